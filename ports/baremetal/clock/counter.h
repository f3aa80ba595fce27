/* A free-running counter. clock/counter.c makes microseconds of it.
 * Licence: MIT OR Apache-2.0. */
#ifndef COUNTER_H
#define COUNTER_H

#include <stdint.h>

void counter_start(void);

/* Counts up, TICKS_PER_MICRO (machine.h) in a microsecond, and wraps at 2^32. */
uint32_t counter_read(void);

#endif
