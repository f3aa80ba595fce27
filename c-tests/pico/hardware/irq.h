#ifndef PICO_MODEL_IRQ_H
#define PICO_MODEL_IRQ_H

#include "hardware/uart.h"

void irq_set_exclusive_handler(uint number, void (*handler)(void));
void irq_set_enabled(uint number, bool enabled);

#endif
