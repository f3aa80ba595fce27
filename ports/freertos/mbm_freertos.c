/* See mbm_freertos.h. Licence: MIT OR Apache-2.0. */
#include "mbm_freertos.h"

enum { MICROS_OF_A_SECOND = 1000000 };

#define MICROS_OF_A_TICK ((uint32_t)(MICROS_OF_A_SECOND / configTICK_RATE_HZ))
/* The longest sleep that is not endless. */
#define MOST_TICKS ((TickType_t)(portMAX_DELAY - 1u))

/* FreeRTOS before 10.4 has one notification a task. */
#ifdef ulTaskNotifyTakeIndexed
#define TAKE(ticks) ulTaskNotifyTakeIndexed(MBM_FREERTOS_NOTIFY_INDEX, pdTRUE, ticks)
#define GIVE(task) xTaskNotifyGiveIndexed(task, MBM_FREERTOS_NOTIFY_INDEX)
#define GIVE_FROM_ISR(task, woken)                                                                 \
    vTaskNotifyGiveIndexedFromISR(task, MBM_FREERTOS_NOTIFY_INDEX, woken)
#else
#if MBM_FREERTOS_NOTIFY_INDEX != 0
#error "this FreeRTOS has one notification a task: define MBM_FREERTOS_NOTIFY_INDEX as 0"
#endif
#define TAKE(ticks) ulTaskNotifyTake(pdTRUE, ticks)
#define GIVE(task) xTaskNotifyGive(task)
#define GIVE_FROM_ISR(task, woken) vTaskNotifyGiveFromISR(task, woken)
#endif

/* Between the writing of one flag and the reading of another, if the interrupt may run on another
 * core. */
#if defined configNUMBER_OF_CORES
#if configNUMBER_OF_CORES > 1
#define FENCE() __sync_synchronize()
#endif
#endif
#ifndef FENCE
#define FENCE() ((void)0)
#endif

/* --- sleeping */

static TickType_t ticks_of(uint32_t micros)
{
    const uint32_t ticks = micros / MICROS_OF_A_TICK;

    return ticks < MOST_TICKS ? (TickType_t)ticks : MOST_TICKS;
}

static uint8_t has_news(void *context)
{
    const mbm_freertosLine *line = context;

    return line->hasNews;
}

uint8_t mbm_freertos_sleepUntil(mbm_freertosLine *line, uint8_t (*isOver)(void *context),
                                void *context, TickType_t ticks)
{
    /* From here on an interrupt notifies this task. What was before, the look afterwards sees. */
    line->waiting = xTaskGetCurrentTaskHandle();
    FENCE();
    if (!isOver(context))
        (void)TAKE(ticks);
    line->waiting = NULL;
    return isOver(context);
}

void mbm_freertos_wait(mbm_freertosLine *line, uint32_t timeoutUs)
{
    TickType_t ticks;

    if (line == NULL || timeoutUs == 0)
        return;
    ticks = timeoutUs == UINT32_MAX ? portMAX_DELAY : ticks_of(timeoutUs);
    /* A sleep of n ticks ends with the nth tick interrupt, so it is never longer than n ticks. */
    if (ticks == 0 && line->isTransmitting) {
        taskYIELD();
    } else {
        (void)mbm_freertos_sleepUntil(line, has_news, line, ticks > 0 ? ticks : 1);
    }
    /* A poll follows, and reads all that has come. */
    line->hasNews = 0;
}

void mbm_freertos_wake(mbm_freertosLine *line)
{
    TaskHandle_t waiting;

    if (line == NULL)
        return;
    line->hasNews = 1;
    FENCE();
    waiting = line->waiting;
    if (waiting != NULL)
        (void)GIVE(waiting);
}

void mbm_freertos_wakeFromISR(mbm_freertosLine *line, BaseType_t *woken)
{
    TaskHandle_t waiting;

    if (line == NULL)
        return;
    line->hasNews = 1;
    FENCE();
    waiting = line->waiting;
    if (waiting != NULL)
        GIVE_FROM_ISR(waiting, woken);
}

/* --- the clock, and the hook idle */

uint32_t mbm_freertos_micros(void *context)
{
    mbm_freertosLine *line = context;
    const TickType_t now = xTaskGetTickCount();

    /* The tick may have 16 bits. */
    line->micros += (uint32_t)(TickType_t)(now - line->ticks) * MICROS_OF_A_TICK;
    line->ticks = now;
    return line->micros;
}

void mbm_freertos_idle(void *context, mbm_node *node)
{
    mbm_freertos_wait(context, mbm_node_pollDelay(node));
}

/* --- sharing */

void mbm_freertos_prepare(mbm_freertosLine *line)
{
    line->hasNews = 0;
    line->isTransmitting = 0;
    /* Tasks may wait for the mutex of a line that begins again. */
    if (line->mutex == NULL)
        line->mutex = xSemaphoreCreateMutexStatic(&line->mutexMemory);
}

uint8_t mbm_freertos_take(mbm_freertosLine *line, TickType_t ticks)
{
    if (line == NULL)
        return MBM_INVALID_ARGUMENT;
    if (line->mutex == NULL)
        return MBM_NOT_INITIALISED;
    return xSemaphoreTake(line->mutex, ticks) == pdTRUE ? MBM_OK : MBM_BUSY;
}

void mbm_freertos_give(mbm_freertosLine *line)
{
    if (line != NULL && line->mutex != NULL)
        (void)xSemaphoreGive(line->mutex);
}

/* --- the hooks of a wrapped port */

static int16_t wrapped_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    const mbm_freertosPort *over = context;

    return over->link.read(over->link.context, bytes, capacity);
}

static uint8_t never(void *context)
{
    (void)context;
    return 0;
}

static int16_t wrapped_write(void *context, const uint8_t *bytes, uint16_t length)
{
    mbm_freertosPort *over = context;
    const int16_t count = over->link.write(over->link.context, bytes, length);

    /* A blocking call asks again at once, and would keep tasks of lower priority from running. */
    if (count == 0)
        (void)mbm_freertos_sleepUntil(&over->line, never, NULL, 1);
    return count;
}

static uint32_t wrapped_micros(void *context)
{
    const mbm_freertosPort *over = context;

    return over->link.micros(over->link.context);
}

static uint8_t is_flushed(void *context)
{
    const mbm_freertosPort *over = context;

    return over->link.flush(over->link.context);
}

static uint8_t wrapped_flush(void *context)
{
    mbm_freertosPort *over = context;

    return mbm_freertos_sleepUntil(&over->line, is_flushed, over, 1);
}

static void driver_on(void *context)
{
    mbm_freertosPort *over = context;

    over->line.isTransmitting = 1;
    if (over->link.preTransmission != NULL)
        over->link.preTransmission(over->link.context);
}

static void driver_off(void *context)
{
    mbm_freertosPort *over = context;

    over->line.isTransmitting = 0;
    if (over->link.postTransmission != NULL)
        over->link.postTransmission(over->link.context);
}

uint8_t mbm_freertos_wrap(mbm_freertosPort *over, mbm_port *port)
{
    static const mbm_port hooks = {.read = wrapped_read,
                                   .write = wrapped_write,
                                   .micros = mbm_freertos_micros,
                                   .preTransmission = driver_on,
                                   .postTransmission = driver_off,
                                   .idle = mbm_freertos_idle};

    if (over == NULL || port == NULL || over->link.read == NULL || over->link.write == NULL)
        return MBM_INVALID_ARGUMENT;
    mbm_freertos_prepare(&over->line);
    *port = hooks;
    port->context = over;
    if (over->link.micros != NULL)
        port->micros = wrapped_micros;
    if (over->link.flush != NULL)
        port->flush = wrapped_flush;
    return MBM_OK;
}
