#include "allocations.h"

#include <errno.h>
#include <stdlib.h>

static _Thread_local int counting;
static _Thread_local long counted;

void allocations_count(int on) { counting = on; }

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)

long allocations_counted(void) { return counted; }

/* The names behind malloc and its kin; the definitions here take their place for the libraries too. */
extern void *__libc_malloc(size_t);
extern void *__libc_calloc(size_t, size_t);
extern void *__libc_realloc(void *, size_t);
extern void *__libc_memalign(size_t, size_t);
extern void __libc_free(void *);

void *malloc(size_t size) {
    counted += counting;
    return __libc_malloc(size);
}

void *calloc(size_t n, size_t size) {
    counted += counting;
    return __libc_calloc(n, size);
}

void *realloc(void *pointer, size_t size) {
    counted += counting;
    return __libc_realloc(pointer, size);
}

void free(void *pointer) {
    counted += counting;
    __libc_free(pointer);
}

void *aligned_alloc(size_t alignment, size_t size) {
    counted += counting;
    return __libc_memalign(alignment, size);
}

int posix_memalign(void **pointer, size_t alignment, size_t size) {
    counted += counting;
    *pointer = __libc_memalign(alignment, size);
    return *pointer ? 0 : ENOMEM;
}

#else

long allocations_counted(void) {
    (void)counted;
    (void)counting;
    return -1;
}

#endif
