/* A link that rests after it was opened, and one that is closed although it is good. */
#include "linked.h"

FRAMING_TEST(no_request_is_sent_before_the_delay_after_connecting_is_over)
{
    begin(framing);
    OK(mbm_link_setDelayAfterConnect(&kept, 2000));
    queue_read(&request);
    IS(MBM_PENDING, mbm_client_poll(&client));
    assert_string_equal(events, "C00 ");
    run(1999);
    assert_int_equal(m.sent_count, 0);
    IS(MBM_PENDING, request.status);
    run(10);
    assert_true(m.sent_count > 0);
    answer(framing);
    IS(MBM_OK, memory_port_run(&m, &client, &request, 1000));
    /* Once it is over, it stays so, also when the clock wraps. */
    m.now += 0xFFFFFFFFu - 1000000u;
    m.sent_count = 0;
    queue_read(&request);
    memory_port_send(&m, &client);
    assert_true(m.sent_count > 0);
}

TEST(during_the_delay_the_client_sleeps_and_drops_what_arrives)
{
    static const uint8_t noise[] = {1, 2, 3, 4, 5, 6, 7, 8, 9};

    begin_up(MBM_FRAMING_TCP);
    OK(mbm_link_setDelayAfterConnect(&kept, 2000));
    queue_read(&request);
    IS(MBM_PENDING, mbm_client_poll(&client));
    assert_int_equal(mbm_client_pollDelay(&client), 2000 * MS);
    memory_port_bytes(&m, noise, sizeof noise);
    IS(MBM_PENDING, mbm_client_poll(&client));
    assert_int_equal(m.arriving_count, 0);
    /* A loss is noticed; the new connection rests anew. */
    m.now += 1000 * MS;
    m.is_lost = 1;
    (void)mbm_client_poll(&client);
    run(1);
    assert_string_equal(events, "LE6 C00 ");
    run(1990);
    assert_int_equal(m.sent_count, 0);
    run(20);
    answer(MBM_FRAMING_TCP);
    IS(MBM_OK, memory_port_run(&m, &client, &request, 1000));
}

TEST(the_delay_is_0_to_65535)
{
    begin_up(MBM_FRAMING_TCP);
    OK(mbm_link_setDelayAfterConnect(&kept, 65535));
    IS(MBM_INVALID_ARGUMENT, mbm_link_setDelayAfterConnect(&kept, 65536));
    IS(MBM_INVALID_ARGUMENT, mbm_link_setDelayAfterConnect(NULL, 1));
    OK(mbm_link_setDelayAfterConnect(&kept, 0));
    reads_right(MBM_FRAMING_TCP);
}

FRAMING_TEST(a_link_that_closes_when_idle_is_open_for_a_round)
{
    begin_up(framing);
    OK(mbm_link_setClose(&kept, MBM_LINK_CLOSE_WHEN_IDLE));
    for (unsigned round = 1; round < 4; round++) {
        reads_right(framing);
        /* The next request of the round comes before the next poll. */
        m.sent_count = 0;
        reads_right(framing);
        m.sent_count = 0;
        assert_int_equal(disconnects, round - 1);
        OK(mbm_client_poll(&client));
        assert_int_equal(disconnects, round);
        assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_DOWN);
        /* It stays closed, and the client sleeps. */
        assert_int_equal(mbm_client_pollDelay(&client), 1000 * MS);
        run(100000);
        assert_int_equal(connects, round);
    }
    assert_int_equal(counters.lost, 0);
    assert_int_equal(counters.connected, 3);
    assert_string_equal(events, "C00 C00 ");
}

FRAMING_TEST(a_link_that_closes_after_a_failure_opens_for_the_next_request_at_once)
{
    begin_up(framing);
    OK(mbm_link_setClose(&kept, MBM_LINK_CLOSE_AFTER_FAILURE));
    reads_right(framing);
    assert_int_equal(disconnects, 0);
    queue_read(&request);
    IS(MBM_RESPONSE_TIMED_OUT, memory_port_run(&m, &client, &request, 10000));
    run(1);
    assert_int_equal(disconnects, 1);
    assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_DOWN);
    run(100000);
    assert_int_equal(connects, 1);
    m.sent_count = 0;
    reads_right(framing);
    assert_int_equal(connects, 2);
    assert_int_equal(counters.lost, 0);
    assert_string_equal(events, "C00 ");
}

TEST(a_request_that_waits_is_sent_over_the_new_connection)
{
    begin_up(MBM_FRAMING_TCP);
    OK(mbm_client_setInFlight(&client, 1));
    OK(mbm_link_setClose(&kept, MBM_LINK_CLOSE_AFTER_FAILURE));
    queue_read(&request);
    queue_read(&other);
    run(310);
    IS(MBM_RESPONSE_TIMED_OUT, request.status);
    IS(MBM_PENDING, other.status);
    assert_int_equal(disconnects, 1);
    assert_int_equal(connects, 2);
    assert_int_equal(m.sent_count, 24);
    memmove(m.sent, m.sent + 12, 12);
    answer(MBM_FRAMING_TCP);
    IS(MBM_OK, memory_port_run(&m, &client, &other, 1000));
}

TEST(a_repetition_goes_over_a_new_connection_too)
{
    static const uint8_t malformed[] = {UNIT, 3, 4, 1, 2, 3, 4};

    for (unsigned is_malformed = 0; is_malformed < 2; is_malformed++) {
        begin_up(MBM_FRAMING_RTU_OVER_TCP);
        OK(mbm_client_setRetries(&client, 1));
        OK(mbm_link_setClose(&kept, MBM_LINK_CLOSE_AFTER_FAILURE));
        queue_read(&request);
        memory_port_send(&m, &client);
        if (is_malformed)
            memory_port_rtu(&m, malformed, sizeof malformed);
        run(310);
        assert_int_equal(connects, 2);
        assert_int_equal(m.sent_count, 16);
        answer(MBM_FRAMING_RTU_OVER_TCP);
        IS(MBM_OK, memory_port_run(&m, &client, &request, 1000));
        assert_int_equal(connects, 2);
    }
}

TEST(a_link_may_close_when_idle_and_after_a_failure)
{
    begin_up(MBM_FRAMING_TCP);
    OK(mbm_client_setInFlight(&client, 1));
    OK(mbm_link_setClose(&kept, MBM_LINK_CLOSE_WHEN_IDLE | MBM_LINK_CLOSE_AFTER_FAILURE));
    reads_right(MBM_FRAMING_TCP);
    OK(mbm_client_poll(&client));
    assert_int_equal(disconnects, 1);
    queue_read(&request);
    queue_read(&other);
    run(310);
    IS(MBM_RESPONSE_TIMED_OUT, request.status);
    IS(MBM_PENDING, other.status);
    assert_int_equal(disconnects, 2);
    assert_int_equal(connects, 3);
}

TEST(an_exception_is_no_failure)
{
    uint8_t exception[] = {0, 0, 0, 0, 0, 3, UNIT, 0x83, 2};

    begin_up(MBM_FRAMING_TCP);
    OK(mbm_link_setClose(&kept, MBM_LINK_CLOSE_AFTER_FAILURE));
    queue_read(&request);
    memory_port_send(&m, &client);
    memcpy(exception, m.sent, 2);
    memory_port_bytes(&m, exception, sizeof exception);
    IS(MBM_ILLEGAL_DATA_ADDRESS, memory_port_run(&m, &client, &request, 1000));
    run(10);
    assert_int_equal(disconnects, 0);
    assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_UP);
}

TEST(a_link_that_is_told_to_stay_open_does)
{
    begin_up(MBM_FRAMING_TCP);
    OK(mbm_link_setClose(&kept, MBM_LINK_CLOSE_WHEN_IDLE));
    OK(mbm_link_setClose(&kept, MBM_LINK_CLOSE_NEVER));
    IS(MBM_INVALID_ARGUMENT, mbm_link_setClose(&kept, 4));
    IS(MBM_INVALID_ARGUMENT, mbm_link_setClose(NULL, 1));
    reads_right(MBM_FRAMING_TCP);
    run(10000);
    assert_int_equal(disconnects, 0);
}

TEST(a_connection_that_cannot_be_made_again_is_waited_for_as_after_a_loss)
{
    begin_up(MBM_FRAMING_TCP);
    OK(mbm_link_setClose(&kept, MBM_LINK_CLOSE_AFTER_FAILURE));
    queue_read(&request);
    IS(MBM_RESPONSE_TIMED_OUT, memory_port_run(&m, &client, &request, 10000));
    connects_with = MBM_LINK_LOST;
    queue_read(&request);
    IS(MBM_LINK_LOST, memory_port_run(&m, &client, &request, 10000));
    assert_int_equal(connects, 2);
    connects_with = MBM_OK;
    assert_in_range(next_attempt(), 400, 501);
    m.sent_count = 0;
    reads_right(MBM_FRAMING_TCP);
}
