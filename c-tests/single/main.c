/* Runs the program, and says on the console how it went. Licence: MIT OR Apache-2.0. */
#include "wire.h"

#if defined(__AVR__)
#include <avr/interrupt.h>
#include <avr/sleep.h>

static void console_print(const char *text)
{
    UCSR0B = 1 << TXEN0;
    for (; *text; text++) {
        while (!(UCSR0A & 1 << UDRE0)) {
        }
        UDR0 = (uint8_t)*text;
    }
}

/* simavr ends when the chip sleeps and nothing can wake it. */
static void leave(void)
{
    cli();
    sleep_mode();
}
#else
#include "board.h"

static void leave(void) {}
#endif

int main(void)
{
    static char text[] = "step 0 is wrong\n";
    const uint8_t wrong = run();

    text[5] = (char)('0' + wrong);
    console_print(wrong ? text : "all steps are right\n");
    leave();
    return wrong;
}
