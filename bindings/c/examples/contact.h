/* Where a tool meets an organ: the point it first touched sticks to it until it is pulled off again.
 *
 * Outside, the closest touchable point and the way out to the tool are remembered. A tool that is found on the other side
 * of that point has gone in there. It must start outside, and move by less than the organ is thick from tick to tick. */
#ifndef CONTACT_H
#define CONTACT_H

#include <string.h>

#include "viscera.h"

typedef struct contact {
    int touches;
    double point[3], outward[3];
    double at[3], moved[3]; /* the tool, and its way since the last tick */
} contact;

/* REAL TIME. The status and the answer for a tool at a place, for viscera_guard_step_moved. */
static inline int32_t contact_touch(contact *c, const viscera_model *model, const double at[3], viscera_answer *answer) {
    double away[3], distance = 0, height = 0;
    memset(answer, 0, sizeof *answer);
    for (int i = 0; i < 3; i++) c->moved[i] = at[i] - c->at[i];
    memcpy(c->at, at, sizeof c->at);
    if (!c->touches) {
        const int32_t status = viscera_locate(model, at, c->point, &distance);
        if (status != VISCERA_OK) return status;
    }
    for (int i = 0; i < 3; i++) {
        away[i] = at[i] - c->point[i];
        height += away[i] * c->outward[i];
    }
    c->touches = height < 0;
    if (c->touches) return viscera_evaluate(model, c->point, away, answer);
    for (int i = 0; i < 3 && distance > 0; i++) c->outward[i] = away[i] / distance;
    return VISCERA_OFF_SURFACE;
}

/* A tool that is outside, at a place. */
static inline void contact_begin(contact *c, const double at[3]) {
    memset(c, 0, sizeof *c);
    memcpy(c->at, at, sizeof c->at);
}

#endif
