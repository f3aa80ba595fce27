/* The faults of a UART: counters, and an end for a transmitter that stands still. Licence: MIT OR
 * Apache-2.0. */
#ifndef FAULTS_H
#define FAULTS_H

#include "board.h"

/* In microseconds. A FIFO of 16 bytes leaves in 67 ms at 2400 baud. */
#define PATIENCE 500000u

static uint16_t overruns, stalls;
static uint32_t moved_at;
static uint8_t is_sending, has_failed;

uint16_t uart_stalled(void)
{
    return stalls;
}

/* Notes that the transmitter took bytes, or none. Returns 1 if it has taken none for too long. */
static uint8_t stands_still(uint16_t taken)
{
    uint32_t now = clock_micros(0);

    if ((taken > 0u) || (is_sending == 0u)) {
        moved_at = now;
        is_sending = 1;
        return 0;
    }
    if ((now - moved_at) < PATIENCE) {
        return 0;
    }
    is_sending = 0;
    stalls++;
    return 1;
}

/* For uart_flush: whether it has ended, the last bit having left or not. */
static uint8_t has_ended(uint8_t is_done)
{
    if (is_done != 0u) {
        is_sending = 0;
    } else if (stands_still(0) != 0u) {
        has_failed = 1;
    } else {
        return 0;
    }
    return 1;
}

/* For uart_read: returns 1 once after a failure. */
static uint8_t take_failure(void)
{
    uint8_t failed = has_failed;

    has_failed = 0;
    return failed;
}

#endif
