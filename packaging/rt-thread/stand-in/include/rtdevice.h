/* See rtthread.h. Licence: MIT OR Apache-2.0. */
#pragma once

#include <rtthread.h>

#define DATA_BITS_8 8
#define STOP_BITS_1 0
#define STOP_BITS_2 1
#define PARITY_NONE 0
#define PARITY_ODD 1
#define PARITY_EVEN 2

#ifdef RT_USING_SERIAL_V2
struct serial_configure {
    rt_uint32_t baud_rate;
    rt_uint32_t data_bits : 4, stop_bits : 2, parity : 2, bit_order : 1, invert : 1;
    rt_uint32_t rx_bufsz : 16, tx_bufsz : 16;
};

/* The first releases with version 2 do not have it. */
#ifndef STAND_IN_WITHOUT_TX_TIMEOUT
#define RT_SERIAL_CTRL_SET_TX_TIMEOUT 0x42
#endif
#else
struct serial_configure {
    rt_uint32_t baud_rate;
    rt_uint32_t data_bits : 4, stop_bits : 2, parity : 2, bit_order : 1, invert : 1, bufsz : 16;
};
#endif

/* 115200 8N1. */
#define RT_SERIAL_CONFIG_DEFAULT                                                                   \
    {                                                                                              \
        .baud_rate = 115200, .data_bits = DATA_BITS_8                                              \
    }

#define PIN_LOW 0
#define PIN_HIGH 1
#define PIN_MODE_OUTPUT 0

void rt_pin_mode(rt_base_t pin, rt_uint8_t mode);
void rt_pin_write(rt_base_t pin, rt_ssize_t value);
rt_ssize_t rt_pin_read(rt_base_t pin);
