/* A client's link over a port in memory, with a clock of its own: when it is opened again,
 * what becomes of requests, and what the program learns. */
#include "memory_port.h"
#include "test.h"

#include <stdio.h>
#include <string.h>

enum { UNIT = 7, MS = 1000 };

static memory_port m;
static mbm_client client;
static mbm_link kept;
static mbm_linkCounters counters;
static mbm_clientRequest request, other;
static uint8_t frame[MBM_MAX_ASCII_FRAME], outgoing[MBM_MAX_TCP_FRAME];
static uint16_t words[4];

static const uint8_t framings[] = {MBM_FRAMING_RTU, MBM_FRAMING_ASCII, MBM_FRAMING_TCP,
                                   MBM_FRAMING_RTU_OVER_TCP};

/* What the hooks do, what they found, and what the callback received. */
static uint8_t connects_with, status_is;
static unsigned connects, disconnects;
static uint32_t connected_at;
static char events[400];
static void (*within)(void);

static void disconnect(void *context)
{
    assert_ptr_equal(context, &m);
    disconnects++;
    if (within)
        within();
}

static uint8_t connect_hook(void *context)
{
    assert_ptr_equal(context, &m);
    connects++;
    connected_at = m.now;
    if (within)
        within();
    m.is_lost = connects_with != MBM_OK;
    return connects_with;
}

static uint8_t status_hook(void *context)
{
    assert_ptr_equal(context, &m);
    if (within)
        within();
    return status_is;
}

static const mbm_linkHooks hooks = {
    .context = &m, .disconnect = disconnect, .connect = connect_hook, .status = status_hook};

static void changed(void *context, uint8_t event, uint8_t status)
{
    const size_t length = strlen(events);

    assert_ptr_equal(context, &kept);
    (void)snprintf(events + length, sizeof events - length, "%c%02X ", "CLF"[event], status);
}

static void begin_client(int framing)
{
    const mbm_port port = memory_port_of(&m);

    switch (framing) {
    case MBM_FRAMING_RTU: OK(mbm_client_beginRtu(&client, &port, frame, sizeof frame)); break;
    case MBM_FRAMING_ASCII: OK(mbm_client_beginAscii(&client, &port, frame, sizeof frame)); break;
    case MBM_FRAMING_RTU_OVER_TCP:
        OK(mbm_client_beginRtuOverTcp(&client, &port, frame, sizeof frame));
        break;
    default:
        OK(mbm_client_beginTcp(&client, &port, frame, sizeof frame, outgoing, sizeof outgoing));
        break;
    }
    OK(mbm_client_setResponseTimeout(&client, 300));
    OK(mbm_client_setQuietTime(&client, 0));
}

/* A client with a link that is not open yet. */
static void begin(int framing)
{
    memset(&m, 0, sizeof m);
    memset(&client, 0, sizeof client);
    memset(&kept, 0, sizeof kept);
    memset(&counters, 0, sizeof counters);
    memset(&request, 0, sizeof request);
    memset(&other, 0, sizeof other);
    connects = disconnects = 0;
    connects_with = MBM_OK;
    status_is = MBM_LINK_LOST;
    events[0] = '\0';
    within = NULL;
    begin_client(framing);
    OK(mbm_link_begin(&kept, &client, &hooks));
    OK(mbm_link_setCallback(&kept, changed, &kept));
    OK(mbm_link_setCounters(&kept, &counters));
    request.unit = other.unit = UNIT;
    request.reply = other.reply = words;
    request.replyBytes = other.replyBytes = sizeof words;
}

static void begin_up(int framing)
{
    begin(framing);
    OK(mbm_client_poll(&client));
    assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_UP);
    events[0] = '\0';
}

static void queue_read(mbm_clientRequest *which)
{
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, which, 0, 1));
}

/* Delivers the right reply to the request that was sent last. */
static void answer(int framing)
{
    static const uint8_t rtu[] = {UNIT, 3, 2, 0x12, 0x34};
    uint8_t tcp[] = {0, 0, 0, 0, 0, 5, UNIT, 3, 2, 0x12, 0x34};

    if (framing == MBM_FRAMING_ASCII) {
        memory_port_bytes(&m, (const uint8_t *)":0703021234AE\r\n", 15);
    } else if (framing == MBM_FRAMING_TCP) {
        memcpy(tcp, m.sent, 2);
        memory_port_bytes(&m, tcp, sizeof tcp);
    } else {
        memory_port_rtu(&m, rtu, sizeof rtu);
    }
}

/* Polls for a time, each time after the time of pollDelay. */
static void run(uint32_t ms)
{
    const uint32_t end = m.now + ms * MS;

    while ((int32_t)(end - m.now) > 0) {
        uint32_t delay = mbm_client_pollDelay(&client);

        if (delay > end - m.now)
            delay = end - m.now;
        m.now += delay > 0 ? delay : 1;
        (void)mbm_client_poll(&client);
    }
}

/* Polls until one more attempt was made. Returns after how many ms that was. */
static uint32_t next_attempt(void)
{
    const uint32_t before = m.now;
    const unsigned count = connects;
    unsigned polls;

    for (polls = 0; polls < 10000 && connects == count; polls++) {
        const uint32_t delay = mbm_client_pollDelay(&client);

        m.now += delay;
        (void)mbm_client_poll(&client);
        if (delay == 0)
            m.now++;
    }
    assert_int_equal(connects, count + 1);
    return (connected_at - before + MS / 2) / MS;
}

static void a_link_is_opened_in_the_first_poll(void **state)
{
    unsigned i;

    (void)state;
    for (i = 0; i < COUNT(framings); i++) {
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

static void a_link_that_is_open_already_is_used_as_it_is(void **state)
{
    (void)state;
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

static void the_loss_of_the_link_is_noticed_while_the_client_is_idle(void **state)
{
    unsigned i;

    (void)state;
    for (i = 0; i < COUNT(framings); i++) {
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

static void bytes_that_arrive_while_the_client_is_idle_are_dropped(void **state)
{
    static const uint8_t late[] = {0, 9, 0, 0, 0, 5, UNIT, 3, 2, 0xAA, 0xAA, 0, 9, 0, 0};
    unsigned i;

    (void)state;
    for (i = 0; i < COUNT(framings); i++) {
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

static void the_gap_is_kept_after_bytes_that_arrived_while_idle(void **state)
{
    (void)state;
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

static void the_wait_grows_from_attempt_to_attempt(void **state)
{
    (void)state;
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

static void a_peer_that_closes_each_connection_at_once_is_asked_less_and_less(void **state)
{
    unsigned i;

    (void)state;
    begin_up(MBM_FRAMING_TCP);
    OK(mbm_link_setBackoff(&kept, MBM_BACKOFF_EXPONENTIAL, 100, 30000));
    run(2000);
    for (i = 0; i < 5; i++) {
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

static uint32_t half(void *context)
{
    assert_ptr_equal(context, &m);
    return 1u << 31;
}

static void jitter_shortens_the_wait(void **state)
{
    (void)state;
    begin_up(MBM_FRAMING_TCP);
    OK(mbm_link_setBackoff(&kept, MBM_BACKOFF_FIXED, 1000, 1000));
    OK(mbm_link_setJitter(&kept, 50, half, &m));
    m.is_lost = 1;
    OK(mbm_client_poll(&client));
    assert_in_range(next_attempt(), 740, 760);
}

static void requests_fail_while_the_link_is_down(void **state)
{
    unsigned i;

    (void)state;
    for (i = 0; i < COUNT(framings); i++) {
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

static void requests_that_were_not_sent_wait_for_the_link(void **state)
{
    unsigned i;

    (void)state;
    for (i = 0; i < COUNT(framings); i++) {
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

static void requests_wait_while_the_first_connection_is_being_made(void **state)
{
    unsigned i;

    (void)state;
    for (i = 0; i < COUNT(framings); i++) {
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

static void a_connection_that_takes_too_long_has_failed(void **state)
{
    (void)state;
    begin(MBM_FRAMING_TCP);
    connects_with = MBM_PENDING;
    OK(mbm_client_poll(&client));
    status_is = MBM_PENDING;
    queue_read(&request);
    assert_in_range(mbm_client_pollDelay(&client), 1, 100 * MS);
    run(9999);
    assert_string_equal(events, "");
    run(2);
    assert_string_equal(events, "FE2 ");
    assert_int_equal(disconnects, 1);
    IS(MBM_LINK_LOST, request.status);
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
    status_is = MBM_SLAVE_DEVICE_FAILURE;
    OK(mbm_client_poll(&client));
    assert_int_equal(counters.failed, 4);
}

static void a_link_without_a_status_hook_waits_for_the_connect_timeout(void **state)
{
    const mbm_linkHooks one = {.context = &m, .connect = connect_hook};

    (void)state;
    begin(MBM_FRAMING_TCP);
    OK(mbm_link_begin(&kept, &client, &one));
    OK(mbm_client_poll(&client));
    assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_UP);
    m.is_lost = 1;
    OK(mbm_client_poll(&client));
    assert_int_equal(next_attempt(), 500);
    assert_int_equal(disconnects, 0);
}

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

static void the_hooks_of_a_link_may_use_neither_link_nor_client(void **state)
{
    (void)state;
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

    (void)context;
    (void)status;
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

static void the_callback_may_use_link_and_client(void **state)
{
    static const uint8_t after[] = {MBM_OK, MBM_OK, MBM_OK, MBM_NOT_INITIALISED,
                                    MBM_OK, MBM_OK, MBM_OK, MBM_OK};
    unsigned i;

    (void)state;
    for (i = 0; i < COUNT(framings); i++)
        for (what = 0; what < 8; what++) {
            begin_up(framings[i]);
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

static void a_client_without_its_link_works_as_before(void **state)
{
    unsigned i;

    (void)state;
    for (i = 0; i < COUNT(framings); i++) {
        begin_up(framings[i]);
        OK(mbm_link_end(&kept));
        IS(MBM_NOT_INITIALISED, mbm_link_end(&kept));
        assert_int_equal(mbm_client_pollDelay(&client), UINT32_MAX);
        m.is_lost = 1;
        OK(mbm_client_poll(&client));
        m.is_lost = 0;
        queue_read(&request);
        memory_port_send(&m, &client);
        answer(framings[i]);
        IS(MBM_OK, memory_port_run(&m, &client, &request, 1000));
        m.is_lost = 1;
        queue_read(&request);
        IS(MBM_LINK_LOST, memory_port_run(&m, &client, &request, 1000));
        assert_string_equal(events, "");
        m.is_lost = 0;
        OK(mbm_link_begin(&kept, &client, &hooks));
        OK(mbm_client_poll(&client));
        assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_UP);
    }
}

static void a_client_that_is_begun_again_has_no_link(void **state)
{
    (void)state;
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

static void a_link_begun_again_has_its_default_settings(void **state)
{
    (void)state;
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

static void a_suspended_client_leaves_its_link_alone(void **state)
{
    static mbm_master master;
    static uint16_t registers[2];
    static uint8_t buffer[16];
    mbm_link second = {0};

    (void)state;
    memset(&master, 0, sizeof master);
    begin_up(MBM_FRAMING_RTU);
    OK(mbm_master_setBuffers(&master, registers, 2, registers, 0, buffer, sizeof buffer));
    OK(mbm_master_setBlocking(&master, 0));
    OK(mbm_client_suspend(&client, &master));
    memory_port_bytes(&m, frame, 1);
    IS(MBM_BUSY, mbm_client_poll(&client));
    assert_int_equal(m.arriving_count, 1);
    assert_int_equal(mbm_client_pollDelay(&client), UINT32_MAX);
    IS(MBM_BUSY, mbm_link_end(&kept));
    IS(MBM_BUSY, mbm_link_begin(&kept, &client, &hooks));
    IS(MBM_BUSY, mbm_link_begin(&second, &client, &hooks));
    /* The master learns of the loss, and then the client. */
    m.is_lost = 1;
    IS(MBM_PENDING, mbm_master_readCoils(&master, 0, 1));
    IS(MBM_LINK_LOST, mbm_master_poll(&master));
    OK(mbm_client_resume(&client, &master));
    OK(mbm_client_poll(&client));
    assert_string_equal(events, "LE6 ");
    /* A master on a link that is down learns it too. */
    connects_with = MBM_LINK_LOST;
    OK(mbm_client_suspend(&client, &master));
    IS(MBM_PENDING, mbm_master_readCoils(&master, 0, 1));
    IS(MBM_LINK_LOST, mbm_master_poll(&master));
    OK(mbm_client_resume(&client, &master));
}

static void a_lost_link_and_a_timeout_in_one_poll_are_a_lost_link(void **state)
{
    unsigned i;

    (void)state;
    for (i = 0; i < COUNT(framings); i++) {
        begin_up(framings[i]);
        queue_read(&request);
        memory_port_send(&m, &client);
        m.now += 10000 * MS;
        m.is_lost = 1;
        OK(mbm_client_poll(&client));
        IS(MBM_LINK_LOST, request.status);
        assert_string_equal(events, "LE6 ");
    }
}

static void a_reconnection_on_demand_closes_the_link_and_opens_it_at_once(void **state)
{
    (void)state;
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

static void queue_again(void *context, mbm_clientRequest *ended)
{
    (void)context;
    called++;
    queue_read(ended);
}

static void a_request_of_done_fails_or_waits_as_all_do(void **state)
{
    unsigned i;

    (void)state;
    for (i = 0; i < 2; i++) {
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

static void a_call_that_is_refused_changes_nothing(void **state)
{
    const mbm_linkHooks none = {.disconnect = disconnect};
    static mbm_link zero, second;
    static mbm_client unused;
    mbm_link before;

    (void)state;
    memset(&second, 0, sizeof second);
    begin_up(MBM_FRAMING_TCP);
    IS(MBM_INVALID_ARGUMENT, mbm_link_begin(NULL, &client, &hooks));
    IS(MBM_INVALID_ARGUMENT, mbm_link_begin(&second, NULL, &hooks));
    IS(MBM_INVALID_ARGUMENT, mbm_link_begin(&second, &client, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_link_begin(&second, &client, &none));
    IS(MBM_NOT_INITIALISED, mbm_link_begin(&second, &unused, &hooks));
    IS(MBM_BUSY, mbm_link_begin(&second, &client, &hooks));
    assert_memory_equal(&second, &zero, sizeof zero);
    IS(MBM_NOT_INITIALISED, mbm_link_end(&second));
    IS(MBM_NOT_INITIALISED, mbm_link_reconnect(&second));
    IS(MBM_NOT_INITIALISED, mbm_link_setRequestsWait(&second, 1));
    assert_int_equal(mbm_link_state(&second), 0);
    assert_int_equal(mbm_link_state(NULL), 0);
    before = kept;
    IS(MBM_INVALID_ARGUMENT, mbm_link_begin(&kept, &client, &none));
    IS(MBM_NOT_INITIALISED, mbm_link_begin(&kept, &unused, &hooks));
    IS(MBM_INVALID_ARGUMENT, mbm_link_setBackoff(&kept, 4, 1, 1));
    IS(MBM_INVALID_ARGUMENT, mbm_link_setJitter(&kept, 1, NULL, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_link_setJitter(&kept, 101, half, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_link_end(NULL));
    assert_memory_equal(&before, &kept, sizeof kept);
    run(3000);
    assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_UP);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_link_is_opened_in_the_first_poll),
        cmocka_unit_test(a_link_that_is_open_already_is_used_as_it_is),
        cmocka_unit_test(the_loss_of_the_link_is_noticed_while_the_client_is_idle),
        cmocka_unit_test(bytes_that_arrive_while_the_client_is_idle_are_dropped),
        cmocka_unit_test(the_gap_is_kept_after_bytes_that_arrived_while_idle),
        cmocka_unit_test(the_wait_grows_from_attempt_to_attempt),
        cmocka_unit_test(a_peer_that_closes_each_connection_at_once_is_asked_less_and_less),
        cmocka_unit_test(jitter_shortens_the_wait),
        cmocka_unit_test(requests_fail_while_the_link_is_down),
        cmocka_unit_test(requests_that_were_not_sent_wait_for_the_link),
        cmocka_unit_test(requests_wait_while_the_first_connection_is_being_made),
        cmocka_unit_test(a_connection_that_takes_too_long_has_failed),
        cmocka_unit_test(a_link_without_a_status_hook_waits_for_the_connect_timeout),
        cmocka_unit_test(the_hooks_of_a_link_may_use_neither_link_nor_client),
        cmocka_unit_test(the_callback_may_use_link_and_client),
        cmocka_unit_test(a_client_without_its_link_works_as_before),
        cmocka_unit_test(a_client_that_is_begun_again_has_no_link),
        cmocka_unit_test(a_link_begun_again_has_its_default_settings),
        cmocka_unit_test(a_suspended_client_leaves_its_link_alone),
        cmocka_unit_test(a_lost_link_and_a_timeout_in_one_poll_are_a_lost_link),
        cmocka_unit_test(a_reconnection_on_demand_closes_the_link_and_opens_it_at_once),
        cmocka_unit_test(a_request_of_done_fails_or_waits_as_all_do),
        cmocka_unit_test(a_call_that_is_refused_changes_nothing),
    };

    return cmocka_run_group_tests_name("link", tests, NULL, NULL);
}
