/* A clock made from a counter of any rate. Dividing the count would make the clock wrap too
 * early, so the microseconds that have passed are added up. This needs no interrupt, but
 * the clock must be read at least once in each turn of the counter, or that turn is lost.
 * mbm reads the clock all the time while a request is pending; between requests a lost
 * turn does no harm.
 * Licence: MIT OR Apache-2.0. */
#include "board.h"
#include "machine.h"

static uint32_t seen, micros;

void clock_start(void)
{
    counter_start();
    seen = counter_read();
}

uint32_t clock_micros(void *context)
{
    uint32_t passed = (counter_read() - seen) / TICKS_PER_MICRO;

    (void)context;
    micros += passed;
    seen += passed * TICKS_PER_MICRO;
    return micros;
}
