/* viscera.h: a reduced model of a soft organ, answered in microseconds, for haptic loops in C and C++.
 *
 * A touch is a contact point on the organ's surface at rest and the displacement of the tool from there. The answer is
 * the force of the tool on the organ (the hand feels its negative), its derivative, and an estimate of its error.
 *
 * Lengths and forces are metres and newtons in the frame of the mesh unless viscera_set_frame says otherwise. Vectors
 * are three doubles, matrices nine row by row. A null pointer is reported, never followed.
 *
 * Calls marked REAL TIME allocate nothing, take no lock, make no system call and write no log. Several threads may
 * make them on one model at once; loading, viscera_set_frame and viscera_free need the model to themselves.
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

/* Compare with viscera_abi_version() once at the start: they differ if header and library do not belong together. */
#define VISCERA_ABI_VERSION 3

/* Status of a call. The first three come with an answer; only the answer of the first can be relied on. */
enum viscera_status {
    VISCERA_OK = 0,
    VISCERA_BEYOND_DEPTH = 1,    /* displaced farther than the depth the model was made for */
    VISCERA_ERROR_TOO_LARGE = 2, /* the estimated error is larger than allowed at this depth */
    VISCERA_OFF_SURFACE = 3,     /* the point is more than an edge length off the touchable surface */
    VISCERA_NOT_FINITE = 4,      /* an input, or an answer that overflowed, is infinite or not a number */
    VISCERA_NULL_POINTER = 5,
    VISCERA_SHORT_BUFFER = 6,
    VISCERA_BAD_MODEL = 7,       /* bytes or a file that cannot be read or hold no usable model */
    VISCERA_BAD_SETTING = 8,     /* a frame or a guard out of its range */
    VISCERA_STALE = 9            /* given to viscera_guard_step by a loop that has no new answer */
};

typedef struct viscera_model viscera_model;

typedef struct viscera_info {
    uint64_t points;            /* nodes of the organ */
    uint64_t surface_nodes;     /* nodes of its boundary */
    uint64_t surface_triangles; /* triangles of its boundary */
    uint64_t positions;         /* nodes where touches were solved off-line */
    double radius;              /* of the contact patch */
    double depth;               /* largest displacement the model was made for */
    double edge_length;         /* mean, of the touchable triangles: how far off the surface a touch may be */
} viscera_info_t;

typedef struct viscera_answer {
    double force[3];         /* of the tool on the organ */
    double stiffness[9];     /* dF_i / dd_j */
    double error_estimate;   /* of the force, relative to its norm; at most 1 */
    double shape_error_estimate; /* of the deformed organ, relative to its displacement; at most 1 */
    double contact_point[3]; /* the touched point of the surface at rest */
} viscera_answer;

/* The caller's frame: x_mesh [m] = metres_per_unit * rotation * x + translation. The rotation must be orthogonal to
 * within 1e-6; a reflection is allowed, for left-handed engines. */
typedef struct viscera_frame {
    double metres_per_unit;  /* 0.001 for millimetres */
    double newtons_per_unit; /* 1 for newtons */
    double rotation[9];
    double translation[3];   /* [m] */
} viscera_frame;

/* Owned by the caller, set up by viscera_guard_init. Read the state if you like; write only the settings. */
typedef struct viscera_guard {
    double force_limit;  /* largest output force */
    double rate_limit;   /* largest change of it per second */
    double watchdog;     /* longest time without an answer [s] */
    double fade;         /* time in which the force then fades to zero [s] */
    double force[3];     /* last output force */
    double target[3];    /* last trusted force */
    double age;          /* of the last answer [s] */
    double fade_rate;    /* force lost per second while fading */
    double energy_limit; /* most energy given out beyond what came in; 0: not counted */
    double damping;      /* most damping that pays such a debt, force per velocity */
    double energy;       /* put into the organ by the hand since it touched; negative: the debt */
} viscera_guard;

/* What a guard did at a step. */
enum viscera_guard_mode {
    VISCERA_GUARD_FOLLOWS = 0, /* the force is the one that came in */
    VISCERA_GUARD_LIMITS = 1,  /* it is on its way there, or shortened to the limit */
    VISCERA_GUARD_HOLDS = 2,   /* no trusted answer: the last trusted force stays */
    VISCERA_GUARD_FADES = 3,   /* stale or faulty: on its way to zero */
    VISCERA_GUARD_REFUSES = 4, /* a null guard, a setting or a time step out of range: zero */
    VISCERA_GUARD_DAMPS = 5    /* energy debt: damped, or reduced to the allowed force */
};

/* The interface version of the library. */
uint32_t viscera_abi_version(void);

/* Text of a status; never null, never to be freed. */
const char *viscera_status_text(int32_t status);

/* Reads a model from the bytes of a *.viscera file (they are copied) or from the file itself. On failure *model is null
 * and `message`, which may be null, says why in one sentence; a file that is damaged is refused. After VISCERA_OK it is
 * empty, or warns of a file of format version 1, which has no checksums to show damage. */
int32_t viscera_load(const uint8_t *bytes, size_t len, viscera_model **model, char *message, size_t message_len);
int32_t viscera_load_file(const char *path, viscera_model **model, char *message, size_t message_len);

/* Frees a model; null is allowed. */
void viscera_free(viscera_model *model);

/* Sizes of a model, in the caller's units. */
int32_t viscera_info(const viscera_model *model, viscera_info_t *info);

/* The frame of the mesh in SI, to start from. */
void viscera_frame_identity(viscera_frame *frame);

/* Sets the frame of all inputs and outputs; VISCERA_BAD_SETTING leaves the old one. Not during other calls. */
int32_t viscera_set_frame(viscera_model *model, const viscera_frame *frame);

/* REAL TIME. The touchable point at rest closest to `point`, and its distance; either output may be null. */
int32_t viscera_locate(const viscera_model *model, const double point[3], double contact_point[3], double *distance);

/* REAL TIME. The answer to a touch: VISCERA_OK, or VISCERA_BEYOND_DEPTH or VISCERA_ERROR_TOO_LARGE with a force that
 * cannot be relied on. Any other status gives zero force and stiffness and error estimates of 1. */
int32_t viscera_evaluate(const viscera_model *model, const double point[3], const double displacement[3],
                         viscera_answer *answer);

/* Floats of workspace that viscera_surface needs. */
size_t viscera_workspace_size(const viscera_model *model);

/* REAL TIME. Positions of the deformed surface nodes, three floats each: at least 3 * surface_nodes of them. The status
 * is that of the shape, whose estimated error differs from that of the force: a compressed model may answer with a
 * trusted force and an untrusted shape. If there is no answer, the positions are those at rest. After
 * VISCERA_NULL_POINTER and VISCERA_SHORT_BUFFER nothing has been written. Workspace and positions must not overlap; lengths count floats. */
int32_t viscera_surface(const viscera_model *model, const double point[3], const double displacement[3],
                        float *workspace, size_t workspace_len, float *positions, size_t positions_len);

/* Triangles of the surface, numbered by the rows of viscera_surface, counter-clockwise from outside in the caller's
 * frame; and the mesh node of each row. Either output may be null; lengths count integers. */
int32_t viscera_surface_topology(const viscera_model *model, uint32_t *triangles, size_t triangles_len,
                                 uint32_t *nodes, size_t nodes_len);

/* A guard at rest; all four settings are positive. VISCERA_BAD_SETTING sets up one that gives no force. */
int32_t viscera_guard_init(viscera_guard *guard, double force_limit, double rate_limit, double watchdog, double fade);

/* REAL TIME. The force to send on, `dt` seconds after the last step; returns an enum viscera_guard_mode.
 * VISCERA_OK: the force follows `force_in` within the limits. VISCERA_BEYOND_DEPTH, VISCERA_ERROR_TOO_LARGE: the last
 * trusted force stays, since a series beyond its range may pull. VISCERA_OFF_SURFACE: free of the organ, towards zero.
 * VISCERA_STALE: no new answer; the force stays for the time of the watchdog, then fades linearly to zero.
 * Anything else, a force that is null or not finite, or a `dt` longer than the watchdog: it fades from now on.
 * `force_in` and `force_out` may be the same. */
int32_t viscera_guard_step(viscera_guard *guard, const double force_in[3], int32_t status, double dt,
                           double force_out[3]);

/* Makes a guard passive. It counts the energy (force unit times length unit) that the hand puts in and gets back, pays a
 * debt by damping of at most `damping` (0: none), and lowers the force to zero as the debt nears `energy_limit`, whatever
 * the rate limit. Of a hand that moves by m in a step, the debt stays below the larger of `energy_limit` and
 * force_limit * m. VISCERA_BAD_SETTING leaves a guard that gives no force. */
int32_t viscera_guard_keep_passive(viscera_guard *guard, double energy_limit, double damping);

/* REAL TIME. viscera_guard_step for a tool that has moved by `moved` since the last step, in the frame and the unit of
 * the displacement. A passive guard needs it: without a finite `moved` the force fades. */
int32_t viscera_guard_step_moved(viscera_guard *guard, const double force_in[3], int32_t status, const double moved[3],
                                 double dt, double force_out[3]);

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
#undef VISCERA_ASSERT
#endif

#ifdef __cplusplus
}
#endif

#endif
