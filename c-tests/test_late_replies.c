/* A device that answers in order, but later than the response timeout. Its late reply looks
 * like the answer to the next request: an RTU frame has no number that distinguishes them.
 * No late reply may become the data of a later request. On a simulated clock; unit 17 is 11
 * on the wire. */
#include "crc.h"
#include "faults.h"
#include "sim.h"
#include "test.h"

enum {
    TIMEOUT_MS = 500,
    LATE = 750000,  /* microseconds that the device takes for a late reply */
    PROMPT = 3000,  /* microseconds that it takes for all others */
    QUIET = 100000, /* the default quiet time */
    REGISTERS = 125 /* the most registers of a reply */
};

/* The device, and the microseconds that it takes for each of the next requests. After those
 * it takes PROMPT. */
typedef struct in_order {
    uint32_t takes[8];
    unsigned requests;
    uint64_t free;     /* when its last reply has been sent */
    uint8_t exception; /* the exception with which it answers the first request */
    unsigned cut;      /* the number of the reply that loses its second half; the first is 1 */
    unsigned damaged;  /* the number of the reply that arrives damaged; the first is 1 */
    unsigned trailing; /* bytes 0x00 that its driver adds to each reply */
} in_order;

static void answer_in_order(sim *s, const sim_frame *request)
{
    in_order *d = (in_order *)s->context;
    unsigned number = d->requests + 1;
    uint32_t takes = number <= 8 && d->takes[number - 1] ? d->takes[number - 1] : PROMPT;
    uint64_t at = (d->free > request->end ? d->free : request->end) + takes;
    uint8_t frame[300] = {0};
    size_t length = fault_right_reply(frame, request->bytes);

    if (request->bytes[0] != 17) { /* another device, which is never late */
        sim_deliver(s, request->end + PROMPT, frame, length);
        return;
    }
    d->requests = number;
    if (number == 1 && d->exception) {
        frame[1] |= 0x80;
        frame[2] = d->exception;
        length = seal(frame, 3);
    }
    if (number == d->damaged)
        frame[length - 1] ^= 0x40;
    if (number == d->cut)
        length /= 2;
    memset(frame + length, 0, d->trailing);
    length += d->trailing;
    sim_deliver(s, at, frame, length);
    d->free = at + length * s->character;
}

static in_order device;

/* The simulation with such a device. Its first reply is late. */
static void begin_device(sim *s)
{
    device = (in_order){.takes = {LATE}};
    s->limit = 2000000000;
    s->device = answer_in_order;
    s->context = &device;
    OK(mbm_node_setResponseTimeout(&s->node, TIMEOUT_MS));
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
    assert_int_equal(read_at(s, 0), MBM_RESPONSE_TIMED_OUT);
    for (uint16_t i = 1; i < 100; i++)
        assert_reads(s, i, 1);
    assert_int_equal(s->counters.foreignFrames, 1);
}

DEVICE_TEST(a_late_reply_does_not_shift_the_answers_after_a_retry)
{
    device.takes[1] = 50000; /* longer than the gap before the next request */
    OK(mbm_line_setRetries(&s->line, 1));
    for (uint16_t i = 0; i < 100; i++)
        assert_reads(s, i, 1);
}

/* The frame buffer has space for one reply of this length, not for two. */
DEVICE_TEST(a_late_reply_of_the_longest_length_does_not_shift_later_answers)
{
    assert_int_equal(mbm_node_readHoldingRegisters(n, 0, REGISTERS), MBM_RESPONSE_TIMED_OUT);
    for (uint16_t i = 1; i < 10; i++)
        assert_reads(s, (uint16_t)(i * REGISTERS), REGISTERS);
}

DEVICE_TEST(a_late_reply_to_a_write_of_the_same_value_costs_one_request)
{
    assert_int_equal(mbm_node_writeSingleRegister(n, 1, 5), MBM_RESPONSE_TIMED_OUT);
    for (unsigned i = 0; i < 10; i++)
        OK(mbm_node_writeSingleRegister(n, 1, 5));
    assert_reads(s, 9, 1);
}

DEVICE_TEST(several_late_replies_in_a_row_are_all_skipped)
{
    uint16_t i;

    device.takes[0] = 1700000; /* after two more requests */
    for (i = 0; i < 3; i++)
        assert_int_equal(read_at(s, i), i < 2 ? MBM_RESPONSE_TIMED_OUT : MBM_OK);
    assert_int_equal(s->response[0], fault_value(2));
    for (; i < 50; i++)
        assert_reads(s, i, 1);
}

/* The reply is held beyond the response timeout. */
DEVICE_TEST(a_late_reply_just_before_the_deadline_of_the_next_request_is_no_answer)
{
    device.takes[0] = 1000 * (TIMEOUT_MS + TIMEOUT_MS) + QUIET - 1000;
    assert_int_equal(read_at(s, 0), MBM_RESPONSE_TIMED_OUT);
    for (uint16_t i = 1; i < 50; i++)
        assert_reads(s, i, 1);
}

DEVICE_TEST(a_late_exception_is_not_the_answer_to_a_later_request)
{
    static const uint8_t codes[] = {2, 5, 6, 0x0B};

    for (unsigned i = 0; i < COUNT(codes); i++) {
        memset(&device, 0, sizeof device);
        device.takes[0] = LATE;
        device.exception = codes[i];
        assert_int_equal(read_at(s, 0), MBM_RESPONSE_TIMED_OUT);
        assert_reads(s, 1, 1);
        assert_int_equal(mbm_node_getExceptionCode(n), 0);
        assert_reads(s, 2, 1);
    }
}

DEVICE_TEST(after_an_exception_in_time_no_reply_is_held)
{
    device.takes[0] = 0;
    device.exception = 5;
    assert_int_equal(read_at(s, 0), 5);
    assert_reads(s, 1, 1);
    /* An exception is an answer, so no reply is late or held. */
    sim_assert_time(s->frames[1].silence, 4000);
}

/* The reply that was held first is most likely the late one. */
DEVICE_TEST(a_held_reply_is_no_answer_if_the_next_one_is_damaged)
{
    device.damaged = 2;
    assert_int_equal(read_at(s, 0), MBM_RESPONSE_TIMED_OUT);
    assert_int_equal(read_at(s, 1), MBM_INVALID_CRC);
    assert_int_equal(s->response[0], 0);
    assert_reads(s, 2, 1);
    assert_reads(s, 3, 1);
}

DEVICE_TEST(a_held_reply_is_no_answer_if_the_next_one_is_cut_off)
{
    device.cut = 2;
    assert_int_equal(read_at(s, 0), MBM_RESPONSE_TIMED_OUT);
    assert_int_equal(read_at(s, 1), MBM_RESPONSE_TIMED_OUT);
    assert_int_equal(s->response[0], 0);
    assert_reads(s, 2, 1);
    assert_reads(s, 3, 1);
}

/* A driver of RS-485 that releases the line can do this. */
DEVICE_TEST(a_byte_of_noise_after_a_held_reply_does_not_spoil_it)
{
    device.trailing = 1;
    assert_int_equal(read_at(s, 0), MBM_RESPONSE_TIMED_OUT);
    for (uint16_t i = 1; i < 10; i++)
        assert_reads(s, i, 1);
    device.requests = 0;
    assert_int_equal(mbm_node_readHoldingRegisters(n, 0, REGISTERS), MBM_RESPONSE_TIMED_OUT);
    for (uint16_t i = 1; i < 10; i++)
        assert_reads(s, (uint16_t)(i * REGISTERS), REGISTERS);
}

DEVICE_TEST(after_a_timeout_the_next_reply_costs_one_more_response_timeout_and_nothing_else)
{
    device.takes[0] = 0xFFFFFFFF; /* no reply */
    assert_int_equal(read_at(s, 0), MBM_RESPONSE_TIMED_OUT);
    memset(&device, 0, sizeof device);
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
    device.takes[0] = 0;
    device.damaged = 1;
    assert_int_equal(read_at(s, 0), MBM_INVALID_CRC);
    assert_reads(s, 1, 1);
    assert_in_range(s->now - s->last_byte, QUIET, QUIET + SIM_SLACK);
}

DEVICE_TEST(a_program_that_polls_late_does_not_lengthen_the_hold)
{
    device.takes[0] = 0;
    device.damaged = 1;
    OK(mbm_node_setBlocking(n, 0));
    assert_int_equal(read_at(s, 0), MBM_PENDING);
    while (s->sent == 0 || s->now < s->frames[0].end + 1000) {
        assert_int_equal(mbm_node_poll(n), MBM_PENDING);
        s->now += 100;
    }
    s->now += 600000000;
    while (mbm_node_poll(n) == MBM_PENDING)
        s->now += 100;
    assert_int_equal(mbm_node_status(n), MBM_INVALID_CRC);
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

    device.takes[0] = 0;
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

    device.takes[0] = 0;
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
    device.takes[0] = 0xFFFFFFFF;
    assert_int_equal(read_at(s, 0), MBM_RESPONSE_TIMED_OUT);
    memset(&device, 0, sizeof device);
    assert_reads(s, 1, 1);
    assert_in_range(s->now - s->last_byte, 0, SIM_SLACK);
}

/* Unit 18 answers between the failed request to unit 17 and the late reply. */
DEVICE_TEST(the_reply_of_another_unit_does_not_end_the_holding)
{
    assert_int_equal(read_at(s, 0), MBM_RESPONSE_TIMED_OUT);
    OK(mbm_node_setSlaveID(n, 18));
    assert_reads(s, 5, 1);
    sim_assert_time(s->now - s->last_byte, 0);
    OK(mbm_node_setSlaveID(n, 17));
    assert_reads(s, 1, 1);
    assert_reads(s, 2, 1);
}

static uint8_t run(sim *s, mbm_client *client, const mbm_clientRequest *request)
{
    while (mbm_client_poll(client) == MBM_PENDING && request->status == MBM_PENDING)
        s->now += s->idle_step;
    return request->status;
}

static void client_reads(sim *s, mbm_client *client, uint16_t address, uint8_t status)
{
    mbm_clientRequest request = {0};
    uint16_t word = 0;

    request.unit = 17;
    request.reply = &word;
    request.replyBytes = sizeof word;
    assert_int_equal(mbm_client_readHoldingRegisters(client, &request, address, 1), MBM_PENDING);
    assert_int_equal(run(s, client, &request), status);
    if (status == MBM_OK)
        assert_int_equal(word, fault_value(address));
}

static void begin_client(sim *s, mbm_client *client)
{
    memset(client, 0, sizeof *client);
    OK(mbm_client_beginRtu(client, &s->port, s->buffer, sizeof s->buffer));
    OK(mbm_client_setResponseTimeout(client, TIMEOUT_MS));
}

DEVICE_TEST(one_late_reply_does_not_shift_the_clients_answers)
{
    mbm_client client;

    begin_client(s, &client);
    client_reads(s, &client, 0, MBM_RESPONSE_TIMED_OUT);
    for (uint16_t i = 1; i < 100; i++)
        client_reads(s, &client, i, MBM_OK);
}

DEVICE_TEST(a_late_reply_does_not_shift_the_clients_answers_after_a_retry)
{
    mbm_client client;

    begin_client(s, &client);
    OK(mbm_client_setRetries(&client, 1));
    device.takes[1] = 50000;
    for (uint16_t i = 0; i < 100; i++)
        client_reads(s, &client, i, MBM_OK);
}

/* Return Query Data with data that no other request has. */
static uint8_t echoes(sim *s, mbm_client *client, uint16_t data)
{
    mbm_clientRequest request = {0};
    uint16_t reply = 0;

    request.unit = 17;
    request.data = &data;
    request.reply = &reply;
    request.replyBytes = sizeof reply;
    assert_int_equal(mbm_client_diagnostics(client, &request, 0, 1), MBM_PENDING);
    return run(s, client, &request);
}

/* So this request finds out at once whether the answers are in step. */
DEVICE_TEST(a_reply_that_repeats_data_of_its_own_is_not_held)
{
    mbm_client client;

    begin_client(s, &client);
    device.takes[0] = LATE + 200000;
    client_reads(s, &client, 0, MBM_RESPONSE_TIMED_OUT);
    OK(echoes(s, &client, 0xA55A));
    assert_in_range(s->now - s->last_byte, 0, SIM_SLACK);
    client_reads(s, &client, 1, MBM_OK);
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
    device.takes[0] = 0xFFFFFFFF;
    for (unsigned i = 0; i < 40; i++)
        assert_int_equal(read_at(s, 0), MBM_RESPONSE_TIMED_OUT);
    s->device = NULL;
    /* One reply every 80 ms, from the end of the next request on. */
    for (at = s->now + QUIET + 10000; at < s->now + 4000000; at += 80000)
        sim_deliver(s, at, frame, length);
    at = s->now;
    assert_int_equal(read_at(s, 7), MBM_RESPONSE_TIMED_OUT);
    assert_in_range(s->now - at, 1000 * TIMEOUT_MS, 1000 * 3 * TIMEOUT_MS + QUIET + 1000);
}

/* The late reply, then the one to the request. The unit owes no other, so it is not held. */
DEVICE_TEST(the_last_reply_that_the_unit_owes_is_delivered_at_once)
{
    device.takes[0] = LATE;
    assert_int_equal(read_at(s, 0), MBM_RESPONSE_TIMED_OUT);
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

    device.takes[0] = 0xFFFFFFFF;
    assert_int_equal(read_at(s, 0), MBM_RESPONSE_TIMED_OUT);
    s->device = NULL;
    /* The last reply arrives shortly before the wait is over. */
    for (at = s->now + QUIET + 10000; at < s->now + QUIET + 1000 * 3 * TIMEOUT_MS - 30000;
         at += 10000)
        sim_deliver(s, at, frame, length);
    OK(mbm_node_setBlocking(n, 0));
    assert_int_equal(read_at(s, 7), MBM_PENDING);
    while (mbm_node_poll(n) == MBM_PENDING) {
        uint64_t next = s->now + mbm_node_pollDelay(n);

        if (s->first < s->last && s->incoming[s->first].at < next)
            next = s->incoming[s->first].at;
        s->now = next > s->now ? next : s->now + 1;
    }
    sent = s->frames[s->sent - 1].end;
    assert_in_range(s->now - sent, 0, 1000 * 3 * TIMEOUT_MS + 1000);
}
