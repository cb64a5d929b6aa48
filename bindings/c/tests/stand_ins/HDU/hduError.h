/* A stand-in, for tests only: see ../HD/hd.h. */
#ifndef HDU_ERROR_STAND_IN_H
#define HDU_ERROR_STAND_IN_H

#include <HD/hd.h>
#include <stdio.h>

static void hduPrintError(FILE *file, const HDErrorInfo *error, const char *sentence) {
    fprintf(file, "%s: error %u\n", sentence, error->errorCode);
}
static int hduIsSchedulerError(const HDErrorInfo *error) { return error->errorCode != 0; }

#endif
