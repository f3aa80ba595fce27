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
