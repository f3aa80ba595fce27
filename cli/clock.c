#define _GNU_SOURCE
#include "clock.h"

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
