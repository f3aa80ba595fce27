/* Several masters on one line and in one frame buffer, which take turns. */
#include "sim.h"
#include "test.h"

#include <string.h>

typedef struct other {
    mbm_master master;
    uint16_t words[4];
} other;

/* A master of unit 3 in the same frame buffer as the simulation's master. */
static void begin_other(sim *s, other *o)
{
    memset(o, 0, sizeof *o);
    OK(mbm_master_setBuffers(&o->master, o->words, 4, NULL, 0, s->buffer, sizeof s->buffer));
    OK(mbm_master_beginRtu(&o->master, 3, &s->port));
}

static void other_reads(sim *s, other *o, mbm_turn *turn)
{
    sim_answer(s, 1, 500, "03 04 02 00 07 +");
    OK(mbm_master_takeTurn(&o->master, turn));
    OK(mbm_master_readInputRegisters(&o->master, 0, 1));
    assert_int_equal(o->words[0], 7);
}

static void the_gap_counts_from_the_last_use_by_the_object_that_had_the_turn(void **state)
{
    mbm_turn turn = {0};
    uint64_t asked;
    other o;
    NODE;

    begin_other(s, &o);
    OK(mbm_master_takeTurn(n, &turn));
    sim_reads(s, 500);
    other_reads(s, &o, &turn);
    sim_assert_time(s->frames[1].silence, 4000);
    OK(mbm_master_takeTurn(n, &turn));
    sim_reads(s, 500);
    sim_assert_time(s->frames[2].silence, 4000);
    s->now += 10000;
    asked = s->now;
    other_reads(s, &o, &turn);
    sim_assert_time(s->frames[3].begin - asked, 0);
}

static void the_turn_is_refused_while_another_object_has_a_request_under_way(void **state)
{
    mbm_turn turn = {0};
    other o;
    NODE;

    begin_other(s, &o);
    OK(mbm_master_takeTurn(n, &turn));
    OK(mbm_master_setBlocking(n, 0));
    sim_answer(s, 1, 500, "11 03 02 00 2A +");
    IS(MBM_PENDING, sim_read_one(s));
    IS(MBM_BUSY, mbm_master_takeTurn(&o.master, &turn));
    OK(mbm_master_takeTurn(n, &turn));
    assert_ptr_equal(turn.master, n);
    OK(sim_poll(s));
    other_reads(s, &o, &turn);
    assert_ptr_equal(turn.master, &o.master);
}

static mbm_turn shared;
static other within;
static unsigned refused;
static void (*driver_on)(void *context);

static void try_a_turn(void *context)
{
    driver_on(context);
    IS(MBM_BUSY, mbm_master_takeTurn(&within.master, &shared));
    refused++;
}

static void the_turn_is_refused_within_a_hook_of_the_object_that_has_it(void **state)
{
    NODE;

    memset(&shared, 0, sizeof shared);
    refused = 0;
    begin_other(s, &within);
    driver_on = s->port.preTransmission;
    s->port.preTransmission = try_a_turn;
    OK(mbm_master_beginRtu(n, 17, &s->port));
    OK(mbm_master_takeTurn(n, &shared));
    sim_answer(s, 1, 500, "11 03 02 00 2A +");
    OK(mbm_master_readHoldingRegisters(n, 0, 1));
    assert_int_equal(refused, 1);
}

static void a_turn_that_was_given_back_leaves_the_time_of_the_last_use(void **state)
{
    mbm_turn turn = {0};
    other o;
    NODE;

    begin_other(s, &o);
    other_reads(s, &o, &turn);
    OK(mbm_master_endTurn(n, &turn)); /* not its turn */
    assert_ptr_equal(turn.master, &o.master);
    OK(mbm_master_endTurn(&o.master, &turn));
    assert_null(turn.master);
    memset(&o, 0xA5, sizeof o); /* its memory may be used for something else */
    OK(mbm_master_takeTurn(n, &turn));
    sim_reads(s, 500);
    sim_assert_time(s->frames[1].silence, 4000);
}

static void an_object_that_gave_back_its_turn_with_a_request_blocks_no_other(void **state)
{
    mbm_turn turn = {0};
    other o;
    NODE;

    begin_other(s, &o);
    OK(mbm_master_setBlocking(&o.master, 0));
    OK(mbm_master_takeTurn(&o.master, &turn));
    IS(MBM_PENDING, mbm_master_readInputRegisters(&o.master, 0, 1));
    OK(mbm_master_endTurn(&o.master, &turn));
    memset(&o, 0xA5, sizeof o);
    OK(mbm_master_takeTurn(n, &turn));
    sim_reads(s, 500);
}

static void a_turn_needs_a_record(void **state)
{
    NODE;

    (void)s;
    IS(MBM_INVALID_ARGUMENT, mbm_master_takeTurn(n, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_master_endTurn(n, NULL));
}

static void one_port_serves_objects_with_contexts_of_their_own(void **state)
{
    mbm_port shared_port;
    other o;
    sim second;
    NODE;

    memcpy(&second, s, sizeof second);
    shared_port = s->port;
    shared_port.context = NULL;
    begin_other(&second, &o);
    OK(mbm_master_beginRtuWith(n, 17, &shared_port, s));
    OK(mbm_master_beginRtuWith(&o.master, 3, &shared_port, &second));
    sim_reads(s, 500);
    sim_answer(&second, 1, 500, "03 04 02 00 07 +");
    OK(mbm_master_readInputRegisters(&o.master, 0, 1));
    assert_int_equal(s->sent, 1);
    assert_int_equal(second.sent, 1);
    sim_assert_sent(&second, 0, "03 04 00 00 00 01 +");
    IS(MBM_INVALID_ARGUMENT, mbm_master_beginRtuWith(n, 17, NULL, s));
    shared_port.read = NULL;
    IS(MBM_INVALID_ARGUMENT, mbm_master_beginRtuWith(&o.master, 17, &shared_port, s));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        SIM_TEST(the_gap_counts_from_the_last_use_by_the_object_that_had_the_turn),
        SIM_TEST(the_turn_is_refused_while_another_object_has_a_request_under_way),
        SIM_TEST(the_turn_is_refused_within_a_hook_of_the_object_that_has_it),
        SIM_TEST(a_turn_that_was_given_back_leaves_the_time_of_the_last_use),
        SIM_TEST(an_object_that_gave_back_its_turn_with_a_request_blocks_no_other),
        SIM_TEST(a_turn_needs_a_record),
        SIM_TEST(one_port_serves_objects_with_contexts_of_their_own),
    };

    return cmocka_run_group_tests_name("turns", tests, NULL, NULL);
}
