/* The test of a port: its clock, an empty read, idle, a second start, an error on the line, a
 * closed connection. See mbm_porttest.h. Licence: MIT OR Apache-2.0. */
#include "mbm_porttest_parts.h"

/* A clock that returns the same time in this number of reads stands still. Even on a fast
 * processor the reads last longer than a tick of 10 ms. */
#define MOST_READS 4000000u

/* --- the clock */

/* Returns the shortest step of a clock, or 0 if it does not move. */
static uint32_t step_of(mbm_portTest *test, uint32_t (*clock)(void *context), void *context)
{
    uint32_t before = clock(context), now, reads = 0, shortest = UINT32_MAX;
    uint8_t steps = 0;

    while (steps < 8) {
        now = clock(context);
        if (now != before) {
            if (now - before < shortest)
                shortest = now - before;
            steps++;
            before = now;
            reads = 0;
        } else if (++reads == MOST_READS) {
            return 0;
        }
        /* Where the clock is that of a task, it moves only if others run. */
        mbm_portTest_yield(test);
    }
    return shortest;
}

/* Watches it for a time of the reference, or of the clock itself. Returns how far it jumped back.
 */
static uint32_t watch(mbm_portTest *test, uint32_t us)
{
    const mbm_port *port = test->port;
    uint32_t before = port->micros(port->context), now, back = 0;
    uint32_t time = mbm_portTest_now(test), later, passed = 0;

    do {
        now = port->micros(port->context);
        /* A step forth of more than half of 2^32 is one back. */
        if (before - now < UINT32_MAX / 2 && before - now > back)
            back = before - now;
        before = now;
        mbm_portTest_yield(test);
        /* In steps, since the clock may jump. */
        later = mbm_portTest_now(test);
        if (later - time < UINT32_MAX / 2)
            passed += later - time;
        time = later;
    } while (passed < us);
    return back;
}

/* Both clocks at the same time, but for a few microseconds. */
typedef struct both {
    uint32_t port, reference, within;
} both;

static both read_both(const mbm_portTest *test)
{
    const mbm_port *port = test->port;
    both best = {0, 0, UINT32_MAX};
    uint8_t tries;

    /* Other work of the processor may come between them. */
    for (tries = 0; tries < 100 && best.within >= 1000; tries++) {
        both now;

        now.reference = mbm_portTest_now(test);
        now.port = port->micros(port->context);
        now.within = mbm_portTest_since(test, now.reference);
        if (now.within < best.within)
            best = now;
    }
    return best;
}

/* Compares it with the reference for a tenth of a second. */
static void compare_rates(mbm_portTest *test)
{
    const both first = read_both(test);
    both last;
    uint32_t went, passed, margin;

    (void)watch(test, 100000);
    last = read_both(test);
    went = last.port - first.port;
    passed = last.reference - first.reference;
    /* Both may be a step late; clocks without a crystal are some percent wrong. */
    margin = passed / 10 + test->stepUs + test->exactUs + first.within + last.within;
    if (went + margin < passed || went > passed + margin)
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "`micros` counted % while % us passed: return microseconds (a tick times its length in us, "
            "a cycle counter divided by its cycles in a us).",
            went, passed);
}

void mbm_portTest_checkClock(mbm_portTest *test, uint32_t millis)
{
    const mbm_port *port = test->port;
    uint32_t back;

    test->checks++;
    test->stepUs = step_of(test, port->micros, port->context);
    if (test->reference != NULL)
        test->exactUs = step_of(test, test->reference, test->context);
    if (test->reference != NULL && test->exactUs == 0) {
        test->isOver = 1;
        SAY(test, MBM_PORT_WRONG, "`reference` always returns the same time: start its timer.");
        return;
    }
    if (test->stepUs == 0) {
        test->isOver = 1;
        SAY(test, MBM_PORT_WRONG,
            "`micros` always returns the same time: start the timer, and let its interrupt run.");
        return;
    }
    SAY_NUMBERS(test, MBM_PORT_FACT, "`micros` moves in steps of % us.", test->stepUs);
    back = watch(test, millis * 1000);
    if (back > 65000)
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "`micros` jumped back by % us: it must count up to 2^32 and wrap only there. Do not divide a "
            "counter that wraps; add up its differences.",
            back);
    else if (back > 0)
        SAY_NUMBERS(
            test, MBM_PORT_ADVICE,
            "`micros` stepped back by % us, which mbm stands up to 65 ms: a tick was read beside its "
            "interrupt. Read the tick again after the counter, and take both anew if it has changed.",
            back);
    else if (test->reference != NULL)
        compare_rates(test);
}

/* --- a read without bytes */

void mbm_portTest_checkRead(mbm_portTest *test)
{
    const mbm_port *port = test->port;
    uint32_t shortest = UINT32_MAX;
    uint8_t byte, i;

    test->checks++;
    if (!mbm_portTest_drain(test, port))
        return;
    for (i = 0; i < TRIES && shortest > NO_WAIT; i++) {
        const uint32_t began = mbm_portTest_now(test);
        uint32_t took;

        (void)port->read(port->context, &byte, 1);
        took = mbm_portTest_since(test, began);
        shortest = took < shortest ? took : shortest;
    }
    if (shortest > NO_WAIT + test->stepUs)
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "`read` waited for % us although nothing had come: return 0 at once (a timeout of 0, a "
            "socket that is non-blocking).",
            shortest);
}

/* --- idle */

/* Milliseconds: a response timeout in which each sleep is short, and one in which a sleep is long.
 */
enum { SHORT = 4, LONG = 400 };

/* The most by which a sleep may be longer than it should, in microseconds, and the longest time
 * that a byte may lie while `idle` sleeps. */
enum { OVERSLEEP = 2000, LIES = 100000 };

/* The requests of the node leave nothing on the line, so that no byte ends a sleep. */
static int16_t swallow(void *context, const uint8_t *bytes, uint16_t length)
{
    (void)context;
    (void)bytes;
    return (int16_t)length;
}

static void begin_node(mbm_portTest *test)
{
    test->silent = *test->port;
    test->silent.write = swallow;
    test->silent.flush = NULL;
    test->silent.preTransmission = NULL;
    test->silent.postTransmission = NULL;
    mbm_line_beginRtu(&test->line, &test->silent, test->frame, 64);
    mbm_line_setGap(&test->line, SHORT * 1000u);
    mbm_line_setQuietTime(&test->line, 0);
    mbm_node_begin(&test->node, &test->line, 247, test->words, 2, test->words, 2);
    mbm_node_setBlocking(&test->node, 0);
}

/* Lets the node wait for the reply to a request. */
static uint8_t is_waiting(mbm_portTest *test)
{
    if (mbm_node_poll(&test->node) == MBM_PENDING)
        return 1;
    return mbm_node_readHoldingRegisters(&test->node, 0, 1) == MBM_PENDING;
}

/* Returns by how much sleeps are longer than pollDelay allows, at least: other work of a computer
 * makes many longer. */
static uint32_t oversleep(mbm_portTest *test)
{
    const mbm_port *port = test->port;
    const uint32_t began = mbm_portTest_now(test);
    uint32_t least = UINT32_MAX;
    uint8_t sleeps = 0;

    mbm_node_setResponseTimeout(&test->node, SHORT);
    while (sleeps < TRIES && least > OVERSLEEP && mbm_portTest_since(test, began) < 5000000u &&
           is_waiting(test)) {
        const uint32_t may = mbm_node_pollDelay(&test->node), before = mbm_portTest_now(test);
        uint32_t took;

        mbm_portTest_yield(test);
        if (may == 0 || may > SHORT * 1000u)
            continue;
        port->idle(port->context, &test->node);
        took = mbm_portTest_since(test, before);
        took = took > may ? took - may : 0;
        least = took < least ? took : least;
        sleeps++;
    }
    mbm_node_cancel(&test->node);
    return sleeps > 0 ? least : 0;
}

/* Sends a byte while `idle` may sleep for long, and returns how long the byte lay there. */
static uint32_t time_of_a_byte(mbm_portTest *test)
{
    const mbm_port *port = test->port, *from = test->other != NULL ? test->other : port;
    uint32_t began = mbm_portTest_now(test);
    uint8_t byte = 0x55;

    mbm_node_setResponseTimeout(&test->node, LONG);
    while (mbm_portTest_since(test, began) < 2000000u && is_waiting(test) &&
           mbm_node_pollDelay(&test->node) < LONG * 700u)
        mbm_portTest_yield(test);
    if (!mbm_portTest_drain(test, port))
        return 0;
    began = mbm_portTest_now(test);
    while (from->write(from->context, &byte, 1) == 0 && mbm_portTest_since(test, began) < 1000000u)
        mbm_portTest_yield(test);
    began = mbm_portTest_now(test);
    do
        port->idle(port->context, &test->node);
    while (port->read(port->context, &byte, 1) <= 0 && mbm_portTest_since(test, began) < 1000000u);
    began = mbm_portTest_since(test, began);
    mbm_node_cancel(&test->node);
    return began;
}

/* The shortest of some tries, as above. */
static void check_wakeup(mbm_portTest *test, uint32_t away)
{
    const uint32_t may = LIES + mbm_portTest_characters(test, 2) + away,
                   began = mbm_portTest_now(test);
    uint32_t us = may + 1;
    uint8_t tries;

    for (tries = 0; us > may && !test->isOver && mbm_portTest_tries_again(test, began, tries);
         tries++)
        us = time_of_a_byte(test);
    if (us > may && !test->isOver)
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "`idle` slept for % us while a byte lay there: let the receive interrupt end the sleep, or "
            "sleep for one tick at most.",
            us);
}

void mbm_portTest_checkIdle(mbm_portTest *test)
{
    uint32_t us, away;

    if (test->port->idle == NULL) {
        SAY(test, MBM_PORT_FACT,
            "The port has no `idle`: blocking calls poll without a pause. That is right where nothing else has to run.");
        return;
    }
    test->checks++;
    begin_node(test);
    us = oversleep(test);
    away = mbm_portTest_away(test);
    if (us > OVERSLEEP + test->stepUs && us <= OVERSLEEP + test->stepUs + away)
        SAY_NUMBERS(
            test, MBM_PORT_LEFT_OUT,
            "Whether `idle` sleeps too long was not measured: other tasks take the processor for % us at a time.",
            away);
    else if (us > OVERSLEEP + test->stepUs)
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "`idle` slept at least % us longer than mbm_node_pollDelay allowed: round ticks down, and do "
            "not sleep for less than one.",
            us);
    if (mbm_portTest_has_wire(test))
        check_wakeup(test, away);
}

/* --- a second start, an error on the line, and the end of a connection */

void mbm_portTest_checkBegin(mbm_portTest *test)
{
    if (!mbm_portTest_has_wire(test))
        return;
    if (test->begin == NULL) {
        SAY(test, MBM_PORT_LEFT_OUT, "The port was not begun a second time: set `begin`.");
        return;
    }
    test->checks++;
    if (test->begin(test->context) != 0) {
        SAY(test, MBM_PORT_WRONG,
            "`begin` failed the second time: stop the UART, its DMA and its interrupts before you start them, "
            "for a program that changes the rate.");
        return;
    }
    if (mbm_portTest_is_alive(test) || test->isOver)
        return;
    test->isOver = 1;
    SAY(test, MBM_PORT_WRONG,
        "After a second `begin` bytes do not arrive as they were sent: empty the ring, clear pending flags, and "
        "start reception again.");
}

void mbm_portTest_checkDisturbed(mbm_portTest *test)
{
    const mbm_port *port = test->port;
    uint8_t byte, i;
    uint32_t began;

    if (!mbm_portTest_has_wire(test))
        return;
    if (test->disturb == NULL) {
        SAY(test, MBM_PORT_LEFT_OUT,
            "No error on the line was tried: set `disturb` to a function that makes one, such as a break, if the line "
            "can have one.");
        return;
    }
    test->checks++;
    test->disturb(test->context);
    began = mbm_portTest_now(test);
    for (i = 0; i < 255 && mbm_portTest_since(test, began) < 50000; i++) {
        if (port->read(port->context, &byte, 1) < 0) {
            SAY(test, MBM_PORT_WRONG,
                "`read` was negative after an error on the line: that means that the link is lost. Clear the error and "
                "return the bytes that have come, or 0.");
            return;
        }
        mbm_portTest_yield(test);
    }
    if (mbm_portTest_is_alive(test) || test->isOver)
        return;
    test->isOver = 1;
    SAY(test, MBM_PORT_WRONG,
        "After an error on the line bytes do not arrive as they were sent: clear the flags of framing, noise, "
        "parity and overrun, and start reception again in the error callback.");
}

/* Reads what was left. Returns whether the end of the connection shows within a second. */
static uint8_t shows_the_end(mbm_portTest *test)
{
    const mbm_port *port = test->port;
    const uint32_t began = mbm_portTest_now(test);
    uint8_t byte;

    while (port->read(port->context, &byte, 1) >= 0) {
        if (mbm_portTest_since(test, began) > 1000000u)
            return 0;
        mbm_portTest_yield(test);
    }
    return 1;
}

void mbm_portTest_checkHangUp(mbm_portTest *test)
{
    if (!mbm_portTest_has_wire(test))
        return;
    if (test->hangUp == NULL) {
        if (test->baud == 0)
            SAY(test, MBM_PORT_LEFT_OUT,
                "No connection was closed: set `hangUp` to a function that closes one at its far end, if the line is "
                "a connection.");
        return;
    }
    test->checks++;
    test->hangUp(test->context);
    if (!shows_the_end(test))
        SAY(test, MBM_PORT_WRONG,
            "`read` returned 0 for a second after the far end had closed the connection, as if the device were "
            "silent. Return a negative number at the end of the stream.");
    else if (test->begin != NULL &&
             (test->begin(test->context) != 0 || (!mbm_portTest_is_alive(test) && !test->isOver)))
        SAY(test, MBM_PORT_WRONG,
            "After the far end had closed the connection, `begin` did not make one that carries bytes: close the "
            "socket, and open a new one.");
}
