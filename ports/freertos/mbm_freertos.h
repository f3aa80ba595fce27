/**
 * @file mbm_freertos.h
 * @brief FreeRTOS around the port of a link: sleeps on a task notification, and a mutex for tasks
 *        that share a line.
 *
 * For FreeRTOS 10 and later, with one core or several. Allocates nothing: the memory of the mutex
 * is in the line. FreeRTOSConfig.h needs configUSE_MUTEXES, configSUPPORT_STATIC_ALLOCATION and
 * configTASK_NOTIFICATION_ARRAY_ENTRIES of 2 or more.
 *
 * mbm_freertos_uart.h has a port for a UART with interrupts. Take mbm_freertos_wrap if your UART,
 * USB device or socket has a port already:
 *
 *     static mbm_freertosPort uart;
 *     mbm_port port;
 *
 *     uart.link = port_of_your_uart;
 *     status = mbm_freertos_wrap(&uart, &port);
 *
 * Licence: MIT OR Apache-2.0.
 */
#ifndef MBM_FREERTOS_H
#define MBM_FREERTOS_H

#include "mbm.h"

#include <FreeRTOS.h>
#include <semphr.h>
#include <task.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The notification of a task that waits for a line: the last one, so that the first ones are left
 * to your program and to FreeRTOS's stream and message buffers. */
#ifndef MBM_FREERTOS_NOTIFY_INDEX
#if defined configTASK_NOTIFICATION_ARRAY_ENTRIES
#if configTASK_NOTIFICATION_ARRAY_ENTRIES > 1
/** The index of the notification that mbm uses. Define it to use another one. */
#define MBM_FREERTOS_NOTIFY_INDEX (configTASK_NOTIFICATION_ARRAY_ENTRIES - 1)
#endif
#endif
#endif
#ifndef MBM_FREERTOS_NOTIFY_INDEX
#error                                                                                             \
    "mbm needs a task notification of its own: set configTASK_NOTIFICATION_ARRAY_ENTRIES to 2 in FreeRTOSConfig.h. If your tasks that use a line take no notifications, define MBM_FREERTOS_NOTIFY_INDEX as 0 instead."
#endif
#if configUSE_MUTEXES != 1
#error "mbm shares a line between tasks by a mutex: set configUSE_MUTEXES to 1 in FreeRTOSConfig.h."
#endif
#if configSUPPORT_STATIC_ALLOCATION != 1
#error "mbm uses no heap: set configSUPPORT_STATIC_ALLOCATION to 1 in FreeRTOSConfig.h."
#endif

/** What tasks and interrupts know of a line: who sleeps for it, and who has taken it. All of it is
 *  private. It is the first member of each port for FreeRTOS. */
typedef struct mbm_freertosLine {
    StaticSemaphore_t mutexMemory;   /**< private */
    SemaphoreHandle_t mutex;         /**< private */
    volatile TaskHandle_t waiting;   /**< private */
    volatile uint8_t hasNews;        /**< private */
    volatile uint8_t isTransmitting; /**< private */
    TickType_t ticks;                /**< private */
    uint32_t micros;                 /**< private */
} mbm_freertosLine;

/** A port of yours, and its line. Set `link`, zero the other fields, and keep it valid while it is
 *  used. */
typedef struct mbm_freertosPort {
    mbm_freertosLine
        line;      /**< for mbm_freertos_take, mbm_freertos_wait, mbm_freertos_wakeFromISR */
    mbm_port link; /**< the port of your UART, USB device or socket. Without `micros` the
                        clock is FreeRTOS's tick. Its `idle` is not used */
} mbm_freertosPort;

/**
 * Makes a port that sleeps of one that does not. May be called before the scheduler starts;
 * requests may not.
 *
 * While a frame leaves, `flush` sleeps. It looks at `flush` of the link whenever it is woken, and
 * at least once a tick. So call mbm_freertos_wakeFromISR when the last bit has left, too, or the
 * driver of the transceiver goes off up to a tick late.
 *
 * @param over  the link
 * @param port  receives the port for the begin functions. It uses `over`
 * @return MBM_OK; MBM_INVALID_ARGUMENT for NULL, and if the link has no `read` or no `write`
 */
uint8_t mbm_freertos_wrap(mbm_freertosPort *over, mbm_port *port);

/**
 * Takes the line for this task. Other tasks that take it wait. While a task of higher priority
 * waits, this task has that priority (FreeRTOS's priority inheritance), so no task between the two
 * delays it. Not from an interrupt, and not twice by one task.
 *
 * @param ticks  the longest wait, for example pdMS_TO_TICKS(500), or portMAX_DELAY; 0: does not
 * wait
 * @return MBM_OK; MBM_BUSY if another task has the line; MBM_NOT_INITIALISED before the line is
 * begun; MBM_INVALID_ARGUMENT for NULL
 */
uint8_t mbm_freertos_take(mbm_freertosLine *line, TickType_t ticks);

/** Gives the line back, in the task that has taken it. Does nothing for NULL and for a line that
 * was not begun. */
void mbm_freertos_give(mbm_freertosLine *line);

/**
 * Sleeps until the link has news or a time is over. For a task that polls a server, a client, a
 * gateway or a sniffer: pass the value that its pollDelay function returned. Without news it sleeps
 * for at least a tick, so that tasks of lower priority run; only while a frame leaves, when the
 * driver of the transceiver must not go off late, for no tick more than the time.
 *
 * @param line       the line. The task must not have taken it, or no other task can use it
 * meanwhile
 * @param timeoutUs  the longest sleep, in microseconds; 0: does not sleep; 0xFFFFFFFF: no limit
 */
void mbm_freertos_wait(mbm_freertosLine *line, uint32_t timeoutUs);

/** Ends the sleep of the task that waits for the line, or its next sleep. For a task that has
 * queued a request for the client of another task. Does nothing for NULL. */
void mbm_freertos_wake(mbm_freertosLine *line);

/**
 * The same from an interrupt: bytes have arrived, the last bit has left, or the link was lost.
 *
 * @param line   the line; NULL does nothing
 * @param woken  is set to pdTRUE if a task of higher priority is ready now: pass it to
 *               portYIELD_FROM_ISR at the end of the interrupt
 */
void mbm_freertos_wakeFromISR(mbm_freertosLine *line, BaseType_t *woken);

/* For ports that are made of a line: its mutex, and the hooks `micros` and `idle`, whose context is
 * the line, which is the first member of the struct of such a port. */
void mbm_freertos_prepare(mbm_freertosLine *line);
uint32_t mbm_freertos_micros(void *context);
void mbm_freertos_idle(void *context, mbm_node *node);

/* Sleeps until `isOver` returns other than 0 or the time is over. Returns what it returned last. */
uint8_t mbm_freertos_sleepUntil(mbm_freertosLine *line, uint8_t (*isOver)(void *context),
                                void *context, TickType_t ticks);

#ifdef __cplusplus
}
#endif

#endif
