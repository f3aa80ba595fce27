/* Hooks that call the library, non-blocking requests, and requests that end early: the
 * driver is off afterwards, and the next request works. Unit 17 is 11 on the wire. */
#include "every_call.h"
#include "sim.h"
#include "test.h"

#include <string.h>

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
    mbm_port other = s->port;
    other.postTransmission = NULL;
    IS(MBM_BUSY, mbm_line_beginRtu(&s->line, &other, s->buffer, MBM_MAX_FRAME));
    IS(MBM_BUSY, mbm_node_begin(n, &s->line, 3, s->response, 1, NULL, 0));
    sim_assert_order(s, "P", "P");
    OK(mbm_line_cancel(&s->line));
    sim_assert_order(s, "PO", "PO");
    OK(mbm_line_beginRtu(&s->line, &other, s->buffer, MBM_MAX_FRAME));
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
