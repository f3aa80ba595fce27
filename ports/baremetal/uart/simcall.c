/* In place of a UART: the simulator's line, as its files 0 and 1. For cores that QEMU has
 * without a chip around them.
 * Licence: MIT OR Apache-2.0. */
#include "board.h"
#include "simcall.h"

void uart_start(void) {}

/* QEMU may lose bytes that arrive while a program reads others. So this reads all that have
 * arrived at once, and keeps them until they are asked for. */
int16_t uart_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    static uint8_t arrived[64];
    static int32_t count, next;
    int16_t given = 0;

    (void)context;
    if (next >= count) {
        /* -1 means that nothing has arrived. */
        count = simcall(SIMCALL_READ, 0, (int32_t)(uintptr_t)arrived, (int32_t)sizeof arrived);
        next = 0;
    }
    while ((next < count) && (given < (int16_t)capacity)) {
        bytes[given] = arrived[next];
        given++;
        next++;
    }
    return given;
}

int16_t uart_write(void *context, const uint8_t *bytes, uint16_t length)
{
    int32_t count = simcall(SIMCALL_WRITE, 1, (int32_t)(uintptr_t)bytes, length);

    (void)context;
    return count < 0 ? 0 : (int16_t)count;
}

uint8_t uart_flush(void *context)
{
    (void)context;
    return 1;
}

/* The simulator keeps no line back. */
uint16_t uart_lost(void)
{
    return 0;
}

uint16_t uart_stalled(void)
{
    return 0;
}
