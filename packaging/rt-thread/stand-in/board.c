/* Plays RT-Thread's serial device, pins and clock on a line in memory, and runs the shell command
 * of the example. Its serial driver returns from a write while the last MBM_EXAMPLE_TAIL
 * characters still leave. Licence: MIT OR Apache-2.0. */
#include "line.h"

#include <rtdevice.h>
#include <rthw.h>
#include <rtthread.h>
#include <stdbool.h>
#include <string.h>

extern int (*const stand_in_command)(int, char **);

static struct rt_device uart;
static bool is_configured, is_output;
static rt_err_t (*indicate)(rt_device_t device, rt_size_t size);

/* Bytes have arrived, perhaps. */
void line_interrupt(void)
{
    if (uart.ref_count > 0 && indicate != NULL && line_received() > 0)
        (void)indicate(&uart, line_received());
}

rt_device_t rt_device_find(const char *name)
{
    return strcmp(name, "uart2") == 0 ? &uart : NULL;
}

rt_err_t rt_device_control(rt_device_t device, int command, void *argument)
{
    const struct serial_configure *config = argument;

#ifdef RT_SERIAL_CTRL_SET_TX_TIMEOUT
    if (command == RT_SERIAL_CTRL_SET_TX_TIMEOUT) {
        line_expect(device == &uart && uart.ref_count == 1 && *(rt_int32_t *)argument > 0,
                    "the timeout");
        return RT_EOK;
    }
#endif
    line_expect(device == &uart && command == RT_DEVICE_CTRL_CONFIG && uart.ref_count == 0,
                "the control");
    line_expect(config->data_bits == DATA_BITS_8 && config->parity == PARITY_EVEN &&
                    config->stop_bits == STOP_BITS_1,
                "the format");
#ifdef RT_USING_SERIAL_V2
    line_expect(config->rx_bufsz >= 256, "the buffer is too small");
#else
    line_expect(config->bufsz >= 256, "the buffer is too small");
#endif
    line_begin(config->baud_rate);
    is_configured = true;
    return RT_EOK;
}

rt_err_t rt_device_open(rt_device_t device, rt_uint16_t flags)
{
    line_expect(device == &uart && is_configured && uart.ref_count == 0, "the device is opened");
#ifdef RT_USING_SERIAL_V2
    line_expect(flags == (RT_DEVICE_FLAG_RX_NON_BLOCKING | RT_DEVICE_FLAG_TX_BLOCKING),
                "the flags");
    printf("serial framework: 2\n");
#else
    line_expect(flags == (RT_DEVICE_OFLAG_RDWR | RT_DEVICE_FLAG_INT_RX), "the flags");
    printf("serial framework: 1\n");
#endif
    uart.ref_count = 1;
    return RT_EOK;
}

rt_err_t rt_device_close(rt_device_t device)
{
    line_expect(device == &uart && uart.ref_count == 1, "another device is closed");
    uart.ref_count = 0;
    indicate = NULL;
    return RT_EOK;
}

rt_err_t rt_device_set_rx_indicate(rt_device_t device,
                                   rt_err_t (*function)(rt_device_t device, rt_size_t size))
{
    line_expect(device == &uart && uart.ref_count == 1, "another device indicates");
    indicate = function;
    return RT_EOK;
}

rt_ssize_t rt_device_read(rt_device_t device, rt_off_t position, void *bytes, rt_size_t size)
{
    line_expect(device == &uart && uart.ref_count == 1 && position == 0, "no device to read from");
    return line_read(bytes, (uint16_t)size);
}

rt_ssize_t rt_device_write(rt_device_t device, rt_off_t position, const void *bytes, rt_size_t size)
{
    line_expect(device == &uart && uart.ref_count == 1 && position == 0, "no device to write to");
    size = line_write(bytes, (uint16_t)size);
    while (line_unsent() > MBM_EXAMPLE_TAIL)
        line_sleep(1);
    return (rt_ssize_t)size;
}

void rt_pin_mode(rt_base_t pin, rt_uint8_t mode)
{
    line_expect(pin == MBM_EXAMPLE_DRIVER_PIN && mode == PIN_MODE_OUTPUT, "the mode of a pin");
    is_output = true;
    line_has_driver();
}

void rt_pin_write(rt_base_t pin, rt_ssize_t value)
{
    line_expect(pin == MBM_EXAMPLE_DRIVER_PIN && is_output, "another pin is set");
    line_drive(value == PIN_HIGH);
}

rt_ssize_t rt_pin_read(rt_base_t pin)
{
    return pin == MBM_EXAMPLE_DRIVER_PIN ? PIN_LOW : -RT_EINVAL;
}

rt_tick_t rt_tick_get(void)
{
    return line_micros() / (1000000 / RT_TICK_PER_SECOND);
}

rt_err_t rt_thread_delay(rt_tick_t ticks)
{
    line_sleep(ticks * (1000000 / RT_TICK_PER_SECOND));
    return RT_EOK;
}

rt_err_t rt_thread_mdelay(rt_int32_t milliseconds)
{
    line_sleep((uint32_t)milliseconds * 1000);
    return RT_EOK;
}

/* A BSP without this function has RT-Thread's own, which prints a warning and does not wait. */
void rt_hw_us_delay(rt_uint32_t micros)
{
    if (micros == 0)
        printf("rt_hw_us_delay is called for nothing\n");
    line_sleep(micros);
}

int main(void)
{
    line_ignore_after(2);
    if (rt_device_find(MBM_EXAMPLE_UART) == NULL) {
        line_expect(stand_in_command(0, NULL) == -RT_ENOENT, "the command finds a device");
        return 0;
    }
    line_expect(stand_in_command(0, NULL) == 0, "the command fails");
    line_expect(uart.ref_count == 0, "the device is left open");
    return 0;
}
