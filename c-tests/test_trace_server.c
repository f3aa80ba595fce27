/* A server behind a trace: its hooks find their connection in the struct that the trace begins. */
#include "test.h"

#include "mbm.h"

typedef struct connection {
    uint8_t request[8];
    uint16_t arrived, sent;
} connection;

/* A hook gets the trace as its connection, which is the first member here. */
typedef struct traced {
    mbm_trace trace;
    connection *wire;
} traced;

static connection wire;
static traced server_trace = {.wire = &wire};
static const connection *accessed;
static uint32_t now;

static int16_t read_wire(void *context, uint8_t *bytes, uint16_t capacity)
{
    connection *c = (connection *)context;
    const uint16_t count = c->arrived < capacity ? c->arrived : capacity;

    memcpy(bytes, c->request, count);
    c->arrived = (uint16_t)(c->arrived - count);
    return (int16_t)count;
}

static int16_t write_wire(void *context, const uint8_t *bytes, uint16_t length)
{
    ((connection *)context)->sent = (uint16_t)(((connection *)context)->sent + length);
    return (int16_t)length;
}

static uint32_t micros(void *context)
{
    return now += 1000;
}

static void on_record(void *context, const mbm_traceRecord *record)
{
    assert_null(mbm_trace_port((mbm_trace *)context));
}

static uint8_t before_read(void *context, const mbm_access *access)
{
    accessed = ((const traced *)access->connection)->wire;
    return 0;
}

TEST(a_hook_finds_its_connection_behind_a_trace)
{
    static const uint8_t request[8] = {17, 3, 0, 0, 0, 1, 0x86, 0x9A};
    static const mbm_accessHooks hooks = {.beforeRead = before_read};
    static const mbm_framing rtu = {.kind = MBM_FRAMING_RTU};
    static uint8_t buffer[64], frame[64];
    static uint16_t words[1];
    static mbm_registerTable table = {.words = words, .size = 1};
    static mbm_unit unit = {.id = 17};
    static mbm_server server;
    const mbm_port port = {
        .context = &wire, .read = read_wire, .write = write_wire, .micros = micros};

    OK(mbm_registerTable_setHooks(&table, &hooks));
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(mbm_trace_begin(&server_trace.trace, MBM_PACKET_RESPONSE, &port, &rtu, buffer, sizeof buffer,
                       on_record, &server_trace.trace));
    OK(mbm_server_beginRtu(&server, mbm_trace_port(&server_trace.trace), &unit, 1, frame,
                           sizeof frame));
    memcpy(wire.request, request, sizeof request);
    wire.arrived = sizeof request;
    for (int polls = 0; polls < 100 && wire.sent == 0; polls++)
        OK(mbm_server_poll(&server));
    assert_int_equal(wire.sent, 7);
    assert_ptr_equal(accessed, &wire);
}
