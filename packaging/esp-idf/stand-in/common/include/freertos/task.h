/* See esp_err.h. Licence: MIT OR Apache-2.0. */
#pragma once

#include "freertos/FreeRTOS.h"

void vTaskDelay(const TickType_t ticks);
