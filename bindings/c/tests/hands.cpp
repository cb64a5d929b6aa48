// The C++ wrapper of several touches: in metres and in turned millimetres they feel the same, and refusals are thrown.
#include <cmath>
#include <cstdio>

#include "throws.hpp"
#include "viscera_hands.hpp"

static bool near(double found, double expected, double size) { return std::abs(found - expected) <= 1e-8 * size; }

int main(int argc, char **argv) {
    if (argc != 2) return 2;
    viscera::Model model(argv[1]);
    const std::vector<double> points = {0.36, 0.1, 0.2, 0.64, 0.1, 0.2}, pushes = {0.001, 0, -0.006, 0, 0.001, -0.005};
    viscera_sampling sampling = viscera::Hands::defaults(model);
    sampling.tolerance = 0.001;
    viscera::Hands hands(model, sampling);
    viscera::Grasp grasp(hands, points, [] { return true; });
    viscera::Held held(grasp);
    std::vector<double> forces(6), stiffness(36), moved(3 * model.info().points);
    std::vector<double> stress(9 * viscera_cell_count(model.get()));
    std::vector<float> positions = model.positions();
    if (grasp.solve(pushes, VISCERA_WITH_STIFFNESS, 0, held) != VISCERA_OK) return 3;
    if (held.forces(forces) != VISCERA_OK || held.stiffness(stiffness) != VISCERA_OK) return 4;
    if (held.surface(positions) != VISCERA_OK || held.field(moved) != VISCERA_OK) return 5;
    if (hands.stress(moved, stress) != VISCERA_OK) return 6;
    double error = 1;
    if (hands.stress_error(points, moved, error) != VISCERA_OK || !(error > 0 && error < 0.15)) return 20;
    if (held.assess(error) != VISCERA_OK || !(error < 0.05)) return 7;
    grasp.add_snapshot();
    if (grasp.state().contacts != 2) return 8;

    if (!throws([&] { viscera::Grasp(hands, {0, 0, 9}); }, "contact 0")) return 9;
    if (!throws([&] { viscera::Grasp(hands, points, [] { return false; }); }, "stopped")) return 10;
    if (!throws([&] { viscera::Grasp(hands, {0, 0, 9, 0}); }, "4 numbers are no list of points")) return 16;
    if (!throws([&] { viscera::Grasp::in_background(hands, {0, 0}); }, "2 numbers are no list")) return 17;
    try {
        viscera::Grasp(hands, points, []() -> bool { throw 42; });
        return 18;
    } catch (int thrown) {
        if (thrown != 42) return 19;
    }
    sampling.tolerance = 2;
    if (!throws([&] { viscera::Hands(model, sampling); }, "tolerance 2")) return 11;

    // A reflected frame: the caller's x is the mesh's y and y is x; 0.001 m and 0.001 N; the origin at (0.1, 0.2, 0.3) m.
    viscera::Model other(argv[1]);
    other.set_frame({0.001, 0.001, {0, 1, 0, 1, 0, 0, 0, 0, 1}, {0.1, 0.2, 0.3}});
    sampling = viscera::Hands::defaults(other);
    sampling.tolerance = 0.001;
    viscera::Hands turned(other, sampling);
    const int axis[3] = {1, 0, 2};
    const double origin[3] = {0.1, 0.2, 0.3};
    std::vector<double> there(6), moves(6), felt(6), stiff(36), field(moved.size()), tensor(stress.size());
    for (int k = 0; k < 6; k++) {
        const int from = 3 * (k / 3) + axis[k % 3];
        there[k] = 1e3 * (points[from] - origin[axis[k % 3]]);
        moves[k] = 1e3 * pushes[from];
    }
    viscera::Grasp same = viscera::Grasp::in_background(turned, there);
    viscera::Held also(same);
    if (same.solve(moves, VISCERA_WITH_STIFFNESS, 0, also) != VISCERA_OK) return 12;
    if (also.forces(felt) != VISCERA_OK || also.stiffness(stiff) != VISCERA_OK) return 13;
    if (also.field(field) != VISCERA_OK || turned.stress(field, tensor) != VISCERA_OK) return 14;
    bool agree = near(also.search().energy, 1e6 * held.search().energy, 1e6 * held.search().energy);
    double largest = 0;
    for (double s : stress) largest = std::fmax(largest, std::abs(s));
    for (int k = 0; k < 6; k++) {
        const int from = 3 * (k / 3) + axis[k % 3];
        agree = agree && near(felt[k], 1e3 * forces[from], 1e3 * std::abs(forces[2]));
        for (int l = 0; l < 6; l++) {
            const int column = 3 * (l / 3) + axis[l % 3];
            agree = agree && near(stiff[6 * k + l], stiffness[6 * from + column], stiffness[14]);
        }
    }
    for (std::size_t k = 0; k < tensor.size(); k++) {
        const std::size_t entry = k % 9;
        const double expected = stress[k - entry + 3 * axis[entry / 3] + axis[entry % 3]]; // Pa; mN/mm^2 are kPa
        agree = agree && near(1e3 * tensor[k], expected, largest);
    }
    std::printf("force %.6f N in metres, %.3f mN in millimetres\n", forces[2], felt[2]);
    return agree ? 0 : 15;
}
