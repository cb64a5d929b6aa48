/* What a caller of several touches may get wrong, and what changes while they are in use: MODEL.viscera in, one line per
 * fault found out. */
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "viscera_hands.h"

static int faults = 0;

static void expect_at(int line, const char *claim, int holds) {
    if (!holds) {
        printf("line %d: not so: %s\n", line, claim);
        faults++;
    }
}
#define EXPECT(claim) expect_at(__LINE__, #claim, claim)

static const double LEFT_AND_RIGHT[6] = {0.36, 0.1, 0.2, 0.64, 0.1, 0.2};
static const double PUSHES[6] = {0, 0, -0.006, 0, 0.001, -0.005};
static char message[256];

static viscera_hands *hands_with(const viscera_model *model, uint64_t snapshots) {
    viscera_hands *hands = NULL;
    viscera_sampling sampling;
    EXPECT(viscera_sampling_init(model, &sampling) == VISCERA_OK);
    sampling.snapshots = snapshots;
    sampling.tolerance = 0.001;
    EXPECT(viscera_hands_new(model, &sampling, &hands, message, sizeof message) == VISCERA_OK);
    EXPECT(message[0] == 0);
    return hands;
}

static void settings(const viscera_model *model) {
    viscera_sampling right, wrong;
    viscera_hands *hands = NULL;
    EXPECT(viscera_sampling_init(NULL, &right) == VISCERA_NULL_POINTER && right.order == 0);
    EXPECT(viscera_sampling_init(model, NULL) == VISCERA_NULL_POINTER);
    viscera_sampling_init(model, &right);
    EXPECT(right.order == 3 && right.snapshots == 0 && right.tolerance == 0.01 && right.depth > 0);
    const struct { uint64_t order, snapshots; double tolerance, depth; const char *words; } cases[] = {
        {0, 0, 0.01, right.depth, "order 0"},      {UINT64_MAX, 0, 0.01, right.depth, "order"},
        {3, 201, 0.01, right.depth, "snapshots"},  {3, 0, 0, right.depth, "tolerance 0"},
        {3, 0, NAN, right.depth, "tolerance NaN"}, {3, 0, 0.01, -1, "depth -1"},
    };
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        wrong = right;
        wrong.order = cases[k].order, wrong.snapshots = cases[k].snapshots;
        wrong.tolerance = cases[k].tolerance, wrong.depth = cases[k].depth;
        hands = (viscera_hands *)&wrong; /* anything: a failure must clear it */
        EXPECT(viscera_hands_new(model, &wrong, &hands, message, sizeof message) == VISCERA_BAD_SETTING);
        EXPECT(hands == NULL && strstr(message, cases[k].words));
    }
    EXPECT(viscera_hands_new(NULL, &right, &hands, message, sizeof message) == VISCERA_NULL_POINTER);
    EXPECT(viscera_hands_new(model, NULL, &hands, NULL, 0) == VISCERA_NULL_POINTER);
    EXPECT(viscera_hands_new(model, &right, NULL, message, sizeof message) == VISCERA_NULL_POINTER);
    viscera_hands_free(NULL);
    viscera_grasp_free(NULL);
    viscera_held_free(NULL);
}

static int32_t twice(void *left) { return atomic_fetch_sub((atomic_int *)left, 1) > 0; }

static void grasps(const viscera_hands *hands, const viscera_hands *trained) {
    viscera_grasp *grasp = NULL;
    const double off[6] = {0.4, 0.1, 0.2, 0.6, 0.1, 1.0}, same[6] = {0.4, 0.1, 0.2, 0.4, 0.1, 0.2};
    EXPECT(viscera_grasp_new(hands, off, 2, NULL, NULL, &grasp, message, sizeof message) == VISCERA_BAD_SETTING);
    EXPECT(grasp == NULL && strstr(message, "contact 1"));
    EXPECT(viscera_grasp_new(hands, same, 2, NULL, NULL, &grasp, message, sizeof message) == VISCERA_BAD_SETTING);
    EXPECT(strstr(message, "so close") != NULL);
    EXPECT(viscera_grasp_new(hands, off, 0, NULL, NULL, &grasp, message, sizeof message) == VISCERA_BAD_SETTING);
    EXPECT(viscera_grasp_new(hands, NULL, 2, NULL, NULL, &grasp, NULL, 0) == VISCERA_NULL_POINTER);
    EXPECT(viscera_grasp_new(hands, off, SIZE_MAX, NULL, NULL, &grasp, NULL, 0) == VISCERA_NULL_POINTER);
    EXPECT(viscera_grasp_new(NULL, off, 2, NULL, NULL, &grasp, NULL, 0) == VISCERA_NULL_POINTER);
    EXPECT(viscera_grasp_in_background(hands, off, 2, &grasp, message, sizeof message) == VISCERA_BAD_SETTING);
    EXPECT(viscera_grasp_in_background(hands, LEFT_AND_RIGHT, 2, NULL, NULL, 0) == VISCERA_NULL_POINTER);
    atomic_int left = 2;
    EXPECT(viscera_grasp_new(trained, LEFT_AND_RIGHT, 2, twice, &left, &grasp, message, sizeof message) ==
           VISCERA_CANCELLED);
    EXPECT(grasp == NULL && strstr(message, "stopped") && atomic_load(&left) < 0);
}

/* A search that is refused leaves no answer, and every reader says why. */
static void reads(const viscera_held *held, int32_t expected) {
    double forces[6] = {1, 1, 1, 1, 1, 1}, stiffness[36], error = 0;
    viscera_search search;
    EXPECT(viscera_held_forces(held, forces, 6) == expected && forces[2] == 0);
    EXPECT(viscera_held_stiffness(held, stiffness, 36) == expected && stiffness[14] == 0);
    EXPECT(viscera_held_search(held, &search) == expected && search.energy == 0);
    EXPECT(viscera_held_assess(held, &error) == expected && error == 1);
}

/* A guard that is fed with the status of the forces lets the hand go when a search is refused. */
static void guarded(viscera_grasp *grasp, viscera_held *held) {
    const double none[6] = {NAN, 0, 0, 0, 0, 0};
    double forces[6];
    viscera_guard guard;
    viscera_guard_init(&guard, 100, 1e6, 0.02, 0.1);
    EXPECT(viscera_grasp_solve(grasp, PUSHES, 6, 0, 0, held) == VISCERA_OK);
    int32_t status = viscera_held_forces(held, forces, 6);
    EXPECT(viscera_guard_step(&guard, forces, status, 1e-3, NULL) == VISCERA_GUARD_FOLLOWS && guard.force[2] < 0);
    viscera_grasp_solve(grasp, none, 6, VISCERA_FROM_LAST, 0, held);
    status = viscera_held_forces(held, forces, 6);
    EXPECT(viscera_guard_step(&guard, forces, status, 1e-3, NULL) == VISCERA_GUARD_FADES);
}

static void answers(viscera_grasp *grasp) {
    viscera_held *held = NULL;
    double forces[6], stiffness[36], error = 0, far[6] = {0, 0, -0.2, 0, 0, -0.2}, deep[6] = {0, 0, -0.06, 0, 0, 0.06}, wrong[6] = {NAN, 0, 0, 0, 0, 0};
    float positions[3];
    viscera_search search;
    viscera_grasp_state state;
    EXPECT(viscera_held_new(NULL, &held, message, sizeof message) == VISCERA_NULL_POINTER && held == NULL);
    EXPECT(viscera_held_new(grasp, NULL, message, sizeof message) == VISCERA_NULL_POINTER);
    EXPECT(viscera_held_new(grasp, &held, message, sizeof message) == VISCERA_OK);

    reads(held, VISCERA_NOT_CONVERGED);
    EXPECT(viscera_held_assess(NULL, &error) == VISCERA_NULL_POINTER && error == 1);

    EXPECT(viscera_grasp_solve(NULL, PUSHES, 6, 0, 0, held) == VISCERA_NULL_POINTER);
    reads(held, VISCERA_NULL_POINTER);
    EXPECT(viscera_grasp_solve(grasp, PUSHES, 6, 0, 0, NULL) == VISCERA_NULL_POINTER);
    EXPECT(viscera_grasp_solve(grasp, NULL, 6, 0, 0, held) == VISCERA_NULL_POINTER);
    EXPECT(viscera_grasp_solve(grasp, PUSHES, 5, 0, 0, held) == VISCERA_SHORT_BUFFER);
    reads(held, VISCERA_SHORT_BUFFER);
    EXPECT(viscera_grasp_solve(grasp, wrong, 6, 0, 0, held) == VISCERA_NOT_FINITE);
    reads(held, VISCERA_NOT_FINITE);
    EXPECT(viscera_grasp_solve(grasp, PUSHES, 6, 4, 0, held) == VISCERA_BAD_SETTING);
    EXPECT(viscera_grasp_solve(grasp, PUSHES, 6, 0, -1, held) == VISCERA_BAD_SETTING);
    EXPECT(viscera_grasp_solve(grasp, PUSHES, 6, 0, NAN, held) == VISCERA_BAD_SETTING);
    reads(held, VISCERA_BAD_SETTING);
    guarded(grasp, held);

    /* An assessment that finds an answer wanting stands until one finds an answer trusted. */
    EXPECT(viscera_grasp_solve(grasp, far, 6, 0, 0, held) != VISCERA_OK);
    EXPECT(viscera_held_assess(held, &error) != VISCERA_OK);
    EXPECT(viscera_grasp_solve(grasp, deep, 6, 0, 0, held) == VISCERA_OK);
    EXPECT(viscera_held_assess(held, &error) == VISCERA_ERROR_TOO_LARGE && error > 0.01);
    EXPECT(viscera_grasp_solve(grasp, PUSHES, 6, 0, INFINITY, held) == VISCERA_ERROR_TOO_LARGE);
    EXPECT(viscera_held_assess(held, &error) == VISCERA_OK && error < 0.05);
    EXPECT(viscera_grasp_solve(grasp, PUSHES, 6, 0, 1e-9, held) == VISCERA_OUT_OF_TIME);
    EXPECT(viscera_held_search(held, &search) == VISCERA_OUT_OF_TIME && search.iterations <= 1);
    EXPECT(viscera_grasp_solve(grasp, PUSHES, 6, VISCERA_FROM_LAST, 0, held) == VISCERA_OK);

    EXPECT(viscera_held_forces(held, forces, 5) == VISCERA_SHORT_BUFFER);
    EXPECT(viscera_held_forces(held, NULL, 6) == VISCERA_NULL_POINTER);
    EXPECT(viscera_held_forces(held, forces, 6) == VISCERA_OK && forces[2] < 0);
    EXPECT(viscera_held_stiffness(held, stiffness, 36) == VISCERA_BAD_SETTING && stiffness[0] == 0);
    EXPECT(viscera_held_stiffness(held, stiffness, 35) == VISCERA_SHORT_BUFFER);
    EXPECT(viscera_held_surface(held, positions, 3) == VISCERA_SHORT_BUFFER);
    EXPECT(viscera_held_field(NULL, stiffness, 36) == VISCERA_NULL_POINTER);
    EXPECT(viscera_held_places(held, NULL, stiffness, 36) == VISCERA_NULL_POINTER);
    EXPECT(viscera_held_search(held, NULL) == VISCERA_NULL_POINTER);
    EXPECT(viscera_grasp_progress(grasp, NULL) == VISCERA_NULL_POINTER);
    EXPECT(viscera_grasp_progress(grasp, &state) == VISCERA_OK && state.contacts == 2 && state.modes > 40);
    EXPECT(state.training == VISCERA_TRAINING_OVER && state.snapshots == 0 && state.cells > 0);
    viscera_held_free(held);
}

/* Answers of a grasp that trains meanwhile, drawn and assessed by another thread. */
static viscera_held *_Atomic newest;
static atomic_int is_over;

static void *assess(void *room) {
    viscera_held *mine = room;
    double error;
    while (!atomic_load(&is_over)) {
        mine = atomic_exchange(&newest, mine);
        viscera_held_assess(mine, &error);
    }
    return mine;
}

static void training(const viscera_hands *trained) {
    viscera_grasp *grasp = NULL;
    viscera_held *mine = NULL, *theirs = NULL, *between = NULL;
    viscera_grasp_state state = {0, 0, 0, 0, 0, VISCERA_TRAINING_GOES_ON};
    pthread_t thread;
    void *left;
    double pushes[6];
    EXPECT(viscera_grasp_in_background(trained, LEFT_AND_RIGHT, 2, &grasp, message, sizeof message) == VISCERA_OK);
    EXPECT(viscera_held_new(grasp, &mine, NULL, 0) == VISCERA_OK);
    EXPECT(viscera_held_new(grasp, &theirs, NULL, 0) == VISCERA_OK);
    EXPECT(viscera_held_new(grasp, &between, NULL, 0) == VISCERA_OK);
    atomic_store(&newest, between);
    EXPECT(pthread_create(&thread, NULL, assess, theirs) == 0);
    int answered = 1;
    for (int tick = 0; tick < 100000 && (tick < 200 || state.training == VISCERA_TRAINING_GOES_ON); tick++) {
        for (int k = 0; k < 6; k++) pushes[k] = PUSHES[k] * (0.8 + 0.2 * sin(0.01 * tick));
        const int status = viscera_grasp_solve(grasp, pushes, 6, VISCERA_FROM_LAST, 0, mine);
        answered = answered && (status == VISCERA_OK || status == VISCERA_ERROR_TOO_LARGE);
        mine = atomic_exchange(&newest, mine);
        viscera_grasp_progress(grasp, &state);
    }
    EXPECT(answered);
    EXPECT(state.training != VISCERA_TRAINING_FAILED && state.snapshots > 0);
    int32_t added = 1;
    EXPECT(viscera_grasp_add_snapshot(grasp, &added, message, sizeof message) == VISCERA_BAD_SETTING && added == 0);
    EXPECT(strstr(message, "in the background") != NULL);
    EXPECT(viscera_grasp_add_snapshot(NULL, NULL, NULL, 0) == VISCERA_NULL_POINTER);
    viscera_grasp_free(grasp);
    atomic_store(&is_over, 1);
    pthread_join(thread, &left);
    /* Answers outlive their grasp. */
    double error;
    viscera_held_assess(mine, &error);
    viscera_held_free(mine);
    viscera_held_free(left);
    viscera_held_free(atomic_load(&newest));
}

/* In units so small that forces overflow, none of them is infinite. */
static void overflowing(viscera_model *model) {
    viscera_frame frame;
    viscera_grasp *grasp = NULL;
    viscera_held *held = NULL;
    double forces[6] = {0, 0, 1, 0, 0, 1}, stiffness[36];
    viscera_frame_identity(&frame);
    frame.newtons_per_unit = 1e-310;
    EXPECT(viscera_set_frame(model, &frame) == VISCERA_OK);
    viscera_hands *hands = hands_with(model, 0);
    frame.newtons_per_unit = 1;
    EXPECT(viscera_set_frame(model, &frame) == VISCERA_OK);
    EXPECT(viscera_grasp_new(hands, LEFT_AND_RIGHT, 2, NULL, NULL, &grasp, message, sizeof message) == VISCERA_OK);
    EXPECT(viscera_held_new(grasp, &held, message, sizeof message) == VISCERA_OK);
    EXPECT(viscera_grasp_solve(grasp, PUSHES, 6, VISCERA_WITH_STIFFNESS, 0, held) == VISCERA_OK);
    EXPECT(viscera_held_forces(held, forces, 6) == VISCERA_NOT_FINITE && forces[2] == 0);
    EXPECT(viscera_held_stiffness(held, stiffness, 36) == VISCERA_NOT_FINITE && stiffness[14] == 0);
    viscera_held_free(held);
    viscera_grasp_free(grasp);
    viscera_hands_free(hands);
}

/* A grasp writes into no memory of another, whose verdict and frame it would take. */
static void strangers(viscera_hands *hands, viscera_grasp *grasp) {
    viscera_grasp *other = NULL;
    viscera_held *held = NULL;
    double forces[6];
    EXPECT(viscera_grasp_new(hands, LEFT_AND_RIGHT, 2, NULL, NULL, &other, message, sizeof message) == VISCERA_OK);
    EXPECT(viscera_held_new(other, &held, message, sizeof message) == VISCERA_OK);
    EXPECT(viscera_grasp_solve(grasp, PUSHES, 6, 0, 0, held) == VISCERA_BAD_SETTING);
    reads(held, VISCERA_BAD_SETTING);
    EXPECT(viscera_grasp_solve(other, PUSHES, 6, 0, 0, held) == VISCERA_OK);
    viscera_grasp_free(other);
    EXPECT(viscera_held_forces(held, forces, 6) == VISCERA_OK && forces[2] != 0);
    viscera_held_free(held);
}

static void stress(const viscera_hands *hands, size_t n) {
    double few[9] = {0}, error = 0, *field = calloc(n, sizeof(double));
    const double off[3] = {0, 0, 9}, wrong[3] = {NAN, 0, 0};
    EXPECT(viscera_hands_stress(hands, few, 9, few, 9) == VISCERA_SHORT_BUFFER);
    EXPECT(viscera_hands_stress(NULL, few, 9, few, 9) == VISCERA_NULL_POINTER);
    EXPECT(viscera_von_mises(NULL, 1, few) == VISCERA_NULL_POINTER);
    EXPECT(viscera_hands_stress_error(hands, LEFT_AND_RIGHT, 2, field, n, &error) == VISCERA_OK && error == 0);
    EXPECT(viscera_hands_stress_error(hands, LEFT_AND_RIGHT, 2, few, 9, &error) == VISCERA_SHORT_BUFFER && error == 1);
    EXPECT(viscera_hands_stress_error(NULL, LEFT_AND_RIGHT, 2, field, n, &error) == VISCERA_NULL_POINTER && error == 1);
    EXPECT(viscera_hands_stress_error(hands, NULL, 2, field, n, &error) == VISCERA_NULL_POINTER && error == 1);
    EXPECT(viscera_hands_stress_error(hands, LEFT_AND_RIGHT, 2, field, n, NULL) == VISCERA_NULL_POINTER);
    EXPECT(viscera_hands_stress_error(hands, off, 1, field, n, &error) == VISCERA_OFF_SURFACE && error == 1);
    EXPECT(viscera_hands_stress_error(hands, wrong, 1, field, n, &error) == VISCERA_NOT_FINITE && error == 1);
    for (size_t i = 0; i < n; i++) field[i] = 1e3 * (double)((i * 7919) % 13);
    EXPECT(viscera_hands_stress_error(hands, LEFT_AND_RIGHT, 2, field, n, &error) == VISCERA_INVERTED && error == 1);
    free(field);
}

int main(int argc, char **argv) {
    viscera_model *model = NULL;
    viscera_grasp *grasp = NULL;
    if (argc != 2 || viscera_load_file(argv[1], &model, NULL, 0) != VISCERA_OK) return 2;
    settings(model);
    overflowing(model);
    viscera_info_t info;
    viscera_info(model, &info);
    viscera_hands *hands = hands_with(model, 0), *trained = hands_with(model, 24);
    viscera_free(model); /* each has a copy */
    grasps(hands, trained);
    EXPECT(viscera_grasp_new(hands, LEFT_AND_RIGHT, 2, NULL, NULL, &grasp, message, sizeof message) == VISCERA_OK);
    strangers(hands, grasp);
    viscera_hands_free(hands);
    answers(grasp);
    viscera_grasp_free(grasp);
    training(trained);
    stress(trained, 3 * (size_t)info.points);
    viscera_hands_free(trained);
    printf("%d faults\n", faults);
    return faults ? 1 : 0;
}
