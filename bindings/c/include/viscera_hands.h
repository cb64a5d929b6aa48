/* viscera_hands.h: several touches at once, for haptic loops in C and C++.
 *
 * The library libviscera_hands has all of viscera.h and what is below. It is larger, because contacts that take hold
 * are trained on the whole organ, by solvers that libviscera does without. Link one of the two, not both.
 *
 * Each tool holds its contact where the others would move it: the answer is the equilibrium of all contacts together,
 * in a span of modes and on a few weighted cells, as by Touch.galerkin in Python. Vectors of several contacts are
 * three doubles each, one after the other. Units and frame are those that the model had at viscera_hands_new.
 *
 * Calls marked REAL TIME stay on the thread that calls, allocate nothing, take no lock and make no system call.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#ifndef VISCERA_HANDS_H
#define VISCERA_HANDS_H

#include "viscera.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A model of several touches. It keeps a copy of the model that it was made of; any number of grasps can be made of it,
 * by several threads at once. */
typedef struct viscera_hands viscera_hands;

/* Contacts that hold the organ; used by one thread at a time. */
typedef struct viscera_grasp viscera_grasp;

/* An answer of a grasp, with the memory for it. A loop and a thread that draws may exchange several of them. */
typedef struct viscera_held viscera_held;

/* How a model of several touches is made. */
typedef struct viscera_sampling {
    uint64_t order;     /* highest order of the series fields in the basis, at most that of the model */
    uint64_t snapshots; /* largest number of states that a grasp solves on the whole organ, at most 200 */
    double tolerance;   /* error of the forces of the sampled cells in training, relative to those of all cells */
    double depth;       /* largest displacement of a contact in training; beyond it no answer is trusted */
} viscera_sampling;

/* Sizes of a grasp, and how far its training is. */
typedef struct viscera_grasp_state {
    uint64_t contacts;
    uint64_t modes;     /* of the basis */
    uint64_t cells;     /* over which the energy is summed */
    uint64_t snapshots; /* states solved on the whole organ that the modes contain */
    double seconds;     /* from taking hold until the present modes were ready */
    int64_t training;   /* an enum viscera_training */
} viscera_grasp_state;

enum viscera_training {
    VISCERA_TRAINING_OVER = 0,    /* it may go on when the tools move */
    VISCERA_TRAINING_GOES_ON = 1,
    VISCERA_TRAINING_FAILED = 2   /* for lack of memory or threads: what was trained before stays in use */
};

/* How a search for equilibrium went. */
typedef struct viscera_search {
    double energy;            /* reduced strain energy, force unit times length unit */
    double depth;             /* largest displacement of a contact */
    double smallest_jacobian; /* smallest volume ratio of a sampled cell; below 0 it is inside out */
    double residual;          /* last step, relative to the coordinates */
    double seconds;
    uint64_t iterations;
    uint64_t tangents;        /* tangents that were evaluated for them */
} viscera_search;

/* What is asked of viscera_grasp_solve; add them up. */
enum viscera_asked {
    VISCERA_FROM_LAST = 1,     /* start from the last answer, as a moving hand does, and not from the superposed series */
    VISCERA_WITH_STIFFNESS = 2 /* with the stiffness, which takes one more tangent */
};

/* Whether work goes on; 0 cancels it. It is asked before each solution of the whole organ, so it also tells progress. */
typedef int32_t (*viscera_go_on)(void *context);

/* Writes the settings that Python has by default: order 3 or that of the model, no snapshots, tolerance 0.01, the depth
 * of the model. */
int32_t viscera_sampling_init(const viscera_model *model, viscera_sampling *sampling);

/* Makes the model of several touches, at the value that the model is set to now: factorises the tangent of the whole
 * organ. A model without cells, such as the web version, is refused, and so is one of an organ with elastic supports
 * or bonds. On failure *hands is null and `message`, which may be null, says why in one sentence; so it is below. */
int32_t viscera_hands_new(const viscera_model *model, const viscera_sampling *sampling, viscera_hands **hands,
                          char *message, size_t message_len);

/* Frees a model of several touches; null is allowed. Its grasps may live on. */
void viscera_hands_free(viscera_hands *hands);

/* Contacts take hold at `count` points of the touchable surface before a touch, and train until they are ready: some
 * tenths of a second without snapshots, seconds with them. All processors are used. `go_on`, which may be null, is
 * called with `context` by several threads, also at once; when it returns 0, the status is VISCERA_CANCELLED. */
int32_t viscera_grasp_new(const viscera_hands *hands, const double *points, size_t count, viscera_go_on go_on,
                          void *context, viscera_grasp **grasp, char *message, size_t message_len);

/* Contacts take hold as soon as the series alone can answer. Snapshots are then solved by threads of the library, on all
 * processors but one, first in rounds and then where the tools are. The next search takes over what is ready. */
int32_t viscera_grasp_in_background(const viscera_hands *hands, const double *points, size_t count,
                                    viscera_grasp **grasp, char *message, size_t message_len);

/* Lets go; null is allowed. A training in the background ends soon after. */
void viscera_grasp_free(viscera_grasp *grasp);

/* REAL TIME. Sizes and training, told by the thread that uses the grasp. */
int32_t viscera_grasp_progress(viscera_grasp *grasp, viscera_grasp_state *state);

/* Compares the last answer with the nearest equilibrium of the whole organ and adds a snapshot if they differ; `added`,
 * which may be null, is then 1: solve again. Without a new answer nothing more is added. A grasp in the background does
 * so by itself, and refuses. */
int32_t viscera_grasp_add_snapshot(viscera_grasp *grasp, int32_t *added, char *message, size_t message_len);

/* Memory for an answer of this grasp, and of no other; it may outlive the grasp. It is used by one thread at a time. */
int32_t viscera_held_new(const viscera_grasp *grasp, viscera_held **held, char *message, size_t message_len);

/* Frees an answer; null is allowed. */
void viscera_held_free(viscera_held *held);

/* REAL TIME. The equilibrium under `displacements` of all contacts. `asked` adds up enum viscera_asked. When `budget`
 * seconds are over (0: no limit), the search ends, and the next one with VISCERA_FROM_LAST goes on; one step is always
 * taken. The status is for viscera_guard_step:
 * - VISCERA_OK: an equilibrium of the model. How near it is to that of the whole organ, viscera_held_assess tells, which
 *   takes longer than a tick: let another thread ask now and then. If the last equilibrium that was assessed is not
 *   trusted, its status takes the place of VISCERA_OK until one is.
 * - VISCERA_BEYOND_DEPTH, VISCERA_NOT_CONVERGED, VISCERA_OUT_OF_TIME, VISCERA_INVERTED: not trusted.
 * - Any other: there is no answer, with VISCERA_BAD_SETTING because the memory is that of another grasp, or `asked` or
 *   `budget` is not one of those above. */
int32_t viscera_grasp_solve(viscera_grasp *grasp, const double *displacements, size_t displacements_len, int32_t asked,
                            double budget, viscera_held *held);

/* REAL TIME. Reads an answer; each returns the status of the last viscera_grasp_solve, also of one that was refused, and
 * VISCERA_NOT_CONVERGED before the first. Without an answer the numbers are zero. With VISCERA_NOT_FINITE they may also
 * have overflowed in the caller's units. Lengths count numbers.
 * - forces: of each tool on the organ, three doubles for each contact.
 * - stiffness: derivative of the forces with respect to the displacements, row by row, (3 contacts)^2 doubles; with
 *   VISCERA_BAD_SETTING it was not asked for.
 * - field: displacement of all nodes, three doubles each.
 * - surface: positions of the deformed surface nodes, three floats each, as by viscera_surface.
 * - places: displacement of places of the same organ, three doubles each; with VISCERA_BAD_SETTING they are places in
 *   another mesh, and the numbers are zero.
 * The last three cost as much as modes times nodes. */
int32_t viscera_held_search(const viscera_held *held, viscera_search *search);
int32_t viscera_held_forces(const viscera_held *held, double *forces, size_t forces_len);
int32_t viscera_held_stiffness(const viscera_held *held, double *stiffness, size_t stiffness_len);
int32_t viscera_held_field(const viscera_held *held, double *moved, size_t moved_len);
int32_t viscera_held_surface(const viscera_held *held, float *positions, size_t positions_len);
int32_t viscera_held_places(const viscera_held *held, const viscera_places *places, double *moved, size_t moved_len);

/* Estimates the error of an answer, the larger of the relative errors of its forces and its field, by two Newton steps
 * of the whole organ, and tells what the answer is worth: VISCERA_OK if it is trusted, VISCERA_ERROR_TOO_LARGE,
 * VISCERA_UNSTABLE or a status of the search if not. It takes as long as a frame of a simulator. A loop may go on
 * meanwhile, with another answer. */
int32_t viscera_held_assess(const viscera_held *held, double *error_estimate);

/* Cauchy stress of each cell (force per area), nine doubles row by row, the mean over its points, under displacements of
 * all nodes: those of viscera_held_field, or of viscera_field for a single touch. With VISCERA_INVERTED a cell is inside
 * out, and the stress is zero. In nearly incompressible tissue the pressure in it feels errors of the displacements that
 * force, shape, von Mises stress and the error estimate do not: viscera_hands_stress_error tells how much. */
int32_t viscera_hands_stress(const viscera_hands *hands, const double *moved, size_t moved_len, double *stress,
                             size_t stress_len);

/* Estimates the error of that stress and of its pressure, relative to their norm, by what the stress leaves unbalanced at
 * nodes that are neither fixed nor touched: stress_error_estimate in Python. `points` are those where the touches take
 * hold, three doubles for each contact. VISCERA_OK up to 0.15; above, VISCERA_ERROR_TOO_LARGE says that the pressure is
 * not to be relied on. Without an estimate it is 1: VISCERA_INVERTED where a cell is inside out, VISCERA_OFF_SURFACE where
 * a point is not on the touchable surface. */
int32_t viscera_hands_stress_error(const viscera_hands *hands, const double *points, size_t contacts, const double *moved,
                                   size_t moved_len, double *error_estimate);

/* REAL TIME. Von Mises stress, sqrt(3/2 s : s) with the deviator s, of `count` stresses. With VISCERA_NOT_FINITE one of them
 * is not finite, or too large, and all are zero. */
int32_t viscera_von_mises(const double *stress, size_t count, double *von_mises);

#if defined(__cplusplus) ? __cplusplus >= 201103L : (defined(__STDC_VERSION__) && __STDC_VERSION__ >= 201112L)
#ifdef __cplusplus
#define VISCERA_ASSERT(claim) static_assert(claim, "viscera_hands.h: a struct is not laid out as in the library")
#else
#define VISCERA_ASSERT(claim) _Static_assert(claim, "viscera_hands.h: a struct is not laid out as in the library")
#endif
VISCERA_ASSERT(sizeof(viscera_sampling) == 32);
VISCERA_ASSERT(sizeof(viscera_grasp_state) == 48);
VISCERA_ASSERT(sizeof(viscera_search) == 56);
#undef VISCERA_ASSERT
#endif

#ifdef __cplusplus
}
#endif

#endif
