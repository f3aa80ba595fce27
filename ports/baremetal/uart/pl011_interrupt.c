/* Arm's PL011 with interrupts: the handler puts received bytes into a ring, and the main
 * loop reads them from there. The FIFO holds the bytes until the handler runs. Licence: MIT
 * OR Apache-2.0. */
#include "mbm.h"
#include "pl011.h"
#include "board.h"

#define FIFO_LEVELS REGISTER(UART_BASE + 0x34u)
#define INTERRUPT_MASK REGISTER(UART_BASE + 0x38u)
#define INTERRUPT_CLEAR REGISTER(UART_BASE + 0x44u)
#define NVIC_ENABLE REGISTER(0xE000E100u)

/* An interrupt after two bytes of sixteen, or if one byte has been alone for the time of 32
 * bits. */
#define AN_EIGHTH 0u
#define RX (1u << 4u)
#define RX_ALONE (1u << 6u)

/* Holds the longest frame: that is how far the handler may be ahead of the main loop. */
static uint8_t received[MBM_MAX_FRAME + 1];
static mbm_ring ring = MBM_INIT;

static void start_line(void)
{
    pl011_set_line();
    FIFO_LEVELS = AN_EIGHTH;
    INTERRUPT_MASK = RX | RX_ALONE;
    NVIC_ENABLE = 1u << UART_INTERRUPT;
    CONTROL = ENABLE | TX_ENABLE | RX_ENABLE;
}

void uart_start(void)
{
    (void)mbm_ring_begin(&ring, received, sizeof received);
    start_line();
}

void uart_interrupt(void)
{
    INTERRUPT_CLEAR = RX | RX_ALONE;
    while ((FLAGS & RX_EMPTY) == 0u) {
        (void)mbm_ring_put(&ring, pl011_take());
    }
}

int16_t uart_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    (void)context;
    if (take_failure() != 0u) {
        return -1;
    }
    return (int16_t)mbm_ring_read(&ring, bytes, capacity);
}

uint8_t uart_has_bytes(void)
{
    return mbm_ring_available(&ring) > 0u;
}

uint16_t uart_lost(void)
{
    return (uint16_t)(mbm_ring_lost(&ring) + overruns);
}

int16_t uart_write(void *context, const uint8_t *bytes, uint16_t length)
{
    uint16_t count = 0;

    (void)context;
    while ((count < length) && ((FLAGS & TX_FULL) == 0u)) {
        DATA = bytes[count];
        count++;
    }
    return written(count, start_line);
}

uint8_t uart_flush(void *context)
{
    (void)context;
    return flushed((FLAGS & BUSY) == 0u, start_line);
}
