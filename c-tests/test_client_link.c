/* The client over a port in memory: when its link is known to be lost, how its waits vary,
 * and which transaction identifier is on the wire. */
#include "every_call.h"
#include "bus.h"
#include "memory_port.h"
#include "test.h"

enum { UNIT = 7, SECOND = 1000000 };

static memory_port m;
static mbm_client client;
static mbm_clientRequest request;
static uint8_t frame[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
static uint16_t words[4];

static void begin(int framing)
{
    mbm_port port = memory_port_of(&m);

    memset(&m, 0, sizeof m);
    memset(&client, 0, sizeof client);
    memset(&request, 0, sizeof request);
    OK(CLIENT_BEGIN(&client, framing, &port, frame, outgoing));
    if (framing == MBM_FRAMING_TCP)
        OK(mbm_client_setInFlight(&client, MBM_CLIENT_DEPTH));
    request.unit = UNIT;
    request.reply = words;
    request.replyBytes = sizeof words;
}

static void queue_read(void)
{
    m.sent_count = 0;
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &request, 0, 1));
}

/* Delivers the right reply to the last request. */
static void answer(int framing)
{
    static const uint8_t rtu[] = {UNIT, 3, 2, 0x12, 0x34};
    uint8_t tcp[] = {0, 0, 0, 0, 0, 5, UNIT, 3, 2, 0x12, 0x34};

    if (framing == MBM_FRAMING_ASCII) {
        memory_port_bytes(&m,
                          (const uint8_t *)":07030212"
                                           "34AE\r\n",
                          15);
    } else if (framing == MBM_FRAMING_TCP) {
        memcpy(tcp, m.sent, 2);
        memory_port_bytes(&m, tcp, sizeof tcp);
    } else {
        memory_port_rtu(&m, rtu, sizeof rtu);
    }
}

static uint8_t connects_with;

static uint8_t reconnected(void *context)
{
    return connects_with;
}

static const int framings[] = {MBM_FRAMING_RTU, MBM_FRAMING_ASCII, MBM_FRAMING_TCP,
                               MBM_FRAMING_RTU_OVER_TCP};

FRAMING_TEST(a_link_is_connected_once_connect_succeeds_or_a_reply_arrives)
{
    static const uint8_t statuses[] = {MBM_OK, MBM_PENDING, MBM_LINK_LOST, MBM_INVALID_ARGUMENT};
    const mbm_linkHooks link = {.connect = reconnected};

    for (unsigned k = 0; k < COUNT(statuses); k++) {
        begin(framing);
        assert_int_equal(mbm_client_isConnected(&client), 1);
        m.is_lost = 1;
        queue_read();
        IS(MBM_LINK_LOST, memory_port_run(&m, &client, &request, 100));
        assert_int_equal(mbm_client_isConnected(&client), 0);

        m.is_lost = 0;
        connects_with = statuses[k];
        IS(statuses[k], mbm_client_reconnect(&client, &link));
        assert_int_equal(mbm_client_isConnected(&client), statuses[k] == MBM_OK);
        /* A request without a reply does not show that there is a link. */
        queue_read();
        IS(MBM_RESPONSE_TIMED_OUT, memory_port_run(&m, &client, &request, 1000));
        assert_int_equal(mbm_client_isConnected(&client), statuses[k] == MBM_OK);
        queue_read();
        memory_port_send(&m, &client);
        answer(framing);
        IS(MBM_OK, memory_port_run(&m, &client, &request, 1000));
        assert_int_equal(mbm_client_isConnected(&client), 1);
    }
}

TEST(a_link_that_the_program_connected_is_connected)
{
    const mbm_linkHooks none = {.connect = NULL};

    for (unsigned i = 0; i < COUNT(framings); i++) {
        begin(framings[i]);
        m.is_lost = 1;
        queue_read();
        IS(MBM_LINK_LOST, memory_port_run(&m, &client, &request, 100));
        OK(mbm_client_reconnect(&client, i % 2 ? &none : NULL));
        assert_int_equal(mbm_client_isConnected(&client), 1);
    }
}

static uint32_t number;

/* Random functions whose values vary in different bits. */
static uint32_t of_32_bits(void *context)
{
    number = number * 1664525u + 1013904223u;
    return number;
}

static uint32_t of_15_bits(void *context)
{
    return of_32_bits(context) >> 17;
}

static uint32_t of_16_bits(void *context)
{
    return of_32_bits(context) >> 16;
}

static uint32_t of_upper_bits(void *context)
{
    return of_32_bits(context) & 0xFFFF0000u;
}

TEST(any_random_function_gives_the_whole_range_of_jitter)
{
    uint32_t (*const generators[])(void *) = {of_32_bits, of_15_bits, of_16_bits, of_upper_bits};

    for (unsigned i = 0; i < COUNT(generators); i++) {
        uint32_t least = UINT32_MAX, most = 0, sum = 0;

        begin(MBM_FRAMING_TCP);
        OK(mbm_client_setResponseTimeout(&client, 1));
        OK(mbm_client_setRetries(&client, 255));
        OK(mbm_client_setBackoff(&client, MBM_BACKOFF_FIXED, 1000, 1000));
        OK(mbm_client_setJitter(&client, 100, generators[i], NULL));
        queue_read();
        memory_port_send(&m, &client);
        for (unsigned k = 0; k < 255; k++) {
            uint32_t sent_at = m.now, wait;

            m.sent_count = 0;
            memory_port_send(&m, &client);
            wait = m.now - sent_at - 1000;
            least = wait < least ? wait : least;
            most = wait > most ? wait : most;
            sum += wait / 255;
        }
        IS(MBM_RESPONSE_TIMED_OUT, memory_port_run(&m, &client, &request, 10));
        assert_in_range(least, 0, SECOND / 20);
        assert_in_range(most, SECOND - SECOND / 20, SECOND);
        assert_in_range(sum, SECOND / 2 - SECOND / 10, SECOND / 2 + SECOND / 10);
    }
}

TEST(the_transaction_identifier_on_the_wire_can_be_read)
{
    mbm_clientRequest other = {0};

    begin(MBM_FRAMING_TCP);
    assert_int_equal(mbm_client_wireTransaction(&request), 0);
    assert_int_equal(mbm_client_wireTransaction(NULL), 0);
    /* A second request, so that the identifier is not 0. */
    queue_read();
    memory_port_send(&m, &client);
    answer(MBM_FRAMING_TCP);
    IS(MBM_OK, memory_port_run(&m, &client, &request, 10));
    request.transaction = 500;
    other.unit = UNIT;
    other.transaction = 501;
    queue_read();
    IS(MBM_PENDING, mbm_client_readCoils(&client, &other, 0, 1));
    memory_port_send(&m, &client);
    assert_int_equal(m.sent_count, 24);
    uint16_t first = mbm_client_wireTransaction(&request);
    assert_int_equal(first, m.sent[0] << 8 | m.sent[1]);
    assert_int_equal(mbm_client_wireTransaction(&other), m.sent[12] << 8 | m.sent[13]);
    assert_int_not_equal(first, mbm_client_wireTransaction(&other));
    assert_int_equal(request.transaction, 500);
    assert_int_equal(other.transaction, 501);
    /* The identifier can be read after the end, too. */
    answer(MBM_FRAMING_TCP);
    IS(MBM_OK, memory_port_run(&m, &client, &request, 10));
    assert_int_equal(mbm_client_wireTransaction(&request), first);
}

TEST(reserved_units_and_sub_functions_are_sent_as_they_are)
{
    static const uint8_t sent[] = {255, 8, 0, 0x15, 0xAB, 0xCD}, reply[] = {255, 8, 0, 0x15, 1, 2};
    const uint16_t data = 0xABCD;

    begin(MBM_FRAMING_RTU);
    request.unit = 255;
    request.data = &data;
    IS(MBM_PENDING, mbm_client_diagnostics(&client, &request, 0x15, 1));
    memory_port_send(&m, &client);
    assert_int_equal(m.sent_count, sizeof sent + 2);
    assert_memory_equal(m.sent, sent, sizeof sent);
    memory_port_rtu(&m, reply, sizeof reply);
    IS(MBM_OK, memory_port_run(&m, &client, &request, 1000));
    assert_int_equal(words[0], 0x0102);
}

/* Several clients and several servers on one simulated multi-drop bus. By the standard a
 * serial line has one client. Two clients that take turns work. Two that do not may fail,
 * but get no wrong data. */

enum { SERVERS = 4, CLIENTS = 2, ROUNDS = 20, WORDS = 8, STEP = 100, EACH = 300 };

static bus line;
static mbm_server servers[SERVERS];
static mbm_unit units[SERVERS];
static mbm_registerTable tables[SERVERS];
static uint16_t held[SERVERS][100];
static uint8_t frames[SERVERS][MBM_MAX_FRAME];

typedef struct job {
    mbm_clientRequest request;
    uint16_t words[WORDS];
    uint16_t address;
    unsigned pending;
} job;

typedef struct asker {
    mbm_client client;
    mbm_counters counters;
    uint8_t frame[MBM_MAX_FRAME];
    job jobs[MBM_CLIENT_DEPTH];
} asker;

static asker askers[CLIENTS];
static unsigned right, failed, wrong, doubled;
static uint32_t random_state;

static uint32_t any(void *context)
{
    random_state = random_state * 1103515245u + 12345u;
    return random_state >> 8;
}

static void begin_bus(void)
{
    bus_start(&line);
    memset(servers, 0, sizeof servers);
    memset(units, 0, sizeof units);
    memset(tables, 0, sizeof tables);
    memset(askers, 0, sizeof askers);
    right = failed = wrong = doubled = 0;
    random_state = 1;
    for (unsigned i = 0; i < SERVERS; i++) {
        mbm_port port = bus_port(&line, 0xFFFF0000u + 0x1234567u * i);

        for (unsigned word = 0; word < COUNT(held[i]); word++)
            held[i][word] = (uint16_t)(1000 * (i + 1) + word);
        tables[i].words = held[i];
        tables[i].size = COUNT(held[i]);
        units[i].id = (uint8_t)(i + 1);
        OK(mbm_unit_serveHoldingRegisters(&units[i], &tables[i]));
        OK(mbm_server_beginRtu(&servers[i], &port, &units[i], 1, frames[i], sizeof frames[i]));
        OK(mbm_server_setBaudRate(&servers[i], BUS_BAUD));
    }
    for (unsigned i = 0; i < CLIENTS; i++) {
        mbm_port port = bus_port(&line, 0xFFFFFF00u * (i + 1));
        asker *a = &askers[i];

        OK(mbm_client_beginRtu(&a->client, &port, a->frame, sizeof a->frame));
        OK(mbm_client_setBaudRate(&a->client, BUS_BAUD));
        OK(mbm_client_setResponseTimeout(&a->client, 100));
        OK(mbm_client_setQuietTime(&a->client, 20));
        OK(mbm_client_setCounters(&a->client, &a->counters));
    }
}

static void pass(void)
{
    line.now += STEP;
    for (unsigned i = 0; i < SERVERS; i++)
        (void)mbm_server_poll(&servers[i]);
}

static void done(void *context, mbm_clientRequest *ended)
{
    const job *j = (const job *)context;
    unsigned i, differs = 0;

    doubled += j->pending != 1;
    ((job *)context)->pending = 0;
    if (ended->status != MBM_OK) {
        failed++;
        return;
    }
    for (i = 0; i < WORDS; i++)
        differs |= j->words[i] != 1000u * ended->unit + j->address + i;
    right += !differs;
    wrong += differs;
}

/* Queues reads of some of the units at a client. */
static void queue_reads(asker *a, unsigned first, unsigned count, unsigned requests)
{
    for (unsigned i = 0; i < requests; i++) {
        job *j = &a->jobs[i];

        memset(j, 0, sizeof *j);
        j->address = (uint16_t)(any(NULL) % 90);
        j->pending = 1;
        j->request.unit = (uint8_t)(first + (requests > 1 ? i : any(NULL)) % count);
        j->request.reply = j->words;
        j->request.replyBytes = sizeof j->words;
        j->request.done = done;
        j->request.context = j;
        IS(MBM_PENDING,
           mbm_client_readHoldingRegisters(&a->client, &j->request, j->address, WORDS));
    }
}

TEST_WITH(clients_that_take_turns_are_answered_by_every_server, begin_bus, NULL)
{
    for (unsigned round = 0; round < ROUNDS; round++) {
        asker *a = &askers[round % CLIENTS];

        queue_reads(a, 1, SERVERS, MBM_CLIENT_DEPTH);
        while (mbm_client_poll(&a->client) == MBM_PENDING)
            pass();
    }
    assert_int_equal(right, ROUNDS * MBM_CLIENT_DEPTH);
    assert_int_equal(failed + wrong + doubled, 0);
    assert_int_equal(line.collisions, 0);
    for (unsigned i = 0; i < CLIENTS; i++) {
        assert_int_equal(askers[i].counters.requests, ROUNDS / CLIENTS * MBM_CLIENT_DEPTH);
        assert_int_equal(askers[i].counters.badCrc + askers[i].counters.timeouts, 0);
    }
}

TEST_WITH(a_broadcast_reaches_every_server_at_once, begin_bus, NULL)
{
    static const uint16_t values[] = {0xBEEF, 0xCAFE};
    mbm_clientRequest r = {.unit = 0, .data = values};

    IS(MBM_PENDING, mbm_client_writeMultipleRegisters(&askers[0].client, &r, 97, 2));
    while (mbm_client_poll(&askers[0].client) == MBM_PENDING)
        pass();
    OK(r.status);
    for (unsigned i = 0; i < SERVERS; i++)
        assert_memory_equal(held[i] + 97, values, sizeof values);
    assert_int_equal(line.collisions, 0);
}

TEST_WITH(clients_that_collide_get_no_wrong_data, begin_bus, NULL)
{
    unsigned asked[CLIENTS] = {0}, i;
    uint64_t due[CLIENTS] = {0};

    for (i = 0; i < CLIENTS; i++) {
        OK(mbm_client_setRetries(&askers[i].client, 10));
        OK(mbm_client_setBackoff(&askers[i].client, MBM_BACKOFF_EXPONENTIAL, 40, 1000));
        OK(mbm_client_setJitter(&askers[i].client, 100, any, NULL));
    }
    while (right + failed + wrong < CLIENTS * EACH) {
        pass();
        for (i = 0; i < CLIENTS; i++) {
            if (mbm_client_poll(&askers[i].client) == MBM_PENDING)
                continue;
            if (due[i] == 0) {
                due[i] = line.now + any(NULL) % 200000;
            } else if (line.now >= due[i] && asked[i] < EACH) {
                /* Each client reads from two units of its own: RTU cannot tell which client
                 * a reply of one unit is for. */
                queue_reads(&askers[i], 1 + 2 * i, 2, 1);
                asked[i]++;
                due[i] = 0;
            }
        }
    }
    print_message("%u right, %u failed, %u bytes collided\n", right, failed, line.collisions);
    assert_true(line.collisions > 0);
    assert_true(askers[0].counters.requests > EACH);
    assert_int_equal(wrong + doubled, 0);
    assert_int_equal(asked[0] + asked[1], right + failed);
    assert_true(right > failed * 20);
}
