/* The test of a port: the end of a frame, blocks, overruns. See mbm_porttest.h.
 * Licence: MIT OR Apache-2.0. */
#include "mbm_porttest_parts.h"

/* --- the end of a frame */

/* A device may reply 3.5 characters after the last bit, and above 19200 baud 1750 us. */
static uint32_t reply_may_begin(const mbm_portTest *test)
{
    const uint32_t us = mbm_portTest_characters(test, 7) / 2;

    return us > 1750 ? us : 1750;
}

static void judge_flush(mbm_portTest *test, uint32_t shortest)
{
    const uint32_t lasts = mbm_portTest_characters(test, FEW),
                   half = mbm_portTest_characters(test, 1) / 2;

    if (test->reference == NULL && test->stepUs > half) {
        SAY_NUMBERS(
            test, MBM_PORT_LEFT_OUT,
            "Whether `flush` is exact was not measured: half a character lasts % us, and the clock moves in steps of "
            "%. Set `reference`, or test at a lower rate.",
            half, test->stepUs);
        return;
    }
    test->checks++;
    if (shortest + half < lasts)
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "`flush` returned 1 after % us, and % characters last %: it must wait for the last bit. Ask for "
            "transmission complete, not for an empty register, FIFO or DMA.",
            shortest, FEW, lasts);
    else if (shortest > lasts + reply_may_begin(test) + test->yieldUs)
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "`flush` returned 1 % us after the last bit: a device may reply before, and the driver is still on. Ask "
            "for transmission complete.",
            shortest - lasts);
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

void mbm_portTest_checkFlush(mbm_portTest *test)
{
    const mbm_port *port = test->port;
    uint32_t shortest = UINT32_MAX, switched = UINT32_MAX;
    passage few = {0};
    uint8_t i;

    for (i = 0; i < 3; i++) {
        few = mbm_portTest_sending(test, FEW);
        if (!mbm_portTest_pass(test, &few))
            return;
        shortest = few.flushedUs < shortest ? few.flushedUs : shortest;
        switched = few.switchedUs < switched ? few.switchedUs : switched;
    }
    if (port->flush == NULL && port->postTransmission != NULL && !test->mayWait)
        SAY(test, MBM_PORT_WRONG,
            "The port switches a driver and has no `flush`: the driver goes off before the bytes have left. Set "
            "`flush` to a function that returns 1 after the last bit.");
    else if (port->flush == NULL)
        SAY(test, MBM_PORT_ADVICE,
            "The port has no `flush`: a response timeout gets the time of the request's characters on top.");
    else if (test->baud == 0)
        SAY(test, MBM_PORT_LEFT_OUT,
            "Whether `flush` is exact was not measured: set `baud`, if the line has a rate.");
    else
        judge_flush(test, shortest);
    if (switched > NO_WAIT + test->stepUs)
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "`preTransmission` or `postTransmission` waited for % us: switch the pin and return; flush and "
            "mbm_line_setPostFlushHold wait for the last bit.",
            switched);
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

    return end > pause ? end : pause;
}

/* How late bytes come, and which setting suits that. */
static void advise(mbm_portTest *test, uint32_t late)
{
    const uint16_t block = test->longestBlock;

    if (test->baud == 0)
        SAY_NUMBERS(test, MBM_PORT_FACT, "Bytes arrive in blocks of up to %.", block);
    else if (late <= reply_may_begin(test) + test->stepUs + test->yieldUs)
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
    uint32_t late;
    uint8_t i;

    test->checks++;
    for (i = 0, late = 0; i < sizeof lengths; i++) {
        passage few = mbm_portTest_receiving(test, lengths[i]);
        uint32_t us;

        if (!mbm_portTest_pass(test, &few) || !mbm_portTest_have_arrived(test, &few))
            return 0;
        us = lateness(test, &few);
        late = us > late ? us : late;
    }
    if (!mbm_portTest_pass(test, &all) || !mbm_portTest_have_arrived(test, &all))
        return 0;
    test->longestBlock = all.longestBlock;
    test->longestPauseUs = all.longestPauseUs;
    advise(test, late > lateness(test, &all) ? late : lateness(test, &all));
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
