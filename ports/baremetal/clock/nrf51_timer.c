/* TIMER0 of the nRF51 at 1 MHz, 32 bits: the chip's Cortex-M0 has no SysTick. Licence: MIT
 * OR Apache-2.0. */
#include "board.h"

#define TIMER0 0x40008000u
#define START REGISTER(TIMER0 + 0x000u)
#define CAPTURE REGISTER(TIMER0 + 0x040u)
#define BIT_MODE REGISTER(TIMER0 + 0x508u)
#define PRESCALER REGISTER(TIMER0 + 0x510u)
#define CAPTURED REGISTER(TIMER0 + 0x540u)

#define BITS_32 3u
#define DIVIDE_BY_16 4u

void counter_start(void)
{
    BIT_MODE = BITS_32;
    PRESCALER = DIVIDE_BY_16;
    START = 1;
}

uint32_t counter_read(void)
{
    CAPTURE = 1;
    return CAPTURED;
}
