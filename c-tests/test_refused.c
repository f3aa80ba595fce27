/* A call that is refused changes nothing: the object is compared byte for byte with its
 * state before the call, and pending requests go on. Buffers have exactly the size that
 * begin is given. */
#include "hooked_port.h"
#include "every_call.h"
#include "refused.h"
#include "test.h"

static hooked_port wire;
static mbm_port port;

static void reset(void)
{
    memset(&wire, 0, sizeof wire);
    wire.step = 100;
    port = hooked_port_of(&wire);
}

fixture each_test = {reset, NULL};

/* --- server --- */

static mbm_server server;
static mbm_unit unit;
static mbm_registerTable table;
static uint16_t words[MBM_MAX_READ_REGISTERS];
static unsigned not_yet;

static uint16_t later(void *context, const mbm_request *request, uint8_t *response,
                      uint16_t capacity)
{
    if (not_yet > 0) {
        not_yet--;
        return MBM_REPLY_PENDING;
    }
    assert_true(capacity >= 250);
    memset(response, 0x5A, 250);
    return 250;
}

static void all_begins_are_refused(uint8_t *frame)
{
    mbm_port without_read = port;
    mbm_unit other;

    without_read.read = NULL;
    memset(&other, 0, sizeof other);
    INVALID(server, mbm_server_beginRtu(&server, &without_read, &other, 1, frame, 20));
    INVALID(server, mbm_server_beginRtu(&server, NULL, &other, 1, frame, 20));
    INVALID(server, mbm_server_beginRtu(&server, &port, NULL, 1, frame, 20));
    INVALID(server, mbm_server_beginRtu(&server, &port, &other, 1, NULL, 20));
    INVALID(server, mbm_server_beginRtu(&server, &port, &other, 1, frame, 15));
    INVALID(server, mbm_server_beginAscii(&server, &port, &other, 1, frame, 20));
    INVALID(server, mbm_server_beginTcp(&server, &port, &other, 1, frame, 20));
    INVALID(server, mbm_server_beginRtuOverTcp(&server, &port, &other, 1, frame, 15));
    other.id = 300; /* not 44 */
    INVALID(server, mbm_server_beginRtu(&server, &port, &other, 1, frame, 20));
    other.id = 256; /* not a unit for every id */
    INVALID(server, mbm_server_beginRtuOverTcp(&server, &port, &other, 1, frame, 20));
}

static void poll_for_a_while(void)
{
    for (unsigned i = 0; i < 200; i++)
        OK(mbm_server_poll(&server));
}

TEST(a_server_goes_on_after_a_refused_begin)
{
    uint8_t *frame = (uint8_t *)malloc(MBM_MAX_FRAME), *small = (uint8_t *)malloc(20);
    mbm_custom custom = {.serve = later, .code = 65};

    memset(&server, 0, sizeof server);
    memset(&table, 0, sizeof table);
    unit = (mbm_unit){.id = 17};
    table.words = words;
    table.size = MBM_MAX_READ_REGISTERS;
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(mbm_unit_serveCustom(&unit, &custom));
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, MBM_MAX_FRAME));
    all_begins_are_refused(small);
    /* The next request. */
    hooked_port_arrive_rtu(&wire, 17, "\x03\0\0\0\x7D", 5);
    poll_for_a_while();
    assert_int_equal(wire.length, 5 + 250);
    /* A part of a request has arrived. */
    wire.length = 0;
    hooked_port_arrive_rtu(&wire, 17, "\x03\0\0\0\x7D", 5);
    wire.last -= 4;
    OK(mbm_server_poll(&server));
    all_begins_are_refused(small);
    wire.last += 4;
    poll_for_a_while();
    assert_int_equal(wire.length, 5 + 250);
    /* A request that is being carried out. */
    wire.length = 0;
    not_yet = 150;
    hooked_port_arrive_rtu(&wire, 17, "\x41\1", 2);
    while (not_yet > 20)
        OK(mbm_server_poll(&server));
    all_begins_are_refused(small);
    poll_for_a_while();
    assert_int_equal(wire.length, 4 + 250);
    free(frame);
    free(small);
}

TEST(a_zeroed_server_stays_zero_when_a_begin_is_refused)
{
    uint8_t *small = (uint8_t *)malloc(20);
    static const mbm_server zero;

    memset(&server, 0, sizeof server);
    all_begins_are_refused(small);
    assert_memory_equal(&server, &zero, sizeof server);
    free(small);
}

/* Neither the records that are refused nor the units that refuse them change. */
/* --- master --- */

TEST(a_master_goes_on_after_refused_calls)
{
    static mbm_line line;
    static mbm_node m;
    uint8_t *frame = (uint8_t *)malloc(MBM_MAX_FRAME), *small = (uint8_t *)malloc(8);
    uint16_t *response = (uint16_t *)malloc(250), *transmit = (uint16_t *)malloc(4), one[1];
    uint8_t answer[252] = {3, 250};
    mbm_port mute = port;

    memset(&line, 0, sizeof line);
    memset(&m, 0, sizeof m);
    INVALID(line, mbm_line_beginRtu(&line, NULL, small, 8));
    mute.write = NULL;
    INVALID(line, mbm_line_beginRtu(&line, &mute, small, 8));
    INVALID(line, mbm_line_beginRtu(&line, &port, small, 7));
    INVALID(m, mbm_node_begin(&m, NULL, 17, one, 1, one, 1));
    OK(mbm_line_beginRtu(&line, &port, frame, MBM_MAX_FRAME));
    OK(mbm_node_begin(&m, &line, 17, response, 125, transmit, 2));
    OK(mbm_node_setBlocking(&m, 0));
    transmit[0] = transmit[1] = 0x1234;
    IS(MBM_PENDING, mbm_node_readHoldingRegisters(&m, 0, 125));

    INVALID(line, mbm_line_beginRtu(&line, &mute, small, 8));
    REFUSED(MBM_BUSY, line, mbm_line_beginRtu(&line, &port, small, 8));
    REFUSED(MBM_BUSY, line, mbm_line_setFrame(&line, small, 8));
    REFUSED(MBM_BUSY, m, mbm_node_begin(&m, &line, 17, one, 1, one, 1));
    INVALID(m, mbm_node_begin(&m, &line, 17, one, 256, one, 1));
    UNCHANGED(m, every_node_request_returns(MBM_BUSY, &m));
    assert_int_equal(transmit[0], 0x1234);
    assert_int_equal(transmit[1], 0x1234);

    for (unsigned i = 0; i < 300 && wire.length == 0; i++)
        IS(MBM_PENDING, mbm_node_poll(&m));
    hooked_port_arrive_rtu(&wire, 17, answer, sizeof answer);
    for (unsigned i = 0; i < 300 && mbm_node_poll(&m) == MBM_PENDING; i++) {
    }
    OK(mbm_node_status(&m));
    /* The queue of words is full. */
    OK(mbm_node_send(&m, 1));
    OK(mbm_node_send(&m, 2));
    REFUSED(MBM_BUFFER_TOO_SMALL, m, mbm_node_send(&m, 3));
    REFUSED(MBM_BUFFER_TOO_SMALL, m, mbm_node_send(&m, 3));
    REFUSED(MBM_BUFFER_TOO_SMALL, m, mbm_node_sendBit(&m, 1));
    free(frame);
    free(small);
    free(response);
    free(transmit);
}

/* --- sniffer --- */

TEST(a_sniffer_goes_on_after_refused_calls)
{
    static mbm_sniffer sniffer;
    uint8_t *buffer = (uint8_t *)malloc(MBM_MAX_FRAME), *small = (uint8_t *)malloc(31);
    mbm_event event;

    memset(&sniffer, 0, sizeof sniffer);
    REFUSED(MBM_BUFFER_TOO_SMALL, sniffer, mbm_sniffer_begin(&sniffer, MBM_FRAMING_RTU, small, 31));
    OK(mbm_sniffer_begin(&sniffer, MBM_FRAMING_RTU, buffer, MBM_MAX_FRAME));
    hooked_port_arrive_rtu(&wire, 17, "\3\0\0\0\1", 5);
    assert_int_equal(mbm_sniffer_feed(&sniffer, MBM_DIRECTION_BOTH, wire.arriving, 4, 0), 4);
    REFUSED(MBM_BUFFER_TOO_SMALL, sniffer, mbm_sniffer_begin(&sniffer, MBM_FRAMING_RTU, small, 31));
    INVALID(sniffer, mbm_sniffer_begin(&sniffer, MBM_FRAMING_RTU, NULL, 256));
    INVALID(sniffer, mbm_sniffer_setFunctions(&sniffer, NULL, 1));
    INVALID(sniffer, mbm_sniffer_setDelimiter(&sniffer, '\r'));
    INVALID(sniffer, mbm_sniffer_setResponseTimeout(&sniffer, 0));
    INVALID(sniffer, mbm_sniffer_setFrameTimeout(&sniffer, 0));
    REFUSED(0, sniffer, mbm_sniffer_feed(&sniffer, 3, wire.arriving, 4, 0));
    REFUSED(0, sniffer, mbm_sniffer_feed(&sniffer, MBM_DIRECTION_BOTH, NULL, 4, 0));
    REFUSED(0, sniffer, mbm_sniffer_next(&sniffer, 0, NULL));
    assert_int_equal(mbm_sniffer_feed(&sniffer, MBM_DIRECTION_BOTH, wire.arriving + 4, 4, 0), 4);
    assert_int_equal(mbm_sniffer_next(&sniffer, 100000, &event), 1);
    assert_int_equal(event.kind, MBM_EVENT_REQUEST);
    free(buffer);
    free(small);
}

/* --- Sequences of calls for which fuzz/fuzz_targets/c_api.rs found a fault --- */

static uint32_t clock_now;
static uint32_t reads;
static uint8_t flood;

static uint32_t port_micros(void *context)
{
    return clock_now;
}

static int16_t port_write(void *context, const uint8_t *bytes, uint16_t length)
{
    return (int16_t)length;
}

/* A peer that never stops sending the same byte. */
static int16_t flooded_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    assert_true(++reads < 10000);
    memset(bytes, flood, capacity);
    return (int16_t)capacity;
}

static const mbm_port flooded = {NULL, flooded_read, port_write, port_micros,
                                 NULL, NULL,         NULL,       NULL};

TEST_WITH(a_poll_of_an_ascii_server_ends_while_a_peer_floods, NULL, NULL)
{
    static mbm_server ascii_server;
    static mbm_unit served;
    static uint8_t frame[MBM_MAX_ASCII_FRAME];
    static const uint8_t floods[] = {'x', ':', '0', '\r', '\n'};

    OK(mbm_server_beginAscii(&ascii_server, &flooded, &served, 1, frame, sizeof frame));
    for (size_t i = 0; i < sizeof floods; i++) {
        flood = floods[i];
        reads = 0;
        OK(mbm_server_poll(&ascii_server));
    }
}

/* Sends a request of `length` bytes in a buffer of `capacity` bytes, into which the
 * response must fit. */
static void answers_with_exception_04(uint8_t framing, mbm_unit *served, const char *request,
                                      uint16_t length, uint16_t capacity)
{
    uint8_t *frame = malloc(capacity);
    uint16_t response = 0xFFFF;
    const uint16_t pdu = framing == MBM_FRAMING_TCP ? 7 : 1;

    assert_non_null(frame);
    memcpy(frame, request, length);
    OK(mbm_unit_respond(served, 1, NULL, FRAMING(framing), frame, length, capacity, &response));
    assert_true(response <= capacity);
    assert_int_equal(response, framing == MBM_FRAMING_TCP ? 9 : 5);
    assert_int_equal(frame[pdu], (uint8_t)request[pdu] | 0x80);
    IS(MBM_SERVER_DEVICE_FAILURE, frame[pdu + 1]);
    free(frame);
}

TEST_WITH(a_response_longer_than_its_buffer_is_exception_04, NULL, NULL)
{
    static mbm_unit served;
    static mbm_serverIdentification identification;
    static mbm_diagnostics diagnostics;

    OK(mbm_unit_serveIdentification(&served, &identification));
    OK(mbm_unit_serveDiagnostics(&served, &diagnostics));
    answers_with_exception_04(MBM_FRAMING_TCP, &served, "\0\1\0\0\0\5\x11\x2B\x0E\1\0", 11, 12);
    answers_with_exception_04(MBM_FRAMING_TCP, &served, "\0\1\0\0\0\2\x11\x0B", 8, 11);
    answers_with_exception_04(MBM_FRAMING_RTU, &served, "\x11\x0B\x4C\x27", 4, 6);
}

/* A call of a client that is refused changes nothing, and pending requests go on. Buffers
 * have exactly the size that begin is given. */

static mbm_client client;
static mbm_line line;
static mbm_node node;
static uint16_t node_words[2];
static uint8_t line_frame[16];
static uint8_t *incoming, *outgoing;

/* Begins in framing 0 to 3, with buffers of exactly this size. */
static uint8_t begin_client(int framing, uint16_t in, uint16_t out)
{
    free(incoming);
    free(outgoing);
    incoming = (uint8_t *)malloc(in);
    outgoing = (uint8_t *)malloc(out);
    return client_begin(&client, (unsigned)framing, &port, incoming, in, outgoing, out);
}

static void all_client_begins_are(uint8_t status, const mbm_port *p, uint8_t *frame, uint16_t bytes)
{
    REFUSED(status, client, mbm_client_beginRtu(&client, p, frame, bytes));
    REFUSED(status, client, mbm_client_beginAscii(&client, p, frame, bytes));
    REFUSED(status, client, mbm_client_beginRtuOverTcp(&client, p, frame, bytes));
    REFUSED(status, client, mbm_client_beginTcp(&client, p, frame, bytes, frame, 12));
}

TEST(a_zeroed_client_stays_zero_when_a_begin_is_refused)
{
    static uint8_t small[16];
    mbm_port mute = port;

    memset(&client, 0, sizeof client);
    mute.micros = NULL;
    all_client_begins_are(MBM_INVALID_ARGUMENT, &mute, small, 16);
    all_client_begins_are(MBM_INVALID_ARGUMENT, NULL, small, 16);
    all_client_begins_are(MBM_INVALID_ARGUMENT, &port, NULL, 16);
    all_client_begins_are(MBM_INVALID_ARGUMENT, &port, small, 7);
    INVALID(client, mbm_client_beginTcp(&client, &port, small, 8, small, 12));
    INVALID(client, mbm_client_beginTcp(&client, &port, small, 16, small, 11));
    INVALID(client, mbm_client_beginTcp(&client, &port, small, 16, NULL, 12));
    assert_int_equal(mbm_client_pending(&client), 0);
    REFUSED(MBM_NOT_INITIALISED, client, mbm_client_setRetries(&client, 1));
}

static void all_settings_out_of_range_are_refused(int framing)
{
    INVALID(client, mbm_client_setBackoff(&client, 4, 1, 1));
    INVALID(client, mbm_client_setJitter(&client, 101, NULL, NULL));
    INVALID(client, mbm_client_setJitter(&client, 1, NULL, NULL));
    INVALID(client, mbm_client_setInFlight(&client, 0));
    INVALID(client, mbm_client_setInFlight(&client, 17));
    INVALID(client, mbm_client_setDelimiter(&client, ':'));
    INVALID(client, mbm_client_setDelimiter(&client, 0));
    INVALID(client, mbm_client_resume(&client, NULL));
    if (framing != 1)
        INVALID(client, mbm_client_setDelimiter(&client, '!'));
}

TEST(a_client_goes_on_after_refused_calls)
{
    static uint8_t small[20];
    static const mbm_line zero;
    static uint16_t reply[125];
    mbm_clientRequest request, other;

    for (int framing = 0; framing < 4; framing++) {
        memset(&client, 0, sizeof client);
        memset(&request, 0, sizeof request);
        memset(&other, 0, sizeof other);
        memset(&line, 0, sizeof line);
        memset(&node, 0, sizeof node);
        OK(begin_client(framing, 600, 600));
        all_settings_out_of_range_are_refused(framing);
        request.unit = 17;
        request.reply = reply;
        request.replyBytes = sizeof reply;
        request.transaction = 7;
        IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &request, 0, 125));
        wire.length = 0;
        for (uint32_t delay = 0; delay < 1000 && wire.length == 0; delay++)
            IS(MBM_PENDING, mbm_client_poll(&client));
        assert_true(wire.length > 0);

        all_client_begins_are(MBM_INVALID_ARGUMENT, &port, small, 7);
        all_client_begins_are(MBM_INVALID_ARGUMENT, NULL, small, sizeof small);
        all_settings_out_of_range_are_refused(framing);
        if (framing == 1)
            REFUSED(MBM_BUSY, client, mbm_client_setDelimiter(&client, '!'));
        REFUSED(MBM_NOT_PENDING, client, mbm_client_cancel(&client, &other));
        INVALID(client, mbm_client_cancel(&client, NULL));
        REFUSED(MBM_BUSY, client, mbm_client_readCoils(&client, &request, 0, 1));
        REFUSED(MBM_BUSY, request, mbm_client_readCoils(&client, &request, 0, 1));
        INVALID(client, mbm_client_readCoils(&client, NULL, 0, 1));
        REFUSED(MBM_BUSY, client, mbm_client_suspend(&client, NULL));
        REFUSED(framing == 0 || framing == 3 ? MBM_BUSY : MBM_INVALID_ARGUMENT, client,
                mbm_client_suspend(&client, &line));
        assert_memory_equal(&line, &zero, sizeof line);
        /* A refused request has the status of the refusal and is not queued. */
        other.unit = 17;
        other.transaction = 7;
        other.reply = reply;
        other.replyBytes = 1;
        REFUSED(MBM_ILLEGAL_DATA_VALUE, client, mbm_client_readCoils(&client, &other, 0, 0));
        REFUSED(MBM_BUFFER_TOO_SMALL, client, mbm_client_readCoils(&client, &other, 0, 9));
        INVALID(client, mbm_client_writeMultipleRegisters(&client, &other, 0, 1));
        IS(MBM_INVALID_ARGUMENT, other.status);
        if (framing == 2)
            REFUSED(MBM_DUPLICATE_TRANSACTION, client, mbm_client_readCoils(&client, &other, 0, 1));
        other.unit = 0;
        /* In TCP frames unit 0 is a unit. */
        if (framing != 2) {
            REFUSED(MBM_BROADCAST_NOT_ALLOWED, client, mbm_client_readCoils(&client, &other, 0, 1));
            IS(MBM_BROADCAST_NOT_ALLOWED, other.status);
        }
        assert_int_equal(mbm_client_pending(&client), 1);

        if (framing == 0 || framing == 3) {
            uint8_t answer[252] = {3, 250};

            hooked_port_arrive_rtu(&wire, 17, answer, sizeof answer);
            for (uint32_t delay = 0; delay < 1000 && mbm_client_poll(&client) == MBM_PENDING;
                 delay++) {
            }
            OK(request.status);
        } else {
            OK(mbm_client_cancel(&client, &request));
        }
    }
    free(incoming);
    free(outgoing);
    incoming = outgoing = NULL;
}

TEST(a_full_queue_and_a_suspended_client_change_nothing)
{
    static mbm_clientRequest requests[MBM_CLIENT_DEPTH + 1];
    static const mbm_line zero;
    unsigned i;

    memset(&client, 0, sizeof client);
    memset(&line, 0, sizeof line);
    memset(&node, 0, sizeof node);
    memset(requests, 0, sizeof requests);
    OK(begin_client(0, 256, 1));
    for (i = 0; i < MBM_CLIENT_DEPTH; i++) {
        requests[i].unit = 17;
        IS(MBM_PENDING, mbm_client_readCoils(&client, &requests[i], 0, 1));
    }
    requests[i].unit = 17;
    REFUSED(MBM_QUEUE_FULL, client, mbm_client_readCoils(&client, &requests[i], 0, 1));
    OK(mbm_client_suspend(&client, NULL));
    REFUSED(MBM_BUSY, client, mbm_client_suspend(&client, &line));
    assert_memory_equal(&line, &zero, sizeof line);
    REFUSED(MBM_BUSY, client, mbm_client_poll(&client));
    REFUSED(MBM_BUSY, client, mbm_client_reconnect(&client, NULL));
    OK(mbm_client_resume(&client, NULL));
    INVALID(client, mbm_client_resume(&client, NULL));
    /* While a master has a pending request, it can be neither given the line nor lose it. */
    OK(mbm_line_setFrame(&line, line_frame, 16));
    OK(mbm_node_begin(&node, &line, 1, node_words, 2, node_words, 0));
    OK(mbm_client_suspend(&client, &line));
    OK(mbm_node_setBlocking(&node, 0));
    IS(MBM_PENDING, mbm_node_readCoils(&node, 0, 1));
    REFUSED(MBM_BUSY, client, mbm_client_resume(&client, &line));
    REFUSED(MBM_BUSY, line, mbm_client_resume(&client, &line));
    OK(mbm_node_cancel(&node));
    OK(mbm_client_resume(&client, &line));
    free(incoming);
    free(outgoing);
    incoming = outgoing = NULL;
}

/* A request is in the queue only once, even if the program zeroes it while it is pending. */
TEST(a_request_that_is_zeroed_while_it_is_pending_is_not_queued_twice)
{
    mbm_clientRequest *request = (mbm_clientRequest *)malloc(sizeof *request);

    for (int framing = 0; framing < 4; framing++) {
        memset(&client, 0, sizeof client);
        OK(begin_client(framing, 600, 600));
        OK(mbm_client_setResponseTimeout(&client, 10));
        memset(request, 0, sizeof *request);
        request->unit = 17;
        IS(MBM_PENDING, mbm_client_readCoils(&client, request, 0, 1));
        memset(request, 0, sizeof *request);
        request->unit = 17;
        IS(MBM_BUSY, mbm_client_readCoils(&client, request, 0, 1)); /* it waits */
        wire.length = 0;
        for (unsigned i = 0; i < 1000 && mbm_client_pending(&client) > 0; i++) {
            mbm_client_poll(&client);
            if (mbm_client_pending(&client) > 0)
                IS(MBM_BUSY, mbm_client_readCoils(&client, request, 0, 1)); /* in flight */
        }
        assert_int_equal(mbm_client_pending(&client), 0);
        /* The same with a request that has ended before. */
        IS(MBM_PENDING, mbm_client_readCoils(&client, request, 0, 1));
        request->status = MBM_OK;
        IS(MBM_BUSY, mbm_client_readCoils(&client, request, 0, 1));
        memset(request, 0, sizeof *request);
        IS(MBM_BUSY, mbm_client_readCoils(&client, request, 0, 1));
        OK(mbm_client_cancel(&client, request));
    }
    free(request);
    for (unsigned i = 0; i < 100; i++)
        OK(mbm_client_poll(&client));
    free(incoming);
    free(outgoing);
    incoming = outgoing = NULL;
}
