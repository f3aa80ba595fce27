/* The 16550, with registers a byte apart. Licence: MIT OR Apache-2.0. */
#include "board.h"
#include "faults.h"
#include "machine.h"

#define DATA REGISTER8(UART_BASE + 0u)
#define DIVISOR_LOW REGISTER8(UART_BASE + 0u)
#define DIVISOR_HIGH REGISTER8(UART_BASE + 1u)
#define FIFO REGISTER8(UART_BASE + 2u)
#define LINE REGISTER8(UART_BASE + 3u)
#define STATUS REGISTER8(UART_BASE + 5u)

#define FIFOS_ON 1u
#define FIFOS_CLEAR 6u
#define EIGHT_BITS 3u
#define SET_DIVISOR 0x80u
#define RX_FULL (1u << 0u)
#define OVERRUN (1u << 1u)
#define TX_EMPTY (1u << 5u)
#define TX_DONE (1u << 6u)

void uart_start(void)
{
    uint32_t divisor = ((UART_HZ / 16u) + (BAUD / 2u)) / BAUD;

    LINE = SET_DIVISOR | EIGHT_BITS;
    DIVISOR_LOW = (uint8_t)divisor;
    DIVISOR_HIGH = (uint8_t)(divisor >> 8);
    LINE = EIGHT_BITS;
    FIFO = FIFOS_ON | FIFOS_CLEAR;
}

/* Reading the status clears the overrun. */
static uint8_t status(void)
{
    uint8_t now = STATUS;

    if ((now & OVERRUN) != 0u) {
        overruns++;
    }
    return now;
}

static uint8_t take_byte(uint8_t *byte)
{
    if ((status() & RX_FULL) == 0u) {
        return 0;
    }
    *byte = DATA;
    return 1;
}

#define CAN_SEND ((status() & TX_EMPTY) != 0u)
#define IS_DONE ((status() & TX_DONE) != 0u)
#include "polled.h"
