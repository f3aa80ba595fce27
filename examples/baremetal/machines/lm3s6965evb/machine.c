/* Clocks and pins of the LM3S6965. Licence: MIT OR Apache-2.0. */
#include "machine.h"
#include "board.h"

#define SYSTEM 0x400FE000u
#define RAW_INTERRUPTS REGISTER(SYSTEM + 0x050)
#define RUN_CLOCKS REGISTER(SYSTEM + 0x060)
#define UART_CLOCKS REGISTER(SYSTEM + 0x104)
#define PORT_CLOCKS REGISTER(SYSTEM + 0x108)
#define PORT_A_FUNCTION REGISTER(0x40004420u)
#define PORT_A_DIGITAL REGISTER(0x4000451Cu)

enum {
    MAIN_OSCILLATOR_OFF = 1 << 0,
    SOURCES = 3 << 4,
    CRYSTALS = 0xF << 6,
    CRYSTAL_8_MHZ = 0xE << 6,
    BYPASS = 1 << 11,
    PLL_OFF = 1 << 13,
    DIVIDE = 1 << 22,
    DIVISORS = 0xF << 23,
    DIVIDE_BY_4 = 3 << 23,
    PLL_LOCKED = 1 << 6
};

void machine_start(void)
{
    uint32_t clocks = (RUN_CLOCKS & ~(uint32_t)DIVIDE) | BYPASS;

    RUN_CLOCKS = clocks;
    clocks &= ~(uint32_t)(MAIN_OSCILLATOR_OFF | SOURCES | CRYSTALS | PLL_OFF | DIVISORS);
    clocks |= CRYSTAL_8_MHZ | DIVIDE | DIVIDE_BY_4;
    RUN_CLOCKS = clocks;
    while (!(RAW_INTERRUPTS & PLL_LOCKED))
        ;
    RUN_CLOCKS = clocks & ~(uint32_t)BYPASS;

    UART_CLOCKS |= 1;
    PORT_CLOCKS |= 1;
    /* A peripheral may be accessed three cycles after its clock has started. */
    (void)PORT_CLOCKS;
    (void)PORT_CLOCKS;
    PORT_A_FUNCTION |= 3;
    PORT_A_DIGITAL |= 3;
}
