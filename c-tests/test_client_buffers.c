/* Clients whose buffers and requests are used in ways that the client does not expect.
 *
 * The client accesses parts of its buffers without checks. The tests give it buffers of many
 * sizes from malloc, exactly as long as begin is given. The port's hooks write and read every byte
 * that they are given, so that AddressSanitizer reports one outside. */
#include "every_call.h"
#include "mbm.h"
#include "test.h"

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
