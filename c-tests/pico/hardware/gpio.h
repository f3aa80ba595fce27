#ifndef PICO_MODEL_GPIO_H
#define PICO_MODEL_GPIO_H

#include "hardware/uart.h"

void gpio_init(uint pin);
void gpio_put(uint pin, bool level);
void gpio_set_dir(uint pin, bool isOutput);
void gpio_set_function(uint pin, uint function);
void gpio_pull_up(uint pin);

#endif
