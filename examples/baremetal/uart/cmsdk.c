/* The UART of Arm's Cortex-M system design kit, as on the MPS2 boards.
 * Licence: MIT OR Apache-2.0. */
#include "board.h"
#include "machine.h"

#define DATA REGISTER(UART_BASE + 0x00)
#define STATE REGISTER(UART_BASE + 0x04)
#define CONTROL REGISTER(UART_BASE + 0x08)
#define DIVISOR REGISTER(UART_BASE + 0x10)

enum { TX_FULL = 1 << 0, RX_FULL = 1 << 1 };
enum { TX_ENABLE = 1 << 0, RX_ENABLE = 1 << 1 };

void uart_start(void)
{
    DIVISOR = UART_HZ / BAUD;
    CONTROL = TX_ENABLE | RX_ENABLE;
}

int16_t uart_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    int16_t count = 0;

    (void)context;
    while (count < capacity && (STATE & RX_FULL))
        bytes[count++] = (uint8_t)DATA;
    return count;
}

int16_t uart_write(void *context, const uint8_t *bytes, uint16_t length)
{
    int16_t count = 0;

    (void)context;
    while (count < length && !(STATE & TX_FULL))
        DATA = bytes[count++];
    return count;
}

/* The last byte may still be in the shift register, which this UART does not show. With an
 * RS-485 driver, mbm_master_setPostFlushHold adds the time of that byte. */
uint8_t uart_flush(void *context)
{
    (void)context;
    return !(STATE & TX_FULL);
}
