/* Clients and devices that never stop sending, at a server and at a gateway: every poll ends, and
 * others are served. */
#include "every_call.h"
#include "gateway_bench.h"
#include "talker.h"
#include "test.h"

enum { UNIT = 7, MS = 1000, STEPS = 20000 };

static talker peer;

/* --- a server --- */

static mbm_server server;
static mbm_unit unit;
static mbm_registerTable table;
static uint16_t words[4];
static uint8_t frame[MBM_MAX_ASCII_FRAME];
static uint32_t now;

static const uint8_t framings[] = {MBM_FRAMING_RTU, MBM_FRAMING_ASCII, MBM_FRAMING_TCP,
                                   MBM_FRAMING_RTU_OVER_TCP};

static const talk REQUESTS[] = {
    {"RTU requests", BYTES("\x07\x03\x00\x00\x00\x01\x84\x6C")},
    {"ASCII requests", BYTES(":070300000001F5\r\n")},
    {"TCP requests", BYTES("\0\1\0\0\0\6\7\3\0\0\0\1")},
};

static void begin_server(int framing, const talk *t, size_t piece)
{
    const mbm_port port = talker_begin(&peer, t, piece, &now);

    memset(&server, 0, sizeof server);
    memset(&table, 0, sizeof table);
    unit = (mbm_unit){.id = UNIT};
    table.words = words;
    table.size = COUNT(words);
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(server_begin(&server, (unsigned)framing, &port, &unit, 1, frame, sizeof frame));
}

/* A frame has at most 260 bytes, and one is served in a poll. */
enum { MOST_READS = 600 };

static void run(unsigned steps)
{
    for (unsigned step = 0; step < steps; step++, now += MS) {
        talker_poll_begins(&peer);
        (void)mbm_server_poll(&server);
        talker_poll_ends(&peer);
    }
}

static void polls_end(int framing, const talk *t, size_t piece)
{
    begin_server(framing, t, piece);
    run(200);
    if (peer.most_reads > MOST_READS)
        fail_msg("%s, framing %d: %u reads", t->what, framing, peer.most_reads);
}

FRAMING_TEST(a_poll_of_a_server_ends_whatever_arrives_without_a_pause)
{
    for (size_t piece = 1; piece <= 1000; piece *= 10) {
        for (unsigned i = 0; i < COUNT(TALKS); i++)
            polls_end(framing, &TALKS[i], piece);
        for (unsigned i = 0; i < COUNT(REQUESTS); i++)
            polls_end(framing, &REQUESTS[i], piece);
    }
}

/* Over a stream there is no silence before the next request. */
TEST(requests_without_a_pause_are_answered_one_by_one)
{
    begin_server(MBM_FRAMING_TCP, &REQUESTS[2], 1000);
    for (unsigned step = 0; step < 100; step++, now += MS)
        OK(mbm_server_poll(&server));
    assert_in_range(peer.sent, 50 * 11, 100 * 11);
}

/* After the talk and a silence, a serial server understands the next request. */
FRAMING_TEST(a_server_understands_the_request_after_the_talk)
{
    const talk *right = framing == MBM_FRAMING_ASCII ? &REQUESTS[1] : &REQUESTS[0];

    if (framing == MBM_FRAMING_TCP)
        return;
    for (unsigned i = 0; i < COUNT(TALKS); i++) {
        polls_end(framing, &TALKS[i], 7);
        peer.piece = 0;
        run(2000);
        (void)talker_begin(&peer, right, 100, &now);
        peer.each = peer.left = right->count;
        while (peer.left > 0)
            run(1);
        peer.each = peer.piece = 0;
        run(2000);
        if (peer.sent == 0)
            fail_msg("no answer after %s, framing %d", TALKS[i].what, framing);
    }
}

/* --- a gateway --- */

static gateway_bench b;

static const mbm_gatewayRoute routes[] = {
    {1, 31, 0, 0}, {101, 131, 1, 1}, {0, 0, MBM_GATEWAY_ALL_LINES, 0}};

#define READ "\x03\x00\x10\x00\x01"
#define VALUE "\x03\x02\x12\x34"

static const talk MASTERS[] = {
    {"requests", BYTES("\0\1\0\0\0\6\7\3\0\0\0\1")},
    {"requests to a unit without a line", BYTES("\0\1\0\0\0\6\xC8\3\0\0\0\1")},
    {"requests that the standard forbids", BYTES("\0\1\0\0\0\6\7\3\0\0\0\0")},
    {"broadcasts", BYTES("\0\1\0\0\0\6\0\6\0\0\0\1")},
    {"reads of all units", BYTES("\0\1\0\0\0\6\0\3\0\0\0\1")},
    {"half a request", BYTES("\0\1\0\0\0\xFE\7\3")},
    {"requests of two bytes", BYTES("\0\1\0\0\0\2\7\3")},
};

static void begin_gateway(void)
{
    gateway_bench_start(&b, routes, COUNT(routes));
}

/* Polls the gateway while the clock goes on, until the connection 1 has got a response of `length`
 * bytes. Returns after how many milliseconds. */
static unsigned until_response(size_t length)
{
    unsigned steps = 0;

    while (b.sockets[1].sent_count < length && steps < STEPS) {
        talker_poll_begins(&peer);
        OK(mbm_gateway_poll(&b.gateway));
        talker_poll_ends(&peer);
        for (unsigned i = 0; i < BENCH_LINES; i++)
            b.wires[i].now += MS;
        for (unsigned i = 0; i < BENCH_CONNECTIONS; i++)
            b.sockets[i].now += MS;
        now += MS;
        steps++;
    }
    assert_true(steps < STEPS);
    return steps;
}

TEST(a_master_that_never_stops_keeps_no_other_from_being_answered)
{
    for (unsigned i = 0; i < COUNT(MASTERS); i++)
        for (int is_stuck = 0; is_stuck <= 1; is_stuck++)
            for (size_t piece = 1; piece <= 1000; piece *= 10) {
                const mbm_port port = talker_begin(&peer, &MASTERS[i], piece, &now);

                begin_gateway();
                now = 0;
                OK(mbm_gateway_close(&b.gateway, 0));
                OK(mbm_gateway_open(&b.gateway, 0, &port));
                peer.is_stuck = is_stuck;
                /* Its silent device costs 100 ms and the quiet time for each of its requests. */
                for (unsigned round = 0; round < 4; round++) {
                    b.sockets[1].sent_count = 0;
                    ASK(1, round, 7, READ);
                    if (until_response(9) > 1500 || peer.most_reads > 64)
                        fail_msg("%s, %zu bytes a read", MASTERS[i].what, piece);
                }
                b.sockets[1].sent_count = b.wires[1].sent_count = 0;
                ASK(1, 9, 101, READ);
                assert_in_range(until_response(9), 1, 1500);
            }
}

FRAMING_TEST(a_device_that_never_stops_keeps_no_request_and_no_other_line)
{
    static uint8_t incoming[MBM_MAX_ASCII_FRAME], outgoing[MBM_MAX_TCP_FRAME];
    mbm_client *client = &b.clients[0];

    for (unsigned i = 0; i < COUNT(TALKS); i++) {
        const mbm_port port = talker_begin(&peer, &TALKS[i], 7, &now);

        begin_gateway();
        now = 0;
        OK(CLIENT_BEGIN(client, framing, &port, incoming, outgoing));
        OK(mbm_client_setResponseTimeout(client, 300));
        for (unsigned round = 0; round < 4; round++) {
            b.sockets[1].sent_count = 0;
            ASK(1, round, UNIT, READ);
            if (until_response(9) > 3000 || peer.most_reads > MOST_READS)
                fail_msg("%s, framing %d", TALKS[i].what, framing);
        }
        b.sockets[1].sent_count = 0;
        ASK(1, 9, UNIT, READ);
        ASK(1, 10, 101, READ);
        REPLY(1, 1, VALUE);
        /* Both responses. */
        assert_in_range(until_response(18), 1, 3000);
    }
}
