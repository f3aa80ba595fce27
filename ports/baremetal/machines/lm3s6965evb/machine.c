/* Clocks and pins of the LM3S6965. Licence: MIT OR Apache-2.0. */
#include "machine.h"
#include "board.h"

#define SYSTEM 0x400FE000u
#define RAW_INTERRUPTS REGISTER(SYSTEM + 0x050u)
#define RUN_CLOCKS REGISTER(SYSTEM + 0x060u)
#define UART_CLOCKS REGISTER(SYSTEM + 0x104u)
#define PORT_CLOCKS REGISTER(SYSTEM + 0x108u)
#define PORT_A_FUNCTION REGISTER(0x40004420u)
#define PORT_A_DIGITAL REGISTER(0x4000451Cu)

#define MAIN_OSCILLATOR_OFF ((uint32_t)1u << 0u)
#define SOURCES ((uint32_t)3u << 4u)
#define CRYSTALS ((uint32_t)0xFu << 6u)
#define CRYSTAL_8_MHZ ((uint32_t)0xEu << 6u)
#define BYPASS ((uint32_t)1u << 11u)
#define PLL_OFF ((uint32_t)1u << 13u)
#define DIVIDE ((uint32_t)1u << 22u)
#define DIVISORS ((uint32_t)0xFu << 23u)
#define DIVIDE_BY_4 ((uint32_t)3u << 23u)
#define PLL_LOCKED ((uint32_t)1u << 6u)

void machine_start(void)
{
    uint32_t clocks = (RUN_CLOCKS & ~DIVIDE) | BYPASS;

    RUN_CLOCKS = clocks;
    clocks &= ~(MAIN_OSCILLATOR_OFF | SOURCES | CRYSTALS | PLL_OFF | DIVISORS);
    clocks |= CRYSTAL_8_MHZ | DIVIDE | DIVIDE_BY_4;
    RUN_CLOCKS = clocks;
    while ((RAW_INTERRUPTS & PLL_LOCKED) == 0u) {
    }
    RUN_CLOCKS = clocks & ~BYPASS;

    UART_CLOCKS |= 1u;
    PORT_CLOCKS |= 1u;
    /* A peripheral may be accessed three cycles after its clock has started. */
    (void)PORT_CLOCKS;
    (void)PORT_CLOCKS;
    PORT_A_FUNCTION |= 3u;
    PORT_A_DIGITAL |= 3u;
}
