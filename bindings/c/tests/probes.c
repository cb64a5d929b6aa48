/* Two probes that feel each other, against what Python answers, and groups that cannot be.
 *
 *     probes MODEL.viscera POSES
 *
 * POSES holds lines of numbers: two places of the centres, and for each probe the status and the force.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "viscera.h"

#define EXPECT(claim) \
    do { \
        if (!(claim)) { \
            printf("line %d: %s\n", __LINE__, #claim); \
            return 1; \
        } \
    } while (0)

static int refusals(viscera_probe *one, double radius, const char *path) {
    viscera_probe *other = NULL, *twice[2] = {one, one}, *missing[2] = {one, NULL};
    viscera_probes *group = (viscera_probes *)&radius; /* anything: a failure must clear it */
    viscera_model *copy = NULL;
    char message[256];
    viscera_felt felt[2];
    int32_t status[2];
    const double places[6] = {0};
    EXPECT(viscera_load_file(path, &copy, NULL, 0) == VISCERA_OK);
    EXPECT(viscera_probe_new(copy, radius, 0, &other, NULL, 0) == VISCERA_OK);
    viscera_probe *strangers[2] = {one, other};
    EXPECT(viscera_probes_new(NULL, 2, &group, message, sizeof message) == VISCERA_NULL_POINTER && group == NULL);
    EXPECT(viscera_probes_new(twice, 2, NULL, NULL, 0) == VISCERA_NULL_POINTER);
    EXPECT(viscera_probes_new(twice, 0, &group, message, sizeof message) == VISCERA_BAD_SETTING);
    EXPECT(strstr(message, "give at least one") != NULL);
    EXPECT(viscera_probes_new(twice, 2, &group, message, sizeof message) == VISCERA_BAD_SETTING);
    EXPECT(group == NULL && strstr(message, "probe 1 of the group is in it twice") != NULL);
    EXPECT(viscera_probes_new(missing, 2, &group, message, sizeof message) == VISCERA_NULL_POINTER);
    EXPECT(strstr(message, "probe 1 of the group is null") != NULL);
    EXPECT(viscera_probes_new(strangers, 2, &group, message, sizeof message) == VISCERA_BAD_SETTING);
    EXPECT(strstr(message, "another model") != NULL);
    EXPECT(viscera_probes_place(NULL, places, felt, status) == VISCERA_NULL_POINTER);
    EXPECT(viscera_probes_new(twice, 1, &group, message, sizeof message) == VISCERA_OK && message[0] == 0);
    EXPECT(viscera_probes_place(group, NULL, felt, status) == VISCERA_NULL_POINTER);
    EXPECT(viscera_probes_place(group, places, NULL, status) == VISCERA_NULL_POINTER);
    EXPECT(viscera_probes_follow(group, places, 1e-3, felt, NULL) == VISCERA_NULL_POINTER);
    EXPECT(viscera_probes_follow(group, places, -1, felt, status) == VISCERA_BAD_SETTING);
    EXPECT(status[0] == VISCERA_BAD_SETTING && felt[0].force[2] == 0);
    viscera_probes_free(group);
    viscera_probes_free(NULL);
    viscera_probe_free(other);
    viscera_free(copy);
    return 0;
}

/* A probe of a group that goes on, lifted while its device is in the organ; then a step that is no duration. */
static int lifted(const viscera_model *organ, double radius) {
    viscera_probe *probes[2];
    viscera_probes *group;
    viscera_felt felt[2], held[2];
    int32_t status[2];
    const double devices[6] = {0.41, 0.1, 0.2 + 0.85 * radius, 0.59, 0.1, 0.2 + 0.85 * radius}, spring = 500;
    for (int k = 0; k < 2; k++) {
        EXPECT(viscera_probe_new(organ, radius, 0.3, &probes[k], NULL, 0) == VISCERA_OK);
        EXPECT(viscera_probe_couple(probes[k], spring, 1) == VISCERA_OK);
    }
    EXPECT(viscera_probes_new(probes, 2, &group, NULL, 0) == VISCERA_OK);
    for (int n = 0; n < 50; n++) viscera_probes_follow(group, devices, 1e-3, held, status);
    EXPECT(status[0] == VISCERA_OK && held[0].force[2] < 0);
    viscera_probe_lift(probes[0]);
    EXPECT(viscera_probes_follow(group, devices, 1e-3, felt, status) == VISCERA_OK);
    EXPECT(fabs(felt[0].force[2] - held[0].force[2]) < -0.05 * held[0].force[2]);
    EXPECT(viscera_probes_follow(group, devices, -1e-3, felt, status) == VISCERA_BAD_SETTING);
    EXPECT(viscera_probes_follow(group, devices, 0, felt, status) == VISCERA_OK && status[0] == VISCERA_OK);
    EXPECT(fabs(felt[1].force[2] - held[1].force[2]) < -0.05 * held[1].force[2]);
    viscera_probes_free(group);
    for (int k = 0; k < 2; k++) viscera_probe_free(probes[k]);
    return 0;
}

int main(int argc, char **argv) {
    viscera_model *organ = NULL;
    viscera_info_t info;
    viscera_probe *probes[2];
    viscera_probes *group;
    EXPECT(argc == 3 && viscera_load_file(argv[1], &organ, NULL, 0) == VISCERA_OK);
    viscera_info(organ, &info);
    for (int k = 0; k < 2; k++) {
        EXPECT(viscera_probe_new(organ, info.radius, 0.3, &probes[k], NULL, 0) == VISCERA_OK);
    }
    if (refusals(probes[0], info.radius, argv[1]) || lifted(organ, info.radius)) return 1;
    for (int k = 0; k < 2; k++) viscera_probe_lift(probes[k]);
    EXPECT(viscera_probes_new(probes, 2, &group, NULL, 0) == VISCERA_OK);

    FILE *poses = fopen(argv[2], "r");
    EXPECT(poses != NULL);
    double centers[6], expected, largest = 0, worst = 0;
    int count = 0;
    while (fscanf(poses, "%lf %lf %lf %lf %lf %lf", centers, centers + 1, centers + 2, centers + 3, centers + 4,
                  centers + 5) == 6) {
        viscera_felt felt[2];
        int32_t status[2];
        int wanted;
        EXPECT(viscera_probes_place(group, centers, felt, status) == VISCERA_OK);
        for (int k = 0; k < 2; k++) {
            EXPECT(fscanf(poses, "%d", &wanted) == 1 && wanted == status[k]);
            for (int i = 0; i < 3; i++) {
                EXPECT(fscanf(poses, "%lf", &expected) == 1);
                largest = fmax(largest, fabs(expected));
                worst = fmax(worst, fabs(felt[k].force[i] - expected));
            }
        }
        count++;
    }
    fclose(poses);
    viscera_probes_free(group);
    for (int k = 0; k < 2; k++) viscera_probe_free(probes[k]);
    viscera_free(organ);
    printf("%d poses of two; largest difference from Python %.1e of %.3f N\n", count, worst, largest);
    return count > 0 && worst <= 1e-9 * largest ? 0 : 1;
}
