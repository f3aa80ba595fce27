/* The console of Xtensa's simulator. Licence: MIT OR Apache-2.0. */
#include "simcall.h"
#include "board.h"

void console_print(const char *text)
{
    static int32_t file = -1;
    int32_t length = 0;

    /* Files 0 to 2 are the serial line, so another file is opened. */
    if (file < 0) {
        file = simcall(SIMCALL_OPEN, (int32_t)(uintptr_t) "/dev/stderr", 1, 0);
    }
    while (text[length] != '\0') {
        length++;
    }
    (void)simcall(SIMCALL_WRITE, file, (int32_t)(uintptr_t)text, length);
}

_Noreturn void console_exit(uint8_t code)
{
    for (;;) {
        (void)simcall(SIMCALL_EXIT, code, 0, 0);
    }
}
