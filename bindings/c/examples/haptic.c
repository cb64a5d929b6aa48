/* A hand that presses an organ at 1 kHz: load a model, answer every tick, guard the force, draw the surface now and then.
 *
 *     cc haptic.c $(pkg-config --cflags --libs viscera) -Wl,-rpath,$(pkg-config --variable=libdir viscera) \
 *         -lm -o haptic
 *     ./haptic liver.viscera
 *
 * It needs C11, for `timespec_get`; a compiler of an older default takes -std=c11.
 * Simulated time runs as fast as it can. A second argument names a file of touches with their answers by Python, which
 * the C interface must reproduce to 1e-6. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "viscera.h"

enum { TICKS = 3000, TICKS_PER_SECOND = 1000, TICKS_PER_PICTURE = 17 };

typedef struct scene {
    viscera_model *model;
    viscera_info_t info;
    size_t workspace_len, positions_len;
    float *workspace, *positions;
} scene;

static double microseconds(void) {
    struct timespec now;
    timespec_get(&now, TIME_UTC);
    return 1e6 * (double)now.tv_sec + 1e-3 * (double)now.tv_nsec;
}

/* Memory is asked for here, once; the loop below asks for none. */
static int open_scene(scene *s, const char *path) {
    char message[256];
    if (viscera_abi_version() != VISCERA_ABI_VERSION) {
        fprintf(stderr, "header and library of different versions\n");
        return 0;
    }
    if (viscera_load_file(path, &s->model, message, sizeof message) != VISCERA_OK) {
        fprintf(stderr, "%s\n", message);
        return 0;
    }
    viscera_info(s->model, &s->info);
    s->workspace_len = viscera_workspace_size(s->model);
    s->positions_len = 3 * (size_t)s->info.surface_nodes;
    s->workspace = malloc(s->workspace_len * sizeof(float));
    s->positions = malloc(s->positions_len * sizeof(float));
    return s->workspace && s->positions;
}

static void close_scene(scene *s) {
    free(s->positions);
    free(s->workspace);
    viscera_free(s->model);
}

/* A quarter of the depth in and out once a second, with a small circle across. */
static void hand(double seconds, const double inward[3], double depth, double displacement[3]) {
    const double turn = 6.283185307179586 * seconds;
    const double press = 0.125 * depth * (1 - cos(turn));
    displacement[0] = press * inward[0] + 0.02 * depth * sin(turn);
    displacement[1] = press * inward[1] + 0.02 * depth * (cos(turn) - 1);
    displacement[2] = press * inward[2];
}

static int loop(scene *s) {
    const double above[3] = {0.4, 0.1, 10.0}; /* the organ is touched where it is closest to this point */
    double contact[3], inward[3], distance;
    if (viscera_locate(s->model, above, contact, &distance) != VISCERA_OK) return 0;
    for (int i = 0; i < 3; i++) inward[i] = (contact[i] - above[i]) / distance;

    viscera_guard guard;
    viscera_guard_init(&guard, 50.0, 1e4, 0.02, 0.1); /* N, N/s, s, s */
    double shortest = INFINITY, longest = 0, picture = 0;
    int trusted = 0;
    for (int tick = 0; tick < TICKS; tick++) {
        double displacement[3], force[3];
        viscera_answer answer;
        hand((double)tick / TICKS_PER_SECOND, inward, s->info.depth, displacement);

        const double start = microseconds();
        const int status = viscera_evaluate(s->model, contact, displacement, &answer);
        viscera_guard_step(&guard, answer.force, status, 1.0 / TICKS_PER_SECOND, force);
        const double taken = microseconds() - start;

        trusted += status == VISCERA_OK;
        shortest = fmin(shortest, taken);
        longest = fmax(longest, taken);
        if (tick % TICKS_PER_PICTURE == 0) {
            const double before = microseconds();
            viscera_surface(s->model, contact, displacement, s->workspace, s->workspace_len, s->positions,
                            s->positions_len);
            picture = fmax(picture, microseconds() - before);
        }
        if (tick % 250 == 0) {
            printf("%5.3f s: the hand feels (%8.4f, %8.4f, %8.4f) N, error about %.2f %%, %s\n",
                   (double)tick / TICKS_PER_SECOND, -force[0], -force[1], -force[2], 100 * answer.error_estimate,
                   viscera_status_text(status));
        }
    }
    printf("%d of %d ticks trusted; a tick took %.1f to %.1f us, a surface of %zu nodes at most %.1f us\n", trusted, TICKS,
           shortest, longest, s->positions_len / 3, picture);
    return 1;
}

/* The largest difference of `n` numbers from those that follow in the file, relative to the largest of them. */
static double difference(FILE *file, const double *found, size_t n) {
    double worst = 0, size = 0;
    for (size_t i = 0; i < n; i++) {
        double expected;
        if (fscanf(file, "%lf", &expected) != 1) return INFINITY;
        worst = fmax(worst, fabs(found[i] - expected));
        size = fmax(size, fabs(expected));
    }
    return worst / (size > 0 ? size : 1);
}

/* Each touch: point, displacement, statuses of force and shape, force, stiffness, error estimates, positions of the
 * surface nodes. */
static int check(scene *s, const char *path) {
    FILE *file = fopen(path, "r");
    double point[3], d[3], worst[4] = {0, 0, 0, 0};
    double *positions = malloc(s->positions_len * sizeof(double));
    int expected, expected_shape, touches = 0, right = file && positions;
    while (right && fscanf(file, "%lf %lf %lf %lf %lf %lf %d %d", point, point + 1, point + 2, d, d + 1, d + 2,
                           &expected, &expected_shape) == 8) {
        viscera_answer answer;
        const int status = viscera_evaluate(s->model, point, d, &answer);
        const int drawn = viscera_surface(s->model, point, d, s->workspace, s->workspace_len, s->positions,
                                          s->positions_len);
        for (size_t i = 0; i < s->positions_len; i++) positions[i] = (double)s->positions[i];
        worst[0] = fmax(worst[0], difference(file, answer.force, 3));
        worst[1] = fmax(worst[1], difference(file, answer.stiffness, 9));
        worst[2] = fmax(worst[2], difference(file, &answer.error_estimate, 1));
        worst[2] = fmax(worst[2], difference(file, &answer.shape_error_estimate, 1));
        worst[3] = fmax(worst[3], difference(file, positions, s->positions_len));
        right = status == expected && drawn == expected_shape;
        touches++;
    }
    right = right && feof(file) && touches > 0;
    if (file) fclose(file);
    free(positions);
    printf("%d touches; largest difference from Python: force %.1e, stiffness %.1e, estimate %.1e, surface %.1e\n",
           touches, worst[0], worst[1], worst[2], worst[3]);
    for (int i = 0; i < 4; i++) right = right && worst[i] < 1e-6;
    return right;
}

int main(int argc, char **argv) {
    scene s;
    memset(&s, 0, sizeof s);
    if (argc < 2) {
        fprintf(stderr, "usage: haptic MODEL.viscera [ANSWERS]\n");
        return 2;
    }
    const int done = open_scene(&s, argv[1]) && loop(&s) && (argc < 3 || check(&s, argv[2]));
    close_scene(&s);
    return done ? 0 : 1;
}
