#define _GNU_SOURCE
#include "overrun.h"

#include <math.h>
#include <string.h>
#include <time.h>

void overruns_add(overruns *all, const tool *before, hand_pose pose, const double origin[3]) {
    if (all->n == OVERRUNS) {
        all->beyond++;
        return;
    }
    overrun *o = &all->of[all->n++];
    o->tool = *before;
    o->pose = pose;
    memcpy(o->origin, origin, sizeof o->origin);
    o->missed = 0;
}

void overruns_miss(overruns *all) {
    if (all->beyond) all->missed_beyond++;
    else if (all->n) all->of[all->n - 1].missed++;
}

static double processor_time(void) {
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

double overruns_repeat(const overruns *all, const viscera_model *model, double period, size_t *missed) {
    double worst = 0;
    *missed = all->missed_beyond;
    for (size_t k = 0; k < all->n; k++) {
        const overrun *o = &all->of[k];
        double best = INFINITY;
        for (int repetition = 0; repetition < 3; repetition++) {
            tool again = o->tool;
            viscera_answer answer;
            const double start = processor_time();
            tool_touch(&again, model, o->pose, o->origin, &answer);
            best = fmin(best, processor_time() - start);
        }
        worst = fmax(worst, best);
        *missed += best > period ? o->missed : 0;
    }
    return worst;
}
