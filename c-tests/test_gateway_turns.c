/* A gateway with several requests at once: order, turns, places, time in the queue, and
 * connections that close. All in memory. */
#include "gateway_bench.h"
#include "test.h"

static gateway_bench b;

static const mbm_gatewayRoute routes[] = {{1, 31, 0, 0}, {101, 131, 1, 1}};

#define READ "\x03\x00\x10\x00\x01"
#define VALUE "\x03\x02\x12\x34"
#define OTHER_VALUE "\x03\x02\xAB\xCD"
#define NO_PATH "\x83\x0A"
#define NO_RESPONSE "\x83\x0B"

static void start(void)
{
    gateway_bench_start(&b, routes, COUNT(routes));
}

fixture each_test = {start, NULL};

static uint16_t pending(unsigned connection)
{
    return mbm_gateway_pending(&b.gateway, (uint8_t)connection);
}

/* --- several requests of one connection --- */

TEST(replies_go_back_as_they_arrive_with_their_transaction_id)
{
    ASK(0, 0x0001, 2, READ);
    ASK(0, 0xFFFF, 102, READ);
    ON_LINE(0, 2, READ);
    ON_LINE(1, 2, READ);
    assert_int_equal(pending(0), 2);
    REPLY(1, 2, OTHER_VALUE);
    EXPECT(0, 0xFFFF, 102, OTHER_VALUE);
    REPLY(0, 2, VALUE);
    EXPECT(0, 0x0001, 2, VALUE);
    assert_int_equal(pending(0), 0);
}

TEST(requests_of_one_connection_reach_their_line_in_order)
{
    for (unsigned i = 0; i < 5; i++)
        ASK(0, i, (uint8_t)(2 + i), READ);
    for (unsigned i = 0; i < 5; i++) {
        ON_LINE(0, (uint8_t)(2 + i), READ);
        REPLY(0, (uint8_t)(2 + i), VALUE);
        EXPECT(0, i, (uint8_t)(2 + i), VALUE);
    }
}

TEST(requests_with_the_same_transaction_id_are_all_answered)
{
    ASK(0, 7, 2, READ);
    ASK(0, 7, 3, READ);
    ASK(1, 7, 4, READ);
    ON_LINE(0, 2, READ);
    REPLY(0, 2, VALUE);
    EXPECT(0, 7, 2, VALUE);
    ON_LINE(0, 4, READ);
    REPLY(0, 4, VALUE);
    EXPECT(1, 7, 4, VALUE);
    ON_LINE(0, 3, READ);
    REPLY(0, 3, OTHER_VALUE);
    EXPECT(0, 7, 3, OTHER_VALUE);
}

TEST(a_connection_has_as_many_requests_as_the_setting_allows)
{
    IS(MBM_INVALID_ARGUMENT, mbm_gateway_setMaxPending(&b.gateway, 0));
    OK(mbm_gateway_setMaxPending(&b.gateway, 2));
    ASK(0, 1, 2, READ);
    ASK(0, 2, 3, READ);
    ASK(0, 3, 4, READ);
    ON_LINE(0, 2, READ);
    assert_int_equal(pending(0), 2);
    assert_int_equal(mbm_gateway_isReading(&b.gateway, 0), 0);
    assert_int_equal(b.sockets[0].arriving_count, 12); /* the third one waits in the socket */
    REPLY(0, 2, VALUE);
    EXPECT(0, 1, 2, VALUE);
    ON_LINE(0, 3, READ);
    assert_int_equal(b.sockets[0].arriving_count, 0);
    REPLY(0, 3, VALUE);
    EXPECT(0, 2, 3, VALUE);
    assert_int_equal(mbm_gateway_isReading(&b.gateway, 0), 1);
    ON_LINE(0, 4, READ);
}

/* --- turns --- */

/* The next request on line 0 is for the unit. It is answered at once. */
static void next_is(uint8_t unit)
{
    ON_LINE(0, unit, READ);
    REPLY(0, unit, VALUE);
}

TEST(the_connections_take_turns_on_a_line)
{
    for (unsigned i = 0; i < 5; i++)
        ASK(0, i, 2, READ);
    ON_LINE(0, 2, READ); /* the flood has begun before the others come */
    ASK(1, 0, 3, READ);
    ASK(2, 0, 4, READ);
    REPLY(0, 2, VALUE);
    next_is(3);
    next_is(4);
    next_is(2);
    ASK(2, 1, 4, READ);
    next_is(4);
    next_is(2);
    next_is(2);
    next_is(2);
    SILENT(b.wires[0]);
}

/* Between two requests of a client at most two requests of others reach the line, however much
 * another client sends. The test counts requests, so it does not depend on time. */
TEST(a_flood_of_one_client_does_not_starve_another)
{
    unsigned round, i, served = 0, others = 0;

    ASK(1, 0, 3, READ);
    for (round = 0; round < 300; round++) {
        for (i = 0; b.sockets[0].arriving_count < 200; i++)
            ASK(0, i, 2, READ);
        while (b.wires[0].sent_count == 0)
            assert_true(gateway_bench_step(&b));
        if (b.wires[0].sent[0] == 3) {
            assert_true(others <= 2);
            others = 0;
            served++;
            ON_LINE(0, 3, READ);
            REPLY(0, 3, VALUE);
            ASK(1, served, 3, READ);
        } else {
            others++;
            ON_LINE(0, 2, READ);
            REPLY(0, 2, VALUE);
        }
        for (i = 0; i < 2; i++)
            b.sockets[i].sent_count = 0;
    }
    assert_true(served >= 100);
}

TEST(a_client_that_floods_leaves_a_place_for_each_other)
{
    for (unsigned i = 0; i < 20; i++)
        ASK(0, i, 2, READ);
    ON_LINE(0, 2, READ);
    assert_int_equal(pending(0), BENCH_REQUESTS - (BENCH_CONNECTIONS - 1));
    assert_int_equal(mbm_gateway_isReading(&b.gateway, 0), 0);
    assert_int_equal(mbm_gateway_isReading(&b.gateway, 1), 1);
    ASK(1, 1, 3, READ);
    ASK(1, 2, 3, READ);
    ASK(2, 1, 4, READ);
    OK(mbm_gateway_poll(&b.gateway));
    assert_int_equal(pending(1), 1);
    assert_int_equal(pending(2), 1);
    REPLY(0, 2, VALUE);
    next_is(3);
    next_is(4);
    next_is(2);
    /* The client that has most requests does not get the free place. */
    next_is(3);
}

/* --- time --- */

TEST(a_request_that_waits_too_long_for_its_line_gets_0a)
{
    OK(mbm_gateway_setQueueTime(&b.gateway, 150));
    ASK(0, 1, 2, READ);
    ASK(0, 2, 3, READ);
    ASK(0, 3, 4, READ);
    ON_LINE(0, 2, READ);
    EXPECT(0, 1, 2, NO_RESPONSE); /* after 100 ms and more */
    ON_LINE(0, 3, READ);
    EXPECT(0, 3, 4, NO_PATH); /* its client has given up meanwhile */
    EXPECT(0, 2, 3, NO_RESPONSE);
    SILENT(b.wires[0]);
    /* The time on the line does not count. */
    OK(mbm_gateway_setQueueTime(&b.gateway, 1));
    ASK(1, 1, 5, READ);
    ON_LINE(0, 5, READ);
    EXPECT(1, 1, 5, NO_RESPONSE);
}

TEST(a_request_that_waits_is_answered_in_time_though_nothing_else_happens)
{
    OK(mbm_gateway_setQueueTime(&b.gateway, 30));
    ASK(0, 1, 2, READ);
    ASK(0, 2, 3, READ);
    ON_LINE(0, 2, READ);
    EXPECT(0, 2, 3, NO_PATH);
    EXPECT(0, 1, 2, NO_RESPONSE); /* after 100 ms */
}

TEST(an_idle_gateway_has_nothing_to_do)
{
    OK(mbm_gateway_poll(&b.gateway));
    assert_int_equal(mbm_gateway_pollDelay(&b.gateway), UINT32_MAX);
    ASK(0, 1, 2, READ);
    OK(mbm_gateway_poll(&b.gateway));
    assert_true(mbm_gateway_pollDelay(&b.gateway) < 100000);
}

/* --- connections --- */

TEST(a_connection_that_closes_gives_up_its_requests)
{
    ASK(0, 1, 2, READ);
    ASK(0, 2, 3, READ);
    ON_LINE(0, 2, READ);
    ASK(1, 1, 4, READ);
    b.sockets[0].is_lost = 1;
    OK(mbm_gateway_poll(&b.gateway));
    IS(MBM_LINK_LOST, mbm_gateway_status(&b.gateway, 0));
    assert_int_equal(pending(0), 0);
    /* The reply to the request that was given up comes late. */
    REPLY(0, 2, VALUE);
    ON_LINE(0, 4, READ);
    REPLY(0, 4, OTHER_VALUE);
    EXPECT(1, 1, 4, OTHER_VALUE);
    SILENT(b.wires[0]);
}

/* The same unit, function and length: only the order of the replies tells them apart. */
TEST(a_new_client_in_the_place_gets_only_its_own_reply)
{
    ASK(0, 5, 2, READ);
    ON_LINE(0, 2, READ);
    OK(mbm_gateway_close(&b.gateway, 0));
    assert_int_equal(mbm_client_pending(&b.clients[0]), 0);
    gateway_bench_open(&b, 0);
    ASK(0, 5, 2, "\x03\x00\x20\x00\x01");
    OK(mbm_gateway_poll(&b.gateway));
    REPLY(0, 2, VALUE);
    ON_LINE(0, 2, "\x03\x00\x20\x00\x01");
    REPLY(0, 2, OTHER_VALUE);
    EXPECT(0, 5, 2, OTHER_VALUE);
    SILENT(b.sockets[0]);
}

TEST(half_a_request_dies_with_its_connection)
{
    memory_port_bytes(&b.sockets[0], (const uint8_t *)"\0\1\0\0\0\6\2\3\0", 9);
    OK(mbm_gateway_poll(&b.gateway));
    assert_int_equal(pending(0), 0);
    OK(mbm_gateway_close(&b.gateway, 0));
    gateway_bench_open(&b, 0);
    ASK(0, 2, 3, READ);
    ON_LINE(0, 3, READ);
}

TEST(bytes_that_are_not_modbus_end_their_connection_only)
{
    static const char *const bad[] = {"\0\1\0\1\0\6\2\3", "\0\1\0\0\0\0\2\3", "\0\1\0\0\1\0\2\3"};

    for (unsigned i = 0; i < COUNT(bad); i++) {
        ASK(0, 1, 2, READ);
        ON_LINE(0, 2, READ);
        ASK(1, 1, 3, READ);
        memory_port_bytes(&b.sockets[0], (const uint8_t *)bad[i], 8);
        OK(mbm_gateway_poll(&b.gateway));
        IS(MBM_MALFORMED_FRAME, mbm_gateway_status(&b.gateway, 0));
        OK(mbm_gateway_status(&b.gateway, 1));
        ON_LINE(0, 3, READ);
        REPLY(0, 3, VALUE);
        EXPECT(1, 1, 3, VALUE);
        gateway_bench_open(&b, 0);
        OK(mbm_gateway_status(&b.gateway, 0));
    }
}

TEST(a_place_is_free_in_use_or_lost)
{
    const mbm_port port = memory_port_of(&b.sockets[0]);

    IS(MBM_BUSY, mbm_gateway_open(&b.gateway, 0, &port));
    OK(mbm_gateway_close(&b.gateway, 0));
    IS(MBM_NOT_INITIALISED, mbm_gateway_status(&b.gateway, 0));
    OK(mbm_gateway_close(&b.gateway, 0));
    assert_int_equal(mbm_gateway_isReading(&b.gateway, 0), 0);
    OK(mbm_gateway_open(&b.gateway, 0, &port));
    IS(MBM_INVALID_ARGUMENT, mbm_gateway_status(&b.gateway, BENCH_CONNECTIONS));
}

/* --- ports --- */

static size_t most; /* bytes that a socket reads or takes at a time */
static mbm_port whole;

static int16_t read_few(void *context, uint8_t *bytes, uint16_t capacity)
{
    return whole.read(context, bytes, capacity < most ? capacity : (uint16_t)most);
}

static int16_t write_few(void *context, const uint8_t *bytes, uint16_t length)
{
    return whole.write(context, bytes, length < most ? length : (uint16_t)most);
}

static void open_narrow(void)
{
    mbm_port port;

    OK(mbm_gateway_close(&b.gateway, 0));
    port = whole = memory_port_of(&b.sockets[0]);
    port.read = read_few;
    port.write = write_few;
    OK(mbm_gateway_open(&b.gateway, 0, &port));
}

TEST(requests_arrive_and_responses_leave_byte_by_byte)
{
    open_narrow();
    most = 1;
    ASK(0, 1, 2, READ);
    ASK(0, 2, 102, READ);
    ON_LINE(0, 2, READ);
    ON_LINE(1, 2, READ);
    REPLY(0, 2, VALUE);
    REPLY(1, 2, OTHER_VALUE);
    /* Each response is whole before the next one begins. */
    EXPECT(0, 1, 2, VALUE);
    EXPECT(0, 2, 102, OTHER_VALUE);
}

TEST(a_client_that_takes_no_responses_delays_no_other)
{
    open_narrow();
    most = 20;
    ASK(0, 1, 2, READ);
    ON_LINE(0, 2, READ);
    most = 0;
    REPLY(0, 2, VALUE);
    ASK(1, 1, 3, READ);
    ON_LINE(0, 3, READ);
    REPLY(0, 3, OTHER_VALUE);
    EXPECT(1, 1, 3, OTHER_VALUE);
    OK(mbm_gateway_poll(&b.gateway));
    assert_int_equal(b.sockets[0].sent_count, 0);
    assert_true(mbm_gateway_pollDelay(&b.gateway) <= 1000);
    assert_true(mbm_gateway_pollDelay(&b.gateway) > 0);
    most = 20;
    EXPECT(0, 1, 2, VALUE);
}

/* The lines of a gateway: not ready, lost, full, shared with the program, begun anew; ASCII and
 * TCP; and the gateway's own units beside them. All in memory. */

#define READ_OTHER "\x03\x00\x20\x00\x01"

static uint8_t ready;

static uint8_t is_ready(void *context)
{
    assert_ptr_equal(context, &b);
    return ready;
}

TEST(a_line_that_is_not_ready_gets_0a)
{
    b.lines[0].isReady = is_ready;
    b.lines[0].context = &b;
    ready = 0;
    ASK(0, 1, 2, READ);
    EXPECT(0, 1, 2, NO_PATH);
    SILENT(b.wires[0]);
    ready = 1;
    ASK(0, 2, 2, READ);
    ON_LINE(0, 2, READ);
}

TEST(a_changed_route_holds_for_later_requests)
{
    static mbm_gatewayRoute map[2];

    map[0] = (mbm_gatewayRoute){1, 9, 0, 0};
    map[1] = (mbm_gatewayRoute){10, 19, 1, 0};
    gateway_bench_start(&b, map, COUNT(map));
    ASK(0, 1, 2, READ);
    ON_LINE(0, 2, READ);
    map[0] = (mbm_gatewayRoute){1, 9, 1, 101};
    map[1] = (mbm_gatewayRoute){1, 0, 0, 0};
    REPLY(0, 2, VALUE);
    EXPECT(0, 1, 2, VALUE);
    ASK(0, 2, 2, READ);
    ON_LINE(1, 102, READ);
    REPLY(1, 102, VALUE);
    EXPECT(0, 2, 2, VALUE);
    ASK(0, 3, 12, READ);
    EXPECT(0, 3, 12, NO_PATH);
}

TEST(a_line_that_is_lost_gets_0a)
{
    ASK(0, 1, 2, READ);
    ASK(0, 2, 2, READ);
    ON_LINE(0, 2, READ);
    b.wires[0].is_lost = 1;
    EXPECT(0, 1, 2, NO_PATH);
    EXPECT(0, 2, 2, NO_PATH);
    b.wires[0].is_lost = 0;
    ASK(0, 3, 2, READ);
    ON_LINE(0, 2, READ);
    REPLY(0, 2, VALUE);
    EXPECT(0, 3, 2, VALUE);
}

static mbm_clientRequest own[16];

static void fill_the_queue(void)
{
    memset(own, 0, sizeof own);
    for (unsigned i = 0; i < COUNT(own); i++) {
        own[i].unit = 9;
        IS(MBM_PENDING, mbm_client_readExceptionStatus(&b.clients[0], &own[i]));
    }
}

TEST(a_client_whose_queue_is_full_gets_0a)
{
    fill_the_queue();
    ASK(0, 1, 2, READ);
    EXPECT(0, 1, 2, NO_PATH);
}

TEST(the_program_shares_the_line)
{
    memset(own, 0, sizeof own);
    own[0].unit = 9;
    ASK(0, 1, 2, READ);
    ON_LINE(0, 2, READ);
    IS(MBM_PENDING, mbm_client_readExceptionStatus(&b.clients[0], &own[0]));
    ASK(0, 2, 2, READ_OTHER);
    REPLY(0, 2, VALUE);
    EXPECT(0, 1, 2, VALUE);
    ON_LINE(0, 9, "\x07");
    REPLY(0, 9, "\x07\x6D");
    ON_LINE(0, 2, READ_OTHER);
    OK(own[0].status);
    REPLY(0, 2, OTHER_VALUE);
    EXPECT(0, 2, 2, OTHER_VALUE);
}

TEST(a_line_that_is_begun_anew_gets_0a)
{
    const mbm_port port = memory_port_of(&b.wires[0]);

    ASK(0, 1, 2, READ);
    ON_LINE(0, 2, READ);
    OK(mbm_client_beginRtu(&b.clients[0], &port, b.frames[0], MBM_MAX_FRAME));
    EXPECT(0, 1, 2, NO_PATH);
    ASK(0, 2, 2, READ);
    ON_LINE(0, 2, READ);
    /* Also if the program has zeroed the client. */
    memset(&b.clients[0], 0, sizeof b.clients[0]);
    EXPECT(0, 2, 2, NO_PATH);
    ASK(0, 3, 2, READ);
    EXPECT(0, 3, 2, NO_PATH);
}

TEST(a_suspended_line_goes_on_when_it_is_resumed)
{
    OK(mbm_client_suspend(&b.clients[0], NULL));
    ASK(0, 1, 2, READ);
    SILENT(b.wires[0]);
    SILENT(b.sockets[0]);
    OK(mbm_client_resume(&b.clients[0], NULL));
    ON_LINE(0, 2, READ);
    REPLY(0, 2, VALUE);
    EXPECT(0, 1, 2, VALUE);
}

TEST(an_ascii_line_works)
{
    const mbm_port port = memory_port_of(&b.wires[1]);
    static const char sent[] = ":020300100001EA\r\n", reply[] = ":0203021234B3\r\n";

    OK(mbm_client_beginAscii(&b.clients[1], &port, b.frames[1], MBM_MAX_ASCII_FRAME));
    ASK(0, 1, 102, READ);
    gateway_bench_settle(&b);
    assert_int_equal(b.wires[1].sent_count, sizeof sent - 1);
    assert_memory_equal(b.wires[1].sent, sent, sizeof sent - 1);
    EXPECT(0, 1, 102, NO_RESPONSE);
    b.wires[1].sent_count = 0;
    ASK(0, 2, 102, READ);
    while (b.wires[1].sent_count < sizeof sent - 1)
        assert_true(gateway_bench_step(&b));
    memory_port_bytes(&b.wires[1], (const uint8_t *)reply, sizeof reply - 1);
    EXPECT(0, 2, 102, VALUE);
}

/* A line that is a TCP connection has as many requests in flight as `inFlight` says. */
TEST(a_line_may_be_a_tcp_connection)
{
    static uint8_t outgoing[MBM_MAX_TCP_FRAME];
    const mbm_port port = memory_port_of(&b.wires[0]);
    uint8_t reply[] = {0, 0, 0, 0, 0, 5, 2, 3, 2, 0x12, 0x34};

    OK(mbm_client_beginTcp(&b.clients[0], &port, b.frames[0], MBM_MAX_TCP_FRAME, outgoing,
                           sizeof outgoing));
    OK(mbm_client_setInFlight(&b.clients[0], 3));
    b.lines[0].inFlight = 3;
    for (unsigned i = 0; i < 4; i++)
        ASK(0, 100 + i, 2, READ);
    for (unsigned i = 0; i < 4; i++)
        OK(mbm_gateway_poll(&b.gateway));
    assert_int_equal(b.wires[0].sent_count, 3 * 12);
    memcpy(reply, b.wires[0].sent + 24, 2); /* the last one is answered first */
    memory_port_bytes(&b.wires[0], reply, sizeof reply);
    EXPECT(0, 102, 2, VALUE);
    OK(mbm_gateway_poll(&b.gateway));
    OK(mbm_gateway_poll(&b.gateway));
    assert_int_equal(b.wires[0].sent_count, 4 * 12);
    memcpy(reply, b.wires[0].sent, 2);
    memory_port_bytes(&b.wires[0], reply, sizeof reply);
    EXPECT(0, 100, 2, VALUE);
}

/* --- the gateway's own units --- */

static mbm_unit unit;
static mbm_registerTable table;
static mbm_custom custom;
static uint16_t words[4] = {1, 2, 3, 4};
static uint8_t units_seen[8];
static unsigned calls, not_yet;

static uint16_t serve(void *context, const mbm_request *request, uint8_t *response,
                      uint16_t capacity)
{
    units_seen[calls++ % COUNT(units_seen)] = request->unit;
    if (not_yet > 0) {
        not_yet--;
        return MBM_REPLY_PENDING;
    }
    response[0] = request->data[0];
    return 1;
}

TEST(own_units_are_served_beside_the_lines)
{
    static const mbm_gatewayRoute local[] = {{1, 31, 0, 0}, {200, 201, MBM_GATEWAY_LOCAL, 7}};

    gateway_bench_start(&b, local, COUNT(local));
    memset(&table, 0, sizeof table);
    memset(&custom, 0, sizeof custom);
    unit = (mbm_unit){.id = 7};
    table.words = words;
    table.size = COUNT(words);
    custom.code = 0x41;
    custom.serve = serve;
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(mbm_unit_serveCustom(&unit, &custom));
    /* Before the units are there, nothing responds. */
    ASK(0, 1, 200, "\x03\x00\x00\x00\x02");
    SILENT(b.sockets[0]);
    OK(mbm_gateway_serveUnits(&b.gateway, &unit, 1));
    ASK(0, 2, 200, "\x03\x00\x01\x00\x02");
    EXPECT(0, 2, 200, "\x03\x04\x00\x02\x00\x03");
    ASK(0, 3, 201, "\x03\x00\x01\x00\x02"); /* unit 8 */
    SILENT(b.sockets[0]);
    /* A function that is not finished delays no other request. */
    calls = 0;
    not_yet = 3;
    ASK(0, 4, 200, "\x41x");
    ASK(0, 5, 200, "\x03\x00\x00\x00\x01");
    ASK(0, 6, 3, READ);
    EXPECT(0, 5, 200, "\x03\x02\x00\x01");
    assert_true(mbm_gateway_pollDelay(&b.gateway) <= 1000);
    EXPECT(0, 4, 200, "\x41x");
    assert_int_equal(calls, 4);
    assert_int_equal(units_seen[0], 7);
    assert_int_equal(units_seen[3], 7);
    ON_LINE(0, 3, READ);
    SILENT(b.wires[1]);
}
