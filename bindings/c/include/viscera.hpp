// viscera.hpp: viscera.h for C++11. Handles free themselves; what cannot be made throws; a tick neither throws nor
// allocates, and returns the status of viscera.h.
//
// SPDX-License-Identifier: MIT OR Apache-2.0
#ifndef VISCERA_HPP
#define VISCERA_HPP

#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "viscera.h"

namespace viscera {

/// A refused file, frame or setting; `status` is an enum viscera_status.
class Error : public std::runtime_error {
public:
    Error(int32_t status, const char *message)
        : std::runtime_error(message && *message ? message : viscera_status_text(status)), status(status) {}
    const int32_t status;
};

/// Room for the sentence of a refusal.
using Message = char[1024];

/// Numbers as an `Error` names them: `0.5`, or `(1, 0, 0)`.
inline std::string named(double number) {
    char text[32];
    std::snprintf(text, sizeof text, "%g", number);
    return text;
}
template <size_t Count> std::string named(const double (&numbers)[Count]) {
    std::string text;
    for (double number : numbers) text += (text.empty() ? "(" : ", ") + named(number);
    return text + ")";
}

/// How many points there are in a list of three numbers each.
inline size_t triples(const std::vector<double> &points) {
    if (points.size() % 3 == 0) return points.size() / 3;
    const std::string count = std::to_string(points.size());
    throw Error(VISCERA_SHORT_BUFFER, (count + " numbers are no list of points, which have three each").c_str());
}

/// A loaded model. It must outlive its probes and places.
class Model {
public:
    explicit Model(const std::string &path) {
        viscera_model *loaded = nullptr;
        Message message = "";
        const int32_t status = viscera_load_file(path.c_str(), &loaded, message, sizeof message);
        handle.reset(loaded);
        if (status != VISCERA_OK) throw Error(status, message);
    }

    const viscera_model *get() const { return handle.get(); }

    viscera_info_t info() const {
        viscera_info_t sizes;
        viscera_info(get(), &sizes);
        return sizes;
    }

    void set_frame(const viscera_frame &frame) {
        const int32_t status = viscera_set_frame(handle.get(), &frame);
        if (status == VISCERA_OK) return;
        std::string why = "a frame of " + named(frame.metres_per_unit) + " m and " + named(frame.newtons_per_unit);
        why += " N per unit is refused: both must be above 0 and finite, its rotation " + named(frame.rotation);
        why += " must be orthogonal to within 1e-6, its translation " + named(frame.translation) + " must be finite";
        throw Error(status, why.c_str());
    }

    /// The workspace of `surface`; make it before the loop.
    std::vector<float> workspace() const { return std::vector<float>(viscera_workspace_size(get())); }

    /// Room for the positions of `surface`; make it before the loop.
    std::vector<float> positions() const { return std::vector<float>(3 * static_cast<size_t>(info().surface_nodes)); }

    int32_t evaluate(const double (&point)[3], const double (&displacement)[3], viscera_answer &answer) const {
        return viscera_evaluate(get(), point, displacement, &answer);
    }

    int32_t energy(const double (&point)[3], const double (&displacement)[3], double &energy) const {
        return viscera_energy(get(), point, displacement, &energy);
    }

    int32_t surface(const double (&point)[3], const double (&displacement)[3], std::vector<float> &workspace,
                    std::vector<float> &positions) const {
        return viscera_surface(get(), point, displacement, workspace.data(), workspace.size(), positions.data(),
                               positions.size());
    }

    /// The workspace of `field`; make it before the loop.
    std::vector<float> field_workspace() const { return std::vector<float>(viscera_field_workspace_size(get())); }

    /// Room for the displacement of all nodes by `field`; make it before the loop.
    std::vector<float> field_room() const { return std::vector<float>(3 * static_cast<size_t>(info().points)); }

    int32_t field(const double (&point)[3], const double (&displacement)[3], std::vector<float> &workspace,
                  std::vector<float> &moved) const {
        return viscera_field(get(), point, displacement, workspace.data(), workspace.size(), moved.data(),
                             moved.size());
    }

    /// Name of the parameter that the model covers a range of; empty if there is none.
    std::string parameter_name() const { return viscera_parameter_name(get()); }

    viscera_parameter parameter() const {
        viscera_parameter range;
        const int32_t status = viscera_get_parameter(get(), &range);
        if (status != VISCERA_OK) throw Error(status, "this model has no parameter");
        return range;
    }

    /// Not in a loop, and while nobody else uses the model.
    void set_parameter(double value) {
        Message message = "";
        const int32_t status = viscera_set_parameter(handle.get(), value, message, sizeof message);
        if (status != VISCERA_OK) throw Error(status, message);
    }

    /// With the frame and the value of the parameter; places and probes stay with the first.
    Model copy() const {
        viscera_model *copied = nullptr;
        Message message = "";
        const int32_t status = viscera_copy(get(), &copied, message, sizeof message);
        if (status != VISCERA_OK) throw Error(status, message);
        return Model(copied);
    }

private:
    explicit Model(viscera_model *owned) : handle(owned) {}
    struct Free {
        void operator()(viscera_model *model) const { viscera_free(model); }
    };
    std::unique_ptr<viscera_model, Free> handle;
};

/// Places in the organ of a model, which must outlive them; used by one thread at a time.
class Places {
public:
    /// Of points of the organ before a touch, three numbers each.
    Places(const Model &model, const std::vector<double> &points) : count(triples(points)) {
        viscera_places *made = nullptr;
        Message message = "";
        const int32_t status = viscera_places_at(model.get(), points.data(), count, &made, message, sizeof message);
        take(made, status, message);
    }

    /// Of nodes.
    Places(const Model &model, const std::vector<uint32_t> &nodes) : count(nodes.size()) {
        viscera_places *made = nullptr;
        Message message = "";
        const int32_t status =
            viscera_places_of_nodes(model.get(), nodes.data(), count, &made, message, sizeof message);
        take(made, status, message);
    }

    const viscera_places *get() const { return handle.get(); }

    /// Room for the displacements; make it before the loop.
    std::vector<double> room() const { return std::vector<double>(3 * count); }

    int32_t displacement(const double (&point)[3], const double (&displacement)[3], std::vector<double> &moved) {
        return viscera_places_displacement(handle.get(), point, displacement, moved.data(), moved.size());
    }

private:
    void take(viscera_places *made, int32_t status, const char *message) {
        handle.reset(made);
        if (status != VISCERA_OK) throw Error(status, message);
    }
    struct Free {
        void operator()(viscera_places *places) const { viscera_places_free(places); }
    };
    std::size_t count;
    std::unique_ptr<viscera_places, Free> handle;
};

/// A rigid sphere on the surface of a model, used by one thread at a time.
class Probe {
public:
    Probe(const Model &model, double radius, double friction) {
        viscera_probe *made = nullptr;
        Message message = "";
        const int32_t status = viscera_probe_new(model.get(), radius, friction, &made, message, sizeof message);
        handle.reset(made);
        if (status != VISCERA_OK) throw Error(status, message);
    }

    void couple(double stiffness, double damping) {
        const int32_t status = viscera_probe_couple(handle.get(), stiffness, damping);
        if (status == VISCERA_OK) return;
        std::string why = "the coupling of a probe has stiffness " + named(stiffness) + " and damping " + named(damping);
        why += "; the stiffness must be above 0, the damping at least 0, both finite";
        throw Error(status, why.c_str());
    }

    void tolerate(double tolerance) {
        const int32_t status = viscera_probe_tolerate(handle.get(), tolerance);
        if (status == VISCERA_OK) return;
        const std::string given = "the tolerance of a probe is " + named(tolerance);
        throw Error(status, (given + "; it must be above 0 and at most 1").c_str());
    }

    void lift() { viscera_probe_lift(handle.get()); }

    int32_t place(const double (&center)[3], viscera_felt &felt) {
        return viscera_probe_place(handle.get(), center, &felt);
    }

    int32_t follow(const double (&device)[3], double dt, viscera_felt &felt) {
        return viscera_probe_follow(handle.get(), device, dt, &felt);
    }

    viscera_probe *get() const { return handle.get(); }

private:
    struct Free {
        void operator()(viscera_probe *probe) const { viscera_probe_free(probe); }
    };
    std::unique_ptr<viscera_probe, Free> handle;
};

/// A group of probes on one model that feel each other, used by one thread at a time. The probes must outlive the group.
class Probes {
public:
    explicit Probes(const std::vector<const Probe *> &probes) : felt(probes.size()), status(probes.size()) {
        std::vector<viscera_probe *> each;
        for (const Probe *probe : probes) each.push_back(probe ? probe->get() : nullptr);
        viscera_probes *made = nullptr;
        Message message = "";
        const int32_t told = viscera_probes_new(each.data(), each.size(), &made, message, sizeof message);
        handle.reset(made);
        if (told != VISCERA_OK) throw Error(told, message);
    }

    /// Centres of all probes, three numbers for each; what they feel is in `felt` and `status`.
    int32_t place(const double *centers) {
        return viscera_probes_place(handle.get(), centers, felt.data(), status.data());
    }

    int32_t follow(const double *devices, double dt) {
        return viscera_probes_follow(handle.get(), devices, dt, felt.data(), status.data());
    }

    std::vector<viscera_felt> felt;
    std::vector<int32_t> status;

private:
    struct Free {
        void operator()(viscera_probes *group) const { viscera_probes_free(group); }
    };
    std::unique_ptr<viscera_probes, Free> handle;
};

} // namespace viscera

#endif
