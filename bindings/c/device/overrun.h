/* Ticks that computed for longer than a period, kept to be repeated: what is slow because of its input is slow again,
 * what a machine under us took is not. */
#ifndef OVERRUN_H
#define OVERRUN_H

#include <stddef.h>

#include "tool.h"

enum { OVERRUNS = 256 };

typedef struct overrun {
    tool tool; /* before the tick */
    hand_pose pose;
    double origin[3];
    size_t missed; /* ticks that this one made impossible */
} overrun;

typedef struct overruns {
    overrun of[OVERRUNS];
    size_t n; /* those kept; what comes after is counted as slow for good */
    size_t beyond, missed_beyond;
} overruns;

void overruns_add(overruns *all, const tool *before, hand_pose pose, const double origin[3]);

/* A tick missed right behind the last overrun. */
void overruns_miss(overruns *all);

/* Touches again what was touched in the overruns, three times each. Returns the seconds of processor time of the one
 * whose best time is worst, and in `missed` how many ticks were missed behind those that take longer than `period` again. */
double overruns_repeat(const overruns *all, const viscera_model *model, double period, size_t *missed);

#endif
