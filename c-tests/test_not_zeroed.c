/* Objects in memory that was not zeroed: with MBM_INIT every object works; without it a begin
 * function works too, or returns a status. The exception is memory with the mark of an object that
 * was begun, one byte. */
#include "every_call.h"
#include "hooked_port.h"
#include "plan_device.h"
#include "test.h"

/* A byte of this value marks an object that was begun. */
enum { MARK = 0xE6, RANDOM_FILLS = 300 };

static hooked_port wire;
static mbm_port port;
static uint8_t frame[MBM_MAX_ASCII_FRAME], outgoing[MBM_MAX_TCP_FRAME];
static uint16_t words[4];

static void reset(void)
{
    memset(&wire, 0, sizeof wire);
    memset(words, 0, sizeof words);
    wire.step = 100;
    port = hooked_port_of(&wire);
}

/* Each of these begins an object and uses it. It returns the status of the begin function, which
 * was refused if that is not MBM_OK. */

static uint8_t use_line_and_node(mbm_line *line, mbm_node *node)
{
    uint8_t begun = mbm_line_beginRtu(line, &port, frame, sizeof frame);

    if (begun == MBM_OK)
        begun = mbm_node_begin(node, line, 17, words, 4, NULL, 0);
    if (begun != MBM_OK)
        return begun;
    OK(mbm_node_setBlocking(node, 0));
    IS(MBM_PENDING, mbm_node_readHoldingRegisters(node, 0, 1));
    while (wire.called[HOOK_POST] == 0)
        IS(MBM_PENDING, mbm_node_poll(node));
    hooked_port_arrive_rtu(&wire, 17, "\x03\x02\x12\x34", 4);
    while (mbm_node_poll(node) == MBM_PENDING)
        ;
    OK(mbm_node_status(node));
    assert_int_equal(words[0], 0x1234);
    return MBM_OK;
}

static uint8_t use_line(void *object, unsigned framing)
{
    mbm_node node = MBM_INIT;

    return use_line_and_node(object, &node);
}

static uint8_t use_node(void *object, unsigned framing)
{
    mbm_line line = MBM_INIT;

    return use_line_and_node(&line, object);
}

static uint8_t use_client(void *object, unsigned framing)
{
    mbm_clientRequest request = MBM_INIT;
    const uint8_t begun = CLIENT_BEGIN(object, framing, &port, frame, outgoing);

    if (begun != MBM_OK)
        return begun;
    request.unit = 17;
    request.reply = words;
    request.replyBytes = sizeof words;
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(object, &request, 0, 1));
    for (unsigned i = 0; i < 1000 && wire.length == 0; i++)
        IS(MBM_PENDING, mbm_client_poll(object));
    assert_true(wire.length > 0);
    if (framing == MBM_FRAMING_RTU || framing == MBM_FRAMING_RTU_OVER_TCP) {
        hooked_port_arrive_rtu(&wire, 17, "\x03\x02\x12\x34", 4);
        for (unsigned i = 0; i < 1000 && request.status == MBM_PENDING; i++)
            mbm_client_poll(object);
        OK(request.status);
        assert_int_equal(words[0], 0x1234);
    } else {
        OK(mbm_client_cancel(object, &request));
    }
    return MBM_OK;
}

static uint8_t use_server(void *object, unsigned framing)
{
    /* By framing: a request, and the length of its response. */
    static const struct {
        const char *request;
        size_t length, response;
    } rows[] = {{"\x11\x03\x00\x00\x00\x01\x86\x9A", 8, 7},
                {":110300000001EB\r\n", 17, 15},
                {"\0\1\0\0\0\6\x11\x03\0\0\0\1", 12, 11},
                {"\x11\x03\x00\x00\x00\x01\x86\x9A", 8, 7}};
    mbm_unit unit = MBM_INIT;
    mbm_registerTable table = MBM_INIT;
    uint8_t begun;

    unit.id = 17;
    table.words = words;
    table.size = 4;
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    begun = server_begin(object, framing, &port, &unit, 1, frame, sizeof frame);
    if (begun != MBM_OK)
        return begun;
    hooked_port_arrive(&wire, rows[framing].request, rows[framing].length);
    for (unsigned i = 0; i < 100; i++)
        OK(mbm_server_poll(object));
    assert_int_equal(wire.length, rows[framing].response);
    return MBM_OK;
}

static uint8_t connected(void *context)
{
    ++*(unsigned *)context;
    return MBM_OK;
}

static uint8_t use_link(void *object, unsigned framing)
{
    static mbm_client client;
    unsigned connects = 0;
    mbm_linkHooks hooks = MBM_INIT;

    hooks.context = &connects;
    hooks.connect = connected;
    OK(mbm_client_beginTcp(&client, &port, frame, sizeof frame, outgoing, sizeof outgoing));
    uint8_t begun = mbm_link_begin(object, &client, &hooks);
    if (begun != MBM_OK)
        return begun;
    OK(mbm_client_poll(&client));
    assert_int_equal(connects, 1);
    OK(mbm_link_end(object));
    return MBM_OK;
}

static uint8_t use_plan(void *object, unsigned framing)
{
    static plan_device device;
    uint32_t ageMs;
    uint16_t field;

    memset(&device, 0, sizeof device);
    plan_device_begin(&device, 0);
    plan_device_add(&device, 17, MBM_TABLE_HOLDING_REGISTERS, MBM_TYPE_UINT16, 0, 1000);
    device.setup.update = NULL;
    uint8_t begun = mbm_plan_begin(object, &device.client, &device.setup, &field);
    if (begun != MBM_OK)
        return begun;
    IS(MBM_PENDING, mbm_plan_getStatus(object, 0, &ageMs));
    for (unsigned i = 0; i < 10; i++)
        OK(mbm_plan_poll(object));
    assert_int_equal(mbm_client_pending(&device.client), 1);
    OK(mbm_plan_end(object));
    return MBM_OK;
}

static uint8_t use_gateway(void *object, unsigned framing)
{
    static mbm_client client;
    mbm_gatewayRoute route = {0, 255, 0, 0};
    mbm_gatewayLine line = MBM_INIT;
    mbm_gatewayConnection connection = MBM_INIT;
    mbm_gatewayRequest request = MBM_INIT;
    mbm_gatewayConfig config = MBM_INIT;

    OK(mbm_client_beginRtu(&client, &port, frame, sizeof frame));
    line.client = &client;
    config.routes = &route;
    config.lines = &line;
    config.connections = &connection;
    config.requests = &request;
    config.requestCount = 1;
    config.routeCount = config.lineCount = config.connectionCount = 1;
    uint8_t begun = mbm_gateway_begin(object, &config);
    if (begun != MBM_OK)
        return begun;
    OK(mbm_gateway_poll(object));
    return MBM_OK;
}

static uint8_t use_sniffer(void *object, unsigned framing)
{
    const uint8_t begun = mbm_sniffer_begin(object, MBM_FRAMING_RTU, frame, sizeof frame);
    mbm_event event;

    if (begun != MBM_OK)
        return begun;
    hooked_port_arrive_rtu(&wire, 17, "\x03\x00\x00\x00\x01", 5);
    assert_int_equal(mbm_sniffer_feed(object, MBM_DIRECTION_BOTH, wire.arriving, 8, 0), 8);
    assert_int_equal(mbm_sniffer_next(object, 10000, &event), 1);
    assert_int_equal(event.kind, MBM_EVENT_REQUEST);
    return MBM_OK;
}

static void count_record(void *context, const mbm_traceRecord *record)
{
    ++*(unsigned *)context;
}

static uint8_t use_trace(void *object, unsigned framing)
{
    const mbm_framing rtu = MBM_INIT;
    mbm_line line = MBM_INIT;
    unsigned records = 0;
    const uint8_t begun = mbm_trace_begin(object, MBM_PACKET_REQUEST, &port, &rtu, outgoing,
                                          sizeof outgoing, count_record, &records);

    if (begun != MBM_OK)
        return begun;
    port = *mbm_trace_port(object);
    OK(use_line(&line, 0));
    assert_int_equal(records, 2);
    return MBM_OK;
}

static uint8_t use_ring(void *object, unsigned framing)
{
    const uint8_t begun = mbm_ring_begin(object, frame, 16);
    uint8_t taken = 0;

    if (begun != MBM_OK)
        return begun;
    assert_int_equal(mbm_ring_available(object), 0);
    assert_int_equal(mbm_ring_put(object, 7), 1);
    assert_int_equal(mbm_ring_read(object, &taken, 1), 1);
    assert_int_equal(taken, 7);
    assert_int_equal(mbm_ring_lost(object), 0);
    return MBM_OK;
}

static uint16_t seven_of_sixteen(void *context)
{
    return 16 - 7;
}

static uint8_t use_dma_ring(void *object, unsigned framing)
{
    const uint8_t begun = mbm_dmaRing_begin(object, frame, 16, seven_of_sixteen, NULL);
    uint8_t taken[16];

    if (begun != MBM_OK)
        return begun;
    mbm_dmaRing_note(object);
    assert_int_equal(mbm_dmaRing_available(object), 7);
    assert_int_equal(mbm_dmaRing_read(object, taken, 16), 7);
    assert_int_equal(mbm_dmaRing_lost(object), 0);
    return MBM_OK;
}

static union {
    mbm_line line;
    mbm_node node;
    mbm_client client;
    mbm_server server;
    mbm_link link;
    mbm_plan plan;
    mbm_gateway gateway;
    mbm_sniffer sniffer;
    mbm_trace trace;
    mbm_ring ring;
    mbm_dmaRing dmaRing;
} memory;

/* The functions that use an object, with a framing. */
#define OBJECTS(USE)                                                                               \
    USE(line, use_line, 0)                                                                         \
    USE(node, use_node, 0)                                                                         \
    USE(client, use_client, MBM_FRAMING_RTU)                                                       \
    USE(client, use_client, MBM_FRAMING_ASCII)                                                     \
    USE(client, use_client, MBM_FRAMING_TCP)                                                       \
    USE(client, use_client, MBM_FRAMING_RTU_OVER_TCP)                                              \
    USE(server, use_server, MBM_FRAMING_RTU)                                                       \
    USE(server, use_server, MBM_FRAMING_ASCII)                                                     \
    USE(server, use_server, MBM_FRAMING_TCP)                                                       \
    USE(server, use_server, MBM_FRAMING_RTU_OVER_TCP)                                              \
    USE(link, use_link, 0)                                                                         \
    USE(plan, use_plan, 0)                                                                         \
    USE(gateway, use_gateway, 0)                                                                   \
    USE(sniffer, use_sniffer, 0)                                                                   \
    USE(trace, use_trace, 0)                                                                       \
    USE(ring, use_ring, 0)                                                                         \
    USE(dmaRing, use_dma_ring, 0)

#define ROW(object, use, framing) {use, framing},
static const struct {
    uint8_t (*use)(void *object, unsigned framing);
    unsigned framing;
} uses[] = {OBJECTS(ROW)};

static void use_all(void)
{
    unsigned char before[sizeof memory];

    memcpy(before, &memory, sizeof before);
    for (size_t i = 0; i < COUNT(uses); i++) {
        uint8_t begun;

        reset();
        memcpy(&memory, before, sizeof before);
        begun = uses[i].use(&memory, uses[i].framing);
        if (begun != MBM_OK)
            IS(MBM_BUSY, begun);
    }
}

TEST(a_begin_function_works_in_memory_filled_with_any_byte)
{
    for (int byte = 0; byte < 256; byte++) {
        memset(&memory, byte, sizeof memory);
        if (byte != MARK)
            use_all();
    }
}

TEST(a_begin_function_works_in_memory_with_random_bytes)
{
    unsigned char bytes[sizeof memory];
    uint32_t random = 1;

    for (size_t fill = 0; fill < RANDOM_FILLS; fill++) {
        for (size_t i = 0; i < sizeof bytes; i++) {
            random = random * 1664525 + 1013904223;
            bytes[i] = (unsigned char)(random >> 24);
            if (bytes[i] == MARK)
                bytes[i] = 0;
        }
        memcpy(&memory, bytes, sizeof bytes);
        use_all();
    }
}

/* The declaration that the header recommends, on a stack that holds other bytes. */
#define WORKS(type, use, framing)                                                                  \
    {                                                                                              \
        mbm_##type object = MBM_INIT;                                                              \
        reset();                                                                                   \
        OK(use(&object, framing));                                                                 \
    }

TEST(every_object_works_with_the_initialiser)
{
    OBJECTS(WORKS)
}
