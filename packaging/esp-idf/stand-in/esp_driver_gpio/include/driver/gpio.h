/* See esp_err.h. Licence: MIT OR Apache-2.0. */
#ifndef GPIO_H
#define GPIO_H

#include "esp_err.h"
#include <stdint.h>

typedef enum { GPIO_NUM_0, GPIO_NUM_MAX = 58 } gpio_num_t;
typedef enum { GPIO_MODE_INPUT = 1, GPIO_MODE_OUTPUT = 2 } gpio_mode_t;

esp_err_t gpio_set_level(gpio_num_t pin, uint32_t level);
esp_err_t gpio_set_direction(gpio_num_t pin, gpio_mode_t mode);

#endif
