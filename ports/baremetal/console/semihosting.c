/* Arm's semihosting, which RISC-V uses too. Licence: MIT OR Apache-2.0. */
#include "board.h"

enum { PRINT = 0x04, EXIT = 0x20, APPLICATION_EXIT = 0x20026 };

static void call(uint32_t number, const void *parameter)
{
#if defined(__arm__)
    register uint32_t r0 __asm__("r0") = number;
    register const void *r1 __asm__("r1") = parameter;

    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
#elif defined(__riscv)
    register uint32_t a0 __asm__("a0") = number;
    register const void *a1 __asm__("a1") = parameter;

    /* The two shifts mark the break as a semihosting call. All three instructions must have
     * four bytes and lie in one page. */
    __asm__ volatile(".option push\n"
                     ".option norvc\n"
                     ".balign 16\n"
                     "slli zero, zero, 0x1f\n"
                     "ebreak\n"
                     "srai zero, zero, 7\n"
                     ".option pop"
                     : "+r"(a0)
                     : "r"(a1)
                     : "memory");
#else
#error "semihosting is known for Arm and RISC-V"
#endif
}

void console_print(const char *text)
{
    call(PRINT, text);
}

_Noreturn void console_exit(uint8_t code)
{
    const uint32_t reason[] = {APPLICATION_EXIT, code};

    for (;;) {
        call(EXIT, reason);
    }
}
