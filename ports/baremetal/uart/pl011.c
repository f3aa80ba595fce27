/* Arm's PL011: Stellaris, RP2040 and others.
 * Licence: MIT OR Apache-2.0. */
#include "pl011.h"

void uart_start(void)
{
    pl011_set_line();
    CONTROL = ENABLE | TX_ENABLE | RX_ENABLE;
}

static uint8_t take_byte(uint8_t *byte)
{
    if ((FLAGS & RX_EMPTY) != 0u) {
        return 0;
    }
    *byte = pl011_take();
    return 1;
}

#define CAN_SEND ((FLAGS & TX_FULL) == 0u)
#define IS_DONE ((FLAGS & BUSY) == 0u)
#include "polled.h"
