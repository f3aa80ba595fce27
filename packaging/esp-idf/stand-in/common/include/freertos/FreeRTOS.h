/* See esp_err.h. Licence: MIT OR Apache-2.0. */
#pragma once

#include <stdint.h>

typedef uint32_t TickType_t;
typedef int BaseType_t;
typedef unsigned UBaseType_t;
typedef struct QueueDefinition *QueueHandle_t;

#define configTICK_RATE_HZ 100
#define portTICK_PERIOD_MS ((TickType_t)1000 / configTICK_RATE_HZ)
#define pdMS_TO_TICKS(milliseconds) ((TickType_t)(milliseconds)*configTICK_RATE_HZ / 1000)
