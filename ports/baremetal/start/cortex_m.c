/* Start-up of every Cortex-M: the first vectors, and memory as C expects it. Licence: MIT
 * OR Apache-2.0. */
#include "board.h"

#include <stddef.h>

/* Symbols of the linker script. */
extern uint32_t stack_top[], data_load[], data_start[], data_end[], bss_start[], bss_end[];

void reset_handler(void);
void fault_handler(void);

/* On your own board: switch the outputs to a safe state, then reset. */
void fault_handler(void)
{
    console_print("fault\n");
    console_exit(254);
}

/* For machines whose clocks and pins are right after reset, as QEMU's mostly are. */
__attribute__((weak)) void machine_start(void) {}

void reset_handler(void)
{
    const uint32_t *from = data_load;
    uint32_t *to;

#if defined(__ARM_FP)
    /* Full access to the FPU, before the first function that may use it. */
    REGISTER(0xE000ED88u) |= 0xFu << 20u;
    __asm__ volatile("dsb\n isb" ::: "memory");
#endif
    for (to = data_start; to < data_end; to++) {
        *to = *from++;
    }
    for (to = bss_start; to < bss_end; to++) {
        *to = 0;
    }
    machine_start();
    console_exit((uint8_t)main());
}

struct vectors {
    uint32_t *stack;
    void (*handlers[15])(void);
};

/* From reset to SysTick. The handlers of a machine's interrupts are in .vectors.machine,
 * which comes after these. */
__attribute__((section(".vectors"), used)) static const struct vectors vectors = {
    stack_top,
    {
        reset_handler,
        fault_handler,
        fault_handler,
        fault_handler,
        fault_handler,
        fault_handler,
        NULL,
        NULL,
        NULL,
        NULL,
        fault_handler,
        fault_handler,
        NULL,
        fault_handler,
        fault_handler,
    },
};
