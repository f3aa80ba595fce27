/* The lower half of RISC-V's machine timer. Licence: MIT OR Apache-2.0. */
#include "board.h"
#include "machine.h"

void counter_start(void) {}

uint32_t counter_read(void)
{
    return REGISTER(MTIME);
}
