/* A stand-in for OpenHaptics' HDAPI, for tests only: the few declarations that examples/openhaptics.c uses, and a
 * scripted device. */
#ifndef HD_STAND_IN_H
#define HD_STAND_IN_H

#include "../scripted.h"

#define HDCALLBACK
#define HD_DEFAULT_DEVICE 0
#define HD_DEVICE_ERROR(error) ((error).errorCode != 0)

typedef double HDdouble;
typedef int HDint;
typedef unsigned int HDuint;
typedef unsigned int HHD;
typedef unsigned long HDSchedulerHandle;
typedef struct HDErrorInfo {
    unsigned int errorCode;
    int internalErrorCode;
    HHD hHD;
} HDErrorInfo;
typedef enum { HD_CALLBACK_DONE, HD_CALLBACK_CONTINUE } HDCallbackCode;
typedef HDCallbackCode(HDCALLBACK *HDSchedulerCallback)(void *);
enum { HD_CURRENT_POSITION, HD_CURRENT_FORCE, HD_UPDATE_RATE, HD_NOMINAL_MAX_FORCE, HD_FORCE_OUTPUT };
enum { HD_DEFAULT_SCHEDULER_PRIORITY };

static HHD hdInitDevice(const char *name) {
    (void)name;
    return 1;
}
static void hdDisableDevice(HHD device) {
    (void)device;
    scripted_report();
}
static HDErrorInfo hdGetError(void) { return (HDErrorInfo){0, 0, 0}; }
static void hdEnable(int what) { (void)what; }
static void hdBeginFrame(HHD device) { (void)device; }
static void hdEndFrame(HHD device) { (void)device; }
static void hdStartScheduler(void) {}
static void hdStopScheduler(void) {}
static void hdUnschedule(HDSchedulerHandle handle) { (void)handle; }
static void hdGetIntegerv(int what, HDint *value) { *value = what == HD_UPDATE_RATE ? 1000 : 0; }

/* Millimetres, y up. */
static void hdGetDoublev(int what, HDdouble *value) {
    if (what == HD_NOMINAL_MAX_FORCE) {
        *value = 100;
        return;
    }
    value[0] = value[2] = 0;
    value[1] = 1000 * scripted_height();
}
static void hdSetDoublev(int what, const HDdouble *value) {
    if (what == HD_CURRENT_FORCE) scripted_force(value);
}

static void hdScheduleSynchronous(HDSchedulerCallback callback, void *data, int priority) {
    (void)priority;
    callback(data);
}
/* Runs at once, to the end of the script. */
static HDSchedulerHandle hdScheduleAsynchronous(HDSchedulerCallback callback, void *data, int priority) {
    (void)priority;
    while (scripted_tick <= SCRIPTED_TICKS && callback(data) == HD_CALLBACK_CONTINUE) {
    }
    return 1;
}

#endif
