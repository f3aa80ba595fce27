/* The UART of Arm's Cortex-M system design kit, as on the MPS2 boards.
 * Licence: MIT OR Apache-2.0. */
#include "board.h"
#include "faults.h"
#include "machine.h"

#define DATA REGISTER(UART_BASE + 0x00u)
#define STATE REGISTER(UART_BASE + 0x04u)
#define CONTROL REGISTER(UART_BASE + 0x08u)
#define DIVISOR REGISTER(UART_BASE + 0x10u)

#define TX_FULL (1u << 0u)
#define RX_FULL (1u << 1u)
#define RX_OVERRUN (1u << 3u)
#define TX_ENABLE (1u << 0u)
#define RX_ENABLE (1u << 1u)

void uart_start(void)
{
    DIVISOR = UART_HZ / BAUD;
    CONTROL = TX_ENABLE | RX_ENABLE;
}

static uint8_t take_byte(uint8_t *byte)
{
    if ((STATE & RX_OVERRUN) != 0u) {
        /* A one clears it. */
        STATE = RX_OVERRUN;
        overruns++;
    }
    if ((STATE & RX_FULL) == 0u) {
        return 0;
    }
    *byte = (uint8_t)DATA;
    return 1;
}

#define CAN_SEND ((STATE & TX_FULL) == 0u)
/* The last byte may still be in the shift register, which this UART does not show. With an
 * RS-485 driver, mbm_line_setPostFlushHold adds the time of that byte. */
#define IS_DONE CAN_SEND
#include "polled.h"
