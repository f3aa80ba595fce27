/* Xtensa's cycle counter. Licence: MIT OR Apache-2.0. */
#include "board.h"

void counter_start(void) {}

uint32_t counter_read(void)
{
    uint32_t count;

    __asm__ volatile("rsr %0, ccount" : "=r"(count));
    return count;
}
