/* The device behind the stand-ins: it comes down on its origin, presses, and goes up again, once, in a second. */
#ifndef SCRIPTED_H
#define SCRIPTED_H

#include <math.h>
#include <stdio.h>

enum { SCRIPTED_TICKS = 1000 };

static int scripted_tick;
static double scripted_last[3], scripted_deepest[3];

/* Height over the origin [m]: from 10 mm above to 20 mm inside. */
static double scripted_height(void) { return -0.005 + 0.015 * cos(6.283185307179586 * scripted_tick / SCRIPTED_TICKS); }

/* Takes a force on the hand, and moves on. */
static void scripted_force(const double force[3]) {
    for (int i = 0; i < 3; i++) {
        scripted_last[i] = force[i];
        if (scripted_tick == SCRIPTED_TICKS / 2) scripted_deepest[i] = force[i];
    }
    scripted_tick++;
}

static void scripted_report(void) {
    printf("deepest %.9g %.9g %.9g last %.9g %.9g %.9g\n", scripted_deepest[0], scripted_deepest[1], scripted_deepest[2],
           scripted_last[0], scripted_last[1], scripted_last[2]);
}

#endif
