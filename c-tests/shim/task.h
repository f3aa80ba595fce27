/* See FreeRTOS.h. */
#ifndef TASK_H
#define TASK_H

#include "FreeRTOS.h"

typedef struct freertos_task *TaskHandle_t;

TaskHandle_t xTaskGetCurrentTaskHandle(void);
TickType_t xTaskGetTickCount(void);
uint32_t ulTaskNotifyTakeIndexed(UBaseType_t index, BaseType_t clear, TickType_t ticks);
BaseType_t xTaskNotifyGiveIndexed(TaskHandle_t task, UBaseType_t index);
void vTaskNotifyGiveIndexedFromISR(TaskHandle_t task, UBaseType_t index, BaseType_t *woken);
#define ulTaskNotifyTakeIndexed ulTaskNotifyTakeIndexed

void freertos_yield(void);
void freertos_enter(void);
void freertos_exit(void);
#define taskYIELD() freertos_yield()
#define taskENTER_CRITICAL() freertos_enter()
#define taskEXIT_CRITICAL() freertos_exit()

#endif
