/* examples/pico/serve_uart.c, and with USB serve_usb.c's holding registers, over nanoMODBUS, for
 * scripts/bench/kits. It polls the UART and waits for the last bit, as its example for the RP2040
 * does. With WITHOUT it is the same program without Modbus. Licence: MIT OR Apache-2.0. */
#include "hardware/gpio.h"
#include "hardware/uart.h"
#include "pico/stdlib.h"

enum { SIZE = 4, BAUD = 19200, DRIVER = 6 };

#ifdef USB
#include "tusb.h"

static void begin_line(void)
{
    tusb_init();
}

static void work(void)
{
    tud_task();
}

static bool take(uint8_t *byte)
{
    return tud_cdc_available() && tud_cdc_read(byte, 1) == 1;
}

static void put(const uint8_t *bytes, uint16_t count)
{
    uint16_t sent = 0;

    while (sent < count && tud_ready()) {
        sent = (uint16_t)(sent + tud_cdc_write(bytes + sent, (uint32_t)count - sent));
        tud_cdc_write_flush();
        tud_task();
    }
}
#else
static void begin_line(void)
{
    uart_init(uart1, BAUD);
    uart_set_format(uart1, 8, 1, UART_PARITY_EVEN);
    gpio_set_function(4, GPIO_FUNC_UART);
    gpio_set_function(5, GPIO_FUNC_UART);
    gpio_init(DRIVER);
    gpio_set_dir(DRIVER, true);
}

static void work(void) {}

static bool take(uint8_t *byte)
{
    if (!uart_is_readable(uart1))
        return false;
    *byte = (uint8_t)uart_getc(uart1);
    return true;
}

static void put(const uint8_t *bytes, uint16_t count)
{
    gpio_put(DRIVER, true);
    uart_write_blocking(uart1, bytes, count);
    uart_tx_wait_blocking(uart1);
    gpio_put(DRIVER, false);
}
#endif

#ifndef WITHOUT
#include "nanomodbus.h"

static uint16_t holding[SIZE] = {555, 100};
static nmbs_t nmbs;

/* Milliseconds; a negative time has no end. */
static int32_t receive(uint8_t *bytes, uint16_t count, int32_t timeout, void *context)
{
    const uint64_t began = time_us_64();
    uint16_t taken = 0;

    (void)context;
    while (taken < count) {
        work();
        if (take(bytes + taken))
            taken++;
        else if (timeout >= 0 && time_us_64() - began > (uint64_t)timeout * 1000u)
            break;
    }
    return taken;
}

static int32_t transmit(const uint8_t *bytes, uint16_t count, int32_t timeout, void *context)
{
    (void)timeout;
    (void)context;
    put(bytes, count);
    return count;
}

static nmbs_error read_registers(uint16_t address, uint16_t count, uint16_t *out, uint8_t unit,
                                 void *context)
{
    (void)unit;
    (void)context;
    if (address + count > SIZE)
        return NMBS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
    for (uint16_t i = 0; i < count; i++)
        out[i] = holding[address + i];
    return NMBS_ERROR_NONE;
}

static nmbs_error write_registers(uint16_t address, uint16_t count, const uint16_t *values,
                                  uint8_t unit, void *context)
{
    (void)unit;
    (void)context;
    if (address + count > SIZE)
        return NMBS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
    for (uint16_t i = 0; i < count; i++)
        holding[address + i] = values[i];
    return NMBS_ERROR_NONE;
}

static nmbs_error write_register(uint16_t address, uint16_t value, uint8_t unit, void *context)
{
    return write_registers(address, 1, &value, unit, context);
}

int main(void)
{
    nmbs_platform_conf platform;
    nmbs_callbacks callbacks;

    begin_line();
    nmbs_platform_conf_create(&platform);
    platform.transport = NMBS_TRANSPORT_RTU;
    platform.read = receive;
    platform.write = transmit;
    nmbs_callbacks_create(&callbacks);
    callbacks.read_holding_registers = read_registers;
    callbacks.write_single_register = write_register;
    callbacks.write_multiple_registers = write_registers;
    (void)nmbs_server_create(&nmbs, 1, &platform, &callbacks);
    nmbs_set_byte_timeout(&nmbs, 20);
    nmbs_set_read_timeout(&nmbs, 100);
    for (;;)
        (void)nmbs_server_poll(&nmbs);
}
#else
int main(void)
{
    uint8_t byte;

    begin_line();
    for (;;) {
        work();
        if (take(&byte))
            put(&byte, 1);
    }
}
#endif
