/* The trace before a port: its records, what it passes on, refused calls, and calls from within
 * its hook. How it cuts bytes into frames is tested in tests/trace. */
#include "every_call.h"
#include "refused.h"
#include "hooked_port.h"
#include "test.h"

enum { MOST = 32 };

typedef struct kept {
    const char *link;
    uint8_t bytes[MBM_MAX_ASCII_FRAME];
    mbm_traceRecord record;
} kept;

static hooked_port wire;
static mbm_port port;
static mbm_trace trace;
static mbm_line line;
static mbm_node master;
static mbm_client client;
static mbm_server server;
static mbm_clientRequest request;
static mbm_unit unit;
static mbm_registerTable table;
static kept records[MOST];
static size_t count;
static void (*within_hook)(void);
static uint8_t buffer[2 * MBM_MAX_ASCII_FRAME], frame[MBM_MAX_ASCII_FRAME],
    other[MBM_MAX_TCP_FRAME];
static uint16_t words[8];

static void reset(void)
{
    memset(&wire, 0, sizeof wire);
    memset(&trace, 0, sizeof trace);
    memset(&master, 0, sizeof master);
    memset(&client, 0, sizeof client);
    memset(&server, 0, sizeof server);
    memset(&request, 0, sizeof request);
    memset(&unit, 0, sizeof unit);
    memset(&table, 0, sizeof table);
    wire.step = 500;
    port = hooked_port_of(&wire);
    count = 0;
    within_hook = NULL;
}

fixture each_test = {reset, NULL};

static void keep(void *context, const mbm_traceRecord *record)
{
    kept *const place = &records[count++];

    assert_true(count <= MOST && record->length <= sizeof place->bytes);
    place->link = (const char *)context;
    place->record = *record;
    memcpy(place->bytes, record->bytes, record->length);
    if (within_hook)
        within_hook();
}

static void is_record(size_t index, uint8_t direction, uint8_t kind, uint8_t status,
                      const void *bytes, size_t length)
{
    const kept *const found = &records[index];

    assert_true(index < count);
    assert_int_equal(found->record.direction, direction);
    assert_int_equal(found->record.kind, kind);
    assert_int_equal(found->record.status, status);
    assert_int_equal(found->record.length, length);
    assert_memory_equal(found->bytes, bytes, length);
}

static void begin_master(void)
{
    OK(mbm_trace_begin(&trace, MBM_PACKET_REQUEST, &port, FRAMING(MBM_FRAMING_RTU), buffer,
                       sizeof buffer, keep, "line"));
    OK(mbm_line_beginRtu(&line, mbm_trace_port(&trace), frame, sizeof frame));
    OK(mbm_node_begin(&master, &line, 17, words, 8, words, 8));
}

static const uint8_t READ[] = {17, 3, 0, 1, 0, 2}, REPLY[] = {17, 3, 4, 0, 1, 0, 2};

TEST(a_blocking_master_works_through_a_trace)
{
    begin_master();
    hooked_port_arrive_rtu(&wire, 17, REPLY + 1, sizeof REPLY - 1);
    wire.last = 0; /* it arrives after the request */
    mbm_node_setBlocking(&master, 0);
    IS(MBM_PENDING, mbm_node_readHoldingRegisters(&master, 1, 2));
    while (mbm_node_poll(&master) == MBM_PENDING)
        if (wire.length > 0)
            wire.last = sizeof REPLY + 2;
    assert_int_equal(mbm_node_available(&master), 2);
    assert_int_equal(count, 2);
    is_record(0, MBM_TRACE_SENT, MBM_PACKET_REQUEST, MBM_OK, wire.sent, 8);
    is_record(1, MBM_TRACE_RECEIVED, MBM_PACKET_RESPONSE, MBM_OK, wire.arriving, 9);
    assert_memory_equal(records[0].bytes, READ, sizeof READ);
    assert_string_equal(records[0].link, "line");
    assert_true(records[0].record.timeUs < records[1].record.timeUs);
    assert_true(records[1].record.timeUs <= wire.now);

    /* Blocking: the hook `idle` gets the master, and the others are called. */
    mbm_node_setBlocking(&master, 1);
    IS(MBM_RESPONSE_TIMED_OUT, mbm_node_readHoldingRegisters(&master, 1, 2));
    assert_true(wire.called[HOOK_IDLE] > 0 && wire.called[HOOK_FLUSH] > 0);
    assert_int_equal(wire.called[HOOK_PRE], 2);
    assert_int_equal(wire.called[HOOK_POST], 2);
    assert_int_equal(count, 3);
}

TEST(optional_hooks_are_passed_on_only_where_the_port_has_them)
{
    const mbm_port *traced;

    for (int i = 0; i < 2; i++) {
        if (i == 1) {
            port.flush = NULL;
            port.preTransmission = port.postTransmission = NULL;
            port.idle = NULL;
        }
        OK(mbm_trace_begin(&trace, MBM_PACKET_RESPONSE, &port, FRAMING(MBM_FRAMING_RTU), buffer, 32,
                           keep, NULL));
        traced = mbm_trace_port(&trace);
        assert_int_equal(traced->flush == NULL, i);
        assert_int_equal(traced->preTransmission == NULL, i);
        assert_int_equal(traced->idle == NULL, i);
        traced->postTransmission(traced->context);
        assert_int_equal(wire.called[HOOK_POST], 1);
    }
}

TEST(a_client_of_each_framing_works_through_a_trace)
{
    for (unsigned kind = MBM_FRAMING_RTU; kind <= MBM_FRAMING_RTU_OVER_TCP; kind++) {
        const mbm_framing *const framing = FRAMING((uint8_t)kind);
        mbm_packet packet = {.kind = MBM_PACKET_RESPONSE, .unit = 17, .function = 3};
        uint8_t reply[MBM_MAX_ASCII_FRAME];
        const mbm_port *traced;
        uint16_t length;

        reset();
        OK(mbm_trace_begin(&trace, MBM_PACKET_REQUEST, &port, framing, buffer, sizeof buffer, keep,
                           NULL));
        traced = mbm_trace_port(&trace);
        OK(CLIENT_BEGIN(&client, kind, traced, frame, other));
        request.unit = 17;
        request.reply = words;
        request.replyBytes = sizeof words;
        IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &request, 1, 2));
        while (wire.length == 0)
            IS(MBM_PENDING, mbm_client_poll(&client));
        packet.transaction = request.transaction;
        packet.data = REPLY + 3;
        packet.dataLength = 4;
        packet.quantity = 2;
        OK(mbm_frame_build(framing, &packet, reply, sizeof reply, &length));
        hooked_port_arrive(&wire, reply, length);
        while (mbm_client_poll(&client) == MBM_PENDING) {
        }
        OK(request.status);
        assert_int_equal(count, 2);
        is_record(0, MBM_TRACE_SENT, MBM_PACKET_REQUEST, MBM_OK, wire.sent, wire.length);
        is_record(1, MBM_TRACE_RECEIVED, MBM_PACKET_RESPONSE, MBM_OK, reply, length);
    }
}

TEST(a_server_works_through_a_trace)
{
    unit.id = 17;
    words[1] = 0x1234;
    table.words = words;
    table.size = 8;
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(mbm_trace_begin(&trace, MBM_PACKET_RESPONSE, &port, FRAMING(MBM_FRAMING_RTU), buffer,
                       sizeof buffer, keep, NULL));
    OK(mbm_server_beginRtu(&server, mbm_trace_port(&trace), &unit, 1, frame, 256));
    hooked_port_arrive_rtu(&wire, 17, READ + 1, sizeof READ - 1);
    while (wire.length == 0)
        OK(mbm_server_poll(&server));
    assert_int_equal(count, 2);
    is_record(0, MBM_TRACE_RECEIVED, MBM_PACKET_REQUEST, MBM_OK, wire.arriving, 8);
    is_record(1, MBM_TRACE_SENT, MBM_PACKET_RESPONSE, MBM_OK, wire.sent, 9);
}

TEST(two_masters_share_a_traced_port)
{
    static mbm_line second_line;
    static mbm_node second;
    static uint8_t more[16];

    begin_master();
    memset(&second_line, 0, sizeof second_line);
    memset(&second, 0, sizeof second);
    OK(mbm_line_beginRtu(&second_line, mbm_trace_port(&trace), more, sizeof more));
    OK(mbm_node_begin(&second, &second_line, 18, words, 1, words, 1));
    OK(mbm_node_setResponseTimeout(&master, 10));
    OK(mbm_node_setResponseTimeout(&second, 10));
    IS(MBM_RESPONSE_TIMED_OUT, mbm_node_writeSingleCoil(&master, 1, 1));
    IS(MBM_RESPONSE_TIMED_OUT, mbm_node_writeSingleCoil(&second, 1, 1));
    assert_int_equal(count, 2);
    assert_int_equal(records[0].bytes[0], 17);
    assert_int_equal(records[1].bytes[0], 18);
}

TEST(two_links_are_told_apart_by_their_contexts)
{
    static mbm_trace second;
    static uint8_t more[64];

    memset(&second, 0, sizeof second);
    begin_master();
    /* A trace before a trace: both hand the frame out. */
    OK(mbm_trace_begin(&second, MBM_PACKET_REQUEST, mbm_trace_port(&trace),
                       FRAMING(MBM_FRAMING_RTU), more, sizeof more, keep, "outer"));
    OK(mbm_line_beginRtu(&line, mbm_trace_port(&second), frame, sizeof frame));
    OK(mbm_node_setResponseTimeout(&master, 10));
    IS(MBM_RESPONSE_TIMED_OUT, mbm_node_writeSingleCoil(&master, 1, 1));
    assert_int_equal(count, 2);
    assert_string_equal(records[0].link, "line");
    assert_string_equal(records[1].link, "outer");
    assert_memory_equal(records[0].bytes, records[1].bytes, 8);
}

TEST(the_rest_is_handed_out_by_flush)
{
    uint8_t bytes[8];

    begin_master();
    const mbm_port *traced = mbm_trace_port(&trace);
    hooked_port_arrive(&wire, REPLY, 5);
    assert_int_equal(traced->read(traced->context, bytes, sizeof bytes), 5);
    assert_int_equal(count, 0);
    OK(mbm_trace_flush(&trace));
    assert_int_equal(count, 1);
    is_record(0, MBM_TRACE_RECEIVED, MBM_PACKET_RESPONSE, MBM_INCOMPLETE_FRAME, REPLY, 5);
    OK(mbm_trace_flush(&trace));
    assert_int_equal(count, 1);
}

TEST(the_frame_timeout_can_be_set)
{
    uint8_t bytes[8];

    begin_master();
    const mbm_port *traced = mbm_trace_port(&trace);
    OK(mbm_trace_setFrameTimeout(&trace, 200));
    hooked_port_arrive(&wire, REPLY, 5);
    assert_int_equal(traced->read(traced->context, bytes, sizeof bytes), 5);
    wire.now += 199000 - wire.step;
    assert_int_equal(traced->read(traced->context, bytes, sizeof bytes), 0);
    assert_int_equal(count, 0);
    wire.now += 1000;
    assert_int_equal(traced->read(traced->context, bytes, sizeof bytes), 0);
    assert_int_equal(count, 1);
}

TEST(a_trace_begun_again_drops_what_it_has_not_handed_out)
{
    uint8_t bytes[8];

    begin_master();
    const mbm_port *traced = mbm_trace_port(&trace);
    OK(mbm_trace_setFrameTimeout(&trace, 60000));
    hooked_port_arrive(&wire, REPLY, 5);
    assert_int_equal(traced->read(traced->context, bytes, sizeof bytes), 5);
    begin_master();
    assert_ptr_equal(mbm_trace_port(&trace), traced);
    OK(mbm_trace_flush(&trace));
    assert_int_equal(count, 0);
    /* The frame timeout is the default. */
    hooked_port_arrive(&wire, REPLY, 5);
    assert_int_equal(traced->read(traced->context, bytes, sizeof bytes), 5);
    wire.now += 200000;
    assert_int_equal(traced->read(traced->context, bytes, sizeof bytes), 0);
    assert_int_equal(count, 1);
}

TEST(a_trace_goes_on_after_refused_calls)
{
    const mbm_function wrong = {.code = 0};
    const mbm_framing rtu = {0}, no_frames = {.kind = MBM_FRAMING_NONE}, unknown = {.kind = 5},
                      no_functions = {.functionCount = 1},
                      wrong_function = {.functions = &wrong, .functionCount = 1},
                      wrong_end = {.kind = MBM_FRAMING_ASCII, .delimiter = ':'};
    const mbm_framing *const framings[] = {NULL,          &no_frames,      &unknown,
                                           &no_functions, &wrong_function, &wrong_end};
    mbm_port incomplete = port;
    uint8_t bytes[16];

    incomplete.micros = NULL;
    begin_master();
    hooked_port_arrive_rtu(&wire, 17, REPLY + 1, sizeof REPLY - 1);
    wire.last = 4;
    const mbm_port *traced = mbm_trace_port(&trace);
    assert_int_equal(traced->read(traced->context, bytes, sizeof bytes), 4);
    for (size_t i = 0; i < COUNT(framings); i++)
        INVALID(trace, mbm_trace_begin(&trace, MBM_PACKET_RESPONSE, &port, framings[i], buffer, 64,
                                       keep, NULL));
    INVALID(trace, mbm_trace_begin(&trace, MBM_PACKET_REQUEST, NULL, &rtu, buffer, 64, keep, NULL));
    INVALID(trace,
            mbm_trace_begin(&trace, MBM_PACKET_REQUEST, &incomplete, &rtu, buffer, 64, keep, NULL));
    INVALID(trace,
            mbm_trace_begin(&trace, MBM_PACKET_REQUEST, traced, &rtu, buffer, 64, keep, NULL));
    INVALID(trace, mbm_trace_begin(&trace, MBM_PACKET_REQUEST, &port, &rtu, NULL, 64, keep, NULL));
    INVALID(trace,
            mbm_trace_begin(&trace, MBM_PACKET_REQUEST, &port, &rtu, buffer, 64, NULL, NULL));
    REFUSED(MBM_BUFFER_TOO_SMALL, trace,
            mbm_trace_begin(&trace, MBM_PACKET_REQUEST, &port, &rtu, buffer,
                            MBM_MIN_TRACE_BUFFER - 1, keep, NULL));
    INVALID(trace, mbm_trace_setFrameTimeout(&trace, 0));
    wire.last = sizeof REPLY + 2;
    assert_int_equal(traced->read(traced->context, bytes, sizeof bytes), 5);
    assert_int_equal(count, 1);
    is_record(0, MBM_TRACE_RECEIVED, MBM_PACKET_RESPONSE, MBM_OK, wire.arriving, 9);
}

static unsigned tried;

static void try_everything(void)
{
    tried++;
    REFUSED(MBM_BUSY, trace, mbm_trace_flush(&trace));
    REFUSED(MBM_BUSY, trace, mbm_trace_setFrameTimeout(&trace, 1));
    REFUSED(MBM_BUSY, trace,
            mbm_trace_begin(&trace, MBM_PACKET_REQUEST, &port, FRAMING(MBM_FRAMING_RTU), buffer, 64,
                            keep, NULL));
    assert_null(mbm_trace_port(&trace));
    IS(MBM_BUSY, mbm_node_poll(&master));
    IS(MBM_BUSY, mbm_node_cancel(&master));
}

/* The trace is at work in these hooks of the port. */
static void try_from_the_port(int hook)
{
    if (hook == HOOK_READ || hook == HOOK_WRITE)
        try_everything();
}

TEST(calls_from_within_the_hook_are_refused)
{
    begin_master();
    OK(mbm_node_setResponseTimeout(&master, 10));
    within_hook = try_everything;
    tried = 0;
    IS(MBM_RESPONSE_TIMED_OUT, mbm_node_writeSingleCoil(&master, 1, 1));
    assert_int_equal(tried, 1);
    within_hook = NULL;
    wire.within = try_from_the_port;
    IS(MBM_RESPONSE_TIMED_OUT, mbm_node_writeSingleCoil(&master, 1, 1));
    assert_true(tried > 2);
    assert_int_equal(count, 2);
}

static const mbm_port *traced_port;

static void use_the_port(void)
{
    static const uint8_t byte = 1;
    const mbm_port *const p = traced_port;
    uint8_t bytes[8];

    /* As an object on the same port that is used from within the hook. */
    assert_int_equal(records[count - 1].record.length, 8);
    within_hook = NULL;
    tried++;
    hooked_port_arrive(&wire, REPLY, 5);
    assert_int_equal(p->read(p->context, bytes, sizeof bytes), 0);
    assert_int_equal(p->write(p->context, &byte, 1), 0);
    assert_true(p->micros(p->context) > 0);
    assert_int_equal(p->flush(p->context), 1);
}

TEST(the_port_of_a_trace_neither_reads_nor_writes_within_the_hook)
{
    const mbm_framing rtu = {0};
    const mbm_port *traced;
    uint8_t sent[8] = {17, 5, 0, 1, 0xFF, 0};

    OK(mbm_trace_begin(&trace, MBM_PACKET_REQUEST, &port, &rtu, buffer, 64, keep, NULL));
    traced_port = traced = mbm_trace_port(&trace);
    uint16_t crc = mbm_frame_crc16(sent, 6);
    sent[6] = (uint8_t)crc;
    sent[7] = (uint8_t)(crc >> 8);
    within_hook = use_the_port;
    tried = 0;
    assert_int_equal(traced->write(traced->context, sent, sizeof sent), 8);
    assert_int_equal(tried, 1);
    assert_int_equal(count, 1);
    assert_int_equal(wire.length, 8);
}

TEST(an_event_of_a_sniffer_becomes_a_record)
{
    static mbm_sniffer sniffer;
    static const uint8_t status_of[] = {MBM_OK, MBM_OK, MBM_INVALID_CRC, MBM_MALFORMED_FRAME};
    uint8_t bytes[64];
    size_t found = 0, timeouts = 0;
    mbm_traceRecord record;
    mbm_event event;
    uint32_t now = 1000;

    memset(&sniffer, 0, sizeof sniffer);
    OK(mbm_sniffer_begin(&sniffer, MBM_FRAMING_RTU, frame, sizeof frame));
    for (unsigned piece = 0; piece < 5; piece++) {
        hooked_port_arrive_rtu(&wire, 17, piece == 1 ? REPLY + 1 : READ + 1, piece == 1 ? 6 : 5);
        memcpy(bytes, wire.arriving, wire.last);
        bytes[7] ^= piece == 2;
        now += 100000;
        if (piece < 4)
            mbm_sniffer_feed(&sniffer, MBM_DIRECTION_BOTH,
                             piece == 3 ? (const uint8_t *)"xyz" : bytes,
                             piece == 3 ? 3 : (uint16_t)wire.last, now);
        while (mbm_sniffer_next(&sniffer, now + 60000 + (piece == 4 ? 2000000 : 0), &event)) {
            memset(&record, 0x55, sizeof record);
            if (event.kind == MBM_EVENT_TIMEOUT) {
                timeouts++;
                INVALID(record, mbm_trace_ofEvent(&event, &record));
                continue;
            }
            OK(mbm_trace_ofEvent(&event, &record));
            assert_ptr_equal(record.bytes, event.frame);
            assert_int_equal(record.length, event.frameLength);
            assert_int_equal(record.timeUs, event.timeUs);
            assert_int_equal(record.direction, MBM_TRACE_RECEIVED);
            assert_int_equal(record.kind, found == 1 ? MBM_PACKET_RESPONSE : MBM_PACKET_REQUEST);
            assert_true(found < COUNT(status_of));
            IS(status_of[found], record.status);
            found++;
        }
    }
    assert_int_equal(found, COUNT(status_of));
    IS(MBM_INVALID_ARGUMENT, mbm_trace_ofEvent(NULL, &record));
    IS(MBM_INVALID_ARGUMENT, mbm_trace_ofEvent(&event, NULL));
}

/* --- a server behind a trace --- */

/* A hook gets the trace as its connection, which is the first member here. */
static struct traced {
    mbm_trace trace;
    hooked_port *wire;
} traced;

static const hooked_port *accessed;

static void no_port_within(void *context, const mbm_traceRecord *record)
{
    assert_null(mbm_trace_port((mbm_trace *)context));
}

static uint8_t before_read(void *context, const mbm_access *access)
{
    accessed = ((const struct traced *)access->connection)->wire;
    return 0;
}

TEST(a_hook_finds_its_connection_behind_a_trace)
{
    static const mbm_accessHooks hooks = {.beforeRead = before_read};
    static const mbm_framing rtu = {.kind = MBM_FRAMING_RTU};

    unit.id = 17;
    table.words = words;
    table.size = 1;
    traced.wire = &wire;
    OK(mbm_registerTable_setHooks(&table, &hooks));
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(mbm_trace_begin(&traced.trace, MBM_PACKET_RESPONSE, &port, &rtu, buffer, sizeof buffer,
                       no_port_within, &traced.trace));
    OK(mbm_server_beginRtu(&server, mbm_trace_port(&traced.trace), &unit, 1, frame, sizeof frame));
    hooked_port_arrive_rtu(&wire, 17, "\3\0\0\0\1", 5);
    for (int polls = 0; polls < 100 && wire.length == 0; polls++)
        OK(mbm_server_poll(&server));
    assert_int_equal(wire.length, 7);
    assert_ptr_equal(accessed, &wire);
}
