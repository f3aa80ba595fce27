/* See mbm_rt_thread.h. Licence: MIT OR Apache-2.0. */
#include "mbm_rt_thread.h"

#include <rthw.h>

/* The bits of a character: start, data, parity or a second stop bit, stop. */
enum { BITS = 11 };

/* RT-Thread 4 has no such number. */
#ifndef RT_ENOENT
#define RT_ENOENT RT_ERROR
#endif

enum { MICROS_OF_A_TICK = 1000000 / RT_TICK_PER_SECOND };

static int16_t line_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    mbm_rtThreadLine *line = context;

    if (line->device == RT_NULL)
        return -1;
    return (int16_t)rt_device_read(line->device, 0, bytes, capacity);
}

static int16_t line_write(void *context, const uint8_t *bytes, uint16_t length)
{
    mbm_rtThreadLine *line = context;
    int16_t count;

    if (line->device == RT_NULL)
        return -1;
    count = (int16_t)rt_device_write(line->device, 0, bytes, length);
    if (count > 0)
        line->held =
            line->held + count < line->tail ? (rt_uint8_t)(line->held + count) : line->tail;
    return count;
}

static uint32_t line_micros(void *context)
{
    (void)context;
    return (uint32_t)rt_tick_get() * MICROS_OF_A_TICK;
}

/* Waits for what the UART still holds. A tick may be longer than the pause before the reply.
 * RT-Thread prints a warning at each call of rt_hw_us_delay if the BSP has no such function. */
static uint8_t line_flush(void *context)
{
    mbm_rtThreadLine *line = context;

    if (line->held > 0)
        rt_hw_us_delay(line->held * BITS * 1000000u / line->baud);
    line->held = 0;
    return 1;
}

static void driver_on(void *context)
{
    mbm_rtThreadLine *line = context;

    rt_pin_write(line->driverPin, PIN_HIGH);
}

static void driver_off(void *context)
{
    mbm_rtThreadLine *line = context;

    rt_pin_write(line->driverPin, PIN_LOW);
}

void mbm_rtThread_wait(uint32_t timeoutUs)
{
    if (timeoutUs >= MICROS_OF_A_TICK)
        rt_thread_delay(1);
}

static void line_idle(void *context, mbm_node *node)
{
    (void)context;
    mbm_rtThread_wait(mbm_node_pollDelay(node));
}

static rt_err_t open_device(const mbm_rtThreadLine *line, rt_device_t device)
{
    struct serial_configure config = RT_SERIAL_CONFIG_DEFAULT;
    rt_err_t error;

    config.baud_rate = line->baud;
    config.data_bits = DATA_BITS_8;
    config.stop_bits = line->parity == PARITY_NONE ? STOP_BITS_2 : STOP_BITS_1;
    config.parity = line->parity & 3u;
#ifdef RT_USING_SERIAL_V2
    config.rx_bufsz = MBM_MAX_FRAME;
#else
    config.bufsz = MBM_MAX_FRAME;
#endif
    error = rt_device_control(device, RT_DEVICE_CTRL_CONFIG, &config);
    if (error != RT_EOK)
        return error;
#ifdef RT_USING_SERIAL_V2
    return rt_device_open(device, RT_DEVICE_FLAG_RX_NON_BLOCKING | RT_DEVICE_FLAG_TX_BLOCKING);
#else
    return rt_device_open(device, RT_DEVICE_OFLAG_RDWR | RT_DEVICE_FLAG_INT_RX);
#endif
}

rt_err_t mbm_rtThread_open(mbm_rtThreadLine *line, mbm_port *port)
{
    static const mbm_port hooks = {.read = line_read,
                                   .write = line_write,
                                   .micros = line_micros,
                                   .flush = line_flush,
                                   .idle = line_idle};
    rt_device_t device;
    rt_err_t error;

    if (line == RT_NULL || port == RT_NULL || line->uart == RT_NULL || line->baud == 0 ||
        line->device != RT_NULL)
        return -RT_EINVAL;
    device = rt_device_find(line->uart);
    if (device == RT_NULL)
        return -RT_ENOENT;
    error = open_device(line, device);
    if (error != RT_EOK)
        return error;
    *port = hooks;
    port->context = line;
    if (line->driverPin != MBM_RT_THREAD_NO_PIN) {
        rt_pin_mode(line->driverPin, PIN_MODE_OUTPUT);
        rt_pin_write(line->driverPin, PIN_LOW);
        port->preTransmission = driver_on;
        port->postTransmission = driver_off;
    }
    line->device = device;
    return RT_EOK;
}

void mbm_rtThread_close(mbm_rtThreadLine *line)
{
    if (line == RT_NULL || line->device == RT_NULL)
        return;
    if (line->driverPin != MBM_RT_THREAD_NO_PIN)
        rt_pin_write(line->driverPin, PIN_LOW);
    rt_device_close(line->device);
    line->device = RT_NULL;
}
