/* Peers that never stop sending, at a client, a server and a gateway: every request ends, and every
 * poll too, whatever arrives. */
#include "linked.h"
#include "every_call.h"
#include "gateway_bench.h"
#include "test.h"

/* A peer that never stops sending: a port that has bytes for every read, and takes what is sent. */
typedef struct talk {
    const char *what;
    const uint8_t *bytes;
    size_t count;
} talk;

typedef struct talker {
    const talk *says; /* again and again */
    size_t at;
    size_t piece;        /* how many bytes a read returns at most */
    size_t each;         /* bytes of a connection until it is lost; 0: no limit */
    size_t left;         /* how many of them are left */
    unsigned reads;      /* since the last poll began */
    unsigned most_reads; /* the most reads of one poll */
    uint32_t *clock;
    uint32_t step; /* microseconds that each look at the clock takes */
    size_t sent;
    int is_lost, is_stuck; /* it takes nothing that is sent */
} talker;

#define BYTES(text) (const uint8_t *)(text), sizeof(text) - 1

static const talk TALKS[] = {
    {"zeros", BYTES("\0")},
    {"a text", BYTES("Port already in use\r\n")},
    {"beginnings of ASCII frames", BYTES(":")},
    {"an ASCII reply", BYTES(":0703021234AE\r\n")},
    {"half an ASCII reply", BYTES(":0703021234\r\n")},
    {"an RTU reply", BYTES("\x07\x03\x02\x12\x34\x3D\x33")},
    {"another unit's RTU reply", BYTES("\x05\x03\x02\x12\x34\x44\xF3")},
    {"half an RTU reply", BYTES("\x07\x03\x02\x12")},
    {"a damaged RTU reply", BYTES("\x07\x03\x02\x12\x34\xFF\xFF")},
    {"the number of another request", BYTES("\x7F\xFF\0\0\0\5\7\3\2\x12\x34")},
    {"another unit with the right number", BYTES("\0\0\0\0\0\5\5\3\2\x12\x34")},
    {"half a frame of TCP", BYTES("\0\0\0\0\0\xFE\7")},
    {"headers that announce more than a frame", BYTES("\0\0\0\0\xFF\xFF\7")},
    {"frames of TCP without a PDU", BYTES("\0\0\0\0\0\1\7")},
};

static int16_t talker_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    talker *t = context;
    size_t count = t->piece < capacity ? t->piece : capacity, i;

    t->reads++;
    if (t->each > 0 && t->left == 0)
        t->is_lost = 1;
    if (t->is_lost)
        return -1;
    if (t->each > 0) {
        count = count < t->left ? count : t->left;
        t->left -= count;
    }
    for (i = 0; i < count; i++, t->at++)
        bytes[i] = t->says->bytes[t->at % t->says->count];
    return (int16_t)count;
}

static int16_t talker_write(void *context, const uint8_t *bytes, uint16_t length)
{
    talker *t = context;

    (void)bytes;
    if (t->is_lost)
        return -1;
    if (t->is_stuck)
        return 0;
    t->sent += length;
    return (int16_t)length;
}

static uint32_t talker_micros(void *context)
{
    const talker *t = context;

    return *t->clock += t->step;
}

/* The port of a talker that says this, with a clock of the test. */
static mbm_port talker_begin(talker *t, const talk *says, size_t piece, uint32_t *clock)
{
    const mbm_port port = {
        .context = t, .read = talker_read, .write = talker_write, .micros = talker_micros};

    memset(t, 0, sizeof *t);
    t->says = says;
    t->piece = piece;
    t->clock = clock;
    return port;
}

/* Notes that a poll begins, and that it has ended. */
static void talker_poll_begins(talker *t)
{
    t->reads = 0;
}

static void talker_poll_ends(talker *t)
{
    if (t->reads > t->most_reads)
        t->most_reads = t->reads;
}

enum { STEPS = 20000 };

static talker peer;

static uint8_t connect_peer(void *context)
{
    assert_ptr_equal(context, &m);
    connects++;
    peer.is_lost = 0;
    peer.left = peer.each;
    return MBM_OK;
}

static const mbm_linkHooks peer_hooks = {
    .context = &m, .disconnect = disconnect, .connect = connect_peer};

/* A client, with a link or without, of a peer that says this. */
static void begin_peer(int framing, int has_link, const talk *says, size_t piece)
{
    const mbm_port port = talker_begin(&peer, says, piece, &m.now);

    begin(framing);
    memset(&client, 0, sizeof client);
    OK(CLIENT_BEGIN(&client, framing, &port, frame, outgoing));
    OK(mbm_client_setResponseTimeout(&client, 300));
    if (has_link)
        OK(mbm_link_begin(&kept, &client, &peer_hooks));
}

static void poll(void)
{
    talker_poll_begins(&peer);
    (void)mbm_client_poll(&client);
    talker_poll_ends(&peer);
    m.now += MS;
}

/* Polls, each millisecond, until the request has ended. Returns how many milliseconds that took. */
static unsigned until_end(const mbm_clientRequest *which)
{
    unsigned steps = 0;

    for (; which->status == MBM_PENDING && steps < STEPS; steps++)
        poll();
    assert_true(steps < STEPS);
    return steps;
}

/* --- connections that are closed again --- */

/* A serial device server that another master uses: ser2net and others say so, and close the
 * connection. */
static const talk in_use = {"a text", BYTES("Port already in use\r\n")};

static void begin_in_use(int framing)
{
    begin_peer(framing, 1, &in_use, 100);
    peer.each = in_use.count;
}

STREAM_TEST(a_peer_that_sends_a_text_and_closes_each_connection_fails_the_request)
{
    begin_in_use(framing);
    for (unsigned round = 0; round < 5; round++) {
        const unsigned before = connects;

        queue_read(&request);
        assert_in_range(until_end(&request), 1, 20);
        IS(MBM_LINK_LOST, request.status);
        assert_in_range(connects - before, 0, 2);
    }
    /* The link waits before each later attempt. */
    run(5000);
    assert_in_range(connects, 2, 20);
    assert_int_equal(peer.sent, 0);
}

STREAM_TEST(a_peer_that_closes_each_connection_during_the_delay_after_it_fails_the_request)
{
    begin_in_use(framing);
    OK(mbm_link_setDelayAfterConnect(&kept, 2000));
    queue_read(&request);
    assert_in_range(until_end(&request), 1, 20);
    IS(MBM_LINK_LOST, request.status);
    assert_in_range(connects, 1, 3);
    /* Once the device is free, requests are sent again. */
    peer.each = 0;
    peer.piece = 0;
    run(4000);
    queue_read(&request);
    assert_in_range(until_end(&request), 250, 400);
    IS(MBM_RESPONSE_TIMED_OUT, request.status);
    assert_true(peer.sent > 0);
}

STREAM_TEST(requests_that_wait_for_the_link_make_no_loop_of_connections_that_are_closed)
{
    begin_in_use(framing);
    OK(mbm_link_setRequestsWait(&kept, 1));
    queue_read(&request);
    run(5000);
    IS(MBM_PENDING, request.status);
    /* Two connections each half second: the link opens one after its wait, and one for the request.
     */
    assert_in_range(connects, 5, 25);
}

/* --- bytes that keep coming --- */

/* A poll may make 255 reads for each request whose deadline has passed. */
enum { MOST_READS = 600, MOST_MS = 3000 };

/* Whether four requests, one after the other, end in time. */
static int requests_end(unsigned most_ms)
{
    for (unsigned round = 0; round < 4; round++) {
        queue_read(&request);
        if (until_end(&request) > most_ms || peer.most_reads > MOST_READS)
            return 0;
    }
    return 1;
}

FRAMING_TEST(a_request_ends_whatever_arrives_without_a_pause)
{
    static const size_t pieces[] = {1, 7, 1000};

    for (unsigned i = 0; i < COUNT(TALKS); i++)
        for (unsigned p = 0; p < COUNT(pieces); p++)
            for (int link = 0; link <= 1; link++) {
                begin_peer(framing, link, &TALKS[i], pieces[p]);
                if (!requests_end(MOST_MS))
                    fail_msg("%s, framing %d, link %d, %zu bytes a read", TALKS[i].what, framing,
                             link, pieces[p]);
            }
}

/* The settings that wait for the device, too. Only those from LENIENT on are for all framings, and
 * LENIENT itself is not for ASCII. */
enum {
    ACCEPT_UNIT,
    ACCEPT_TRANSACTION,
    MESSAGE_WAIT,
    LENIENT,
    RETRIES,
    QUIET_TIME,
    DELAY_AFTER_CONNECT, /* of a link, like those below */
    CLOSE_AFTER_FAILURE,
    CLOSE_WHEN_IDLE,
    WAITS
};

static void set_wait(unsigned which)
{
    switch (which) {
    case ACCEPT_UNIT: OK(mbm_client_setAccept(&client, MBM_ACCEPT_UNIT)); return;
    case ACCEPT_TRANSACTION: OK(mbm_client_setAccept(&client, MBM_ACCEPT_TRANSACTION)); return;
    case MESSAGE_WAIT: OK(mbm_client_setMessageWait(&client, 200)); return;
    case LENIENT: OK(mbm_client_setLenient(&client, 1)); return;
    case RETRIES: OK(mbm_client_setRetries(&client, 3)); return;
    case QUIET_TIME: OK(mbm_client_setQuietTime(&client, 500)); return;
    case DELAY_AFTER_CONNECT: OK(mbm_link_setDelayAfterConnect(&kept, 500)); return;
    case CLOSE_AFTER_FAILURE: OK(mbm_link_setClose(&kept, MBM_LINK_CLOSE_AFTER_FAILURE)); return;
    default: OK(mbm_link_setClose(&kept, MBM_LINK_CLOSE_WHEN_IDLE)); return;
    }
}

static int has_wait(int framing, unsigned which)
{
    if (framing == MBM_FRAMING_TCP)
        return 1;
    return which > LENIENT || (which == LENIENT && framing != MBM_FRAMING_ASCII);
}

FRAMING_TEST(a_request_ends_with_every_setting_that_waits)
{
    for (unsigned i = 0; i < COUNT(TALKS); i++)
        for (unsigned w = 0; w < WAITS; w++) {
            if (!has_wait(framing, w))
                continue;
            begin_peer(framing, w >= DELAY_AFTER_CONNECT, &TALKS[i], 7);
            set_wait(w);
            if (!requests_end(4 * MOST_MS))
                fail_msg("%s, framing %d, setting %u", TALKS[i].what, framing, w);
        }
}

/* After a request that was cancelled the next one rests until its unit is clean. */
FRAMING_TEST(a_request_after_a_cancelled_one_ends)
{
    for (unsigned i = 0; i < COUNT(TALKS); i++) {
        begin_peer(framing, 0, &TALKS[i], 0);
        queue_read(&request);
        while (peer.sent == 0 && m.now < STEPS * MS)
            poll();
        for (unsigned step = 0; step < 20; step++)
            poll();
        OK(mbm_client_cancel(&client, &request));
        peer.piece = 7;
        queue_read(&request);
        if (until_end(&request) > MOST_MS)
            fail_msg("%s, framing %d", TALKS[i].what, framing);
    }
}

FRAMING_TEST(a_poll_of_an_idle_link_ends)
{
    for (unsigned i = 0; i < COUNT(TALKS); i++) {
        begin_peer(framing, 1, &TALKS[i], 1);
        for (unsigned step = 0; step < 100; step++)
            poll();
        assert_in_range(peer.most_reads, 0, MOST_READS);
    }
}

/* --- a master, which waits in its call --- */

TEST(a_blocking_call_ends_whatever_arrives_without_a_pause)
{
    static mbm_line line;
    static mbm_node node;

    for (unsigned i = 0; i < COUNT(TALKS); i++)
        for (size_t piece = 1; piece <= 100; piece *= 10) {
            const mbm_port port = talker_begin(&peer, &TALKS[i], piece, &m.now);

            memset(&line, 0, sizeof line);
            memset(&node, 0, sizeof node);
            peer.step = 100;
            OK(mbm_line_beginRtu(&line, &port, frame, sizeof frame));
            OK(mbm_node_begin(&node, &line, UNIT, words, COUNT(words), NULL, 0));
            OK(mbm_node_setResponseTimeout(&node, 300));
            for (unsigned round = 0; round < 4; round++) {
                const uint32_t before = m.now;

                (void)mbm_node_readHoldingRegisters(&node, 0, 1);
                if (m.now - before > MOST_MS * MS)
                    fail_msg("%s, %zu bytes a read", TALKS[i].what, piece);
            }
        }
}

/* --- at a server and at a gateway every poll ends too, and others are served --- */

static mbm_server server;
static mbm_unit unit;
static mbm_registerTable table;
static uint32_t now;

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

static void serve_for(unsigned steps)
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
    serve_for(200);
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
        serve_for(2000);
        (void)talker_begin(&peer, right, 100, &now);
        peer.each = peer.left = right->count;
        while (peer.left > 0)
            serve_for(1);
        peer.each = peer.piece = 0;
        serve_for(2000);
        if (peer.sent == 0)
            fail_msg("no answer after %s, framing %d", TALKS[i].what, framing);
    }
}

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
    static uint8_t incoming[MBM_MAX_ASCII_FRAME];
    mbm_client *of_line = &b.clients[0];

    for (unsigned i = 0; i < COUNT(TALKS); i++) {
        const mbm_port port = talker_begin(&peer, &TALKS[i], 7, &now);

        begin_gateway();
        now = 0;
        OK(CLIENT_BEGIN(of_line, framing, &port, incoming, outgoing));
        OK(mbm_client_setResponseTimeout(of_line, 300));
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
