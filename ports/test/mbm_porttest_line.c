/* The test of a port: bytes that are sent and received. See mbm_porttest.h.
 * Licence: MIT OR Apache-2.0. */
#include "mbm_porttest_parts.h"

/* Nothing has happened for so long: a check ends. Longer than any latency of an adapter. */
#define PATIENCE 1000000u

/* The most bytes of one read, and the space for them: a port that ignores `capacity` has some more.
 */
enum { CAPACITY = 32 };
#if defined(__AVR__)
enum { SPACE = 64 };
#else
enum { SPACE = 300 };
#endif

/* A byte that no read may change. */
enum { UNTOUCHED = 0x5C };

/* --- the bytes */

/* The bytes of a frame: each of the 256 values once, since some lines change or keep some. */
static uint8_t byte_at(const mbm_portTest *test, uint16_t at)
{
    return (uint8_t)(at * 167u + test->seed);
}

/* The place of a byte among 256: 23 times 167 is 1. */
static uint8_t place_of(const mbm_portTest *test, uint8_t byte)
{
    return (uint8_t)((uint8_t)(byte - test->seed) * 23u);
}

static void fill(mbm_portTest *test)
{
    uint16_t i;

    for (i = 0; i < sizeof test->frame; i++)
        test->frame[i] = byte_at(test, i);
}

/* The tested port sends. */
passage mbm_portTest_sending(const mbm_portTest *test, uint16_t length)
{
    passage bytes = {0};

    bytes.from = test->port;
    bytes.to = test->other != NULL ? test->other : test->isLooped ? test->port : NULL;
    bytes.length = length;
    return bytes;
}

/* It receives. */
passage mbm_portTest_receiving(const mbm_portTest *test, uint16_t length)
{
    passage bytes = mbm_portTest_sending(test, length);

    bytes.from = test->other != NULL ? test->other : test->port;
    bytes.to = test->port;
    return bytes;
}

static uint8_t is_lost(mbm_portTest *test)
{
    test->isOver = 1;
    SAY(test, MBM_PORT_WRONG,
        "`read` or `write` was negative, which means that the link is lost: open it, or return 0 while there is "
        "nothing to do.");
    return 0;
}

/* Reads into a place with more space than `capacity`. */
static int16_t take(mbm_portTest *test, const mbm_port *port, uint8_t *space, uint16_t capacity)
{
    int16_t count;

    space[capacity] = space[capacity + 1] = UNTOUCHED;
    count = port->read(port->context, space, capacity);
    if (count <= (int16_t)capacity && space[capacity] == UNTOUCHED &&
        space[capacity + 1] == UNTOUCHED)
        return count;
    test->isOver = 1;
    SAY_NUMBERS(
        test, MBM_PORT_WRONG,
        "`read` wrote past `capacity`, which was %: copy at most `capacity` bytes; keep the rest for the "
        "next call.",
        capacity);
    return -1;
}

uint8_t mbm_portTest_drain(mbm_portTest *test, const mbm_port *port)
{
    const uint32_t began = mbm_portTest_now(test), rest = 20000u + mbm_portTest_characters(test, 4);
    uint32_t last = began;
    uint8_t space[SPACE];

    while (mbm_portTest_since(test, last) < rest) {
        const int16_t count = take(test, port, space, CAPACITY);

        if (test->isOver)
            return 0;
        if (count < 0)
            return is_lost(test);
        if (count > 0) {
            last = mbm_portTest_now(test);
            if (last - began > 3 * PATIENCE) {
                test->isOver = 1;
                SAY(test, MBM_PORT_WRONG,
                    "`read` returns bytes without end although nothing is sent: return 0 when the ring is empty; give "
                    "the RX pin a pull-up; set the rate of the line.");
                return 0;
            }
        }
        mbm_portTest_yield(test);
    }
    return 1;
}

/* --- one passage */

/* What a passage knows of time. */
typedef struct times {
    uint32_t began;
    uint32_t progress; /* the last time that a byte moved */
    uint32_t sure;     /* so long after it the last bit has surely not left; 0: not known */
    uint32_t readAt;   /* of the last byte */
} times;

/* The most bytes of one call. While a write waits, nothing is read: the receiver must hold what
 * comes. */
static uint16_t piece(const mbm_portTest *test, const passage *bytes)
{
    return test->mayWait && bytes->from == bytes->to ? 16 : 256;
}

static void send(mbm_portTest *test, passage *bytes, times *when)
{
    const uint16_t left = (uint16_t)(bytes->length - bytes->taken), at = bytes->taken % 256u;
    const uint16_t most =
        piece(test, bytes) < 256u - at ? piece(test, bytes) : (uint16_t)(256u - at);
    const uint16_t length = left < most ? left : most;
    const uint32_t before = mbm_portTest_now(test);
    uint32_t took;
    uint16_t i;
    const int16_t count = bytes->from->write(bytes->from->context, test->frame + at, length);

    took = mbm_portTest_since(test, before);
    if (took > bytes->longestWriteUs)
        bytes->longestWriteUs = took;
    if (count < 0 || (uint16_t)count > length) {
        (void)is_lost(test);
        return;
    }
    if (count == 0)
        return;
    when->progress = before + took;
    bytes->taken = (uint16_t)(bytes->taken + (uint16_t)count);
    if ((uint16_t)count > bytes->atOnce)
        bytes->atOnce = (uint16_t)count;
    /* The frame buffer belongs to mbm again. */
    for (i = 0; i < (uint16_t)count; i++)
        test->frame[at + i] = (uint8_t)~test->frame[at + i];
    if (bytes->taken % 256u == 0)
        fill(test);
}

/* Calls a hook of the driver. */
static void switch_driver(mbm_portTest *test, passage *bytes, void (*hook)(void *))
{
    const uint32_t before = mbm_portTest_now(test);
    uint32_t took;

    if (hook == NULL)
        return;
    hook(bytes->from->context);
    took = mbm_portTest_since(test, before);
    if (took > bytes->switchedUs)
        bytes->switchedUs = took;
}

static void end(mbm_portTest *test, passage *bytes, times *when)
{
    const mbm_port *port = bytes->from;

    if (port->flush != NULL && !port->flush(port->context))
        return;
    bytes->isFlushed = 1;
    when->progress = mbm_portTest_now(test);
    bytes->flushedUs = mbm_portTest_since(test, when->began);
    switch_driver(test, bytes, port->postTransmission);
}

/* The pin, while the bytes leave. It is read before the clock: the task may be away between them,
 * and the driver goes off rightly meanwhile. */
static void watch_driver(mbm_portTest *test, passage *bytes, const times *when)
{
    uint32_t us;

    if (test->driver == NULL || bytes->from != test->port || bytes->isFlushed)
        return;
    if (test->driver(test->context)) {
        bytes->wentOn = 1;
        return;
    }
    us = mbm_portTest_since(test, when->began);
    if (bytes->wentOn && !bytes->wentOff && us < when->sure) {
        bytes->wentOff = 1;
        bytes->offUs = us;
    }
}

static void compare(const mbm_portTest *test, passage *bytes, const uint8_t *came, uint16_t count)
{
    uint16_t i;

    for (i = 0; i < count; i++, bytes->arrived++) {
        const uint8_t wanted = byte_at(test, bytes->arrived);

        if (bytes->isDifferent) {
            if (!bytes->hasAfter)
                bytes->after = came[i];
            bytes->hasAfter = 1;
        } else if (came[i] == wanted) {
            bytes->right++;
        } else {
            bytes->isDifferent = 1;
            bytes->wanted = wanted;
            bytes->came = came[i];
        }
    }
}

static void receive(mbm_portTest *test, passage *bytes, times *when)
{
    /* A single byte now and then: mbm on a microcontroller reads them one by one. */
    const uint16_t capacity = bytes->arrived % 5u == 2 ? 1 : CAPACITY;
    uint8_t space[SPACE];
    const int16_t count = take(test, bytes->to, space, capacity);
    uint32_t pause;

    if (test->isOver)
        return;
    if (count < 0) {
        (void)is_lost(test);
        return;
    }
    if (count == 0) {
        bytes->block = 0;
        return;
    }
    compare(test, bytes, space, (uint16_t)count);
    when->progress = mbm_portTest_now(test);
    pause = mbm_portTest_since(test, when->readAt);
    if (bytes->block == 0 && bytes->lastUs > 0 && pause > bytes->longestPauseUs)
        bytes->longestPauseUs = pause;
    when->readAt = when->progress;
    bytes->lastUs = mbm_portTest_since(test, when->began);
    bytes->block = (uint16_t)(bytes->block + (uint16_t)count);
    if (bytes->block > bytes->longestBlock)
        bytes->longestBlock = bytes->block;
}

static uint8_t is_done(const passage *bytes)
{
    return bytes->isFlushed && (bytes->to == NULL || bytes->arrived >= bytes->length);
}

/* Nothing is read while a flush waits either, so most bytes must have arrived before. */
static uint8_t waits_for_bytes(const mbm_portTest *test, const passage *bytes, const times *when)
{
    return piece(test, bytes) < 256 && !bytes->isAway &&
           bytes->arrived + piece(test, bytes) < bytes->taken &&
           mbm_portTest_since(test, when->progress) < PATIENCE / 2;
}

/* Goes on until all has been done, or nothing happens any more. */
static void move(mbm_portTest *test, passage *bytes)
{
    const uint32_t now = mbm_portTest_now(test);
    /* Bytes that were taken leave one by one. */
    const uint32_t lasts = mbm_portTest_characters(test, bytes->length),
                   patience = PATIENCE + lasts,
                   /* The clock shows up to a step less than has passed. */
        margin = mbm_portTest_characters(test, 1) / 2 + test->stepUs;
    times when = {
        .began = now, .progress = now, .sure = lasts > margin ? lasts - margin : 0, .readAt = now};

    while (!test->isOver && !is_done(bytes) && mbm_portTest_since(test, when.progress) < patience) {
        if (bytes->taken < bytes->length)
            send(test, bytes, &when);
        else if (!bytes->isFlushed && !waits_for_bytes(test, bytes, &when))
            end(test, bytes, &when);
        watch_driver(test, bytes, &when);
        /* A line that holds the sender back waits for the reader. */
        if (mbm_portTest_since(test, when.progress) > patience - PATIENCE / 2)
            bytes->isAway = 0;
        if (!test->isOver && bytes->to != NULL && (!bytes->isAway || bytes->isFlushed))
            receive(test, bytes, &when);
        mbm_portTest_yield(test);
    }
}

/* A device may reply 3.5 characters after the last bit. A UART that switches the pin itself may
 * hold it for some bits. */
static uint8_t stays_on(mbm_portTest *test)
{
    const uint32_t ended = mbm_portTest_now(test),
                   may = mbm_portTest_characters(test, 2) + test->stepUs + test->yieldUs;

    while (test->driver(test->context)) {
        if (mbm_portTest_since(test, ended) > may)
            return 1;
        mbm_portTest_yield(test);
    }
    return 0;
}

uint8_t mbm_portTest_pass(mbm_portTest *test, passage *bytes)
{
    const mbm_port *from = bytes->from;
    const uint8_t has_pin = test->driver != NULL && from == test->port;

    test->seed = (uint8_t)(test->seed + 59u);
    fill(test);
    if (!mbm_portTest_drain(test, test->port) ||
        (test->other != NULL && !mbm_portTest_drain(test, test->other)))
        return 0;
    if (has_pin)
        bytes->wasOn = test->driver(test->context);
    switch_driver(test, bytes, from->preTransmission);
    if (has_pin && from->preTransmission != NULL)
        bytes->wentOn = test->driver(test->context);
    move(test, bytes);
    if (!bytes->isFlushed)
        switch_driver(test, bytes, from->postTransmission);
    if (has_pin)
        bytes->staysOn = stays_on(test);
    return !test->isOver;
}

uint8_t mbm_portTest_is_alive(mbm_portTest *test)
{
    passage bytes = mbm_portTest_receiving(test, FEW);

    return mbm_portTest_pass(test, &bytes) && bytes.right == FEW && bytes.arrived == FEW;
}

/* --- what is wrong with bytes */

static void say_difference(mbm_portTest *test, const passage *bytes)
{
    const uint8_t at = place_of(test, bytes->came), lost = (uint8_t)(at - bytes->right);
    /* The next byte shows whether the bytes go on from there. */
    const uint8_t goes_on = !bytes->hasAfter || bytes->after == byte_at(test, at + 1u);

    if ((bytes->came ^ bytes->wanted) == 0xFF)
        SAY(test, MBM_PORT_WRONG,
            "The bytes on the line are those that were put into the buffer after `write` had returned: `write` keeps "
            "the pointer. Copy the bytes; mbm uses its buffer again.");
    else if (goes_on && lost == 1 && (bytes->wanted == 0x11 || bytes->wanted == 0x13))
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "The byte % was swallowed: XON and XOFF are on. Switch software flow control off.",
            bytes->wanted);
    else if (bytes->right > 0 && bytes->came == byte_at(test, (uint16_t)(bytes->right - 1u)) &&
             (!bytes->hasAfter || bytes->after == bytes->wanted))
        SAY_NUMBERS(test, MBM_PORT_WRONG,
                    "Byte % of %, a %, came twice: `read` must take a byte out of the ring, once.",
                    bytes->right, bytes->length, bytes->came);
    else if (bytes->came == (bytes->wanted & 0x7F))
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "A % arrived as %: the upper bit is missing. Set eight data bits (with a parity, a word of nine on STM32).",
            bytes->wanted, bytes->came);
    else if (goes_on && lost < bytes->length - bytes->right)
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "After % of % bytes, % went missing: the receiver is read too late. Let an interrupt or DMA fill a ring.",
            bytes->right, bytes->length, lost);
    else if ((bytes->wanted == '\r' && bytes->came == '\n') ||
             (bytes->wanted == '\n' && bytes->came == '\r'))
        SAY_NUMBERS(test, MBM_PORT_WRONG,
                    "A % arrived as %: a console translates line ends. Make the line raw.",
                    bytes->wanted, bytes->came);
    else
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "Byte % of % was sent as % and arrived as %: set the same rate, parity and stop bits at both ends; else "
            "bytes are handed over out of order.",
            bytes->right + 1u, bytes->length, bytes->wanted, bytes->came);
}

/* Whether what was held back comes when more is sent. */
static uint8_t comes_later(mbm_portTest *test, passage *bytes)
{
    const uint16_t before = bytes->arrived;

    /* Up to 512 bytes: twice the buffer of a DMA that tells of nothing but its two halves. */
    while (bytes->arrived == before && bytes->length < 768 && !test->isOver) {
        bytes->length = (uint16_t)(bytes->length + 64u);
        bytes->isFlushed = 0;
        move(test, bytes);
    }
    return bytes->arrived > before;
}

uint8_t mbm_portTest_have_arrived(mbm_portTest *test, passage *bytes)
{
    const uint16_t before = bytes->arrived, length = bytes->length;

    if (bytes->to == NULL || (!bytes->isDifferent && before >= length))
        return 1;
    if (bytes->isDifferent)
        say_difference(test, bytes);
    else if (comes_later(test, bytes) && !bytes->isDifferent)
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "Only % of % bytes arrived until more were sent: the receiver hands over full blocks alone. Add the "
            "idle-line event of the DMA, or the timeout of the FIFO.",
            before, length);
    else if (before == 0)
        SAY(test, MBM_PORT_WRONG,
            "Nothing arrived: look at the wire, at the pins' function, whether the receiver is on while the "
            "port sends, and whether its interrupt reaches the ring.");
    else
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "Only the first % of % bytes arrived: the receiver loses the others (let an interrupt or DMA fill a "
            "ring), or `write` returned more than it took.",
            before, length);
    return 0;
}

/* --- the checks */

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

void mbm_portTest_checkWrite(mbm_portTest *test)
{
    passage all = mbm_portTest_sending(test, 256);
    const uint32_t lasts = mbm_portTest_characters(test, 256);

    if (!can_send(test))
        return;
    test->checks++;
    if (!mbm_portTest_pass(test, &all))
        return;
    if (all.taken == 0) {
        test->isOver = 1;
        SAY(test, MBM_PORT_WRONG,
            "`write` took none of 256 bytes for a second, after a frame of 8: clear your mark of a transmission under way "
            "when it has ended, and take part of a frame that is longer than your buffer.");
        return;
    }
    if (all.taken < all.length || !all.isFlushed) {
        test->isOver = 1;
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "Of a frame of 256 bytes `write` took %, and then nothing left for a second: take part of the bytes, "
            "return their number, and take the others later.",
            all.taken);
        return;
    }
    if (all.to != NULL && !mbm_portTest_have_arrived(test, &all)) {
        test->isOver = 1;
        return;
    }
    if (lasts > 0 && all.longestWriteUs > lasts / 4 + 1000 && !test->mayWait)
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "`write` waited for % us: hand the bytes to an interrupt, to DMA or to a transmit buffer, and return "
            "the number that was taken.",
            all.longestWriteUs);
    else if (all.atOnce < 256 && !test->mayWait)
        SAY_NUMBERS(
            test, MBM_PORT_ADVICE,
            "`write` takes at most % of 256 bytes at once: a frame gets a pause if the main loop is away for longer "
            "than they last. A transmit buffer of 256 bytes prevents that.",
            all.atOnce);
    if (all.to != NULL && !is_in_time(test, &all))
        test->isOver = 1;
    else if (lasts > 0 && all.to != NULL && all.lastUs > 2 * lasts + 50000)
        SAY_NUMBERS(
            test, MBM_PORT_WRONG,
            "256 characters took % us, and last % at % baud: the clock does not count microseconds, the line "
            "has another rate, or the frame has pauses.",
            all.lastUs, lasts, test->baud);
}
