/* Reads the clocks, and writes times as text. */
#include "clock.h"

#include <stdio.h>

uint64_t clock_micros(clockid_t clock)
{
    struct timespec now;

    clock_gettime(clock, &now);
    return (uint64_t)now.tv_sec * 1000000u + (uint64_t)now.tv_nsec / 1000u;
}

int64_t clock_milliseconds(void)
{
    return (int64_t)(clock_micros(CLOCK_MONOTONIC) / 1000u);
}

struct timespec clock_timespec(uint32_t micros)
{
    return (struct timespec){(time_t)(micros / 1000000u), (long)(micros % 1000000u) * 1000};
}

const char *clock_text(uint64_t micros, int digits, char text[CLOCK_TEXT_BYTES])
{
    const time_t seconds = (time_t)(micros / 1000000u);
    const unsigned fraction = (unsigned)(micros % 1000000u) / (digits == 3 ? 1000 : 1);
    struct tm utc;
    size_t length;

    gmtime_r(&seconds, &utc);
    length = strftime(text, CLOCK_TEXT_BYTES, "%Y-%m-%dT%H:%M:%S", &utc);
    snprintf(text + length, CLOCK_TEXT_BYTES - length, ".%0*uZ", digits, fraction);
    return text;
}

const char *clock_now_text(char text[CLOCK_TEXT_BYTES])
{
    return clock_text(clock_micros(CLOCK_REALTIME), 3, text);
}
