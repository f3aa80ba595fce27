/* The waits of a transaction of the contract with programs for ModbusMaster: for the reply,
 * the quiet time, the turnaround delay and a busy line, on a simulated clock. Unit 17 is 11
 * on the wire. */
#include "every_call.h"
#include "sim.h"
#include "test.h"

static void gap_after_reply(sim *s, uint32_t wanted)
{
    sim_reads(s, 500);
    sim_reads(s, 500);
    sim_assert_time(s->frames[s->sent - 1].silence, wanted);
}

SIM_TEST(a_reply_may_take_2000_ms)
{
    IS(MBM_RESPONSE_TIMED_OUT, mbm_node_readHoldingRegisters(n, 0, 1));
    sim_assert_time(s->now - sim_time_of(s, 'O'), 2000000);
    assert_true(s->idles > 1000);
    assert_int_equal(s->counters.timeouts, 1);
    sim_reads(s, 1990000);
}

SIM_TEST(the_response_timeout_can_be_set)
{
    OK(mbm_node_setResponseTimeout(n, 7));
    IS(MBM_RESPONSE_TIMED_OUT, sim_read_one(s));
    sim_assert_time(s->now - sim_time_of(s, 'O'), 7000);
    OK(mbm_node_setResponseTimeout(n, 65535));
    s->limit = 140000000; /* the reply is held, because the one before it may be late */
    sim_reads(s, 65000000);
}

static void pass_3_seconds(sim *s)
{
    if (s->sent > 0)
        s->now += 3000000;
}

static void read_as_the_deadline_passes(sim *s, uint16_t read_piece)
{
    s->on_idle = pass_3_seconds;
    s->read_piece = read_piece;
    sim_reads(s, 1500000);
}

SIM_ROW(a_reply_that_is_complete_as_the_deadline_passes_is_a_success,
        read_as_the_deadline_passes(s, 0))
/* Ports such as Arduino's return one byte for each read. The result must be the same. */
SIM_ROW(a_reply_read_byte_by_byte_after_the_deadline_is_a_success,
        read_as_the_deadline_passes(s, 1))

/* The request must end, however many bytes arrive after the deadline. */
SIM_TEST(endless_bytes_do_not_keep_a_request_from_ending)
{
    static const uint8_t noise[8000] = {0};

    mbm_node_setResponseTimeout(n, 50);
    s->step = 100;
    s->read_piece = 1;
    s->character = 0;
    sim_deliver(s, 4500, noise, sizeof noise);
    IS(MBM_RESPONSE_TIMED_OUT, sim_read_one(s));
    assert_int_equal(s->sent, 1);
    assert_in_range(s->now - s->frames[0].end, 50000, 300000);
}

SIM_TEST(a_long_idle_while_a_reply_arrives_is_tolerated)
{
    mbm_node_setResponseTimeout(n, 10000);
    s->on_idle = pass_3_seconds;
    sim_reads(s, 100);
    assert_true(s->idles < 1000);
}

SIM_TEST(the_quiet_time_is_kept_after_a_timeout)
{
    IS(MBM_RESPONSE_TIMED_OUT, sim_read_one(s));
    uint64_t failed = s->now;
    sim_reads(s, 500);
    sim_assert_time(s->frames[1].begin - failed, 100000);
    /* This request's reply was held, see test_late_replies.c. After a held reply there is
     * no quiet time. */
    sim_reads(s, 500);
    sim_reads(s, 500);
    sim_assert_time(s->frames[3].silence, 4000);
    OK(mbm_line_setQuietTime(&s->line, 250));
    IS(MBM_RESPONSE_TIMED_OUT, sim_read_one(s));
    failed = s->now;
    sim_reads(s, 500);
    sim_assert_time(s->frames[5].begin - failed, 250000);
}

/* The quiet time waits for this reply. */
SIM_TEST(a_reply_in_the_quiet_time_is_dropped_and_ends_it)
{
    sim_answer(s, 1, 2050000, "11 03 02 66 66 +");
    IS(MBM_RESPONSE_TIMED_OUT, sim_read_one(s));
    uint64_t failed = s->now;
    sim_reads(s, 500);
    assert_true(s->frames[1].begin >= failed + 50000);
    sim_assert_time(s->frames[1].silence, 4000);
}

/* One frame followed by silence does not mean that the line never falls silent. */
SIM_TEST(a_reply_late_in_the_quiet_time_does_not_make_the_line_busy)
{
    mbm_node_setResponseTimeout(n, 50);
    sim_answer(s, 1, 130000, "11 03 02 66 66 +");
    IS(MBM_RESPONSE_TIMED_OUT, sim_read_one(s));
    sim_reads(s, 500);
}

SIM_TEST(a_foreign_frame_in_the_quiet_time_does_not_lengthen_it)
{
    mbm_node_setResponseTimeout(n, 50);
    /* The frame contains bytes that look like a damaged exception. */
    sim_answer(s, 1, 60000, "05 03 06 11 83 00 00 00 00 +");
    IS(MBM_RESPONSE_TIMED_OUT, sim_read_one(s));
    sim_reads(s, 500);
    sim_assert_time(s->frames[1].silence, 100000);
}

SIM_TEST(a_request_without_a_reply_is_repeated_as_often_as_set)
{
    OK(mbm_line_setRetries(&s->line, 2));
    sim_answer(s, 3, 500, "11 03 02 00 2A +");
    OK(sim_read_one(s));
    assert_int_equal(s->sent, 3);
    assert_int_equal(s->counters.requests, 3);
    assert_int_equal(s->counters.timeouts, 2);
    sim_assert_time(s->frames[1].silence, 2000000 + 100000);
    sim_assert_sent(s, 2, "11 03 00 00 00 01 +");
    IS(MBM_RESPONSE_TIMED_OUT, sim_read_one(s));
    assert_int_equal(s->sent, 6);
}

SIM_TEST(damaged_and_malformed_replies_are_retried_exceptions_are_not)
{
    OK(mbm_line_setRetries(&s->line, 1));
    sim_answer(s, 1, 500, "11 03 02 00 2A 00 00");
    sim_answer(s, 2, 500, "11 03 02 00 2A +");
    OK(sim_read_one(s));
    sim_answer(s, 1, 500, "11 03 04 00 00 00 00 +");
    sim_answer(s, 2, 500, "11 03 02 00 2A +");
    OK(sim_read_one(s));
    assert_int_equal(s->sent, 4);
    sim_answer(s, 1, 500, "11 83 06 +");
    IS(MBM_SERVER_DEVICE_BUSY, sim_read_one(s));
    assert_int_equal(s->sent, 5);
}

SIM_TEST(a_broadcast_succeeds_after_the_turnaround_delay)
{
    OK(mbm_node_setSlaveID(n, 0));
    OK(mbm_node_writeSingleRegister(n, 1, 2));
    sim_assert_sent(s, 0, "00 06 00 01 00 02 +");
    sim_assert_time(s->now - sim_time_of(s, 'O'), 100000);
    sim_assert_order(s, "OI", "IOI");
    OK(mbm_line_setTurnaroundDelay(&s->line, 30));
    OK(mbm_node_writeMultipleCoils(n, 1, 9));
    sim_assert_time(s->now - s->frames[1].end, 30000);
    OK(mbm_node_writeMultipleRegisters(n, 1, 2));
    OK(mbm_node_maskWriteRegister(n, 1, 2, 3));
    assert_int_equal(s->counters.replies, 0);
    assert_int_equal(s->idle_while_driving, 0);
}

/* Lets the frames of `text` arrive from time `at` on, `count` times, each time `period`
 * microseconds after the last one; without a pause if `period` is 0. */
static void repeat(sim *s, uint64_t at, const char *text, unsigned count, uint32_t period)
{
    uint8_t bytes[64];
    size_t length = sim_bytes(bytes, text);

    for (unsigned i = 0; i < count; i++) {
        sim_deliver(s, at, bytes, length);
        at += period ? period : length * s->character;
    }
}

static void is_busy(sim *s, const char *text, unsigned count, uint64_t latest)
{
    OK(mbm_node_setResponseTimeout(&s->node, 100));
    s->limit = 1000000;
    repeat(s, 0, text, count, 0);
    IS(MBM_LINE_BUSY, sim_read_one(s));
    assert_int_equal(s->sent, 0);
    assert_in_range(s->now, 100000, latest);
}

SIM_ROW(a_line_that_never_falls_silent_is_busy, is_busy(s, "00", 3000, 110000))
/* None of them answers the request, which was not sent. */
SIM_ROW(a_device_that_never_stops_repeating_the_right_reply_makes_the_line_busy,
        is_busy(s, "11 03 02 00 2A +", 1000, 300000))
/* Each right reply makes the request wait for the quiet time, and the frame after it for the gap
 * again. */
SIM_ROW(a_device_that_never_stops_sending_different_replies_makes_the_line_busy,
        is_busy(s, "11 03 02 00 2A +/11 03 04 00 2A 00 2B +", 480, 300000))

/* The late reply ends the quiet time, which is longer than the response timeout here. */
SIM_TEST(a_late_reply_in_a_long_quiet_time_does_not_make_the_line_busy)
{
    OK(mbm_node_setResponseTimeout(n, 100));
    OK(mbm_line_setQuietTime(&s->line, 500));
    IS(MBM_RESPONSE_TIMED_OUT, sim_read_one(s));
    sim_deliver_text(s, s->now + 300000, "11 03 02 00 2A +");
    sim_answer(s, 1, 500, "11 03 02 00 2B +");
    OK(sim_read_one(s));
    assert_int_equal(s->response[0], 43);
    assert_int_equal(s->sent, 2);
}

/* The first reply of each pair is the one that the unit owes. The second one is owed to nobody, so
 * the request does not wait for the unit again. */
SIM_TEST(a_device_that_sends_each_reply_twice_does_not_keep_a_request_from_being_sent)
{
    OK(mbm_node_setResponseTimeout(n, 100));
    OK(mbm_node_setBlocking(n, 0));
    IS(MBM_PENDING, sim_read_one(s));
    while (s->sent == 0 || s->driver_on)
        IS(MBM_PENDING, mbm_node_poll(n));
    OK(mbm_node_cancel(n));
    OK(mbm_node_setBlocking(n, 1));
    repeat(s, s->now + 10000, "11 03 02 00 2A +/11 03 02 00 2A +", 20, 150000);
    s->limit = 2000000;
    OK(sim_read_one(s));
    assert_int_equal(s->sent, 2);
    assert_in_range(s->now, 0, 500000);
}

SIM_TEST(a_flood_is_bounded_even_if_every_read_returns_bytes)
{
    static const uint8_t noise[8000] = {0};

    OK(mbm_node_setResponseTimeout(n, 1));
    s->character = 0;
    s->step = 250; /* so the flood lasts longer than the timeout and the gap */
    sim_deliver(s, 0, noise, sizeof noise);
    s->read_piece = 1;
    IS(MBM_LINE_BUSY, sim_read_one(s));
    assert_in_range(s->now, 1000, 10000);
}

static void writes_at_9600(sim *s, uint16_t write_piece, uint16_t write_busy)
{
    s->character = 1146;
    s->write_piece = write_piece;
    s->write_busy = write_busy;
    OK(mbm_line_setBaudRate(&s->line, 9600));
    OK(mbm_node_setResponseTimeout(&s->node, 100));
    sim_answer(s, 1, 500, "11 10 00 00 00 64 +");
    OK(mbm_node_writeMultipleRegisters(&s->node, 0, 100));
}

/* Reads a register, and returns how many microseconds that took. The device answers at once. */
static uint64_t time_of_a_read(sim *s)
{
    const uint64_t began = s->now;

    sim_answer(s, 1, 500, "11 03 02 00 2A +");
    OK(sim_read_one(s));
    assert_int_equal(s->response[0], 42);
    return s->now - began;
}

/* The device cannot have the request, so no late reply can come. */
SIM_TEST(a_request_of_which_the_port_took_no_byte_delays_no_later_reply)
{
    OK(mbm_node_setResponseTimeout(n, 100));
    s->write_never = 1;
    IS(MBM_LINE_BUSY, sim_read_one(s));
    s->write_never = 0;
    assert_in_range(time_of_a_read(s), 0, 20000);
}

SIM_TEST(a_request_of_which_the_port_took_a_part_delays_no_later_reply)
{
    OK(mbm_node_setResponseTimeout(n, 100));
    OK(mbm_node_setBlocking(n, 0));
    s->write_piece = 3;
    s->cut_allowed = 1;
    IS(MBM_PENDING, sim_read_one(s));
    while (s->counters.bytesSent == 0)
        IS(MBM_PENDING, mbm_node_poll(n));
    s->write_never = 1;
    while (mbm_node_poll(n) == MBM_PENDING)
        s->now += 1000;
    IS(MBM_LINE_BUSY, mbm_node_status(n));
    OK(mbm_node_setBlocking(n, 1));
    s->write_never = 0;
    s->write_piece = 0;
    assert_in_range(time_of_a_read(s), 0, 20000);
}

/* The port took the whole request, and no hook says whether it left: the device may have it. So the
 * next reply is held for a response timeout. */
SIM_TEST(a_request_whose_flush_never_ended_may_be_answered_late)
{
    OK(mbm_node_setResponseTimeout(n, 100));
    s->flush_never = 1;
    IS(MBM_LINE_BUSY, sim_read_one(s));
    s->flush_never = 0;
    assert_in_range(time_of_a_read(s), 100000, 300000);
}

/* On a slow line the port still accepts bytes, so it is not stuck. */
SIM_ROW(a_request_that_takes_longer_than_the_response_timeout_is_sent, writes_at_9600(s, 0, 0))
/* One byte in 1 ms. */
SIM_ROW(a_port_that_accepts_a_byte_now_and_then_is_not_busy, writes_at_9600(s, 1, 500))

SIM_TEST(a_gap_longer_than_the_timeout_is_waited_for)
{
    OK(mbm_node_setResponseTimeout(n, 3));
    gap_after_reply(s, 4000);
}

/* The client that is polled; NULL: the node. */
static mbm_client *polled;

static uint8_t poll(sim *s)
{
    return polled ? mbm_client_poll(polled) : mbm_node_poll(&s->node);
}

static uint32_t delay(sim *s)
{
    return polled ? mbm_client_pollDelay(polled) : mbm_node_pollDelay(&s->node);
}

static void poll_the_node(sim *s)
{
    polled = NULL;
    OK(mbm_node_setBlocking(&s->node, 0));
}

#define POLLED_TEST(name) SIM_TEST_WITH(name, poll_the_node)

/* Polls every `step` microseconds until a frame has begun. */
static void poll_until_a_frame_is_sent(sim *s, uint32_t step)
{
    for (const unsigned sent = s->sent; s->sent == sent; s->now += step)
        IS(MBM_PENDING, poll(s));
}

/* Polls a non-blocking request until it has ended, and sleeps for exactly the time of
 * pollDelay. */
static uint8_t poll_as_rarely_as_allowed(sim *s)
{
    uint8_t status;
    unsigned polls = 0;

    while ((status = poll(s)) == MBM_PENDING) {
        s->now += delay(s);
        assert_true(polls++ < 1000);
    }
    return status;
}

/* A poll does not take all of 407 bytes. The rest needs no wait, also after the deadline. */
POLLED_TEST(a_reply_behind_400_bytes_is_found_by_polls_without_a_wait)
{
    static const uint32_t pauses[] = {1000000, 3000000};

    s->character = 100;
    for (unsigned i = 0; i < COUNT(pauses); i++) {
        uint64_t at;

        sim_answer(s, 1, 0, TEN(TEN("12 07 + / ")) "11 03 02 00 2A +");
        IS(MBM_PENDING, sim_read_one(s));
        poll_until_a_frame_is_sent(s, 100);
        s->now += 1000;
        IS(MBM_PENDING, poll(s));
        s->now += pauses[i];
        at = s->now;
        OK(poll_as_rarely_as_allowed(s));
        assert_in_range(s->now - at, 0, 1000);
        assert_int_equal(s->response[0], 42);
    }
}

POLLED_TEST(sleeping_for_poll_delay_does_not_lengthen_a_timeout)
{
    OK(mbm_node_setResponseTimeout(n, 500));
    IS(MBM_PENDING, sim_read_one(s));
    IS(MBM_RESPONSE_TIMED_OUT, poll_as_rarely_as_allowed(s));
    sim_assert_time(s->now - s->frames[0].end, 500000);

    /* Each repetition waits for the quiet time and for its own reply. */
    OK(mbm_line_setRetries(&s->line, 2));
    uint64_t begin = s->now;
    IS(MBM_PENDING, sim_read_one(s));
    IS(MBM_RESPONSE_TIMED_OUT, poll_as_rarely_as_allowed(s));
    assert_int_equal(s->sent, 4);
    assert_in_range(s->now - begin, 1800000, 1800000 + 40 * s->character);
}

POLLED_TEST(sleeping_for_poll_delay_does_not_lengthen_a_turnaround_delay)
{
    OK(mbm_node_setSlaveID(n, 0));
    OK(mbm_line_setTurnaroundDelay(&s->line, 200));
    IS(MBM_PENDING, mbm_node_writeSingleRegister(n, 0, 1));
    OK(poll_as_rarely_as_allowed(s));
    sim_assert_time(s->now - s->frames[0].end, 200000);
}

POLLED_TEST(sleeping_for_poll_delay_does_not_lengthen_the_hold_of_a_reply)
{
    OK(mbm_node_setResponseTimeout(n, 500));
    IS(MBM_PENDING, sim_read_one(s));
    IS(MBM_RESPONSE_TIMED_OUT, poll_as_rarely_as_allowed(s));
    sim_answer(s, 1, 500, "11 03 02 00 2A +");
    IS(MBM_PENDING, sim_read_one(s));
    while (s->sent < 2 || s->now < s->frames[1].end + 2000) {
        IS(MBM_PENDING, mbm_node_poll(n));
        s->now += s->idle_step;
    }
    OK(poll_as_rarely_as_allowed(s));
    assert_in_range(s->now - s->last_byte, 500000, 500100);
}

/* Polls as pollDelay says, and every 20 us while it says 0, until the driver has been on and is off
 * again. Returns how often it polled meanwhile. */
static unsigned poll_while_the_frame_leaves(sim *s)
{
    const unsigned sent = s->sent;
    unsigned polls = 0;

    s->order_length = 0;
    while (s->sent == sent || s->driver_on) {
        uint32_t sleep;

        polls += s->sent > sent;
        IS(MBM_PENDING, poll(s));
        sleep = delay(s);
        s->now += sleep > 0 ? sleep : 20;
    }
    return polls;
}

/* The driver goes off as soon as the last bit has left. */
static void driver_goes_off_in_time(const sim *s)
{
    assert_in_range(sim_time_of(s, 'O'), s->transmitted, s->transmitted + 30);
}

/* Words to write, the characters of that frame. */
enum { LONGEST_WRITE = 123, LONGEST_FRAME = 9 + 2 * LONGEST_WRITE };

/* The rate that the program gives is for characters of 11 bits. */
static const struct leaving {
    uint32_t baud, character; /* the time of a character on the wire, in microseconds */
    uint16_t piece;           /* what the port takes at once; 0: all */
} leavings[] = {
    {9600, 1146, 0},   {9600, 1042, 0}, /* 8N1: ten bits */
    {9600, 1021, 0},                    /* and 2 % too fast */
    {19200, 573, 0},   {115200, 96, 0},   {115200, 85, 0},
    {9600, 1042, 200}, {9600, 1042, 128}, /* a port that takes the frame in two parts */
};

/* Lets a frame of `length` characters leave. At most an eighth of its time and two characters are
 * spent in polls of 20 us. */
static void sleeps_while_it_leaves(sim *s, const struct leaving *l, uint32_t length)
{
    unsigned polls;

    s->character = l->character;
    s->write_piece = l->piece;
    polls = poll_while_the_frame_leaves(s);
    driver_goes_off_in_time(s);
    if (l->piece == 0)
        assert_in_range(polls, 1, (length / 8 + 2) * s->character / 20);
}

POLLED_TEST(a_program_sleeps_while_a_frame_leaves)
{
    static const uint16_t quantities[] = {1, 2, 10, 60, LONGEST_WRITE};

    /* The unit is not left alone after a request that was cancelled. */
    OK(mbm_line_setQuietTime(&s->line, 0));
    for (unsigned i = 0; i < COUNT(leavings); i++)
        for (unsigned k = 0; k < COUNT(quantities); k++) {
            const uint32_t length = 9u + 2u * quantities[k];

            OK(mbm_line_setBaudRate(&s->line, leavings[i].baud));
            IS(MBM_PENDING, mbm_node_writeMultipleRegisters(n, 0, quantities[k]));
            sleeps_while_it_leaves(s, &leavings[i], length);
            assert_int_equal(s->frames[s->sent - 1].length, length);
            assert_int_equal(s->frames[s->sent - 1].end, s->transmitted);
            OK(mbm_node_cancel(n));
        }
}

/* Without a baud rate, the frame may leave at any time. */
POLLED_TEST(a_program_polls_while_a_frame_leaves_at_an_unknown_rate)
{
    IS(MBM_PENDING, mbm_node_writeMultipleRegisters(n, 0, LONGEST_WRITE));
    (void)poll_while_the_frame_leaves(s);
    driver_goes_off_in_time(s);
    OK(mbm_node_cancel(n));
}

POLLED_TEST(a_program_sleeps_while_the_driver_stays_on)
{
    OK(mbm_line_setBaudRate(&s->line, 9600));
    OK(mbm_line_setPostFlushHold(&s->line, 200));
    s->character = 100;
    s->flush_lies = 1;
    IS(MBM_PENDING, sim_read_one(s));
    unsigned polls = poll_while_the_frame_leaves(s);
    /* 200 characters of 11 bits after the frame has been written. */
    assert_in_range(sim_time_of(s, 'O') - sim_time_of(s, 'W'), 200 * 1146, 200 * 1147 + 100);
    assert_in_range(polls, 1, 4);
    OK(mbm_node_cancel(n));
}

static void begin_client(sim *s, unsigned framing)
{
    static mbm_client client;
    static uint8_t frame[MBM_MAX_ASCII_FRAME];

    memset(&client, 0, sizeof client);
    OK(client_begin(&client, framing, &s->port, frame, sizeof frame, NULL, 0));
    polled = &client;
}

SIM_TEST(a_program_with_a_client_sleeps_while_a_frame_leaves)
{
    static const uint16_t words[LONGEST_WRITE] = {0};

    for (unsigned ascii = 0; ascii <= 1; ascii++)
        for (unsigned i = 0; i < COUNT(leavings); i++) {
            mbm_clientRequest request = {.unit = 17, .data = words};

            if (ascii && leavings[i].piece)
                continue; /* the wire looks for the end of an RTU frame */
            begin_client(s, ascii ? MBM_FRAMING_ASCII : MBM_FRAMING_RTU);
            OK(mbm_client_setBaudRate(polled, leavings[i].baud));
            IS(MBM_PENDING, mbm_client_writeMultipleRegisters(polled, &request, 0, LONGEST_WRITE));
            sleeps_while_it_leaves(s, &leavings[i], (1 + ascii) * LONGEST_FRAME);
            OK(mbm_client_cancel(polled, &request));
            s->cut_allowed += ascii;
        }
}

/* Polls until a frame is sent, which is after a silence of 2 to the 31 microseconds. A longer gap
 * could not be measured with the clock, so it would not be kept at all. */
static void keeps_the_longest_gap(sim *s, uint64_t begin)
{
    const unsigned sent = s->sent;

    while (s->now < begin + 0x7FFF0000) {
        IS(MBM_PENDING, poll(s));
        assert_int_equal(s->sent, sent);
        s->now += 1000000;
    }
    poll_until_a_frame_is_sent(s, 1000);
    assert_true(s->now < begin + 0x80100000);
}

POLLED_TEST(the_longest_gap_is_2_to_the_31_microseconds)
{
    static const uint32_t gaps[] = {0x80000000, 0x80000001, 0xFFFF0000, 0xFFFFFFFE, 0xFFFFFFFF};

    s->limit = UINT64_MAX;
    for (unsigned i = 0; i < COUNT(gaps); i++) {
        uint64_t begin = s->now;

        OK(mbm_line_setGap(&s->line, gaps[i]));
        OK(mbm_line_used(&s->line));
        IS(MBM_PENDING, sim_read_one(s));
        keeps_the_longest_gap(s, begin);
        OK(mbm_node_cancel(n));
    }
}

SIM_TEST(the_longest_gap_of_a_client_is_2_to_the_31_microseconds)
{
    mbm_clientRequest request = {.unit = 17};

    s->limit = UINT64_MAX;
    begin_client(s, MBM_FRAMING_RTU);
    OK(mbm_client_setGap(polled, 0xFFFFFFFF));
    IS(MBM_PENDING, mbm_client_writeSingleRegister(polled, &request, 0, 1));
    keeps_the_longest_gap(s, 0);
    OK(mbm_client_cancel(polled, &request));
}
