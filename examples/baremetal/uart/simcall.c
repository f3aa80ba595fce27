/* In place of a UART: the simulator's line, as its files 0 and 1. For cores that QEMU has
 * without a chip around them.
 * Licence: MIT OR Apache-2.0. */
#include "board.h"
#include "simcall.h"

void uart_start(void) {}

int16_t uart_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    /* -1 means that nothing has arrived. */
    int32_t count = simcall(SIMCALL_READ, 0, (int32_t)(uintptr_t)bytes, capacity);

    (void)context;
    return count < 0 ? 0 : (int16_t)count;
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
