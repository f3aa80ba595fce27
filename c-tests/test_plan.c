/* When a plan reads which fields, over a port in memory with a clock of its own. */
#include "plan_device.h"
#include "test.h"

enum { HOLDING = MBM_TABLE_HOLDING_REGISTERS, SECOND = 1000 };

static plan_device d;

static void rtu(void)
{
    plan_device_begin(&d, 0);
}

static void add(uint8_t unit, uint16_t address, uint32_t intervalMs)
{
    (void)plan_device_add(&d, unit, HOLDING, MBM_TYPE_UINT16, address, intervalMs);
}

static uint8_t status(uint16_t field)
{
    return mbm_plan_getStatus(&d.plan, field, NULL);
}

static uint32_t age(uint16_t field)
{
    uint32_t ms = 1;

    (void)mbm_plan_getStatus(&d.plan, field, &ms);
    return ms;
}

fixture each_test = {rtu, NULL};

TEST(every_table_is_read_with_its_function)
{
    for (unsigned i = 1; i <= 4; i++)
        (void)plan_device_add(&d, 1, (uint8_t)i, i <= 2 ? MBM_TYPE_BIT : MBM_TYPE_UINT16,
                              (uint16_t)(10 * i), SECOND);
    plan_device_start(&d);
    plan_device_run(&d, 900);
    assert_true(d.requested >= 4);
    for (unsigned i = 0; i < 4; i++)
        assert_int_equal(d.log[i].address, 10 * d.log[i].function);
    for (unsigned i = 0; i < 4; i++) {
        uint16_t cell = d.registers[10 * (i + 1)];

        OK(status((uint16_t)i));
        assert_int_equal(plan_device_integer(&d, (uint16_t)i, 0), i < 2 ? cell & 1 : cell);
    }
}

TEST(fields_that_fit_together_are_one_request)
{
    add(1, 12, SECOND);
    add(1, 10, SECOND);
    add(1, 15, SECOND);
    d.setup.registerGap = 2;
    plan_device_start(&d);
    plan_device_run(&d, 100);
    assert_int_equal(d.requested, 1);
    assert_int_equal(d.log[0].address, 10);
    assert_int_equal(d.log[0].quantity, 6);
    assert_int_equal(plan_device_integer(&d, 0, 0), d.registers[12]);
    assert_int_equal(plan_device_integer(&d, 1, 0), d.registers[10]);
    assert_int_equal(plan_device_integer(&d, 2, 0), d.registers[15]);
}

TEST(fields_that_were_grouped_before_are_read_as_they_were_grouped)
{
    static const uint16_t counts[] = {3, 1};

    add(1, 10, SECOND);
    add(1, 15, SECOND);
    add(1, 12, SECOND);
    add(2, 30, SECOND);
    d.setup.readCount = 2;
    OK(mbm_plan_beginGrouped(&d.plan, &d.client, &d.setup, counts, NULL));
    plan_device_run(&d, 2500);
    assert_int_equal(plan_device_requests(&d, 1), 3);
    assert_int_equal(plan_device_requests(&d, 2), 3);
    assert_int_equal(d.log[0].address, 10);
    assert_int_equal(d.log[0].quantity, 6);
    assert_int_equal(plan_device_integer(&d, 0, 0), d.registers[10]);
    assert_int_equal(plan_device_integer(&d, 1, 0), d.registers[15]);
    assert_int_equal(plan_device_integer(&d, 2, 0), d.registers[12]);
    assert_int_equal(plan_device_integer(&d, 3, 0), d.registers[30]);
    assert_int_equal(plan_device_updates(&d, 2), 3);
    assert_int_equal(plan_device_updates(&d, 3), 3);
}

TEST(limits_above_255_are_not_reduced)
{
    mbm_planUnitLimits own = {.registersPerRead = 260, .unit = 2};

    d.setup.registersPerRead = 300;
    d.setup.registerGap = 300;
    d.setup.units = &own;
    d.setup.unitCount = 1;
    add(1, 0, SECOND);
    add(1, 124, SECOND);
    add(2, 0, SECOND);
    add(2, 124, SECOND);
    plan_device_start(&d);
    plan_device_run(&d, 100);
    assert_int_equal(d.requested, 2);
    assert_int_equal(d.log[0].quantity, 125);
    assert_int_equal(d.log[1].quantity, 125);
}

TEST(each_read_keeps_its_interval)
{
    add(1, 10, 100);
    add(1, 50, SECOND);
    plan_device_start(&d);
    plan_device_run(&d, 10 * SECOND);
    unsigned fast = plan_device_updates(&d, 0);
    unsigned slow = plan_device_updates(&d, 1);
    assert_in_range(fast, 100, 101);
    assert_in_range(slow, 10, 11);
}

TEST(reads_of_one_interval_are_spread_over_it)
{
    for (unsigned i = 0; i < 5; i++)
        add(1, (uint16_t)(10 * i), SECOND);
    plan_device_start(&d);
    plan_device_run(&d, 5 * SECOND);
    /* The first round is at once. */
    assert_true(d.log[4].ms < 100);
    for (unsigned i = 5; i + 1 < d.requested; i++)
        assert_in_range(d.log[i + 1].ms - d.log[i].ms, 180, 220);
    assert_in_range(d.requested, 25, 30);
}

TEST(a_value_is_never_older_than_its_interval_while_its_unit_answers)
{
    for (unsigned i = 0; i < 8; i++)
        add(1, (uint16_t)(10 * i), i % 2 ? SECOND : 700);
    plan_device_start(&d);
    plan_device_run(&d, 300);
    for (unsigned i = 0; i < 1000; i++) {
        plan_device_run(&d, 13);
        assert_true(age((uint16_t)(i % 8)) <= (i % 2 ? SECOND : 700) + 60u);
    }
}

TEST(a_value_has_no_age_before_it_was_read)
{
    int64_t value = 77;

    add(1, 10, SECOND);
    plan_device_start(&d);
    IS(MBM_PENDING, status(0));
    assert_int_equal(age(0), UINT32_MAX);
    IS(MBM_PENDING, mbm_plan_getInteger(&d.plan, 0, 0, &value));
    assert_int_equal(value, 77);
    plan_device_run(&d, 50);
    OK(status(0));
    assert_true(age(0) <= 50);
    plan_device_run(&d, 500);
    assert_in_range(age(0), 500, 551);
}

TEST(a_full_queue_delays_the_plan_and_no_more)
{
    static mbm_clientRequest own[16];

    add(2, 10, 500);
    d.answers[1] = SILENT;
    for (unsigned i = 0; i < COUNT(own); i++) {
        memset(&own[i], 0, sizeof own[i]);
        own[i].unit = 1;
        IS(MBM_PENDING, mbm_client_readHoldingRegisters(&d.client, &own[i], 0, 1));
    }
    plan_device_start(&d);
    OK(mbm_plan_poll(&d.plan));
    assert_int_equal(mbm_plan_pollDelay(&d.plan), UINT32_MAX);
    plan_device_run(&d, 5 * SECOND);
    OK(status(0));
    for (unsigned i = 0; i < COUNT(own); i++)
        IS(MBM_RESPONSE_TIMED_OUT, own[i].status);
}

TEST(the_programs_own_requests_go_beside_the_plan)
{
    mbm_clientRequest own = {0};
    uint16_t word = 0;

    add(1, 10, 100);
    plan_device_start(&d);
    plan_device_run(&d, 250);
    own.unit = 3;
    own.reply = &word;
    own.replyBytes = sizeof word;
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&d.client, &own, 77, 1));
    plan_device_run(&d, 250);
    OK(own.status);
    assert_int_equal(word, d.registers[77]);
    assert_int_equal(plan_device_updates(&d, 0), 5);
}

TEST_WITH(many_requests_are_in_flight_on_tcp, NULL, NULL)
{
    plan_device_begin(&d, 1);
    for (unsigned i = 0; i < 6; i++)
        add(1, (uint16_t)(10 * i), SECOND);
    d.setup.requestCount = 4;
    plan_device_start(&d);
    OK(mbm_plan_poll(&d.plan));
    assert_int_equal(mbm_client_pending(&d.client), 4);
    plan_device_run(&d, 200);
    for (unsigned i = 0; i < 6; i++) {
        OK(status((uint16_t)i));
        assert_int_equal(plan_device_integer(&d, (uint16_t)i, 0), d.registers[10 * i]);
    }
}

TEST(a_plan_is_polled_every_half_hour_although_no_read_is_due)
{
    add(1, 10, 3600 * SECOND);
    plan_device_start(&d);
    plan_device_run(&d, SECOND);
    OK(status(0));
    assert_int_equal(mbm_plan_pollDelay(&d.plan), 30 * 60 * 1000000);
}

TEST(a_refresh_reads_at_once)
{
    add(1, 10, 3600 * SECOND);
    add(1, 50, 3600 * SECOND);
    plan_device_start(&d);
    plan_device_run(&d, SECOND);
    assert_int_equal(d.requested, 2);
    OK(mbm_plan_refresh(&d.plan, 1));
    assert_int_equal(mbm_plan_pollDelay(&d.plan), 0);
    plan_device_run(&d, SECOND);
    assert_int_equal(d.requested, 3);
    assert_int_equal(d.log[2].address, 50);
}

TEST(an_ended_plan_gives_its_requests_up)
{
    add(1, 10, SECOND);
    plan_device_start(&d);
    OK(mbm_plan_poll(&d.plan));
    assert_int_equal(mbm_client_pending(&d.client), 1);
    OK(mbm_plan_end(&d.plan));
    assert_int_equal(mbm_client_pending(&d.client), 0);
    IS(MBM_NOT_INITIALISED, mbm_plan_poll(&d.plan));
    plan_device_start(&d);
    plan_device_run(&d, 100);
    OK(status(0));
}

TEST(a_plan_that_was_zeroed_ignores_the_reply)
{
    add(1, 10, SECOND);
    plan_device_start(&d);
    OK(mbm_plan_poll(&d.plan));
    memset(&d.plan, 0, sizeof d.plan);
    while (mbm_client_poll(&d.client) == MBM_PENDING)
        d.memory.now += 10000;
    assert_int_equal(d.updated, 0);
    plan_device_start(&d);
    d.memory.sent_count = 0;
    /* After a timeout the client holds the next reply for the quiet time. */
    plan_device_run(&d, 500);
    OK(status(0));
}

static void ending(void *context, mbm_plan *plan, uint16_t field)
{
    ++*(unsigned *)context;
    OK(mbm_plan_end(plan));
    IS(MBM_NOT_INITIALISED, mbm_plan_refresh(plan, 0));
}

TEST(update_may_end_the_plan)
{
    unsigned calls = 0;

    add(1, 10, SECOND);
    add(1, 11, SECOND);
    d.setup.update = ending;
    d.setup.context = &calls;
    plan_device_start(&d);
    OK(mbm_plan_poll(&d.plan));
    while (mbm_client_poll(&d.client) == MBM_PENDING)
        d.memory.now += 10000;
    assert_int_equal(calls, 0);
    assert_int_equal(mbm_plan_pollDelay(&d.plan), 0);
    OK(mbm_plan_poll(&d.plan));
    assert_int_equal(calls, 1);
}

/* Begins the plan anew, in the middle of the updates of its fields. */
static void beginning_again(void *context, mbm_plan *plan, uint16_t field)
{
    ++*(unsigned *)context;
    OK(mbm_plan_end(plan));
    d.setup.update = NULL;
    d.setup.fieldCount = 1;
    OK(mbm_plan_begin(plan, &d.client, &d.setup, NULL));
    OK(mbm_plan_poll(plan));
}

TEST(update_may_begin_the_plan_anew)
{
    unsigned calls = 0;

    add(1, 10, SECOND);
    add(1, 11, SECOND);
    d.setup.update = beginning_again;
    d.setup.context = &calls;
    plan_device_start(&d);
    plan_device_run(&d, 100);
    assert_int_equal(calls, 1);
    OK(status(0));
    IS(MBM_INVALID_ARGUMENT, status(1));
}

/* A plan whose units do not answer, or not well, over a port in memory with a clock of its own. */

TEST(a_unit_that_is_gone_keeps_its_last_value_with_status_and_age)
{
    add(1, 10, SECOND);
    plan_device_start(&d);
    plan_device_run(&d, 100);
    d.answers[1] = SILENT;
    d.registers[10] = 1234;
    plan_device_run(&d, 5 * SECOND);
    IS(MBM_RESPONSE_TIMED_OUT, status(0));
    assert_in_range(age(0), 5 * SECOND, 5100);
    assert_int_not_equal(plan_device_integer(&d, 0, 0), 1234);
    d.answers[1] = ANSWERS;
    plan_device_run(&d, 60 * SECOND);
    OK(status(0));
    assert_int_equal(plan_device_integer(&d, 0, 0), 1234);
}

TEST(the_plan_backs_off_from_a_silent_unit_and_goes_on_with_the_rest)
{
    add(1, 10, 200);
    add(2, 10, 200);
    d.answers[1] = SILENT;
    d.setup.backoffMs = 1000;
    d.setup.longestBackoffMs = 8000;
    plan_device_start(&d);
    plan_device_run(&d, 60 * SECOND);
    /* At 0, then 1, 2, 4 and 8 s after each end. */
    assert_in_range(plan_device_requests(&d, 1), 8, 12);
    assert_in_range(plan_device_updates(&d, 1), 295, 301);
    OK(status(1));
    IS(MBM_RESPONSE_TIMED_OUT, status(0));
}

TEST(a_silent_unit_with_many_reads_is_tried_with_one_at_a_time)
{
    for (unsigned i = 0; i < 6; i++)
        add(1, (uint16_t)(10 * i), 500);
    d.answers[1] = SILENT;
    d.setup.backoffMs = 1000;
    d.setup.longestBackoffMs = 4000;
    plan_device_start(&d);
    plan_device_run(&d, 40 * SECOND);
    assert_in_range(d.requested, 9, 14);
    for (unsigned i = 0; i < 6; i++) {
        IS(MBM_RESPONSE_TIMED_OUT, status((uint16_t)i));
        assert_true(plan_device_updates(&d, (uint16_t)i) > 0);
    }
    /* Once it answers, all its reads are made at once. */
    d.answers[1] = ANSWERS;
    plan_device_run(&d, 5 * SECOND);
    for (unsigned i = 0; i < 6; i++)
        OK(status((uint16_t)i));
}

TEST(one_read_without_an_answer_does_not_stop_the_others_of_its_unit)
{
    add(1, 10, 500);
    (void)plan_device_add(&d, 1, MBM_TABLE_INPUT_REGISTERS, MBM_TYPE_UINT16, 10, 500);
    d.silent_function = 4;
    plan_device_start(&d);
    plan_device_run(&d, 20 * SECOND);
    IS(MBM_RESPONSE_TIMED_OUT, status(1));
    OK(status(0));
    assert_in_range(plan_device_updates(&d, 0), 38, 41);
    assert_true(plan_device_updates(&d, 1) < 10);
}

TEST(an_exception_is_an_answer)
{
    add(1, 10, 200);
    d.answers[1] = EXCEPTION;
    plan_device_start(&d);
    plan_device_run(&d, 10 * SECOND);
    IS(MBM_SERVER_DEVICE_FAILURE, status(0));
    assert_in_range(d.requested, 49, 51);
}

TEST(half_a_reply_is_no_value)
{
    int64_t value = 77;

    add(1, 10, 500);
    d.answers[1] = HALF_A_REPLY;
    plan_device_start(&d);
    plan_device_run(&d, 3 * SECOND);
    assert_true(status(0) >= 0xE0 && status(0) != MBM_PENDING);
    IS(status(0), mbm_plan_getInteger(&d.plan, 0, 0, &value));
    assert_int_equal(value, 77);
    d.answers[1] = ANSWERS;
    plan_device_run(&d, 70 * SECOND);
    OK(status(0));
    assert_int_equal(plan_device_integer(&d, 0, 0), d.registers[10]);
}

TEST(a_damaged_reply_is_read_again_at_the_interval)
{
    add(1, 10, 500);
    d.answers[1] = WRONG_CRC;
    plan_device_start(&d);
    plan_device_run(&d, 10 * SECOND);
    IS(MBM_INVALID_CRC, status(0));
    assert_in_range(d.requested, 19, 21);
}

TEST(a_lost_link_is_the_status_and_the_plan_goes_on_once_it_is_back)
{
    add(1, 10, 500);
    plan_device_start(&d);
    plan_device_run(&d, 100);
    d.memory.is_lost = 1;
    plan_device_run(&d, 3 * SECOND);
    IS(MBM_LINK_LOST, status(0));
    d.memory.is_lost = 0;
    plan_device_run(&d, SECOND);
    OK(status(0));
    assert_true(age(0) <= 600);
}

TEST_WITH(many_timeouts_at_once_count_as_one, NULL, NULL)
{
    plan_device_begin(&d, 1);
    for (unsigned i = 0; i < 6; i++)
        add(1, (uint16_t)(10 * i), 100);
    d.setup.requestCount = 6;
    d.answers[1] = SILENT;
    d.setup.backoffMs = 1000;
    plan_device_start(&d);
    plan_device_run(&d, 1050);
    d.answers[1] = ANSWERS;
    /* Six doublings would be a minute. */
    plan_device_run(&d, 2 * SECOND);
    for (unsigned i = 0; i < 6; i++)
        OK(status((uint16_t)i));
}

TEST(a_client_that_is_begun_again_loses_the_reads_in_flight_only)
{
    mbm_port port = memory_port_of(&d.memory);

    add(1, 10, 500);
    plan_device_start(&d);
    OK(mbm_plan_poll(&d.plan));
    assert_int_equal(mbm_client_pending(&d.client), 1);
    OK(mbm_client_beginRtu(&d.client, &port, d.frame, sizeof d.frame));
    assert_int_equal(mbm_plan_pollDelay(&d.plan), 0);
    OK(mbm_plan_poll(&d.plan));
    IS(MBM_CANCELLED, status(0));
    plan_device_run(&d, 700);
    OK(status(0));
}

TEST(a_request_that_cannot_be_sent_is_a_status)
{
    add(1, 10, SECOND);
    plan_device_start(&d);
    memset(&d.client, 0, sizeof d.client);
    IS(MBM_NOT_INITIALISED, mbm_plan_poll(&d.plan));
    assert_int_equal(mbm_plan_pollDelay(&d.plan), UINT32_MAX);
    OK(mbm_plan_end(&d.plan));
}

TEST(the_clock_may_wrap)
{
    d.memory.now = UINT32_MAX - 2500000;
    add(1, 10, 500);
    plan_device_start(&d);
    for (unsigned i = 0; i < 100; i++) {
        plan_device_run(&d, 100);
        assert_true(age(0) <= 550);
    }
    assert_in_range(d.requested, 19, 21);
}

TEST(a_plan_that_was_not_polled_for_long_reads_once)
{
    add(1, 10, 10);
    plan_device_start(&d);
    plan_device_run(&d, 100);
    d.requested = 0;
    d.memory.now += 3600u * 1000000u;
    plan_device_run(&d, 9);
    assert_in_range(d.requested, 1, 2);
    assert_true(age(0) < 10);
}
