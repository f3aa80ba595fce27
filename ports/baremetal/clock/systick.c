/* Cortex-M's SysTick: 24 bits, counting down. It wraps after 0.1 s at 168 MHz. Licence: MIT
 * OR Apache-2.0. */
#include "board.h"

#define CONTROL REGISTER(0xE000E010u)
#define RELOAD REGISTER(0xE000E014u)
#define VALUE REGISTER(0xE000E018u)

#define ENABLE 1u
#define CPU_CLOCK 4u
#define LAST 0xFFFFFFu

void counter_start(void)
{
    RELOAD = LAST;
    VALUE = 0;
    CONTROL = ENABLE | CPU_CLOCK;
}

/* In 256ths of a cycle, so that the 24 bits wrap at 2^32. */
uint32_t counter_read(void)
{
    return (LAST - VALUE) << 8u;
}
