/* See mbm_pico.h. Licence: MIT OR Apache-2.0. */
#include "mbm_pico.h"

#include <string.h>

#include "hardware/clocks.h"
#include "hardware/gpio.h"
#include "hardware/irq.h"
#include "pico/time.h"

enum { PINS = 30, SHORTEST_SLEEP = 20 /* microseconds */ };

/* The most bits of a character: start, data, parity or a second stop bit, stop. */
enum { BITS = 12, FIFO = 32 /* characters */ };

/* Milliseconds that a frame may take longer than twice its characters. */
enum { PATIENCE = 50 };

/* The lines that are open, for their interrupts. */
static mbm_picoUart *lines[2];

/* --- the FIFO */

static void receive(mbm_picoUart *line)
{
    uart_hw_t *hw = uart_get_hw(line->uart);

    while (uart_is_readable(line->uart)) {
        uint32_t character = hw->dr;

        if (character & UART_UARTDR_OE_BITS)
            line->overruns++;
        /* A damaged character is passed on: the CRC refuses the frame that it is in. */
        if (character & (UART_UARTDR_FE_BITS | UART_UARTDR_PE_BITS | UART_UARTDR_BE_BITS))
            line->faulty++;
        mbm_ring_put(&line->ring, (uint8_t)character);
    }
}

static void send(mbm_picoUart *line)
{
    while (line->next < line->end && uart_is_writable(line->uart)) {
        uart_putc_raw(line->uart, (char)line->toSend[line->next]);
        line->next++;
    }
    if (line->next == line->end)
        hw_clear_bits(&uart_get_hw(line->uart)->imsc, UART_UARTIMSC_TXIM_BITS);
}

static void interrupt(mbm_picoUart *line)
{
    receive(line);
    /* While this is off, a write of the program puts bytes into the FIFO, and may be in the middle
     * of one. */
    if (uart_get_hw(line->uart)->imsc & UART_UARTIMSC_TXIM_BITS)
        send(line);
}

static void interrupt_0(void)
{
    interrupt(lines[0]);
}

static void interrupt_1(void)
{
    interrupt(lines[1]);
}

/* --- a frame that does not leave */

/* The busy flag is set until the stop bit of the last character has left. */
static bool is_sending(const mbm_picoUart *line)
{
    return line->next != line->end || (uart_get_hw(line->uart)->fr & UART_UARTFR_BUSY_BITS);
}

static bool is_overdue(const mbm_picoUart *line)
{
    return time_us_32() - line->sentAt >= line->sendingTime;
}

/* Drops a frame that takes too long: the interrupt is off, CTS holds it back, or the UART has no
 * clock. The next call reports it. */
static void end_if_overdue(mbm_picoUart *line)
{
    uart_hw_t *hw = uart_get_hw(line->uart);
    uint32_t settings;

    if (!is_sending(line) || !is_overdue(line))
        return;
    hw_clear_bits(&hw->imsc, UART_UARTIMSC_TXIM_BITS);
    line->next = line->end;
    /* The UART empties its FIFOs when they are switched off. It must be off itself meanwhile. */
    settings = hw->cr;
    hw_clear_bits(&hw->cr, UART_UARTCR_UARTEN_BITS);
    hw_clear_bits(&hw->lcr_h, UART_UARTLCR_H_FEN_BITS);
    hw_set_bits(&hw->lcr_h, UART_UARTLCR_H_FEN_BITS);
    hw->cr = settings;
    line->stalled++;
    line->hasFailed = true;
}

/* Returns true once after a frame was dropped. */
static bool take_failure(mbm_picoUart *line)
{
    const bool hasFailed = line->hasFailed;

    line->hasFailed = false;
    return hasFailed;
}

/* --- the hooks */

static int16_t line_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    mbm_picoUart *line = context;
    uart_hw_t *hw = uart_get_hw(line->uart);
    const uint32_t on = UART_UARTIMSC_RXIM_BITS | UART_UARTIMSC_RTIM_BITS;

    if (take_failure(line))
        return -1;
    /* The interrupt comes with the fourth character, or 32 bits after the last one. What is in the
     * FIFO before that is taken here, so that silence is seen when it begins. */
    hw_clear_bits(&hw->imsc, on);
    receive(line);
    hw_set_bits(&hw->imsc, on);
    return (int16_t)mbm_ring_read(&line->ring, bytes, capacity);
}

static int16_t line_write(void *context, const uint8_t *bytes, uint16_t length)
{
    mbm_picoUart *line = context;
    uart_hw_t *hw = uart_get_hw(line->uart);

    end_if_overdue(line);
    if (take_failure(line))
        return -1;
    if (line->next != line->end)
        return 0;
    if (length > sizeof line->toSend)
        length = sizeof line->toSend;
    memcpy(line->toSend, bytes, length);
    line->sentAt = time_us_32();
    /* The FIFO may be full of the characters before. */
    line->sendingTime = (2u * (length + FIFO) * BITS * 1000u / line->baud + PATIENCE) * 1000u;
    /* The interrupt comes only when the FIFO becomes emptier, so the first bytes go in here. */
    line->next = 0;
    line->end = length;
    send(line);
    if (line->next != length)
        hw_set_bits(&hw->imsc, UART_UARTIMSC_TXIM_BITS);
    return (int16_t)length;
}

static uint8_t line_flush(void *context)
{
    mbm_picoUart *line = context;

    end_if_overdue(line);
    return line->hasFailed || !is_sending(line);
}

static uint32_t line_micros(void *context)
{
    (void)context;
    return time_us_32();
}

static void driver_on(void *context)
{
    gpio_put(((mbm_picoUart *)context)->driverPin, true);
}

static void driver_off(void *context)
{
    gpio_put(((mbm_picoUart *)context)->driverPin, false);
}

/* A received character ends the sleep early. */
static void line_idle(void *context, mbm_node *node)
{
    uint32_t most = mbm_node_pollDelay(node);

    (void)context;
    if (most >= SHORTEST_SLEEP)
        best_effort_wfe_or_timeout(make_timeout_time_us(most));
}

/* --- opening */

static void begin_driver(const mbm_picoUart *line)
{
    gpio_init(line->driverPin);
    gpio_put(line->driverPin, false);
    gpio_set_dir(line->driverPin, true);
}

static void begin_interrupt(mbm_picoUart *line)
{
    const uint index = uart_get_index(line->uart);
    const uint number = index ? UART1_IRQ : UART0_IRQ;

    lines[index] = line;
    irq_set_exclusive_handler(number, index ? interrupt_1 : interrupt_0);
    irq_set_enabled(number, true);
    uart_set_irqs_enabled(line->uart, true, false);
}

/* The UART divides its clock by 16, and by a number of 16 bits. */
static bool has_rate(const mbm_picoUart *line)
{
    const uint32_t most = clock_get_hz(UART_CLOCK_NUM(line->uart)) / 16u;

    return line->baud != 0 && line->baud <= most && line->baud >= most / 65535u;
}

uint8_t mbm_picoUart_open(mbm_picoUart *line, mbm_port *port)
{
    static const mbm_port hooks = {.read = line_read,
                                   .write = line_write,
                                   .micros = line_micros,
                                   .flush = line_flush,
                                   .idle = line_idle};

    if (line == NULL || port == NULL || line->uart == NULL || !has_rate(line) ||
        line->txPin >= PINS || line->rxPin >= PINS || line->driverPin >= PINS)
        return MBM_INVALID_ARGUMENT;
    if (line->next != line->end && !is_overdue(line))
        return MBM_BUSY;
    line->next = line->end = 0;
    if (line->hasDriver)
        begin_driver(line);
    uart_init(line->uart, line->baud);
    uart_set_format(line->uart, 8, line->parity == UART_PARITY_NONE ? 2 : 1, line->parity);
    uart_set_fifo_enabled(line->uart, true);
    gpio_set_function(line->txPin, UART_FUNCSEL_NUM(line->uart, line->txPin));
    gpio_set_function(line->rxPin, UART_FUNCSEL_NUM(line->uart, line->rxPin));
    /* An open input, as behind a transceiver whose receiver is off, is at rest. */
    gpio_pull_up(line->rxPin);
    line->overruns = 0;
    line->faulty = 0;
    line->stalled = 0;
    line->hasFailed = false;
    mbm_ring_begin(&line->ring, line->ringBytes, sizeof line->ringBytes);
    begin_interrupt(line);
    *port = hooks;
    port->context = line;
    if (line->hasDriver) {
        port->preTransmission = driver_on;
        port->postTransmission = driver_off;
    }
    return MBM_OK;
}

uint16_t mbm_picoUart_lost(const mbm_picoUart *line)
{
    return line == NULL ? 0 : mbm_ring_lost(&line->ring);
}
