/* The clocks of the system.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef CLOCK_H
#define CLOCK_H

#include <stdint.h>
#include <time.h>

/* The time of a clock in microseconds; of CLOCK_REALTIME since 1970. */
uint64_t clock_micros(clockid_t clock);

/* The time of the monotonic clock in milliseconds. */
int64_t clock_milliseconds(void);

#endif
