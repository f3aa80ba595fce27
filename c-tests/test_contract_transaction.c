/* One transaction of the contract with programs for ModbusMaster: the order of its steps
 * and the gap before it, on a simulated clock. Unit 17 is 11 on the wire. */
#include "sim.h"
#include "test.h"

#include <string.h>

static void steps_come_in_order(void **state)
{
    NODE;

    (void)n;
    sim_deliver_text(s, s->now, "DE AD BE EF");
    sim_reads(s, 5000);
    /* Old bytes dropped, driver on, write, flush, driver off, idle, reply. */
    sim_assert_order(s, "PWFOR", "RPWFOR");
    sim_assert_order(s, "POI", "IPOI");
    assert_int_equal(s->counters.resynchronisations, 0);
    sim_assert_sent(s, 0, "11 03 00 00 00 01 +");
}

static void steps_come_in_order_when_the_port_takes_bytes_one_by_one(void **state)
{
    NODE;

    (void)n;
    s->write_piece = 1;
    s->write_busy = 3;
    sim_reads(s, 5000);
    sim_assert_order(s, "PWFO", "PWFO");
    assert_int_equal(s->counters.bytesSent, 8);
}

static void bytes_that_wait_in_the_receiver_are_no_part_of_the_reply(void **state)
{
    NODE;

    (void)n;
    sim_deliver_text(s, s->now, "11 03 02 66 66 +");
    sim_reads(s, 500);
}

static void the_driver_is_switched_off_only_after_the_last_bit(void **state)
{
    NODE;

    (void)n;
    s->character = 1146;
    sim_reads(s, 500);
    sim_assert_time(sim_time_of(s, 'O'), s->frames[0].end);
}

static void the_driver_is_held_on_after_an_early_flush(void **state)
{
    NODE;

    s->character = 1146;
    s->flush_lies = 1;
    OK(mbm_master_setBaudRate(n, 9600));
    OK(mbm_master_setPostFlushHold(n, 9));
    sim_reads(s, 500);
    assert_int_equal(s->post_before_last_bit, 0);
    sim_assert_time(sim_time_of(s, 'O') - sim_time_of(s, 'F'), 9 * 1146);
    assert_int_equal(s->idle_while_driving, 0);
}

static void without_a_baud_rate_the_hold_is_that_of_9600_baud(void **state)
{
    NODE;

    s->flush_lies = 1;
    OK(mbm_master_setPostFlushHold(n, 2));
    sim_reads(s, 500);
    sim_assert_time(sim_time_of(s, 'O') - sim_time_of(s, 'F'), 2 * 1146);
}

static void all_hooks_except_three_may_be_missing(void **state)
{
    NODE;

    s->port.flush = NULL;
    s->port.preTransmission = NULL;
    s->port.postTransmission = NULL;
    s->port.idle = NULL;
    OK(mbm_master_beginRtu(n, 17, &s->port));
    sim_reads(s, 500);
    sim_assert_order(s, "PFOI", "");
}

static void the_first_request_waits_for_the_gap_after_begin(void **state)
{
    NODE;

    (void)n;
    sim_reads(s, 500);
    sim_assert_time(s->frames[0].silence, 4000);
}

static void gap_after_reply(sim *s, uint32_t wanted)
{
    sim_reads(s, 500);
    sim_reads(s, 500);
    sim_assert_time(s->frames[s->sent - 1].silence, wanted);
}

static void the_gap_is_4_ms_while_no_baud_rate_is_set(void **state)
{
    NODE;

    gap_after_reply(s, 4000);
    mbm_master_setBaudRate(n, 115200);
    mbm_master_setBaudRate(n, 0);
    gap_after_reply(s, 4000);
}

static void the_gap_is_three_and_a_half_characters_up_to_19200_baud(void **state)
{
    NODE;

    OK(mbm_master_setBaudRate(n, 9600));
    gap_after_reply(s, 4011);
    OK(mbm_master_setBaudRate(n, 1200));
    gap_after_reply(s, 32084);
    OK(mbm_master_setBaudRate(n, 19200));
    gap_after_reply(s, 2006);
}

static void the_gap_is_1750_us_above_19200_baud(void **state)
{
    NODE;

    OK(mbm_master_setBaudRate(n, 19201));
    gap_after_reply(s, 1750);
    OK(mbm_master_setBaudRate(n, 1000000));
    gap_after_reply(s, 1750);
}

static void a_set_gap_holds_until_a_baud_rate_is_set(void **state)
{
    NODE;

    OK(mbm_master_setGap(n, 20000));
    gap_after_reply(s, 20000);
    OK(mbm_master_setGap(n, 0));
    gap_after_reply(s, 0);
    OK(mbm_master_setBaudRate(n, 115200));
    gap_after_reply(s, 1750);
}

static void the_gap_counts_from_the_last_foreign_byte(void **state)
{
    NODE;

    (void)n;
    sim_reads(s, 500);
    sim_deliver_text(s, s->now + 3000, "05 03 02 00 01 +");
    sim_deliver_text(s, s->now + 6000, "99");
    sim_reads(s, 500);
    sim_assert_time(s->frames[1].silence, 4000);
    sim_assert_order(s, "PR", "PRPR");
}

static void the_gap_counts_from_the_last_byte_sent(void **state)
{
    NODE;

    mbm_master_setTurnaroundDelay(n, 0);
    mbm_master_setSlaveID(n, 0);
    OK(mbm_master_writeSingleCoil(n, 1, 1));
    OK(mbm_master_writeSingleCoil(n, 1, 1));
    sim_assert_time(s->frames[1].begin - s->frames[0].end, 4000);
}

static void a_gap_that_has_passed_already_is_not_waited_for(void **state)
{
    uint64_t asked;
    NODE;

    (void)n;
    sim_reads(s, 500);
    s->now += 10000;
    asked = s->now;
    sim_reads(s, 500);
    sim_assert_time(s->frames[1].begin - asked, 0);
}

static void line_used_makes_the_gap_count_from_now(void **state)
{
    uint64_t asked;
    NODE;

    sim_reads(s, 500);
    s->now += 10000;
    asked = s->now;
    OK(mbm_master_lineUsed(n));
    sim_reads(s, 500);
    sim_assert_time(s->frames[1].begin - asked, 4000);
}

static void idle_is_not_called_while_bytes_wait(void **state)
{
    NODE;

    (void)n;
    s->character = 0;
    s->read_piece = 1;
    sim_reads(s, 500);
    sim_assert_order(s, "IRO", "IOIR");
}

static void no_gap_is_waited_for_after_begin_on_a_silent_line(void **state)
{
    uint64_t asked;
    NODE;

    s->now += 10000;
    OK(mbm_master_beginRtu(n, 17, &s->port));
    asked = s->now;
    sim_reads(s, 500);
    sim_assert_time(s->frames[0].begin - asked, 0);
    /* After a request of the object on that line the gap is kept. */
    OK(mbm_master_beginRtu(n, 17, &s->port));
    sim_reads(s, 500);
    sim_assert_time(s->frames[1].silence, 4000);
}

static void bytes_that_arrive_after_begin_start_the_gap(void **state)
{
    NODE;

    s->now += 10000;
    OK(mbm_master_beginRtu(n, 17, &s->port));
    sim_deliver_text(s, s->now - 100, "05 03 02");
    sim_reads(s, 500);
    sim_assert_time(s->frames[0].silence, 4000);
}

static void the_gap_counts_from_the_reported_use_of_the_line(void **state)
{
    uint64_t asked;
    NODE;

    sim_reads(s, 500);
    s->now += 10000;
    asked = s->now;
    OK(mbm_master_lineUsedAt(n, (uint32_t)s->now - 3000));
    sim_reads(s, 500);
    sim_assert_time(s->frames[1].begin - asked, 1000);
    /* The master's own last byte is later than this. */
    OK(mbm_master_lineUsedAt(n, (uint32_t)asked - 3000));
    sim_reads(s, 500);
    sim_assert_time(s->frames[2].silence, 4000);
}

/* Returns a second master, with buffers, for the same line. */
static mbm_master *another_master(void)
{
    static mbm_master other;
    static uint16_t words[4];
    static uint8_t frame[MBM_FRAME_BYTES(4)];

    memset(&other, 0, sizeof other);
    OK(mbm_master_setBuffers(&other, words, 4, NULL, 0, frame, sizeof frame));
    return &other;
}

static void several_masters_share_a_stream(void **state)
{
    mbm_master *other = another_master();
    NODE;

    OK(mbm_master_beginRtu(other, 3, &s->port));
    sim_reads(s, 500);
    mbm_master_lineUsed(other);
    sim_answer(s, 1, 500, "03 04 02 00 07 +");
    OK(mbm_master_readInputRegisters(other, 0, 1));
    assert_int_equal(mbm_master_getResponseBuffer(other, 0), 7);
    sim_assert_time(s->frames[1].silence, 4000);
    assert_int_equal(mbm_master_getResponseBuffer(n, 0), 42);
    mbm_master_lineUsed(n);
    sim_reads(s, 500);
}

static void the_idle_hook_is_given_the_master_that_waits(void **state)
{
    mbm_master *other = another_master();
    NODE;

    OK(mbm_master_beginRtu(other, 3, &s->port));
    sim_reads(s, 500);
    assert_ptr_equal(s->waits, n);
    sim_answer(s, 1, 500, "03 04 02 00 07 +");
    OK(mbm_master_readInputRegisters(other, 0, 1));
    assert_ptr_equal(s->waits, other);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        SIM_TEST(steps_come_in_order),
        SIM_TEST(steps_come_in_order_when_the_port_takes_bytes_one_by_one),
        SIM_TEST(bytes_that_wait_in_the_receiver_are_no_part_of_the_reply),
        SIM_TEST(the_driver_is_switched_off_only_after_the_last_bit),
        SIM_TEST(the_driver_is_held_on_after_an_early_flush),
        SIM_TEST(without_a_baud_rate_the_hold_is_that_of_9600_baud),
        SIM_TEST(all_hooks_except_three_may_be_missing),
        SIM_TEST(the_first_request_waits_for_the_gap_after_begin),
        SIM_TEST(the_gap_is_4_ms_while_no_baud_rate_is_set),
        SIM_TEST(the_gap_is_three_and_a_half_characters_up_to_19200_baud),
        SIM_TEST(the_gap_is_1750_us_above_19200_baud),
        SIM_TEST(a_set_gap_holds_until_a_baud_rate_is_set),
        SIM_TEST(the_gap_counts_from_the_last_foreign_byte),
        SIM_TEST(the_gap_counts_from_the_last_byte_sent),
        SIM_TEST(a_gap_that_has_passed_already_is_not_waited_for),
        SIM_TEST(line_used_makes_the_gap_count_from_now),
        SIM_TEST(idle_is_not_called_while_bytes_wait),
        SIM_TEST(no_gap_is_waited_for_after_begin_on_a_silent_line),
        SIM_TEST(bytes_that_arrive_after_begin_start_the_gap),
        SIM_TEST(the_gap_counts_from_the_reported_use_of_the_line),
        SIM_TEST(several_masters_share_a_stream),
        SIM_TEST(the_idle_hook_is_given_the_master_that_waits),
    };

    return cmocka_run_group_tests_name("contract: one transaction", tests, NULL, NULL);
}
