/* See mbm_zephyr.h. Licence: MIT OR Apache-2.0. */
#include "mbm_zephyr.h"

#include <errno.h>
#include <string.h>
#include <zephyr/sys/printk.h>

/* The bits of a character: start, data, parity or a second stop bit, stop. */
enum { BITS = 11 };

/* The longest sleep, in microseconds. */
#define LONGEST_SLEEP 1000000u

static uint32_t line_micros(void *context)
{
    (void)context;
#ifdef CONFIG_ARCH_POSIX
    /* The clock of native_sim stands still while a program runs, and the master asks for the time
     * until a silence is over. */
    k_busy_wait(10);
#endif
    /* The cycle counter times a factor would not wrap at 2^32. */
    return (uint32_t)k_ticks_to_us_floor64((uint64_t)k_uptime_ticks());
}

/* --- the interrupt */

static void receive(mbm_zephyrLine *line)
{
    uint8_t bytes[16];
    int count;

    /* uart_fifo_read may wait for a byte if none is there, as that of native_sim does. */
    do {
        count = uart_fifo_read(line->uart, bytes, sizeof bytes);
        if (count > 0)
            mbm_ring_write(&line->ring, bytes, (uint16_t)count);
    } while (count > 0 && uart_irq_rx_ready(line->uart));
    k_sem_give(&line->received);
}

static void send(mbm_zephyrLine *line)
{
    if (line->next < line->end) {
        int count = uart_fifo_fill(line->uart, line->toSend + line->next, line->end - line->next);

        if (count > 0)
            line->next = (uint16_t)(line->next + count);
    } else if (uart_irq_tx_complete(line->uart)) {
        uart_irq_tx_disable(line->uart);
        line->isSending = false;
    }
}

static void interrupt(const struct device *uart, void *context)
{
    mbm_zephyrLine *line = context;

    if (!uart_irq_update(uart) || !uart_irq_is_pending(uart))
        return;
    if (uart_irq_rx_ready(uart))
        receive(line);
    if (uart_irq_tx_ready(uart))
        send(line);
}

/* --- the hooks */

static int16_t line_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    mbm_zephyrLine *line = context;

    return (int16_t)mbm_ring_read(&line->ring, bytes, capacity);
}

/* Half a character is added, for rates and clocks that are not exact. The device's reply begins
 * after more than three. */
static uint32_t sending_micros(const mbm_zephyrLine *line, uint16_t length)
{
    uint32_t halves = (2u * length + 1u) * BITS;

    return (uint32_t)((uint64_t)halves * 500000 / line->baud);
}

static int16_t line_write(void *context, const uint8_t *bytes, uint16_t length)
{
    mbm_zephyrLine *line = context;

    if (line->isSending)
        return 0;
    if (length > sizeof line->toSend)
        length = sizeof line->toSend;
    memcpy(line->toSend, bytes, length);
    line->next = 0;
    line->end = length;
    line->beganAtCycles = k_cycle_get_32();
    line->lastsCycles = k_us_to_cyc_ceil32(sending_micros(line, length));
    line->isSending = true;
    uart_irq_tx_enable(line->uart);
    return (int16_t)length;
}

/* Some UARTs report that they are done while the last byte still leaves, so the time counts too.
 * The cycle counter measures it, because a tick may be longer than a character. */
static uint8_t line_flush(void *context)
{
    mbm_zephyrLine *line = context;

    return !line->isSending && k_cycle_get_32() - line->beganAtCycles >= line->lastsCycles;
}

static void driver_on(void *context)
{
    mbm_zephyrLine *line = context;

    gpio_pin_set_dt(&line->driver, 1);
}

static void driver_off(void *context)
{
    mbm_zephyrLine *line = context;

    gpio_pin_set_dt(&line->driver, 0);
}

static void line_idle(void *context, mbm_node *node)
{
    mbm_zephyr_wait(context, mbm_node_pollDelay(node));
}

/* --- opening */

/* The UART has the rate and the format of the devicetree. The driver may know them. */
static void keep_configuration(mbm_zephyrLine *line, const struct uart_config *wanted)
{
    struct uart_config now = *wanted;

    now.baudrate = line->currentSpeed;
#ifdef CONFIG_UART_USE_RUNTIME_CONFIGURE
    if (uart_config_get(line->uart, &now) != 0) {
        now = *wanted;
        now.baudrate = line->currentSpeed;
    }
#endif
    if (now.baudrate != 0 && now.baudrate != line->baud) {
        printk("mbm: %s keeps the %u baud of its devicetree, not %u: set current-speed\n",
               line->uart->name, (unsigned)now.baudrate, (unsigned)line->baud);
        line->baud = now.baudrate;
    }
    if (now.parity != wanted->parity || now.stop_bits != wanted->stop_bits ||
        now.data_bits != wanted->data_bits)
        printk("mbm: %s keeps the parity and the data and stop bits of its devicetree\n",
               line->uart->name);
}

static int configure(mbm_zephyrLine *line)
{
    const struct uart_config config = {
        .baudrate = line->baud,
        .parity = line->parity,
        .stop_bits =
            line->parity == UART_CFG_PARITY_NONE ? UART_CFG_STOP_BITS_2 : UART_CFG_STOP_BITS_1,
        .data_bits = UART_CFG_DATA_BITS_8,
        .flow_ctrl = UART_CFG_FLOW_CTRL_NONE,
    };

#ifdef CONFIG_UART_USE_RUNTIME_CONFIGURE
    /* -ENOSYS comes from a driver without this function. */
    int error = uart_configure(line->uart, &config);

    if (error != -ENOSYS)
        return error;
#endif
    keep_configuration(line, &config);
    return 0;
}

int mbm_zephyr_open(mbm_zephyrLine *line, mbm_port *port)
{
    static const mbm_port hooks = {.read = line_read,
                                   .write = line_write,
                                   .micros = line_micros,
                                   .flush = line_flush,
                                   .idle = line_idle};
    int error;

    if (line == NULL || port == NULL || line->uart == NULL || line->baud == 0 || line->isSending)
        return -EINVAL;
    if (!device_is_ready(line->uart))
        return -ENODEV;
    if (line->driver.port != NULL) {
        if (!device_is_ready(line->driver.port))
            return -ENODEV;
        error = gpio_pin_configure_dt(&line->driver, GPIO_OUTPUT_INACTIVE);
        if (error != 0)
            return error;
    }
    error = configure(line);
    if (error != 0)
        return error;
    mbm_ring_begin(&line->ring, line->ringBytes, sizeof line->ringBytes);
    k_sem_init(&line->received, 0, 1);
    error = uart_irq_callback_user_data_set(line->uart, interrupt, line);
    if (error != 0)
        return error;
    uart_irq_tx_disable(line->uart);
    uart_irq_rx_enable(line->uart);
    *port = hooks;
    port->context = line;
    if (line->driver.port != NULL) {
        port->preTransmission = driver_on;
        port->postTransmission = driver_off;
    }
    return 0;
}

/* A sleep of n ticks ends after up to n + 1, and must not be too long: the driver would still be on
 * when the reply comes. */
void mbm_zephyr_wait(mbm_zephyrLine *line, uint32_t timeoutUs)
{
    const uint32_t ticks = k_us_to_ticks_floor32(MIN(timeoutUs, LONGEST_SLEEP));

    if (line != NULL && ticks > 1)
        k_sem_take(&line->received, K_TICKS(ticks - 1));
}

uint16_t mbm_zephyr_lost(const mbm_zephyrLine *line)
{
    return line == NULL ? 0 : mbm_ring_lost(&line->ring);
}
