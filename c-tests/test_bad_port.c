/* Ports that stall, lie or lose the link, and clocks that wrap: the call ends with a
 * status, the driver is off, and the next request works. Unit 17 is 11 on the wire. */
#include "sim.h"
#include "test.h"

fixture each_test = {sim_setup, sim_teardown};

SIM_TEST(write_may_accept_a_byte_at_a_time)
{
    s->write_piece = 1;
    for (unsigned i = 0; i < 123; i++)
        s->transmit[i] = (uint16_t)(i * 0x0101);
    sim_answer(s, 1, 500, "11 10 00 00 00 7B +");
    OK(mbm_node_writeMultipleRegisters(n, 0, 123));
    assert_int_equal(s->frames[0].length, 255);
    assert_int_equal(s->frames[0].bytes[7 + 2 * 99], 99);
}

SIM_TEST(read_may_return_a_byte_at_a_time)
{
    s->read_piece = 1;
    sim_deliver_text(s, s->now, "01 02 03 04 05");
    sim_reads(s, 500);
}

SIM_TEST(a_write_that_never_accepts_a_byte_is_a_busy_line)
{
    s->write_never = 1;
    IS(MBM_LINE_BUSY, sim_read_one(s));
    assert_int_equal(s->sent, 0);
    sim_assert_order(s, "PO", "PO");
    assert_in_range(s->now, 2000000, 2500000);
    s->write_never = 0;
    sim_reads(s, 500);
}

SIM_TEST(a_flush_that_never_drains_is_a_busy_line)
{
    s->flush_never = 1;
    IS(MBM_LINE_BUSY, sim_read_one(s));
    sim_assert_order(s, "PO", "PO");
    assert_in_range(s->now, 2000000, 2500000);
    s->flush_never = 0;
    sim_reads(s, 500);
}

SIM_TEST(a_link_lost_in_the_gap_sends_nothing)
{
    s->read_dead = 1;
    IS(MBM_LINK_LOST, sim_read_one(s));
    IS(MBM_LINK_LOST, mbm_node_status(n));
    assert_int_equal(s->sent, 0);
    sim_assert_order(s, "PWO", "");
    s->read_dead = 0;
    sim_reads(s, 500);
}

static void die_mid_reply(sim *s)
{
    if (s->first > 3)
        s->read_dead = 1;
}

SIM_TEST(a_link_lost_mid_reply_ends_the_request_at_once)
{
    mbm_line_setRetries(&s->line, 3);
    s->on_idle = die_mid_reply;
    sim_answer(s, 1, 500, "11 03 02 00 07 +");
    IS(MBM_LINK_LOST, sim_read_one(s));
    assert_int_equal(s->sent, 1);
    assert_true(s->now < 20000);
    s->on_idle = NULL;
    s->read_dead = 0;
    sim_reads(s, 500);
}

SIM_TEST(a_link_lost_mid_write_switches_the_driver_off)
{
    s->cut_allowed = 7;
    for (uint16_t at = 1; at <= 8; at++) {
        s->write_dies_at = at;
        IS(MBM_LINK_LOST, sim_read_one(s));
        assert_int_equal(s->driver_on, 0);
    }
    s->write_dies_at = 0;
    sim_reads(s, 500);
    assert_int_equal(s->sent, 9);
}

/* Without the gap, a device would take the sent half of the request and the next request
 * for one frame. */
SIM_TEST(the_gap_is_kept_after_a_link_lost_mid_write)
{
    s->character = 0; /* bytes are on the wire as soon as they are handed over */
    s->cut_allowed = 1;
    s->write_dies_at = 5;
    IS(MBM_LINK_LOST, sim_read_one(s));
    s->write_dies_at = 0;
    sim_reads(s, 500);
    assert_in_range(s->frames[1].begin - s->frames[0].end, 4000, 4100);
}

SIM_TEST(hooks_that_claim_too_many_bytes_do_no_harm)
{
    s->overclaim = 1000;
    sim_reads(s, 500);
    assert_int_equal(s->counters.bytesSent, 8);
    s->read_piece = 0;
    sim_deliver_text(s, s->now, "01 02 03 04 05 06 07 08 09");
    sim_reads(s, 500);
    assert_int_equal(s->frames[1].length, 8);
}

/* One read with its gap, hold and reply takes 12 ms. The clock wraps at each quarter of a
 * character in this time. */
TEST(the_clock_may_wrap_at_any_time_of_a_transaction)
{
    for (uint32_t ahead = 0; ahead < 12000; ahead += 25) {
        sim *s = sim_of_test();

        s->clock_start = (uint32_t)(0u - ahead - s->now);
        mbm_line_setPostFlushHold(&s->line, 1);
        mbm_node_setResponseTimeout(&s->node, 5);
        sim_begin(s, 17);
        OK(mbm_line_used(&s->line));
        sim_answer(s, 1, 3000, "11 03 02 00 2A +");
        OK(sim_read_one(s));
        assert_in_range(s->frames[0].silence, 4000, 4100);
        IS(MBM_RESPONSE_TIMED_OUT, sim_read_one(s));
        assert_in_range(s->now - s->frames[1].end, 5000 + 1146, 5000 + 1146 + 100);
        sim_teardown();
        sim_setup();
    }
}

TEST(the_clock_may_wrap_in_a_long_wait)
{
    static const uint32_t ahead[] = {100, 5000, 50000, 500000, 1999000, 2050000, 2100000};

    for (size_t i = 0; i < COUNT(ahead); i++) {
        sim *s = sim_of_test();

        s->clock_start = (uint32_t)(0u - ahead[i] - s->now);
        sim_begin(s, 17);
        IS(MBM_RESPONSE_TIMED_OUT, sim_read_one(s));
        assert_in_range(s->now - s->frames[0].end, 2000000, 2000100);
        sim_reads(s, 500);
        assert_in_range(s->frames[1].silence, 2000000 + 100000, 2000000 + 100200);
        mbm_node_setSlaveID(&s->node, 0);
        OK(mbm_node_writeSingleCoil(&s->node, 0, 0));
        assert_in_range(s->now - s->frames[2].end, 100000, 100100);
        sim_teardown();
        sim_setup();
    }
}
