/* The gap that a master keeps while no baud rate is set: t3.5 of the rate of its UART. */
#include "peer.h"
#include "rows.h"
#include "timing.h"

/* The calls of the sketch, in order. */
enum { AFTER_BEGIN, OTHER_AFTER_PAUSE, OTHER_AT_ONCE, SAME_AFTER_PAUSE, CALLS };

/* 1750 us; the core's clock counts in steps of 4 us. */
enum { GAP = 1750 * MHZ, CLOCK_STEP = 4 * MHZ };

typedef struct turns {
    wire *bus;
    uint64_t called, silent_from;
    uint64_t waited[CALLS];  /* from the call to the first byte of its request */
    uint64_t silence[CALLS]; /* the silence on the line before it */
} turns;

static void is_called(void *context, int level, uint64_t cycle)
{
    turns *t = context;

    if (level)
        t->called = cycle;
}

static void is_asked(wire *w, const uint8_t *frame, size_t length)
{
    turns *t = w->context;
    unsigned call = w->frames - 1;

    if (call >= CALLS)
        give_up("TimeFirst sends more requests than it makes calls");
    t->waited[call] = w->first_started - t->called;
    t->silence[call] = w->first_started - w->received;
    peer_right(w, frame, length);
}

static void row_of(const char *what, uint64_t cycles, unsigned long limit)
{
    row(what, "cycles", (unsigned long)cycles, (unsigned long)cycles, limit);
}

void time_default_gap(void)
{
    turns t = {0};
    board *b = timed_board("uno", "TimeFirst");

    t.bus = board_uart(b, '0', is_asked, &t);
    board_watch_pin(b, 'B', 0, is_called, &t);
    if (!board_run(b, 300 * MS))
        give_up("a sketch crashed");
    if (t.bus->frames != CALLS)
        give_up("TimeFirst has not sent its requests");
    if (t.silence[OTHER_AT_ONCE] < GAP - CLOCK_STEP)
        give_up("another object's request does not keep the gap");
    row_of(
        "no baud rate set: the first request after begin on a line that was silent for 50 ms, from the call to its first byte",
        t.waited[AFTER_BEGIN], 3463);
    row_of(
        "no baud rate set: another object's request after 50 ms of silence, from the call to its "
        "first byte",
        t.waited[OTHER_AFTER_PAUSE], 3463);
    row_of(
        "no baud rate set: the same object's request after 50 ms of silence, from the call to its "
        "first byte",
        t.waited[SAME_AFTER_PAUSE], 3463);
    row_of(
        "no baud rate set: another object's request at once, dead time with the gap of 28000 cycles",
        t.silence[OTHER_AT_ONCE], GAP + GAP / 20);
    board_free(b);
}
