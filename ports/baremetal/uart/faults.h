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

/* Notes that the transmitter took bytes, or none. If it has taken none for too long, starts the
 * UART again with `start` and returns 1. */
static uint8_t gave_up(uint16_t taken, void (*start)(void))
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
    start();
    return 1;
}

/* What uart_write returns. */
static int16_t written(uint16_t count, void (*start)(void))
{
    return gave_up(count, start) != 0u ? (int16_t)-1 : (int16_t)count;
}

/* What uart_flush returns: 1 if the last bit has left, or was given up. */
static uint8_t flushed(uint8_t is_done, void (*start)(void))
{
    if (is_done != 0u) {
        is_sending = 0;
    } else if (gave_up(0, start) != 0u) {
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
