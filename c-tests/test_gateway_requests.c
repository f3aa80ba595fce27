/* Where a gateway sends requests, and what it makes of the replies. All in memory. */
#include "gateway_bench.h"
#include "test.h"

static gateway_bench b;

/* Line 0 has the units 1 to 31, line 1 the units 1 to 31 as 101 to 131. */
static const mbm_gatewayRoute routes[] = {
    {1, 31, 0, 0},
    {101, 131, 1, 1},
    {255, 255, 0, 5},
    {0, 0, 1, 6},
};

#define READ "\x03\x00\x10\x00\x01"
#define READ_OTHER "\x03\x00\x20\x00\x01"
#define VALUE "\x03\x02\x12\x34"
#define OTHER_VALUE "\x03\x02\xAB\xCD"
#define NO_PATH "\x83\x0A"
#define NO_RESPONSE "\x83\x0B"

static void start(void)
{
    gateway_bench_start(&b, routes, COUNT(routes));
}

fixture each_test = {start, NULL};

TEST(a_request_goes_to_the_line_and_unit_of_its_route)
{
    static const struct {
        uint8_t unit, line, there;
    } cases[] = {{1, 0, 1}, {31, 0, 31}, {101, 1, 1}, {131, 1, 31}, {255, 0, 5}, {0, 1, 6}};

    for (unsigned i = 0; i < COUNT(cases); i++) {
        ASK(0, 0x1200 + i, cases[i].unit, READ);
        ON_LINE(cases[i].line, cases[i].there, READ);
        REPLY(cases[i].line, cases[i].there, VALUE);
        EXPECT(0, 0x1200 + i, cases[i].unit, VALUE);
    }
    SILENT(b.wires[0]);
}

TEST(a_unit_without_a_route_gets_0a)
{
    ASK(1, 7, 32, READ);
    EXPECT(1, 7, 32, NO_PATH);
    ASK(1, 8, 254, READ);
    EXPECT(1, 8, 254, NO_PATH);
    SILENT(b.wires[0]);
    SILENT(b.wires[1]);
}

TEST(an_exception_of_a_device_passes)
{
    ASK(0, 1, 2, READ);
    ON_LINE(0, 2, READ);
    REPLY(0, 2, "\x83\x02");
    EXPECT(0, 1, 2, "\x83\x02");
}

TEST(a_silent_device_gets_0b)
{
    ASK(0, 1, 2, READ);
    ON_LINE(0, 2, READ);
    EXPECT(0, 1, 2, NO_RESPONSE);
}

TEST(half_a_reply_and_a_damaged_one_get_0b)
{
    ASK(0, 1, 2, READ);
    ON_LINE(0, 2, READ);
    memory_port_bytes(&b.wires[0], (const uint8_t *)"\x02\x03\x02\x12", 4);
    EXPECT(0, 1, 2, NO_RESPONSE);
    ASK(0, 2, 2, READ);
    ON_LINE(0, 2, READ);
    memory_port_bytes(&b.wires[0], (const uint8_t *)"\x02\x03\x02\x12\x34\x00\x00", 7);
    EXPECT(0, 2, 2, NO_RESPONSE);
}

TEST(a_reply_that_does_not_answer_the_request_gets_0b)
{
    ASK(0, 1, 2, "\x03\x00\x10\x00\x03");
    ON_LINE(0, 2, "\x03\x00\x10\x00\x03");
    REPLY(0, 2, VALUE);
    EXPECT(0, 1, 2, NO_RESPONSE);
    ASK(0, 2, 2, "\x06\x00\x10\x12\x34");
    ON_LINE(0, 2, "\x06\x00\x10\x12\x34");
    REPLY(0, 2, "\x06\x00\x11\x12\x34");
    EXPECT(0, 2, 2, "\x86\x0B");
}

TEST(a_late_reply_to_a_closed_connection_is_discarded)
{
    ASK(0, 1, 2, READ);
    ON_LINE(0, 2, READ);
    EXPECT(0, 1, 2, NO_RESPONSE);
    ASK(1, 9, 2, READ_OTHER);
    ON_LINE(0, 2, READ_OTHER);
    REPLY(0, 2, VALUE);       /* to the first request */
    REPLY(0, 2, OTHER_VALUE); /* to the second */
    EXPECT(1, 9, 2, OTHER_VALUE);
    SILENT(b.sockets[0]);
}

TEST(a_request_that_the_standard_forbids_is_refused)
{
    ASK(0, 1, 2, "\x03\x00\x10\x00\x00");
    EXPECT(0, 1, 2, "\x83\x03");
    ASK(0, 2, 2, "\x03\xFF\xFF\x00\x02");
    EXPECT(0, 2, 2, "\x83\x02");
    ASK(0, 3, 2, "\x00\x01");
    EXPECT(0, 3, 2, "\x80\x01");
    /* Records without their byte count: a program may forward them, a TCP client may not. */
    ASK(0, 4, 2, "\x14\x06\x00\x04\x00\x01\x00\x02");
    EXPECT(0, 4, 2, "\x94\x03");
    ASK(0, 5, 2, "\x15\x06\x00\x04\x00\x01\x00\x01\xBE\xEF");
    EXPECT(0, 5, 2, "\x95\x03");
    SILENT(b.wires[0]);
}

TEST(force_listen_only_mode_gets_no_response)
{
    ASK(0, 1, 2, "\x08\x00\x04\x00\x00");
    ON_LINE(0, 2, "\x08\x00\x04\x00\x00");
    SILENT(b.sockets[0]);
    assert_int_equal(mbm_gateway_pending(&b.gateway, 0), 0);
}

TEST(unknown_functions_pass)
{
    ASK(0, 1, 2, "\x64 any data");
    ON_LINE(0, 2, "\x64 any data");
    REPLY(0, 2, "\x64 of any length");
    EXPECT(0, 1, 2, "\x64 of any length");
    ASK(0, 2, 2, "\x41");
    ON_LINE(0, 2, "\x41");
    REPLY(0, 2, "\x41\x00");
    EXPECT(0, 2, 2, "\x41\x00");
}

TEST(a_reply_without_data_passes)
{
    for (unsigned function = 0x41; function <= 0x48; function++) {
        const char pdu[] = {(char)function};

        gateway_bench_ask(&b, 0, function, 2, pdu, 1);
        gateway_bench_on_line(&b, 0, 2, pdu, 1);
        gateway_bench_reply(&b, 0, 2, pdu, 1);
        gateway_bench_expect(&b, 0, function, 2, pdu, 1);
    }
}

TEST(a_declared_function_has_its_lengths)
{
    static const mbm_function functions[] = {
        {0x41, {MBM_RULE_FIXED, 3, 0}, {MBM_RULE_COUNTED, 1, 1}},
        {0x03, {MBM_RULE_FIXED, 9, 0}, {MBM_RULE_FIXED, 9, 0}}, /* the standard's meaning holds */
    };

    OK(mbm_gateway_setFunctions(&b.gateway, functions, COUNT(functions)));
    ASK(0, 1, 2, "\x41\x01");
    EXPECT(0, 1, 2, "\xC1\x03");
    ASK(0, 2, 2, "\x41\x01\x02");
    ON_LINE(0, 2, "\x41\x01\x02");
    uint32_t before = b.wires[0].now;
    REPLY(0, 2, "\x41\x02zzx");
    EXPECT(0, 2, 2, "\x41\x02zzx");
    /* No silence was waited for. */
    assert_true(b.wires[0].now - before < 1500);
    ASK(0, 3, 2, READ);
    ON_LINE(0, 2, READ);
    REPLY(0, 2, VALUE);
    EXPECT(0, 3, 2, VALUE);
    ASK(0, 4, 2, "\x42 not declared");
    ON_LINE(0, 2, "\x42 not declared");
    REPLY(0, 2, "\x42 of any length");
    EXPECT(0, 4, 2, "\x42 of any length");
    OK(mbm_gateway_setFunctions(&b.gateway, NULL, 0));
    ASK(0, 5, 2, "\x41\x01");
    ON_LINE(0, 2, "\x41\x01");
}

TEST(a_retry_sends_the_same_request)
{
    OK(mbm_client_setRetries(&b.clients[0], 2));
    ASK(0, 1, 2, "\x10\x00\x01\x00\x02\x04\x11\x22\x33\x44");
    ON_LINE(0, 2, "\x10\x00\x01\x00\x02\x04\x11\x22\x33\x44");
    REPLY(0, 2, "\x10\x00\x07\x00\x02"); /* another address */
    ON_LINE(0, 2, "\x10\x00\x01\x00\x02\x04\x11\x22\x33\x44");
    REPLY(0, 2, "\x90\x06");
    EXPECT(0, 1, 2, "\x90\x06");
    ASK(0, 2, 2, "\x10\x00\x01\x00\x02\x04\x11\x22\x33\x44");
    ON_LINE(0, 2, "\x10\x00\x01\x00\x02\x04\x11\x22\x33\x44");
    ON_LINE(0, 2, "\x10\x00\x01\x00\x02\x04\x11\x22\x33\x44");
    REPLY(0, 2, "\x10\x00\x01\x00\x02");
    EXPECT(0, 2, 2, "\x10\x00\x01\x00\x02");
}

TEST(the_longest_request_and_reply_pass)
{
    char request[253] = {0x10, 0, 1, 0, 123, (char)246}, reply[252] = {0x03, (char)250};

    for (unsigned i = 6; i < 252; i++)
        request[i] = (char)i;
    for (unsigned i = 2; i < 252; i++)
        reply[i] = (char)(i * 3);
    gateway_bench_ask(&b, 0, 1, 2, request, 252);
    gateway_bench_on_line(&b, 0, 2, request, 252);
    REPLY(0, 2, "\x10\x00\x01\x00\x7B");
    EXPECT(0, 1, 2, "\x10\x00\x01\x00\x7B");
    ASK(0, 2, 2, "\x03\x00\x00\x00\x7D");
    ON_LINE(0, 2, "\x03\x00\x00\x00\x7D");
    gateway_bench_reply(&b, 0, 2, reply, sizeof reply);
    gateway_bench_expect(&b, 0, 2, 2, reply, sizeof reply);
}

/* --- broadcasts --- */

#define WRITE "\x06\x00\x10\x12\x34"

TEST(a_broadcast_goes_to_its_line_and_gets_no_response)
{
    static const mbm_gatewayRoute one[] = {{0, 31, 0, 0}, {101, 131, 1, 1}};

    gateway_bench_start(&b, one, COUNT(one));
    ASK(0, 1, 0, WRITE);
    ASK(0, 2, 1, READ);
    ON_LINE(0, 0, WRITE);
    ON_LINE(0, 1, READ);
    REPLY(0, 1, VALUE);
    EXPECT(0, 2, 1, VALUE);
    SILENT(b.sockets[0]);
    SILENT(b.wires[1]);
    assert_int_equal(mbm_gateway_pending(&b.gateway, 0), 0);
}

TEST(a_broadcast_to_all_lines_reaches_each)
{
    static const mbm_gatewayRoute all[] = {{0, 0, MBM_GATEWAY_ALL_LINES, 0}, {1, 31, 1, 0}};

    gateway_bench_start(&b, all, COUNT(all));
    ASK(0, 1, 0, WRITE);
    ON_LINE(0, 0, WRITE);
    ON_LINE(1, 0, WRITE);
    SILENT(b.sockets[0]);
    /* A line that is lost does not keep it from the next one. */
    b.wires[0].is_lost = 1;
    ASK(0, 2, 0, WRITE);
    ON_LINE(1, 0, WRITE);
    SILENT(b.sockets[0]);
    b.wires[0].is_lost = 0;
    assert_int_equal(mbm_gateway_pending(&b.gateway, 0), 0);
}

TEST(a_broadcast_to_all_lines_of_a_gateway_without_lines_ends)
{
    static const mbm_gatewayRoute all[] = {{0, 0, MBM_GATEWAY_ALL_LINES, 0}};

    gateway_bench_start(&b, all, COUNT(all));
    b.config.lineCount = 0;
    OK(mbm_gateway_begin(&b.gateway, &b.config));
    gateway_bench_open(&b, 0);
    ASK(0, 1, 0, WRITE);
    (void)gateway_bench_step(&b);
    assert_int_equal(mbm_gateway_pending(&b.gateway, 0), 0);
    assert_int_equal(mbm_gateway_pollDelay(&b.gateway), UINT32_MAX);
    SILENT(b.sockets[0]);
}

TEST(a_function_that_cannot_be_broadcast_gets_01)
{
    static const mbm_gatewayRoute all[] = {{0, 0, MBM_GATEWAY_ALL_LINES, 0}};

    gateway_bench_start(&b, all, COUNT(all));
    ASK(0, 1, 0, READ);
    EXPECT(0, 1, 0, "\x83\x01");
    SILENT(b.wires[0]);
    SILENT(b.wires[1]);
}

TEST(a_broadcast_that_its_line_does_not_send_gets_0a)
{
    static const mbm_gatewayRoute one[] = {{0, 31, 0, 0}};

    gateway_bench_start(&b, one, COUNT(one));
    b.wires[0].is_lost = 1;
    ASK(0, 1, 0, WRITE);
    EXPECT(0, 1, 0, "\x86\x0A");
    assert_int_equal(mbm_gateway_pending(&b.gateway, 0), 0);
}

/* --- unit 0 of a line with TCP frames --- */

/* Begins a gateway whose line 1 has TCP frames. */
static void start_with_tcp(const mbm_gatewayRoute *map, unsigned count)
{
    static uint8_t outgoing[MBM_MAX_TCP_FRAME];
    mbm_port port;

    gateway_bench_start(&b, map, count);
    port = memory_port_of(&b.wires[1]);
    OK(mbm_client_beginTcp(&b.clients[1], &port, b.frames[1], MBM_MAX_TCP_FRAME, outgoing,
                           sizeof outgoing));
    OK(mbm_client_setResponseTimeout(&b.clients[1], 100));
}

/* A request for a unit arrives at the device of that line, which replies, if `reply` is not NULL.
 */
static void at_device(uint8_t unit, const char *pdu, size_t length, const char *reply,
                      size_t reply_length)
{
    uint8_t header[7] = {0, 0, 0, 0, 0, 0, unit};

    while (b.wires[1].sent_count < sizeof header + length)
        assert_true(gateway_bench_step(&b));
    memcpy(header, b.wires[1].sent, 2);
    header[5] = (uint8_t)(length + 1);
    assert_int_equal(b.wires[1].sent_count, sizeof header + length);
    assert_memory_equal(b.wires[1].sent, header, sizeof header);
    assert_memory_equal(b.wires[1].sent + sizeof header, pdu, length);
    b.wires[1].sent_count = 0;
    if (!reply)
        return;
    header[5] = (uint8_t)(reply_length + 1);
    memory_port_bytes(&b.wires[1], header, sizeof header);
    memory_port_bytes(&b.wires[1], (const uint8_t *)reply, reply_length);
}

#define AT_DEVICE(unit, pdu, reply) at_device(unit, pdu, sizeof(pdu) - 1, reply, sizeof(reply) - 1)

TEST(unit_0_of_a_line_with_tcp_frames_answers)
{
    static const mbm_gatewayRoute both[] = {{0, 0, 1, 0}, {5, 6, 1, MBM_GATEWAY_UNIT_0}};
    static const uint8_t units[] = {0, 5};

    start_with_tcp(both, COUNT(both));
    for (unsigned i = 0; i < COUNT(units); i++) {
        ASK(0, 0x100, units[i], READ);
        AT_DEVICE(0, READ, VALUE);
        EXPECT(0, 0x100, units[i], VALUE);
        ASK(0, 0x101, units[i], WRITE);
        AT_DEVICE(0, WRITE, WRITE);
        EXPECT(0, 0x101, units[i], WRITE);
        ASK(0, 0x102, units[i], READ);
        AT_DEVICE(0, READ, "\x83\x02");
        EXPECT(0, 0x102, units[i], "\x83\x02");
        ASK(0, 0x103, units[i], WRITE);
        at_device(0, WRITE, sizeof WRITE - 1, NULL, 0);
        EXPECT(0, 0x103, units[i], "\x86\x0B");
        ASK(0, 0x104, units[i], "\x41");
        AT_DEVICE(0, "\x41", "\x41");
        EXPECT(0, 0x104, units[i], "\x41");
        ASK(0, 0x105, units[i], "\x08\x00\x04\x00\x00");
        at_device(0, "\x08\x00\x04\x00\x00", 5, NULL, 0);
        SILENT(b.sockets[0]);
    }
    ASK(0, 0x106, 6, READ);
    AT_DEVICE(1, READ, VALUE);
    EXPECT(0, 0x106, 6, VALUE);
    b.wires[1].is_lost = 1;
    ASK(0, 0x107, 5, WRITE);
    EXPECT(0, 0x107, 5, "\x86\x0A");
    assert_int_equal(mbm_gateway_pending(&b.gateway, 0), 0);
}

TEST(a_unit_that_leads_to_0_of_a_serial_line_is_a_broadcast)
{
    static const mbm_gatewayRoute five[] = {{5, 5, 0, MBM_GATEWAY_UNIT_0}};

    start_with_tcp(five, COUNT(five));
    ASK(0, 1, 5, WRITE);
    ON_LINE(0, 0, WRITE);
    SILENT(b.sockets[0]);
    ASK(0, 2, 5, READ);
    EXPECT(0, 2, 5, "\x83\x01");
}

TEST(a_broadcast_to_all_lines_goes_to_unit_0_of_one_with_tcp_frames_and_its_response_is_dropped)
{
    static const mbm_gatewayRoute all[] = {{0, 0, MBM_GATEWAY_ALL_LINES, 0}, {1, 31, 1, 0}};

    start_with_tcp(all, COUNT(all));
    ASK(0, 1, 0, WRITE);
    ON_LINE(0, 0, WRITE);
    AT_DEVICE(0, WRITE, WRITE);
    SILENT(b.sockets[0]);
    ASK(0, 2, 0, WRITE);
    ON_LINE(0, 0, WRITE);
    AT_DEVICE(0, WRITE, "\x86\x02");
    SILENT(b.sockets[0]);
    ASK(0, 3, 0, WRITE);
    ON_LINE(0, 0, WRITE);
    at_device(0, WRITE, sizeof WRITE - 1, NULL, 0);
    SILENT(b.sockets[0]);
    assert_int_equal(mbm_gateway_pending(&b.gateway, 0), 0);
    ASK(0, 4, 1, READ);
    AT_DEVICE(1, READ, VALUE);
    EXPECT(0, 4, 1, VALUE);
}
