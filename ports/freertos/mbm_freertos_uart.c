/* See mbm_freertos_uart.h. Licence: MIT OR Apache-2.0. */
#include "mbm_freertos_uart.h"

/* The bits of a character: start, data, parity or a second stop bit, stop. */
enum { BITS = 11 };

/* After this time a frame that does not leave is given up. The request of a master has ended
 * before. */
enum { SECONDS = 3 };

/* Twice the time of a frame, and two ticks for the task. */
static TickType_t longest(const mbm_freertosUart *uart)
{
    return (TickType_t)(uart->end * (2u * BITS) * (uint32_t)configTICK_RATE_HZ / uart->baud + 2u);
}

/* Returns whether the pin has this level, or there is none. */
static uint8_t switch_driver(const mbm_freertosUart *uart, uint8_t on)
{
    return uart->setDriver == NULL || uart->setDriver(uart->context, on) != 0;
}

static void release_line(mbm_freertosUart *uart)
{
    uart->isStuck = !switch_driver(uart, 0);
}

/* Reports a failure of the pin once, and one that does not go off until it does. */
static uint8_t has_failed(mbm_freertosUart *uart)
{
    const uint8_t has = uart->hasFailed;

    uart->hasFailed = 0;
    if (uart->isStuck)
        release_line(uart);
    return has || uart->isStuck;
}

/* --- the interrupt */

void mbm_freertos_receivedFromISR(mbm_freertosUart *uart, const uint8_t *bytes, uint16_t length,
                                  BaseType_t *woken)
{
    if (uart == NULL || !uart->isOpen || length == 0)
        return;
    (void)mbm_ring_write(&uart->ring, bytes, length);
    mbm_freertos_wakeFromISR(&uart->line, woken);
}

uint8_t mbm_freertos_nextFromISR(mbm_freertosUart *uart, uint8_t *byte)
{
    if (uart == NULL || uart->next >= uart->end)
        return 0;
    *byte = uart->toSend[uart->next];
    uart->next = (uint16_t)(uart->next + 1u);
    return 1;
}

void mbm_freertos_sentFromISR(mbm_freertosUart *uart, BaseType_t *woken)
{
    if (uart == NULL || !uart->isSending || uart->next < uart->end)
        return;
    if (!uart->hasNoSentInterrupt)
        release_line(uart);
    uart->isSending = 0;
    mbm_freertos_wakeFromISR(&uart->line, woken);
}

void mbm_freertos_overrunFromISR(mbm_freertosUart *uart)
{
    if (uart != NULL)
        uart->overruns = (uint16_t)(uart->overruns + 1u);
}

/* --- the hooks */

static int16_t uart_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    mbm_freertosUart *uart = context;

    if (!uart->isOpen || has_failed(uart))
        return -1;
    return (int16_t)mbm_ring_read(&uart->ring, bytes, capacity);
}

uint8_t mbm_freertos_isSent(void *context)
{
    const mbm_freertosUart *uart = context;

    return !uart->isSending || !uart->isOpen;
}

/* Gives up what has not left. */
static void give_up(mbm_freertosUart *uart)
{
    taskENTER_CRITICAL();
    uart->next = 0;
    uart->end = 0;
    uart->isSending = 0;
    taskEXIT_CRITICAL();
}

/* Counts a frame that does not leave, and gives it up: it must not leave later, after its request
 * has ended. */
static void stall(mbm_freertosUart *uart)
{
    give_up(uart);
    uart->stalled = (uint16_t)(uart->stalled + 1u);
}

static int16_t uart_write(void *context, const uint8_t *bytes, uint16_t length)
{
    mbm_freertosUart *uart = context;
    uint16_t i;

    if (!uart->isOpen || has_failed(uart))
        return -1;
    if (uart->isSending) {
        /* A blocking call asks again at once, and would keep tasks of lower priority from running.
         */
        (void)mbm_freertos_sleepUntil(&uart->line, mbm_freertos_isSent, uart, 1);
        return 0;
    }
    if (length > uart->toSendBytes)
        length = uart->toSendBytes;
    for (i = 0; i < length; i++)
        uart->toSend[i] = bytes[i];
    uart->beganAt = xTaskGetTickCount();
    taskENTER_CRITICAL();
    uart->next = 0;
    uart->end = length;
    uart->isSending = 1;
    taskEXIT_CRITICAL();
    uart->startSending(uart->context);
    return (int16_t)length;
}

static uint8_t uart_flush(void *context)
{
    mbm_freertosUart *uart = context;

    if (mbm_freertos_sleepUntil(&uart->line, mbm_freertos_isSent, uart, longest(uart)))
        return 1;
    /* A server would wait for ever. */
    if ((TickType_t)(xTaskGetTickCount() - uart->beganAt) <=
        longest(uart) + SECONDS * configTICK_RATE_HZ)
        return 0;
    stall(uart);
    return 1;
}

static void driver_on(void *context)
{
    mbm_freertosUart *uart = context;

    uart->line.isTransmitting = 1;
    uart->hasFailed = !switch_driver(uart, 1);
}

static void driver_off(void *context)
{
    mbm_freertosUart *uart = context;

    uart->line.isTransmitting = 0;
    if (uart->isSending)
        stall(uart);
    release_line(uart);
}

/* --- opening */

uint8_t mbm_freertos_open(mbm_freertosUart *uart, mbm_port *port)
{
    static const mbm_port hooks = {.read = uart_read,
                                   .write = uart_write,
                                   .micros = mbm_freertos_micros,
                                   .flush = uart_flush,
                                   .preTransmission = driver_on,
                                   .postTransmission = driver_off,
                                   .idle = mbm_freertos_idle};

    if (uart == NULL || port == NULL || uart->startSending == NULL || uart->baud == 0 ||
        uart->toSend == NULL || uart->toSendBytes == 0)
        return MBM_INVALID_ARGUMENT;
    if (uart->isOpen)
        return MBM_BUSY;
    if (!switch_driver(uart, 0))
        return MBM_LINK_LOST;
    if (mbm_ring_begin(&uart->ring, uart->received, uart->receivedBytes) != MBM_OK)
        return MBM_INVALID_ARGUMENT;
    mbm_freertos_prepare(&uart->line);
    uart->next = 0;
    uart->end = 0;
    uart->isSending = 0;
    uart->overruns = 0;
    uart->stalled = 0;
    uart->hasFailed = 0;
    uart->isStuck = 0;
    *port = hooks;
    port->context = uart;
    uart->isOpen = 1;
    return MBM_OK;
}

void mbm_freertos_close(mbm_freertosUart *uart)
{
    if (uart == NULL || !uart->isOpen)
        return;
    uart->isOpen = 0;
    give_up(uart);
    release_line(uart);
    mbm_freertos_wake(&uart->line);
}

uint16_t mbm_freertos_lost(const mbm_freertosUart *uart)
{
    return uart == NULL ? 0 : (uint16_t)(mbm_ring_lost(&uart->ring) + uart->overruns);
}

uint16_t mbm_freertos_stalled(const mbm_freertosUart *uart)
{
    return uart == NULL ? 0 : uart->stalled;
}
