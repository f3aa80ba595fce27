/* The USART of STM32 F1, F2 and F4. Licence: MIT OR Apache-2.0. */
#include "board.h"
#include "machine.h"

#define STATUS REGISTER(UART_BASE + 0x00)
#define DATA REGISTER(UART_BASE + 0x04)
#define DIVISOR REGISTER(UART_BASE + 0x08)
#define CONTROL REGISTER(UART_BASE + 0x0C)

enum { RX_FULL = 1 << 5, TX_DONE = 1 << 6, TX_EMPTY = 1 << 7 };
enum { RX_ENABLE = 1 << 2, TX_ENABLE = 1 << 3, ENABLE = 1 << 13 };

/* The chip's start-up must set the clocks and pins of the USART. */
void uart_start(void)
{
    DIVISOR = (UART_HZ + BAUD / 2u) / BAUD;
    CONTROL = ENABLE | TX_ENABLE | RX_ENABLE;
}

#define HAS_BYTE (STATUS & RX_FULL)
#define CAN_SEND (STATUS & TX_EMPTY)
#include "polled.h"

uint8_t uart_flush(void *context)
{
    (void)context;
    return (STATUS & TX_DONE) != 0;
}
