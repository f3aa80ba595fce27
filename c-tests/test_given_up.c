/* Hooks that call the library, non-blocking requests, and requests that end early: the
 * driver is off afterwards, and the next request works. Unit 17 is 11 on the wire. */
#include "sim.h"
#include "test.h"

#include <string.h>

static void call_back(sim *s)
{
    mbm_master *n = &s->master;
    unsigned sent = s->sent;
    uint16_t address = 3;

    IS(MBM_PENDING, mbm_master_status(n));
    IS(MBM_BUSY, mbm_master_readCoils(n, 0, 1));
    IS(MBM_BUSY, mbm_master_readDiscreteInputs(n, 0, 1));
    IS(MBM_BUSY, mbm_master_readHoldingRegisters(n, 0, 1));
    IS(MBM_BUSY, mbm_master_readInputRegisters(n, 0, 1));
    IS(MBM_BUSY, mbm_master_writeSingleCoil(n, address, 1));
    IS(MBM_BUSY, mbm_master_writeSingleRegister(n, address, 0x9999));
    IS(MBM_BUSY, mbm_master_writeMultipleCoils(n, address, 1));
    IS(MBM_BUSY, mbm_master_writeQueuedCoils(n));
    IS(MBM_BUSY, mbm_master_writeMultipleRegisters(n, address, 1));
    IS(MBM_BUSY, mbm_master_writeQueuedRegisters(n));
    IS(MBM_BUSY, mbm_master_maskWriteRegister(n, address, 1, 2));
    IS(MBM_BUSY, mbm_master_readWriteMultipleRegisters(n, 0, 1, address, 1));
    IS(MBM_BUSY, mbm_master_readWriteQueuedRegisters(n, 0, 1));
    IS(MBM_BUSY, mbm_master_setBuffers(n, s->response, 1, s->transmit, 1, s->buffer, 8));
    assert_int_equal(mbm_master_getSlaveID(n), 17);
    assert_int_equal(mbm_master_getExceptionCode(n), 0);
    assert_int_equal(s->transmit[0], 0x1111);
    assert_int_equal(s->sent, sent);
}

static void requests_in_an_idle_hook_return_busy_and_change_nothing(void **state)
{
    NODE;

    mbm_master_setTransmitBuffer(n, 0, 0x1111);
    mbm_master_beginTransmission(n, 0x55);
    s->on_idle = call_back;
    sim_reads(s, 500);
    assert_true(s->idles > 10);
    s->on_idle = NULL;
    /* The write address is still the one that was set before. */
    mbm_master_send(n, 0x2222);
    sim_answer(s, 1, 500, "11 10 00 55 00 01 +");
    OK(mbm_master_writeQueuedRegisters(n));
}

static void request_from_idle(sim *s)
{
    mbm_master_requestFrom(&s->master, 0, 1);
}

static void request_from_in_an_idle_hook_changes_nothing(void **state)
{
    NODE;

    (void)n;
    s->on_idle = request_from_idle;
    sim_reads(s, 500);
    assert_int_equal(s->sent, 1);
}

static void poll_from_idle(sim *s)
{
    mbm_master_poll(&s->master);
}

static void an_idle_hook_that_polls_does_no_harm(void **state)
{
    NODE;

    (void)n;
    s->on_idle = poll_from_idle;
    sim_reads(s, 500);
}

static void cancel_after_20_idles(sim *s)
{
    if (s->idles == 20)
        OK(mbm_master_cancel(&s->master));
}

static void an_idle_hook_may_cancel_before_a_byte_is_sent(void **state)
{
    NODE;

    s->on_idle = cancel_after_20_idles;
    IS(MBM_CANCELLED, sim_read_one(s));
    IS(MBM_CANCELLED, mbm_master_status(n));
    assert_int_equal(s->sent, 0);
    s->on_idle = NULL;
    sim_reads(s, 500);
}

static void cancel_in_the_reply(sim *s)
{
    if (s->sent == 1)
        OK(mbm_master_cancel(&s->master));
}

static void an_idle_hook_may_cancel_while_the_reply_is_waited_for(void **state)
{
    NODE;

    mbm_master_setRetries(n, 3);
    s->on_idle = cancel_in_the_reply;
    IS(MBM_CANCELLED, sim_read_one(s));
    assert_int_equal(s->sent, 1);
    s->on_idle = NULL;
    sim_reads(s, 500);
}

static void idle_is_not_called_again_once_it_has_cancelled(void **state)
{
    NODE;

    (void)n;
    s->on_idle = cancel_after_20_idles;
    IS(MBM_CANCELLED, sim_read_one(s));
    assert_int_equal(s->idles, 20);
}

static void poll_until(sim *s, unsigned bytes)
{
    while (s->sent == 0 || s->frames[s->sent - 1].length < bytes)
        IS(MBM_PENDING, mbm_master_poll(&s->master));
}

static void a_non_blocking_request_is_ended_by_poll(void **state)
{
    NODE;

    OK(mbm_master_poll(n));
    OK(mbm_master_status(n));
    OK(mbm_master_setBlocking(n, 0));
    sim_answer(s, 1, 500, "11 03 02 00 2A +");
    IS(MBM_PENDING, sim_read_one(s));
    IS(MBM_PENDING, mbm_master_status(n));
    IS(MBM_BUSY, sim_read_one(s));
    OK(sim_poll(s));
    OK(mbm_master_poll(n));
    assert_int_equal(mbm_master_receive(n), 42);
    assert_int_equal(s->idles, 0);
    sim_answer(s, 1, 500, "11 83 04 +");
    assert_int_equal(mbm_master_requestFrom(n, 0, 1), 0);
    IS(4, sim_poll(s));
    IS(4, mbm_master_poll(n));
    OK(mbm_master_setBlocking(n, 1));
    sim_reads(s, 500);
}

static void set_buffers_while_pending_is_busy_and_changes_nothing(void **state)
{
    uint16_t words[1];
    uint8_t frame[8];
    NODE;

    mbm_master_setBlocking(n, 0);
    sim_answer(s, 1, 500, "11 03 02 00 2A +");
    IS(MBM_PENDING, sim_read_one(s));
    IS(MBM_BUSY, mbm_master_setBuffers(n, words, 1, NULL, 0, frame, 8));
    poll_until(s, 8);
    IS(MBM_BUSY, mbm_master_setBuffers(n, words, 1, NULL, 0, frame, 8));
    OK(sim_poll(s));
    assert_int_equal(s->response[0], 42);
    OK(mbm_master_setBuffers(n, words, 1, NULL, 0, frame, 8));
    OK(mbm_master_setBuffers(n, s->response, 125, s->transmit, 123, s->buffer, 256));
}

static void a_cancel_mid_send_switches_the_driver_off(void **state)
{
    NODE;

    mbm_master_setBlocking(n, 0);
    s->write_piece = 1;
    s->cut_allowed = 1;
    IS(MBM_PENDING, sim_read_one(s));
    poll_until(s, 3);
    OK(mbm_master_cancel(n));
    sim_assert_order(s, "PO", "PO");
    IS(MBM_CANCELLED, mbm_master_poll(n));
    OK(mbm_master_cancel(n));
    IS(MBM_CANCELLED, mbm_master_status(n));
    sim_assert_order(s, "PO", "PO");
    mbm_master_setBlocking(n, 1);
    sim_reads(s, 500);
}

static void the_gap_is_kept_after_a_cancel_mid_send(void **state)
{
    NODE;

    mbm_master_setBlocking(n, 0);
    s->write_piece = 1;
    s->character = 0; /* bytes are on the wire as soon as they are handed over */
    s->cut_allowed = 1;
    IS(MBM_PENDING, sim_read_one(s));
    poll_until(s, 3);
    OK(mbm_master_cancel(n));
    mbm_master_setBlocking(n, 1);
    sim_reads(s, 500);
    assert_in_range(s->frames[1].begin - s->frames[0].end, 4000, 4100);
}

static void a_cancel_while_the_port_drains_switches_the_driver_off(void **state)
{
    NODE;

    mbm_master_setBlocking(n, 0);
    IS(MBM_PENDING, sim_read_one(s));
    poll_until(s, 8);
    OK(mbm_master_cancel(n));
    sim_assert_order(s, "PO", "PO");
    s->post_before_last_bit = 0; /* the test does this on purpose */
    mbm_master_setBlocking(n, 1);
    sim_reads(s, 500);
}

static void a_cancel_in_the_hold_switches_the_driver_off(void **state)
{
    NODE;

    mbm_master_setBlocking(n, 0);
    mbm_master_setPostFlushHold(n, 100);
    IS(MBM_PENDING, sim_read_one(s));
    poll_until(s, 8);
    while (s->now < s->transmitted + 1000)
        IS(MBM_PENDING, mbm_master_poll(n));
    assert_int_not_equal(s->driver_on, 0);
    OK(mbm_master_cancel(n));
    sim_assert_order(s, "PO", "PO");
}

static void begin_mid_send_switches_the_driver_off_on_the_old_port(void **state)
{
    mbm_port other;
    NODE;

    mbm_master_setBlocking(n, 0);
    s->write_piece = 1;
    s->character = 0; /* bytes are on the wire as soon as they are handed over */
    s->cut_allowed = 1;
    IS(MBM_PENDING, sim_read_one(s));
    poll_until(s, 3);
    other = s->port;
    other.postTransmission = NULL;
    OK(mbm_master_beginRtu(n, 3, &other));
    sim_assert_order(s, "PO", "PO");
    IS(MBM_CANCELLED, mbm_master_status(n));
    IS(MBM_CANCELLED, mbm_master_poll(n));
    mbm_master_setBlocking(n, 1);
    sim_begin(s, 17);
    sim_reads(s, 500);
    assert_in_range(s->frames[1].begin - s->frames[0].end, 4000, 4100);
}

static void a_refused_begin_leaves_the_request_under_way(void **state)
{
    mbm_port empty;
    NODE;

    memset(&empty, 0, sizeof empty);
    mbm_master_setBlocking(n, 0);
    sim_answer(s, 1, 500, "11 03 02 00 2A +");
    IS(MBM_PENDING, sim_read_one(s));
    IS(MBM_INVALID_ARGUMENT, mbm_master_beginRtu(n, 3, &empty));
    IS(MBM_INVALID_ARGUMENT, mbm_master_beginRtu(n, 3, NULL));
    OK(sim_poll(s));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        SIM_TEST(requests_in_an_idle_hook_return_busy_and_change_nothing),
        SIM_TEST(request_from_in_an_idle_hook_changes_nothing),
        SIM_TEST(an_idle_hook_that_polls_does_no_harm),
        SIM_TEST(an_idle_hook_may_cancel_before_a_byte_is_sent),
        SIM_TEST(an_idle_hook_may_cancel_while_the_reply_is_waited_for),
        SIM_TEST(idle_is_not_called_again_once_it_has_cancelled),
        SIM_TEST(a_non_blocking_request_is_ended_by_poll),
        SIM_TEST(set_buffers_while_pending_is_busy_and_changes_nothing),
        SIM_TEST(a_cancel_mid_send_switches_the_driver_off),
        SIM_TEST(the_gap_is_kept_after_a_cancel_mid_send),
        SIM_TEST(a_cancel_while_the_port_drains_switches_the_driver_off),
        SIM_TEST(a_cancel_in_the_hold_switches_the_driver_off),
        SIM_TEST(begin_mid_send_switches_the_driver_off_on_the_old_port),
        SIM_TEST(a_refused_begin_leaves_the_request_under_way),
    };

    return cmocka_run_group_tests_name("requests that end early", tests, NULL, NULL);
}
