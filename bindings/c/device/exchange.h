/* The newest value from one writing thread to one reading thread: no lock, no waiting, no value torn.
 *
 * There are three slots. The writer owns one, the reader another; the third lies in the middle. Publishing swaps the
 * writer's with the middle one, taking swaps the reader's with it if it is fresh: one atomic exchange each. A reader may
 * miss values, never see half of one; a writer never learns whether anybody reads. */
#ifndef EXCHANGE_H
#define EXCHANGE_H

#include <stdalign.h>
#include <stdatomic.h>
#include <stddef.h>

enum { EXCHANGE_SLOT = 3, EXCHANGE_FRESH = 4 };

typedef struct exchange {
    unsigned char *slots; /* three values, one after the other */
    size_t size;          /* of a value */
    alignas(64) atomic_uint middle;
    alignas(64) unsigned written;
    alignas(64) unsigned read;
} exchange;

static inline void exchange_init(exchange *e, void *three_values, size_t size) {
    e->slots = three_values;
    e->size = size;
    e->written = 0;
    e->read = 1;
    atomic_init(&e->middle, 2);
}

/* Where the writer puts its next value. */
static inline void *exchange_slot(exchange *e) { return e->slots + e->written * e->size; }

/* Hands that value over. */
static inline void exchange_publish(exchange *e) {
    const unsigned fresh = e->written | EXCHANGE_FRESH;
    e->written = atomic_exchange_explicit(&e->middle, fresh, memory_order_acq_rel) & EXCHANGE_SLOT;
}

/* The reader's newest value; it stays as it is until the next call. */
static inline const void *exchange_take(exchange *e) {
    if (atomic_load_explicit(&e->middle, memory_order_relaxed) & EXCHANGE_FRESH) {
        e->read = atomic_exchange_explicit(&e->middle, e->read, memory_order_acq_rel) & EXCHANGE_SLOT;
    }
    return e->slots + e->read * e->size;
}

#endif
