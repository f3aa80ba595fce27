/* STAND_IN_UART_KIND is what the UART's driver can do: CONFIGURABLE, READABLE or FIXED.
 *
 * Plays Zephyr's UART with a FIFO of 16 bytes, a GPIO and the kernel's clock on a line in memory.
 * The sample's main runs by itself: this file's constructor prepares the line. The program ends
 * when the device has answered four requests and ignored one. Licence: MIT OR Apache-2.0. */
#include "line.h"
#include "zephyr_board.h"

#include <errno.h>
#include <stdio.h>
#include <zephyr/drivers/gpio.h>
#include <zephyr/drivers/uart.h>
#include <zephyr/kernel.h>

enum { FIFO = 16 };
enum { CONFIGURABLE, READABLE, FIXED };

const struct device stand_in_uart = {.name = STAND_IN_UART};
const struct device stand_in_gpio = {.name = STAND_IN_GPIO};

struct board_faults board_faults;
unsigned board_interrupts;
static uart_irq_callback_user_data_t call;
static void *call_data;
static const int uart_kind = STAND_IN_UART_KIND;
static bool is_configured;
static bool is_output, has_rx, has_tx, is_inside, is_updated, has_begun;
static unsigned locks;

__attribute__((constructor)) static void begin(void)
{
    line_ignore_after(2);
    line_end_after(4);
    if (uart_kind != CONFIGURABLE) {
        line_begin(STAND_IN_CURRENT_SPEED);
        is_configured = true;
    }
}

bool device_is_ready(const struct device *device)
{
    return (device == &stand_in_uart && !board_faults.uartIsNotReady) ||
           (device == &stand_in_gpio && !board_faults.gpioIsNotReady);
}

/* --- the UART */

static bool has_received(void)
{
    return has_rx && line_received() > 0 &&
           !(board_faults.isDeafUntilChecked && board_faults.errors != 0);
}

static bool can_send(void)
{
    return has_tx && line_unsent() < FIFO && !board_faults.hasNoTxInterrupt &&
           !(board_faults.hasNoLastInterrupt && has_begun && line_unsent() <= 1);
}

/* The interrupt's level: the handler runs again as long as there is something to do. */
void line_interrupt(void)
{
    int times = 0;

    if (call == NULL || is_inside || locks > 0)
        return;
    is_inside = true;
    while (has_received() || (can_send() && times < 2)) {
        line_expect(times++ < 100, "the handler does not end");
        is_updated = false;
        board_interrupts++;
        call(&stand_in_uart, call_data);
    }
    is_inside = false;
}

void board_interrupt(void)
{
    has_tx = true;
    line_interrupt();
}

int uart_configure(const struct device *dev, const struct uart_config *config)
{
    line_expect(dev == &stand_in_uart && config->baudrate == 19200, "the rate");
    if (uart_kind != CONFIGURABLE)
        return -ENOSYS;
    if (board_faults.configure != 0)
        return board_faults.configure;
    line_expect(config->parity == UART_CFG_PARITY_EVEN &&
                    config->stop_bits == UART_CFG_STOP_BITS_1 &&
                    config->data_bits == UART_CFG_DATA_BITS_8 &&
                    config->flow_ctrl == UART_CFG_FLOW_CTRL_NONE,
                "the format");
    if (!board_faults.keepsFifo)
        line_drop_unsent();
    /* As some drivers do. */
    has_rx = has_tx = false;
    if (!is_configured)
        line_begin(config->baudrate);
    is_configured = true;
    return 0;
}

int uart_config_get(const struct device *dev, struct uart_config *config)
{
    line_expect(dev == &stand_in_uart, "the settings of another UART");
    if (uart_kind == FIXED)
        return -ENOSYS;
    *config =
        (struct uart_config){STAND_IN_CURRENT_SPEED, UART_CFG_PARITY_NONE, UART_CFG_STOP_BITS_1,
                             UART_CFG_DATA_BITS_8, UART_CFG_FLOW_CTRL_NONE};
    return 0;
}

int uart_irq_callback_user_data_set(const struct device *dev, uart_irq_callback_user_data_t wanted,
                                    void *user_data)
{
    line_expect(dev == &stand_in_uart && is_configured, "a handler for another UART");
    call = wanted;
    call_data = user_data;
    return 0;
}

int uart_irq_update(const struct device *dev)
{
    is_updated = dev == &stand_in_uart && is_inside;
    return is_updated;
}

int uart_irq_rx_ready(const struct device *dev)
{
    (void)dev;
    line_expect(is_updated, "the state is read without uart_irq_update");
    return has_received();
}

int uart_irq_tx_ready(const struct device *dev)
{
    (void)dev;
    line_expect(is_updated, "the state is read without uart_irq_update");
    return can_send();
}

int uart_irq_is_pending(const struct device *dev)
{
    return uart_irq_rx_ready(dev) || uart_irq_tx_ready(dev);
}

/* As many UARTs do: the FIFO is empty, but the last byte still leaves. */
int uart_irq_tx_complete(const struct device *dev)
{
    (void)dev;
    return line_unsent() <= 1;
}

void uart_irq_rx_enable(const struct device *dev)
{
    has_rx = dev == &stand_in_uart;
    line_interrupt();
}

void uart_irq_tx_enable(const struct device *dev)
{
    has_tx = dev == &stand_in_uart;
    has_begun = false;
    line_interrupt();
}

void uart_irq_tx_disable(const struct device *dev)
{
    (void)dev;
    has_tx = false;
}

int uart_fifo_read(const struct device *dev, uint8_t *bytes, const int size)
{
    line_expect(dev == &stand_in_uart && is_inside, "the FIFO is read outside of the handler");
    line_expect(line_received() > 0,
                "the FIFO is read while it is empty: some drivers wait for a byte");
    return line_read(bytes, (uint16_t)size);
}

int uart_fifo_fill(const struct device *dev, const uint8_t *bytes, int size)
{
    int space = FIFO - line_unsent();

    line_expect(dev == &stand_in_uart && is_inside, "the FIFO is filled outside of the handler");
    has_begun = true;
    return line_write(bytes, (uint16_t)(size < space ? size : space));
}

int uart_err_check(const struct device *dev)
{
    const int errors = board_faults.errors;

    line_expect(dev == &stand_in_uart, "the errors of another UART");
    if (board_faults.hasNoErrCheck)
        return -ENOSYS;
    if (!board_faults.keepsErrors)
        board_faults.errors = 0;
    return errors;
}

/* --- the GPIO */

int gpio_pin_configure_dt(const struct gpio_dt_spec *pin, gpio_flags_t flags)
{
    line_expect(pin->port == &stand_in_gpio && pin->pin == STAND_IN_PIN &&
                    flags == GPIO_OUTPUT_INACTIVE,
                "another GPIO is set up");
    if (board_faults.pinConfigure != 0)
        return board_faults.pinConfigure;
    /* A line may be opened again. */
    if (!is_output)
        printf("driver: pin %d of %s\n", pin->pin, pin->port->name);
    is_output = true;
    line_has_driver();
    return 0;
}

int gpio_pin_set_dt(const struct gpio_dt_spec *pin, int value)
{
    line_expect(pin->port == &stand_in_gpio && pin->pin == STAND_IN_PIN && is_output,
                "another GPIO is set");
    if (board_faults.pinSet != 0)
        return board_faults.pinSet;
    line_drive(value != 0);
    return 0;
}

/* --- the kernel */

int64_t k_uptime_ticks(void)
{
    return line_micros() / STAND_IN_TICK_US;
}

uint32_t k_uptime_get_32(void)
{
    return line_micros() / 1000;
}

uint32_t k_cycle_get_32(void)
{
    return line_micros() * STAND_IN_MHZ;
}

uint32_t k_us_to_ticks_floor32(uint32_t micros)
{
    return micros / STAND_IN_TICK_US;
}

uint32_t k_us_to_cyc_ceil32(uint32_t micros)
{
    return micros * STAND_IN_MHZ;
}

uint64_t k_ticks_to_us_floor64(uint64_t ticks)
{
    return ticks * STAND_IN_TICK_US;
}

int32_t k_msleep(int32_t milliseconds)
{
    line_sleep((uint32_t)milliseconds * 1000);
    return 0;
}

/* On one core: interrupts wait. */
k_spinlock_key_t k_spin_lock(struct k_spinlock *lock)
{
    line_expect(!lock->isLocked, "a lock is taken twice");
    lock->isLocked = true;
    locks++;
    return (k_spinlock_key_t){0};
}

void k_spin_unlock(struct k_spinlock *lock, k_spinlock_key_t key)
{
    (void)key;
    line_expect(lock->isLocked, "a lock is given twice");
    lock->isLocked = false;
    locks--;
    line_interrupt();
}

int k_sem_init(struct k_sem *sem, unsigned count, unsigned limit)
{
    sem->count = count;
    sem->limit = limit;
    return 0;
}

void k_sem_give(struct k_sem *sem)
{
    if (sem->count < sem->limit)
        sem->count++;
}

int k_sem_take(struct k_sem *sem, k_timeout_t timeout)
{
    while (sem->count == 0 && timeout.ticks-- > 0)
        line_sleep(STAND_IN_TICK_US);
    if (sem->count == 0)
        return -11; /* EAGAIN */
    sem->count--;
    return 0;
}
