/* The test of a port: frames, their end, blocks, overruns. See mbm_porttest.h.
 * Licence: MIT OR Apache-2.0. */
#include "mbm_porttest_parts.h"

static uint32_t least(uint32_t one, uint32_t other)
{
    return one < other ? one : other;
}

static uint32_t most(uint32_t one, uint32_t other)
{
    return one > other ? one : other;
}

/* --- frames that are sent */

/* Characters do not arrive before they can. */
static uint8_t is_in_time(mbm_portTest *test, const passage *bytes)
{
    const uint32_t lasts = mbm_portTest_characters(test, bytes->length);

    if (lasts == 0 || bytes->to == NULL || bytes->lastUs + lasts / 10 + test->stepUs >= lasts)
        return 1;
    SAY_NUMBERS(
        test, MBM_PORT_WRONG,
        "% characters took % us, and last % at % baud: the clock does not count microseconds, or the line has another "
        "rate.",
        bytes->length, bytes->lastUs, lasts, test->baud);
    return 0;
}

/* A frame of a few bytes is taken, leaves and arrives. Without that nothing else can be tested. */
static uint8_t can_send(mbm_portTest *test)
{
    passage few = mbm_portTest_sending(test, FEW);

    test->checks++;
    if (!mbm_portTest_pass(test, &few))
        return 0;
    if (few.taken < FEW)
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "`write` took % of % bytes and then none for a second: start the transmitter, and clear your mark of a "
            "transmission under way when it has ended.",
            few.taken, FEW);
    else if (!few.isFlushed)
        SAY(test, MBM_PORT_WRONG,
            "`flush` returned 0 for a second: it must return 1 once the last bit has left. Start the interrupt or "
            "read the flag that says so.");
    else if (mbm_portTest_have_arrived(test, &few) && is_in_time(test, &few))
        return !test->isOver;
    test->isOver = 1;
    return 0;
}

/* Returns whether the longest frame was sent. */
static uint8_t can_send_all(mbm_portTest *test, passage *all)
{
    *all = mbm_portTest_sending(test, 256);
    if (!mbm_portTest_pass(test, all))
        return 0;
    if (all->taken == 0)
        SAY(test, MBM_PORT_WRONG,
            "`write` took none of 256 bytes for a second, after a frame of 8: clear your mark of a transmission under way "
            "when it has ended, and take part of a frame that is longer than your buffer.");
    else if (all->taken < all->length || !all->isFlushed)
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "Of a frame of 256 bytes `write` took %, and then nothing left for a second: take part of the bytes, "
            "return their number, and take the others later.",
            all->taken);
    else if (mbm_portTest_have_arrived(test, all))
        return !test->isOver;
    test->isOver = 1;
    return 0;
}

void mbm_portTest_checkWrite(mbm_portTest *test)
{
    const uint32_t lasts = mbm_portTest_characters(test, 256), may_wait = lasts / 4 + 1000,
                   may_last = 2 * lasts + 50000;
    uint32_t began, longest_write = UINT32_MAX, last = UINT32_MAX;
    passage all;
    uint8_t tries = 0, is_long;

    if (!can_send(test))
        return;
    test->checks++;
    began = mbm_portTest_now(test);
    do {
        if (!can_send_all(test, &all))
            return;
        tries++;
        longest_write = least(longest_write, all.longestWriteUs);
        last = least(last, all.lastUs);
        is_long = lasts > 0 && ((longest_write > may_wait && !test->mayWait) || last > may_last);
    } while (is_long && mbm_portTest_tries_again(test, began, tries));
    if (lasts > 0 && longest_write > may_wait && !test->mayWait)
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "`write` waited for % us: hand the bytes to an interrupt, to DMA or to a transmit buffer, and return "
            "the number that was taken.",
            longest_write);
    else if (all.atOnce < 256 && !test->mayWait)
        SAY_NUMBERS(
            test, MBM_PORT_ADVICE,
            "`write` takes at most % of 256 bytes at once: a frame gets a pause if the main loop is away for longer "
            "than they last. A transmit buffer of 256 bytes prevents that.",
            all.atOnce);
    if (all.to != NULL && !is_in_time(test, &all))
        test->isOver = 1;
    else if (lasts > 0 && last > may_last)
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "256 characters took % us, and last % at % baud: the clock does not count microseconds, the line "
            "has another rate, or the frame has pauses.",
            last, lasts, test->baud);
}

/* --- the end of a frame */

/* A device may reply 3.5 characters after the last bit, and above 19200 baud 1750 us. */
static uint32_t reply_may_begin(const mbm_portTest *test)
{
    return most(mbm_portTest_characters(test, 7) / 2, 1750);
}

/* Microseconds in which flush may return 1. */
static uint32_t flush_may_take(const mbm_portTest *test)
{
    return mbm_portTest_characters(test, FEW) + reply_may_begin(test) + mbm_portTest_step(test);
}

/* Whether flush returned 0 although the last bit had left long before, or waited until long after.
 * Other tasks may delay a call that waits, so of several frames the shortest wait counts. */
static uint8_t is_flush_late(const mbm_portTest *test, const passage *few)
{
    return most(few->askedUs, few->waitedUs) > flush_may_take(test);
}

/* Whether the driver cannot have been on for the length of a frame without being seen. */
static uint8_t is_seen(const mbm_portTest *test, const passage *few)
{
    return test->port->preTransmission != NULL ||
           few->unseenUs + mbm_portTest_step(test) < mbm_portTest_characters(test, FEW - 1);
}

/* Other tasks may delay a flush that waits. A flush that returned 0 is the port's own. */
static void judge_late_flush(mbm_portTest *test, const passage *few)
{
    const uint32_t may_take = flush_may_take(test);

    if (few->askedUs <= may_take) {
        const uint32_t away = mbm_portTest_away(test);

        if (few->waitedUs <= may_take + away) {
            SAY_NUMBERS(
                test, MBM_PORT_LEFT_OUT,
                "Whether `flush` is late was not measured: other tasks take the processor for % us at a time.",
                away);
            return;
        }
    }
    SAY_NUMBERS(
        test, MBM_PORT_WRONG,
        "`flush` returned 1 % us after the last bit: a device may reply before, and the driver is still on. Ask "
        "for transmission complete.",
        most(few->askedUs, few->flushedUs) - mbm_portTest_characters(test, FEW));
}

static void judge_flush(mbm_portTest *test, const passage *few)
{
    const uint32_t shortest = few->flushedUs;
    const uint32_t lasts = mbm_portTest_characters(test, FEW),
                   half = mbm_portTest_characters(test, 1) / 2;

    if (mbm_portTest_step(test) > half) {
        SAY_NUMBERS(
            test, MBM_PORT_LEFT_OUT,
            "Whether `flush` is exact was not measured: half a character lasts % us, and the clock moves in steps of "
            "%. Set `reference`, or test at a lower rate.",
            half, mbm_portTest_step(test));
        return;
    }
    test->checks++;
    if (shortest + half < lasts)
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "`flush` returned 1 after % us, and % characters last %: it must wait for the last bit. Ask for "
            "transmission complete, not for an empty register, FIFO or DMA.",
            shortest, FEW, lasts);
    else if (is_flush_late(test, few))
        judge_late_flush(test, few);
}

static void judge_driver(mbm_portTest *test, const passage *few)
{
    test->checks++;
    if (few->wasOn && !few->wentOn)
        SAY(test, MBM_PORT_WRONG,
            "The driver is off during a frame and on otherwise: turn the level of its pin round.");
    else if (test->startsOn)
        SAY(test, MBM_PORT_WRONG,
            "The driver is on before the first frame: switch its pin off when the port begins.");
    else if (!few->wentOn && !is_seen(test, few))
        SAY(test, MBM_PORT_LEFT_OUT,
            "Whether the driver goes on was not seen: nobody looked at its pin while the bytes left.");
    else if (!few->wentOn)
        SAY(test, MBM_PORT_WRONG,
            "The driver did not go on for a frame: make its pin an output, look at its number and its level, and at "
            "`preTransmission`.");
    else if (few->wentOff)
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "The driver went off after % us, before the last bit: switch it in the interrupt of transmission "
            "complete, or in `postTransmission`.",
            few->offUs);
    else if (few->staysOn)
        SAY(test, MBM_PORT_WRONG,
            "The driver is still on after a frame: switch its pin off in `postTransmission`, or in the interrupt of "
            "transmission complete.");
}

/* The shorter times of two frames, and whatever was seen of the driver. */
static passage joined(const passage *one, const passage *other)
{
    passage sum = *other;

    sum.flushedUs = least(one->flushedUs, other->flushedUs);
    sum.switchedUs = least(one->switchedUs, other->switchedUs);
    sum.waitedUs = least(one->waitedUs, other->waitedUs);
    sum.askedUs = most(one->askedUs, other->askedUs);
    sum.unseenUs = least(one->unseenUs, other->unseenUs);
    sum.wentOn |= one->wentOn;
    sum.staysOn |= one->staysOn;
    if (one->wentOff) {
        sum.wentOff = 1;
        sum.offUs = one->offUs;
    }
    return sum;
}

/* Whether another frame may show that the port is right. */
static uint8_t is_unclear(const mbm_portTest *test, const passage *few)
{
    return (test->baud != 0 && test->port->flush != NULL && is_flush_late(test, few)) ||
           few->switchedUs > NO_WAIT + test->stepUs ||
           (test->driver != NULL && !few->wentOn && !is_seen(test, few));
}

void mbm_portTest_checkFlush(mbm_portTest *test)
{
    const mbm_port *port = test->port;
    const uint32_t began = mbm_portTest_now(test);
    passage few = {0};
    uint8_t tries;

    for (tries = 0;
         tries < 3 || (is_unclear(test, &few) && mbm_portTest_tries_again(test, began, tries));
         tries++) {
        passage again = mbm_portTest_sending(test, FEW);

        if (!mbm_portTest_pass(test, &again))
            return;
        few = tries == 0 ? again : joined(&few, &again);
    }
    if (port->flush == NULL && port->postTransmission != NULL && !test->mayWait)
        SAY(test, MBM_PORT_WRONG,
            "The port switches a driver and has no `flush`: the driver goes off before the bytes have left. Set "
            "`flush` to a function that returns 1 after the last bit.");
    else if (port->flush == NULL && test->baud == 0)
        SAY(test, MBM_PORT_LEFT_OUT,
            "Whether `flush` is missing was not judged: a socket or USB needs none. Set `baud`, if the line has a "
            "rate.");
    else if (port->flush == NULL)
        SAY(test, MBM_PORT_ADVICE,
            "The port has no `flush`: a response timeout gets the time of the request's characters on top.");
    else if (test->baud == 0)
        SAY(test, MBM_PORT_LEFT_OUT,
            "Whether `flush` is exact was not measured: set `baud`, if the line has a rate.");
    else
        judge_flush(test, &few);
    if (few.switchedUs > NO_WAIT + test->stepUs)
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "`preTransmission` or `postTransmission` waited for % us: switch the pin and return; flush and "
            "mbm_line_setPostFlushHold wait for the last bit.",
            few.switchedUs);
    if (test->driver != NULL)
        judge_driver(test, &few);
    else
        SAY(test, MBM_PORT_LEFT_OUT,
            "The pin of a driver was not looked at: set `driver`, if there is one.");
}

/* --- blocks */

/* How late a passage ended, and by how much a pause was longer than the bytes that came after it.
 */
static uint32_t lateness(const mbm_portTest *test, const passage *bytes)
{
    const uint32_t lasts = mbm_portTest_characters(test, bytes->length);
    const uint32_t block = mbm_portTest_characters(test, (uint16_t)(bytes->longestBlock + 1u));
    const uint32_t end = bytes->lastUs > lasts ? bytes->lastUs - lasts : 0,
                   pause = bytes->longestPauseUs > block ? bytes->longestPauseUs - block : 0;

    return most(end, pause);
}

/* Says how late bytes come, and which setting suits that. `yields` is for how long the test itself
 * was away at a time. */
static void advise(mbm_portTest *test, uint32_t late, uint32_t yields)
{
    const uint16_t block = test->longestBlock;

    if (test->baud == 0)
        SAY_NUMBERS(test, MBM_PORT_FACT, "Bytes arrive in blocks of up to %.", block);
    else if (late <= reply_may_begin(test) + mbm_portTest_step(test) + yields)
        SAY_NUMBERS(
            test, MBM_PORT_FACT,
            "Bytes arrive in blocks of up to %, at most % us late: no setting of mbm needs a change.",
            block, late);
    else if (late <= 50000)
        SAY_NUMBERS(
            test, MBM_PORT_ADVICE,
            "Bytes arrive in blocks of up to %, up to % us late: give response timeouts % ms more, or hand bytes over "
            "sooner (a FIFO threshold of 1, the idle line). The receive latency of a server is enough.",
            block, late, late / 1000 + 1);
    else
        SAY_NUMBERS(
            test, MBM_PORT_ADVICE,
            "Bytes arrive in blocks of up to %, up to % us late: call mbm_server_setReceiveLatency with %, and give "
            "response timeouts % ms more.",
            block, late, late / 1000 + late / 4000 + 1, late / 1000 + 1);
}

/* The main loop is away while a frame arrives. */
static void check_away(mbm_portTest *test)
{
    const uint16_t promised = test->holds == 0 || test->holds > 256 ? 256 : test->holds;
    passage away = mbm_portTest_receiving(test, promised);
    uint32_t lasts;

    away.isAway = 1;
    test->checks++;
    if (!mbm_portTest_pass(test, &away) || (away.right == promised && away.arrived == promised))
        return;
    lasts = mbm_portTest_characters(test, away.right);
    if (test->holds > 0)
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "While the main loop was away, % of % bytes were held: `holds` is too high, or bytes are lost before "
            "the ring.",
            away.right, promised);
    else if (lasts > 0)
        SAY_NUMBERS(
            test, MBM_PORT_ADVICE,
            "While the main loop is away the receiver holds % of 256 bytes: poll at least every % us, or let an "
            "interrupt or DMA fill a ring of 257 bytes.",
            away.right, lasts);
    else
        SAY_NUMBERS(
            test, MBM_PORT_ADVICE,
            "While the main loop is away the receiver holds % of 256 bytes: let an interrupt or DMA fill a ring of "
            "257 bytes.",
            away.right);
}

/* Frames of several lengths, since a block may end with any byte. Returns whether they arrived. */
static uint8_t check_blocks(mbm_portTest *test)
{
    static const uint8_t lengths[] = {FEW, 3, 29, 17};
    passage all = mbm_portTest_receiving(test, 256);
    uint32_t late = 0, yields = 0;
    uint8_t i;

    test->checks++;
    for (i = 0; i < sizeof lengths; i++) {
        passage few = mbm_portTest_receiving(test, lengths[i]);

        if (!mbm_portTest_pass(test, &few) || !mbm_portTest_have_arrived(test, &few))
            return 0;
        late = most(late, lateness(test, &few));
        yields = most(yields, few.yieldUs);
    }
    if (!mbm_portTest_pass(test, &all) || !mbm_portTest_have_arrived(test, &all))
        return 0;
    test->longestBlock = all.longestBlock;
    test->longestPauseUs = all.longestPauseUs;
    advise(test, most(late, lateness(test, &all)), most(yields, all.yieldUs));
    return 1;
}

/* --- more bytes than the receiver holds */

static void check_overrun(mbm_portTest *test)
{
    const uint16_t promised = test->holds == 0 ? 256 : test->holds;
    passage flood = mbm_portTest_receiving(test, (uint16_t)(promised + 300u));
    uint32_t before = 0, counted, gone;

    flood.isAway = 1;
    test->checks++;
    if (test->lost != NULL)
        before = test->lost(test->context);
    if (!mbm_portTest_pass(test, &flood))
        return;
    if (!mbm_portTest_is_alive(test)) {
        if (test->isOver)
            return;
        test->isOver = 1;
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "After an overrun of % bytes later ones do not arrive as they were sent: clear the overrun flag of "
            "the UART, and start reception again.",
            flood.length);
        return;
    }
    gone = (uint32_t)flood.taken - flood.arrived;
    if (gone == 0)
        SAY_NUMBERS(test, MBM_PORT_FACT,
                    "% bytes at once were all held, or the line held the sender back.",
                    flood.taken);
    else if (test->lost == NULL)
        SAY_NUMBERS(
            test, MBM_PORT_ADVICE,
            "% of % bytes were lost, and no counter said so: count them (mbm_ring_lost does), and set `lost`.",
            gone, flood.taken);
    else if ((counted = test->lost(test->context) - before) == 0)
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "% of % bytes were lost, and `lost` did not count them: count an overrun of the UART and a full ring.",
            gone, flood.taken);
    else
        SAY_NUMBERS(test, MBM_PORT_FACT, "% of % bytes were lost, and `lost` counted %.", gone,
                    flood.taken, counted);
}

void mbm_portTest_checkWire(mbm_portTest *test)
{
    if (!mbm_portTest_has_wire(test)) {
        SAY(test, MBM_PORT_LEFT_OUT,
            "Nothing was received: lead a wire from TX to RX and set `isLooped`, or set `other`, a second port "
            "on the line.");
        return;
    }
    if (!check_blocks(test)) {
        test->isOver = 1;
        return;
    }
    check_away(test);
    if (!test->isOver)
        check_overrun(test);
}
