/* A simulated haptic device: a hand presses an organ at 1 kHz while a slow thread moves the organ and draws it.
 *
 *     haptic_loop MODEL.viscera RECORDING.csv [SECONDS]
 *
 * Half of the time (600 s unless told) the recorded hand, half the random one, each tick due on the clock. Then as many
 * ticks as one core can do; then the slow thread falls silent under a pressing hand, and the force must fade. A tick
 * that computed for longer than a period is repeated afterwards, to tell its work from what a machine took from under it.
 * Linux; it exits with 1 where memory was asked for, a value was torn, a tick was missed because of the work in it, a
 * limit of the guard did not hold, or a force stayed. */
#define _GNU_SOURCE
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>

#include "allocations.h"
#include "exchange.h"
#include "hand.h"
#include "overrun.h"
#include "report.h"
#include "tool.h"
#include "viscera.h"

enum { TICKS_PER_SECOND = 1000, FRAMES_PER_SECOND = 60 };
static const double DT = 1.0 / TICKS_PER_SECOND;
/* N, N/s, s, s; J, N s/m; s */
static const double FORCE_LIMIT = 5, RATE_LIMIT = 2000, WATCHDOG = 0.02, FADE = 0.1;
static const double ENERGY_LIMIT = 0.002, DAMPING = 2, FRAME_LIMIT = 0.1;

/* What the slow thread tells the loop, and the loop the slow thread; `check` repeats the number, against torn values. */
typedef struct frame {
    uint64_t number;
    double time, origin[3];
    uint64_t check;
} frame;

typedef struct touch {
    uint64_t number;
    double contact[3], displacement[3];
    uint64_t check;
} touch;

typedef struct device {
    viscera_model *model;
    viscera_info_t info;
    viscera_guard guard;
    tool tool;
    double inward[3];
    exchange frames, touches;
    frame frame_slots[3];
    touch touch_slots[3];
    float *workspace, *positions;
    size_t workspace_len, positions_len;
    atomic_int runs, speaks;
    uint64_t ticks, torn;
    /* the slow thread's */
    uint64_t drawn, torn_touches;
    double slowest_picture;
} device;

static double now(clockid_t clock) {
    struct timespec t;
    clock_gettime(clock, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void sleep_until(double seconds) {
    struct timespec t = {(time_t)seconds, (long)(1e9 * (seconds - floor(seconds)))};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL) != 0) {
    }
}

/* 60 times a second: the organ breathes by a tenth of the depth, and is drawn as the hand has it. */
static void *slow_thread(void *argument) {
    device *d = argument;
    double due = now(CLOCK_MONOTONIC);
    for (uint64_t number = 1; atomic_load(&d->runs); number++) {
        const double time = now(CLOCK_MONOTONIC), breath = 0.05 * d->info.depth * (1 - cos(1.6 * time));
        if (atomic_load(&d->speaks)) {
            frame *f = exchange_slot(&d->frames);
            *f = (frame){number, time, {0, 0, 0}, number};
            for (int i = 0; i < 3; i++) f->origin[i] = -breath * d->inward[i];
            exchange_publish(&d->frames);
        }
        const touch *t = exchange_take(&d->touches);
        d->torn_touches += t->number != t->check;
        viscera_surface(d->model, t->contact, t->displacement, d->workspace, d->workspace_len, d->positions,
                        d->positions_len);
        d->slowest_picture = fmax(d->slowest_picture, now(CLOCK_MONOTONIC) - time);
        d->drawn++;
        due += 1.0 / FRAMES_PER_SECOND;
        sleep_until(due);
    }
    return NULL;
}

static void set_guard(device *d) {
    viscera_guard_init(&d->guard, FORCE_LIMIT, RATE_LIMIT, WATCHDOG, FADE);
    viscera_guard_keep_passive(&d->guard, ENERGY_LIMIT, DAMPING);
}

/* One millisecond of the device; all of what the 1 kHz thread does for the organ. */
static void tick(device *d, hand_pose pose, double time, latencies *measured, double due) {
    const tool before = d->tool;
    const frame *f = exchange_take(&d->frames);
    d->torn += f->number != f->check;
    viscera_answer answer;
    const double start = now(CLOCK_MONOTONIC), cpu = now(CLOCK_THREAD_CPUTIME_ID);
    int32_t status = tool_touch(&d->tool, d->model, pose, f->origin, &answer);
    /* Where the organ is now is not known: the answer is as old as the frame. */
    if (time - f->time > FRAME_LIMIT) status = VISCERA_STALE;
    double force[3];
    const int32_t mode = viscera_guard_step_moved(&d->guard, answer.force, status, d->tool.moved, DT, force);
    const double end = now(CLOCK_MONOTONIC);
    touch *t = exchange_slot(&d->touches);
    t->number = t->check = ++d->ticks;
    memcpy(t->contact, d->tool.contact, sizeof t->contact);
    memcpy(t->displacement, d->tool.displacement, sizeof t->displacement);
    exchange_publish(&d->touches);
    if (measured) {
        const double computed = now(CLOCK_THREAD_CPUTIME_ID) - cpu;
        if (computed > DT) overruns_add(&measured->overruns, &before, pose, f->origin);
        latencies_add(measured, start - due, end - start, computed, end - due);
        latencies_count(measured, status, mode, &d->guard, d->tool.moved);
    }
}

/* `seconds` of a hand, each tick due on the clock; ticks that came too late for the next one are missed. */
static void run_paced(device *d, hand *h, double seconds, latencies *measured) {
    const uint64_t n = (uint64_t)(seconds * TICKS_PER_SECOND);
    double due = now(CLOCK_MONOTONIC) + DT;
    allocations_count(1);
    for (uint64_t k = 0; k < n; k++, due += DT) {
        const double time = now(CLOCK_MONOTONIC);
        if (time > due + DT) {
            latencies_miss(measured);
            continue;
        }
        if (time < due) sleep_until(due);
        tick(d, hand_at(h, (double)k * DT, DT), now(CLOCK_MONOTONIC), measured, due);
    }
    allocations_count(0);
}

/* The same ticks without a clock to wait for; returns how many a second. Not for a second: a system stops a real-time
 * thread that never sleeps. */
static double run_free(device *d, hand *h, double seconds, latencies *measured) {
    const double start = now(CLOCK_MONOTONIC);
    double time = start;
    uint64_t k = 0;
    for (; time - start < seconds && k < measured->capacity; k++) {
        tick(d, hand_at(h, (double)k * DT, DT), time, measured, time);
        time = now(CLOCK_MONOTONIC);
    }
    return (double)k / (time - start);
}

/* The hand comes down and holds on; then the slow thread stops telling where the organ is. Seconds until the force was
 * zero, or -1. */
static double run_silent(device *d) {
    hand_pose pose = {{0, 0}, -0.5};
    double due = now(CLOCK_MONOTONIC), silence = 0;
    set_guard(d); /* without the random hand's debts */
    for (int k = 0; k < 2 * TICKS_PER_SECOND; k++, due += DT) {
        sleep_until(due);
        const double time = now(CLOCK_MONOTONIC);
        if (k == TICKS_PER_SECOND) {
            if (!(fabs(d->guard.force[0]) + fabs(d->guard.force[1]) + fabs(d->guard.force[2]) > 0)) return -1;
            atomic_store(&d->speaks, 0);
            silence = time;
        }
        pose.press = fmin(0.5, 2.0 * k / TICKS_PER_SECOND - 0.5);
        tick(d, pose, time, NULL, due);
        const double *force = d->guard.force;
        if (silence > 0 && force[0] == 0 && force[1] == 0 && force[2] == 0) return time - silence;
    }
    return -1;
}

static int open_device(device *d, const char *path) {
    char message[256] = "header and library of different versions";
    if (viscera_abi_version() != VISCERA_ABI_VERSION ||
        viscera_load_file(path, &d->model, message, sizeof message) != VISCERA_OK) {
        fprintf(stderr, "%s\n", message);
        return 0;
    }
    viscera_info(d->model, &d->info);
    d->workspace_len = viscera_workspace_size(d->model);
    d->positions_len = 3 * (size_t)d->info.surface_nodes;
    d->workspace = calloc(d->workspace_len, sizeof(float));
    d->positions = calloc(d->positions_len, sizeof(float));
    if (!d->workspace || !d->positions) return 0;
    set_guard(d);
    exchange_init(&d->frames, d->frame_slots, sizeof(frame));
    exchange_init(&d->touches, d->touch_slots, sizeof(touch));
    atomic_init(&d->runs, 1);
    atomic_init(&d->speaks, 1);
    if (!tool_place(&d->tool, d->model, &d->info, d->workspace, d->positions)) return 0;
    memcpy(d->inward, d->tool.inward, sizeof d->inward);
    for (int i = 0; i < 3; i++) memcpy(d->touch_slots[i].contact, d->tool.contact, sizeof d->tool.contact);
    return 1;
}

static void close_device(device *d) {
    free(d->workspace);
    free(d->positions);
    viscera_free(d->model);
}

/* A thread that other work must not push aside, in memory that stays where it is, where the system allows it. */
static int ask_for_real_time(void) {
    const struct sched_param priority = {.sched_priority = 80};
    const int stays = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
    return pthread_setschedparam(pthread_self(), SCHED_FIFO, &priority) == 0 && stays;
}

int main(int argc, char **argv) {
    const double seconds = argc > 3 ? atof(argv[3]) : 600, spare = fmin(0.8, seconds / 4);
    static device d;
    hand hands[2];
    latencies measured[4];
    if (argc < 3 || argc > 4 || !(seconds > 0)) {
        fprintf(stderr, "usage: haptic_loop MODEL.viscera RECORDING.csv [SECONDS]\n");
        return 2;
    }
    const char *wrong = hand_open(&hands[0], argv[2]);
    if (wrong) fprintf(stderr, "%s: %s\n", argv[2], wrong);
    if (wrong || !open_device(&d, argv[1])) return 2;
    hand_random(&hands[1], 1);
    const size_t paced = (size_t)(0.5 * seconds * TICKS_PER_SECOND) + 1, most = (size_t)(spare * 1e6) + 1;
    for (int k = 0; k < 4; k++) {
        if (!latencies_open(&measured[k], k < 2 ? paced : most)) return 2;
    }
    pthread_t slow;
    if (pthread_create(&slow, NULL, slow_thread, &d) != 0) return 2;
    while (((const frame *)exchange_take(&d.frames))->number == 0) sleep_until(now(CLOCK_MONOTONIC) + 1e-3);

    const int is_real_time = ask_for_real_time();
    report_machine(argv[1], &d.info, TICKS_PER_SECOND, seconds, is_real_time);
    for (int k = 0; k < 2; k++) run_paced(&d, &hands[k], 0.5 * seconds, &measured[k]);
    double rates[2];
    for (int k = 0; k < 2; k++) {
        rates[k] = run_free(&d, &hands[k], 0.5 * spare, &measured[2 + k]);
        sleep_until(now(CLOCK_MONOTONIC) + spare);
    }
    const double silent = run_silent(&d);
    atomic_store(&d.runs, 0);
    pthread_join(slow, NULL);

    int right = 1;
    for (int k = 0; k < 2; k++) {
        latencies_repeat(&measured[k], d.model);
        report_latencies(k == 0 ? "recorded hand" : "random hand", &measured[k]);
        right = right && measured[k].missed_by_us == 0 && measured[k].largest_force <= FORCE_LIMIT * (1 + 1e-12) &&
                -measured[k].lowest_energy <= fmax(ENERGY_LIMIT, FORCE_LIMIT * measured[k].longest_move) * (1 + 1e-9);
    }
    printf("\n");
    for (int k = 0; k < 2; k++) report_rate(k == 0 ? "recorded hand" : "random hand", &measured[2 + k], rates[k]);
    const long allocated = allocations_counted();
    const uint64_t torn = d.torn + d.torn_touches;
    printf("slow thread: %llu pictures, the slowest in %.0f us; torn values: %llu\n", (unsigned long long)d.drawn,
           1e6 * d.slowest_picture, (unsigned long long)torn);
    printf("silence: the force was zero %.0f ms after the last frame\n", 1e3 * silent);
    if (allocated < 0) printf("allocations: not counted here\n");
    if (allocated >= 0) printf("allocations: %ld\n", allocated);
    const double patience = FRAME_LIMIT + WATCHDOG + FADE + 0.1;
    right = right && allocated <= 0 && torn == 0 && silent >= 0 && silent < patience;
    for (int k = 0; k < 4; k++) latencies_close(&measured[k]);
    hand_close(&hands[0]);
    close_device(&d);
    return right ? 0 : 1;
}
