#ifndef PICO_MODEL_TIME_H
#define PICO_MODEL_TIME_H

#include <stdbool.h>
#include <stdint.h>

typedef uint64_t absolute_time_t;

uint32_t time_us_32(void);
absolute_time_t make_timeout_time_us(uint64_t us);
bool best_effort_wfe_or_timeout(absolute_time_t end);

#endif
