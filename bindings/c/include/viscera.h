/* viscera.h: evaluates reduced models of soft organs in microseconds, for haptic loops in C and C++.
 *
 * A touch is a contact point on the organ's surface at rest, and the displacement of the tool from there. The answer
 * is the force of the tool on the organ (the hand feels its negative), the stiffness, which is the derivative of that
 * force, and an estimate of its error.
 *
 * Lengths and forces are metres and newtons in the frame of the mesh unless viscera_set_frame says otherwise. Vectors
 * are three doubles, matrices nine row by row. A null pointer is reported, never followed.
 *
 * Calls marked REAL TIME allocate nothing, take no lock, make no system call and write no log. Several threads may
 * make them on one model at once; loading, viscera_set_frame, viscera_set_parameter and viscera_free need the model to
 * themselves.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#ifndef VISCERA_H
#define VISCERA_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Compare with viscera_abi_version() once at the start: the two differ if header and library do not belong together. */
#define VISCERA_ABI_VERSION 3

/* Status of a call. The first three come with an answer; only the answer of VISCERA_OK is trusted. */
enum viscera_status {
    VISCERA_OK = 0,
    VISCERA_BEYOND_DEPTH = 1,    /* the displacement exceeds the depth that the model was made for */
    VISCERA_ERROR_TOO_LARGE = 2, /* the estimated error is larger than allowed at this depth */
    VISCERA_OFF_SURFACE = 3,     /* nothing is touched: a point is more than an edge length off the touchable surface, or a
                                  * probe does not reach it */
    VISCERA_NOT_FINITE = 4,      /* an input is infinite or not a number, or the answer overflowed */
    VISCERA_NULL_POINTER = 5,
    VISCERA_SHORT_BUFFER = 6,
    VISCERA_BAD_MODEL = 7,       /* the file cannot be read, or file or bytes hold no usable model */
    VISCERA_BAD_SETTING = 8,     /* a setting is out of the range that is stated where it is set */
    VISCERA_STALE = 9,           /* passed to viscera_guard_step by a loop that has no new answer */
    VISCERA_INSIDE = 10,         /* a probe came into the organ in one step: no force until it is lifted off */
    /* Of several touches (viscera_hands.h); the first four come with an answer that is not trusted. */
    VISCERA_NOT_CONVERGED = 11,  /* no equilibrium was found */
    VISCERA_OUT_OF_TIME = 12,    /* the time for the search was over before there was an equilibrium */
    VISCERA_INVERTED = 13,       /* a cell is inside out */
    VISCERA_UNSTABLE = 14,       /* the whole organ would not stay there */
    VISCERA_CANCELLED = 15       /* the caller has cancelled */
};

typedef struct viscera_model viscera_model;

typedef struct viscera_info {
    uint64_t points;            /* nodes of the organ */
    uint64_t surface_nodes;     /* nodes of its boundary */
    uint64_t surface_triangles; /* triangles of its boundary */
    uint64_t positions;         /* nodes where touches were solved off-line */
    double radius;              /* of the contact patch */
    double depth;               /* largest displacement the model was made for */
    double edge_length;         /* mean edge of the touchable triangles: a touch may be this far off the surface */
} viscera_info_t;

typedef struct viscera_answer {
    double force[3];         /* of the tool on the organ */
    double stiffness[9];     /* dF_i / dd_j, the derivative of this force; its own error is larger and not estimated */
    double error_estimate;   /* of the force, relative to its norm; at most 1 */
    double shape_error_estimate; /* of the deformed organ, relative to its displacement; at most 1 */
    double contact_point[3]; /* the touched point of the surface at rest */
} viscera_answer;

/* The caller's frame: x_mesh [m] = metres_per_unit * rotation * x + translation. Both units are above 0 and finite, and
 * the translation is finite. The rotation is orthogonal to within 1e-6: no entry of rotation * transposed rotation is
 * farther from the identity. A reflection is allowed, for left-handed engines. */
typedef struct viscera_frame {
    double metres_per_unit;  /* 0.001 for millimetres */
    double newtons_per_unit; /* 1 for newtons */
    double rotation[9];
    double translation[3];   /* [m] */
} viscera_frame;

/* Limits the force that is sent to a device. The caller owns it; viscera_guard_init sets it up. The state may be read
 * at any time. Write only the four settings and, through viscera_guard_keep_passive, energy_limit and damping. */
typedef struct viscera_guard {
    double force_limit;  /* setting: largest output force */
    double rate_limit;   /* setting: largest change of the output force per second */
    double watchdog;     /* setting: longest time without an answer before the force fades [s] */
    double fade;         /* setting: time in which the force then fades to zero [s] */
    double force[3];     /* state: last output force */
    double target[3];    /* state: last trusted force */
    double age;          /* state: age of the last answer [s] */
    double fade_rate;    /* state: decrease of the force per second while it fades */
    double energy_limit; /* largest debt: energy given out beyond what came in; 0: energy is not counted */
    double damping;      /* largest damping that pays a debt, force per velocity */
    double energy;       /* state: energy that the hand has put into the organ since it touched; negative: a debt */
} viscera_guard;

/* What a guard did at a step. */
enum viscera_guard_mode {
    VISCERA_GUARD_FOLLOWS = 0, /* the output force is the input force */
    VISCERA_GUARD_LIMITS = 1,  /* the rate limit delays the force, or the force limit shortens it */
    VISCERA_GUARD_HOLDS = 2,   /* there is no trusted answer: the last trusted force stays */
    VISCERA_GUARD_FADES = 3,   /* no answer, or a faulty one: the force fades to zero */
    VISCERA_GUARD_REFUSES = 4, /* the guard is null, or a setting or the time step is out of range: no force */
    VISCERA_GUARD_DAMPS = 5    /* there is an energy debt: the force is damped, or reduced to the allowed force */
};

/* Messages are in SI units and in the axes of the mesh, whatever frame the caller has set. */

/* The interface version of the library. */
uint32_t viscera_abi_version(void);

/* Text of a status. It is never null; do not free it. */
const char *viscera_status_text(int32_t status);

/* Reads a model from the bytes of a *.viscera file (they are copied) or from the file itself. On failure *model is
 * null and `message`, which may be null, says why in one sentence. If path and reason do not fit in the message, the
 * path loses its beginning. Damaged files are refused. After VISCERA_OK the message is empty, or warns that a file of
 * format version 1 has no checksums that would show damage. */
int32_t viscera_load(const uint8_t *bytes, size_t len, viscera_model **model, char *message, size_t message_len);
int32_t viscera_load_file(const char *path, viscera_model **model, char *message, size_t message_len);

/* Frees a model; null is allowed. */
void viscera_free(viscera_model *model);

/* Sizes of a model, in the caller's units. */
int32_t viscera_info(const viscera_model *model, viscera_info_t *info);

/* Writes the default frame, which is that of the mesh in SI units. Change what differs, then set it. */
void viscera_frame_identity(viscera_frame *frame);

/* Sets the frame of all inputs and outputs. With VISCERA_BAD_SETTING, for a frame out of the ranges above, the old
 * one stays. No other call may use the model meanwhile. */
int32_t viscera_set_frame(viscera_model *model, const viscera_frame *frame);

/* REAL TIME. The touchable point at rest closest to `point`, and its distance; either output may be null. With any
 * status but VISCERA_OK nothing is written. */
int32_t viscera_locate(const viscera_model *model, const double point[3], double contact_point[3], double *distance);

/* REAL TIME. The answer to a touch. With VISCERA_OK the force is trusted. With VISCERA_BEYOND_DEPTH and
 * VISCERA_ERROR_TOO_LARGE there is a force, but it is not trusted. With any other status force and stiffness are zero,
 * and the error estimates are 1. */
int32_t viscera_evaluate(const viscera_model *model, const double point[3], const double displacement[3],
                         viscera_answer *answer);

/* REAL TIME. The energy that a touch has put into the organ: the work of its force on the straight way to the
 * displacement, in force unit times length unit. The status is that of viscera_evaluate; without a force the energy is
 * zero. */
int32_t viscera_energy(const viscera_model *model, const double point[3], const double displacement[3],
                       double *energy);

/* Number of floats of workspace that viscera_surface needs. */
size_t viscera_workspace_size(const viscera_model *model);

/* REAL TIME. Writes the positions of the deformed surface nodes, three floats each; `positions` has room for at least
 * 3 * surface_nodes floats. The status is that of the shape, whose estimated error differs from that of the force: a
 * compressed model may give a trusted force and an untrusted shape. If there is no answer, the positions are those at
 * rest. With VISCERA_NULL_POINTER and VISCERA_SHORT_BUFFER nothing is written. Workspace and positions must not
 * overlap. Lengths count floats. */
int32_t viscera_surface(const viscera_model *model, const double point[3], const double displacement[3],
                        float *workspace, size_t workspace_len, float *positions, size_t positions_len);

/* Writes the triangles of the surface, and the mesh node of each row of viscera_surface. The corners of the triangles
 * are such rows, counter-clockwise seen from outside in the caller's frame. Either output may be null; lengths count
 * integers. */
int32_t viscera_surface_topology(const viscera_model *model, uint32_t *triangles, size_t triangles_len,
                                 uint32_t *nodes, size_t nodes_len);

/* Number of cells of the mesh; 0 for a model that keeps nothing of what lies inside. */
size_t viscera_cell_count(const viscera_model *model);

/* Writes the mesh before a touch: its nodes, three doubles each, and the corners of its cells, four nodes each; a
 * quadratic element has its other nodes on the edges of the cells. Either output may be null; lengths count numbers. */
int32_t viscera_mesh(const viscera_model *model, double *points, size_t points_len, uint32_t *cells, size_t cells_len);

/* Number of floats of workspace that viscera_field needs. */
size_t viscera_field_workspace_size(const viscera_model *model);

/* REAL TIME. Writes the displacement of all nodes (not their positions), three floats each; `moved` has room for at
 * least 3 * points floats. Status, workspace and lengths are as for viscera_surface; if there is no answer, nothing
 * has moved. */
int32_t viscera_field(const viscera_model *model, const double point[3], const double displacement[3],
                      float *workspace, size_t workspace_len, float *moved, size_t moved_len);

/* Places in the organ, such as those of a vessel or a tumour, whose displacement a touch tells. */
typedef struct viscera_places viscera_places;

/* Makes places of `count` points of the organ before a touch, three doubles each, or of `count` nodes. A point outside
 * all cells is refused with VISCERA_BAD_SETTING. The model must be freed after the places. On failure *places is null
 * and `message`, which may be null, says why in one sentence. Places are used by one thread at a time. */
int32_t viscera_places_at(const viscera_model *model, const double *points, size_t count, viscera_places **places,
                          char *message, size_t message_len);
int32_t viscera_places_of_nodes(const viscera_model *model, const uint32_t *nodes, size_t count,
                                viscera_places **places, char *message, size_t message_len);

/* Frees places; null is allowed. */
void viscera_places_free(viscera_places *places);

/* REAL TIME. Writes the displacement of each place under a touch, three doubles each; `moved_len` counts doubles. It
 * costs as little as the places are few. The status is that of the shape, as for viscera_surface; if there is no
 * answer, nothing has moved. */
int32_t viscera_places_displacement(viscera_places *places, const double point[3], const double displacement[3],
                                    double *moved, size_t moved_len);

/* The parameter of a model that was made for a range of it, in the caller's units. */
typedef struct viscera_parameter {
    double low;
    double high;
    double value; /* that the model is set to */
} viscera_parameter;

/* Name of the parameter: "young" (a force per area), "poisson" (a number) or "radius" (a length: that of the contact
 * patch); empty if the model has none, never null. It lives as long as the model. */
const char *viscera_parameter_name(const viscera_model *model);

/* Range and value of the parameter; VISCERA_BAD_SETTING if the model has none. */
int32_t viscera_get_parameter(const viscera_model *model, viscera_parameter *parameter);

/* Sets the model to a value of its parameter: all answers are then those of that value. After VISCERA_BAD_SETTING the
 * old value stays, and `message`, which may be null, says why. It allocates, and takes longer than a tick: no other
 * call may use the model meanwhile, so a running loop gets a copy that another thread has set. Places stay valid; with
 * another radius, make probes anew. */
int32_t viscera_set_parameter(viscera_model *model, double value, char *message, size_t message_len);

/* Copies a model with its frame and its value of the parameter. Places and probes stay with the first. On failure
 * *copy is null. */
int32_t viscera_copy(const viscera_model *model, viscera_model **copy, char *message, size_t message_len);

/* Sets up a guard without force. All four settings must be above 0 and finite. After VISCERA_BAD_SETTING the guard
 * never gives a force. */
int32_t viscera_guard_init(viscera_guard *guard, double force_limit, double rate_limit, double watchdog, double fade);

/* REAL TIME. The force to send to the device, `dt` seconds after the last step; returns an enum viscera_guard_mode.
 * `force_in` and `force_out` may be the same. The force depends on the status:
 * - VISCERA_OK: the force follows `force_in` within the limits.
 * - VISCERA_BEYOND_DEPTH, VISCERA_ERROR_TOO_LARGE, and VISCERA_NOT_CONVERGED to VISCERA_UNSTABLE: the last trusted
 *   force stays, because a series beyond its range may pull.
 * - VISCERA_OFF_SURFACE: the tool is free of the organ, and the force goes to zero within the rate limit.
 * - VISCERA_STALE: there is no new answer. The force stays for the time of the watchdog, then fades linearly to zero.
 * - Any other status, a force that is null or not finite, a `dt` longer than the watchdog: the force fades at once. */
int32_t viscera_guard_step(viscera_guard *guard, const double force_in[3], int32_t status, double dt,
                           double force_out[3]);

/* Makes a guard passive. The guard then counts the energy (force unit times length unit) that the hand puts in and
 * gets back. It pays a debt by damping of at most `damping` (0: none), and lowers the force to zero as the debt
 * approaches `energy_limit`, whatever the rate limit. For a hand that moves by at most m in a step, the debt does not
 * exceed the larger of `energy_limit` and force_limit * m. Without force the debt is forgiven, an `energy_limit` in
 * the time of a fade. The limit must be above 0, the damping at least 0, both finite; after VISCERA_BAD_SETTING the
 * guard never gives a force. */
int32_t viscera_guard_keep_passive(viscera_guard *guard, double energy_limit, double damping);

/* REAL TIME. viscera_guard_step for a tool that has moved by `moved` since the last step, in the frame and the unit of
 * the displacement. A passive guard needs this call: without a finite `moved` its force fades. */
int32_t viscera_guard_step_moved(viscera_guard *guard, const double force_in[3], int32_t status, const double moved[3],
                                 double dt, double force_out[3]);

/* A rigid probe: a sphere on the touchable surface that presses, sticks, slides and lets go. */
typedef struct viscera_probe viscera_probe;

enum viscera_probe_grip {
    VISCERA_PROBE_FREE = 0,   /* it touches nothing, or there is no answer */
    VISCERA_PROBE_STICKS = 1, /* it holds the point that it touches */
    VISCERA_PROBE_SLIDES = 2  /* it slides along the surface; without friction always */
};

typedef struct viscera_felt {
    double force[3];         /* of the probe on the organ, within the friction cone */
    double torque[3];        /* on the organ about the centre of the sphere */
    double center[3];        /* of the sphere; it differs from the device if there is a coupling */
    double contact_point[3]; /* the point at rest that the probe holds, or the nearest: for viscera_surface */
    double displacement[3];  /* of the contact there: for viscera_surface */
    double gap;              /* distance of the sphere from the surface at rest; negative if it has entered */
    double error_estimate;   /* of the force, relative to its norm: of the model, and of the patch for the contact */
    double shape_error_estimate;
    int64_t grip;            /* an enum viscera_probe_grip */
} viscera_felt;

/* Makes a probe of 0.8 to 1.25 times the radius of the model's contact patch, with Coulomb's coefficient of
 * friction, from 0 to 1000. The model must be freed after the probe, and viscera_set_frame be called before. On
 * failure *probe is null and `message`, which may be null, says why in one sentence. A probe is used by one thread at
 * a time. */
int32_t viscera_probe_new(const viscera_model *model, double radius, double friction, viscera_probe **probe,
                          char *message, size_t message_len);

/* Frees a probe; null is allowed. */
void viscera_probe_free(viscera_probe *probe);

/* REAL TIME. Puts a spring (force per length) and a damper (force per velocity) between device and probe, for
 * viscera_probe_follow. The stiffness must be above 0, the damping at least 0, both finite. After VISCERA_BAD_SETTING
 * the old coupling stays; a new probe has none. */
int32_t viscera_probe_couple(viscera_probe *probe, double stiffness, double damping);

/* REAL TIME. Sets the largest estimated error of a trusted force, relative to its norm, above 0 and at most 1: that
 * of a contact as wide as the mesh can show. A smaller one has a larger relative error, and a smaller one in newtons.
 * After VISCERA_BAD_SETTING the old tolerance stays. */
int32_t viscera_probe_tolerate(viscera_probe *probe, double tolerance);

/* REAL TIME. Puts the centre of the sphere at a place, and tells what it feels there. The status is for
 * viscera_guard_step:
 * - VISCERA_OK, VISCERA_ERROR_TOO_LARGE: as for viscera_evaluate.
 * - VISCERA_BEYOND_DEPTH: the probe has entered deeper than the model serves; the force is that at the largest depth.
 * - VISCERA_OFF_SURFACE: the probe is free, or beyond the end of the touchable surface.
 * - VISCERA_INSIDE: the probe came into the organ in one step. There is no force until it has been outside.
 * - VISCERA_NOT_FINITE: the place is not a number; the probe stays where it was, and its touch is over. Or what it feels
 *   overflows in the caller's units. */
int32_t viscera_probe_place(viscera_probe *probe, const double center[3], viscera_felt *felt);

/* REAL TIME. Draws the probe by its coupling towards a device, `dt` seconds after the last step. The probe goes where
 * spring, damper and tissue are in balance, by at most a quarter of its radius, and stays on the side of the organ that
 * it touches. The force is that of the tissue. Without a coupling the probe is where the device is. The first step of a
 * new or lifted probe begins outside, and goes at once to the balance of spring and tissue; friction begins after it.
 * `dt` is at least 0 and finite; any other is refused with VISCERA_BAD_SETTING and no force, and the probe stays as it
 * was. In a step of no duration the damper takes the probe along with the device. The statuses are else those of
 * viscera_probe_place. */
int32_t viscera_probe_follow(viscera_probe *probe, const double device[3], double dt, viscera_felt *felt);

/* REAL TIME. Takes the probe from the organ: the next place is a first one, so it must be outside. */
int32_t viscera_probe_lift(viscera_probe *probe);

/* Several probes on one model that feel each other through the organ: each meets the surface as the others leave it. */
typedef struct viscera_probes viscera_probes;

/* Makes a group of `count` probes of one model, which must be freed after it. On failure *group is null and `message`,
 * which may be null, says why in one sentence. Group and probes are used by one thread at a time. */
int32_t viscera_probes_new(viscera_probe **probes, size_t count, viscera_probes **group, char *message,
                           size_t message_len);

/* Frees a group, not its probes; null is allowed. */
void viscera_probes_free(viscera_probes *group);

/* REAL TIME. Puts the centres of the spheres at places, three numbers for each, and tells what each feels there, with the
 * status that viscera_probe_place would give. The fields of viscera_surface at each touch add up to that of the organ. */
int32_t viscera_probes_place(viscera_probes *group, const double *centers, viscera_felt *felt, int32_t *status);

/* REAL TIME. Draws the probes by their couplings towards devices, as viscera_probe_follow, with the status that it would
 * give. For a `dt` that is refused this returns VISCERA_BAD_SETTING, too. */
int32_t viscera_probes_follow(viscera_probes *group, const double *devices, double dt, viscera_felt *felt,
                              int32_t *status);

#if defined(__cplusplus) ? __cplusplus >= 201103L : (defined(__STDC_VERSION__) && __STDC_VERSION__ >= 201112L)
#ifdef __cplusplus
#define VISCERA_ASSERT(claim) static_assert(claim, "viscera.h: a struct is not laid out as in the library")
#else
#define VISCERA_ASSERT(claim) _Static_assert(claim, "viscera.h: a struct is not laid out as in the library")
#endif
VISCERA_ASSERT(sizeof(viscera_info_t) == 56);
VISCERA_ASSERT(sizeof(viscera_answer) == 136);
VISCERA_ASSERT(sizeof(viscera_frame) == 112);
VISCERA_ASSERT(sizeof(viscera_guard) == 120);
VISCERA_ASSERT(sizeof(viscera_felt) == 152);
VISCERA_ASSERT(sizeof(viscera_parameter) == 24);
#undef VISCERA_ASSERT
#endif

#ifdef __cplusplus
}
#endif

#endif
