/* A rigid probe in a haptic loop: a sphere on a spring follows a hand that presses an organ, strokes it and lets go.
 *
 *     probe MODEL.viscera [POSES]
 *
 * The loop runs in simulated time and prints what the hand feels. POSES holds lines of numbers, a place of the centre,
 * the status and the force and torque that Python answers there; the program compares its own.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "viscera.h"

#define PI 3.14159265358979323846
static const double TICK = 1e-3; /* [s] */

static viscera_probe *new_probe(const viscera_model *organ, double radius, double friction) {
    char message[256];
    viscera_probe *probe;
    if (viscera_probe_new(organ, radius, friction, &probe, message, sizeof message) != VISCERA_OK) {
        puts(message);
        exit(1);
    }
    return probe;
}

/* Two seconds over the touchable point that is the highest. */
static void stroke(const viscera_model *organ, const viscera_info_t *info) {
    const double high[3] = {0.5, 0.1, 1e3};
    double top[3], force[3];
    viscera_locate(organ, high, top, NULL);

    viscera_probe *probe = new_probe(organ, info->radius, 0.3);
    viscera_probe_couple(probe, 500, 2); /* N/m, N s/m */
    viscera_guard guard;
    viscera_guard_init(&guard, 5, 1000, 0.02, 0.1);   /* at most 5 N and 1000 N/s; watchdog 20 ms, fade 100 ms */
    viscera_guard_keep_passive(&guard, 1e-3, 5);
    double last[3] = {top[0], top[1], top[2] + info->radius};
    int touching = 0, sliding = 0, trusted = 0;
    for (int n = 0; n < 2000; n++) {
        const double s = n * TICK;
        const double hand[3] = {
            top[0] + 0.3 * info->radius * sin(2 * PI * s),
            top[1],
            top[2] + info->radius - 0.25 * info->depth * sin(PI * s),
        };
        viscera_felt felt;
        const int32_t status = viscera_probe_follow(probe, hand, TICK, &felt);
        const double moved[3] = {hand[0] - last[0], hand[1] - last[1], hand[2] - last[2]};
        viscera_guard_step_moved(&guard, felt.force, status, moved, TICK, force);
        for (int i = 0; i < 3; i++) last[i] = hand[i];
        touching += felt.grip != VISCERA_PROBE_FREE;
        sliding += felt.grip == VISCERA_PROBE_SLIDES;
        trusted += status == VISCERA_OK;
        if (n % 250 == 125) {
            printf("%.3f s: the hand feels (%7.3f %7.3f %7.3f) N, %s\n", s, -force[0], -force[1], -force[2],
                   viscera_status_text(status));
        }
    }
    printf("%d of 2000 ticks in touch, %d sliding, %d trusted\n", touching, sliding, trusted);
    viscera_probe_free(probe);
}

static int compare(const viscera_model *organ, const viscera_info_t *info, const char *path) {
    FILE *poses = fopen(path, "r");
    viscera_probe *probe = new_probe(organ, info->radius, 0.3);
    double center[3], expected[6], largest = 0, worst = 0;
    int status, count = 0, is_equal = poses != NULL;
    while (poses && fscanf(poses, "%lf %lf %lf %d", center, center + 1, center + 2, &status) == 4) {
        viscera_felt felt;
        is_equal = is_equal && viscera_probe_place(probe, center, &felt) == status;
        for (int i = 0; i < 6; i++) {
            const double found = i < 3 ? felt.force[i] : felt.torque[i - 3];
            is_equal = is_equal && fscanf(poses, "%lf", expected + i) == 1;
            largest = fmax(largest, fabs(expected[i]));
            worst = fmax(worst, fabs(found - expected[i]));
        }
        count++;
    }
    if (poses) fclose(poses);
    viscera_probe_free(probe);
    printf("%d poses; largest difference from Python %.1e of %.3f N\n", count, worst, largest);
    return is_equal && count > 0 && worst <= 1e-9 * largest;
}

int main(int argc, char **argv) {
    viscera_model *organ = NULL;
    viscera_info_t info;
    if (argc < 2 || viscera_load_file(argv[1], &organ, NULL, 0) != VISCERA_OK) {
        puts("probe MODEL.viscera [POSES]");
        return 2;
    }
    viscera_info(organ, &info);
    stroke(organ, &info);
    const int is_equal = argc < 3 || compare(organ, &info, argv[2]);
    viscera_free(organ);
    return is_equal ? 0 : 1;
}
