/* When a plan reads what, and what it does if units do not answer: over a port in memory with a
 * clock of its own. */
#include "plan_device.h"
#include "test.h"

#include <string.h>

enum { HOLDING = MBM_TABLE_HOLDING_REGISTERS, SECOND = 1000 };

static plan_device d;

static int rtu(void **state)
{
    (void)state;
    plan_device_begin(&d, 0);
    return 0;
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

static void every_table_is_read_with_its_function(void **state)
{
    unsigned i;

    (void)state;
    for (i = 1; i <= 4; i++)
        (void)plan_device_add(&d, 1, (uint8_t)i, i <= 2 ? MBM_TYPE_BIT : MBM_TYPE_UINT16,
                              (uint16_t)(10 * i), SECOND);
    plan_device_start(&d);
    plan_device_run(&d, 900);
    assert_true(d.requested >= 4);
    for (i = 0; i < 4; i++)
        assert_int_equal(d.log[i].address, 10 * d.log[i].function);
    for (i = 0; i < 4; i++) {
        uint16_t cell = d.registers[10 * (i + 1)];

        OK(status((uint16_t)i));
        assert_int_equal(plan_device_integer(&d, (uint16_t)i, 0), i < 2 ? cell & 1 : cell);
    }
}

static void fields_that_fit_together_are_one_request(void **state)
{
    (void)state;
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

static void each_read_keeps_its_interval(void **state)
{
    unsigned fast, slow;

    (void)state;
    add(1, 10, 100);
    add(1, 50, SECOND);
    plan_device_start(&d);
    plan_device_run(&d, 10 * SECOND);
    fast = plan_device_updates(&d, 0);
    slow = plan_device_updates(&d, 1);
    assert_in_range(fast, 100, 101);
    assert_in_range(slow, 10, 11);
}

static void reads_of_one_interval_are_spread_over_it(void **state)
{
    unsigned i;

    (void)state;
    for (i = 0; i < 5; i++)
        add(1, (uint16_t)(10 * i), SECOND);
    plan_device_start(&d);
    plan_device_run(&d, 5 * SECOND);
    /* The first round is at once. */
    assert_true(d.log[4].ms < 100);
    for (i = 5; i + 1 < d.requested; i++)
        assert_in_range(d.log[i + 1].ms - d.log[i].ms, 180, 220);
    assert_in_range(d.requested, 25, 30);
}

static void a_value_is_never_older_than_its_interval_while_its_unit_answers(void **state)
{
    unsigned i;

    (void)state;
    for (i = 0; i < 8; i++)
        add(1, (uint16_t)(10 * i), i % 2 ? SECOND : 700);
    plan_device_start(&d);
    plan_device_run(&d, 300);
    for (i = 0; i < 1000; i++) {
        plan_device_run(&d, 13);
        assert_true(age((uint16_t)(i % 8)) <= (i % 2 ? SECOND : 700) + 60u);
    }
}

static void a_value_has_no_age_before_it_was_read(void **state)
{
    int64_t value = 77;

    (void)state;
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

static void a_unit_that_is_gone_keeps_its_last_value_with_status_and_age(void **state)
{
    (void)state;
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

static void the_plan_backs_off_from_a_silent_unit_and_goes_on_with_the_rest(void **state)
{
    (void)state;
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

static void a_silent_unit_with_many_reads_is_tried_with_one_at_a_time(void **state)
{
    unsigned i;

    (void)state;
    for (i = 0; i < 6; i++)
        add(1, (uint16_t)(10 * i), 500);
    d.answers[1] = SILENT;
    d.setup.backoffMs = 1000;
    d.setup.longestBackoffMs = 4000;
    plan_device_start(&d);
    plan_device_run(&d, 40 * SECOND);
    assert_in_range(d.requested, 9, 14);
    for (i = 0; i < 6; i++) {
        IS(MBM_RESPONSE_TIMED_OUT, status((uint16_t)i));
        assert_true(plan_device_updates(&d, (uint16_t)i) > 0);
    }
    /* Once it answers, all its reads are made at once. */
    d.answers[1] = ANSWERS;
    plan_device_run(&d, 5 * SECOND);
    for (i = 0; i < 6; i++)
        OK(status((uint16_t)i));
}

static void one_read_without_an_answer_does_not_stop_the_others_of_its_unit(void **state)
{
    (void)state;
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

static void an_exception_is_an_answer(void **state)
{
    (void)state;
    add(1, 10, 200);
    d.answers[1] = EXCEPTION;
    plan_device_start(&d);
    plan_device_run(&d, 10 * SECOND);
    IS(MBM_SLAVE_DEVICE_FAILURE, status(0));
    assert_in_range(d.requested, 49, 51);
}

static void half_a_reply_is_no_value(void **state)
{
    int64_t value = 77;

    (void)state;
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

static void a_damaged_reply_is_read_again_at_the_interval(void **state)
{
    (void)state;
    add(1, 10, 500);
    d.answers[1] = WRONG_CRC;
    plan_device_start(&d);
    plan_device_run(&d, 10 * SECOND);
    IS(MBM_INVALID_CRC, status(0));
    assert_in_range(d.requested, 19, 21);
}

static void a_lost_link_is_the_status_and_the_plan_goes_on_once_it_is_back(void **state)
{
    (void)state;
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

static void a_full_queue_delays_the_plan_and_no_more(void **state)
{
    static mbm_clientRequest own[16];
    unsigned i;

    (void)state;
    add(2, 10, 500);
    d.answers[1] = SILENT;
    for (i = 0; i < COUNT(own); i++) {
        memset(&own[i], 0, sizeof own[i]);
        own[i].unit = 1;
        IS(MBM_PENDING, mbm_client_readHoldingRegisters(&d.client, &own[i], 0, 1));
    }
    plan_device_start(&d);
    OK(mbm_plan_poll(&d.plan));
    assert_int_equal(mbm_plan_pollDelay(&d.plan), UINT32_MAX);
    plan_device_run(&d, 5 * SECOND);
    OK(status(0));
    for (i = 0; i < COUNT(own); i++)
        IS(MBM_RESPONSE_TIMED_OUT, own[i].status);
}

static void the_programs_own_requests_go_beside_the_plan(void **state)
{
    mbm_clientRequest own = {0};
    uint16_t word = 0;

    (void)state;
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

static void many_requests_are_under_way_on_tcp(void **state)
{
    unsigned i;

    (void)state;
    plan_device_begin(&d, 1);
    for (i = 0; i < 6; i++)
        add(1, (uint16_t)(10 * i), SECOND);
    d.setup.requestCount = 4;
    plan_device_start(&d);
    OK(mbm_plan_poll(&d.plan));
    assert_int_equal(mbm_client_pending(&d.client), 4);
    plan_device_run(&d, 200);
    for (i = 0; i < 6; i++) {
        OK(status((uint16_t)i));
        assert_int_equal(plan_device_integer(&d, (uint16_t)i, 0), d.registers[10 * i]);
    }
}

static void many_timeouts_at_once_count_as_one(void **state)
{
    unsigned i;

    (void)state;
    plan_device_begin(&d, 1);
    for (i = 0; i < 6; i++)
        add(1, (uint16_t)(10 * i), 100);
    d.setup.requestCount = 6;
    d.answers[1] = SILENT;
    d.setup.backoffMs = 1000;
    plan_device_start(&d);
    plan_device_run(&d, 1050);
    d.answers[1] = ANSWERS;
    /* Six doublings would be a minute. */
    plan_device_run(&d, 2 * SECOND);
    for (i = 0; i < 6; i++)
        OK(status((uint16_t)i));
}

static void a_refresh_reads_at_once(void **state)
{
    (void)state;
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

static void an_ended_plan_gives_its_requests_up(void **state)
{
    (void)state;
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

static void a_plan_that_was_zeroed_ignores_the_reply(void **state)
{
    (void)state;
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
    (void)field;
    ++*(unsigned *)context;
    OK(mbm_plan_end(plan));
    IS(MBM_NOT_INITIALISED, mbm_plan_refresh(plan, 0));
}

static void update_may_end_the_plan(void **state)
{
    unsigned calls = 0;

    (void)state;
    add(1, 10, SECOND);
    add(1, 11, SECOND);
    d.setup.update = ending;
    d.setup.context = &calls;
    plan_device_start(&d);
    OK(mbm_plan_poll(&d.plan));
    while (mbm_client_poll(&d.client) == MBM_PENDING)
        d.memory.now += 10000;
    assert_int_equal(calls, 1);
}

static void a_request_that_cannot_be_sent_is_a_status(void **state)
{
    (void)state;
    add(1, 10, SECOND);
    plan_device_start(&d);
    memset(&d.client, 0, sizeof d.client);
    IS(MBM_NOT_INITIALISED, mbm_plan_poll(&d.plan));
    assert_int_equal(mbm_plan_pollDelay(&d.plan), UINT32_MAX);
    OK(mbm_plan_end(&d.plan));
}

static void the_clock_may_wrap(void **state)
{
    unsigned i;

    (void)state;
    d.memory.now = UINT32_MAX - 2500000;
    add(1, 10, 500);
    plan_device_start(&d);
    for (i = 0; i < 100; i++) {
        plan_device_run(&d, 100);
        assert_true(age(0) <= 550);
    }
    assert_in_range(d.requested, 19, 21);
}

static void a_plan_that_was_not_polled_for_long_reads_once(void **state)
{
    (void)state;
    add(1, 10, 10);
    plan_device_start(&d);
    plan_device_run(&d, 100);
    d.requested = 0;
    d.memory.now += 3600u * 1000000u;
    plan_device_run(&d, 9);
    assert_in_range(d.requested, 1, 2);
    assert_true(age(0) < 10);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(every_table_is_read_with_its_function, rtu),
        cmocka_unit_test_setup(fields_that_fit_together_are_one_request, rtu),
        cmocka_unit_test_setup(each_read_keeps_its_interval, rtu),
        cmocka_unit_test_setup(reads_of_one_interval_are_spread_over_it, rtu),
        cmocka_unit_test_setup(a_value_is_never_older_than_its_interval_while_its_unit_answers,
                               rtu),
        cmocka_unit_test_setup(a_value_has_no_age_before_it_was_read, rtu),
        cmocka_unit_test_setup(a_unit_that_is_gone_keeps_its_last_value_with_status_and_age, rtu),
        cmocka_unit_test_setup(the_plan_backs_off_from_a_silent_unit_and_goes_on_with_the_rest,
                               rtu),
        cmocka_unit_test_setup(a_silent_unit_with_many_reads_is_tried_with_one_at_a_time, rtu),
        cmocka_unit_test_setup(one_read_without_an_answer_does_not_stop_the_others_of_its_unit,
                               rtu),
        cmocka_unit_test_setup(an_exception_is_an_answer, rtu),
        cmocka_unit_test_setup(half_a_reply_is_no_value, rtu),
        cmocka_unit_test_setup(a_damaged_reply_is_read_again_at_the_interval, rtu),
        cmocka_unit_test_setup(a_lost_link_is_the_status_and_the_plan_goes_on_once_it_is_back, rtu),
        cmocka_unit_test_setup(a_full_queue_delays_the_plan_and_no_more, rtu),
        cmocka_unit_test_setup(the_programs_own_requests_go_beside_the_plan, rtu),
        cmocka_unit_test(many_requests_are_under_way_on_tcp),
        cmocka_unit_test(many_timeouts_at_once_count_as_one),
        cmocka_unit_test_setup(a_refresh_reads_at_once, rtu),
        cmocka_unit_test_setup(an_ended_plan_gives_its_requests_up, rtu),
        cmocka_unit_test_setup(a_plan_that_was_zeroed_ignores_the_reply, rtu),
        cmocka_unit_test_setup(update_may_end_the_plan, rtu),
        cmocka_unit_test_setup(a_request_that_cannot_be_sent_is_a_status, rtu),
        cmocka_unit_test_setup(the_clock_may_wrap, rtu),
        cmocka_unit_test_setup(a_plan_that_was_not_polled_for_long_reads_once, rtu),
    };

    return cmocka_run_group_tests_name("plan", tests, NULL, NULL);
}
