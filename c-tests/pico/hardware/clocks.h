#ifndef PICO_MODEL_CLOCKS_H
#define PICO_MODEL_CLOCKS_H

#include "hardware/uart.h"

uint32_t clock_get_hz(uint clock);

#endif
