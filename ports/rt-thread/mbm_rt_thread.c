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

/* The lines that are open, for the interrupt. */
static mbm_rtThreadLine *lines;

/* --- the device */

/* The framework's buffer drops bytes in silence. So they leave it at once, in the UART's interrupt,
 * for a ring that counts. */
static rt_err_t take_received(rt_device_t device, rt_size_t size)
{
    mbm_rtThreadLine *line = lines;
    rt_uint8_t bytes[16];
    uint16_t count;

    (void)size;
    while (line != RT_NULL && line->device != device)
        line = line->next;
    if (line == RT_NULL)
        return RT_EOK;
    while ((count = (uint16_t)rt_device_read(device, 0, bytes, sizeof bytes)) > 0)
        (void)mbm_ring_write(&line->ring, bytes, count);
    return RT_EOK;
}

/* Version 2 of the framework would wait for ever for a transmitter that does not end. Where it has
 * no timeout yet, the driver sends without its buffer, character by character. */
#if defined(RT_USING_SERIAL_V2) && defined(RT_SERIAL_CTRL_SET_TX_TIMEOUT)
enum { SEND_BUFFER = MBM_MAX_FRAME };

static void set_timeout(const mbm_rtThreadLine *line)
{
    rt_int32_t ticks =
        (rt_int32_t)(2u * MBM_MAX_FRAME * BITS * RT_TICK_PER_SECOND / line->baud + 2u);

    (void)rt_device_control(line->device, RT_SERIAL_CTRL_SET_TX_TIMEOUT, &ticks);
}
#else
enum { SEND_BUFFER = 0 };

static void set_timeout(const mbm_rtThreadLine *line)
{
    (void)line;
}
#endif

static rt_err_t open_device(const mbm_rtThreadLine *line)
{
    struct serial_configure config = RT_SERIAL_CONFIG_DEFAULT;
    rt_err_t error;

    config.baud_rate = line->baud;
    config.data_bits = DATA_BITS_8;
    config.stop_bits = line->parity == PARITY_NONE ? STOP_BITS_2 : STOP_BITS_1;
    config.parity = line->parity & 3u;
#ifdef RT_USING_SERIAL_V2
    config.rx_bufsz = MBM_MAX_FRAME;
    config.tx_bufsz = SEND_BUFFER;
#else
    config.bufsz = MBM_MAX_FRAME;
#endif
    error = rt_device_control(line->device, RT_DEVICE_CTRL_CONFIG, &config);
    if (error != RT_EOK)
        return error;
#ifdef RT_USING_SERIAL_V2
    error =
        rt_device_open(line->device, RT_DEVICE_FLAG_RX_NON_BLOCKING | RT_DEVICE_FLAG_TX_BLOCKING);
#else
    error = rt_device_open(line->device, RT_DEVICE_OFLAG_RDWR | RT_DEVICE_FLAG_INT_RX);
#endif
    if (error != RT_EOK)
        return error;
    (void)rt_device_set_rx_indicate(line->device, take_received);
    set_timeout(line);
    return RT_EOK;
}

/* Opens the device for the next call if another part of the program has closed it, or if it could
 * not be opened again. */
static rt_bool_t is_open(const mbm_rtThreadLine *line)
{
    if (line->device == RT_NULL)
        return RT_FALSE;
    if (line->device->ref_count > 0)
        return RT_TRUE;
    (void)open_device(line);
    return RT_FALSE;
}

/* --- the hooks */

static int16_t line_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    mbm_rtThreadLine *line = context;

    if (!is_open(line))
        return -1;
    return (int16_t)mbm_ring_read(&line->ring, bytes, capacity);
}

static int16_t line_write(void *context, const uint8_t *bytes, uint16_t length)
{
    mbm_rtThreadLine *line = context;

    if (!is_open(line))
        return -1;
    if (rt_device_write(line->device, 0, bytes, length) != length) {
        line->stalled++;
        rt_device_close(line->device);
        (void)open_device(line);
        return -1;
    }
    line->held = line->held + length < line->tail ? (rt_uint8_t)(line->held + length) : line->tail;
    return (int16_t)length;
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

/* --- begin and end */

static void forget(mbm_rtThreadLine *line)
{
    mbm_rtThreadLine **place = &lines;

    while (*place != RT_NULL && *place != line)
        place = &(*place)->next;
    if (*place != RT_NULL)
        *place = line->next;
    line->device = RT_NULL;
}

/* A driver of pins that knows its pins returns a negative level for another. */
static rt_bool_t set_pin(const mbm_rtThreadLine *line)
{
    if (line->driverPin == MBM_RT_THREAD_NO_PIN)
        return RT_TRUE;
    rt_pin_mode(line->driverPin, PIN_MODE_OUTPUT);
    rt_pin_write(line->driverPin, PIN_LOW);
    return rt_pin_read(line->driverPin) >= 0;
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

    /* rt_pin_get returns an error as a negative number. */
    if (line == RT_NULL || port == RT_NULL || line->uart == RT_NULL || line->baud == 0 ||
        line->driverPin < MBM_RT_THREAD_NO_PIN || line->device != RT_NULL)
        return -RT_EINVAL;
    device = rt_device_find(line->uart);
    if (device == RT_NULL)
        return -RT_ENOENT;
    /* A line that was zeroed while it was open is in the list already. */
    forget(line);
    mbm_ring_begin(&line->ring, line->received, sizeof line->received);
    line->device = device;
    line->next = lines;
    lines = line;
    error = open_device(line);
    if (error == RT_EOK && !set_pin(line)) {
        rt_device_close(device);
        error = -RT_EINVAL;
    }
    if (error != RT_EOK) {
        forget(line);
        return error;
    }
    line->stalled = 0;
    line->held = 0;
    *port = hooks;
    port->context = line;
    if (line->driverPin != MBM_RT_THREAD_NO_PIN) {
        port->preTransmission = driver_on;
        port->postTransmission = driver_off;
    }
    return RT_EOK;
}

void mbm_rtThread_close(mbm_rtThreadLine *line)
{
    if (line == RT_NULL || line->device == RT_NULL)
        return;
    if (line->driverPin != MBM_RT_THREAD_NO_PIN)
        rt_pin_write(line->driverPin, PIN_LOW);
    rt_device_close(line->device);
    forget(line);
}

rt_uint16_t mbm_rtThread_lost(const mbm_rtThreadLine *line)
{
    return line == RT_NULL ? 0 : mbm_ring_lost(&line->ring);
}
