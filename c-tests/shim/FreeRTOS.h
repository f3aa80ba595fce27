/* Plays the few calls of FreeRTOS that ports/freertos uses, with a thread of this machine for each
 * task: c-tests/support/freertos.c. A tick has 16 bits, and wraps soon after the start. */
#ifndef FREERTOS_H
#define FREERTOS_H

#include <stddef.h>
#include <stdint.h>

#define configTICK_RATE_HZ 1000
#define configUSE_MUTEXES 1
#define configSUPPORT_STATIC_ALLOCATION 1
#define configTASK_NOTIFICATION_ARRAY_ENTRIES 2

typedef uint16_t TickType_t;
typedef int BaseType_t;
typedef unsigned UBaseType_t;
typedef uint32_t StackType_t;

#define portMAX_DELAY ((TickType_t)0xFFFF)
#define pdTRUE 1
#define pdFALSE 0
#define pdMS_TO_TICKS(milliseconds) ((TickType_t)(milliseconds))

#endif
