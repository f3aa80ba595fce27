/* Several clients and several servers on one simulated multi-drop bus. By the standard a
 * serial line has one client. Two clients that take turns work. Two that do not may fail,
 * but get no wrong data. */
#include "bus.h"
#include "test.h"

#include <string.h>

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
    (void)context;
    random_state = random_state * 1103515245u + 12345u;
    return random_state >> 8;
}

static void begin(void)
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

fixture each_test = {begin, NULL};

static void pass(void)
{
    line.now += STEP;
    for (unsigned i = 0; i < SERVERS; i++)
        (void)mbm_server_poll(&servers[i]);
}

static void done(void *context, mbm_clientRequest *request)
{
    const job *j = (const job *)context;
    unsigned i, differs = 0;

    doubled += j->pending != 1;
    ((job *)context)->pending = 0;
    if (request->status != MBM_OK) {
        failed++;
        return;
    }
    for (i = 0; i < WORDS; i++)
        differs |= j->words[i] != 1000u * request->unit + j->address + i;
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

TEST(clients_that_take_turns_are_answered_by_every_server)
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

TEST(a_broadcast_reaches_every_server_at_once)
{
    static const uint16_t words[] = {0xBEEF, 0xCAFE};
    mbm_clientRequest r = {.unit = 0, .data = words};

    IS(MBM_PENDING, mbm_client_writeMultipleRegisters(&askers[0].client, &r, 97, 2));
    while (mbm_client_poll(&askers[0].client) == MBM_PENDING)
        pass();
    assert_int_equal(r.status, MBM_OK);
    for (unsigned i = 0; i < SERVERS; i++)
        assert_memory_equal(held[i] + 97, words, sizeof words);
    assert_int_equal(line.collisions, 0);
}

TEST(clients_that_collide_get_no_wrong_data)
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
