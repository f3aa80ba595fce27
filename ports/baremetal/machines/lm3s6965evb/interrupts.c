/* A sleep that ends with an interrupt of the UART or of a timer. Licence: MIT OR Apache-2.0. */
#include "board.h"
#include "machine.h"

#define RUN_CLOCKS REGISTER(0x400FE104u)
#define TIMER 0x40030000u
#define CONFIGURATION REGISTER(TIMER + 0x000u)
#define MODE REGISTER(TIMER + 0x004u)
#define CONTROL REGISTER(TIMER + 0x00Cu)
#define INTERRUPT_MASK REGISTER(TIMER + 0x018u)
#define INTERRUPT_CLEAR REGISTER(TIMER + 0x024u)
#define TICKS REGISTER(TIMER + 0x028u)
#define NVIC_ENABLE REGISTER(0xE000E100u)

#define TIMER_CLOCK (1u << 16u)
#define ONE_COUNTER 0u /* one counter of 32 bits, not two of 16 */
#define ONCE 1u
#define ENABLE 1u
#define TIME_OVER 1u
#define TIMER_INTERRUPT 19u
#define LONGEST 100000u /* microseconds; the clock's counter wraps after 335 ms */

uint32_t sleeps;
static volatile uint8_t is_over;

void sleep_start(void)
{
    RUN_CLOCKS |= TIMER_CLOCK;
    (void)RUN_CLOCKS;
    (void)RUN_CLOCKS;
    CONTROL = 0;
    CONFIGURATION = ONE_COUNTER;
    MODE = ONCE;
    INTERRUPT_MASK = TIME_OVER;
    NVIC_ENABLE = 1u << TIMER_INTERRUPT;
}

void sleep_interrupt(void)
{
    INTERRUPT_CLEAR = TIME_OVER;
    is_over = 1;
}

void sleep_at_most(uint32_t micros)
{
    if (micros == 0u) {
        return;
    }
    is_over = 0;
    TICKS = ((micros > LONGEST) ? LONGEST : micros) * (TICKS_PER_MICRO / 256u);
    CONTROL = ENABLE;
    /* An interrupt between this check and the sleep ends the sleep at once: an interrupt
     * that is held back wakes the core too. */
    __asm__ volatile("cpsid i" ::: "memory");
    if ((is_over == 0u) && (uart_has_bytes() == 0u)) {
        sleeps++;
        __asm__ volatile("dsb\n wfi" ::: "memory");
    }
    __asm__ volatile("cpsie i\n isb" ::: "memory");
    CONTROL = 0;
    /* If the time was over meanwhile, it must not wake the next sleep. */
    INTERRUPT_CLEAR = TIME_OVER;
}

void fault_handler(void);

/* The vectors after those of the core: the two enabled interrupts. All others are faults. */
#define NONE fault_handler
__attribute__((section(".vectors.machine"), used)) static void (*const vectors[])(void) = {
    NONE, NONE, NONE, NONE, NONE, uart_interrupt, NONE, NONE, NONE, NONE,
    NONE, NONE, NONE, NONE, NONE, NONE,           NONE, NONE, NONE, sleep_interrupt,
};
_Static_assert((sizeof vectors / sizeof vectors[0]) == TIMER_INTERRUPT + 1u,
               "a vector an interrupt");
