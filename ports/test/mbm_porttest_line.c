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

/* Of a turn of the loop that took longer, this time alone counts as waiting: other tasks had the
 * processor, and the test did not call the port. */
#define MOST_OF_A_TURN (PATIENCE / 8)

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
    uint8_t space[SPACE], reads = 0;

    for (;;) {
        const uint32_t silence = mbm_portTest_since(test, last);
        const int16_t count = take(test, port, space, CAPACITY);

        if (test->isOver)
            return 0;
        if (count < 0)
            return is_lost(test);
        /* What came while the task was away has been read. */
        if (count == 0 && silence >= rest)
            return 1;
        if (count > 0) {
            last = mbm_portTest_now(test);
            if (reads < 64) {
                reads++;
            } else if (last - began > 3 * PATIENCE) {
                test->isOver = 1;
                SAY(test, MBM_PORT_WRONG,
                    "`read` returns bytes without end although nothing is sent: return 0 when the ring is empty; give "
                    "the RX pin a pull-up; set the rate of the line.");
                return 0;
            }
        }
        mbm_portTest_yield(test);
    }
}

/* --- one passage */

/* What a passage knows of time. */
typedef struct times {
    uint32_t began;
    uint32_t takenAt;  /* the end of the last write */
    uint32_t turnAt;   /* the begin of this turn of the loop */
    uint32_t waited;   /* since a byte moved */
    uint32_t sure;     /* after `began`: until then the last bit cannot have left; 0: not known */
    uint32_t readAt;   /* of the last byte */
    uint32_t lookedAt; /* at the pin of the driver */
} times;

static void note_progress(const mbm_portTest *test, times *when)
{
    when->turnAt = mbm_portTest_now(test);
    when->waited = 0;
}

static void end_turn(const mbm_portTest *test, times *when)
{
    const uint32_t us = mbm_portTest_since(test, when->turnAt);

    when->turnAt = mbm_portTest_now(test);
    when->waited += us < MOST_OF_A_TURN ? us : MOST_OF_A_TURN;
}

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
    note_progress(test, when);
    when->takenAt = when->turnAt;
    bytes->taken = (uint16_t)(bytes->taken + (uint16_t)count);
    if ((uint16_t)count > bytes->atOnce)
        bytes->atOnce = (uint16_t)count;
    /* The frame buffer belongs to mbm again. */
    for (i = 0; i < (uint16_t)count; i++)
        test->frame[at + i] = (uint8_t)~test->frame[at + i];
    if (bytes->taken % 256u == 0)
        fill(test);
}

/* Whether the pin of the driver of the port that sends can be read. */
static uint8_t has_pin(const mbm_portTest *test, const passage *bytes)
{
    return test->driver != NULL && bytes->from == test->port;
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

/* The pin was not looked at since the last look. */
static void note_unseen(const mbm_portTest *test, passage *bytes, const times *when)
{
    const uint32_t us = mbm_portTest_since(test, when->lookedAt);

    if (us > bytes->unseenUs)
        bytes->unseenUs = us;
}

static void end(mbm_portTest *test, passage *bytes, times *when)
{
    const mbm_port *port = bytes->from;
    const uint32_t asked = mbm_portTest_now(test);

    if (port->flush != NULL && !port->flush(port->context)) {
        bytes->askedUs = asked - when->takenAt;
        return;
    }
    bytes->isFlushed = 1;
    bytes->flushedUs = mbm_portTest_since(test, when->began);
    if (mbm_portTest_since(test, asked) > NO_WAIT + mbm_portTest_step(test))
        bytes->waitedUs = bytes->flushedUs;
    note_unseen(test, bytes, when);
    note_progress(test, when);
    switch_driver(test, bytes, port->postTransmission);
}

/* The pin, while the bytes leave. It is read before the clock: the task may be away between them,
 * and the driver goes off rightly meanwhile. */
static void watch_driver(mbm_portTest *test, passage *bytes, times *when)
{
    const uint32_t before = mbm_portTest_now(test);
    uint8_t is_on;
    uint32_t us;

    if (!has_pin(test, bytes) || bytes->isFlushed)
        return;
    is_on = test->driver(test->context);
    note_unseen(test, bytes, when);
    when->lookedAt = before;
    if (is_on) {
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
    note_progress(test, when);
    pause = mbm_portTest_since(test, when->readAt);
    if (bytes->block == 0 && bytes->lastUs > 0 && pause > bytes->longestPauseUs)
        bytes->longestPauseUs = pause;
    when->readAt = when->turnAt;
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
           bytes->arrived + piece(test, bytes) < bytes->taken && when->waited < PATIENCE / 2;
}

/* A flush may wait until the last bit has left. A UART that switches its driver itself is looked at
 * before. */
static uint8_t waits_for_driver(const mbm_portTest *test, const passage *bytes, const times *when)
{
    return has_pin(test, bytes) && bytes->from->preTransmission == NULL && !bytes->wentOn &&
           mbm_portTest_since(test, when->began) < mbm_portTest_characters(test, bytes->length) / 2;
}

/* Goes on until all has been done, or nothing happens any more. */
static void move(mbm_portTest *test, passage *bytes)
{
    const uint32_t now = mbm_portTest_now(test);
    /* Bytes that were taken leave one by one. */
    const uint32_t lasts = mbm_portTest_characters(test, bytes->length),
                   patience = PATIENCE + lasts,
                   /* The clock shows up to a step less than has passed. */
        margin = mbm_portTest_characters(test, 1) / 2 + mbm_portTest_step(test);
    times when = {.began = now,
                  .turnAt = now,
                  .sure = lasts > margin ? lasts - margin : 0,
                  .readAt = now,
                  .lookedAt = now};

    test->yieldUs = 0;
    while (!test->isOver && !is_done(bytes) && when.waited < patience) {
        if (bytes->taken < bytes->length)
            send(test, bytes, &when);
        else if (!bytes->isFlushed && !waits_for_bytes(test, bytes, &when) &&
                 !waits_for_driver(test, bytes, &when))
            end(test, bytes, &when);
        watch_driver(test, bytes, &when);
        /* A line that holds the sender back waits for the reader. */
        if (when.waited > patience - PATIENCE / 2)
            bytes->isAway = 0;
        if (!test->isOver && bytes->to != NULL && (!bytes->isAway || bytes->isFlushed))
            receive(test, bytes, &when);
        mbm_portTest_yield(test);
        end_turn(test, &when);
    }
    bytes->yieldUs = test->yieldUs;
}

/* A device may reply 3.5 characters after the last bit. A UART that switches the pin itself may
 * hold it for some bits. Without a flush the bytes may still be leaving. */
static uint8_t stays_on(mbm_portTest *test, const passage *bytes)
{
    const uint32_t ended = mbm_portTest_now(test);
    const uint32_t bits = test->baud != 0 ? mbm_portTest_characters(test, 2) : PATIENCE / 10;
    const uint32_t rest =
        bytes->from->flush == NULL ? mbm_portTest_characters(test, bytes->taken) : 0;

    for (;;) {
        const uint32_t us = mbm_portTest_since(test, ended);

        if (!test->driver(test->context))
            return 0;
        if (us > bits + rest + mbm_portTest_step(test))
            return 1;
        mbm_portTest_yield(test);
    }
}

uint8_t mbm_portTest_pass(mbm_portTest *test, passage *bytes)
{
    const mbm_port *from = bytes->from;

    test->seed = (uint8_t)(test->seed + 59u);
    fill(test);
    if (!mbm_portTest_drain(test, test->port) ||
        (test->other != NULL && !mbm_portTest_drain(test, test->other)))
        return 0;
    if (has_pin(test, bytes))
        bytes->wasOn = test->driver(test->context);
    switch_driver(test, bytes, from->preTransmission);
    if (has_pin(test, bytes) && from->preTransmission != NULL)
        bytes->wentOn = test->driver(test->context);
    move(test, bytes);
    if (!bytes->isFlushed)
        switch_driver(test, bytes, from->postTransmission);
    if (has_pin(test, bytes))
        bytes->staysOn = stays_on(test, bytes);
    return !test->isOver;
}

uint8_t mbm_portTest_is_alive(mbm_portTest *test)
{
    uint8_t tries;

    for (tries = 0; tries < 3; tries++) {
        passage bytes = mbm_portTest_receiving(test, FEW);

        if (!mbm_portTest_pass(test, &bytes))
            return 0;
        if (bytes.right == FEW && bytes.arrived == FEW)
            return 1;
    }
    return 0;
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
