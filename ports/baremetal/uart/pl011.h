/* The registers of Arm's PL011, and its start with or without interrupts. Licence: MIT OR
 * Apache-2.0. */
#include "board.h"
#include "faults.h"
#include "machine.h"

#define DATA REGISTER(UART_BASE + 0x00u)
#define FLAGS REGISTER(UART_BASE + 0x18u)
#define DIVISOR REGISTER(UART_BASE + 0x24u)
#define FRACTION REGISTER(UART_BASE + 0x28u)
#define LINE REGISTER(UART_BASE + 0x2Cu)
#define CONTROL REGISTER(UART_BASE + 0x30u)

#define OVERRUN ((uint32_t)1u << 11u) /* in DATA, beside the byte */
#define BUSY (1u << 3u)
#define RX_EMPTY (1u << 4u)
#define TX_FULL (1u << 5u)
#define FIFOS (1u << 4u)
#define EIGHT_BITS (3u << 5u)
#define ENABLE (1u << 0u)
#define TX_ENABLE (1u << 8u)
#define RX_ENABLE (1u << 9u)

/* Sets baud rate and format, and empties the FIFOs. The UART stays off until CONTROL is set. */
static inline void pl011_set_line(void)
{
    /* In 64ths of the clock divided by 16. */
    uint32_t divisor = ((UART_HZ * 4u) + (BAUD / 2u)) / BAUD;

    CONTROL = 0;
    DIVISOR = divisor / 64u;
    FRACTION = divisor % 64u;
    LINE = EIGHT_BITS;
    LINE = FIFOS | EIGHT_BITS;
}

/* Returns the next received byte. */
static inline uint8_t pl011_take(void)
{
    uint32_t data = DATA;

    if ((data & OVERRUN) != 0u) {
        overruns++;
    }
    return (uint8_t)data;
}
