// The C++ wrapper: a probe in metres and in turned millimetres feels the same, and refusals are thrown.
#include <cmath>
#include <cstdio>

#include "throws.hpp"

static bool near(double found, double expected, double size) { return std::abs(found - expected) <= 1e-9 * size; }

int main(int argc, char **argv) {
    if (argc != 2) return 2;
    viscera::Model model(argv[1]);
    const viscera_info_t info = model.info();
    const double far[3] = {0.4, 0.1, 10.0};
    double top[3];
    viscera_locate(model.get(), far, top, nullptr);

    viscera::Probe probe(model, info.radius, 0.3);
    viscera_felt felt, turned;
    const double centers[2][3] = {{top[0], top[1], top[2] + 0.95 * info.radius},
                                  {top[0] + 0.05 * info.radius, top[1], top[2] + 0.93 * info.radius}};
    for (const auto &center : centers) {
        if (probe.place(center, felt) != VISCERA_OK) return 3;
    }
    std::vector<float> workspace = model.workspace(), positions = model.positions();
    if (model.surface(felt.contact_point, felt.displacement, workspace, positions) != VISCERA_OK) return 4;

    if (!throws([] { viscera::Model("nowhere.viscera"); }, "nowhere.viscera")) return 5;
    const std::string deep = std::string(600, 'x') + "/nowhere.viscera";
    if (!throws([&] { viscera::Model model(deep); }, (deep + ": ").c_str())) return 13;
    if (!throws([&] { viscera::Probe(model, 0.1 * info.radius, 0.3); }, "radius of a probe")) return 6;
    if (!throws([&] { probe.couple(-1, 0); }, "stiffness -1 and damping 0; the stiffness must be above 0")) return 7;
    if (!throws([&] { probe.couple(1, -1); }, "damping -1; the stiffness must be above 0, the damping at least 0")) return 14;
    if (!throws([&] { probe.couple(NAN, 1); }, "stiffness nan")) return 15;
    if (!throws([&] { probe.tolerate(0); }, "tolerance of a probe is 0; it must be above 0 and at most 1")) return 16;
    viscera_frame frame;
    viscera_frame_identity(&frame);
    frame.metres_per_unit = 0;
    if (!throws([&] { model.set_frame(frame); }, "0 m and 1 N per unit")) return 17;
    frame.metres_per_unit = 1;
    frame.rotation[4] = 2;
    if (!throws([&] { model.set_frame(frame); }, "(1, 0, 0, 0, 2, 0, 0, 0, 1) must be orthogonal")) return 18;
    frame.rotation[4] = 1;
    frame.translation[2] = INFINITY;
    if (!throws([&] { model.set_frame(frame); }, "translation (0, 0, inf) must be finite")) return 19;

    // One alone in a group feels what it feels by itself.
    {
        viscera::Probe again(model, info.radius, 0.3);
        viscera::Probes group({&again});
        for (const auto &center : centers) {
            if (group.place(center) != VISCERA_OK || group.status[0] != VISCERA_OK) return 10;
        }
        if (group.felt[0].force[2] != felt.force[2]) return 11;
        if (!throws([&] { viscera::Probes({&again, &again}); }, "in it twice")) return 12;
    }

    // A reflected frame: the caller's x is the mesh's y and y is x; 0.001 m and 0.001 N; the origin at (0.1, 0.2, 0.3) m.
    viscera::Model other(argv[1]);
    other.set_frame({0.001, 0.001, {0, 1, 0, 1, 0, 0, 0, 0, 1}, {0.1, 0.2, 0.3}});
    viscera::Probe same(other, 1e3 * info.radius, 0.3);
    for (const auto &center : centers) {
        const double x[3] = {1e3 * (center[1] - 0.2), 1e3 * (center[0] - 0.1), 1e3 * (center[2] - 0.3)};
        if (same.place(x, turned) != VISCERA_OK) return 8;
    }
    const int axis[3] = {1, 0, 2};
    const double force = std::abs(felt.force[2]);
    bool agree = near(turned.gap, 1e3 * felt.gap, info.radius);
    for (int i = 0; i < 3; i++) {
        agree = agree && near(turned.force[i], 1e3 * felt.force[axis[i]], 1e3 * force);
        // A reflection turns a torque over: mN mm.
        agree = agree && near(turned.torque[i], -1e6 * felt.torque[axis[i]], 1e6 * force * info.radius);
        agree = agree && near(turned.displacement[i], 1e3 * felt.displacement[axis[i]], 1e3 * info.radius);
    }
    std::printf("force %.6f N in metres, %.3f mN in millimetres\n", felt.force[2], turned.force[2]);
    return agree && std::abs(felt.torque[1]) > 0.0 ? 0 : 9;
}
