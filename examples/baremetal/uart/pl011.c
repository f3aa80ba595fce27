/* Arm's PL011: Stellaris, RP2040 and others.
 * Licence: MIT OR Apache-2.0. */
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

void uart_start(void)
{
    /* In 64ths of the clock divided by 16. */
    uint32_t divisor = (UART_HZ * 4u + BAUD / 2u) / BAUD;

    CONTROL = 0;
    DIVISOR = divisor / 64;
    FRACTION = divisor % 64;
    LINE = FIFOS | EIGHT_BITS;
    CONTROL = ENABLE | TX_ENABLE | RX_ENABLE;
}

int16_t uart_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    int16_t count = 0;

    (void)context;
    while (count < capacity && !(FLAGS & RX_EMPTY))
        bytes[count++] = (uint8_t)DATA;
    return count;
}

int16_t uart_write(void *context, const uint8_t *bytes, uint16_t length)
{
    int16_t count = 0;

    (void)context;
    while (count < length && !(FLAGS & TX_FULL))
        DATA = bytes[count++];
    return count;
}

uint8_t uart_flush(void *context)
{
    (void)context;
    return !(FLAGS & BUSY);
}
