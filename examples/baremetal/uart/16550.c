/* The 16550, with registers a byte apart. Licence: MIT OR Apache-2.0. */
#include "board.h"
#include "machine.h"

#define REGISTER8(offset) (*(volatile uint8_t *)(uintptr_t)(UART_BASE + (offset)))
#define DATA REGISTER8(0)
#define DIVISOR_LOW REGISTER8(0)
#define DIVISOR_HIGH REGISTER8(1)
#define FIFO REGISTER8(2)
#define LINE REGISTER8(3)
#define STATUS REGISTER8(5)

enum { FIFOS_ON = 1, FIFOS_CLEAR = 6, EIGHT_BITS = 3, SET_DIVISOR = 0x80 };
enum { RX_FULL = 1 << 0, TX_EMPTY = 1 << 5, TX_DONE = 1 << 6 };

void uart_start(void)
{
    uint32_t divisor = (UART_HZ / 16u + BAUD / 2u) / BAUD;

    LINE = SET_DIVISOR | EIGHT_BITS;
    DIVISOR_LOW = (uint8_t)divisor;
    DIVISOR_HIGH = (uint8_t)(divisor >> 8);
    LINE = EIGHT_BITS;
    FIFO = FIFOS_ON | FIFOS_CLEAR;
}

#define HAS_BYTE (STATUS & RX_FULL)
#define CAN_SEND (STATUS & TX_EMPTY)
#include "polled.h"

uint8_t uart_flush(void *context)
{
    (void)context;
    return (STATUS & TX_DONE) != 0;
}
