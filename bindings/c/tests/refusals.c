/* What a caller may get wrong, each told by a status: MODEL.viscera in, one line per fault found out. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "viscera.h"

static int faults = 0;

static void expect_at(int line, const char *claim, int holds) {
    if (!holds) {
        printf("line %d: not so: %s\n", line, claim);
        faults++;
    }
}
#define EXPECT(claim) expect_at(__LINE__, #claim, claim)

static uint8_t *contents(const char *path, size_t *len) {
    FILE *file = fopen(path, "rb");
    uint8_t *bytes = NULL;
    if (!file) return NULL;
    fseek(file, 0, SEEK_END);
    *len = (size_t)ftell(file);
    rewind(file);
    bytes = malloc(*len);
    if (bytes && fread(bytes, 1, *len, file) != *len) *len = 0;
    fclose(file);
    return bytes;
}

/* The byte behind the first place where the bytes read as a text. */
static uint8_t *after(uint8_t *bytes, size_t len, const char *text) {
    const size_t n = strlen(text);
    for (size_t i = 0; i + n < len; i++) {
        if (memcmp(bytes + i, text, n) == 0) return bytes + i + n;
    }
    return NULL;
}

static void loading(const char *path) {
    char message[200], small[8];
    size_t len = 0, cuts[] = {0, 1, 8, 1000, 0, 0};
    viscera_model *model = NULL;
    uint8_t *bytes = contents(path, &len);
    cuts[4] = len / 2;
    cuts[5] = len - 1;
    for (int i = 0; i < 6; i++) {
        model = (viscera_model *)&len; /* anything: a failed load must clear it */
        EXPECT(viscera_load(bytes, cuts[i], &model, message, sizeof message) == VISCERA_BAD_MODEL);
        EXPECT(model == NULL);
        EXPECT(strlen(message) > 10 && strchr(message, '\n') == NULL);
    }
    EXPECT(viscera_load((const uint8_t *)"no model, only words", 20, &model, small, sizeof small) == VISCERA_BAD_MODEL);
    EXPECT(strlen(small) == sizeof small - 1);
    EXPECT(viscera_load(bytes, len, NULL, message, sizeof message) == VISCERA_NULL_POINTER);
    EXPECT(viscera_load(NULL, len, &model, message, sizeof message) == VISCERA_NULL_POINTER);
    EXPECT(viscera_load(bytes, SIZE_MAX, &model, NULL, 0) == VISCERA_BAD_MODEL);
    EXPECT(viscera_load_file(NULL, &model, NULL, 0) == VISCERA_NULL_POINTER);
    EXPECT(viscera_load_file("nowhere.viscera", &model, message, sizeof message) == VISCERA_BAD_MODEL);
    EXPECT(strstr(message, "nowhere.viscera") != NULL);
    /* A long path loses its beginning, so that the reason and the name of the file are there. */
    char deep[600], reason[200];
    snprintf(reason, sizeof reason, "%s", strchr(message, ':'));
    memset(deep, 'x', sizeof deep);
    for (size_t k = 0; k < sizeof deep; k += 3) memcpy(deep + k, "\xc3\xa9/", 3); /* an e with an accent */
    strcpy(deep + sizeof deep - 17, "/nowhere.viscera");
    EXPECT(viscera_load_file(deep, &model, message, sizeof message) == VISCERA_BAD_MODEL);
    EXPECT(strlen(message) > sizeof message - 4 && strncmp(message, "...", 3) == 0 && (uint8_t)message[3] != 0xa9);
    EXPECT(strstr(message, "/nowhere.viscera: ") != NULL && strstr(message, reason) != NULL);
    EXPECT(viscera_load_file(deep, &model, small, sizeof small) == VISCERA_BAD_MODEL);
    EXPECT(strncmp(small, "...: ", 5) == 0 && strlen(small) == sizeof small - 1);
    EXPECT(viscera_load(bytes, len, &model, message, sizeof message) == VISCERA_OK);
    EXPECT(model != NULL && message[0] == 0);
    viscera_free(model);
    uint8_t *version = after(bytes, len, "format_version\\\":");
    EXPECT(version != NULL && *version < '9');
    uint8_t kept = version ? *version : 0;
    if (version) *version = '9';
    EXPECT(viscera_load(bytes, len, &model, message, sizeof message) == VISCERA_BAD_MODEL && model == NULL);
    EXPECT(strstr(message, "format version 9") != NULL);
    if (version) *version = kept;
    for (int i = 0; i < 8; i++) bytes[i] = 0xff; /* a header longer than all memory */
    EXPECT(viscera_load(bytes, len, &model, message, sizeof message) == VISCERA_BAD_MODEL && model == NULL);
    viscera_free(NULL);
    free(bytes);
}

static void touching(viscera_model *model) {
    const double far[3] = {0, 0, 1e3}, nowhere[3] = {NAN, 0, 0}, huge[3] = {1e300, 0, -1e300};
    const double push[3] = {0, 0, -0.001}, not_a_push[3] = {0, INFINITY, 0}, none[3] = {0, 0, 0};
    double contact[3], distance;
    viscera_info_t info;
    viscera_answer answer;
    EXPECT(viscera_info(NULL, &info) == VISCERA_NULL_POINTER && info.points == 0);
    EXPECT(viscera_info(model, &info) == VISCERA_OK && info.points > info.surface_nodes);
    EXPECT(viscera_info(model, NULL) == VISCERA_NULL_POINTER);
    EXPECT(viscera_locate(model, far, contact, &distance) == VISCERA_OK && distance > 900);
    EXPECT(viscera_locate(model, far, NULL, NULL) == VISCERA_OK);
    EXPECT(viscera_locate(model, nowhere, contact, &distance) == VISCERA_NOT_FINITE);
    EXPECT(viscera_locate(NULL, far, contact, &distance) == VISCERA_NULL_POINTER);
    EXPECT(viscera_locate(model, NULL, contact, &distance) == VISCERA_NULL_POINTER);

    EXPECT(viscera_evaluate(model, contact, push, &answer) == VISCERA_OK && answer.force[2] < 0);
    EXPECT(viscera_evaluate(model, contact, none, &answer) == VISCERA_OK && answer.force[2] == 0);
    EXPECT(viscera_evaluate(model, far, push, &answer) == VISCERA_OFF_SURFACE);
    EXPECT(answer.force[2] == 0 && answer.stiffness[8] == 0 && answer.error_estimate == 1 &&
           answer.shape_error_estimate == 1);
    EXPECT(viscera_evaluate(model, nowhere, push, &answer) == VISCERA_NOT_FINITE);
    EXPECT(viscera_evaluate(model, contact, not_a_push, &answer) == VISCERA_NOT_FINITE);
    EXPECT(viscera_evaluate(model, contact, huge, &answer) == VISCERA_NOT_FINITE && answer.force[0] == 0);
    EXPECT(viscera_evaluate(model, huge, push, &answer) == VISCERA_OFF_SURFACE);
    EXPECT(viscera_evaluate(NULL, contact, push, &answer) == VISCERA_NULL_POINTER && answer.force[2] == 0);
    EXPECT(viscera_evaluate(model, NULL, push, &answer) == VISCERA_NULL_POINTER);
    EXPECT(viscera_evaluate(model, contact, NULL, &answer) == VISCERA_NULL_POINTER);
    EXPECT(viscera_evaluate(model, contact, push, NULL) == VISCERA_NULL_POINTER);

    const double too_deep[3] = {0, 0, -2 * info.depth};
    EXPECT(viscera_evaluate(model, contact, too_deep, &answer) == VISCERA_BEYOND_DEPTH);
    EXPECT(isfinite(answer.force[2]));
}

static void drawing(viscera_model *model) {
    const double far[3] = {0, 0, 1e3}, push[3] = {0, 0, -0.001}, nowhere[3] = {NAN, 0, 0}, huge[3] = {0, 1e12, 0};
    double contact[3];
    viscera_info_t info;
    viscera_info(model, &info);
    viscera_locate(model, far, contact, NULL);
    const size_t n_work = viscera_workspace_size(model), n = 3 * (size_t)info.surface_nodes;
    const size_t n_triangles = 3 * (size_t)info.surface_triangles;
    float *work = malloc(n_work * sizeof(float)), *x = malloc((n + 1) * sizeof(float));
    uint32_t *triangles = malloc(n_triangles * sizeof(uint32_t)), *nodes = malloc(n / 3 * sizeof(uint32_t));
    EXPECT(viscera_workspace_size(NULL) == 0 && n_work > 0);
    x[0] = x[n] = 12345;
    EXPECT(viscera_surface(model, contact, push, work, n_work - 1, x, n) == VISCERA_SHORT_BUFFER);
    EXPECT(viscera_surface(model, contact, push, work, n_work, x, n - 1) == VISCERA_SHORT_BUFFER);
    EXPECT(viscera_surface(model, contact, push, NULL, n_work, x, n) == VISCERA_NULL_POINTER);
    EXPECT(viscera_surface(model, contact, push, work, n_work, NULL, n) == VISCERA_NULL_POINTER);
    EXPECT(viscera_surface(NULL, contact, push, work, n_work, x, n) == VISCERA_NULL_POINTER);
    EXPECT(viscera_surface(model, NULL, push, work, n_work, x, n) == VISCERA_NULL_POINTER);
    EXPECT(viscera_surface(model, contact, NULL, work, n_work, x, n) == VISCERA_NULL_POINTER);
    EXPECT(x[0] == 12345);
    EXPECT(viscera_surface(model, contact, nowhere, work, n_work, x, n) == VISCERA_NOT_FINITE && isfinite(x[0]));
    EXPECT(viscera_surface(model, far, push, work, n_work, x, n) == VISCERA_OFF_SURFACE && x[0] != 12345);
    EXPECT(viscera_surface(model, contact, huge, work, n_work, x, n) != VISCERA_OK);
    for (size_t i = 0; i < n; i++) EXPECT(isfinite(x[i]));
    EXPECT(viscera_surface(model, contact, push, work, n_work, x, n + 1) == VISCERA_OK && x[n] == 12345);

    EXPECT(viscera_surface_topology(NULL, triangles, n_triangles, nodes, n / 3) == VISCERA_NULL_POINTER);
    EXPECT(viscera_surface_topology(model, triangles, n_triangles - 1, nodes, n / 3) == VISCERA_SHORT_BUFFER);
    EXPECT(viscera_surface_topology(model, triangles, n_triangles, nodes, n / 3 - 1) == VISCERA_SHORT_BUFFER);
    EXPECT(viscera_surface_topology(model, NULL, 0, NULL, 0) == VISCERA_OK);
    EXPECT(viscera_surface_topology(model, triangles, n_triangles, nodes, n / 3) == VISCERA_OK);
    for (size_t i = 0; i < n_triangles; i++) EXPECT(triangles[i] < n / 3);
    for (size_t i = 0; i < n / 3; i++) EXPECT(nodes[i] < info.points);
    free(nodes);
    free(triangles);
    free(x);
    free(work);
}

static void looking_inside(viscera_model *model) {
    const double far[3] = {0, 0, 1e3}, push[3] = {0, 0, -0.001}, nowhere[3] = {NAN, 0, 0}, huge[3] = {1e300, 0, -1e300};
    double contact[3], energy = 1, moved[6];
    char message[256];
    viscera_info_t info;
    viscera_info(model, &info);
    viscera_locate(model, far, contact, NULL);
    EXPECT(viscera_energy(model, contact, push, &energy) == VISCERA_OK && energy > 0);
    EXPECT(viscera_energy(model, far, push, &energy) == VISCERA_OFF_SURFACE && energy == 0);
    EXPECT(viscera_energy(model, contact, nowhere, &energy) == VISCERA_NOT_FINITE && energy == 0);
    EXPECT(viscera_energy(model, contact, huge, &energy) == VISCERA_NOT_FINITE && energy == 0);
    EXPECT(viscera_energy(NULL, contact, push, &energy) == VISCERA_NULL_POINTER && energy == 0);
    EXPECT(viscera_energy(model, contact, push, NULL) == VISCERA_NULL_POINTER);

    const size_t n_work = viscera_field_workspace_size(model), n = 3 * (size_t)info.points;
    const size_t n_cells = 4 * viscera_cell_count(model);
    float *work = malloc(n_work * sizeof(float)), *u = malloc((n + 1) * sizeof(float));
    double *points = malloc(n * sizeof(double));
    uint32_t *cells = malloc(n_cells * sizeof(uint32_t));
    EXPECT(viscera_field_workspace_size(NULL) == 0 && viscera_cell_count(NULL) == 0 && n_cells > 0);
    u[0] = u[n] = 12345;
    EXPECT(viscera_field(model, contact, push, work, n_work - 1, u, n) == VISCERA_SHORT_BUFFER);
    EXPECT(viscera_field(model, contact, push, work, n_work, u, n - 1) == VISCERA_SHORT_BUFFER);
    EXPECT(viscera_field(model, contact, push, NULL, n_work, u, n) == VISCERA_NULL_POINTER);
    EXPECT(viscera_field(model, contact, push, work, n_work, NULL, n) == VISCERA_NULL_POINTER);
    EXPECT(viscera_field(NULL, contact, push, work, n_work, u, n) == VISCERA_NULL_POINTER);
    EXPECT(u[0] == 12345);
    EXPECT(viscera_field(model, far, push, work, n_work, u, n) == VISCERA_OFF_SURFACE && u[0] == 0 && u[n - 1] == 0);
    EXPECT(viscera_field(model, contact, push, work, n_work, u, n + 1) == VISCERA_OK && u[n] == 12345);
    EXPECT(viscera_mesh(NULL, points, n, cells, n_cells) == VISCERA_NULL_POINTER);
    EXPECT(viscera_mesh(model, points, n - 1, cells, n_cells) == VISCERA_SHORT_BUFFER);
    EXPECT(viscera_mesh(model, points, n, cells, n_cells - 1) == VISCERA_SHORT_BUFFER);
    EXPECT(viscera_mesh(model, NULL, 0, NULL, 0) == VISCERA_OK);
    EXPECT(viscera_mesh(model, points, n, cells, n_cells) == VISCERA_OK);
    for (size_t i = 0; i < n_cells; i++) EXPECT(cells[i] < info.points);

    const double pair[6] = {contact[0], contact[1], contact[2], points[3], points[4], points[5]};
    const uint32_t node = 0, wrong = (uint32_t)info.points;
    viscera_places *places = (viscera_places *)&info; /* anything: a failure must clear it */
    EXPECT(viscera_places_at(model, far, 1, &places, message, sizeof message) == VISCERA_BAD_SETTING);
    EXPECT(places == NULL && strstr(message, "outside the organ") != NULL);
    EXPECT(viscera_places_at(model, nowhere, 1, &places, NULL, 0) == VISCERA_BAD_SETTING);
    EXPECT(viscera_places_at(model, NULL, 1, &places, message, sizeof message) == VISCERA_NULL_POINTER);
    EXPECT(viscera_places_at(model, pair, SIZE_MAX, &places, message, sizeof message) == VISCERA_NULL_POINTER);
    EXPECT(viscera_places_at(NULL, pair, 2, &places, message, sizeof message) == VISCERA_NULL_POINTER);
    EXPECT(viscera_places_at(model, pair, 2, NULL, message, sizeof message) == VISCERA_NULL_POINTER);
    EXPECT(viscera_places_of_nodes(model, &wrong, 1, &places, message, sizeof message) == VISCERA_BAD_SETTING);
    EXPECT(places == NULL && strstr(message, "nodes 0 to") != NULL);
    EXPECT(viscera_places_of_nodes(model, NULL, 1, &places, NULL, 0) == VISCERA_NULL_POINTER && places == NULL);
    EXPECT(viscera_places_of_nodes(model, &node, 0, &places, message, sizeof message) == VISCERA_OK);
    EXPECT(viscera_places_displacement(places, contact, push, moved, 0) == VISCERA_OK);
    viscera_places_free(places);
    EXPECT(viscera_places_at(model, pair, 2, &places, message, sizeof message) == VISCERA_OK && message[0] == 0);
    EXPECT(viscera_places_displacement(places, contact, push, moved, 5) == VISCERA_SHORT_BUFFER);
    EXPECT(viscera_places_displacement(places, contact, push, NULL, 6) == VISCERA_NULL_POINTER);
    EXPECT(viscera_places_displacement(NULL, contact, push, moved, 6) == VISCERA_NULL_POINTER);
    EXPECT(viscera_places_displacement(places, NULL, push, moved, 6) == VISCERA_NULL_POINTER);
    EXPECT(viscera_places_displacement(places, contact, push, moved, 6) == VISCERA_OK && moved[2] < 0);
    EXPECT(viscera_places_displacement(places, far, push, moved, 6) == VISCERA_OFF_SURFACE && moved[2] == 0);
    EXPECT(viscera_places_displacement(places, contact, nowhere, moved, 6) == VISCERA_NOT_FINITE && moved[2] == 0);
    viscera_places_free(places);
    viscera_places_free(NULL);
    free(work);
    free(u);
    free(points);
    free(cells);
}

/* Of a model without a parameter; bindings/c/tests/inside.c sets one. */
static void varying(viscera_model *model) {
    viscera_parameter parameter = {1, 2, 3};
    viscera_model *copy = (viscera_model *)&parameter; /* anything: a failure must clear it */
    char message[256];
    EXPECT(viscera_parameter_name(NULL)[0] == 0 && viscera_parameter_name(model)[0] == 0);
    EXPECT(viscera_get_parameter(model, &parameter) == VISCERA_BAD_SETTING && parameter.value == 0);
    EXPECT(viscera_get_parameter(NULL, &parameter) == VISCERA_NULL_POINTER);
    EXPECT(viscera_get_parameter(model, NULL) == VISCERA_NULL_POINTER);
    EXPECT(viscera_set_parameter(model, 1, message, sizeof message) == VISCERA_BAD_SETTING);
    EXPECT(strstr(message, "no parameter") != NULL);
    EXPECT(viscera_set_parameter(NULL, 1, message, sizeof message) == VISCERA_NULL_POINTER);
    EXPECT(viscera_copy(NULL, &copy, message, sizeof message) == VISCERA_NULL_POINTER && copy == NULL);
    EXPECT(viscera_copy(model, NULL, message, sizeof message) == VISCERA_NULL_POINTER);
    EXPECT(viscera_copy(model, &copy, message, sizeof message) == VISCERA_OK && copy != NULL && message[0] == 0);
    viscera_free(copy);
}

static void settings(viscera_model *model) {
    viscera_frame frame;
    viscera_guard guard;
    double force[3] = {1, 2, 2};
    viscera_frame_identity(NULL);
    viscera_frame_identity(&frame);
    EXPECT(viscera_set_frame(model, NULL) == VISCERA_NULL_POINTER);
    EXPECT(viscera_set_frame(NULL, &frame) == VISCERA_NULL_POINTER);
    EXPECT(viscera_set_frame(model, &frame) == VISCERA_OK);
    frame.metres_per_unit = 0;
    EXPECT(viscera_set_frame(model, &frame) == VISCERA_BAD_SETTING);
    frame.metres_per_unit = 1;
    frame.rotation[1] = 0.1;
    EXPECT(viscera_set_frame(model, &frame) == VISCERA_BAD_SETTING);

    EXPECT(viscera_guard_init(NULL, 1, 1, 1, 1) == VISCERA_NULL_POINTER);
    EXPECT(viscera_guard_init(&guard, 1, NAN, 1, 1) == VISCERA_BAD_SETTING);
    EXPECT(viscera_guard_step(&guard, force, VISCERA_OK, 1e-3, force) == VISCERA_GUARD_REFUSES && force[0] == 0);
    force[0] = 1;
    EXPECT(viscera_guard_step(NULL, force, VISCERA_OK, 1e-3, force) == VISCERA_GUARD_REFUSES && force[0] == 0);
    EXPECT(viscera_guard_init(&guard, 1, 1, 1, 1) == VISCERA_OK);
    EXPECT(viscera_guard_step(&guard, NULL, VISCERA_OK, 1e-3, NULL) == VISCERA_GUARD_FADES);

    const double still[3] = {0, 0, 0};
    EXPECT(viscera_guard_keep_passive(NULL, 1, 1) == VISCERA_NULL_POINTER);
    EXPECT(viscera_guard_keep_passive(&guard, 1, 1) == VISCERA_OK);
    force[0] = 1;
    EXPECT(viscera_guard_step_moved(&guard, force, VISCERA_OK, still, 1, force) == VISCERA_GUARD_FOLLOWS && force[0] == 1);
    EXPECT(viscera_guard_step_moved(&guard, force, VISCERA_OK, NULL, 0.1, force) == VISCERA_GUARD_FADES);
    EXPECT(viscera_guard_step_moved(NULL, force, VISCERA_OK, still, 1, NULL) == VISCERA_GUARD_REFUSES);
    const double wrong[4][2] = {{0, 1}, {-1, 1}, {NAN, 1}, {1, -1}};
    for (int i = 0; i < 4; i++) {
        EXPECT(viscera_guard_init(&guard, 1, 1, 1, 1) == VISCERA_OK);
        EXPECT(viscera_guard_keep_passive(&guard, wrong[i][0], wrong[i][1]) == VISCERA_BAD_SETTING);
        force[0] = force[1] = force[2] = 1;
        const int32_t mode = viscera_guard_step_moved(&guard, force, VISCERA_OK, still, 1, force);
        EXPECT(mode == VISCERA_GUARD_REFUSES && force[0] == 0);
    }
    for (int32_t status = -1; status <= VISCERA_INSIDE + 1; status++) EXPECT(strlen(viscera_status_text(status)) > 5);
}

/* In units so small that what is told in them overflows, no infinite force is trusted. */
static void overflowing(viscera_model *model) {
    const double far[3] = {0.5, 0.1, 1e3}, none[3] = {0, 0, 0}, push[3] = {0, 0, -0.001};
    double top[3];
    int32_t status;
    viscera_info_t info;
    viscera_frame frame;
    viscera_answer answer;
    viscera_probe *probe = NULL;
    viscera_probes *group = NULL;
    viscera_felt felt;
    viscera_info(model, &info);
    viscera_locate(model, far, top, NULL);
    viscera_frame_identity(&frame);
    frame.newtons_per_unit = 1e-310;
    EXPECT(viscera_set_frame(model, &frame) == VISCERA_OK);
    EXPECT(viscera_evaluate(model, top, push, &answer) == VISCERA_NOT_FINITE);
    EXPECT(answer.force[2] == 0 && answer.stiffness[8] == 0 && answer.error_estimate == 1);
    EXPECT(viscera_evaluate(model, top, none, &answer) == VISCERA_NOT_FINITE && answer.stiffness[8] == 0);
    EXPECT(viscera_probe_new(model, info.radius, 0.2, &probe, NULL, 0) == VISCERA_OK);
    EXPECT(viscera_probes_new(&probe, 1, &group, NULL, 0) == VISCERA_OK);
    const double above[3] = {top[0], top[1], top[2] + 1.1 * info.radius};
    const double pressed[3] = {top[0], top[1], top[2] + 0.95 * info.radius};
    EXPECT(viscera_probe_place(probe, above, &felt) == VISCERA_OFF_SURFACE);
    EXPECT(viscera_probe_place(probe, pressed, &felt) == VISCERA_NOT_FINITE);
    EXPECT(felt.force[2] == 0 && felt.error_estimate == 1 && felt.grip == VISCERA_PROBE_FREE);
    EXPECT(viscera_probes_place(group, pressed, &felt, &status) == VISCERA_OK);
    EXPECT(status == VISCERA_NOT_FINITE && felt.force[2] == 0);
    viscera_probes_free(group);
    viscera_probe_free(probe);
    frame.newtons_per_unit = 1;
    frame.metres_per_unit = 1e-310;
    EXPECT(viscera_set_frame(model, &frame) == VISCERA_OK);
    EXPECT(viscera_locate(model, none, top, NULL) == VISCERA_NOT_FINITE);
    frame.metres_per_unit = 1;
    EXPECT(viscera_set_frame(model, &frame) == VISCERA_OK);
}

static void probing(viscera_model *model) {
    const double far[3] = {0.5, 0.1, 1e3}, nowhere[3] = {NAN, 0, 0};
    double top[3];
    char message[256];
    viscera_info_t info;
    viscera_probe *probe = (viscera_probe *)&info; /* anything: a failure must clear it */
    viscera_felt felt;
    viscera_info(model, &info);
    viscera_locate(model, far, top, NULL);
    const double r = info.radius;
    EXPECT(viscera_probe_new(model, 0.5 * r, 0, &probe, message, sizeof message) == VISCERA_BAD_SETTING);
    EXPECT(probe == NULL && strstr(message, "radius of a probe") != NULL);
    EXPECT(viscera_probe_new(model, NAN, 0, &probe, NULL, 0) == VISCERA_BAD_SETTING && probe == NULL);
    EXPECT(viscera_probe_new(model, r, -1, &probe, message, sizeof message) == VISCERA_BAD_SETTING);
    EXPECT(strstr(message, "friction of a probe") != NULL);
    EXPECT(viscera_probe_new(NULL, r, 0, &probe, message, sizeof message) == VISCERA_NULL_POINTER && probe == NULL);
    EXPECT(viscera_probe_new(model, r, 0, NULL, message, sizeof message) == VISCERA_NULL_POINTER);
    EXPECT(viscera_probe_new(model, r, 0.2, &probe, message, sizeof message) == VISCERA_OK && message[0] == 0);
    EXPECT(viscera_probe_couple(NULL, 1, 1) == VISCERA_NULL_POINTER);
    EXPECT(viscera_probe_couple(probe, 0, 1) == VISCERA_BAD_SETTING);
    EXPECT(viscera_probe_couple(probe, 1, NAN) == VISCERA_BAD_SETTING);
    EXPECT(viscera_probe_tolerate(NULL, 0.2) == VISCERA_NULL_POINTER);
    EXPECT(viscera_probe_tolerate(probe, 0) == VISCERA_BAD_SETTING);
    EXPECT(viscera_probe_lift(NULL) == VISCERA_NULL_POINTER);

    const double deep[3] = {top[0], top[1], top[2] + 0.2 * r}, above[3] = {top[0], top[1], top[2] + 1.1 * r};
    const double pressed[3] = {top[0], top[1], top[2] + 0.95 * r};
    EXPECT(viscera_probe_place(probe, deep, &felt) == VISCERA_INSIDE && felt.force[2] == 0);
    EXPECT(viscera_probe_place(probe, pressed, &felt) == VISCERA_INSIDE && felt.error_estimate == 1);
    EXPECT(viscera_probe_place(probe, above, &felt) == VISCERA_OFF_SURFACE && felt.gap > 0);
    EXPECT(viscera_probe_place(probe, pressed, &felt) == VISCERA_OK && felt.force[2] < 0);
    EXPECT(felt.grip != VISCERA_PROBE_FREE && felt.gap < 0 && felt.displacement[2] < 0);
    EXPECT(viscera_probe_place(probe, nowhere, &felt) == VISCERA_NOT_FINITE && felt.force[2] == 0);
    EXPECT(isfinite(felt.center[0]) && isfinite(felt.gap));
    EXPECT(viscera_probe_lift(probe) == VISCERA_OK);
    EXPECT(viscera_probe_follow(probe, above, 1e-3, &felt) == VISCERA_OFF_SURFACE);
    EXPECT(viscera_probe_follow(probe, above, -1e-3, &felt) == VISCERA_BAD_SETTING);
    EXPECT(viscera_probe_follow(probe, far, NAN, &felt) == VISCERA_BAD_SETTING);
    EXPECT(viscera_probe_place(probe, NULL, &felt) == VISCERA_NULL_POINTER && felt.force[2] == 0);
    EXPECT(viscera_probe_place(NULL, above, &felt) == VISCERA_NULL_POINTER);
    EXPECT(viscera_probe_place(probe, above, NULL) == VISCERA_NULL_POINTER);
    EXPECT(viscera_probe_follow(NULL, above, 1e-3, &felt) == VISCERA_NULL_POINTER);
    EXPECT(viscera_probe_follow(probe, NULL, 1e-3, &felt) == VISCERA_NULL_POINTER);
    viscera_probe_free(probe);
    viscera_probe_free(NULL);
    EXPECT(strstr(viscera_status_text(VISCERA_OFF_SURFACE), "nothing is touched") != NULL);
}

/* What a coupled probe makes of time steps that are none, and of a device that is in the organ at once. */
static void following(viscera_model *model) {
    const double far[3] = {0.5, 0.1, 1e3}, wrong[4] = {NAN, INFINITY, -INFINITY, -1e-3}, spring = 500;
    double top[3];
    viscera_info_t info;
    viscera_probe *probe = NULL;
    viscera_felt felt, held;
    viscera_info(model, &info);
    viscera_locate(model, far, top, NULL);
    const double device[3] = {top[0] + 0.002, top[1], top[2] + 0.8 * info.radius};
    const double deep[3] = {top[0], top[1], top[2] - info.radius};
    EXPECT(viscera_probe_new(model, info.radius, 0.5, &probe, NULL, 0) == VISCERA_OK);
    EXPECT(viscera_probe_couple(probe, spring, 1) == VISCERA_OK);
    for (int n = 0; n < 2; n++) {
        EXPECT(viscera_probe_follow(probe, device, 1e-3, &felt) == VISCERA_OK && felt.force[2] < 0);
        EXPECT(fabs(spring * (device[2] - felt.center[2]) - felt.force[2]) < -1e-3 * felt.force[2]);
        viscera_probe_lift(probe);
    }
    for (int n = 0; n < 100; n++) {
        const double dragged[3] = {device[0] + 5e-5 * n, device[1], device[2]};
        EXPECT(viscera_probe_follow(probe, dragged, 1e-3, &held) == VISCERA_OK);
    }
    for (int n = 0; n < 4; n++) {
        EXPECT(viscera_probe_follow(probe, deep, wrong[n], &felt) == VISCERA_BAD_SETTING && felt.force[2] == 0);
    }
    const double same[3] = {device[0] + 5e-5 * 99, device[1], device[2]};
    EXPECT(viscera_probe_follow(probe, same, 0, &felt) == VISCERA_OK);
    EXPECT(held.force[0] > 0 && fabs(felt.force[0] - held.force[0]) < 0.01 * held.force[0]);
    EXPECT(fabs(felt.force[2] - held.force[2]) < -0.01 * held.force[2]);
    for (int n = 0; n < 300; n++) viscera_probe_follow(probe, deep, n ? 1e-3 : 0, &felt);
    EXPECT(felt.force[2] < 0 && felt.grip != VISCERA_PROBE_FREE);
    viscera_probe_free(probe);
}

int main(int argc, char **argv) {
    viscera_model *model = NULL;
    if (argc != 2 || viscera_load_file(argv[1], &model, NULL, 0) != VISCERA_OK) return 2;
    loading(argv[1]);
    touching(model);
    drawing(model);
    looking_inside(model);
    varying(model);
    probing(model);
    following(model);
    overflowing(model);
    settings(model);
    viscera_free(model);
    printf("%d faults\n", faults);
    return faults ? 1 : 0;
}
