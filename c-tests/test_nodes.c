/* Several nodes on one line: one request at a time, each with its own unit, words and status. */
#include "every_call.h"
#include "sim.h"
#include "test.h"

typedef struct other {
    mbm_node node;
    uint16_t words[4];
} other;

static other o;

/* A node of unit 3 on the simulation's line. */
static void begin_other(sim *s)
{
    memset(&o, 0, sizeof o);
    OK(mbm_node_begin(&o.node, &s->line, 3, o.words, 4, NULL, 0));
}

#define NODES_TEST(name) SIM_TEST_WITH(name, begin_other)

static void other_reads(sim *s)
{
    sim_answer(s, 1, 500, "03 04 02 00 07 +");
    OK(mbm_node_readInputRegisters(&o.node, 0, 1));
    assert_int_equal(o.words[0], 7);
}

NODES_TEST(the_gap_counts_from_the_last_use_by_any_node)
{
    sim_reads(s, 500);
    other_reads(s);
    sim_assert_time(s->frames[1].silence, 4000);
    sim_reads(s, 500);
    sim_assert_time(s->frames[2].silence, 4000);
    s->now += 10000;
    uint64_t asked = s->now;
    other_reads(s);
    sim_assert_time(s->frames[3].begin - asked, 0);
}

NODES_TEST(each_node_keeps_its_result)
{
    OK(mbm_node_setResponseTimeout(&o.node, 50));
    sim_reads(s, 500);
    sim_answer(s, 1, 500, "03 84 02 +");
    IS(2, mbm_node_readInputRegisters(&o.node, 0, 1));
    OK(mbm_node_status(n));
    assert_int_equal(mbm_node_getExceptionCode(n), 0);
    assert_int_equal(mbm_node_getExceptionCode(&o.node), 2);
    assert_int_equal(mbm_node_available(n), 1);
    assert_int_equal(mbm_node_receive(n), 42);
    assert_int_equal(mbm_node_available(&o.node), 0);
}

NODES_TEST(a_request_is_refused_while_another_node_has_one_pending)
{
    OK(mbm_node_setBlocking(n, 0));
    sim_answer(s, 1, 500, "11 03 02 00 2A +");
    IS(MBM_PENDING, sim_read_one(s));
    IS(MBM_BUSY, mbm_node_readInputRegisters(&o.node, 0, 1));
    OK(mbm_node_status(&o.node));
    /* The calls of the other one change nothing. */
    OK(mbm_node_poll(&o.node));
    OK(mbm_node_cancel(&o.node));
    assert_true(mbm_node_pollDelay(&o.node) == UINT32_MAX);
    begin_other(s);
    OK(sim_poll(s));
    assert_int_equal(s->response[0], 42);
    other_reads(s);
}

static unsigned tried;
static void (*driver_on)(void *context);

static void try_the_other_node(void *context)
{
    driver_on(context);
    IS(MBM_BUSY, mbm_node_readInputRegisters(&o.node, 0, 1));
    OK(mbm_node_status(&o.node));
    OK(mbm_node_poll(&o.node));
    OK(mbm_node_cancel(&o.node));
    OK(mbm_node_setSlaveID(&o.node, 4));
    assert_int_equal(mbm_node_receive(&o.node), 7);
    tried++;
}

NODES_TEST(a_hook_may_use_another_node_but_not_for_a_request)
{
    tried = 0;
    other_reads(s);
    driver_on = s->port.preTransmission;
    s->port.preTransmission = try_the_other_node;
    sim_answer(s, 1, 500, "11 03 02 00 2A +");
    OK(mbm_node_readHoldingRegisters(n, 0, 1));
    assert_int_equal(tried, 1);
    assert_int_equal(mbm_node_getSlaveID(&o.node), 4);
}

NODES_TEST(the_idle_hook_is_given_the_node_that_waits)
{
    sim_reads(s, 500);
    assert_ptr_equal(s->waits, n);
    other_reads(s);
    assert_ptr_equal(s->waits, &o.node);
}

NODES_TEST(a_request_that_the_line_has_given_up_is_cancelled)
{
    OK(mbm_node_setBlocking(n, 0));
    IS(MBM_PENDING, sim_read_one(s));
    OK(mbm_line_cancel(&s->line));
    other_reads(s);
    IS(MBM_PENDING, mbm_node_status(n));
    IS(MBM_CANCELLED, mbm_node_poll(n));
    IS(MBM_CANCELLED, mbm_node_status(n));
    OK(mbm_line_cancel(&s->line));
}

NODES_TEST(a_lost_node_blocks_its_line_until_that_is_cancelled)
{
    OK(mbm_node_setBlocking(&o.node, 0));
    IS(MBM_PENDING, mbm_node_readInputRegisters(&o.node, 0, 1));
    memset(&o, 0xA5, sizeof o); /* its memory may be used for something else */
    IS(MBM_BUSY, sim_read_one(s));
    IS(MBM_BUSY, mbm_line_beginRtu(&s->line, &s->port, s->buffer, MBM_MAX_FRAME));
    OK(mbm_line_cancel(&s->line));
    sim_reads(s, 500);
}

SIM_TEST(the_request_of_a_node_is_not_that_of_its_copy)
{
    mbm_node copy;

    OK(mbm_node_setBlocking(n, 0));
    sim_answer(s, 1, 500, "11 03 02 00 2A +");
    IS(MBM_PENDING, sim_read_one(s));
    memcpy(&copy, n, sizeof copy);
    IS(MBM_PENDING, mbm_node_poll(n));
    IS(MBM_CANCELLED, mbm_node_poll(&copy));
    memcpy(&copy, n, sizeof copy);
    OK(mbm_node_cancel(&copy));
    IS(MBM_CANCELLED, mbm_node_status(&copy));
    OK(sim_poll(s));
    assert_int_equal(s->response[0], 42);
}

NODES_TEST(a_node_may_move_to_another_line)
{
    mbm_line line = MBM_INIT;
    uint8_t frame[MBM_FRAME_BYTES(4)];
    sim second;

    memcpy(&second, s, sizeof second);
    second.port.context = &second;
    other_reads(s);
    OK(mbm_line_beginRtu(&line, &second.port, frame, sizeof frame));
    OK(mbm_node_begin(&o.node, &line, 3, o.words, 4, NULL, 0));
    sim_answer(&second, 1, 500, "03 04 02 00 08 +");
    OK(mbm_node_readInputRegisters(&o.node, 0, 1));
    assert_int_equal(o.words[0], 8);
    assert_int_equal(s->sent, 1);
    assert_int_equal(second.sent, 1);
    sim_assert_sent(&second, 0, "03 04 00 00 00 01 +");
}

NODES_TEST(a_failure_of_one_node_delays_the_next_request_of_another)
{
    OK(mbm_node_setResponseTimeout(n, 50));
    IS(MBM_RESPONSE_TIMED_OUT, sim_read_one(s));
    /* The late reply may still come: the line is quiet first. */
    other_reads(s);
    assert_in_range(s->frames[1].begin - s->frames[0].end, 150000, 151000);
}

NODES_TEST(one_node_may_be_lenient_beside_a_strict_one)
{
    OK(mbm_node_setLenient(&o.node, 1));
    OK(mbm_node_setResponseTimeout(&o.node, 50));
    OK(mbm_node_setResponseTimeout(n, 50));
    OK(mbm_line_setQuietTime(&s->line, 0));
    sim_answer(s, 1, 500, "03 04 04 00 07 00 08 +");
    OK(mbm_node_readInputRegisters(&o.node, 0, 1));
    assert_int_equal(mbm_node_available(&o.node), 2);
    sim_answer(s, 1, 500, "11 03 04 00 07 00 08 +");
    IS(MBM_MALFORMED_REPLY, sim_read_one(s));
}

/* Hooks that call the library, non-blocking requests, and requests that end early: the
 * driver is off afterwards, and the next request works. Unit 17 is 11 on the wire. */

static void call_back(sim *s)
{
    mbm_node *n = &s->node;
    unsigned sent = s->sent;

    IS(MBM_PENDING, mbm_node_status(n));
    every_node_request_returns(MBM_BUSY, n);
    IS(MBM_BUSY, mbm_line_beginRtu(&s->line, &s->port, s->buffer, 8));
    IS(MBM_BUSY, mbm_line_setFrame(&s->line, s->buffer, 8));
    IS(MBM_BUSY, mbm_node_begin(n, &s->line, 3, s->response, 1, s->transmit, 1));
    assert_int_equal(mbm_node_getSlaveID(n), 17);
    assert_int_equal(mbm_node_getExceptionCode(n), 0);
    assert_int_equal(s->transmit[0], 0x1111);
    assert_int_equal(s->sent, sent);
}

SIM_TEST(requests_in_an_idle_hook_return_busy_and_change_nothing)
{
    s->transmit[0] = 0x1111;
    mbm_node_beginTransmission(n, 0x55);
    s->on_idle = call_back;
    sim_reads(s, 500);
    assert_true(s->idles > 10);
    s->on_idle = NULL;
    /* The write address is still the one that was set before. */
    mbm_node_send(n, 0x2222);
    sim_answer(s, 1, 500, "11 10 00 55 00 01 +");
    OK(mbm_node_writeQueuedRegisters(n));
}

static void poll_from_idle(sim *s)
{
    mbm_node_poll(&s->node);
}

SIM_TEST(an_idle_hook_that_polls_does_no_harm)
{
    s->on_idle = poll_from_idle;
    sim_reads(s, 500);
}

static void cancel_after_20_idles(sim *s)
{
    if (s->idles == 20)
        OK(mbm_node_cancel(&s->node));
}

SIM_TEST(an_idle_hook_may_cancel_before_a_byte_is_sent)
{
    s->on_idle = cancel_after_20_idles;
    IS(MBM_CANCELLED, sim_read_one(s));
    IS(MBM_CANCELLED, mbm_node_status(n));
    assert_int_equal(s->sent, 0);
    s->on_idle = NULL;
    sim_reads(s, 500);
}

static void cancel_in_the_reply(sim *s)
{
    if (s->sent == 1)
        OK(mbm_node_cancel(&s->node));
}

SIM_TEST(an_idle_hook_may_cancel_while_the_reply_is_waited_for)
{
    mbm_line_setRetries(&s->line, 3);
    s->on_idle = cancel_in_the_reply;
    IS(MBM_CANCELLED, sim_read_one(s));
    assert_int_equal(s->sent, 1);
    s->on_idle = NULL;
    sim_reads(s, 500);
}

SIM_TEST(idle_is_not_called_again_once_it_has_cancelled)
{
    s->on_idle = cancel_after_20_idles;
    IS(MBM_CANCELLED, sim_read_one(s));
    assert_int_equal(s->idles, 20);
}

static void poll_until(sim *s, unsigned bytes)
{
    while (s->sent == 0 || s->frames[s->sent - 1].length < bytes)
        IS(MBM_PENDING, mbm_node_poll(&s->node));
}

SIM_TEST(a_non_blocking_request_is_ended_by_poll)
{
    OK(mbm_node_poll(n));
    OK(mbm_node_status(n));
    OK(mbm_node_setBlocking(n, 0));
    sim_answer(s, 1, 500, "11 03 02 00 2A +");
    IS(MBM_PENDING, sim_read_one(s));
    IS(MBM_PENDING, mbm_node_status(n));
    IS(MBM_BUSY, sim_read_one(s));
    OK(sim_poll(s));
    OK(mbm_node_poll(n));
    assert_int_equal(mbm_node_receive(n), 42);
    assert_int_equal(s->idles, 0);
    sim_answer(s, 1, 500, "11 83 04 +");
    IS(MBM_PENDING, mbm_node_readHoldingRegisters(n, 0, 1));
    IS(4, sim_poll(s));
    IS(4, mbm_node_poll(n));
    OK(mbm_node_setBlocking(n, 1));
    sim_reads(s, 500);
}

SIM_TEST(buffers_of_a_pending_request_do_not_change)
{
    uint16_t words[1];
    uint8_t frame[8];

    mbm_node_setBlocking(n, 0);
    sim_answer(s, 1, 500, "11 03 02 00 2A +");
    IS(MBM_PENDING, sim_read_one(s));
    IS(MBM_BUSY, mbm_node_begin(n, &s->line, 17, words, 1, NULL, 0));
    IS(MBM_BUSY, mbm_line_setFrame(&s->line, frame, 8));
    poll_until(s, 8);
    IS(MBM_BUSY, mbm_node_begin(n, &s->line, 17, words, 1, NULL, 0));
    IS(MBM_BUSY, mbm_line_setFrame(&s->line, frame, 8));
    OK(sim_poll(s));
    assert_int_equal(s->response[0], 42);
    OK(mbm_node_begin(n, &s->line, 17, words, 1, NULL, 0));
    OK(mbm_line_setFrame(&s->line, frame, 8));
    OK(mbm_node_setBlocking(n, 1));
    sim_reads(s, 500);
    assert_int_equal(words[0], 42);
}

SIM_TEST(a_cancel_mid_send_switches_the_driver_off)
{
    mbm_node_setBlocking(n, 0);
    s->write_piece = 1;
    s->cut_allowed = 1;
    IS(MBM_PENDING, sim_read_one(s));
    poll_until(s, 3);
    OK(mbm_node_cancel(n));
    sim_assert_order(s, "PO", "PO");
    IS(MBM_CANCELLED, mbm_node_poll(n));
    OK(mbm_node_cancel(n));
    IS(MBM_CANCELLED, mbm_node_status(n));
    sim_assert_order(s, "PO", "PO");
    mbm_node_setBlocking(n, 1);
    sim_reads(s, 500);
}

SIM_TEST(the_gap_is_kept_after_a_cancel_mid_send)
{
    mbm_node_setBlocking(n, 0);
    s->write_piece = 1;
    s->character = 0; /* bytes are on the wire as soon as they are handed over */
    s->cut_allowed = 1;
    IS(MBM_PENDING, sim_read_one(s));
    poll_until(s, 3);
    OK(mbm_node_cancel(n));
    mbm_node_setBlocking(n, 1);
    sim_reads(s, 500);
    assert_in_range(s->frames[1].begin - s->frames[0].end, 4000, 4100);
}

SIM_TEST(a_cancel_while_the_port_drains_switches_the_driver_off)
{
    mbm_node_setBlocking(n, 0);
    IS(MBM_PENDING, sim_read_one(s));
    poll_until(s, 8);
    OK(mbm_node_cancel(n));
    sim_assert_order(s, "PO", "PO");
    s->post_before_last_bit = 0; /* the test does this on purpose */
    mbm_node_setBlocking(n, 1);
    sim_reads(s, 500);
}

SIM_TEST(a_cancel_in_the_hold_switches_the_driver_off)
{
    mbm_node_setBlocking(n, 0);
    mbm_line_setPostFlushHold(&s->line, 100);
    IS(MBM_PENDING, sim_read_one(s));
    poll_until(s, 8);
    while (s->now < s->transmitted + 1000)
        IS(MBM_PENDING, mbm_node_poll(n));
    assert_int_not_equal(s->driver_on, 0);
    OK(mbm_node_cancel(n));
    sim_assert_order(s, "PO", "PO");
}

SIM_TEST(begin_mid_send_is_refused_until_the_request_is_given_up)
{
    mbm_node_setBlocking(n, 0);
    s->write_piece = 1;
    s->character = 0; /* bytes are on the wire as soon as they are handed over */
    s->cut_allowed = 1;
    IS(MBM_PENDING, sim_read_one(s));
    poll_until(s, 3);
    mbm_port next = s->port;
    next.postTransmission = NULL;
    IS(MBM_BUSY, mbm_line_beginRtu(&s->line, &next, s->buffer, MBM_MAX_FRAME));
    IS(MBM_BUSY, mbm_node_begin(n, &s->line, 3, s->response, 1, NULL, 0));
    sim_assert_order(s, "P", "P");
    OK(mbm_line_cancel(&s->line));
    sim_assert_order(s, "PO", "PO");
    OK(mbm_line_beginRtu(&s->line, &next, s->buffer, MBM_MAX_FRAME));
    IS(MBM_CANCELLED, mbm_node_poll(n));
    IS(MBM_CANCELLED, mbm_node_status(n));
    mbm_node_setBlocking(n, 1);
    sim_begin(s, 17);
    sim_reads(s, 500);
    assert_in_range(s->frames[1].begin - s->frames[0].end, 4000, 4100);
}

SIM_TEST(a_refused_begin_leaves_the_pending_request)
{
    mbm_port empty;

    memset(&empty, 0, sizeof empty);
    mbm_node_setBlocking(n, 0);
    sim_answer(s, 1, 500, "11 03 02 00 2A +");
    IS(MBM_PENDING, sim_read_one(s));
    IS(MBM_INVALID_ARGUMENT, mbm_line_beginRtu(&s->line, &empty, s->buffer, MBM_MAX_FRAME));
    IS(MBM_INVALID_ARGUMENT, mbm_line_beginRtu(&s->line, NULL, s->buffer, MBM_MAX_FRAME));
    IS(MBM_INVALID_ARGUMENT, mbm_node_begin(n, NULL, 17, s->response, 1, NULL, 0));
    IS(MBM_INVALID_ARGUMENT, mbm_node_begin(n, &s->line, 17, NULL, 1, NULL, 0));
    OK(sim_poll(s));
}
