/* What lies inside, energy and another value of the parameter, against Python: MODEL.viscera ANSWERS.
 *
 * ANSWERS: the number of places and their points; then for each touch value of the parameter, point, displacement,
 * statuses of force and shape, force, stiffness, error estimates, energy, displacement of the places and of all nodes.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "viscera.h"

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

static double larger(double worst, double other) { return other <= worst ? worst : other; }

int main(int argc, char **argv) {
    viscera_model *model = NULL;
    viscera_places *places = NULL, *nodes = NULL;
    char message[256];
    if (argc != 3 || viscera_load_file(argv[1], &model, message, sizeof message) != VISCERA_OK) return 2;
    viscera_info_t info;
    viscera_info(model, &info);
    const size_t n = 3 * (size_t)info.points, n_work = viscera_field_workspace_size(model);
    FILE *file = fopen(argv[2], "r");
    unsigned count = 0;
    if (!file || fscanf(file, "%u", &count) != 1) return 3;
    double *points = malloc(3 * count * sizeof(double)), *moved = malloc(3 * count * sizeof(double));
    double *field = malloc(n * sizeof(double)), *few = malloc(3 * sizeof(double));
    float *work = malloc(n_work * sizeof(float)), *all = malloc(n * sizeof(float));
    for (unsigned i = 0; i < 3 * count; i++) {
        if (fscanf(file, "%lf", points + i) != 1) return 4;
    }
    const uint32_t last = (uint32_t)info.points - 1;
    if (viscera_places_at(model, points, count, &places, message, sizeof message) != VISCERA_OK) puts(message);
    if (viscera_places_of_nodes(model, &last, 1, &nodes, message, sizeof message) != VISCERA_OK) puts(message);

    double value, point[3], d[3], worst[5] = {0, 0, 0, 0, 0}, energy;
    int expected, shape, touches = 0, right = places && nodes;
    while (right && fscanf(file, "%lf %lf %lf %lf %lf %lf %lf %d %d", &value, point, point + 1, point + 2, d, d + 1,
                           d + 2, &expected, &shape) == 9) {
        viscera_answer answer;
        right = viscera_set_parameter(model, value, message, sizeof message) == VISCERA_OK;
        right = right && viscera_evaluate(model, point, d, &answer) == expected;
        right = right && viscera_energy(model, point, d, &energy) == expected;
        right = right && viscera_places_displacement(places, point, d, moved, 3 * count) == shape;
        right = right && viscera_places_displacement(nodes, point, d, few, 3) == shape;
        right = right && viscera_field(model, point, d, work, n_work, all, n) == shape;
        for (size_t i = 0; i < n; i++) field[i] = (double)all[i];
        for (size_t i = 0; i < 3; i++) right = right && few[i] == field[n - 3 + i];
        worst[0] = larger(worst[0], difference(file, answer.force, 3));
        worst[0] = larger(worst[0], difference(file, answer.stiffness, 9));
        worst[1] = larger(worst[1], difference(file, &answer.error_estimate, 2));
        worst[2] = larger(worst[2], difference(file, &energy, 1));
        worst[3] = larger(worst[3], difference(file, moved, 3 * count));
        worst[4] = larger(worst[4], difference(file, field, n));
        touches++;
    }
    right = right && feof(file) && touches > 0;
    printf("%d touches; largest difference from Python: force %.1e, estimates %.1e, energy %.1e, places %.1e, field %.1e\n",
           touches, worst[0], worst[1], worst[2], worst[3], worst[4]);
    for (int i = 0; i < 5; i++) right = right && worst[i] <= 1e-12;
    fclose(file);
    viscera_places_free(places);
    viscera_places_free(nodes);
    viscera_free(model);
    free(points);
    free(moved);
    free(field);
    free(few);
    free(work);
    free(all);
    return right ? 0 : 1;
}
