/* Two hands on an organ at 1 kHz: they take hold, answer every tick, and are guarded. A second thread draws the organ and
 * asks now and then what the answers are worth.
 *
 *     cc hands.c $(pkg-config --cflags --libs viscera_hands) -Wl,-rpath,$(pkg-config --variable=libdir viscera) \
 *         -lpthread -lm -o hands
 *     ./hands liver.viscera
 *
 * It needs C11, for its atomics, and POSIX.
 * It takes three seconds, and before them those of the training. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "viscera_hands.h"

enum { HANDS = 2, TICKS = 3000, TICKS_PER_SECOND = 1000 };

typedef struct scene {
    viscera_model *model;
    viscera_hands *organ;
    viscera_grasp *grasp;
    /* Answers of three owners: the loop, the thread that draws, and the newest on the way between them. */
    viscera_held *_Atomic newest;
    viscera_held *drawn;
    atomic_int is_over, fresh;
    float *positions;
    size_t positions_len;
    int assessed, trusted;
} scene;

/* Of this thread's processor time, whatever else the machine does. */
static double microseconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return 1e6 * (double)now.tv_sec + 1e-3 * (double)now.tv_nsec;
}

static void wait_a_millisecond(void) { nanosleep(&(struct timespec){0, 1000000}, NULL); }

static int by_size(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Draws the newest answer, and lets the whole organ assess it: the status of later ticks follows. */
static void *draw(void *argument) {
    scene *s = argument;
    while (!atomic_load(&s->is_over)) {
        double error;
        if (!atomic_exchange(&s->fresh, 0)) {
            wait_a_millisecond();
            continue;
        }
        s->drawn = atomic_exchange(&s->newest, s->drawn);
        viscera_held_surface(s->drawn, s->positions, s->positions_len);
        s->trusted += viscera_held_assess(s->drawn, &error) == VISCERA_OK;
        s->assessed++;
    }
    return NULL;
}

/* One hand presses and the other pulls, by a twelfth of the depth, with a turn of the wrist. */
static void move(double seconds, double depth, double d[3 * HANDS]) {
    const double turn = 6.283185307179586 * seconds, press = 0.04 * depth * (1 - cos(turn));
    for (int hand = 0; hand < HANDS; hand++) {
        d[3 * hand] = 0.02 * depth * sin(turn);
        d[3 * hand + 1] = 0.02 * depth * (cos(turn) - 1);
        d[3 * hand + 2] = hand == 0 ? -press : press;
    }
}

static int loop(scene *s, viscera_held *held, double depth, double *taken) {
    viscera_guard guards[HANDS];
    for (int hand = 0; hand < HANDS; hand++) viscera_guard_init(&guards[hand], 50.0, 1e4, 0.02, 0.1);
    int trusted = 0;
    for (int tick = 0; tick < TICKS; tick++) {
        double d[3 * HANDS], found[3 * HANDS], felt[HANDS][3];
        move((double)tick / TICKS_PER_SECOND, depth, d);

        const double start = microseconds();
        const int status = viscera_grasp_solve(s->grasp, d, 3 * HANDS, VISCERA_FROM_LAST, 0.8e-3, held);
        viscera_held_forces(held, found, 3 * HANDS);
        for (int hand = 0; hand < HANDS; hand++) {
            viscera_guard_step(&guards[hand], found + 3 * hand, status, 1.0 / TICKS_PER_SECOND, felt[hand]);
        }
        taken[tick] = microseconds() - start;
        wait_a_millisecond();

        trusted += status == VISCERA_OK;
        held = atomic_exchange(&s->newest, held);
        atomic_store(&s->fresh, 1);
        if (tick % 500 == 0) {
            printf("%5.3f s: the hands feel (%7.3f, %7.3f, %7.3f) N and (%7.3f, %7.3f, %7.3f) N, %s\n",
                   (double)tick / TICKS_PER_SECOND, -felt[0][0], -felt[0][1], -felt[0][2], -felt[1][0], -felt[1][1],
                   -felt[1][2], viscera_status_text(status));
        }
    }
    viscera_held_free(held);
    return trusted;
}

/* Holds the organ where it is nearest to two points above it, one on either side of its middle. */
static int take_hold(scene *s, viscera_info_t *info, char *message, size_t message_len) {
    double points[3 * HANDS], *nodes = malloc(3 * info->points * sizeof(double));
    if (!nodes || viscera_mesh(s->model, nodes, 3 * info->points, NULL, 0) != VISCERA_OK) return 0;
    double low[3], high[3];
    for (int i = 0; i < 3; i++) low[i] = high[i] = nodes[i];
    for (size_t k = 0; k < 3 * info->points; k++) {
        low[k % 3] = fmin(low[k % 3], nodes[k]);
        high[k % 3] = fmax(high[k % 3], nodes[k]);
    }
    free(nodes);
    for (int hand = 0; hand < HANDS; hand++) {
        const double share = hand == 0 ? 0.36 : 0.64;
        const double above[3] = {low[0] + share * (high[0] - low[0]), 0.5 * (low[1] + high[1]), 2 * high[2] - low[2]};
        viscera_locate(s->model, above, points + 3 * hand, NULL);
    }
    viscera_sampling sampling;
    viscera_sampling_init(s->model, &sampling);
    sampling.snapshots = 24;
    sampling.tolerance = 0.003; /* more cells than by default, longer ticks, more of them trusted */
    return viscera_hands_new(s->model, &sampling, &s->organ, message, message_len) == VISCERA_OK &&
           viscera_grasp_new(s->organ, points, HANDS, NULL, NULL, &s->grasp, message, message_len) == VISCERA_OK;
}

int main(int argc, char **argv) {
    static scene s;
    static double taken[TICKS];
    char message[256] = "";
    viscera_info_t info;
    viscera_held *held = NULL, *newest = NULL;
    pthread_t thread;
    if (argc != 2 || viscera_abi_version() != VISCERA_ABI_VERSION) return 2;
    int done = viscera_load_file(argv[1], &s.model, message, sizeof message) == VISCERA_OK;
    done = done && viscera_info(s.model, &info) == VISCERA_OK && take_hold(&s, &info, message, sizeof message);
    /* Memory is asked for here, once; the loop asks for none. */
    s.positions_len = done ? 3 * (size_t)info.surface_nodes : 0;
    s.positions = malloc(s.positions_len * sizeof(float) + 1);
    done = done && s.positions && viscera_held_new(s.grasp, &held, message, sizeof message) == VISCERA_OK;
    done = done && viscera_held_new(s.grasp, &newest, message, sizeof message) == VISCERA_OK;
    done = done && viscera_held_new(s.grasp, &s.drawn, message, sizeof message) == VISCERA_OK;
    atomic_store(&s.newest, newest);
    if (done && pthread_create(&thread, NULL, draw, &s) == 0) {
        const int trusted = loop(&s, held, info.depth, taken);
        atomic_store(&s.is_over, 1);
        pthread_join(thread, NULL);
        viscera_grasp_state state;
        viscera_grasp_progress(s.grasp, &state);
        qsort(taken, TICKS, sizeof(double), by_size);
        printf("%d of %d ticks trusted, %d of %d answers assessed; %d modes on %d cells, %d snapshots\n", trusted, TICKS,
               s.trusted, s.assessed, (int)state.modes, (int)state.cells, (int)state.snapshots);
        printf("a tick took %.0f us of processor time, 1 in 100 more than %.0f us, the longest %.0f us\n", taken[TICKS / 2],
               taken[TICKS - TICKS / 100], taken[TICKS - 1]);
    } else {
        fprintf(stderr, "%s\n", message);
        done = 0;
    }
    viscera_held_free(atomic_load(&s.newest));
    viscera_held_free(s.drawn);
    viscera_grasp_free(s.grasp);
    viscera_hands_free(s.organ);
    viscera_free(s.model);
    free(s.positions);
    return done ? 0 : 1;
}
