/* Requests for memory by one thread, counted in the allocator that the whole process uses (glibc; elsewhere and under
 * sanitizers, which bring their own, nothing is counted). */
#ifndef ALLOCATIONS_H
#define ALLOCATIONS_H

/* Counts the calling thread's requests from now on, or stops. */
void allocations_count(int on);

/* Requests counted so far in this thread; -1 where they cannot be. */
long allocations_counted(void);

#endif
