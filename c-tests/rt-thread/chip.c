#include "serial_model.h"

#include "test.h"

#include <rthw.h>

enum { CHARACTER_BITS = 11 };

rtt_chip chip;

static uint64_t replyAt;
static rt_base_t output;

void rtt_chip_reset(void)
{
    memset(&chip, 0, sizeof chip);
    chip.baud = 19200;
    chip.knowsPins = true;
    replyAt = 0;
    output = -1;
    rtt_framework_reset();
}

/* --- the line */

uint64_t rtt_character(void)
{
    return CHARACTER_BITS * 1000000u / chip.baud;
}

bool rtt_is_stopped(void)
{
    return chip.stopsAfter > 0 && chip.sent >= chip.stopsAfter;
}

void rtt_send(uint8_t byte)
{
    chip.undriven += !chip.isDriving;
    assert_true(chip.sent < sizeof chip.line);
    chip.line[chip.sent++] = byte;
    if (chip.reply != NULL)
        replyAt = chip.now + 4 * rtt_character();
}

bool rtt_send_waiting(uint8_t byte)
{
    if (rtt_is_stopped()) {
        rtt_chip_pass(10000);
        return false;
    }
    rtt_chip_pass(rtt_character());
    rtt_send(byte);
    /* The character leaves, and the driver says that it did not. */
    return chip.characterTimeout == 0 || chip.characterTimeout >= rtt_character();
}

void rtt_chip_receive(const uint8_t *bytes, unsigned length)
{
    for (unsigned i = 0; i < length; i++) {
        chip.now += rtt_character();
        rtt_framework_receive(bytes[i]);
    }
}

void rtt_chip_pass(uint64_t micros)
{
    const uint64_t end = chip.now + micros, step = rtt_character() / 16 + 1;

    while (chip.now < end) {
        chip.now = end - chip.now < step ? end : chip.now + step;
        rtt_framework_work();
        if (replyAt != 0 && chip.now >= replyAt) {
            replyAt = 0;
            rtt_chip_receive(chip.reply, chip.replyLength);
        }
    }
}

void rtt_chip_close(void)
{
    (void)rt_device_close(&rtt_uart);
}

/* --- pins, clock and threads */

static bool is_pin(rt_base_t pin)
{
    return pin >= 0 && pin < RTT_PINS;
}

void rtt_pin_mode(rt_base_t pin)
{
    if (is_pin(pin))
        output = pin;
}

void rtt_pin_write(rt_base_t pin, bool isHigh)
{
    if (pin == output && pin == RTT_DRIVER_PIN)
        chip.isDriving = isHigh;
}

rt_ssize_t rtt_pin_read(rt_base_t pin)
{
    if (chip.knowsPins && !is_pin(pin))
        return -RT_EINVAL;
    return pin == RTT_DRIVER_PIN && chip.isDriving ? PIN_HIGH : PIN_LOW;
}

rt_tick_t rt_tick_get(void)
{
    rtt_chip_pass(1);
    return (rt_tick_t)(chip.now / (1000000 / RT_TICK_PER_SECOND));
}

rt_err_t rt_thread_delay(rt_tick_t ticks)
{
    rtt_chip_pass(ticks * (1000000 / RT_TICK_PER_SECOND));
    return RT_EOK;
}

void rt_hw_us_delay(rt_uint32_t micros)
{
    rtt_chip_pass(micros);
}
