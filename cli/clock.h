/* The clocks of the system. */
#pragma once

#include <stdint.h>
#include <time.h>

/* The time of a clock in microseconds; CLOCK_REALTIME counts from 1970. */
uint64_t clock_micros(clockid_t clock);

/* The time of the monotonic clock in milliseconds. */
int64_t clock_milliseconds(void);

/* The time of a sleep in microseconds, as ppoll takes it. */
struct timespec clock_timespec(uint32_t micros);

/* Writes a time since 1970 in UTC, such as 2026-01-31T12:00:00.123Z, with 3 or 6 digits after the
 * seconds. Returns `text`. */
enum { CLOCK_TEXT_BYTES = 40 };
const char *clock_text(uint64_t micros, int digits, char text[CLOCK_TEXT_BYTES]);

/* The same of the time now, in milliseconds. */
const char *clock_now_text(char text[CLOCK_TEXT_BYTES]);
