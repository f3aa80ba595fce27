/* The UART of Arm's Cortex-M system design kit, as on the MPS2 boards.
 * Licence: MIT OR Apache-2.0. */
#include "board.h"
#include "machine.h"

#define DATA REGISTER(UART_BASE + 0x00u)
#define STATE REGISTER(UART_BASE + 0x04u)
#define CONTROL REGISTER(UART_BASE + 0x08u)
#define DIVISOR REGISTER(UART_BASE + 0x10u)

#define TX_FULL (1u << 0u)
#define RX_FULL (1u << 1u)
#define TX_ENABLE (1u << 0u)
#define RX_ENABLE (1u << 1u)

void uart_start(void)
{
    DIVISOR = UART_HZ / BAUD;
    CONTROL = TX_ENABLE | RX_ENABLE;
}

#define HAS_BYTE ((STATE & RX_FULL) != 0u)
#define CAN_SEND ((STATE & TX_FULL) == 0u)
#include "polled.h"

/* The last byte may still be in the shift register, which this UART does not show. With an
 * RS-485 driver, mbm_line_setPostFlushHold adds the time of that byte. */
uint8_t uart_flush(void *context)
{
    (void)context;
    return (STATE & TX_FULL) == 0u;
}
