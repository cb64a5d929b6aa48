// The C++ wrapper of what lies inside, of energy and of a family: FAMILY.viscera, its parameter Young's modulus. In
// metres and in turned millimetres all is the same, a copy has a value of its own, and refusals are thrown.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "throws.hpp"

static bool near(double found, double expected, double size, double tolerance = 1e-12) {
    return std::abs(found - expected) <= tolerance * size;
}

int main(int argc, char **argv) {
    if (argc != 2) return 2;
    viscera::Model model(argv[1]);
    if (model.parameter_name() != "young") return 3;
    const viscera_parameter range = model.parameter();
    model.set_parameter(range.low);

    // A copy is as stiff as it is set to; the first stays soft.
    viscera::Model stiff = model.copy();
    stiff.set_parameter(range.high);
    const double high[3] = {0.5, 0.1, 10.0}, push[3] = {0.001, 0.0005, -0.004};
    double top[3], soft_energy, stiff_energy;
    viscera_locate(model.get(), high, top, nullptr);
    if (model.energy(top, push, soft_energy) != VISCERA_OK) return 4;
    if (stiff.energy(top, push, stiff_energy) != VISCERA_OK) return 5;
    if (!near(stiff_energy / soft_energy, range.high / range.low, 1, 0.01)) return 6;
    if (model.parameter().value != range.low || stiff.parameter().value != range.high) return 7;

    // A reflected frame: the caller's x is the mesh's y and y is x; 0.001 m and 0.001 N; the origin at (0.1, 0.2, 0.3) m.
    viscera::Model other = model.copy();
    other.set_frame({0.001, 0.001, {0, 1, 0, 1, 0, 0, 0, 0, 1}, {0.1, 0.2, 0.3}});
    const int axis[3] = {1, 0, 2};
    const double origin[3] = {0.1, 0.2, 0.3};
    double same_top[3], same_push[3], same_energy;
    std::vector<double> inside = {0.5, 0.1, 0.15, 0.45, 0.12, 0.1}, same_inside(6);
    for (int i = 0; i < 3; i++) {
        same_top[i] = 1e3 * (top[axis[i]] - origin[axis[i]]);
        same_push[i] = 1e3 * push[axis[i]];
        for (int k = 0; k < 2; k++) same_inside[3 * k + i] = 1e3 * (inside[3 * k + axis[i]] - origin[axis[i]]);
    }
    if (other.energy(same_top, same_push, same_energy) != VISCERA_OK) return 8;
    if (!near(same_energy, 1e6 * soft_energy, same_energy, 1e-9)) return 9; // mN mm
    // Pa is mN / mm^2 times 1e-3: 1 mN / mm^2 = 1000 Pa.
    if (!near(other.parameter().high, 1e-3 * range.high, 1e-3 * range.high)) return 10;
    other.set_parameter(other.parameter().high);
    double highest;
    other.energy(same_top, same_push, highest);
    if (!near(highest, 1e6 * stiff_energy, highest, 1e-9)) return 11;
    other.set_parameter(other.parameter().low);

    viscera::Places places(model, inside), same(other, same_inside);
    std::vector<double> moved = places.room(), same_moved = same.room();
    if (places.displacement(top, push, moved) != VISCERA_OK) return 12;
    if (same.displacement(same_top, same_push, same_moved) != VISCERA_OK) return 13;
    double size = 0;
    for (double u : moved) size = std::max(size, std::abs(u));
    for (int i = 0; i < 6; i++) {
        if (!near(same_moved[i], 1e3 * moved[3 * (i / 3) + axis[i % 3]], 1e3 * size, 1e-6)) return 14;
    }
    if (!(size > 1e-4)) return 15;

    std::vector<float> workspace = model.field_workspace(), field = model.field_room(), same_field = field;
    if (model.field(top, push, workspace, field) != VISCERA_OK) return 16;
    if (other.field(same_top, same_push, workspace, same_field) != VISCERA_OK) return 17;
    for (size_t i = 0; i < field.size(); i++) {
        if (!near(same_field[i], 1e3 * field[3 * (i / 3) + static_cast<size_t>(axis[i % 3])], 1e3 * size, 1e-5)) return 18;
    }
    viscera::Places nodes(model, std::vector<uint32_t>{7});
    std::vector<double> node = nodes.room();
    if (nodes.displacement(top, push, node) != VISCERA_OK || node[2] != static_cast<double>(field[3 * 7 + 2])) return 19;

    if (!throws([&] { viscera::Places(model, std::vector<double>{0, 0, 9}); }, "outside the organ")) return 20;
    if (!throws([&] { viscera::Places(model, std::vector<double>{0, 0}); }, "2 numbers are no list of points")) return 24;
    if (!throws([&] { viscera::Places(model, std::vector<uint32_t>{1000000}); }, "the organ has nodes")) return 21;
    if (!throws([&] { model.set_parameter(2 * range.high); }, "this model is for")) return 22;
    return model.parameter().value == range.low ? 0 : 23;
}
