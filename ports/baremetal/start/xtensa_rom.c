/* Functions that the ESP8266 has in its ROM and the simulated core has not: division, for
 * which the core has no instruction, and abort, where impossible branches end. Licence: MIT
 * OR Apache-2.0. */
#include "board.h"

unsigned __udivsi3(unsigned dividend, unsigned divisor);
unsigned __umodsi3(unsigned dividend, unsigned divisor);
_Noreturn void abort(void);

unsigned __udivsi3(unsigned dividend, unsigned divisor)
{
    unsigned quotient = 0, rest = 0, bit;

    for (bit = 0x80000000u; bit != 0u; bit >>= 1) {
        rest = (rest << 1) | (((dividend & bit) != 0u) ? 1u : 0u);
        if (rest >= divisor) {
            rest -= divisor;
            quotient |= bit;
        }
    }
    return quotient;
}

unsigned __umodsi3(unsigned dividend, unsigned divisor)
{
    return dividend - __udivsi3(dividend, divisor) * divisor;
}

void abort(void)
{
    console_print("abort\n");
    console_exit(253);
}
