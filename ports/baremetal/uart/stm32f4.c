/* The USART of STM32 F1, F2 and F4. Licence: MIT OR Apache-2.0. */
#include "board.h"
#include "faults.h"
#include "machine.h"

#define STATUS REGISTER(UART_BASE + 0x00u)
#define DATA REGISTER(UART_BASE + 0x04u)
#define DIVISOR REGISTER(UART_BASE + 0x08u)
#define CONTROL REGISTER(UART_BASE + 0x0Cu)

#define OVERRUN (1u << 3u)
#define RX_FULL (1u << 5u)
#define TX_DONE (1u << 6u)
#define TX_EMPTY (1u << 7u)
#define RX_ENABLE (1u << 2u)
#define TX_ENABLE (1u << 3u)
#define ENABLE (1u << 13u)

/* The chip's start-up must set the clocks and pins of the USART. */
void uart_start(void)
{
    DIVISOR = (UART_HZ + (BAUD / 2u)) / BAUD;
    CONTROL = ENABLE | TX_ENABLE | RX_ENABLE;
}

/* Reading the byte clears the overrun, also when the overrun came after the byte was taken. */
static uint8_t take_byte(uint8_t *byte)
{
    uint32_t status = STATUS;

    if ((status & OVERRUN) != 0u) {
        overruns++;
    }
    if ((status & (RX_FULL | OVERRUN)) != 0u) {
        *byte = (uint8_t)DATA;
    }
    return (status & RX_FULL) != 0u;
}

#define CAN_SEND ((STATUS & TX_EMPTY) != 0u)
#define IS_DONE ((STATUS & TX_DONE) != 0u)
#include "polled.h"
