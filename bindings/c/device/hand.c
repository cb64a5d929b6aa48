#include "hand.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char *hand_open(hand *h, const char *path) {
    FILE *file = fopen(path, "r");
    size_t capacity = 0;
    memset(h, 0, sizeof *h);
    if (!file) return "the recording cannot be opened";
    int right = fscanf(file, "frames_per_second,%lf across,across,press", &h->frames_per_second) == 1;
    hand_pose pose;
    while (right && fscanf(file, " %lf,%lf,%lf", &pose.across[0], &pose.across[1], &pose.press) == 3) {
        if (h->n_frames == capacity) {
            capacity = capacity ? 2 * capacity : 1024;
            hand_pose *more = realloc(h->frames, capacity * sizeof *more);
            if (!more) break;
            h->frames = more;
        }
        h->frames[h->n_frames++] = pose;
    }
    right = right && feof(file) && h->n_frames > 3 && h->frames_per_second > 0;
    fclose(file);
    if (!right) hand_close(h);
    return right ? NULL : "the recording is not a table of positions";
}

void hand_close(hand *h) {
    free(h->frames);
    memset(h, 0, sizeof *h);
}

void hand_random(hand *h, uint64_t seed) {
    memset(h, 0, sizeof *h);
    h->state = seed;
}

/* In [0, 1), the same for the same seed. */
static double next(hand *h) {
    h->state = h->state * 6364136223846793005u + 1442695040888963407u;
    return (double)(h->state >> 11) / 9007199254740992.0;
}

/* Runs through all frames with a continuous velocity (Catmull and Rom). */
static double spline(const double x[4], double t) {
    const double slope[2] = {0.5 * (x[2] - x[0]), 0.5 * (x[3] - x[1])}, way = x[2] - x[1];
    return x[1] + t * (slope[0] + t * (3 * way - 2 * slope[0] - slope[1] + t * (slope[0] + slope[1] - 2 * way)));
}

static hand_pose played(const hand *h, double seconds) {
    const double frame = seconds * h->frames_per_second, t = frame - floor(frame);
    const size_t first = (size_t)fmod(floor(frame), (double)h->n_frames) + h->n_frames - 1;
    double x[3][4];
    for (size_t k = 0; k < 4; k++) {
        const hand_pose *pose = &h->frames[(first + k) % h->n_frames];
        x[0][k] = pose->across[0];
        x[1][k] = pose->across[1];
        x[2][k] = pose->press;
    }
    return (hand_pose){{spline(x[0], t), spline(x[1], t)}, spline(x[2], t)};
}

/* Off to the new place at full speed, most of the way in 20 to 100 ms: a start that no wrist could make. */
static hand_pose jerked(hand *h, double seconds, double dt) {
    if (seconds >= h->next_jerk) {
        h->next_jerk = seconds + 0.01 + 0.19 * next(h);
        h->to = (hand_pose){{4 * next(h) - 2, 4 * next(h) - 2}, 1.5 * next(h) - 0.5};
    }
    const double part = 1 - exp(-dt / (0.02 + 0.08 * next(h)));
    for (int i = 0; i < 2; i++) h->at.across[i] += part * (h->to.across[i] - h->at.across[i]);
    h->at.press += part * (h->to.press - h->at.press);
    return h->at;
}

hand_pose hand_at(hand *h, double seconds, double dt) {
    return h->frames ? played(h, seconds) : jerked(h, seconds, dt);
}
