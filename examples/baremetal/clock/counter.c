/* A clock from a counter of any rate. The count divided would wrap too soon,
 * so what has passed is added up. No interrupt, and no race with one; but who
 * does not ask at least once a turn of the counter loses that turn. mbm asks
 * all the time while a request runs, and between requests it does no harm.
 * Licence: MIT OR Apache-2.0. */
#include "counter.h"
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
