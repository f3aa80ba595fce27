/* A client's link: when it is opened again, and what becomes of requests meanwhile. */
#include "linked.h"

FRAMING_TEST(a_link_is_opened_in_the_first_poll)
{
    begin(framing);
    assert_int_equal(mbm_link_state(&kept), 0);
    assert_int_equal(connects, 0);
    assert_int_equal(mbm_client_pollDelay(&client), 0);
    OK(mbm_client_poll(&client));
    assert_int_equal(connects, 1);
    assert_int_equal(disconnects, 0);
    assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_UP);
    assert_int_equal(mbm_client_isConnected(&client), 1);
    assert_string_equal(events, "C00 ");
    reads_right(framing);
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

FRAMING_TEST(the_loss_of_the_link_is_noticed_while_the_client_is_idle)
{
    begin_up(framing);
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

FRAMING_TEST(bytes_that_arrive_while_the_client_is_idle_are_dropped)
{
    static const uint8_t late[] = {0, 9, 0, 0, 0, 5, UNIT, 3, 2, 0xAA, 0xAA, 0, 9, 0, 0};
    mbm_counters counted = {0};

    begin_up(framing);
    OK(mbm_client_setCounters(&client, &counted));
    memory_port_bytes(&m, late, sizeof late);
    OK(mbm_client_poll(&client));
    OK(mbm_client_poll(&client));
    assert_int_equal(m.arriving_count, 0);
    assert_int_equal(counted.bytesReceived, sizeof late);
    /* A frame that has begun while the client was idle does not hide the reply. */
    queue_read(&request);
    memory_port_send(&m, &client);
    if (framing == MBM_FRAMING_TCP) {
        assert_int_equal(counted.foreignFrames, 1);
        memory_port_bytes(&m, late + 4, 7);
    }
    answer(framing);
    IS(MBM_OK, memory_port_run(&m, &client, &request, 1000));
    assert_int_equal(words[0], 0x1234);
    assert_int_equal(counted.resynchronisations, 0);
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

FRAMING_TEST(requests_fail_while_the_link_is_down)
{
    begin_up(framing);
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

FRAMING_TEST(requests_that_were_not_sent_wait_for_the_link)
{
    begin_up(framing);
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
    answer(framing);
    IS(MBM_OK, memory_port_run(&m, &client, &other, 1000));
    assert_int_equal(mbm_client_pending(&client), 0);
}

FRAMING_TEST(requests_wait_while_the_first_connection_is_being_made)
{
    begin(framing);
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
    answer(framing);
    IS(MBM_OK, memory_port_run(&m, &client, &request, 1000));
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

/* A client's link: what its hooks and its callback may call, how it ends and begins again, and
 * what a refused call leaves. */

static unsigned called;

static void use_everything(void)
{
    called++;
    IS(MBM_BUSY, mbm_client_poll(&client));
    IS(MBM_BUSY, mbm_client_readCoils(&client, &other, 0, 1));
    IS(MBM_BUSY, mbm_client_cancel(&client, &request));
    IS(MBM_BUSY, mbm_client_reconnect(&client, NULL));
    IS(MBM_BUSY, mbm_client_suspend(&client, NULL));
    IS(MBM_BUSY, mbm_link_begin(&kept, &client, &hooks));
    IS(MBM_BUSY, mbm_link_end(&kept));
    IS(MBM_BUSY, mbm_link_reconnect(&kept));
    IS(MBM_BUSY, mbm_link_setBackoff(&kept, 0, 0, 0));
    IS(MBM_BUSY, mbm_link_setJitter(&kept, 0, NULL, NULL));
    IS(MBM_BUSY, mbm_link_setConnectTimeout(&kept, 0));
    IS(MBM_BUSY, mbm_link_setRequestsWait(&kept, 0));
    IS(MBM_BUSY, mbm_link_setCallback(&kept, NULL, NULL));
    IS(MBM_BUSY, mbm_link_setCounters(&kept, NULL));
    assert_int_equal(mbm_link_state(&kept), 0);
    assert_int_equal(mbm_client_pollDelay(&client), 0);
}

TEST(the_hooks_of_a_link_may_use_neither_link_nor_client)
{
    begin(MBM_FRAMING_TCP);
    called = 0;
    within = use_everything;
    connects_with = MBM_PENDING;
    OK(mbm_client_poll(&client));
    assert_int_equal(called, 2); /* status, connect */
    status_is = MBM_LINK_LOST;
    OK(mbm_client_poll(&client));
    assert_int_equal(called, 4); /* status, disconnect */
    assert_string_equal(events, "FE6 ");
}

static int what;

/* Does one thing in the callback: the client goes on, or nothing of it is used any more. */
static void act(void *context, uint8_t event, uint8_t status)
{
    const mbm_port port = memory_port_of(&m);

    called++;
    if (event != MBM_LINK_EVENT_LOST)
        return;
    IS(MBM_BUSY, mbm_client_poll(&client));
    switch (what) {
    case 0: OK(mbm_link_end(&kept)); break;
    case 1: OK(mbm_link_begin(&kept, &client, &hooks)); break;
    case 2: OK(mbm_client_beginRtu(&client, &port, frame, sizeof frame)); break;
    case 3: memset(&client, 0, sizeof client); break;
    case 4:
        OK(mbm_link_end(&kept));
        memset(&kept, 0, sizeof kept);
        break;
    case 5: queue_read(&request); break;
    case 6: OK(mbm_link_reconnect(&kept)); break;
    case 7: OK(mbm_link_setCallback(&kept, NULL, NULL)); break;
    default: break;
    }
}

FRAMING_TEST(the_callback_may_use_link_and_client)
{
    static const uint8_t after[] = {MBM_OK, MBM_OK, MBM_OK, MBM_NOT_INITIALISED,
                                    MBM_OK, MBM_OK, MBM_OK, MBM_OK};

    for (what = 0; what < 8; what++) {
        begin_up(framing);
        OK(mbm_link_setCallback(&kept, act, NULL));
        called = 0;
        m.is_lost = 1;
        /* The link was lost before, so a request of the callback ends. */
        IS(MBM_OK, mbm_client_poll(&client));
        assert_int_equal(called, 1);
        m.is_lost = 0;
        IS(after[what], mbm_client_poll(&client));
        run(1000);
        assert_int_equal(mbm_link_state(&kept), what == 0 || what == 4   ? 0
                                                : what == 2 || what == 3 ? MBM_LINK_IS_DOWN
                                                                         : MBM_LINK_IS_UP);
        if (what == 5)
            IS(MBM_LINK_LOST, request.status);
    }
}

FRAMING_TEST(a_client_without_its_link_works_as_before)
{
    begin_up(framing);
    OK(mbm_link_end(&kept));
    IS(MBM_NOT_INITIALISED, mbm_link_end(&kept));
    assert_int_equal(mbm_client_pollDelay(&client), UINT32_MAX);
    m.is_lost = 1;
    OK(mbm_client_poll(&client));
    m.is_lost = 0;
    reads_right(framing);
    m.is_lost = 1;
    queue_read(&request);
    IS(MBM_LINK_LOST, memory_port_run(&m, &client, &request, 1000));
    assert_string_equal(events, "");
    m.is_lost = 0;
    OK(mbm_link_begin(&kept, &client, &hooks));
    OK(mbm_client_poll(&client));
    assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_UP);
}

TEST(a_client_that_is_begun_again_has_no_link)
{
    begin_up(MBM_FRAMING_TCP);
    begin_client(MBM_FRAMING_RTU);
    assert_int_equal(mbm_client_pollDelay(&client), UINT32_MAX);
    OK(mbm_link_begin(&kept, &client, &hooks));
    begin_client(MBM_FRAMING_TCP);
    OK(mbm_link_end(&kept));
    OK(mbm_link_begin(&kept, &client, &hooks));
    OK(mbm_client_poll(&client));
    assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_UP);
}

TEST(a_link_uses_nothing_of_a_client_that_was_begun_again)
{
    static mbm_client linked, next;
    const mbm_port port = memory_port_of(&m);

    begin_up(MBM_FRAMING_TCP);
    memcpy(&linked, &client, sizeof client);
    begin_client(MBM_FRAMING_RTU);
    /* The client has ended. Its storage has other content, which looks like a client. */
    memcpy(&client, &linked, sizeof client);
    memset(&next, 0, sizeof next);
    OK(mbm_client_beginRtu(&next, &port, frame, sizeof frame));
    OK(mbm_link_begin(&kept, &next, &hooks));
    assert_memory_equal(&client, &linked, sizeof client);
    OK(mbm_client_poll(&next));
    assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_UP);
}

TEST(a_link_begun_again_has_its_default_settings)
{
    begin_up(MBM_FRAMING_TCP);
    OK(mbm_link_setBackoff(&kept, MBM_BACKOFF_FIXED, 7, 7));
    OK(mbm_link_setRequestsWait(&kept, 1));
    OK(mbm_link_begin(&kept, &client, &hooks));
    OK(mbm_client_poll(&client));
    assert_string_equal(events, "");
    m.is_lost = 1;
    OK(mbm_client_poll(&client));
    queue_read(&request);
    OK(mbm_client_poll(&client));
    IS(MBM_LINK_LOST, request.status);
    assert_int_equal(mbm_client_pollDelay(&client), 500 * MS);
}

TEST(a_suspended_client_leaves_its_link_alone)
{
    static mbm_line line;
    static mbm_node node;
    static uint16_t registers[2];
    static uint8_t buffer[16];
    mbm_link second = {0};

    memset(&line, 0, sizeof line);
    memset(&node, 0, sizeof node);
    begin_up(MBM_FRAMING_RTU);
    OK(mbm_line_setFrame(&line, buffer, sizeof buffer));
    OK(mbm_node_begin(&node, &line, 1, registers, 2, registers, 0));
    OK(mbm_node_setBlocking(&node, 0));
    OK(mbm_client_suspend(&client, &line));
    memory_port_bytes(&m, frame, 1);
    IS(MBM_BUSY, mbm_client_poll(&client));
    assert_int_equal(m.arriving_count, 1);
    assert_int_equal(mbm_client_pollDelay(&client), UINT32_MAX);
    IS(MBM_BUSY, mbm_link_end(&kept));
    IS(MBM_BUSY, mbm_link_begin(&kept, &client, &hooks));
    IS(MBM_BUSY, mbm_link_begin(&second, &client, &hooks));
    /* The master learns of the loss, and then the client. */
    m.is_lost = 1;
    IS(MBM_PENDING, mbm_node_readCoils(&node, 0, 1));
    IS(MBM_LINK_LOST, mbm_node_poll(&node));
    OK(mbm_client_resume(&client, &line));
    OK(mbm_client_poll(&client));
    assert_string_equal(events, "LE6 ");
    /* A master on a link that is down learns it too. */
    connects_with = MBM_LINK_LOST;
    OK(mbm_client_suspend(&client, &line));
    IS(MBM_PENDING, mbm_node_readCoils(&node, 0, 1));
    IS(MBM_LINK_LOST, mbm_node_poll(&node));
    OK(mbm_client_resume(&client, &line));
}

FRAMING_TEST(a_lost_link_and_a_timeout_in_one_poll_are_a_lost_link)
{
    begin_up(framing);
    queue_read(&request);
    memory_port_send(&m, &client);
    m.now += 10000 * MS;
    m.is_lost = 1;
    OK(mbm_client_poll(&client));
    IS(MBM_LINK_LOST, request.status);
    assert_string_equal(events, "LE6 ");
}

TEST(a_reconnection_on_demand_closes_the_link_and_opens_it_at_once)
{
    begin_up(MBM_FRAMING_TCP);
    OK(mbm_link_setRequestsWait(&kept, 1));
    queue_read(&request);
    memory_port_send(&m, &client);
    OK(mbm_link_reconnect(&kept));
    OK(mbm_link_reconnect(&kept));
    assert_int_equal(mbm_client_pollDelay(&client), 0);
    OK(mbm_client_poll(&client));
    IS(MBM_LINK_LOST, request.status);
    OK(mbm_client_poll(&client));
    assert_string_equal(events, "LE6 C00 ");
    assert_int_equal(disconnects, 1);
    assert_int_equal(connects, 2);
    /* While the connection is being made. */
    connects_with = status_is = MBM_PENDING;
    OK(mbm_link_reconnect(&kept));
    OK(mbm_client_poll(&client));
    OK(mbm_client_poll(&client));
    assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_CONNECTING);
    OK(mbm_link_reconnect(&kept));
    OK(mbm_client_poll(&client));
    assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_CONNECTING);
    assert_int_equal(disconnects, 3);
    assert_int_equal(connects, 4);
    /* While it is down. */
    connects_with = MBM_LINK_LOST;
    status_is = MBM_LINK_LOST;
    OK(mbm_client_poll(&client));
    assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_DOWN);
    OK(mbm_link_reconnect(&kept));
    assert_int_equal(next_attempt(), 0);
}

TEST(queued_requests_wait_for_a_reconnection_on_demand)
{
    for (unsigned is_down = 0; is_down < 2; is_down++) {
        mbm_clientRequest queued = {.unit = 17};

        begin_up(MBM_FRAMING_RTU);
        if (is_down) {
            connects_with = status_is = MBM_LINK_LOST;
            OK(mbm_link_reconnect(&kept));
            OK(mbm_client_poll(&client));
            OK(mbm_client_poll(&client));
            assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_DOWN);
            connects_with = MBM_OK;
        }
        IS(MBM_PENDING, mbm_client_readCoils(&client, &queued, 0, 1));
        OK(mbm_link_reconnect(&kept));
        (void)mbm_client_poll(&client);
        (void)mbm_client_poll(&client);
        IS(MBM_PENDING, queued.status);
        assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_UP);
        /* If the attempt fails, they end. */
        connects_with = status_is = MBM_LINK_LOST;
        OK(mbm_link_reconnect(&kept));
        (void)mbm_client_poll(&client);
        (void)mbm_client_poll(&client);
        IS(MBM_LINK_LOST, queued.status);
    }
}

static void queue_again(void *context, mbm_clientRequest *ended)
{
    called++;
    queue_read(ended);
}

TEST(a_request_of_done_fails_or_waits_as_all_do)
{
    for (unsigned i = 0; i < 2; i++) {
        begin_up(MBM_FRAMING_TCP);
        OK(mbm_link_setRequestsWait(&kept, (uint8_t)i));
        connects_with = MBM_LINK_LOST;
        request.done = queue_again;
        queue_read(&request);
        memory_port_send(&m, &client);
        m.is_lost = 1;
        called = 0;
        IS(MBM_PENDING, mbm_client_poll(&client));
        /* One poll ends at most 17 requests; the loss was one of them. */
        assert_int_equal(called, i == 0 ? 16 : 1);
    }
}

TEST(a_call_that_is_refused_changes_nothing)
{
    const mbm_linkHooks none = {.disconnect = disconnect};
    static mbm_client unused;

    begin_up(MBM_FRAMING_TCP);
    mbm_link before = kept;
    IS(MBM_INVALID_ARGUMENT, mbm_link_begin(&kept, &client, &none));
    IS(MBM_NOT_INITIALISED, mbm_link_begin(&kept, &unused, &hooks));
    IS(MBM_INVALID_ARGUMENT, mbm_link_setBackoff(&kept, 4, 1, 1));
    IS(MBM_INVALID_ARGUMENT, mbm_link_setJitter(&kept, 1, NULL, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_link_setJitter(&kept, 101, half, NULL));
    assert_memory_equal(&before, &kept, sizeof kept);
    run(3000);
    assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_UP);
}
