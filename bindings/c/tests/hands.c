/* Several touches against Python, and what a tick asks of the system: MODEL.viscera ANSWERS.
 *
 * ANSWERS: the numbers of contacts and of places, contact points, places; then for each search what is asked, the
 * displacements, its status, forces, stiffness (if asked for), energy, estimate and status of the assessment,
 * displacement of the places and of all nodes, von Mises stress of the cells, the estimated error of the stress.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "../device/allocations.h"
#include "viscera_hands.h"

enum { MOST = 8 };

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

static int numbers(FILE *file, double *into, size_t n) {
    for (size_t i = 0; i < n; i++) {
        if (fscanf(file, "%lf", into + i) != 1) return 0;
    }
    return 1;
}

int main(int argc, char **argv) {
    viscera_model *model = NULL;
    viscera_hands *hands = NULL;
    viscera_grasp *grasp = NULL;
    viscera_held *held = NULL;
    viscera_places *places = NULL;
    char message[256] = "";
    if (argc != 3 || viscera_load_file(argv[1], &model, message, sizeof message) != VISCERA_OK) return 2;
    FILE *file = fopen(argv[2], "r");
    unsigned contacts = 0, count = 0;
    double at[3 * MOST], inside[3 * MOST], d[3 * MOST], forces[3 * MOST], stiffness[9 * MOST * MOST], moved[3 * MOST];
    if (!file || fscanf(file, "%u %u", &contacts, &count) != 2 || contacts > MOST || count > MOST) return 3;
    if (!numbers(file, at, 3 * contacts) || !numbers(file, inside, 3 * count)) return 3;
    viscera_sampling sampling;
    viscera_sampling_init(model, &sampling);
    int right = viscera_hands_new(model, &sampling, &hands, message, sizeof message) == VISCERA_OK;
    right = right && viscera_grasp_new(hands, at, contacts, NULL, NULL, &grasp, message, sizeof message) == VISCERA_OK;
    right = right && viscera_held_new(grasp, &held, message, sizeof message) == VISCERA_OK;
    right = right && viscera_places_at(model, inside, count, &places, message, sizeof message) == VISCERA_OK;
    if (!right) puts(message);

    viscera_info_t info;
    viscera_info(model, &info);
    const size_t n = 3 * (size_t)info.points, cells = viscera_cell_count(model), surface = 3 * info.surface_nodes;
    double *field = malloc(n * sizeof(double)), *stress = malloc(9 * cells * sizeof(double));
    double *von_mises = malloc(cells * sizeof(double));
    float *positions = malloc(surface * sizeof(float));
    double worst[8] = {0, 0, 0, 0, 0, 0, 0, 0};
    int unbalanced = 0;
    long allocated = 0;
    int asked, expected, searches = 0;
    while (right && fscanf(file, "%d", &asked) == 1) {
        viscera_search search;
        right = numbers(file, d, 3 * contacts) && fscanf(file, "%d", &expected) == 1;
        const long before = allocations_counted();
        allocations_count(1);
        const int status = viscera_grasp_solve(grasp, d, 3 * contacts, asked, 0, held);
        viscera_held_forces(held, forces, 3 * contacts);
        viscera_held_field(held, field, n);
        viscera_held_surface(held, positions, surface);
        viscera_held_places(held, places, moved, 3 * count);
        allocations_count(0);
        allocated += allocations_counted() - before;
        if (status != expected) {
            printf("search %d: status %d, and %d in Python\n", searches, status, expected);
            right = 0;
            break;
        }
        worst[0] = larger(worst[0], difference(file, forces, 3 * contacts));
        if (asked & VISCERA_WITH_STIFFNESS) {
            right = right && viscera_held_stiffness(held, stiffness, 9 * contacts * contacts) == status;
            worst[1] = larger(worst[1], difference(file, stiffness, 9 * contacts * contacts));
        } else {
            right = right && viscera_held_stiffness(held, stiffness, 9 * contacts * contacts) == VISCERA_BAD_SETTING;
        }
        right = right && viscera_held_search(held, &search) == status;
        worst[2] = larger(worst[2], difference(file, &search.energy, 1));
        double error;
        const int verdict = viscera_held_assess(held, &error);
        worst[3] = larger(worst[3], difference(file, &error, 1));
        right = right && fscanf(file, "%d", &expected) == 1 && verdict == expected;
        worst[4] = larger(worst[4], difference(file, moved, 3 * count));
        worst[5] = larger(worst[5], difference(file, field, n));
        right = right && viscera_hands_stress(hands, field, n, stress, 9 * cells) == VISCERA_OK;
        right = right && viscera_von_mises(stress, cells, von_mises) == VISCERA_OK;
        worst[6] = larger(worst[6], difference(file, von_mises, cells));
        const int balance = viscera_hands_stress_error(hands, at, contacts, field, n, &error);
        worst[7] = larger(worst[7], difference(file, &error, 1));
        right = right && balance == (error > 0.15 ? VISCERA_ERROR_TOO_LARGE : VISCERA_OK);
        unbalanced += balance == VISCERA_ERROR_TOO_LARGE;
        searches++;
    }
    right = right && feof(file) && searches > 0;
    printf("%d searches; largest difference from Python: force %.1e, stiffness %.1e, energy %.1e, estimate %.1e, "
           "places %.1e, nodes %.1e, stress %.1e, its estimate %.1e\n",
           searches, worst[0], worst[1], worst[2], worst[3], worst[4], worst[5], worst[6], worst[7]);
    printf("stress that is not balanced: %d\n", unbalanced);
    for (int i = 0; i < 8; i++) right = right && worst[i] < 1e-10;
    printf("allocations: %ld\n", allocated);
    right = right && allocated <= 0;
    fclose(file);
    free(field);
    free(stress);
    free(von_mises);
    free(positions);
    viscera_places_free(places);
    viscera_held_free(held);
    viscera_grasp_free(grasp);
    viscera_hands_free(hands);
    viscera_free(model);
    return right ? 0 : 1;
}
