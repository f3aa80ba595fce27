/* A client's link: what it does when the peer closes connections that are idle, or falls silent on
 * one that stays open. */
#include "linked.h"

static const uint8_t streams[] = {MBM_FRAMING_TCP, MBM_FRAMING_RTU_OVER_TCP};

/* A link that has been open for two seconds, over which one request was answered. */
static void begin_good(int framing)
{
    begin_up(framing);
    queue_read(&request);
    memory_port_send(&m, &client);
    answer(framing);
    IS(MBM_OK, memory_port_run(&m, &client, &request, 1000));
    run(2000);
    m.sent_count = 0;
    connects = disconnects = 0;
}

/* The request goes out over the open link, and is answered. */
static void is_answered(int framing, mbm_clientRequest *which)
{
    memory_port_send(&m, &client);
    assert_true(m.sent_count > 0);
    answer(framing);
    IS(MBM_OK, memory_port_run(&m, &client, which, 1000));
    assert_int_equal(words[0], 0x1234);
}

TEST(a_request_that_finds_the_link_closed_opens_it_at_once)
{
    unsigned noticed;

    for (unsigned i = 0; i < 2 * COUNT(framings); i++) {
        const int framing = framings[i / 2];
        uint32_t before;

        noticed = i % 2;
        begin_good(framing);
        m.is_lost = 1;
        if (noticed) {
            OK(mbm_client_poll(&client));
            assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_DOWN);
            run(100);
            assert_int_equal(connects, 0);
        }
        before = m.now;
        queue_read(&request);
        assert_int_equal(mbm_client_pollDelay(&client), 0);
        IS(MBM_PENDING, mbm_client_poll(&client));
        if (!noticed) {
            /* Not a byte was lost with the old link. */
            assert_int_equal(mbm_client_pollDelay(&client), 0);
            IS(MBM_PENDING, mbm_client_poll(&client));
        }
        assert_int_equal(connects, 1);
        assert_int_equal(connected_at, before);
        assert_int_equal(disconnects, 1);
        assert_string_equal(events, "LE6 C00 ");
        is_answered(framing, &request);
    }
}

/* A device that serves one request with each connection. */
TEST(a_peer_that_closes_the_link_after_each_reply_answers_each_request)
{
    for (unsigned i = 0; i < COUNT(streams); i++) {
        begin_good(streams[i]);
        for (unsigned round = 0; round < 20; round++) {
            m.is_lost = 1;
            queue_read(&request);
            m.sent_count = 0;
            is_answered(streams[i], &request);
            events[0] = '\0';
        }
        assert_int_equal(connects, 20);
        assert_int_equal(counters.failed, 0);
    }
}

TEST(a_request_waits_for_the_opening_as_long_as_its_response_timeout)
{
    for (unsigned i = 0; i < COUNT(framings); i++) {
        begin_good(framings[i]);
        m.is_lost = 1;
        connects_with = status_is = MBM_PENDING;
        other.timeoutMs = 900;
        queue_read(&request);
        queue_read(&other);
        run(299);
        IS(MBM_PENDING, request.status);
        run(60);
        IS(MBM_CONNECT_TIMED_OUT, request.status);
        IS(MBM_PENDING, other.status);
        run(540);
        IS(MBM_PENDING, other.status);
        run(60);
        IS(MBM_CONNECT_TIMED_OUT, other.status);
        /* The attempt itself goes on. */
        assert_int_equal(connects, 1);
        assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_CONNECTING);
        assert_int_equal(m.sent_count, 0);
        m.is_lost = 0;
        status_is = MBM_OK;
        queue_read(&request);
        is_answered(framings[i], &request);
    }
}

TEST(requests_that_wait_for_the_link_wait_longer)
{
    begin_good(MBM_FRAMING_TCP);
    OK(mbm_link_setRequestsWait(&kept, 1));
    m.is_lost = 1;
    connects_with = status_is = MBM_PENDING;
    queue_read(&request);
    run(9000);
    IS(MBM_PENDING, request.status);
    m.is_lost = 0;
    status_is = MBM_OK;
    is_answered(MBM_FRAMING_TCP, &request);
}

TEST(only_a_failed_opening_backs_off)
{
    for (unsigned i = 0; i < COUNT(framings); i++) {
        begin_good(framings[i]);
        m.is_lost = 1;
        connects_with = MBM_LINK_LOST;
        queue_read(&request);
        run(1);
        IS(MBM_LINK_LOST, request.status);
        assert_string_equal(events, "LE6 FE6 ");
        queue_read(&request);
        OK(mbm_client_poll(&client));
        IS(MBM_LINK_LOST, request.status);
        assert_int_equal(connects, 1);
        assert_in_range(next_attempt(), 498, 500);
        assert_int_equal(next_attempt(), 1000);
        assert_int_equal(m.sent_count, 0);
    }
}

TEST(a_peer_that_closes_each_connection_at_once_is_not_asked_for_each_request)
{
    begin_good(MBM_FRAMING_TCP);
    m.is_lost = 1;
    for (unsigned i = 0; i < 1000; i++) {
        queue_read(&request);
        run(5);
        m.is_lost = 1;
        run(5);
        IS(MBM_LINK_LOST, request.status);
    }
    /* Ten seconds: at once, and after 0.5, 1, 2 and 4 seconds. */
    assert_in_range(connects, 4, 6);
}

TEST(a_request_that_was_sent_is_not_sent_again_over_the_new_link)
{
    for (unsigned i = 0; i < COUNT(framings); i++) {
        begin_good(framings[i]);
        OK(mbm_client_setRetries(&client, 3));
        IS(MBM_PENDING, mbm_client_writeSingleRegister(&client, &request, 1, 2));
        memory_port_send(&m, &client);
        m.is_lost = 1;
        queue_read(&other);
        run(1);
        IS(MBM_LINK_LOST, request.status);
        m.sent_count = 0;
        is_answered(framings[i], &other);
        assert_int_equal(connects, 1);
        assert_int_equal(m.sent[framings[i] == MBM_FRAMING_TCP ? 7 : 1],
                         framings[i] == MBM_FRAMING_ASCII ? '0' : 3);
        run(5000);
        assert_int_equal(mbm_client_pending(&client), 0);
    }
}

TEST(a_link_that_its_peer_closes_twice_while_idle_waits_for_a_request)
{
    for (unsigned i = 0; i < COUNT(framings); i++) {
        begin_good(framings[i]);
        OK(mbm_link_setBackoff(&kept, MBM_BACKOFF_FIXED, 1000, 1000));
        m.is_lost = 1;
        OK(mbm_client_poll(&client));
        assert_int_equal(next_attempt(), 1000);
        run(2000);
        m.is_lost = 1;
        run(3600000);
        assert_int_equal(connects, 1);
        assert_in_range(mbm_client_pollDelay(&client), 1, 1000 * MS);
        queue_read(&request);
        assert_int_equal(mbm_client_pollDelay(&client), 0);
        is_answered(framings[i], &request);
        assert_int_equal(connects, 2);
        /* Its answer shows that it is in use: it is opened again without a request, once. */
        m.is_lost = 1;
        run(2100);
        assert_int_equal(connects, 3);
        m.is_lost = 1;
        run(100000);
        assert_int_equal(connects, 3);
        OK(mbm_link_reconnect(&kept));
        assert_int_equal(next_attempt(), 0);
    }
}

/* --- a device that falls silent --- */

/* Sends a request that gets no byte. */
static void is_unanswered(mbm_clientRequest *which)
{
    m.sent_count = 0;
    queue_read(which);
    IS(MBM_RESPONSE_TIMED_OUT, memory_port_run(&m, &client, which, 1000));
}

TEST(a_silent_connection_is_replaced_after_two_requests)
{
    for (unsigned i = 0; i < COUNT(streams); i++) {
        begin_good(streams[i]);
        for (unsigned round = 1; round < 5; round++) {
            events[0] = '\0';
            is_unanswered(&request);
            assert_int_equal(connects, round - 1);
            is_unanswered(&request);
            m.sent_count = 0;
            queue_read(&request);
            is_answered(streams[i], &request);
            assert_int_equal(connects, round);
            assert_int_equal(disconnects, round);
            assert_string_equal(events, "LE2 C00 ");
            assert_int_equal(counters.lost, round);
        }
    }
}

/* A unit behind a gateway is absent, and the gateway says nothing. Another one is there. */
TEST(a_silent_unit_costs_the_others_no_request)
{
    for (unsigned i = 0; i < COUNT(streams); i++) {
        begin_up(streams[i]);
        connects = 0;
        OK(mbm_client_setResponseTimeout(&client, 20));
        /* After 2, 4, 8 and 16 requests. */
        for (unsigned round = 0; round < 30; round++)
            is_unanswered(&request);
        assert_int_equal(counters.lost, 4);
        m.sent_count = 0;
        queue_read(&other);
        is_answered(streams[i], &other);
        assert_int_equal(connects, 4);
        assert_int_equal(counters.failed, 0);
    }
}

TEST(a_repetition_goes_over_the_new_connection)
{
    for (unsigned i = 0; i < COUNT(streams); i++) {
        begin_good(streams[i]);
        OK(mbm_client_setRetries(&client, 2));
        queue_read(&request);
        run(301);
        assert_int_equal(connects, 0);
        m.sent_count = 0;
        run(301);
        assert_int_equal(connects, 1);
        is_answered(streams[i], &request);
    }
}

TEST(any_byte_begins_the_count_anew)
{
    static const uint8_t noise = 0xA5;

    for (unsigned i = 0; i < COUNT(streams); i++) {
        begin_good(streams[i]);
        for (unsigned round = 0; round < 20; round++) {
            queue_read(&request);
            memory_port_send(&m, &client);
            if (round % 2)
                memory_port_bytes(&m, &noise, 1);
            (void)memory_port_run(&m, &client, &request, 1000);
            assert_int_not_equal(request.status, MBM_OK);
        }
        assert_int_equal(connects, 0);
    }
}

TEST(requests_of_a_program_with_limits_of_its_own_count_too)
{
    for (unsigned i = 0; i < COUNT(streams); i++) {
        begin_good(streams[i]);
        /* Each is cancelled after 20 ms. The response timeout is 300 ms. */
        for (unsigned round = 0; round < 15; round++) {
            assert_int_equal(connects, 0);
            queue_read(&request);
            run(20);
            OK(mbm_client_cancel(&client, &request));
        }
        run(100);
        queue_read(&request);
        run(20);
        assert_int_equal(connects, 1);
    }
}

TEST(cancelled_requests_alone_do_not_close_a_connection)
{
    begin_good(MBM_FRAMING_TCP);
    for (unsigned round = 0; round < 100; round++) {
        unsigned cancelled;

        for (cancelled = 0; cancelled < 5; cancelled++) {
            queue_read(&request);
            run(10);
            OK(mbm_client_cancel(&client, &request));
        }
        queue_read(&request);
        m.sent_count = 0;
        is_answered(MBM_FRAMING_TCP, &request);
    }
    assert_int_equal(connects, 0);
}

TEST(the_limit_is_a_setting)
{
    IS(MBM_INVALID_ARGUMENT, mbm_link_setReplaceAfter(NULL, 1));
    begin(MBM_FRAMING_TCP);
    IS(MBM_INVALID_ARGUMENT, mbm_link_setReplaceAfter(&kept, 101));
    for (unsigned i = 0; i < COUNT(framings); i++) {
        const int is_stream =
            framings[i] == MBM_FRAMING_TCP || framings[i] == MBM_FRAMING_RTU_OVER_TCP;

        begin_good(framings[i]);
        if (is_stream)
            OK(mbm_link_setReplaceAfter(&kept, 0));
        for (unsigned round = 0; round < 200; round++)
            is_unanswered(&request);
        OK(mbm_client_poll(&client));
        assert_int_equal(connects, 0);
        assert_int_equal(counters.lost, 0);
        OK(mbm_link_setReplaceAfter(&kept, 100));
        OK(mbm_client_poll(&client));
        assert_int_equal(counters.lost, 1);
        OK(mbm_link_setReplaceAfter(&kept, 1));
        is_unanswered(&request);
        assert_int_equal(counters.lost, 2);
    }
}

TEST(a_response_of_the_old_connection_is_not_taken_for_one_of_the_new)
{
    uint8_t late[11] = {0, 0, 0, 0, 0, 5, UNIT, 3, 2, 0x66, 0x66};

    begin_good(MBM_FRAMING_TCP);
    is_unanswered(&request);
    m.sent_count = 0;
    is_unanswered(&request);
    memcpy(late, m.sent, 2);
    m.sent_count = 0;
    queue_read(&request);
    memory_port_send(&m, &client);
    assert_int_equal(connects, 1);
    memory_port_bytes(&m, late, sizeof late);
    is_answered(MBM_FRAMING_TCP, &request);
}

/* Two requests time out while three that were sent later may still be answered. */
TEST(requests_in_flight_have_their_time_before_a_connection_is_replaced)
{
    static mbm_clientRequest late[3];
    uint8_t reply[11] = {0, 0, 0, 0, 0, 5, UNIT, 3, 2, 0x12, 0x34};

    for (unsigned answered = 0; answered < 2; answered++) {
        begin_good(MBM_FRAMING_TCP);
        queue_read(&request);
        queue_read(&other);
        run(100);
        m.sent_count = 0;
        for (unsigned i = 0; i < COUNT(late); i++) {
            late[i] = (mbm_clientRequest){.unit = UNIT, .reply = words, .replyBytes = 2};
            queue_read(&late[i]);
        }
        run(201);
        IS(MBM_RESPONSE_TIMED_OUT, request.status);
        IS(MBM_RESPONSE_TIMED_OUT, other.status);
        if (answered) {
            memcpy(reply, m.sent, 2);
            memory_port_bytes(&m, reply, sizeof reply);
        }
        run(101);
        IS(answered ? MBM_OK : MBM_RESPONSE_TIMED_OUT, late[0].status);
        IS(MBM_RESPONSE_TIMED_OUT, late[1].status);
        IS(MBM_RESPONSE_TIMED_OUT, late[2].status);
        assert_int_equal(counters.lost, answered ? 0 : 1);
    }
}
