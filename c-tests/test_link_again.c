/* A client's link: what it does when the peer closes connections that are idle, or falls silent on
 * one that stays open. */
#include "every_call.h"
#include "linked.h"

/* A link that has been open for two seconds, over which one request was answered. */
static void begin_good(int framing)
{
    begin_up(framing);
    reads_right(framing);
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
STREAM_TEST(a_peer_that_closes_the_link_after_each_reply_answers_each_request)
{
    begin_good(framing);
    for (unsigned round = 0; round < 20; round++) {
        m.is_lost = 1;
        queue_read(&request);
        m.sent_count = 0;
        is_answered(framing, &request);
        events[0] = '\0';
    }
    assert_int_equal(connects, 20);
    assert_int_equal(counters.failed, 0);
}

FRAMING_TEST(a_request_waits_for_the_opening_as_long_as_its_response_timeout)
{
    begin_good(framing);
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
    is_answered(framing, &request);
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

FRAMING_TEST(only_a_failed_opening_backs_off)
{
    begin_good(framing);
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

FRAMING_TEST(a_request_that_was_sent_is_not_sent_again_over_the_new_link)
{
    begin_good(framing);
    OK(mbm_client_setRetries(&client, 3));
    IS(MBM_PENDING, mbm_client_writeSingleRegister(&client, &request, 1, 2));
    memory_port_send(&m, &client);
    m.is_lost = 1;
    queue_read(&other);
    run(1);
    IS(MBM_LINK_LOST, request.status);
    m.sent_count = 0;
    is_answered(framing, &other);
    assert_int_equal(connects, 1);
    assert_int_equal(m.sent[framing == MBM_FRAMING_TCP ? 7 : 1],
                     framing == MBM_FRAMING_ASCII ? '0' : 3);
    run(5000);
    assert_int_equal(mbm_client_pending(&client), 0);
}

FRAMING_TEST(a_link_that_its_peer_closes_twice_while_idle_waits_for_a_request)
{
    begin_good(framing);
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
    is_answered(framing, &request);
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

/* --- a device that falls silent --- */

/* Sends a request that gets no byte. */
static void is_unanswered(mbm_clientRequest *which)
{
    m.sent_count = 0;
    queue_read(which);
    IS(MBM_RESPONSE_TIMED_OUT, memory_port_run(&m, &client, which, 1000));
}

STREAM_TEST(a_silent_connection_is_replaced_after_two_requests)
{
    begin_good(framing);
    for (unsigned round = 1; round < 5; round++) {
        events[0] = '\0';
        is_unanswered(&request);
        assert_int_equal(connects, round - 1);
        is_unanswered(&request);
        m.sent_count = 0;
        queue_read(&request);
        is_answered(framing, &request);
        assert_int_equal(connects, round);
        assert_int_equal(disconnects, round);
        assert_string_equal(events, "LE2 C00 ");
        assert_int_equal(counters.lost, round);
    }
}

/* A unit on a gateway's line is absent, and the gateway sends nothing. Another one is there. */
STREAM_TEST(a_silent_unit_costs_the_others_no_request)
{
    begin_up(framing);
    connects = 0;
    OK(mbm_client_setResponseTimeout(&client, 20));
    /* After 2, 4, 8 and 16 requests. */
    for (unsigned round = 0; round < 30; round++)
        is_unanswered(&request);
    assert_int_equal(counters.lost, 4);
    m.sent_count = 0;
    queue_read(&other);
    is_answered(framing, &other);
    assert_int_equal(connects, 4);
    assert_int_equal(counters.failed, 0);
}

STREAM_TEST(a_repetition_goes_over_the_new_connection)
{
    begin_good(framing);
    OK(mbm_client_setRetries(&client, 2));
    queue_read(&request);
    run(301);
    assert_int_equal(connects, 0);
    m.sent_count = 0;
    run(301);
    assert_int_equal(connects, 1);
    is_answered(framing, &request);
}

STREAM_TEST(any_byte_begins_the_count_anew)
{
    static const uint8_t noise = 0xA5;

    begin_good(framing);
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

STREAM_TEST(requests_of_a_program_with_limits_of_its_own_count_too)
{
    begin_good(framing);
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

/* A link that begins, or is closed, while requests of its client are in flight: they end, and
 * nothing of them is sent or received over the link that is opened then. */

enum { NOTHING = 0, ALL = 0xFFFF };

/* How many bytes the port accepts at a time, and whether the driver is on. */
static uint16_t accepts;
static int driver;

static int16_t accept_some(void *context, const uint8_t *bytes, uint16_t length)
{
    const mbm_port port = memory_port_of(&m);

    return port.write(context, bytes, length < accepts ? length : accepts);
}

static void driver_on(void *context)
{
    driver++;
}

static void driver_off(void *context)
{
    driver--;
}

/* A client without a link. Then `request` is queued and polled until it is in flight, or, if the
 * port accepts nothing, until it waits for the port. */
static void begin_in_flight(int framing, uint16_t accepted)
{
    mbm_port port = memory_port_of(&m);

    begin(framing);
    OK(mbm_link_end(&kept));
    port.write = accept_some;
    port.preTransmission = driver_on;
    port.postTransmission = driver_off;
    memset(&client, 0, sizeof client);
    driver = 0;
    OK(CLIENT_BEGIN(&client, framing, &port, frame, outgoing));
    if (framing == MBM_FRAMING_TCP)
        OK(mbm_client_setInFlight(&client, 1));
    OK(mbm_client_setResponseTimeout(&client, 300));
    OK(mbm_client_setQuietTime(&client, 0));
    accepts = accepted;
    IS(MBM_PENDING, mbm_client_writeSingleRegister(&client, &request, 7, 0xBEEF));
    for (m.now += 10 * MS; m.sent_count == 0; m.now += MS) {
        IS(MBM_PENDING, mbm_client_poll(&client));
        if (accepted == NOTHING && m.now > 15 * MS)
            break;
    }
}

static void begin_link(void)
{
    OK(mbm_link_begin(&kept, &client, &hooks));
    OK(mbm_link_setBackoff(&kept, MBM_BACKOFF_FIXED, 100, 100));
    OK(mbm_link_setConnectTimeout(&kept, 100));
    OK(mbm_link_setCallback(&kept, changed, &kept));
}

/* The link is open: a request is sent, is the first that is sent, and is answered. */
static void works_over_the_new_link(int framing)
{
    static const uint8_t read_rtu[] = {UNIT, 3}, read_ascii[] = ":0703", read_tcp[] = {UNIT, 3};

    accepts = ALL;
    m.is_lost = 0;
    assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_UP);
    assert_int_equal(m.sent_count, 0);
    queue_read(&other);
    memory_port_send(&m, &client);
    switch (framing) {
    case MBM_FRAMING_ASCII: assert_memory_equal(m.sent, read_ascii, 5); break;
    case MBM_FRAMING_TCP: assert_memory_equal(m.sent + 6, read_tcp, 2); break;
    default: assert_memory_equal(m.sent, read_rtu, 2); break;
    }
    answer(framing);
    IS(MBM_OK, memory_port_run(&m, &client, &other, 1000));
    assert_int_equal(words[0], 0x1234);
    assert_int_equal(mbm_client_pending(&client), 0);
    assert_int_equal(driver, 0);
}

/* The results of `status` and `connect` in the first polls. */
static const struct {
    uint8_t status_is, connects_with;
} courses[] = {
    {MBM_LINK_LOST, MBM_OK},
    {MBM_LINK_LOST, MBM_PENDING},
    {MBM_LINK_LOST, MBM_LINK_LOST},
    {MBM_PENDING, MBM_OK}, /* status fails later, and connect succeeds */
};

static void requests_in_flight_end_when_the_link_was_closed(uint16_t accepted)
{
    for (unsigned i = 0; i < COUNT(framings); i++)
        for (unsigned j = 0; j < COUNT(courses); j++)
            for (unsigned waits = 0; waits < 2; waits++) {
                begin_in_flight(framings[i], accepted);
                m.is_lost = 1;
                status_is = courses[j].status_is;
                connects_with = courses[j].connects_with;
                begin_link();
                OK(mbm_link_setRequestsWait(&kept, (uint8_t)waits));
                m.sent_count = 0;
                (void)mbm_client_poll(&client);
                status_is = MBM_LINK_LOST;
                run(50);
                IS(MBM_LINK_LOST, request.status);
                assert_int_equal(driver, 0);
                connects_with = MBM_OK;
                run(2000);
                works_over_the_new_link(framings[i]);
            }
}

TEST_ROW(requests_that_were_sent_end_when_a_link_begins_that_is_closed,
         requests_in_flight_end_when_the_link_was_closed(ALL))
TEST_ROW(a_request_that_the_port_took_in_part_is_not_sent_on_over_the_new_link,
         requests_in_flight_end_when_the_link_was_closed(5))

FRAMING_TEST(a_request_that_ended_with_the_old_link_is_never_sent)
{
    for (unsigned j = 0; j < COUNT(courses); j++) {
        begin_in_flight(framing, NOTHING);
        assert_int_equal(m.sent_count, 0);
        status_is = courses[j].status_is;
        connects_with = courses[j].connects_with;
        begin_link();
        (void)mbm_client_poll(&client);
        status_is = MBM_LINK_LOST;
        run(50);
        IS(MBM_LINK_LOST, request.status);
        connects_with = MBM_OK;
        run(2000);
        works_over_the_new_link(framing);
    }
}

FRAMING_TEST(half_a_reply_of_the_old_peer_is_dropped)
{
    static const uint8_t half_rtu[] = {UNIT, 3, 2}, half_tcp[] = {0, 0, 0, 0, 0, 5, UNIT, 6};

    begin_in_flight(framing, ALL);
    if (framing == MBM_FRAMING_TCP)
        memory_port_bytes(&m, half_tcp, sizeof half_tcp);
    else if (framing == MBM_FRAMING_ASCII)
        memory_port_bytes(&m, (const uint8_t *)":0703", 5);
    else
        memory_port_bytes(&m, half_rtu, sizeof half_rtu);
    m.now += MS;
    IS(MBM_PENDING, mbm_client_poll(&client));
    begin_link();
    m.sent_count = 0;
    run(20);
    IS(MBM_LINK_LOST, request.status);
    works_over_the_new_link(framing);
}

FRAMING_TEST(a_request_in_flight_goes_on_if_the_link_is_found_open)
{
    static const uint8_t reply[] = {UNIT, 6, 0, 7, 0xBE, 0xEF};
    uint8_t tcp[] = {0, 0, 0, 0, 0, 6, UNIT, 6, 0, 7, 0xBE, 0xEF};

    for (unsigned waits = 0; waits < 2; waits++) {
        begin_in_flight(framing, ALL);
        status_is = waits ? MBM_PENDING : MBM_OK;
        begin_link();
        IS(MBM_PENDING, mbm_client_poll(&client));
        status_is = MBM_OK;
        IS(MBM_PENDING, mbm_client_poll(&client));
        assert_int_equal(connects + disconnects, 0);
        assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_UP);
        if (framing == MBM_FRAMING_TCP)
            memory_port_bytes(&m, tcp, sizeof tcp);
        else if (framing == MBM_FRAMING_ASCII)
            memory_port_bytes(&m, (const uint8_t *)":07060007BEEF3F\r\n", 17);
        else
            memory_port_rtu(&m, reply, sizeof reply);
        IS(MBM_OK, memory_port_run(&m, &client, &request, 1000));
        m.sent_count = 0;
        works_over_the_new_link(framing);
    }
}

FRAMING_TEST(a_link_that_the_program_closes_while_it_is_being_made_sends_nothing_old)
{
    mbm_clientRequest second = {.unit = UNIT};

    begin_in_flight(framing, NOTHING);
    status_is = MBM_PENDING;
    begin_link();
    IS(MBM_PENDING, mbm_client_poll(&client));
    assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_CONNECTING);
    /* A queued request that the reconnection must leave as it is. */
    IS(MBM_PENDING, mbm_client_readCoils(&client, &second, 0, 1));
    OK(mbm_link_reconnect(&kept));
    connects_with = MBM_PENDING;
    IS(MBM_PENDING, mbm_client_poll(&client));
    IS(MBM_LINK_LOST, request.status);
    IS(MBM_PENDING, second.status);
    assert_int_equal(disconnects, 1);
    OK(mbm_client_cancel(&client, &second));
    status_is = MBM_OK;
    IS(MBM_OK, mbm_client_poll(&client));
    works_over_the_new_link(framing);
}

/* The link is lost, and its callback does this next. */
static void end_it(void *context, uint8_t event, uint8_t status)
{
    if (event != MBM_LINK_EVENT_CONNECTED)
        OK(mbm_link_end(&kept));
}

FRAMING_TEST(a_client_whose_link_ends_in_its_callback_sends_nothing_old)
{
    for (unsigned j = 1; j < COUNT(courses); j++) {
        begin_in_flight(framing, NOTHING);
        status_is = courses[j].status_is;
        connects_with = courses[j].connects_with;
        begin_link();
        OK(mbm_link_setCallback(&kept, end_it, NULL));
        (void)mbm_client_poll(&client);
        status_is = MBM_LINK_LOST;
        run(100);
        assert_int_equal(mbm_link_state(&kept), 0);
        accepts = ALL;
        m.is_lost = 0;
        run(100);
        IS(MBM_LINK_LOST, request.status);
        assert_int_equal(m.sent_count, 0);
        queue_read(&other);
        memory_port_send(&m, &client);
        answer(framing);
        IS(MBM_OK, memory_port_run(&m, &client, &other, 1000));
    }
}

/* A reply that guesses the transaction identifier ends a request before it was sent. */
TEST(a_request_that_was_answered_before_it_was_sent_is_not_sent)
{
    static const uint8_t reply[] = {0, 0, 0, 0, 0, 6, UNIT, 6, 0, 7, 0xBE, 0xEF};

    begin_in_flight(MBM_FRAMING_TCP, NOTHING);
    memory_port_bytes(&m, reply, sizeof reply);
    IS(MBM_OK, memory_port_run(&m, &client, &request, 1000));
    status_is = MBM_OK;
    begin_link();
    run(10);
    works_over_the_new_link(MBM_FRAMING_TCP);
}

FRAMING_TEST(requests_end_if_attempts_that_fail_follow_each_other_without_a_wait)
{
    static const uint8_t failing[] = {MBM_LINK_LOST, MBM_PENDING};

    for (unsigned i = 0; i < 4; i++) {
        if (i % 2 == 0)
            begin(framing);
        else
            begin_up(framing);
        /* The program does not ask for events, and an attempt is due in each poll. */
        OK(mbm_link_setCallback(&kept, NULL, NULL));
        OK(mbm_link_setBackoff(&kept, MBM_BACKOFF_NONE, 0, 0));
        connects_with = failing[i / 2];
        m.is_lost = 1;
        for (unsigned round = 0; round < 10; round++) {
            queue_read(&request);
            for (unsigned polls = 0; request.status == MBM_PENDING && polls < 3; polls++) {
                (void)mbm_client_poll(&client);
                m.now += MS;
            }
            IS(MBM_LINK_LOST, request.status);
        }
    }
}
