/* A client's link: when it is opened again, and what becomes of requests meanwhile. */
#include "linked.h"

TEST(a_link_is_opened_in_the_first_poll)
{
    for (unsigned i = 0; i < COUNT(framings); i++) {
        begin(framings[i]);
        assert_int_equal(mbm_link_state(&kept), 0);
        assert_int_equal(connects, 0);
        assert_int_equal(mbm_client_pollDelay(&client), 0);
        OK(mbm_client_poll(&client));
        assert_int_equal(connects, 1);
        assert_int_equal(disconnects, 0);
        assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_UP);
        assert_int_equal(mbm_client_isConnected(&client), 1);
        assert_string_equal(events, "C00 ");
        queue_read(&request);
        memory_port_send(&m, &client);
        answer(framings[i]);
        IS(MBM_OK, memory_port_run(&m, &client, &request, 1000));
        assert_int_equal(words[0], 0x1234);
    }
}

TEST(a_link_that_is_open_already_is_used_as_it_is)
{
    begin(MBM_FRAMING_TCP);
    status_is = MBM_OK;
    OK(mbm_client_poll(&client));
    assert_int_equal(connects + disconnects, 0);
    assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_UP);

    begin(MBM_FRAMING_TCP);
    status_is = MBM_PENDING;
    OK(mbm_client_poll(&client));
    assert_int_equal(connects + disconnects, 0);
    assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_CONNECTING);
    status_is = MBM_OK;
    OK(mbm_client_poll(&client));
    assert_int_equal(connects + disconnects, 0);
    assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_UP);
}

TEST(the_loss_of_the_link_is_noticed_while_the_client_is_idle)
{
    for (unsigned i = 0; i < COUNT(framings); i++) {
        begin_up(framings[i]);
        assert_int_equal(mbm_client_pollDelay(&client), 1000 * MS);
        run(10000);
        assert_string_equal(events, "");
        m.is_lost = 1;
        OK(mbm_client_poll(&client));
        assert_string_equal(events, "LE6 ");
        assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_DOWN);
        assert_int_equal(mbm_client_isConnected(&client), 0);
        assert_int_equal(disconnects, 1);
        assert_int_equal(mbm_client_pollDelay(&client), 500 * MS);
        assert_int_equal(next_attempt(), 500);
        assert_string_equal(events, "LE6 C00 ");
        assert_int_equal(mbm_client_isConnected(&client), 1);
        assert_int_equal(disconnects, 1);
        assert_int_equal(counters.attempts, 2);
        assert_int_equal(counters.connected, 2);
        assert_int_equal(counters.lost, 1);
        assert_int_equal(counters.failed, 0);
    }
}

TEST(bytes_that_arrive_while_the_client_is_idle_are_dropped)
{
    static const uint8_t late[] = {0, 9, 0, 0, 0, 5, UNIT, 3, 2, 0xAA, 0xAA, 0, 9, 0, 0};

    for (unsigned i = 0; i < COUNT(framings); i++) {
        mbm_counters counted = {0};

        begin_up(framings[i]);
        OK(mbm_client_setCounters(&client, &counted));
        memory_port_bytes(&m, late, sizeof late);
        OK(mbm_client_poll(&client));
        OK(mbm_client_poll(&client));
        assert_int_equal(m.arriving_count, 0);
        assert_int_equal(counted.bytesReceived, sizeof late);
        /* A frame that has begun while the client was idle does not hide the reply. */
        queue_read(&request);
        memory_port_send(&m, &client);
        if (framings[i] == MBM_FRAMING_TCP) {
            assert_int_equal(counted.foreignFrames, 1);
            memory_port_bytes(&m, late + 4, 7);
        }
        answer(framings[i]);
        IS(MBM_OK, memory_port_run(&m, &client, &request, 1000));
        assert_int_equal(words[0], 0x1234);
        assert_int_equal(counted.resynchronisations, 0);
    }
}

TEST(the_gap_is_kept_after_bytes_that_arrived_while_idle)
{
    begin_up(MBM_FRAMING_RTU);
    OK(mbm_client_setBaudRate(&client, 9600));
    run(1000);
    memory_port_bytes(&m, frame, 1);
    OK(mbm_client_poll(&client));
    queue_read(&request);
    IS(MBM_PENDING, mbm_client_poll(&client));
    assert_int_equal(m.sent_count, 0);
    assert_in_range(mbm_client_pollDelay(&client), 4000, 4020);
}

TEST(the_wait_grows_from_attempt_to_attempt)
{
    begin_up(MBM_FRAMING_TCP);
    OK(mbm_link_setBackoff(&kept, MBM_BACKOFF_EXPONENTIAL, 100, 1000));
    run(5000);
    m.is_lost = 1;
    connects_with = MBM_LINK_LOST;
    assert_int_equal(next_attempt(), 1000 + 100); /* The idle client looks once a second. */
    assert_int_equal(next_attempt(), 200);
    assert_int_equal(next_attempt(), 400);
    assert_int_equal(next_attempt(), 800);
    assert_int_equal(next_attempt(), 1000);
    assert_int_equal(next_attempt(), 1000);
    assert_int_equal(counters.failed, 6);
    assert_string_equal(events, "LE6 FE6 FE6 FE6 FE6 FE6 FE6 ");
    assert_int_equal(disconnects, 7);

    OK(mbm_link_setBackoff(&kept, MBM_BACKOFF_LINEAR, 100, 1000));
    OK(mbm_link_reconnect(&kept));
    assert_int_equal(next_attempt(), 0);
    assert_int_equal(next_attempt(), 100);
    assert_int_equal(next_attempt(), 200);
    assert_int_equal(next_attempt(), 300);
    OK(mbm_link_setBackoff(&kept, MBM_BACKOFF_FIXED, 100, 1000));
    (void)next_attempt();
    assert_int_equal(next_attempt(), 100);
    assert_int_equal(next_attempt(), 100);
}

TEST(a_peer_that_closes_each_connection_at_once_is_asked_less_and_less)
{
    begin_up(MBM_FRAMING_TCP);
    OK(mbm_link_setBackoff(&kept, MBM_BACKOFF_EXPONENTIAL, 100, 30000));
    run(2000);
    for (unsigned i = 0; i < 5; i++) {
        m.is_lost = 1;
        OK(mbm_client_poll(&client));
        assert_int_equal(next_attempt(), 100u << i);
    }
    /* The link is open for long enough, so the waits start anew. */
    run(1500);
    run(500);
    m.is_lost = 1;
    OK(mbm_client_poll(&client));
    assert_int_equal(next_attempt(), 100);
}

TEST(jitter_shortens_the_wait)
{
    begin_up(MBM_FRAMING_TCP);
    OK(mbm_link_setBackoff(&kept, MBM_BACKOFF_FIXED, 1000, 1000));
    OK(mbm_link_setJitter(&kept, 50, half, &m));
    m.is_lost = 1;
    OK(mbm_client_poll(&client));
    assert_in_range(next_attempt(), 740, 760);
}

TEST(requests_fail_while_the_link_is_down)
{
    for (unsigned i = 0; i < COUNT(framings); i++) {
        begin_up(framings[i]);
        connects_with = MBM_LINK_LOST;
        queue_read(&request);
        memory_port_send(&m, &client);
        queue_read(&other);
        m.is_lost = 1;
        IS(MBM_OK, mbm_client_poll(&client));
        IS(MBM_LINK_LOST, request.status);
        IS(MBM_LINK_LOST, other.status);
        assert_string_equal(events, "LE6 ");
        queue_read(&other);
        assert_int_equal(mbm_client_pollDelay(&client), 0);
        OK(mbm_client_poll(&client));
        IS(MBM_LINK_LOST, other.status);
        assert_int_equal(mbm_client_pollDelay(&client), 500 * MS);
    }
}

TEST(requests_that_were_not_sent_wait_for_the_link)
{
    for (unsigned i = 0; i < COUNT(framings); i++) {
        begin_up(framings[i]);
        OK(mbm_link_setRequestsWait(&kept, 1));
        OK(mbm_client_setInFlight(&client, 1));
        OK(mbm_client_setRetries(&client, 3));
        connects_with = MBM_LINK_LOST;
        queue_read(&request);
        memory_port_send(&m, &client);
        queue_read(&other);
        IS(MBM_PENDING, mbm_client_poll(&client));
        m.is_lost = 1;
        IS(MBM_PENDING, mbm_client_poll(&client));
        /* The device may have carried it out, so it is not repeated. */
        IS(MBM_LINK_LOST, request.status);
        IS(MBM_PENDING, other.status);
        queue_read(&request);
        run(100000);
        IS(MBM_PENDING, other.status);
        IS(MBM_PENDING, request.status);
        OK(mbm_client_cancel(&client, &request));
        IS(MBM_CANCELLED, request.status);
        connects_with = MBM_OK;
        m.sent_count = 0;
        (void)next_attempt();
        memory_port_send(&m, &client);
        answer(framings[i]);
        IS(MBM_OK, memory_port_run(&m, &client, &other, 1000));
        assert_int_equal(mbm_client_pending(&client), 0);
    }
}

TEST(requests_wait_while_the_first_connection_is_being_made)
{
    for (unsigned i = 0; i < COUNT(framings); i++) {
        begin(framings[i]);
        connects_with = MBM_PENDING;
        queue_read(&request);
        IS(MBM_PENDING, mbm_client_poll(&client));
        status_is = MBM_PENDING;
        run(9000);
        IS(MBM_PENDING, request.status);
        assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_CONNECTING);
        assert_int_equal(connects, 1);
        m.is_lost = 0;
        status_is = MBM_OK;
        memory_port_send(&m, &client);
        answer(framings[i]);
        IS(MBM_OK, memory_port_run(&m, &client, &request, 1000));
    }
}

TEST(a_connection_that_takes_too_long_has_failed)
{
    begin(MBM_FRAMING_TCP);
    connects_with = MBM_PENDING;
    OK(mbm_client_poll(&client));
    status_is = MBM_PENDING;
    queue_read(&request);
    assert_in_range(mbm_client_pollDelay(&client), 1, 100 * MS);
    run(9999);
    assert_string_equal(events, "");
    run(2);
    assert_string_equal(events, "FF7 ");
    assert_int_equal(disconnects, 1);
    IS(MBM_CONNECT_TIMED_OUT, request.status);
    assert_in_range(next_attempt(), 499, 500);
    OK(mbm_link_setConnectTimeout(&kept, 50));
    (void)next_attempt();
    run(49);
    assert_int_equal(counters.failed, 2);
    run(2);
    assert_int_equal(counters.failed, 3);
    OK(mbm_link_setConnectTimeout(&kept, 0));
    (void)next_attempt();
    run(1000000);
    assert_int_equal(counters.failed, 3);
    assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_CONNECTING);
    status_is = MBM_SERVER_DEVICE_FAILURE;
    OK(mbm_client_poll(&client));
    assert_int_equal(counters.failed, 4);
    /* This attempt has failed for another reason. */
    queue_read(&request);
    run(1);
    IS(MBM_LINK_LOST, request.status);
}

TEST(a_link_without_a_status_hook_waits_for_the_connect_timeout)
{
    const mbm_linkHooks one = {.context = &m, .connect = connect_hook};

    begin(MBM_FRAMING_TCP);
    OK(mbm_link_begin(&kept, &client, &one));
    OK(mbm_client_poll(&client));
    assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_UP);
    m.is_lost = 1;
    OK(mbm_client_poll(&client));
    assert_int_equal(next_attempt(), 500);
    assert_int_equal(disconnects, 0);
}
