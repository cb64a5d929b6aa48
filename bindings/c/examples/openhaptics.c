/* A haptic device under OpenHaptics (HDAPI) that presses an organ: millimetres and newtons.
 *
 *     cc openhaptics.c $(pkg-config --cflags --libs viscera) -Wl,-rpath,$(pkg-config --variable=libdir viscera) \
 *         -lHD -lHDU -lm -o openhaptics
 *
 * The device's x points to the right, y up, z to the user. The organ lies with its z up and its x to the right; the
 * origin of the device is put on its top. */
#include <HD/hd.h>
#include <HDU/hduError.h>
#include <stdio.h>
#include <string.h>

#include "contact.h"
#include "viscera.h"

typedef struct scene {
    viscera_model *model;
    viscera_guard guard;
    contact tool;
    HHD device;
} scene;

/* What the servo thread calls every millisecond: no allocation, no lock. */
static HDCallbackCode HDCALLBACK servo(void *data) {
    scene *s = data;
    HDdouble at[3], force[3];
    viscera_answer answer;
    HDint rate = 1000;
    hdBeginFrame(s->device);
    hdGetDoublev(HD_CURRENT_POSITION, at);
    hdGetIntegerv(HD_UPDATE_RATE, &rate);
    const int32_t status = contact_touch(&s->tool, s->model, at, &answer);
    viscera_guard_step_moved(&s->guard, answer.force, status, s->tool.moved, 1.0 / rate, force);
    /* The force is that of the tool on the organ; the hand feels its negative. */
    for (int i = 0; i < 3; i++) force[i] = -force[i];
    hdSetDoublev(HD_CURRENT_FORCE, force);
    hdEndFrame(s->device);
    const HDErrorInfo error = hdGetError();
    return HD_DEVICE_ERROR(error) && hduIsSchedulerError(&error) ? HD_CALLBACK_DONE : HD_CALLBACK_CONTINUE;
}

/* The tool's first place, read where the device may be read. */
static HDCallbackCode HDCALLBACK begin(void *data) {
    scene *s = data;
    HDdouble at[3];
    hdBeginFrame(s->device);
    hdGetDoublev(HD_CURRENT_POSITION, at);
    hdEndFrame(s->device);
    contact_begin(&s->tool, at);
    return HD_CALLBACK_DONE;
}

static int place(viscera_model *model) {
    const double above[3] = {0, 0, 10}, rotation[9] = {1, 0, 0, 0, 0, -1, 0, 1, 0};
    viscera_frame frame;
    viscera_frame_identity(&frame);
    viscera_locate(model, above, frame.translation, NULL);
    memcpy(frame.rotation, rotation, sizeof rotation);
    frame.metres_per_unit = 0.001;
    return viscera_set_frame(model, &frame) == VISCERA_OK;
}

int main(int argc, char **argv) {
    static scene s;
    char message[256];
    if (argc != 2 || viscera_abi_version() != VISCERA_ABI_VERSION) return 2;
    if (viscera_load_file(argv[1], &s.model, message, sizeof message) != VISCERA_OK) {
        fprintf(stderr, "%s\n", message);
        return 2;
    }
    if (!place(s.model)) return 2;
    s.device = hdInitDevice(HD_DEFAULT_DEVICE);
    HDErrorInfo error = hdGetError();
    if (HD_DEVICE_ERROR(error)) {
        hduPrintError(stderr, &error, "no haptic device");
        return 1;
    }
    HDdouble strongest = 3;
    hdGetDoublev(HD_NOMINAL_MAX_FORCE, &strongest);
    viscera_guard_init(&s.guard, 0.8 * strongest, 2000, 0.02, 0.1); /* N, N/s, s, s */
    viscera_guard_keep_passive(&s.guard, 1, 0.002);                 /* N mm, N s/mm */

    hdEnable(HD_FORCE_OUTPUT);
    hdStartScheduler();
    hdScheduleSynchronous(begin, &s, HD_DEFAULT_SCHEDULER_PRIORITY);
    const HDSchedulerHandle handle = hdScheduleAsynchronous(servo, &s, HD_DEFAULT_SCHEDULER_PRIORITY);
    puts("press enter to end");
    getchar();
    hdStopScheduler();
    hdUnschedule(handle);
    hdDisableDevice(s.device);
    viscera_free(s.model);
    return 0;
}
