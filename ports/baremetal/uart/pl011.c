/* Arm's PL011: Stellaris, RP2040 and others.
 * Licence: MIT OR Apache-2.0. */
#include "pl011.h"

void uart_start(void)
{
    pl011_set_line();
    CONTROL = ENABLE | TX_ENABLE | RX_ENABLE;
}

#define HAS_BYTE ((FLAGS & RX_EMPTY) == 0u)
#define CAN_SEND ((FLAGS & TX_FULL) == 0u)
#include "polled.h"

uint8_t uart_flush(void *context)
{
    (void)context;
    return (FLAGS & BUSY) == 0u;
}
