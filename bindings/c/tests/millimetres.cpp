// The header in C++, and a frame: the same touch in metres and in turned millimetres and millinewtons.
#include <cmath>
#include <cstdio>
#include <memory>
#include <type_traits>

#include "viscera.h"

static_assert(std::is_standard_layout<viscera_answer>::value, "an answer is plain data");
static_assert(offsetof(viscera_answer, contact_point) == 112, "the contact point comes last");
static_assert(offsetof(viscera_frame, translation) == 88, "the translation comes last");
static_assert(offsetof(viscera_guard, energy) == 112, "the energy comes last");
static_assert(offsetof(viscera_felt, grip) == 144, "the grip comes last");
static_assert(sizeof(struct viscera_info) == 56 && offsetof(struct viscera_info, radius) == 32, "counts come first");

struct Free {
    void operator()(viscera_model *model) const { viscera_free(model); }
};

static bool near(double found, double expected, double size) { return std::abs(found - expected) <= 1e-9 * size; }

int main(int argc, char **argv) {
    viscera_model *loaded = nullptr;
    if (argc != 2 || viscera_load_file(argv[1], &loaded, nullptr, 0) != VISCERA_OK) return 2;
    const std::unique_ptr<viscera_model, Free> model(loaded);

    const double above[3] = {0.4, 0.1, 10.0};
    double x[3];
    viscera_locate(model.get(), above, x, nullptr);
    viscera_info_t metres;
    viscera_info(model.get(), &metres);
    const double d[3] = {0.1 * metres.depth, -0.05 * metres.depth, -0.3 * metres.depth};
    viscera_answer in_metres;
    if (viscera_evaluate(model.get(), x, d, &in_metres) != VISCERA_OK) return 3;

    // Caller's x is the mesh's z, y is x, z is y; 0.001 m and 0.001 N; the origin lies at (0.1, 0.2, 0.3) m.
    const viscera_frame frame = {0.001, 0.001, {0, 1, 0, 0, 0, 1, 1, 0, 0}, {0.1, 0.2, 0.3}};
    if (viscera_set_frame(model.get(), &frame) != VISCERA_OK) return 4;
    const double turned_x[3] = {1e3 * (x[2] - 0.3), 1e3 * (x[0] - 0.1), 1e3 * (x[1] - 0.2)};
    const double turned_d[3] = {1e3 * d[2], 1e3 * d[0], 1e3 * d[1]};
    viscera_answer turned;
    if (viscera_evaluate(model.get(), turned_x, turned_d, &turned) != VISCERA_OK) return 5;
    viscera_info_t millimetres;
    viscera_info(model.get(), &millimetres);

    const int axis[3] = {2, 0, 1};
    bool agree = near(millimetres.depth, 1e3 * metres.depth, 1e3 * metres.depth);
    for (int i = 0; i < 3; i++) {
        agree = agree && near(turned.force[i], 1e3 * in_metres.force[axis[i]], 1e3 * std::abs(in_metres.force[2]));
        agree = agree && near(turned.contact_point[i], turned_x[i], 1e3);
        for (int j = 0; j < 3; j++) {
            // N/m and mN/mm are the same number.
            agree = agree && near(turned.stiffness[3 * i + j], in_metres.stiffness[3 * axis[i] + axis[j]],
                                  std::abs(in_metres.stiffness[8]));
        }
    }
    std::printf("force %.6f N in metres, %.3f mN in millimetres\n", in_metres.force[2], turned.force[0]);
    return agree ? 0 : 6;
}
