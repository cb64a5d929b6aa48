// viscera_hands.hpp: viscera_hands.h for C++11, as viscera.hpp is for viscera.h.
//
// SPDX-License-Identifier: MIT OR Apache-2.0
#ifndef VISCERA_HANDS_HPP
#define VISCERA_HANDS_HPP

#include <exception>
#include <functional>
#include <mutex>

#include "viscera.hpp"
#include "viscera_hands.h"

namespace viscera {

/// A model of several touches, with the settings of Python unless others are given.
class Hands {
public:
    explicit Hands(const Model &model) { make(model, defaults(model)); }
    Hands(const Model &model, const viscera_sampling &sampling) { make(model, sampling); }

    static viscera_sampling defaults(const Model &model) {
        viscera_sampling sampling;
        viscera_sampling_init(model.get(), &sampling);
        return sampling;
    }

    const viscera_hands *get() const { return handle.get(); }

    /// Cauchy stress of each cell, nine numbers, under displacements of all nodes.
    int32_t stress(const std::vector<double> &moved, std::vector<double> &stress) const {
        return viscera_hands_stress(get(), moved.data(), moved.size(), stress.data(), stress.size());
    }
    /// Estimated error of that stress where touches take hold at these points.
    int32_t stress_error(const std::vector<double> &points, const std::vector<double> &moved, double &estimate) const {
        return viscera_hands_stress_error(get(), points.data(), triples(points), moved.data(), moved.size(), &estimate);
    }

private:
    void make(const Model &model, const viscera_sampling &sampling) {
        viscera_hands *made = nullptr;
        Message message = "";
        const int32_t status = viscera_hands_new(model.get(), &sampling, &made, message, sizeof message);
        handle.reset(made);
        if (status != VISCERA_OK) throw Error(status, message);
    }
    struct Free {
        void operator()(viscera_hands *hands) const { viscera_hands_free(hands); }
    };
    std::unique_ptr<viscera_hands, Free> handle;
};

class Held;

/// Contacts that hold the organ, used by one thread at a time.
class Grasp {
public:
    /// Trains before it returns. `go_on`, which may be empty, is called by several threads at once; false cancels, and so
    /// does an exception, which is thrown again from here.
    Grasp(const Hands &hands, const std::vector<double> &points, std::function<bool()> go_on = nullptr) {
        viscera_grasp *made = nullptr;
        Message message = "";
        Question question(go_on);
        const int32_t status = viscera_grasp_new(hands.get(), points.data(), triples(points), go_on ? ask : nullptr,
                                                 &question, &made, message, sizeof message);
        handle.reset(made);
        if (question.thrown) std::rethrow_exception(question.thrown);
        if (status != VISCERA_OK) throw Error(status, message);
    }

    /// Answers at once, and trains while it is in use.
    static Grasp in_background(const Hands &hands, const std::vector<double> &points) {
        Grasp grasp;
        viscera_grasp *made = nullptr;
        Message message = "";
        const int32_t status = viscera_grasp_in_background(hands.get(), points.data(), triples(points), &made, message,
                                                           sizeof message);
        grasp.take(made, status, message);
        return grasp;
    }

    viscera_grasp *get() const { return handle.get(); }

    viscera_grasp_state state() {
        viscera_grasp_state told;
        viscera_grasp_progress(get(), &told);
        return told;
    }

    /// Whether the last answer was wrong, so that there is a snapshot more: solve again, then ask again.
    bool add_snapshot() {
        int32_t added = 0;
        Message message = "";
        const int32_t status = viscera_grasp_add_snapshot(get(), &added, message, sizeof message);
        if (status != VISCERA_OK) throw Error(status, message);
        return added != 0;
    }

    /// `asked` adds up enum viscera_asked.
    int32_t solve(const std::vector<double> &displacements, int32_t asked, double budget, Held &held);

private:
    /// No exception may pass through the library, so the first one waits here.
    struct Question {
        explicit Question(const std::function<bool()> &go_on) : go_on(go_on) {}
        const std::function<bool()> &go_on;
        std::mutex mutex;
        std::exception_ptr thrown;
    };
    Grasp() {}
    static int32_t ask(void *context) noexcept {
        Question &question = *static_cast<Question *>(context);
        try {
            return question.go_on() ? 1 : 0;
        } catch (...) {
            const std::lock_guard<std::mutex> lock(question.mutex);
            if (!question.thrown) question.thrown = std::current_exception();
            return 0;
        }
    }
    void take(viscera_grasp *made, int32_t status, const char *message) {
        handle.reset(made);
        if (status != VISCERA_OK) throw Error(status, message);
    }
    struct Free {
        void operator()(viscera_grasp *grasp) const { viscera_grasp_free(grasp); }
    };
    std::unique_ptr<viscera_grasp, Free> handle;
};

/// An answer of a grasp, with the memory for it; used by one thread at a time.
class Held {
public:
    explicit Held(const Grasp &grasp) {
        viscera_held *made = nullptr;
        Message message = "";
        const int32_t status = viscera_held_new(grasp.get(), &made, message, sizeof message);
        handle.reset(made);
        if (status != VISCERA_OK) throw Error(status, message);
    }

    viscera_held *get() const { return handle.get(); }

    viscera_search search() const {
        viscera_search told;
        viscera_held_search(get(), &told);
        return told;
    }

    int32_t forces(std::vector<double> &forces) const {
        return viscera_held_forces(get(), forces.data(), forces.size());
    }
    int32_t stiffness(std::vector<double> &stiffness) const {
        return viscera_held_stiffness(get(), stiffness.data(), stiffness.size());
    }
    int32_t field(std::vector<double> &moved) const { return viscera_held_field(get(), moved.data(), moved.size()); }
    int32_t surface(std::vector<float> &positions) const {
        return viscera_held_surface(get(), positions.data(), positions.size());
    }
    int32_t places(const Places &places, std::vector<double> &moved) const {
        return viscera_held_places(get(), places.get(), moved.data(), moved.size());
    }

    /// Takes as long as a frame of a simulator.
    int32_t assess(double &error_estimate) const { return viscera_held_assess(get(), &error_estimate); }

private:
    struct Free {
        void operator()(viscera_held *held) const { viscera_held_free(held); }
    };
    std::unique_ptr<viscera_held, Free> handle;
};

inline int32_t Grasp::solve(const std::vector<double> &displacements, int32_t asked, double budget, Held &held) {
    return viscera_grasp_solve(get(), displacements.data(), displacements.size(), asked, budget, held.get());
}

} // namespace viscera

#endif
