/* Hands without a person: one played from a recording, one that is random and jerky.
 *
 * A hand says where it would be over a flat surface: across it in radii of the contact patch, and into it as a part of
 * the depth the model was made for, negative above the surface. */
#ifndef HAND_H
#define HAND_H

#include <stddef.h>
#include <stdint.h>

typedef struct hand_pose {
    double across[2];
    double press;
} hand_pose;

typedef struct hand {
    hand_pose *frames; /* of a recording that ends where it begins; null for a random hand */
    size_t n_frames;
    double frames_per_second;
    uint64_t state;    /* of the random numbers */
    double next_jerk;  /* [s] */
    hand_pose at, to;
} hand;

/* Reads a recording: a first line `frames_per_second,RATE`, a line of titles, then rows `across,across,press`. The
 * sentence that comes back says why it cannot; null where it can. */
const char *hand_open(hand *h, const char *path);

/* A hand that jumps to somewhere else every 10 to 200 ms, sometimes off the organ, sometimes too deep. */
void hand_random(hand *h, uint64_t seed);

/* Where the hand is at a time [s] that grows from call to call by `dt`. Allocates nothing. */
hand_pose hand_at(hand *h, double seconds, double dt);

void hand_close(hand *h);

#endif
