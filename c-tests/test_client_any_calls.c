/* Calls the client's functions in any order with any arguments, also from callbacks. The
 * ports accept few bytes or none, deliver noise or answers, or lose the link, and the
 * clocks jump. Every request ends once, and all end when no more are queued. */
#include "mbm.h"
#include "test.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { REQUESTS = 24, CALLS = 400, SEEDS = 10000, WORDS = 128 };
enum { TAKES, TAKES_NOTHING, LOST };

static mbm_client client;
static struct {
    mbm_clientRequest request;
    uint16_t reply[WORDS];
    int pending;
} jobs[REQUESTS];
static mbm_clientUnit units[3];
static mbm_counters counters;
static uint16_t data[WORDS];
/* Bodies for forward: short requests, and one with many numbers and counts. */
static const uint8_t bodies[4][WORDS] = {
    {0, 1, 0, 2}, {0, 0, 0, 0, 2, 0x12, 0x34}, {14, 1, 0}, {7, 6, 0, 1, 0, 0, 0, 1}};
static uint8_t incoming[1100], outgoing[1100];
static unsigned long ended;

static struct {
    uint8_t arriving[4096];
    size_t count;
    uint32_t now;
    int mode, is_tcp;
    int calm; /* 1: accepts everything at once and delivers no bytes */
} wire;

static uint64_t random_state;

static unsigned chance(unsigned limit)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 7;
    random_state ^= random_state << 17;
    return (unsigned)(random_state >> 33) % limit;
}

static uint16_t any(unsigned limit)
{
    return (uint16_t)chance(limit);
}

static uint8_t byte(unsigned limit)
{
    return (uint8_t)chance(limit);
}

static void arrive(const uint8_t *bytes, size_t count)
{
    if (wire.count + count > sizeof wire.arriving)
        return;
    memcpy(wire.arriving + wire.count, bytes, count);
    wire.count += count;
}

static void arrive_noise(void)
{
    uint8_t noise[300];
    size_t count = chance(sizeof noise), i;

    for (i = 0; i < count; i++)
        noise[i] = byte(256);
    arrive(noise, count);
}

static int16_t wire_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    size_t count = wire.count < capacity ? wire.count : capacity;

    (void)context;
    if (wire.mode == LOST)
        return -1;
    if (!wire.calm && count > 0 && chance(3) == 0)
        count = 1 + chance((unsigned)count);
    memcpy(bytes, wire.arriving, count);
    memmove(wire.arriving, wire.arriving + count, wire.count - count);
    wire.count -= count;
    return (int16_t)count;
}

/* Delivers something that may answer the bytes that were sent. */
static void answer(const uint8_t *bytes, size_t count)
{
    uint8_t frame[16];

    if (!wire.is_tcp || count < 9) {
        if (chance(3) == 0)
            arrive(bytes, count); /* an echo, which is the right reply to 05, 06 and 08 */
        return;
    }
    memcpy(frame, bytes, 8);
    switch (chance(5)) {
    case 0:
        frame[5] = 3;
        frame[7] |= 0x80;
        frame[8] = byte(256);
        arrive(frame, 9);
        break;
    case 1:
        frame[5] = 5;
        frame[8] = 2;
        frame[9] = frame[10] = 1;
        arrive(frame, 11);
        break;
    case 2: arrive(bytes, count < 12 ? count : 12); break;
    case 3: arrive(bytes, 1 + chance((unsigned)count)); break;
    default: arrive_noise(); break;
    }
}

static int16_t wire_write(void *context, const uint8_t *bytes, uint16_t length)
{
    size_t count = length;

    (void)context;
    if (wire.mode != TAKES)
        return wire.mode == LOST ? -1 : 0;
    if (!wire.calm && chance(2))
        count = 1 + chance(length);
    if (!wire.calm && chance(2))
        answer(bytes, count);
    return (int16_t)count;
}

static uint32_t wire_micros(void *context)
{
    (void)context;
    return wire.now;
}

static uint8_t wire_flush(void *context)
{
    (void)context;
    return wire.calm || chance(3) != 0;
}

static const mbm_port port = {
    .read = wire_read, .write = wire_write, .micros = wire_micros, .flush = wire_flush};

static void call(int is_callback);

static void done(void *context, mbm_clientRequest *request)
{
    int *pending = (int *)context;
    unsigned calls = chance(3);

    assert_int_equal(*pending, 1);
    assert_true(request->status != MBM_PENDING && request->status != MBM_CANCELLED);
    *pending = 0;
    ended++;
    while (!wire.calm && calls-- > 0)
        call(1);
}

static uint8_t queue_one(mbm_clientRequest *r)
{
    const mbm_rule rule = {.kind = byte(5), .bytes = byte(8)};

    switch (chance(17)) {
    case 0: return mbm_client_readCoils(&client, r, any(65536), any(2100));
    case 1: return mbm_client_readHoldingRegisters(&client, r, any(65536), any(130));
    case 2: return mbm_client_writeSingleCoil(&client, r, any(65536), byte(2));
    case 3: return mbm_client_writeMultipleRegisters(&client, r, any(65536), any(130));
    case 4: return mbm_client_writeMultipleCoils(&client, r, any(100), any(1024));
    case 5: return mbm_client_custom(&client, r, byte(140), any(256), &rule);
    case 6: return mbm_client_diagnostics(&client, r, any(22), any(3));
    case 7: return mbm_client_reportServerId(&client, r);
    case 8: return mbm_client_getCommEventLog(&client, r);
    case 9: return mbm_client_readFifoQueue(&client, r, any(65536));
    case 10: return mbm_client_readDeviceIdentification(&client, r, byte(6), byte(256));
    case 11: return mbm_client_readExceptionStatus(&client, r);
    case 12: return mbm_client_maskWriteRegister(&client, r, 1, 2, 3);
    case 13:
        return mbm_client_readWriteMultipleRegisters(&client, r, any(100), any(127), any(100),
                                                     any(123));
    case 14: return mbm_client_readFileRecord(&client, r, any(3), any(10001), any(130));
    case 15: return mbm_client_writeFileRecord(&client, r, any(3), any(10001), any(125));
    default: {
        const uint8_t function = byte(0x2D);

        return mbm_client_forward(&client, r, function, chance(20) ? bodies[function % 4] : NULL,
                                  chance(2) ? 4 : any(sizeof bodies[0] + 1));
    }
    }
}

static void queue_any(void)
{
    unsigned i = chance(REQUESTS);
    mbm_clientRequest *r = &jobs[i].request;

    if (jobs[i].pending) {
        assert_int_equal(queue_one(r), MBM_BUSY);
        return;
    }
    memset(r, 0, sizeof *r);
    r->unit = byte(5);
    r->done = done;
    r->context = &jobs[i].pending;
    r->data = chance(20) ? data : NULL;
    r->reply = chance(10) ? jobs[i].reply : NULL;
    r->replyBytes = chance(5) ? sizeof jobs[i].reply : any(10);
    r->transaction = chance(2) ? 0 : any(30);
    uint8_t status = queue_one(r);
    assert_int_equal(r->status, status);
    jobs[i].pending = status == MBM_PENDING;
}

static void cancel_any(void)
{
    unsigned i = chance(REQUESTS);
    uint8_t wanted = jobs[i].pending ? MBM_OK : MBM_NOT_PENDING;

    assert_int_equal(mbm_client_cancel(&client, &jobs[i].request), wanted);
    jobs[i].pending = 0;
}

static uint32_t any_number(void *context)
{
    (void)context;
    return chance(1u << 31);
}

static void set_any(void)
{
    switch (chance(7)) {
    case 0: (void)mbm_client_setRetries(&client, byte(4)); break;
    case 1: (void)mbm_client_setBackoff(&client, byte(5), any(3000), any(3000)); break;
    case 2: (void)mbm_client_setInFlight(&client, byte(18)); break;
    case 3: (void)mbm_client_setResponseTimeout(&client, any(3000)); break;
    case 4: (void)mbm_client_setUnits(&client, chance(2) ? units : NULL, 3); break;
    case 5: (void)mbm_client_setJitter(&client, byte(102), any_number, NULL); break;
    default: (void)mbm_client_setEchoDiscard(&client, byte(2)); break;
    }
}

static void call(int is_callback)
{
    switch (chance(is_callback ? 8 : 14)) {
    case 0:
    case 1:
    case 2: queue_any(); break;
    case 3: cancel_any(); break;
    case 4: (void)mbm_client_pollDelay(&client); break;
    case 5:
        if (chance(10) == 0)
            (void)mbm_client_reconnect(&client, NULL);
        break;
    case 6: set_any(); break;
    case 7:
        if (is_callback)
            IS(MBM_BUSY, mbm_client_poll(&client));
        if (chance(4) == 0)
            (void)mbm_client_suspend(&client, NULL);
        if (chance(2))
            (void)mbm_client_resume(&client, NULL);
        break;
    case 8: wire.now += chance(2) ? chance(5000) : chance(3000000); break;
    case 9:
        if (chance(20) == 0)
            wire.now += chance(2) ? 0x7FFFFFF0u : 0u - chance(1000000);
        break;
    case 10: wire.mode = chance(4) ? TAKES : chance(10) ? TAKES_NOTHING : LOST; break;
    case 11:
        if (chance(5) == 0)
            arrive_noise();
        break;
    default: (void)mbm_client_poll(&client); break;
    }
}

static void begin(unsigned seed)
{
    uint16_t received = (uint16_t)(chance(2) ? 256 + chance(800) : 9 + chance(60));
    uint16_t sent = (uint16_t)(chance(2) ? 260 + chance(800) : 12 + chance(60));

    memset(&client, 0, sizeof client);
    memset(jobs, 0, sizeof jobs);
    memset(&wire, 0, sizeof wire);
    memset(units, 0, sizeof units);
    for (unsigned i = 0; i < COUNT(units); i++) {
        units[i].unit = (uint8_t)i;
        units[i].delayUs = chance(500000);
    }
    wire.now = chance(2) ? 0 : 0xFFFF0000u;
    wire.is_tcp = seed % 4 == 3;
    switch (seed % 4) {
    case 0: OK(mbm_client_beginRtu(&client, &port, incoming, received)); break;
    case 1:
        received = received < 17 ? 17 : received;
        OK(mbm_client_beginAscii(&client, &port, incoming, received));
        break;
    case 2: OK(mbm_client_beginRtuOverTcp(&client, &port, incoming, received)); break;
    default: OK(mbm_client_beginTcp(&client, &port, incoming, received, outgoing, sent)); break;
    }
    OK(mbm_client_setCounters(&client, &counters));
}

/* Polls until all requests have ended. The port accepts bytes or none. */
static void all_end(void)
{
    unsigned polls = 0;

    wire.calm = 1;
    wire.mode = chance(2) ? TAKES : TAKES_NOTHING;
    (void)mbm_client_resume(&client, NULL);
    OK(mbm_client_setRetries(&client, 1));
    OK(mbm_client_setResponseTimeout(&client, 1000));
    while (mbm_client_poll(&client) == MBM_PENDING) {
        uint32_t delay = mbm_client_pollDelay(&client);

        wire.now += delay < 5000 ? 5000 : delay < 1000000 ? delay : 1000000;
        assert_true(++polls < 60000);
    }
}

TEST(every_request_ends_once_whatever_is_called)
{
    const char *fewer = getenv("MBM_TRANSACTIONS");
    unsigned seeds = fewer ? 40 : SEEDS, seed, i, pending;

    for (seed = 0; seed < seeds; seed++) {
        random_state = seed * 0x9E3779B97F4A7C15u + 1;
        begin(seed);
        for (i = 0; i < CALLS; i++)
            call(0);
        for (i = pending = 0; i < REQUESTS; i++)
            pending += (unsigned)jobs[i].pending;
        assert_int_equal(mbm_client_pending(&client), pending);
        all_end();
        for (i = 0; i < REQUESTS; i++)
            assert_int_equal(jobs[i].pending, 0);
    }
    printf("%u clients, %lu requests ended\n", seeds, ended);
    assert_true(ended > seeds);
}
