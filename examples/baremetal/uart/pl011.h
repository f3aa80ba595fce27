/* The registers of Arm's PL011, and its start with or without interrupts. Licence: MIT OR
 * Apache-2.0. */
#include "board.h"
#include "machine.h"

#define DATA REGISTER(UART_BASE + 0x00)
#define FLAGS REGISTER(UART_BASE + 0x18)
#define DIVISOR REGISTER(UART_BASE + 0x24)
#define FRACTION REGISTER(UART_BASE + 0x28)
#define LINE REGISTER(UART_BASE + 0x2C)
#define CONTROL REGISTER(UART_BASE + 0x30)

enum { BUSY = 1 << 3, RX_EMPTY = 1 << 4, TX_FULL = 1 << 5 };
enum { FIFOS = 1 << 4, EIGHT_BITS = 3 << 5 };
enum { ENABLE = 1 << 0, TX_ENABLE = 1 << 8, RX_ENABLE = 1 << 9 };

/* Sets baud rate and format. The UART stays off until CONTROL is set. */
static inline void pl011_set_line(void)
{
    /* In 64ths of the clock divided by 16. */
    uint32_t divisor = (UART_HZ * 4u + BAUD / 2u) / BAUD;

    CONTROL = 0;
    DIVISOR = divisor / 64;
    FRACTION = divisor % 64;
    LINE = FIFOS | EIGHT_BITS;
}
