/* The counter of allocations counts: five requests between two that it must not see. Exits with 77 where it cannot. */
#define _POSIX_C_SOURCE 200809L
#include "../device/allocations.h"

#include <stdlib.h>
#include <string.h>

static char *volatile kept; /* so that no compiler may leave a request out */

int main(void) {
    kept = malloc(8);
    allocations_count(1);
    free(kept);
    kept = malloc(8);
    kept = realloc(kept, 9000);
    free(kept);
    kept = strdup("asked for inside a library");
    allocations_count(0);
    free(kept);
    kept = malloc(8);
    free(kept);
    return allocations_counted() < 0 ? 77 : allocations_counted() == 5 ? 0 : 1;
}
