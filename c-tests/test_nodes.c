/* Several nodes on one line: one request at a time, each with its own unit, words and status. */
#include "sim.h"
#include "test.h"

#include <string.h>

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
    /* What the other one does changes nothing. */
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
