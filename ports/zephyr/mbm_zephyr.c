/* See mbm_zephyr.h. Licence: MIT OR Apache-2.0. */
#include "mbm_zephyr.h"

#include <errno.h>
#include <string.h>
#include <zephyr/sys/printk.h>

/* The bits of a character: start, data, parity or a second stop bit, stop. */
enum { BITS = 11 };

/* Milliseconds that a frame may take longer than its characters, twice. */
enum { PATIENCE = 50 };

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

/* --- faults */

/* Counts the errors that the driver has seen since the last look. Some drivers receive nothing more
 * until they were asked. One that does not clear an error counts it once. */
static void count_errors(mbm_zephyrLine *line)
{
    const int errors = uart_err_check(line->uart);
    const int others = UART_ERROR_FRAMING | UART_ERROR_PARITY | UART_ERROR_NOISE;
    int more;

    /* -ENOSYS comes from a driver without this function. */
    if (errors < 0)
        return;
    more = errors & ~line->errors;
    line->errors = errors;
    if (more & UART_ERROR_OVERRUN)
        line->overruns++;
    if (more & others)
        line->faulty++;
}

static void end_sending(mbm_zephyrLine *line)
{
    uart_irq_tx_disable(line->uart);
    line->isSending = false;
}

/* Gives up a frame that takes too long: the UART has no clock, or its interrupt does not come. */
static void end_if_overdue(mbm_zephyrLine *line)
{
    if (!line->isSending || k_uptime_get_32() - line->beganAtMs < line->longestMs)
        return;
    line->next = line->end;
    end_sending(line);
    line->isUnsure = true;
    line->hasFailed = true;
    line->stalled++;
    /* No byte will end the sleep of the thread. */
    k_sem_give(&line->received);
}

/* Whether a frame leaves, which may have had all of its time. */
static bool is_busy(mbm_zephyrLine *line)
{
    k_spinlock_key_t key = k_spin_lock(&line->lock);

    end_if_overdue(line);
    k_spin_unlock(&line->lock, key);
    return line->isSending;
}

/* --- the interrupt */

static void receive(mbm_zephyrLine *line)
{
    uint8_t bytes[16];
    int count;

    /* Before, because reading clears the flags of some UARTs. */
    count_errors(line);
    /* uart_fifo_read may wait for a byte if none is there, as that of native_sim does. */
    while (uart_irq_rx_ready(line->uart)) {
        count = uart_fifo_read(line->uart, bytes, sizeof bytes);
        if (count <= 0)
            break;
        mbm_ring_write(&line->ring, bytes, (uint16_t)count);
    }
    /* An overrun meanwhile would be the last interrupt of some UARTs. */
    count_errors(line);
}

static void send(mbm_zephyrLine *line)
{
    if (!line->isSending) {
        uart_irq_tx_disable(line->uart);
    } else if (line->next < line->end) {
        int count = uart_fifo_fill(line->uart, line->toSend + line->next, line->end - line->next);

        if (count > 0)
            line->next = (uint16_t)(line->next + count);
    } else if (uart_irq_tx_complete(line->uart)) {
        end_sending(line);
    }
    /* The interrupt of a transmitter that stands still may come without end. */
    end_if_overdue(line);
}

/* Some drivers call this in the thread too, in uart_irq_tx_enable. */
static void interrupt(const struct device *uart, void *context)
{
    mbm_zephyrLine *line = context;
    k_spinlock_key_t key = k_spin_lock(&line->lock);
    bool hasReceived = false;

    if (uart_irq_update(uart) && uart_irq_is_pending(uart)) {
        hasReceived = uart_irq_rx_ready(uart);
        if (hasReceived)
            receive(line);
        if (uart_irq_tx_ready(uart))
            send(line);
    }
    k_spin_unlock(&line->lock, key);
    if (hasReceived)
        k_sem_give(&line->received);
}

/* --- the driver of the transceiver */

static void driver_on(void *context)
{
    mbm_zephyrLine *line = context;

    if (gpio_pin_set_dt(&line->driver, 1) != 0)
        line->hasFailed = true;
}

static void driver_off(void *context)
{
    mbm_zephyrLine *line = context;

    line->isStuck = gpio_pin_set_dt(&line->driver, 0) != 0;
}

/* --- the settings of the UART */

static struct uart_config settings(const mbm_zephyrLine *line)
{
    const struct uart_config config = {
        .baudrate = line->baud,
        .parity = line->parity,
        .stop_bits =
            line->parity == UART_CFG_PARITY_NONE ? UART_CFG_STOP_BITS_2 : UART_CFG_STOP_BITS_1,
        .data_bits = UART_CFG_DATA_BITS_8,
        .flow_ctrl = UART_CFG_FLOW_CTRL_NONE,
    };

    return config;
}

/* Returns -ENOSYS if the UART cannot be configured at run time. */
static int set_up(const mbm_zephyrLine *line)
{
#ifdef CONFIG_UART_USE_RUNTIME_CONFIGURE
    const struct uart_config config = settings(line);

    return uart_configure(line->uart, &config);
#else
    (void)line;
    return -ENOSYS;
#endif
}

/* Empties the FIFO if the driver can: the rest of a frame that was given up must not leave. */
static void begin_again(mbm_zephyrLine *line)
{
    const int error = set_up(line);

    if (error != 0 && error != -ENOSYS)
        return;
    /* Some drivers have switched it off. */
    uart_irq_rx_enable(line->uart);
    line->isUnsure = false;
}

/* --- the hooks */

/* Reports a failure once. One that lasts is reported until its cause is gone. */
static bool has_failed(mbm_zephyrLine *line)
{
    const bool has = line->hasFailed;

    line->hasFailed = false;
    if (line->isStuck)
        driver_off(line);
    if (line->isUnsure)
        begin_again(line);
    return has || line->isStuck || line->isUnsure;
}

static int16_t line_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    mbm_zephyrLine *line = context;
    const uint16_t count = mbm_ring_read(&line->ring, bytes, capacity);
    k_spinlock_key_t key;

    if (count > 0)
        return (int16_t)count;
    key = k_spin_lock(&line->lock);
    count_errors(line);
    k_spin_unlock(&line->lock, key);
    return has_failed(line) ? -1 : 0;
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
    const bool isBusy = is_busy(line);

    if (has_failed(line))
        return -1;
    if (isBusy)
        return 0;
    if (length > sizeof line->toSend)
        length = sizeof line->toSend;
    memcpy(line->toSend, bytes, length);
    line->next = 0;
    line->end = length;
    line->beganAtCycles = k_cycle_get_32();
    line->lastsCycles = k_us_to_cyc_ceil32(sending_micros(line, length));
    line->beganAtMs = k_uptime_get_32();
    line->longestMs = 2u * sending_micros(line, length) / 1000u + PATIENCE;
    line->isSending = true;
    uart_irq_tx_enable(line->uart);
    return (int16_t)length;
}

/* Some UARTs report that they are done while the last byte still leaves, so the time counts too.
 * The cycle counter measures it, because a tick may be longer than a character. Others are done
 * without another interrupt. */
static uint8_t line_flush(void *context)
{
    mbm_zephyrLine *line = context;
    k_spinlock_key_t key;

    if (k_cycle_get_32() - line->beganAtCycles < line->lastsCycles)
        return 0;
    if (line->isSending) {
        key = k_spin_lock(&line->lock);
        if (line->isSending && line->next >= line->end && uart_irq_tx_complete(line->uart))
            end_sending(line);
        end_if_overdue(line);
        k_spin_unlock(&line->lock, key);
    }
    return !line->isSending;
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
    const struct uart_config wanted = settings(line);
    const int error = set_up(line);

    if (error != -ENOSYS)
        return error;
    keep_configuration(line, &wanted);
    return 0;
}

/* Begins with no frame, no byte and no fault. */
static void clear(mbm_zephyrLine *line)
{
    mbm_ring_begin(&line->ring, line->ringBytes, sizeof line->ringBytes);
    k_sem_init(&line->received, 0, 1);
    line->faulty = line->overruns = line->stalled = 0;
    line->hasFailed = line->isUnsure = line->isStuck = false;
    line->errors = 0;
}

static int set_driver(mbm_zephyrLine *line)
{
    if (line->driver.port == NULL)
        return 0;
    if (!device_is_ready(line->driver.port))
        return -ENODEV;
    return gpio_pin_configure_dt(&line->driver, GPIO_OUTPUT_INACTIVE);
}

int mbm_zephyr_open(mbm_zephyrLine *line, mbm_port *port)
{
    static const mbm_port hooks = {.read = line_read,
                                   .write = line_write,
                                   .micros = line_micros,
                                   .flush = line_flush,
                                   .idle = line_idle};
    int error;

    if (line == NULL || port == NULL || line->uart == NULL || line->baud == 0 || is_busy(line))
        return -EINVAL;
    if (!device_is_ready(line->uart))
        return -ENODEV;
    error = set_driver(line);
    if (error == 0)
        error = configure(line);
    if (error != 0)
        return error;
    clear(line);
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
