/* Clients whose buffers and requests are used in ways that the client does not expect, and buffers
 * of more bytes than an int16_t can count.
 *
 * The client accesses parts of its buffers without checks. The tests give it buffers of many
 * sizes from malloc, exactly as long as begin is given. The port's hooks write and read every byte
 * that they are given, so that AddressSanitizer reports one outside. */
#include "every_call.h"
#include "test.h"
#include "crc.h"
#include "hooked_port.h"

enum { ROUNDS = 120, STEPS = 400, REQUESTS = 20, REPLY = 256 };

typedef struct line {
    mbm_client client;
    mbm_clientRequest requests[REQUESTS];
    uint8_t *incoming, *outgoing;
    uint16_t incoming_bytes, outgoing_bytes;
    uint8_t sent[600]; /* bytes that were sent and get an answer */
    size_t sent_bytes;
    uint32_t now;
    int is_tcp;
} line;

static uint32_t random_state;
static unsigned long sum;
static uint16_t data[130];
static uint8_t reply[REPLY];

static uint32_t chance(uint32_t below)
{
    random_state = random_state * 1664525 + 1013904223;
    return (random_state >> 8) % below;
}

/* Delivers noise or the sent bytes, with one part changed: on TCP they look like responses
 * of any length. */
static int16_t read_any(void *context, uint8_t *bytes, uint16_t capacity)
{
    line *l = context;
    uint16_t count = (uint16_t)chance(capacity + 1u), i;

    for (i = 0; i < capacity; i++)
        bytes[i] = (uint8_t)chance(256);
    if (chance(300) == 0)
        return -1;
    if (l->sent_bytes > 0 && chance(4) > 0) {
        for (i = 0; i < count && i < l->sent_bytes; i++)
            bytes[i] = l->sent[i];
        count = i;
        if (l->is_tcp && count > 5) {
            bytes[4] = 0;
            bytes[5] = (uint8_t)(2 + chance(chance(2) ? 10 : 253));
        }
        l->sent_bytes = 0;
    }
    return (int16_t)count;
}

static int16_t write_some(void *context, const uint8_t *bytes, uint16_t length)
{
    line *l = context;
    uint16_t count = (uint16_t)chance(length + 1u), i;

    for (i = 0; i < length; i++)
        sum += bytes[i];
    if (chance(300) == 0)
        return -1;
    for (i = 0; i < count && l->sent_bytes < sizeof l->sent; i++)
        l->sent[l->sent_bytes++] = bytes[i];
    return (int16_t)count;
}

static uint32_t clock_of(void *context)
{
    return ((line *)context)->now;
}

static void begin(line *l, unsigned framing)
{
    mbm_port port;

    memset(l, 0, sizeof *l);
    port = (mbm_port){.context = l, .read = read_any, .write = write_some, .micros = clock_of};
    l->is_tcp = framing == MBM_FRAMING_TCP;
    l->incoming_bytes = (uint16_t)(17 + chance(chance(2) ? 8 : 600));
    l->outgoing_bytes = (uint16_t)(12 + chance(chance(2) ? 8 : 600));
    l->incoming = malloc(l->incoming_bytes);
    l->outgoing = malloc(l->outgoing_bytes);
    assert_non_null(l->incoming);
    assert_non_null(l->outgoing);
    OK(client_begin(&l->client, framing, &port, l->incoming, l->incoming_bytes, l->outgoing,
                    l->outgoing_bytes));
    OK(mbm_client_setResponseTimeout(&l->client, 50));
    OK(mbm_client_setRetries(&l->client, (uint8_t)chance(3)));
}

static void queue_request(line *l, mbm_clientRequest *request)
{
    if (request->status == MBM_PENDING)
        return;
    request->unit = (uint8_t)(1 + chance(2));
    request->data = data;
    request->reply = reply;
    request->replyBytes = (uint16_t)chance(REPLY);
    switch (chance(4)) {
    case 0:
        (void)mbm_client_readHoldingRegisters(&l->client, request, 1, (uint16_t)(1 + chance(125)));
        break;
    case 1:
        (void)mbm_client_writeMultipleRegisters(&l->client, request, 1,
                                                (uint16_t)(1 + chance(123)));
        break;
    case 2: (void)mbm_client_reportServerId(&l->client, request); break;
    default: (void)mbm_client_readCoils(&l->client, request, 1, (uint16_t)(1 + chance(2000)));
    }
}

TEST(no_byte_outside_of_the_buffers_is_touched)
{
    static line l;

    random_state = 7;
    for (unsigned round = 0; round < ROUNDS; round++) {
        begin(&l, round % 4);
        for (unsigned step = 0; step < STEPS; step++) {
            mbm_clientRequest *request = &l.requests[chance(REQUESTS)];

            l.now += chance(chance(8) ? 3000 : 60000);
            switch (chance(12)) {
            case 0: (void)mbm_client_cancel(&l.client, request); break;
            case 1:
                if (chance(20) == 0)
                    OK(mbm_client_reconnect(&l.client, NULL));
                break;
            case 2:
            case 3:
            case 4: queue_request(&l, request); break;
            default: (void)mbm_client_poll(&l.client);
            }
        }
        for (unsigned i = 0; i < REQUESTS; i++)
            if (l.requests[i].status == MBM_PENDING)
                OK(mbm_client_cancel(&l.client, &l.requests[i]));
        assert_int_equal(mbm_client_pending(&l.client), 0);
        free(l.incoming);
        free(l.outgoing);
    }
    assert_true(sum > 0);
}

static int driver;

static int16_t write_one(void *context, const uint8_t *bytes, uint16_t length)
{
    return length > 0;
}

static int16_t read_nothing(void *context, uint8_t *bytes, uint16_t capacity)
{
    return 0;
}

static void switch_on(void *context)
{
    driver++;
}

static void switch_off(void *context)
{
    driver--;
}

/* Zeroes a request while its client is sending it. */
static void zero_while_sent(line *l)
{
    mbm_port port;
    static uint8_t frame[256];

    memset(l, 0, sizeof *l);
    memset(&port, 0, sizeof port);
    port.context = l;
    port.read = read_nothing;
    port.write = write_one;
    port.micros = clock_of;
    port.preTransmission = switch_on;
    port.postTransmission = switch_off;
    driver = 0;
    OK(mbm_client_beginRtu(&l->client, &port, frame, sizeof frame));
    l->requests[0].unit = 1;
    IS(MBM_PENDING, mbm_client_writeSingleCoil(&l->client, &l->requests[0], 1, 1));
    while (driver == 0) {
        l->now += 1000;
        IS(MBM_PENDING, mbm_client_poll(&l->client));
    }
    memset(&l->requests[0], 0, sizeof l->requests[0]);
}

TEST(a_request_zeroed_while_it_is_sent_is_cancelled_with_the_driver_off)
{
    static line l;

    zero_while_sent(&l);
    OK(mbm_client_cancel(&l.client, &l.requests[0]));
    assert_int_equal(driver, 0);
    assert_int_equal(mbm_client_pending(&l.client), 0);
}

TEST(a_request_zeroed_while_it_is_sent_is_lost_with_its_link)
{
    static line l;

    zero_while_sent(&l);
    OK(mbm_client_reconnect(&l.client, NULL));
    assert_int_equal(driver, 0);
    OK(mbm_client_poll(&l.client));
    IS(MBM_LINK_LOST, l.requests[0].status);
}

/* --- buffers of more bytes than an int16_t can count. A port's read and write return an int16_t,
 * and hooked_port.c fails if it gets a larger capacity --- */

enum { LARGE = UINT16_MAX };

static uint8_t incoming[LARGE], outgoing[LARGE];
static hooked_port wire;
static mbm_port port;

static void reset(void)
{
    memset(&wire, 0, sizeof wire);
    wire.step = 1000;
    port = hooked_port_of(&wire);
}

fixture each_test = {reset, NULL};

TEST(a_client_over_tcp_works_with_large_buffers)
{
    static const uint8_t response[] = {0, 0, 0, 0, 0, 7, 1, 3, 4, 0, 1, 0, 2};
    static mbm_client client;
    uint16_t words[2] = {0};
    mbm_clientRequest request = {.unit = 1, .reply = words, .replyBytes = sizeof words};

    OK(mbm_client_beginTcp(&client, &port, incoming, LARGE, outgoing, LARGE));
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &request, 0, 2));
    IS(MBM_PENDING, mbm_client_poll(&client));
    hooked_port_arrive(&wire, response, sizeof response);
    OK(mbm_client_poll(&client));
    OK(request.status);
    assert_int_equal(words[1], 2);
}

TEST(a_client_on_a_serial_line_works_with_large_buffers)
{
    uint8_t response[] = {1, 3, 4, 0, 1, 0, 2, 0, 0};
    static mbm_client client;
    uint16_t words[2] = {0};
    mbm_clientRequest request = {.unit = 1, .reply = words, .replyBytes = sizeof words};

    OK(mbm_client_beginRtu(&client, &port, incoming, LARGE));
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &request, 0, 2));
    for (unsigned i = 0; i < 10; i++)
        IS(MBM_PENDING, mbm_client_poll(&client));
    (void)seal(response, 7);
    hooked_port_arrive(&wire, response, sizeof response);
    for (unsigned i = 0; i < 10; i++)
        (void)mbm_client_poll(&client);
    OK(request.status);
    assert_int_equal(words[1], 2);
}

static void assert_served(uint8_t (*begin_of)(mbm_server *, const mbm_port *, mbm_unit *, uint8_t,
                                              uint8_t *, uint16_t),
                          const uint8_t *request, size_t length, size_t answered)
{
    static mbm_server server;
    static uint16_t words[2];
    mbm_unit unit = {0};
    mbm_registerTable table = {0};

    memset(&server, 0, sizeof server);
    reset();
    unit.id = 1;
    table.words = words;
    table.size = 2;
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(begin_of(&server, &port, &unit, 1, incoming, LARGE));
    hooked_port_arrive(&wire, request, length);
    for (unsigned i = 0; i < 10; i++)
        OK(mbm_server_poll(&server));
    assert_int_equal(wire.length, answered);
}

TEST(a_server_works_with_large_buffers)
{
    static const uint8_t over_tcp[] = {0, 0, 0, 0, 0, 6, 1, 3, 0, 0, 0, 2};
    uint8_t over_rtu[] = {1, 3, 0, 0, 0, 2, 0, 0};

    (void)seal(over_rtu, 6);
    assert_served(mbm_server_beginTcp, over_tcp, sizeof over_tcp, 13);
    assert_served(mbm_server_beginRtu, over_rtu, sizeof over_rtu, 9);
    assert_served(mbm_server_beginRtuOverTcp, over_rtu, sizeof over_rtu, 9);
}
