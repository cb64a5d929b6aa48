/* The tip of a tool on an organ: where it touched, how far it has moved since, and when it slips. */
#ifndef TOOL_H
#define TOOL_H

#include "hand.h"
#include "viscera.h"

typedef struct tool {
    double base[3], inward[3], across[2][3]; /* the place a hand works on, in the frame of the organ */
    double radius, depth;
    int touches;
    double contact[3];      /* touched point of the surface at rest */
    double anchor[3];       /* where the tool is when nothing drags it */
    double displacement[3]; /* from there */
    double at[3], moved[3]; /* the tip, and its way since the last call */
} tool;

/* Puts a tool over the touchable point closest to the organ's middle, with the memory that viscera_surface needs.
 * Returns 0 where there is none. */
int tool_place(tool *t, const viscera_model *model, const viscera_info_t *info, float *workspace, float *positions);

/* REAL TIME. The status and the answer for a hand's pose on an organ that has moved by `origin`. */
int32_t tool_touch(tool *t, const viscera_model *model, hand_pose pose, const double origin[3],
                   viscera_answer *answer);

#endif
