/* See esp_err.h. Licence: MIT OR Apache-2.0. */
#pragma once

#include "freertos/FreeRTOS.h"

BaseType_t xQueueReceive(QueueHandle_t queue, void *item, TickType_t ticks);
UBaseType_t uxQueueSpacesAvailable(const QueueHandle_t queue);
