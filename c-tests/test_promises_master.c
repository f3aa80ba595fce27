/* Each function of a line and of a node is held to its comment in mbm.h: results, limits, defaults.
 * test_bad_input calls each with NULL and with an object that was never begun. */
#include "exchanges.h"
#include "refused.h"
#include "hooked_port.h"
#include "test.h"

enum { RESPONSE = 125, TRANSMIT = 123 };

static hooked_port wire;
static mbm_port port;
static mbm_line line;
static mbm_node m;
static uint16_t response[RESPONSE], transmit[TRANSMIT];
static uint8_t frame[MBM_MAX_FRAME];

static void setup(void)
{
    memset(&wire, 0, sizeof wire);
    memset(&line, 0, sizeof line);
    memset(&m, 0, sizeof m);
    memset(response, 0x55, sizeof response);
    memset(transmit, 0x55, sizeof transmit);
    port = hooked_port_of(&wire);
    OK(mbm_line_beginRtu(&line, &port, frame, sizeof frame));
    OK(mbm_node_begin(&m, &line, 17, response, RESPONSE, transmit, TRANSMIT));
    OK(mbm_node_setBlocking(&m, 0));
}

fixture each_test = {setup, NULL};

/* Polls until the request has ended, and lets the time of pollDelay pass. */
static uint8_t run(void)
{
    uint8_t status;

    while ((status = mbm_node_poll(&m)) == MBM_PENDING)
        wire.now += mbm_node_pollDelay(&m) + 1;
    return status;
}

/* --- requests --- */

/* What 17 writes, and the functions that send the queued words or bits. */
enum { WRITE_OF_BOTH = 0x117, QUEUED_COILS = 0x20F, QUEUED = 0x210, READ_WITH_QUEUED = 0x217 };

static const struct {
    uint16_t function, most;
} requests[] = {{0x01, 2000},       {0x02, 2000},           {0x03, 125},
                {0x04, 125},        {0x0F, 1968},           {0x10, 123},
                {0x17, 125},        {WRITE_OF_BOTH, 121},   {QUEUED_COILS, 1968},
                {QUEUED, TRANSMIT}, {READ_WITH_QUEUED, 125}};

/* Makes a request of a function that has a quantity. */
static uint8_t request(unsigned function, uint16_t address, uint16_t quantity)
{
    exchange e = {.function = (uint8_t)function, .with = {address, quantity, 0, 1}};
    const unsigned queued = function == READ_WITH_QUEUED ? 1 : quantity;

    if (function == WRITE_OF_BOTH)
        e = (exchange){.function = 0x17, .with = {0, 1, address, quantity}};
    if (function >= QUEUED_COILS) {
        OK(mbm_node_beginTransmission(&m, address));
        for (unsigned i = 0; i < queued; i++) {
            const uint8_t status =
                function == QUEUED_COILS ? mbm_node_sendBit(&m, 1) : mbm_node_send(&m, 1);

            if (status != MBM_OK)
                return MBM_ILLEGAL_DATA_VALUE; /* the buffer ends where the function does */
        }
    }
    switch (function) {
    case QUEUED_COILS: return mbm_node_writeQueuedCoils(&m);
    case QUEUED: return mbm_node_writeQueuedRegisters(&m);
    case READ_WITH_QUEUED: return mbm_node_readWriteQueuedRegisters(&m, address, quantity);
    default: break;
    }
#define NODE(name, ...) mbm_node_##name(&m, __VA_ARGS__)
    EXCHANGE_CALL(&e, NODE);
}

static uint8_t read_words(uint16_t quantity)
{
    return mbm_node_readHoldingRegisters(&m, 0, quantity);
}

static void request_returns(uint8_t status, unsigned function, unsigned address, unsigned quantity)
{
    setup();
    IS(status, request(function, (uint16_t)address, (uint16_t)quantity));
    if (status == MBM_PENDING) {
        IS(MBM_RESPONSE_TIMED_OUT, run());
        assert_in_range(wire.length, 8, MBM_MAX_FRAME);
        return;
    }
    assert_int_equal(wire.called[HOOK_PRE] + wire.called[HOOK_WRITE] + wire.called[HOOK_POST], 0);
    assert_int_equal(wire.length, 0);
    assert_int_equal(mbm_node_getExceptionCode(&m), 0);
    assert_int_equal(response[0], 0x5555);
    assert_int_equal(mbm_node_pollDelay(&m), 0xFFFFFFFF);
}

TEST(a_quantity_and_an_address_have_the_limits_of_the_header)
{
    static const uint16_t beyond[] = {128, 256, 257, 512, 2001, 2048, 4096, 32768, 32769, 65535};

    for (unsigned i = 0; i < COUNT(requests); i++) {
        const unsigned function = requests[i].function, most = requests[i].most;

        request_returns(MBM_PENDING, function, 0, 1);
        request_returns(MBM_PENDING, function, 0, most);
        request_returns(MBM_PENDING, function, 65536 - most, most);
        request_returns(MBM_PENDING, function, 65535, 1);
        request_returns(MBM_ILLEGAL_DATA_VALUE, function, 0, 0);
        request_returns(MBM_ILLEGAL_DATA_VALUE, function, 0, most + 1);
        for (unsigned k = 0; k < COUNT(beyond); k++)
            if (beyond[k] > most)
                request_returns(MBM_ILLEGAL_DATA_VALUE, function, 0, beyond[k]);
        request_returns(MBM_ILLEGAL_DATA_ADDRESS, function, 65535, 2);
        request_returns(MBM_ILLEGAL_DATA_ADDRESS, function, 65537 - most, most);
        /* The quantity is checked before the address, as a device does. */
        request_returns(MBM_ILLEGAL_DATA_VALUE, function, 65535, most + 1);
    }
}

TEST(single_writes_store_their_arguments)
{
    IS(MBM_PENDING, mbm_node_writeSingleRegister(&m, 65535, 0x1234));
    assert_int_equal(transmit[0], 0x1234);
    OK(mbm_node_cancel(&m));
    IS(MBM_PENDING, mbm_node_maskWriteRegister(&m, 65535, 0x0F0F, 0xF0F0));
    assert_true(transmit[0] == 0x0F0F && transmit[1] == 0xF0F0);
    OK(mbm_node_cancel(&m));
    IS(MBM_PENDING, mbm_node_writeSingleCoil(&m, 65535, 77));
    IS(MBM_RESPONSE_TIMED_OUT, run());
    assert_int_equal(wire.sent[4], 0xFF);
}

TEST(requests_that_read_are_not_broadcast)
{
    static const uint8_t reads[] = {0x01, 0x02, 0x03, 0x04, 0x17};

    OK(mbm_node_setSlaveID(&m, 0));
    for (unsigned i = 0; i < COUNT(reads); i++)
        IS(MBM_BROADCAST_NOT_ALLOWED, request(reads[i], 0, 1));
    IS(MBM_BROADCAST_NOT_ALLOWED, mbm_node_status(&m));
    assert_int_equal(wire.length, 0);
    IS(MBM_PENDING, mbm_node_writeMultipleCoils(&m, 0, 1));
    OK(run());
    IS(MBM_PENDING, mbm_node_maskWriteRegister(&m, 0, 1, 1));
    OK(run());
}

/* --- words --- */

TEST(words_end_where_their_buffers_end)
{
    assert_int_equal(mbm_node_available(&m), 0);
    assert_int_equal(mbm_node_receive(&m), 0xFFFF);
    for (unsigned i = 0; i < TRANSMIT; i++)
        OK(mbm_node_send(&m, (uint16_t)i));
    IS(MBM_BUFFER_TOO_SMALL, mbm_node_send(&m, 1));
    assert_int_equal(transmit[TRANSMIT - 1], TRANSMIT - 1);
    IS(MBM_BUFFER_TOO_SMALL, mbm_node_sendBit(&m, 1));
    OK(mbm_node_beginTransmission(&m, 9));
    OK(mbm_node_sendBit(&m, 1));
    OK(mbm_node_send(&m, 5)); /* after a word with bits */
    assert_true((transmit[0] & 1) == 1 && transmit[1] == 5);
}

TEST(words_have_indices_up_to_the_ends_of_their_buffers)
{
    assert_int_equal(mbm_node_getResponseBuffer(&m, 0), 0x5555);
    OK(mbm_node_clearResponseBuffer(&m));
    OK(mbm_node_clearTransmitBuffer(&m));
    for (unsigned i = 0; i < 256; i++) {
        const uint8_t index = (uint8_t)i;

        assert_int_equal(mbm_node_getResponseBuffer(&m, index), i < RESPONSE ? 0 : 0xFFFF);
        IS(i < TRANSMIT ? MBM_OK : MBM_ILLEGAL_DATA_ADDRESS,
           mbm_node_setTransmitBuffer(&m, index, (uint16_t)i));
        if (i < TRANSMIT)
            assert_int_equal(transmit[i], i);
    }
    OK(mbm_node_send8(&m, 255));
    OK(mbm_node_send32(&m, 0xFFFE1234));
    assert_true(transmit[0] == 255 && transmit[1] == 0x1234 && transmit[2] == 0xFFFE);
    /* A node without words. */
    OK(mbm_node_begin(&m, &line, 17, NULL, 0, NULL, 0));
    assert_int_equal(mbm_node_getResponseBuffer(&m, 0), 0xFFFF);
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_node_setTransmitBuffer(&m, 0, 1));
    IS(MBM_BUFFER_TOO_SMALL, mbm_node_send8(&m, 1));
    IS(MBM_BUFFER_TOO_SMALL, mbm_node_send32(&m, 1));
    OK(mbm_node_clearResponseBuffer(&m));
    OK(mbm_node_clearTransmitBuffer(&m));
    assert_int_equal(mbm_node_requestFrom(&m, 0, 1), 0);
    IS(MBM_PENDING, mbm_node_status(&m));
}

static void nothing(void) {}

TEST(callbacks_have_the_rules_of_the_header)
{
    static mbm_nodeCallbacks callbacks, never;
    static const mbm_nodeCallbacks zero;

    memset(&callbacks, 0, sizeof callbacks);
    assert_null(mbm_nodeCallbacks_port(NULL));
    assert_null(mbm_nodeCallbacks_port(&never));
    IS(MBM_INVALID_ARGUMENT, mbm_nodeCallbacks_begin(NULL, &port));
    INVALID(callbacks, mbm_nodeCallbacks_begin(&callbacks, NULL));
    for (int hook = HOOK_READ; hook <= HOOK_MICROS; hook++) {
        const mbm_port lacking = hooked_port_without(&wire, hook);

        INVALID(callbacks, mbm_nodeCallbacks_begin(&callbacks, &lacking));
    }
    assert_memory_equal(&callbacks, &zero, sizeof zero);
    /* A line without them, and one without a port. */
    REFUSED(MBM_NOT_INITIALISED, line, mbm_node_idle(&m, nothing));
    REFUSED(MBM_NOT_INITIALISED, line, mbm_node_preTransmission(&m, nothing));
    REFUSED(MBM_NOT_INITIALISED, line, mbm_node_postTransmission(&m, NULL));
    OK(mbm_nodeCallbacks_begin(&callbacks, &port));
    INVALID(callbacks, mbm_nodeCallbacks_begin(&callbacks, mbm_nodeCallbacks_port(&callbacks)));
    OK(mbm_line_beginRtu(&line, mbm_nodeCallbacks_port(&callbacks), frame, sizeof frame));
    OK(mbm_node_idle(&m, nothing));
    OK(mbm_node_preTransmission(&m, nothing));
    OK(mbm_node_postTransmission(&m, nothing));
    IS(MBM_PENDING, mbm_node_readHoldingRegisters(&m, 0, 1));
    OK(mbm_node_idle(&m, NULL));
    IS(MBM_RESPONSE_TIMED_OUT, run());
}

TEST(the_words_of_a_read_are_received_once)
{
    IS(MBM_PENDING, read_words(2));
    while (wire.length == 0) {
        IS(MBM_PENDING, mbm_node_poll(&m));
        wire.now += 100;
    }
    hooked_port_arrive_rtu(&wire, 17, "\3\4\1\2\3\4", 6);
    OK(run());
    assert_int_equal(mbm_node_available(&m), 2);
    assert_int_equal(mbm_node_receive(&m), 0x0102);
    assert_int_equal(mbm_node_receive(&m), 0x0304);
    assert_int_equal(mbm_node_receive(&m), 0xFFFF);
    assert_int_equal(mbm_node_available(&m), 0);
    assert_int_equal(response[2], 0x5555);
}

/* --- begin, buffers, views --- */

TEST(a_begin_is_refused_without_a_change)
{
#define LINE(status, port, frame, bytes)                                                           \
    REFUSED(status, line, mbm_line_beginRtu(&line, port, frame, bytes))
    LINE(MBM_INVALID_ARGUMENT, NULL, frame, 8);
    LINE(MBM_INVALID_ARGUMENT, &port, NULL, 8);
    for (uint16_t bytes = 0; bytes < 8; bytes++) {
        if (bytes > 0)
            LINE(MBM_INVALID_ARGUMENT, &port, frame, bytes);
        INVALID(line, mbm_line_setFrame(&line, frame, bytes));
    }
    for (int hook = HOOK_READ; hook <= HOOK_MICROS; hook++) {
        const mbm_port lacking = hooked_port_without(&wire, hook);

        LINE(MBM_INVALID_ARGUMENT, &lacking, frame, 8);
    }
    INVALID(line, mbm_line_setFrame(&line, NULL, 8));
    OK(mbm_line_setFrame(&line, frame, 8));
    OK(mbm_line_beginRtu(&line, &port, frame, 8));
    OK(mbm_line_setFrame(&line, frame, sizeof frame));
#define WORDS(status, r, rs, t, ts) REFUSED(status, m, mbm_node_begin(&m, &line, 17, r, rs, t, ts))
    INVALID(m, mbm_node_begin(&m, NULL, 17, response, 1, transmit, 1));
    WORDS(MBM_INVALID_ARGUMENT, NULL, 1, transmit, 1);
    WORDS(MBM_INVALID_ARGUMENT, response, 1, NULL, 1);
    WORDS(MBM_INVALID_ARGUMENT, response, 256, transmit, 1);
    WORDS(MBM_INVALID_ARGUMENT, response, 1, transmit, 256);
    IS(MBM_PENDING, read_words(1));
    LINE(MBM_BUSY, &port, frame, 8);
    REFUSED(MBM_BUSY, line, mbm_line_setFrame(&line, frame, 8));
    WORDS(MBM_BUSY, response, 1, transmit, 1);
    OK(mbm_node_cancel(&m));
    OK(mbm_node_begin(&m, &line, 17, NULL, 0, NULL, 0));
    IS(MBM_ILLEGAL_DATA_VALUE, mbm_node_writeMultipleRegisters(&m, 0, 1));
}

TEST(a_line_without_a_frame_makes_no_request)
{
    mbm_line other = MBM_INIT;

    OK(mbm_line_beginRtu(&other, &port, NULL, 0));
    OK(mbm_node_begin(&m, &other, 17, response, RESPONSE, transmit, TRANSMIT));
    IS(MBM_NOT_INITIALISED, mbm_node_readHoldingRegisters(&m, 0, 1));
    OK(mbm_line_setFrame(&other, frame, sizeof frame));
    IS(MBM_PENDING, mbm_node_readHoldingRegisters(&m, 0, 1));
    OK(mbm_node_cancel(&m));
}

/* Makes a request and waits for its end. The frame lies on the stack. */
static uint8_t read_by_the_stack(uint8_t quantity)
{
    uint8_t own[MBM_FRAME_BYTES(2 * RESPONSE)];

    OK(mbm_line_setFrame(&line, own, (uint16_t)MBM_FRAME_BYTES(2 * quantity)));
    IS(MBM_PENDING, read_words(quantity));
    return run();
}

TEST(a_frame_is_used_only_while_a_request_is_pending)
{
    INVALID(line, mbm_line_setFrame(&line, NULL, 8));
    INVALID(line, mbm_line_setFrame(&line, NULL, 0));
    INVALID(line, mbm_line_setFrame(&line, frame, 7));
    IS(MBM_PENDING, read_words(1));
    REFUSED(MBM_BUSY, line, mbm_line_setFrame(&line, frame, 8));
    OK(mbm_node_cancel(&m));
    memset(frame, 0xA5, sizeof frame);
    IS(MBM_RESPONSE_TIMED_OUT, read_by_the_stack(1));
    IS(MBM_RESPONSE_TIMED_OUT, read_by_the_stack(2));
    assert_int_equal(frame[0], 0xA5);
    OK(mbm_line_setFrame(&line, frame, sizeof frame));
    IS(MBM_PENDING, read_words(1));
    assert_int_equal(frame[0], 17);
}

/* A right reply, a wrong one, none, and a request that was cancelled. */
TEST(an_ended_request_leaves_its_frame_alone)
{
    static const uint8_t right[] = {3, 2, 0, 7}, wrong[] = {4, 2, 0, 7}, late[] = {3, 2, 0, 8};
    static uint8_t one_frame[MBM_FRAME_BYTES(2)], untouched[sizeof one_frame];

    for (unsigned nth = 0; nth < 4; nth++) {
        OK(mbm_line_setFrame(&line, one_frame, sizeof one_frame));
        IS(MBM_PENDING, read_words(1));
        if (nth < 2)
            hooked_port_arrive_rtu(&wire, 17, nth == 0 ? right : wrong, sizeof right);
        if (nth < 3)
            run();
        else
            OK(mbm_node_cancel(&m));
        memset(one_frame, 0xA5, sizeof one_frame);
        memset(untouched, 0xA5, sizeof untouched);
        hooked_port_arrive_rtu(&wire, 17, late, sizeof late);
        wire.now += 100000;
        mbm_node_poll(&m);
        mbm_node_pollDelay(&m);
        mbm_node_cancel(&m);
        mbm_node_status(&m);
        mbm_node_getExceptionCode(&m);
        mbm_node_receive(&m);
        mbm_node_begin(&m, &line, 17, response, RESPONSE, transmit, TRANSMIT);
        mbm_line_used(&line);
        OK(mbm_line_setFrame(&line, frame, sizeof frame));
        IS(MBM_PENDING, read_words(1));
        run();
        assert_memory_equal(one_frame, untouched, sizeof untouched);
    }
}

TEST(what_begin_keeps_and_drops)
{
    OK(mbm_line_setRetries(&line, 3));
    OK(mbm_node_send(&m, 0x77));
    OK(mbm_line_beginRtu(&line, &port, frame, sizeof frame));
    OK(mbm_node_begin(&m, &line, 255, response, RESPONSE, transmit, TRANSMIT));
    assert_int_equal(mbm_node_getSlaveID(&m), 255);
    assert_int_equal(transmit[0], 0x77);
    /* The queue is empty. */
    IS(MBM_ILLEGAL_DATA_VALUE, mbm_node_writeQueuedRegisters(&m));
    /* It still does not block, and repeats a request three times. */
    OK(mbm_node_setResponseTimeout(&m, 5));
    IS(MBM_PENDING, mbm_node_writeSingleRegister(&m, 1, 2));
    IS(MBM_RESPONSE_TIMED_OUT, run());
    assert_int_equal(wire.length, 4 * 8);
}

TEST(a_line_gives_up_the_request_of_any_node)
{
    REFUSED(MBM_OK, line, mbm_line_cancel(&line)); /* there is none */
    IS(MBM_PENDING, read_words(1));
    OK(mbm_line_cancel(&line));
    IS(MBM_CANCELLED, mbm_node_poll(&m));
    OK(mbm_line_beginRtu(&line, &port, frame, sizeof frame));
}

/* --- settings --- */

/* The silence that is left before a request, if the wire was used just now. */
static uint32_t gap(void)
{
    OK(mbm_line_usedAt(&line, wire.now));
    IS(MBM_PENDING, read_words(1));
    IS(MBM_PENDING, mbm_node_poll(&m));
    uint32_t delay = mbm_node_pollDelay(&m);
    assert_int_equal(wire.length, 0);
    OK(mbm_node_cancel(&m));
    /* A request that was not sent leaves no reply to wait for. */
    return delay;
}

TEST(the_gap_is_that_of_the_header)
{
    static const uint32_t rates[][2] = {{19200, 2006}, {9600, 4011}, {115200, 1750}, {0, 4000}};

    assert_int_equal(gap(), 4000);
    OK(mbm_line_setGap(&line, 0xFFFFFFFF));
    assert_int_equal(gap(), 0x80000000);
    for (unsigned i = 0; i < COUNT(rates); i++) {
        OK(mbm_line_setBaudRate(&line, rates[i][0]));
        assert_int_equal(gap(), rates[i][1]);
    }
    OK(mbm_line_setGap(&line, 5));
    assert_int_equal(gap(), 5);
}

/* How many times a request is sent that nothing answers, and how long all of it takes. */
static unsigned frames(uint32_t *us)
{
    uint32_t begin = wire.now;

    wire.called[HOOK_PRE] = 0;
    IS(MBM_PENDING, read_words(1));
    IS(MBM_RESPONSE_TIMED_OUT, run());
    unsigned sent = wire.called[HOOK_PRE];
    *us = wire.now - begin;
    return sent;
}

TEST(a_master_without_settings_has_the_defaults_of_the_header)
{
    uint32_t us;

    assert_int_equal(frames(&us), 1); /* no retries */
    assert_in_range(us, 2000000, 2004100);
    assert_int_equal(frames(&us), 1);
    assert_in_range(us, 2100000, 2104100); /* after the quiet time */
    OK(mbm_line_setQuietTime(&line, 0));
    OK(mbm_node_setSlaveID(&m, 0));
    us = wire.now;
    IS(MBM_PENDING, mbm_node_writeMultipleRegisters(&m, 0, 1));
    OK(run());
    assert_in_range(wire.now - us, 100000, 104100); /* gap and turnaround delay */
}

TEST(settings_have_the_ranges_of_the_header)
{
    static mbm_counters counters;
    uint32_t us;

    OK(mbm_node_setResponseTimeout(&m, 1));
    OK(mbm_line_setRetries(&line, 255));
    assert_int_equal(frames(&us), 256);
    OK(mbm_line_setRetries(&line, 0));
    OK(mbm_line_setPostFlushHold(&line, 255));
    assert_int_equal(frames(&us), 1);
    assert_in_range(us, 255 * 1145, 500000); /* characters at 9600 bit/s, then the timeout */
    OK(mbm_line_setEchoDiscard(&line, 1));
    OK(mbm_node_setLenient(&m, 3));
    OK(mbm_line_setCounters(&line, &counters));
    OK(mbm_line_setCounters(&line, NULL));
    OK(mbm_line_used(&line));
    OK(mbm_line_usedAt(&line, 5));
}

TEST(lenient_is_refused_while_a_request_is_pending)
{
    IS(MBM_PENDING, read_words(1));
    REFUSED(MBM_BUSY, m, mbm_node_setLenient(&m, 1));
    REFUSED(MBM_BUSY, m, mbm_node_readHoldingRegisters(&m, 0, 1));
}

/* --- the response timeout --- */

/* Sends 123 registers, lets the device answer after the given milliseconds, and returns the
 * status. */
static uint8_t answered_after(uint32_t ms)
{
    wire.length = 0;
    IS(MBM_PENDING, mbm_node_writeMultipleRegisters(&m, 0, 123));
    while (wire.length < 255) {
        IS(MBM_PENDING, mbm_node_poll(&m));
        wire.now += 100;
    }
    uint32_t sent = wire.now;
    while (wire.now - sent < 1000 * ms) {
        uint32_t delay = mbm_node_pollDelay(&m), left = sent + 1000 * ms - wire.now;
        uint8_t status = mbm_node_poll(&m);

        if (status != MBM_PENDING)
            return status;
        wire.now += delay < left ? delay + 1 : left;
    }
    hooked_port_arrive_rtu(&wire, 17, "\x10\0\0\0\x7B", 5);
    return run();
}

TEST(without_flush_a_timeout_counts_from_when_the_request_is_sent)
{
    port.flush = NULL;
    OK(mbm_line_beginRtu(&line, &port, frame, sizeof frame));
    OK(mbm_line_setBaudRate(&line, 1200));
    /* 255 characters of 11 bits take 2337 ms, the timeout is 2000 ms. */
    OK(answered_after(2400));
    OK(answered_after(4300));
    IS(MBM_RESPONSE_TIMED_OUT, answered_after(4400));
}

TEST(a_port_that_knows_when_the_request_is_sent_adds_nothing)
{
    OK(mbm_line_setBaudRate(&line, 1200));
    OK(answered_after(1990));
    IS(MBM_RESPONSE_TIMED_OUT, answered_after(2010));
}

TEST(without_a_baud_rate_nothing_is_added)
{
    port.flush = NULL;
    OK(mbm_line_beginRtu(&line, &port, frame, sizeof frame));
    OK(answered_after(1990));
    IS(MBM_RESPONSE_TIMED_OUT, answered_after(2010));
    OK(mbm_line_setBaudRate(&line, 1200));
    OK(mbm_line_setBaudRate(&line, 0));
    IS(MBM_RESPONSE_TIMED_OUT, answered_after(2010));
}

TEST(a_time_that_is_too_long_is_refused_and_not_cut)
{
    OK(mbm_node_setResponseTimeout(&m, 100000));
    RANGE(m, 1000000, mbm_node_setResponseTimeout);
    INVALID(m, mbm_node_setResponseTimeout(&m, 0xFFFFFFFF));
    RANGE(line, 65535, mbm_line_setTurnaroundDelay);
    RANGE(line, 65535, mbm_line_setQuietTime);
    /* A timeout of 100 s is one. */
    OK(mbm_node_setResponseTimeout(&m, 100000));
    IS(MBM_RESPONSE_TIMED_OUT, answered_after(100100));
    OK(mbm_line_setQuietTime(&line, 0));
    OK(answered_after(99900));
}
