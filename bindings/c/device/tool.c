#include "tool.h"

#include <math.h>
#include <string.h>

static const double FRICTION = 0.5; /* the tip slips where it is dragged by more than this part of its depth */

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void cross(const double a[3], const double b[3], double c[3]) {
    for (int i = 0; i < 3; i++) c[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

static int normalise(double v[3]) {
    const double size = sqrt(dot(v, v));
    for (int i = 0; i < 3; i++) v[i] /= size;
    return size > 0;
}

int tool_place(tool *t, const viscera_model *model, const viscera_info_t *info, float *workspace, float *positions) {
    const double far_away[3] = {1e6, 0, 0}, still[3] = {0, 0, 0};
    const size_t n = (size_t)info->surface_nodes;
    double middle[3] = {0, 0, 0};
    memset(t, 0, sizeof *t);
    /* Off the surface, the positions are those at rest. */
    viscera_surface(model, far_away, still, workspace, viscera_workspace_size(model), positions, 3 * n);
    for (size_t k = 0; k < 3 * n; k++) middle[k % 3] += (double)positions[k] / (double)n;
    if (viscera_locate(model, middle, t->base, NULL) != VISCERA_OK) return 0;
    for (int i = 0; i < 3; i++) t->inward[i] = middle[i] - t->base[i];
    if (!normalise(t->inward)) return 0;
    int flat = 0; /* the axis farthest from the way in */
    for (int i = 1; i < 3; i++) flat = fabs(t->inward[i]) < fabs(t->inward[flat]) ? i : flat;
    const double axis[3] = {flat == 0, flat == 1, flat == 2};
    cross(t->inward, axis, t->across[0]);
    normalise(t->across[0]);
    cross(t->inward, t->across[0], t->across[1]);
    t->radius = info->radius;
    t->depth = info->depth;
    memcpy(t->contact, t->base, sizeof t->contact);
    memcpy(t->at, t->base, sizeof t->at);
    return 1;
}

/* Where the tip sticks or slips to, over a surface it is pressed into by `press` parts of the depth. */
static void drag(tool *t, const viscera_model *model, const double over[3], double press) {
    double pull[3];
    for (int i = 0; i < 3; i++) pull[i] = over[i] - t->anchor[i];
    const double size = sqrt(dot(pull, pull)), longest = FRICTION * press * t->depth;
    const double slip = !t->touches ? 1 : size > longest ? 1 - longest / size : 0;
    if (slip > 0) {
        for (int i = 0; i < 3; i++) t->anchor[i] += slip * pull[i];
        viscera_locate(model, t->anchor, t->contact, NULL);
    }
    t->touches = 1;
    for (int i = 0; i < 3; i++) t->displacement[i] = (1 - slip) * pull[i] + press * t->depth * t->inward[i];
}

int32_t tool_touch(tool *t, const viscera_model *model, hand_pose pose, const double origin[3],
                   viscera_answer *answer) {
    double at[3], over[3], press = 0;
    for (int i = 0; i < 3; i++) {
        const double along = t->radius * (pose.across[0] * t->across[0][i] + pose.across[1] * t->across[1][i]);
        at[i] = t->base[i] + along + pose.press * t->depth * t->inward[i] - origin[i];
        press += (at[i] - t->base[i]) * t->inward[i] / t->depth;
        t->moved[i] = at[i] - t->at[i];
        t->at[i] = at[i];
    }
    for (int i = 0; i < 3; i++) over[i] = at[i] - press * t->depth * t->inward[i];
    if (press > 0) {
        drag(t, model, over, press);
        return viscera_evaluate(model, t->contact, t->displacement, answer);
    }
    t->touches = 0;
    memset(t->displacement, 0, sizeof t->displacement);
    memset(answer, 0, sizeof *answer);
    return VISCERA_OFF_SURFACE;
}
