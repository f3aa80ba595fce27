/* Beginning an object again: it gives up all that was pending. */
#include "every_call.h"
#include "refused.h"
#include "hooked_port.h"
#include "test.h"

static hooked_port wire, other_wire;
static mbm_port port, other_port;
static mbm_client client;
static mbm_line line;
static mbm_node master;
static uint8_t frame[MBM_MAX_ASCII_FRAME], other_frame[MBM_MAX_ASCII_FRAME];
static uint8_t outgoing[MBM_MAX_TCP_FRAME];
static mbm_clientRequest requests[3];
static uint16_t words[4];
static unsigned ended, hooks_called;

static void count_done(void *context, mbm_clientRequest *request)
{
    ended++;
}

static void reset(void)
{
    memset(&client, 0, sizeof client);
    memset(&line, 0, sizeof line);
    memset(&master, 0, sizeof master);
    memset(&wire, 0, sizeof wire);
    memset(&other_wire, 0, sizeof other_wire);
    memset(requests, 0, sizeof requests);
    wire.step = other_wire.step = 100;
    port = hooked_port_of(&wire);
    other_port = hooked_port_of(&other_wire);
    for (size_t i = 0; i < COUNT(requests); i++) {
        requests[i].unit = 17;
        requests[i].transaction = (uint16_t)(i + 1);
        requests[i].reply = words;
        requests[i].replyBytes = sizeof words;
        requests[i].done = count_done;
    }
    ended = hooks_called = 0;
}

fixture each_test = {reset, NULL};

/* Begins the client with the framing of a number, on either port. */
static uint8_t begin(unsigned framing, const mbm_port *on)
{
    return CLIENT_BEGIN(&client, framing, on, frame, outgoing);
}

static void ask_three_times(void)
{
    for (size_t i = 0; i < COUNT(requests); i++)
        IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &requests[i], 0, 1));
    wire.length = 0;
    for (size_t i = 0; i < 1000 && wire.length == 0; i++)
        IS(MBM_PENDING, mbm_client_poll(&client));
    assert_true(wire.length > 0);
}

/* A request over the other port, with the reply that RTU has. */
static void ask_over_the_other_port(unsigned framing)
{
    mbm_clientRequest *const request = &requests[0];

    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, request, 0, 1));
    for (unsigned i = 0; i < 1000 && other_wire.length == 0; i++)
        IS(MBM_PENDING, mbm_client_poll(&client));
    assert_true(other_wire.length > 0);
    if (framing != MBM_FRAMING_RTU && framing != MBM_FRAMING_RTU_OVER_TCP)
        return;
    hooked_port_arrive_rtu(&other_wire, 17, "\x03\x02\x12\x34", 4);
    for (unsigned i = 0; i < 1000 && request->status == MBM_PENDING; i++)
        mbm_client_poll(&client);
    OK(request->status);
    assert_int_equal(words[0], 0x1234);
}

TEST(a_client_gives_up_its_requests_whatever_its_framing_was_and_becomes)
{
    for (unsigned from = 0; from < 4; from++) {
        for (unsigned to = 0; to < 4; to++) {
            reset();
            OK(begin(from, &port));
            ask_three_times();
            assert_int_equal(mbm_client_pending(&client), 3);
            wire.length = 0;
            OK(begin(to, &other_port));
            for (size_t i = 0; i < COUNT(requests); i++)
                IS(MBM_CANCELLED, requests[i].status);
            assert_int_equal(ended, 0);
            assert_int_equal(mbm_client_pending(&client), 0);
            OK(mbm_client_poll(&client));
            assert_int_equal(mbm_client_isConnected(&client), 1);
            ask_over_the_other_port(to);
            assert_int_equal(wire.length, 0);
        }
    }
}

TEST(a_client_that_begins_again_has_the_settings_of_the_first_time)
{
    mbm_counters counters = {0};

    OK(begin(MBM_FRAMING_RTU, &port));
    OK(mbm_client_setCounters(&client, &counters));
    OK(mbm_client_setResponseTimeout(&client, 1));
    OK(mbm_client_setRetries(&client, 5));
    ask_three_times();
    counters.requests = 0;
    OK(begin(MBM_FRAMING_RTU, &other_port));
    ask_over_the_other_port(MBM_FRAMING_RTU);
    assert_int_equal(counters.requests, 0);
}

static void within_the_driver_hook(int hook)
{
    if (hook == HOOK_POST) {
        hooks_called++;
        IS(MBM_BUSY, begin(MBM_FRAMING_TCP, &other_port));
        IS(MBM_BUSY, mbm_client_poll(&client));
        IS(MBM_BUSY, mbm_client_readCoils(&client, &requests[2], 0, 1));
    }
}

static uint8_t never_drained(void *context)
{
    return 0;
}

TEST(a_client_that_begins_again_switches_the_driver_of_the_old_port_off)
{
    port.flush = never_drained;
    OK(begin(MBM_FRAMING_RTU, &port));
    ask_three_times();
    wire.within = within_the_driver_hook;
    assert_int_equal(wire.called[HOOK_POST], 0);
    OK(begin(MBM_FRAMING_RTU, &other_port));
    assert_int_equal(wire.called[HOOK_POST], 1);
    assert_int_equal(hooks_called, 1);
    wire.within = NULL;
    ask_over_the_other_port(MBM_FRAMING_RTU);
}

TEST(a_client_that_is_suspended_is_not_begun_again)
{
    OK(begin(MBM_FRAMING_RTU, &port));
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &requests[0], 0, 1));
    OK(mbm_client_suspend(&client, &line));
    for (unsigned framing = 0; framing < 4; framing++)
        REFUSED(MBM_BUSY, client, begin(framing, &other_port));
    IS(MBM_PENDING, requests[0].status);
    OK(mbm_client_resume(&client, &line));
    OK(begin(MBM_FRAMING_TCP, &other_port));
    IS(MBM_CANCELLED, requests[0].status);
}

static void begin_another(void *context, mbm_clientRequest *request)
{
    ended++;
    OK(begin(MBM_FRAMING_TCP, &other_port));
}

TEST(a_client_may_begin_again_when_a_request_is_done)
{
    requests[0].done = begin_another;
    OK(begin(MBM_FRAMING_RTU, &port));
    ask_three_times();
    hooked_port_arrive_rtu(&wire, 17, "\x03\x02\x12\x34", 4);
    for (unsigned i = 0; i < 100 && ended == 0; i++)
        mbm_client_poll(&client);
    assert_int_equal(ended, 1);
    OK(requests[0].status);
    IS(MBM_CANCELLED, requests[1].status);
    IS(MBM_CANCELLED, requests[2].status);
    OK(mbm_client_poll(&client));
    requests[0].done = NULL;
    ask_over_the_other_port(MBM_FRAMING_TCP);
}

TEST(a_line_and_a_node_keep_their_settings)
{
    mbm_counters counters = {0};

    OK(mbm_line_beginRtu(&line, &port, other_frame, 256));
    OK(mbm_node_begin(&master, &line, 17, words, 4, NULL, 0));
    OK(mbm_node_setBlocking(&master, 0));
    OK(mbm_line_setCounters(&line, &counters));
    IS(MBM_PENDING, mbm_node_readHoldingRegisters(&master, 0, 1));
    for (unsigned i = 0; i < 1000 && wire.length == 0; i++)
        IS(MBM_PENDING, mbm_node_poll(&master));
    IS(MBM_BUSY, mbm_line_beginRtu(&line, &other_port, other_frame, 256));
    OK(mbm_node_cancel(&master));
    OK(mbm_line_beginRtu(&line, &other_port, other_frame, 256));
    OK(mbm_node_begin(&master, &line, 18, words, 4, NULL, 0));
    IS(MBM_CANCELLED, mbm_node_status(&master));
    IS(MBM_CANCELLED, mbm_node_poll(&master));
    IS(MBM_PENDING, mbm_node_readHoldingRegisters(&master, 0, 1));
    for (unsigned i = 0; i < 10000 && other_wire.called[HOOK_POST] == 0; i++)
        IS(MBM_PENDING, mbm_node_poll(&master));
    hooked_port_arrive_rtu(&other_wire, 18, "\x03\x02\x56\x78", 4);
    /* After a request that was given up, a reply is held for the quiet time. */
    for (unsigned i = 0; i < 10000 && mbm_node_poll(&master) == MBM_PENDING; i++)
        ;
    OK(mbm_node_status(&master));
    assert_int_equal(words[0], 0x5678);
    assert_int_equal(counters.requests, 2);
}

TEST(a_server_drops_what_it_received_and_serves_the_new_port)
{
    static mbm_server server;
    static mbm_unit unit;
    static mbm_registerTable table;

    unit.id = 17;
    table.words = words;
    table.size = 4;
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    OK(mbm_server_setEchoDiscard(&server, 1));
    hooked_port_arrive_rtu(&wire, 17, "\x03\x00\x00\x00\x01", 5);
    OK(mbm_server_poll(&server));
    OK(mbm_server_beginRtu(&server, &other_port, &unit, 1, other_frame, sizeof other_frame));
    for (unsigned i = 0; i < 100; i++)
        OK(mbm_server_poll(&server));
    assert_int_equal(wire.length + other_wire.length, 0);
    hooked_port_arrive_rtu(&other_wire, 17, "\x03\x00\x00\x00\x01", 5);
    for (unsigned i = 0; i < 100; i++)
        OK(mbm_server_poll(&server));
    assert_int_equal(other_wire.length, 7);
    /* The echo is no longer discarded: the second request is answered too. */
    other_wire.length = 0;
    hooked_port_arrive_rtu(&other_wire, 17, "\x03\x00\x00\x00\x01", 5);
    for (unsigned i = 0; i < 100; i++)
        OK(mbm_server_poll(&server));
    assert_int_equal(other_wire.length, 7);
}

TEST(a_sniffer_forgets_bytes_and_requests)
{
    static mbm_sniffer sniffer;
    mbm_event event;

    hooked_port_arrive_rtu(&wire, 17, "\x03\x00\x00\x00\x01", 5);
    OK(mbm_sniffer_begin(&sniffer, MBM_FRAMING_RTU, frame, sizeof frame));
    OK(mbm_sniffer_setResponseTimeout(&sniffer, 1));
    assert_int_equal(mbm_sniffer_feed(&sniffer, MBM_DIRECTION_BOTH, wire.arriving, 8, 0), 8);
    assert_int_equal(mbm_sniffer_next(&sniffer, 10000, &event), 1);
    assert_int_equal(event.kind, MBM_EVENT_REQUEST);
    assert_int_equal(mbm_sniffer_feed(&sniffer, MBM_DIRECTION_BOTH, wire.arriving, 4, 20000), 4);
    OK(mbm_sniffer_begin(&sniffer, MBM_FRAMING_TCP, other_frame, sizeof other_frame));
    assert_int_equal(mbm_sniffer_next(&sniffer, 60000000, &event), 0);
}

TEST(a_ring_is_empty_and_has_lost_nothing)
{
    static mbm_ring ring;
    uint8_t bytes[4], others[8], taken[8];

    OK(mbm_ring_begin(&ring, bytes, sizeof bytes));
    assert_int_equal(mbm_ring_write(&ring, (const uint8_t *)"12345", 5), 3);
    assert_int_equal(mbm_ring_lost(&ring), 2);
    OK(mbm_ring_begin(&ring, others, sizeof others));
    assert_int_equal(mbm_ring_available(&ring), 0);
    assert_int_equal(mbm_ring_lost(&ring), 0);
    assert_int_equal(mbm_ring_write(&ring, (const uint8_t *)"1234567", 7), 7);
    assert_int_equal(mbm_ring_read(&ring, taken, sizeof taken), 7);
}
