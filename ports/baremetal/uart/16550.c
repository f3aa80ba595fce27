/* The 16550, with registers a byte apart. Licence: MIT OR Apache-2.0. */
#include "board.h"
#include "machine.h"

#define REGISTER8(offset) (*(volatile uint8_t *)(uintptr_t)(UART_BASE + (offset)))
#define DATA REGISTER8(0u)
#define DIVISOR_LOW REGISTER8(0u)
#define DIVISOR_HIGH REGISTER8(1u)
#define FIFO REGISTER8(2u)
#define LINE REGISTER8(3u)
#define STATUS REGISTER8(5u)

#define FIFOS_ON 1u
#define FIFOS_CLEAR 6u
#define EIGHT_BITS 3u
#define SET_DIVISOR 0x80u
#define RX_FULL (1u << 0u)
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

#define HAS_BYTE ((STATUS & RX_FULL) != 0u)
#define CAN_SEND ((STATUS & TX_EMPTY) != 0u)
#include "polled.h"

uint8_t uart_flush(void *context)
{
    (void)context;
    return (STATUS & TX_DONE) != 0u;
}
