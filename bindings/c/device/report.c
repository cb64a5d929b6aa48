#include "report.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const double PERIOD = 1e-3;
static const char *NAMES[LATENCIES] = {"the system woke us late by", "answer, by the clock",
                                       "whole tick, processor time", "due until the force is out"};

int latencies_open(latencies *l, size_t capacity) {
    memset(l, 0, sizeof *l);
    l->capacity = capacity;
    for (int k = 0; k < LATENCIES; k++) {
        l->seconds[k] = malloc(capacity * sizeof(float));
        if (!l->seconds[k]) return 0;
        memset(l->seconds[k], 1, capacity * sizeof(float)); /* the system gives a page when it is written to */
    }
    return 1;
}

void latencies_close(latencies *l) {
    for (int k = 0; k < LATENCIES; k++) free(l->seconds[k]);
}

void latencies_add(latencies *l, double late, double evaluation, double cpu, double loop) {
    if (l->n == l->capacity) return;
    l->seconds[LATE][l->n] = (float)late;
    l->seconds[EVALUATION][l->n] = (float)evaluation;
    l->seconds[CPU][l->n] = (float)cpu;
    l->seconds[LOOP][l->n] = (float)loop;
    l->n++;
}

static double norm(const double v[3]) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

void latencies_count(latencies *l, int32_t status, int32_t mode, const viscera_guard *guard, const double moved[3]) {
    l->trusted += status == VISCERA_OK;
    l->untrusted += status == VISCERA_BEYOND_DEPTH || status == VISCERA_ERROR_TOO_LARGE;
    l->free += status == VISCERA_OFF_SURFACE;
    l->damped += mode == VISCERA_GUARD_DAMPS;
    l->largest_force = fmax(l->largest_force, norm(guard->force));
    l->lowest_energy = fmin(l->lowest_energy, guard->energy);
    l->longest_move = fmax(l->longest_move, norm(moved));
}

void latencies_miss(latencies *l) {
    l->missed++;
    if (l->n > 0 && (double)l->seconds[CPU][l->n - 1] > PERIOD) overruns_miss(&l->overruns);
}

void latencies_repeat(latencies *l, const viscera_model *model) {
    l->slowest_again = overruns_repeat(&l->overruns, model, PERIOD, &l->missed_by_us);
}

static int ascending(const void *a, const void *b) {
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static double share(const float *sorted, size_t n, double part) {
    return n ? 1e6 * (double)sorted[(size_t)(part * (double)(n - 1))] : 0;
}

static void processor(char *name, size_t size) {
    char line[256];
    FILE *file = fopen("/proc/cpuinfo", "r");
    snprintf(name, size, "unknown processor");
    while (file && fgets(line, sizeof line, file)) {
        const char *value = strchr(line, ':');
        if (strncmp(line, "model name", 10) != 0 || !value) continue;
        snprintf(name, size, "%.*s", (int)strcspn(value + 2, "\n"), value + 2);
        break;
    }
    if (file) fclose(file);
}

void report_machine(const char *model, const viscera_info_t *info, int rate, double seconds, int is_real_time) {
    char name[128];
    const char *slash = strrchr(model, '/');
    processor(name, sizeof name);
    printf("%s, %ld cores\n", name, sysconf(_SC_NPROCESSORS_ONLN));
    printf("%s: %llu points, %llu on the surface, %llu positions\n", slash ? slash + 1 : model,
           (unsigned long long)info->points, (unsigned long long)info->surface_nodes,
           (unsigned long long)info->positions);
    printf("a loop at %d Hz for %g s, %s real-time priority\n", rate, seconds, is_real_time ? "with" : "without");
    fflush(stdout);
}

void report_latencies(const char *name, latencies *l) {
    printf("\n%-30s %9s %9s %9s %9s\n", name, "p50 [us]", "p99", "p99.9", "worst");
    for (int k = 0; k < LATENCIES; k++) {
        qsort(l->seconds[k], l->n, sizeof(float), ascending);
        printf("  %-28s %9.2f %9.2f %9.2f %9.2f\n", NAMES[k], share(l->seconds[k], l->n, 0.5),
               share(l->seconds[k], l->n, 0.99), share(l->seconds[k], l->n, 0.999), share(l->seconds[k], l->n, 1));
    }
    printf("  %zu ticks: %zu trusted, %zu not, %zu free; %zu missed, %zu of them because of us\n", l->n + l->missed,
           l->trusted, l->untrusted, l->free, l->missed, l->missed_by_us);
    if (l->overruns.n)
        printf("  %zu ticks computed for longer than a period; repeated, the slowest of them took %.2f us\n",
               l->overruns.n + l->overruns.beyond, 1e6 * l->slowest_again);
    printf("  largest force %.3f N; largest debt of energy %.3f mJ, held down for it %.1f %% of the time\n",
           l->largest_force, -1e3 * l->lowest_energy, 100 * (double)l->damped / (double)(l->n ? l->n : 1));
    printf("  fastest move %.2f mm in a tick\n", 1e3 * l->longest_move);
}

void report_rate(const char *name, latencies *l, double rate) {
    qsort(l->seconds[EVALUATION], l->n, sizeof(float), ascending);
    const double slow = share(l->seconds[EVALUATION], l->n, 0.999);
    printf("%s back to back on one core: %.0f ticks a second; 99.9 %% of the answers within %.2f us (%.0f kHz)\n", name,
           rate, slow, 1e3 / slow);
}
