/* Nordic's nRF51 UART. Licence: MIT OR Apache-2.0. */
#include "board.h"
#include "faults.h"
#include "machine.h"

#define START_RX REGISTER(UART_BASE + 0x000u)
#define START_TX REGISTER(UART_BASE + 0x008u)
#define RX_READY REGISTER(UART_BASE + 0x108u)
#define TX_READY REGISTER(UART_BASE + 0x11Cu)
#define ERRORS REGISTER(UART_BASE + 0x480u)
#define ENABLE REGISTER(UART_BASE + 0x500u)
#define TX_PIN REGISTER(UART_BASE + 0x50Cu)
#define RX_PIN REGISTER(UART_BASE + 0x514u)
#define RX_DATA REGISTER(UART_BASE + 0x518u)
#define TX_DATA REGISTER(UART_BASE + 0x51Cu)
#define RATE REGISTER(UART_BASE + 0x524u)

#define ENABLED 4u
#define OVERRUN 1u

/* 2^32 times the rate, divided by 16 MHz. The lowest 12 bits are ignored. */
#define RATE_OF(baud) ((uint32_t)(((uint64_t)(baud) << 32) / 16000000u + 0x800u) & 0xFFFFF000u)

/* TX_READY says that the last byte has been sent. Before the first byte it is 0. */
static uint8_t sending;

uint16_t uart_lost(void)
{
    return overruns;
}

void uart_start(void)
{
    TX_PIN = UART_TX_PIN;
    RX_PIN = UART_RX_PIN;
    RATE = RATE_OF(BAUD);
    ENABLE = ENABLED;
    RX_READY = 0;
    TX_READY = 0;
    sending = 0;
    START_RX = 1;
    START_TX = 1;
}

int16_t uart_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    uint16_t count = 0;

    (void)context;
    if (take_failure() != 0u) {
        return -1;
    }
    if ((ERRORS & OVERRUN) != 0u) {
        /* A one clears it. */
        ERRORS = OVERRUN;
        overruns++;
    }
    while ((count < capacity) && (RX_READY != 0u)) {
        /* In this order, since the next byte may set it as soon as this one is read. */
        RX_READY = 0;
        bytes[count] = (uint8_t)RX_DATA;
        count++;
    }
    return (int16_t)count;
}

static uint8_t is_done(void)
{
    if ((sending != 0u) && (TX_READY != 0u)) {
        TX_READY = 0;
        sending = 0;
    }
    return sending == 0u;
}

int16_t uart_write(void *context, const uint8_t *bytes, uint16_t length)
{
    uint16_t count = 0;

    (void)context;
    if ((length > 0u) && (is_done() != 0u)) {
        sending = 1;
        TX_DATA = bytes[0];
        count = 1;
    }
    return written(count, uart_start);
}

uint8_t uart_flush(void *context)
{
    (void)context;
    return flushed(is_done(), uart_start);
}
