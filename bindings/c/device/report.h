/* What a loop measured, tick by tick, in memory taken before it began; and the lines that say it. */
#ifndef REPORT_H
#define REPORT_H

#include <stddef.h>
#include <stdint.h>

#include "overrun.h"
#include "viscera.h"

enum { LATE, EVALUATION, CPU, LOOP, LATENCIES };

typedef struct latencies {
    float *seconds[LATENCIES];
    size_t n, capacity;
    size_t missed, missed_by_us; /* of the missed: those behind a tick that needs longer than a period */
    overruns overruns;           /* ticks that computed for longer than a period, */
    double slowest_again;        /* and what the slowest of them took when repeated */
    size_t trusted, untrusted, free, damped;
    double largest_force, lowest_energy, longest_move;
} latencies;

int latencies_open(latencies *l, size_t capacity);
void latencies_close(latencies *l);

/* A tick: how late it began, how long its answer took by the clock and in this thread, how late the force was out. */
void latencies_add(latencies *l, double late, double evaluation, double cpu, double loop);
void latencies_count(latencies *l, int32_t status, int32_t mode, const viscera_guard *guard, const double moved[3]);
void latencies_miss(latencies *l);

/* Which overruns were slow because of their work. */
void latencies_repeat(latencies *l, const viscera_model *model);

void report_machine(const char *model, const viscera_info_t *info, int rate, double seconds, int is_real_time);
void report_latencies(const char *name, latencies *l);
void report_rate(const char *name, latencies *l, double rate);

#endif
