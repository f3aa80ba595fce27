/* Replies that consist of a function code alone: the counter of an energy meter is reset with
 * function 42, and the meter answers with unit, function and CRC. And the length rules of a
 * program, which hold for every function code. All in memory, with one clock. */
#include "every_call.h"
#include "memory_port.h"
#include "test.h"

enum { UNIT = 7, LAST = 127, REPLY = 252, STEP = 500 };

static const uint8_t framings[] = {MBM_FRAMING_RTU, MBM_FRAMING_ASCII, MBM_FRAMING_TCP,
                                   MBM_FRAMING_RTU_OVER_TCP};

static memory_port near_end, far_end;
static mbm_client client;
static mbm_clientRequest request;
static mbm_server server;
static mbm_unit unit;
static mbm_custom custom;
static mbm_sniffer sniffer;
static mbm_trace trace;
static uint8_t frame[MBM_MAX_ASCII_FRAME], outgoing[MBM_MAX_TCP_FRAME], reply[REPLY],
    served[MBM_MAX_ASCII_FRAME], seen[2 * MBM_MAX_ASCII_FRAME], traced[2 * MBM_MAX_ASCII_FRAME];
static struct {
    const char *bytes;
    uint16_t count;
    unsigned calls;
} answer;

static struct {
    unsigned requests, replies, others;
} records;

static void keep(void *context, const mbm_traceRecord *record)
{
    const int is_right = record->status == MBM_OK;

    if (is_right && record->direction == MBM_TRACE_SENT && record->kind == MBM_PACKET_REQUEST)
        records.requests++;
    else if (is_right && record->direction == MBM_TRACE_RECEIVED &&
             record->kind == MBM_PACKET_RESPONSE)
        records.replies++;
    else
        records.others++;
}

static uint16_t serve(void *context, const mbm_request *asked, uint8_t *response, uint16_t capacity)
{
    assert_true(answer.count <= capacity);
    memcpy(response, answer.bytes, answer.count);
    answer.calls++;
    return answer.count;
}

/* A client and a server of one framing, a trace at the client and a sniffer on the line. The server
 * answers every function with `count` bytes of data. */
static void begin(uint8_t framing, const char *bytes, uint16_t count)
{
    const mbm_port bare_port = memory_port_of(&near_end), far_port = memory_port_of(&far_end);

    memset(&near_end, 0, sizeof near_end);
    memset(&far_end, 0, sizeof far_end);
    memset(&client, 0, sizeof client);
    memset(&request, 0, sizeof request);
    memset(&server, 0, sizeof server);
    memset(&unit, 0, sizeof unit);
    memset(&custom, 0, sizeof custom);
    memset(&trace, 0, sizeof trace);
    memset(&records, 0, sizeof records);
    memset(reply, 0xEE, sizeof reply);
    OK(mbm_trace_begin(&trace, MBM_PACKET_REQUEST, &bare_port, FRAMING(framing), traced,
                       sizeof traced, keep, NULL));
    const mbm_port *near_port = mbm_trace_port(&trace);
    answer.bytes = bytes;
    answer.count = count;
    answer.calls = 0;
    unit.id = UNIT;
    OK(CLIENT_BEGIN(&client, framing, near_port, frame, outgoing));
    OK(server_begin(&server, framing, &far_port, &unit, 1, served, sizeof served));
    custom.serve = serve;
    OK(mbm_unit_serveCustom(&unit, &custom));
    OK(mbm_sniffer_begin(&sniffer, framing, seen, sizeof seen));
    request.unit = UNIT;
    request.reply = reply;
    request.replyBytes = sizeof reply;
}

static void carry(memory_port *from, memory_port *to, uint8_t direction)
{
    if (from->sent_count == 0)
        return;
    memory_port_bytes(to, from->sent, from->sent_count);
    assert_int_equal(
        mbm_sniffer_feed(&sniffer, direction, from->sent, (uint16_t)from->sent_count, near_end.now),
        from->sent_count);
    from->sent_count = 0;
}

/* Lets client and server work until the request has ended. Returns its status. */
static uint8_t run(void)
{
    while (request.status == MBM_PENDING) {
        (void)mbm_client_poll(&client);
        carry(&near_end, &far_end, MBM_DIRECTION_BOTH);
        OK(mbm_server_poll(&server));
        carry(&far_end, &near_end, MBM_DIRECTION_BOTH);
        near_end.now += STEP;
        far_end.now += STEP;
    }
    return request.status;
}

/* Sniffer, trace and packets agree: a request and its reply, both without data. */
static void assert_seen(uint8_t framing, uint8_t function)
{
    static const uint8_t kinds[] = {MBM_EVENT_REQUEST, MBM_EVENT_REPLY};
    const mbm_function declared = {function, {MBM_RULE_SILENCE, 0, 0}, {MBM_RULE_SILENCE, 0, 0}};
    const mbm_framing own = {&declared, 1, framing, 0};
    uint8_t pdu[MBM_MAX_PDU], bytes[MBM_MAX_ASCII_FRAME];
    mbm_packet packet, again;
    mbm_event event;
    uint16_t length;

    mbm_trace_flush(&trace);
    assert_int_equal(records.requests, 1);
    assert_int_equal(records.replies, 1);
    assert_int_equal(records.others, 0);
    OK(mbm_client_reply(&request, pdu, sizeof pdu, &packet));
    assert_int_equal(packet.kind, MBM_PACKET_RESPONSE);
    assert_int_equal(packet.function, function);
    assert_int_equal(packet.dataLength, 0);
    OK(mbm_frame_build(&own, &packet, bytes, sizeof bytes, &length));
    OK(mbm_frame_parse(&own, MBM_PACKET_RESPONSE, bytes, length, &again));
    assert_int_equal(again.function, function);
    assert_int_equal(again.dataLength, 0);

    for (unsigned i = 0; i < COUNT(kinds); i++) {
        assert_int_equal(mbm_sniffer_next(&sniffer, near_end.now + 1000000, &event), 1);
        assert_int_equal(event.kind, kinds[i]);
        assert_int_equal(event.unit, UNIT);
        assert_int_equal(event.function, function);
        assert_int_equal(event.pduLength, 1);
        assert_int_equal(event.length, framing == MBM_FRAMING_TCP     ? 8
                                       : framing == MBM_FRAMING_ASCII ? 9
                                                                      : 4);
    }
    assert_int_equal(mbm_sniffer_next(&sniffer, near_end.now + 1000000, &event), 0);
}

static int is_standard(uint8_t function)
{
    static const uint8_t codes[] = {1,    2,    3,    4,    5,    6,    7,    8,    0x0B, 0x0C,
                                    0x0F, 0x10, 0x11, 0x14, 0x15, 0x16, 0x17, 0x18, 0x2B};

    return memchr(codes, function, sizeof codes) != NULL;
}

FRAMING_TEST(every_function_may_be_answered_without_data)
{
    static const mbm_rule silence = MBM_INIT;

    for (unsigned function = 1; function <= LAST; function++) {
        begin(framing, "", 0);
        IS(MBM_PENDING, mbm_client_custom(&client, &request, (uint8_t)function, 0, &silence));
        IS(MBM_OK, run());
        assert_int_equal(answer.calls, 1);
        assert_int_equal(request.length, 0);
        assert_int_equal(reply[0], 0xEE);
        /* The silence that ends the frame was enough. */
        assert_true(near_end.now < 600000);
        if (!is_standard((uint8_t)function))
            assert_seen(framing, (uint8_t)function);
    }
}

FRAMING_TEST(every_function_that_the_standard_leaves_open_is_forwarded_without_data)
{
    for (unsigned function = 1; function <= LAST; function++) {
        uint8_t queued;

        begin(framing, "", 0);
        queued = mbm_client_forward(&client, &request, (uint8_t)function, NULL, 0);
        if (!is_standard((uint8_t)function)) {
            IS(MBM_PENDING, queued);
            IS(MBM_OK, run());
            assert_int_equal(request.length, 0);
            assert_seen(framing, (uint8_t)function);
        } else if (queued == MBM_PENDING) {
            /* 07, 0B, 0C and 11 (hex) have no data to send, and an answer with data. */
            assert_true(run() >= 0xE0);
        } else {
            IS(MBM_ILLEGAL_DATA_VALUE, queued);
        }
        assert_int_equal(reply[0], 0xEE);
    }
}

FRAMING_TEST(a_function_with_data_may_be_answered_without)
{
    static const mbm_rule silence = MBM_INIT;

    begin(framing, "", 0);
    request.data = "abcde";
    IS(MBM_PENDING, mbm_client_custom(&client, &request, 0x42, 5, &silence));
    IS(MBM_OK, run());
    assert_int_equal(request.length, 0);
    begin(framing, "", 0);
    IS(MBM_PENDING, mbm_client_forward(&client, &request, 0x42, (const uint8_t *)"abcde", 5));
    IS(MBM_OK, run());
    assert_int_equal(request.length, 0);
}

/* MEI type and sub-function are no data: the response repeats them. */
FRAMING_TEST(a_reply_that_lacks_what_it_must_repeat_is_not_accepted)
{
    static const char *const bodies[] = {"\x0D\x01", "\x00\x15\x00\x00"};
    static const uint8_t functions[] = {0x2B, 0x08}, counts[] = {2, 4};

    for (unsigned k = 0; k < COUNT(functions); k++) {
        begin(framing, "", 0);
        IS(MBM_PENDING, mbm_client_forward(&client, &request, functions[k],
                                           (const uint8_t *)bodies[k], counts[k]));
        assert_true(run() >= 0xE0);
        assert_int_equal(request.length, 0);
    }
}

/* An answer whose bytes no function of the standard would have. */
TEST(the_rule_of_the_program_holds_for_every_function)
{
    static const struct {
        mbm_rule rule;
        const char *bytes;
        uint16_t count;
    } cases[] = {
        {MBM_INIT, "\xFF", 1},
        {MBM_INIT, "\xFF\x09\x09\x09", 4},
        {{MBM_RULE_FIXED, 2, 0}, "\xFF", 1},
        {{MBM_RULE_FIXED, 6, 0}, "\xFF\x02\x03\x04\x05", 5},
        {{MBM_RULE_COUNTED, 2, 1}, "\xFF\x02\x03\x04\x05", 5},
    };

    for (unsigned i = 0; i < COUNT(framings); i++)
        for (unsigned k = 0; k < COUNT(cases); k++)
            for (unsigned function = 1; function <= LAST; function++) {
                begin(framings[i], cases[k].bytes, cases[k].count);
                IS(MBM_PENDING,
                   mbm_client_custom(&client, &request, (uint8_t)function, 0, &cases[k].rule));
                IS(MBM_OK, run());
                assert_int_equal(request.length, cases[k].count);
                assert_memory_equal(reply, cases[k].bytes, cases[k].count);
            }
}

/* Only Return Query Data (08, sub-function 00) carries data that tell its replies apart. */
TEST(a_late_reply_to_a_function_08_of_the_program_is_not_taken)
{
    static const mbm_rule fixed = {MBM_RULE_FIXED, 5, 0};
    static const uint8_t late[] = {UNIT, 8, 0, 0x0B, 0, 1}, right[] = {UNIT, 8, 0, 0x0B, 0, 2};

    begin(MBM_FRAMING_RTU, "", 0);
    request.data = "\x00\x0B\x00\x00";
    IS(MBM_PENDING, mbm_client_custom(&client, &request, 8, 4, &fixed));
    IS(MBM_RESPONSE_TIMED_OUT, memory_port_run(&near_end, &client, &request, 1000));
    near_end.sent_count = 0;
    IS(MBM_PENDING, mbm_client_custom(&client, &request, 8, 4, &fixed));
    memory_port_send(&near_end, &client);
    memory_port_rtu(&near_end, late, sizeof late);
    memory_port_run(&near_end, &client, &request, 1);
    near_end.now += 10000;
    memory_port_rtu(&near_end, right, sizeof right);
    IS(MBM_OK, memory_port_run(&near_end, &client, &request, 1000));
    assert_int_equal(request.length, 4);
    assert_memory_equal(reply, right + 2, 4);
}
