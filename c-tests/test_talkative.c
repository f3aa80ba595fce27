/* Peers that never stop sending: every request ends, and every poll too, whatever arrives. */
#include "linked.h"
#include "talker.h"

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

/* A client, with a link or without, of a peer that says these bytes. */
static void begin_peer(int framing, int has_link, const uint8_t *bytes, size_t count, size_t piece)
{
    const mbm_port port = talker_begin(&peer, bytes, count, piece, &m.now);

    begin(framing);
    memset(&client, 0, sizeof client);
    switch (framing) {
    case MBM_FRAMING_RTU: OK(mbm_client_beginRtu(&client, &port, frame, sizeof frame)); break;
    case MBM_FRAMING_ASCII: OK(mbm_client_beginAscii(&client, &port, frame, sizeof frame)); break;
    case MBM_FRAMING_RTU_OVER_TCP:
        OK(mbm_client_beginRtuOverTcp(&client, &port, frame, sizeof frame));
        break;
    default:
        OK(mbm_client_beginTcp(&client, &port, frame, sizeof frame, outgoing, sizeof outgoing));
    }
    OK(mbm_client_setResponseTimeout(&client, 300));
    if (has_link)
        OK(mbm_link_begin(&kept, &client, &peer_hooks));
}

/* Polls, each millisecond, until the request has ended. Returns how many milliseconds that took. */
static unsigned until_end(const mbm_clientRequest *which)
{
    unsigned steps = 0;

    while (which->status == MBM_PENDING && steps < STEPS) {
        talker_poll_begins(&peer);
        (void)mbm_client_poll(&client);
        talker_poll_ends(&peer);
        steps++;
        m.now += MS;
    }
    assert_true(steps < STEPS);
    return steps;
}

/* --- connections that are closed again --- */

static const uint8_t streams[] = {MBM_FRAMING_TCP, MBM_FRAMING_RTU_OVER_TCP};
/* A serial device server that another master uses: ser2net and others say so, and close the
 * connection. */
static const char in_use[] = "Port already in use\r\n";

static void begin_in_use(int framing)
{
    begin_peer(framing, 1, (const uint8_t *)in_use, sizeof in_use - 1, 100);
    peer.each = sizeof in_use - 1;
}

TEST(a_peer_that_sends_a_text_and_closes_each_connection_fails_the_request)
{
    for (unsigned i = 0; i < COUNT(streams); i++) {
        begin_in_use(streams[i]);
        for (unsigned round = 0; round < 5; round++) {
            const unsigned before = connects;

            queue_read(&request);
            assert_in_range(until_end(&request), 1, 20);
            IS(MBM_LINK_LOST, request.status);
            assert_in_range(connects - before, 0, 2);
        }
        /* The attempts after that have their waits. */
        run(5000);
        assert_in_range(connects, 2, 20);
        assert_int_equal(peer.sent, 0);
    }
}

TEST(a_peer_that_closes_each_connection_during_the_delay_after_it_fails_the_request)
{
    for (unsigned i = 0; i < COUNT(streams); i++) {
        begin_in_use(streams[i]);
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
}

TEST(requests_that_wait_for_the_link_make_no_loop_of_connections_that_are_closed)
{
    for (unsigned i = 0; i < COUNT(streams); i++) {
        begin_in_use(streams[i]);
        OK(mbm_link_setRequestsWait(&kept, 1));
        queue_read(&request);
        run(5000);
        IS(MBM_PENDING, request.status);
        /* Two each half second: that of the wait, and the one that the request opens. */
        assert_in_range(connects, 5, 25);
    }
}

/* --- bytes that keep coming --- */

/* What the reads of a poll may take: those of a deadline are 255 for each request. */
enum { MOST_READS = 600, MOST_MS = 3000 };

static void request_ends(const talk *t, int framing, int has_link, size_t piece)
{
    begin_peer(framing, has_link, t->bytes, t->count, piece);
    for (unsigned round = 0; round < 4; round++) {
        queue_read(&request);
        if (until_end(&request) > MOST_MS || peer.most_reads > MOST_READS)
            fail_msg("%s, framing %d, link %d, %zu bytes a read", t->what, framing, has_link,
                     piece);
    }
}

TEST(a_request_ends_whatever_arrives_without_a_pause)
{
    static const size_t pieces[] = {1, 7, 1000};

    for (unsigned i = 0; i < COUNT(TALKS); i++)
        for (unsigned f = 0; f < COUNT(framings); f++)
            for (unsigned p = 0; p < COUNT(pieces); p++)
                for (int link = 0; link <= 1; link++)
                    request_ends(&TALKS[i], framings[f], link, pieces[p]);
}

/* With settings that wait for the device, too. */
static void set_wait(unsigned which)
{
    switch (which) {
    case 0: OK(mbm_client_setAccept(&client, MBM_ACCEPT_TRANSACTION)); return;
    case 1: OK(mbm_client_setAccept(&client, MBM_ACCEPT_UNIT)); return;
    case 2: OK(mbm_client_setMessageWait(&client, 200)); return;
    case 3: OK(mbm_client_setLenient(&client, 1)); return;
    case 4: OK(mbm_client_setRetries(&client, 3)); return;
    case 5: OK(mbm_link_setDelayAfterConnect(&kept, 500)); return;
    case 6: OK(mbm_link_setClose(&kept, MBM_LINK_CLOSE_AFTER_FAILURE)); return;
    case 7: OK(mbm_link_setClose(&kept, MBM_LINK_CLOSE_WHEN_IDLE)); return;
    default: OK(mbm_client_setQuietTime(&client, 500)); return;
    }
}

static int is_of_link(unsigned which)
{
    return which >= 5 && which <= 7;
}

TEST(a_request_ends_with_every_setting_that_waits)
{
    enum { WAITS = 9, FIRST_FOR_ALL = 3 };

    for (unsigned i = 0; i < COUNT(TALKS); i++)
        for (unsigned f = 0; f < COUNT(framings); f++)
            for (unsigned w = 0; w < WAITS; w++) {
                if (framings[f] != MBM_FRAMING_TCP &&
                    (w < FIRST_FOR_ALL || (w == 3 && framings[f] == MBM_FRAMING_ASCII)))
                    continue;
                begin_peer(framings[f], is_of_link(w), TALKS[i].bytes, TALKS[i].count, 7);
                set_wait(w);
                for (unsigned round = 0; round < 4; round++) {
                    queue_read(&request);
                    if (until_end(&request) > 4 * MOST_MS || peer.most_reads > MOST_READS)
                        fail_msg("%s, framing %d, setting %u", TALKS[i].what, framings[f], w);
                }
            }
}

/* After a request that was cancelled the next one rests until its unit is clean. */
TEST(a_request_after_a_cancelled_one_ends)
{
    for (unsigned i = 0; i < COUNT(TALKS); i++)
        for (unsigned f = 0; f < COUNT(framings); f++) {
            begin_peer(framings[f], 0, TALKS[i].bytes, TALKS[i].count, 0);
            queue_read(&request);
            while (peer.sent == 0 && m.now < STEPS * MS) {
                (void)mbm_client_poll(&client);
                m.now += MS;
            }
            for (unsigned step = 0; step < 20; step++, m.now += MS)
                (void)mbm_client_poll(&client);
            OK(mbm_client_cancel(&client, &request));
            peer.piece = 7;
            queue_read(&request);
            if (until_end(&request) > MOST_MS)
                fail_msg("%s, framing %d", TALKS[i].what, framings[f]);
        }
}

TEST(a_poll_of_an_idle_link_ends)
{
    for (unsigned i = 0; i < COUNT(TALKS); i++)
        for (unsigned f = 0; f < COUNT(framings); f++) {
            begin_peer(framings[f], 1, TALKS[i].bytes, TALKS[i].count, 1);
            for (unsigned step = 0; step < 100; step++, m.now += MS) {
                peer.reads = 0;
                (void)mbm_client_poll(&client);
                assert_in_range(peer.reads, 0, MOST_READS);
            }
        }
}

/* --- a master, which waits in its call --- */

TEST(a_blocking_call_ends_whatever_arrives_without_a_pause)
{
    static mbm_line line;
    static mbm_node node;

    for (unsigned i = 0; i < COUNT(TALKS); i++)
        for (size_t piece = 1; piece <= 100; piece *= 10) {
            const mbm_port port =
                talker_begin(&peer, TALKS[i].bytes, TALKS[i].count, piece, &m.now);

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
