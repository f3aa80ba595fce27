/* A device that answers in order, but later than the response timeout. Its late reply looks
 * like the answer to the next request: an RTU frame has no number that distinguishes them.
 * No late reply may become the data of a later request. On a simulated clock; unit 17 is 11
 * on the wire. */
#include "faults.h"
#include "reader.h"
#include "test.h"

enum {
    TIMEOUT_MS = 500,
    LATE = 750 * MS,  /* what the device takes for a late reply; PROMPT for all others */
    QUIET = 100 * MS, /* the default quiet time */
    REGISTERS = 125   /* the most registers of a reply */
};

static bench line;
static device *d;

static void begin(sim *s, reader_kind kind)
{
    bench_begin(&line, s, kind, TIMEOUT_MS * MS);
    OK(mbm_node_setBlocking(&s->node, 1));
    d = bench_add(&line, UNIT, PROMPT);
    device_is_late(d, LATE);
    bench_add(&line, 18, PROMPT);
}

/* The simulation with a device whose first reply is late. */
static void begin_device(sim *s)
{
    begin(s, NODE_READS);
}

/* From now on the device is as new, and in time. */
static void renew(void)
{
    *d = (device){.unit = UNIT, .takes = PROMPT};
}

#define DEVICE_TEST(name) SIM_TEST_WITH(name, begin_device)

static void assert_reads(sim *s, uint16_t address, uint16_t quantity)
{
    OK(mbm_node_readHoldingRegisters(&s->node, address, quantity));
    for (uint16_t i = 0; i < quantity; i++)
        assert_int_equal(s->response[i], fault_value(address + i));
}

static uint8_t read_at(sim *s, uint16_t address)
{
    return mbm_node_readHoldingRegisters(&s->node, address, 1);
}

DEVICE_TEST(one_late_reply_does_not_shift_the_answers_of_later_requests)
{
    IS(MBM_RESPONSE_TIMED_OUT, read_at(s, 0));
    for (uint16_t i = 1; i < 100; i++)
        assert_reads(s, i, 1);
    assert_int_equal(s->counters.foreignFrames, 1);
}

DEVICE_TEST(a_late_reply_does_not_shift_the_answers_after_a_retry)
{
    d->takes = 50000; /* longer than the gap before the next request */
    OK(mbm_line_setRetries(&s->line, 1));
    for (uint16_t i = 0; i < 100; i++)
        assert_reads(s, i, 1);
}

/* The frame buffer has space for one reply of this length, not for two. */
DEVICE_TEST(a_late_reply_of_the_longest_length_does_not_shift_later_answers)
{
    IS(MBM_RESPONSE_TIMED_OUT, mbm_node_readHoldingRegisters(n, 0, REGISTERS));
    for (uint16_t i = 1; i < 10; i++)
        assert_reads(s, (uint16_t)(i * REGISTERS), REGISTERS);
}

DEVICE_TEST(a_late_reply_to_a_write_of_the_same_value_costs_one_request)
{
    IS(MBM_RESPONSE_TIMED_OUT, mbm_node_writeSingleRegister(n, 1, 5));
    for (unsigned i = 0; i < 10; i++)
        OK(mbm_node_writeSingleRegister(n, 1, 5));
    assert_reads(s, 9, 1);
}

DEVICE_TEST(several_late_replies_in_a_row_are_all_skipped)
{
    uint16_t i;

    d->takes_for_late = 1700000; /* after two more requests */
    for (i = 0; i < 3; i++)
        assert_int_equal(read_at(s, i), i < 2 ? MBM_RESPONSE_TIMED_OUT : MBM_OK);
    assert_int_equal(s->response[0], fault_value(2));
    for (; i < 50; i++)
        assert_reads(s, i, 1);
}

/* The reply is held beyond the response timeout. */
DEVICE_TEST(a_late_reply_just_before_the_deadline_of_the_next_request_is_no_answer)
{
    d->takes_for_late = 1000 * (TIMEOUT_MS + TIMEOUT_MS) + QUIET - 1000;
    IS(MBM_RESPONSE_TIMED_OUT, read_at(s, 0));
    for (uint16_t i = 1; i < 50; i++)
        assert_reads(s, i, 1);
}

DEVICE_TEST(a_late_exception_is_not_the_answer_to_a_later_request)
{
    static const uint8_t codes[] = {2, 5, 6, 0x0B};

    for (unsigned i = 0; i < COUNT(codes); i++) {
        renew();
        device_is_late(d, LATE);
        d->exception = codes[i];
        IS(MBM_RESPONSE_TIMED_OUT, read_at(s, 0));
        assert_reads(s, 1, 1);
        assert_int_equal(mbm_node_getExceptionCode(n), 0);
        assert_reads(s, 2, 1);
    }
}

DEVICE_TEST(after_an_exception_in_time_no_reply_is_held)
{
    d->late = 0;
    d->exception = 5;
    assert_int_equal(read_at(s, 0), 5);
    assert_reads(s, 1, 1);
    /* An exception is an answer, so no reply is late or held. */
    sim_assert_time(s->frames[1].silence, 4000);
}

/* The reply that was held first is most likely the late one. */
DEVICE_TEST(a_held_reply_is_no_answer_if_the_next_one_is_damaged)
{
    d->damaged = 2;
    IS(MBM_RESPONSE_TIMED_OUT, read_at(s, 0));
    IS(MBM_INVALID_CRC, read_at(s, 1));
    assert_int_equal(s->response[0], 0);
    assert_reads(s, 2, 1);
    assert_reads(s, 3, 1);
}

DEVICE_TEST(a_held_reply_is_no_answer_if_the_next_one_is_cut_off)
{
    d->cut = 2;
    IS(MBM_RESPONSE_TIMED_OUT, read_at(s, 0));
    IS(MBM_RESPONSE_TIMED_OUT, read_at(s, 1));
    assert_int_equal(s->response[0], 0);
    assert_reads(s, 2, 1);
    assert_reads(s, 3, 1);
}

/* A driver of RS-485 that releases the line can do this. */
DEVICE_TEST(a_byte_of_noise_after_a_held_reply_does_not_spoil_it)
{
    d->trailing = 1;
    IS(MBM_RESPONSE_TIMED_OUT, read_at(s, 0));
    for (uint16_t i = 1; i < 10; i++)
        assert_reads(s, i, 1);
    d->requests = 0;
    IS(MBM_RESPONSE_TIMED_OUT, mbm_node_readHoldingRegisters(n, 0, REGISTERS));
    for (uint16_t i = 1; i < 10; i++)
        assert_reads(s, (uint16_t)(i * REGISTERS), REGISTERS);
}

DEVICE_TEST(after_a_timeout_the_next_reply_costs_one_more_response_timeout_and_nothing_else)
{
    d->takes_for_late = 0xFFFFFFFF; /* no reply */
    IS(MBM_RESPONSE_TIMED_OUT, read_at(s, 0));
    renew();
    assert_reads(s, 1, 1);
    assert_in_range(s->now - s->last_byte, 1000 * TIMEOUT_MS, 1000 * TIMEOUT_MS + SIM_SLACK);
    uint64_t begin = s->now;
    assert_reads(s, 2, 1);
    assert_in_range(s->now - begin, 0, PROMPT + 20 * s->character + SIM_SLACK);
    assert_in_range(s->now - s->last_byte, 0, SIM_SLACK);
}

/* The damaged reply has come, so none is late. */
DEVICE_TEST(after_a_damaged_reply_the_next_reply_costs_one_quiet_time)
{
    d->late = 0;
    d->damaged = 1;
    IS(MBM_INVALID_CRC, read_at(s, 0));
    assert_reads(s, 1, 1);
    assert_in_range(s->now - s->last_byte, QUIET, QUIET + SIM_SLACK);
}

DEVICE_TEST(a_program_that_polls_late_does_not_lengthen_the_hold)
{
    d->late = 0;
    d->damaged = 1;
    OK(mbm_node_setBlocking(n, 0));
    IS(MBM_PENDING, read_at(s, 0));
    while (s->sent == 0 || s->now < s->frames[0].end + 1000) {
        IS(MBM_PENDING, mbm_node_poll(n));
        s->now += 100;
    }
    s->now += 600000000;
    while (mbm_node_poll(n) == MBM_PENDING)
        s->now += 100;
    IS(MBM_INVALID_CRC, mbm_node_status(n));
    OK(mbm_node_setBlocking(n, 1));
    assert_reads(s, 1, 1);
    assert_in_range(s->now - s->last_byte, QUIET, QUIET + SIM_SLACK);
}

/* The line is free, so the reply belongs to an earlier request, and another may follow. */
DEVICE_TEST(a_right_reply_before_a_request_lets_the_next_one_be_held)
{
    uint8_t frame[16];
    const uint8_t request[6] = {17, 3, 0, 7, 0, 1};
    size_t length = fault_right_reply(frame, request);

    d->late = 0;
    assert_reads(s, 0, 1);
    sim_deliver(s, s->now + 10000, frame, length);
    s->now += 50000;
    assert_reads(s, 1, 1);
    assert_true(s->frames[1].silence >= QUIET);
    assert_in_range(s->now - s->last_byte, 1000 * TIMEOUT_MS, 1000 * TIMEOUT_MS + SIM_SLACK);
    assert_reads(s, 2, 1);
    assert_in_range(s->now - s->last_byte, 0, SIM_SLACK);
}

DEVICE_TEST(noise_and_other_replies_before_a_request_let_no_reply_be_held)
{
    uint8_t frame[16];
    const uint8_t request[6] = {17, 3, 0, 7, 0, 2};
    size_t length = fault_right_reply(frame, request);

    d->late = 0;
    assert_reads(s, 0, 1);
    sim_deliver(s, s->now + 10000, frame, length); /* two registers */
    sim_deliver(s, s->now + 20000, (const uint8_t *)"\0\x11\x03", 3);
    s->now += 50000;
    assert_reads(s, 1, 1);
    assert_in_range(s->now - s->last_byte, 0, SIM_SLACK);
    sim_assert_sent(s, 1, "11 03 00 01 00 01 +");
}

DEVICE_TEST(without_a_quiet_time_no_reply_is_held)
{
    OK(mbm_line_setQuietTime(&s->line, 0));
    d->takes_for_late = 0xFFFFFFFF;
    IS(MBM_RESPONSE_TIMED_OUT, read_at(s, 0));
    renew();
    assert_reads(s, 1, 1);
    assert_in_range(s->now - s->last_byte, 0, SIM_SLACK);
}

/* Unit 18 answers between the failed request to unit 17 and the late reply. */
DEVICE_TEST(the_reply_of_another_unit_does_not_end_the_holding)
{
    IS(MBM_RESPONSE_TIMED_OUT, read_at(s, 0));
    OK(mbm_node_setSlaveID(n, 18));
    assert_reads(s, 5, 1);
    sim_assert_time(s->now - s->last_byte, 0);
    OK(mbm_node_setSlaveID(n, 17));
    assert_reads(s, 1, 1);
    assert_reads(s, 2, 1);
}

DEVICE_TEST(one_late_reply_does_not_shift_the_clients_answers)
{
    begin(s, CLIENT_READS);
    IS(MBM_RESPONSE_TIMED_OUT, bench_reads(&line, UNIT, 0, NEVER));
    for (uint16_t i = 1; i < 100; i++)
        OK(bench_reads(&line, UNIT, i, NEVER));
}

DEVICE_TEST(a_late_reply_does_not_shift_the_clients_answers_after_a_retry)
{
    begin(s, CLIENT_READS);
    OK(mbm_client_setRetries(&line.client, 1));
    d->takes = 50000;
    for (uint16_t i = 0; i < 100; i++)
        OK(bench_reads(&line, UNIT, i, NEVER));
}

/* Return Query Data with data that no other request has. */
static uint8_t echoes(sim *s, uint16_t data)
{
    uint16_t reply = 0;
    mbm_clientRequest request = {
        .unit = UNIT, .data = &data, .reply = &reply, .replyBytes = sizeof reply};

    IS(MBM_PENDING, mbm_client_diagnostics(&line.client, &request, 0, 1));
    while (mbm_client_poll(&line.client) == MBM_PENDING && request.status == MBM_PENDING)
        s->now += s->idle_step;
    return request.status;
}

/* So this request finds out at once whether the answers are in step. */
DEVICE_TEST(a_reply_that_repeats_data_of_its_own_is_not_held)
{
    begin(s, CLIENT_READS);
    d->takes_for_late = LATE + 200000;
    IS(MBM_RESPONSE_TIMED_OUT, bench_reads(&line, UNIT, 0, NEVER));
    OK(echoes(s, 0xA55A));
    assert_in_range(s->now - s->last_byte, 0, SIM_SLACK);
    OK(bench_reads(&line, UNIT, 1, NEVER));
    assert_in_range(s->now - s->last_byte, 0, SIM_SLACK);
}

/* A request must end, however many right replies arrive. */
DEVICE_TEST(a_device_that_never_stops_answering_does_not_keep_a_request_from_ending)
{
    uint8_t frame[16];
    const uint8_t request[6] = {17, 3, 0, 7, 0, 1};
    size_t length = fault_right_reply(frame, request);
    uint64_t at;

    /* The device owes more replies than are counted, so each one is held. */
    d->takes_for_late = 0xFFFFFFFF;
    for (unsigned i = 0; i < 40; i++)
        IS(MBM_RESPONSE_TIMED_OUT, read_at(s, 0));
    s->device = NULL;
    /* One reply every 80 ms, from the end of the next request on. */
    for (at = s->now + QUIET + 10000; at < s->now + 4000000; at += 80000)
        sim_deliver(s, at, frame, length);
    at = s->now;
    IS(MBM_RESPONSE_TIMED_OUT, read_at(s, 7));
    assert_in_range(s->now - at, 1000 * TIMEOUT_MS, 1000 * 3 * TIMEOUT_MS + QUIET + 1000);
}

/* The late reply, then the one to the request. The unit owes no other, so it is not held. */
DEVICE_TEST(the_last_reply_that_the_unit_owes_is_delivered_at_once)
{
    d->takes_for_late = LATE;
    IS(MBM_RESPONSE_TIMED_OUT, read_at(s, 0));
    for (uint16_t i = 1; i < 4; i++) {
        OK(read_at(s, i));
        assert_int_equal(s->response[0], fault_value(i));
        assert_in_range(s->now - s->last_byte, 0, SIM_SLACK);
    }
}

/* The program polls when a byte has arrived, and else when mbm_node_pollDelay says. */
DEVICE_TEST(a_program_that_sleeps_as_pollDelay_says_waits_for_three_timeouts_at_most)
{
    uint8_t frame[16];
    const uint8_t request[6] = {17, 3, 0, 7, 0, 1};
    size_t length = fault_right_reply(frame, request);
    uint64_t at, sent;

    d->takes_for_late = 0xFFFFFFFF;
    IS(MBM_RESPONSE_TIMED_OUT, read_at(s, 0));
    s->device = NULL;
    /* The last reply arrives shortly before the wait is over. */
    for (at = s->now + QUIET + 10000; at < s->now + QUIET + 1000 * 3 * TIMEOUT_MS - 30000;
         at += 10000)
        sim_deliver(s, at, frame, length);
    OK(mbm_node_setBlocking(n, 0));
    IS(MBM_PENDING, read_at(s, 7));
    while (mbm_node_poll(n) == MBM_PENDING)
        sleep_until_a_byte(s, mbm_node_pollDelay(n), UINT64_MAX);
    sent = s->frames[s->sent - 1].end;
    assert_in_range(s->now - sent, 0, 1000 * 3 * TIMEOUT_MS + 1000);
}
