/* See esp_err.h. Licence: MIT OR Apache-2.0. */
#ifndef TASK_H
#define TASK_H

#include "freertos/FreeRTOS.h"

void vTaskDelay(const TickType_t ticks);

#endif
