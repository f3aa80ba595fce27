/* What a plan does if units do not answer, or not well: over a port in memory with a clock of its
 * own. */
#include "plan_fixture.h"
#include "test.h"

#include <string.h>

fixture each_test = {rtu, NULL};

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
