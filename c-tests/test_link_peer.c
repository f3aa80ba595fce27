/* A client's link against real peers: libmodbus's replies over TCP, and a libmodbus server on
 * a pty. The peers go away, while the client is idle and while requests are in flight, and
 * come back. */
#define _GNU_SOURCE
#include "await.h"
#include "client.h"
#include "server.h"
#include "tcp_peer.h"
#include "test.h"

#include <unistd.h>

enum { FIRST_MS = 20, MOST_MS = 100, UNIT = 17, MANY = 10 };

static asker a;
static mbm_link kept;
static mbm_linkCounters counters;
static tcp_peer *peer;
static uint16_t port;
static mbm_clientRequest requests[MANY];
static uint16_t words[MANY][2];

static void keep(const mbm_linkHooks *hooks)
{
    memset(&counters, 0, sizeof counters);
    memset(&kept, 0, sizeof kept);
    OK(mbm_link_begin(&kept, &a.client, hooks));
    OK(mbm_link_setBackoff(&kept, MBM_BACKOFF_EXPONENTIAL, FIRST_MS, MOST_MS));
    OK(mbm_link_setCounters(&kept, &counters));
}

/* Waits as a program does: for bytes, for the end of the link, or until the next poll. */
static void poll_once(void)
{
    const uint32_t delay = mbm_client_pollDelay(&a.client);

    if (a.service[0])
        mbm_tcp_wait(&a.tcp, 1, NULL, -1, delay);
    else if (a.tty.isOpen)
        mbm_tty_wait(&a.tty, delay);
    else
        usleep(delay < 100000 ? delay : 100000);
    (void)mbm_client_poll(&a.client);
}

/* Polls until a condition holds. */
#define UNTIL(condition)                                                                           \
    do {                                                                                           \
        unsigned polls_ = 0;                                                                       \
                                                                                                   \
        while (!(condition)) {                                                                     \
            if (polls_++ == 100000)                                                                \
                fail_msg("this did not happen: %s", #condition);                                   \
            poll_once();                                                                           \
        }                                                                                          \
    } while (0)

static void begin_tcp(void)
{
    peer = tcp_peer_new();
    port = tcp_peer_start(peer, 0);
    asker_begin_tcp(&a, port);
    mbm_linkHooks hooks = mbm_tcp_link(&a.tcp);
    keep(&hooks);
    UNTIL(mbm_link_state(&kept) == MBM_LINK_IS_UP);
}

static void end_tcp(void)
{
    mbm_tcp_close(&a.tcp);
    tcp_peer_stop(peer);
}

fixture each_test = {begin_tcp, end_tcp};

static void queue_read(unsigned i)
{
    requests[i] = asker_request(UNIT, words[i], sizeof words[i], NULL);
    memset(words[i], 0, sizeof words[i]);
    IS(MBM_PENDING,
       mbm_client_readHoldingRegisters(&a.client, &requests[i], (uint16_t)(10 * i), 2));
}

static void read_over_tcp(unsigned i)
{
    queue_read(i);
    UNTIL(requests[i].status != MBM_PENDING);
    IS(MBM_OK, requests[i].status);
    assert_int_equal(words[i][1], tcp_peer_word(10 * i + 1));
}

TEST(a_connection_that_the_server_closes_is_opened_again_while_idle)
{
    read_over_tcp(0);
    for (unsigned i = 1; i < 4; i++) {
        tcp_peer_hang_up(peer);
        UNTIL(counters.lost == i);
        UNTIL(counters.connected == i + 1);
        assert_int_equal(mbm_client_isConnected(&a.client), 1);
        read_over_tcp(i);
    }
    assert_int_equal(tcp_peer_count(peer).connections, 4);
    assert_int_equal(counters.failed, 0);
}

TEST(a_request_after_the_server_has_hung_up_is_sent_once_over_a_new_connection)
{
    OK(mbm_link_setBackoff(&kept, MBM_BACKOFF_FIXED, 1000000, 1000000));
    read_over_tcp(0);
    for (unsigned i = 1; i < MANY; i++) {
        tcp_peer_hang_up(peer);
        /* With and without a poll between. */
        if (i % 2)
            UNTIL(counters.lost == i);
        else
            AWAIT(mbm_tcp_isConnected(&a.tcp) < 0);
        read_over_tcp(i);
        assert_int_equal(counters.connected, i + 1);
        assert_int_equal(tcp_peer_count(peer).requests, i + 1);
    }
    assert_int_equal(counters.failed, 0);
}

TEST(a_server_that_answers_no_more_is_connected_to_anew)
{
    OK(mbm_client_setResponseTimeout(&a.client, 100));
    read_over_tcp(0);
    tcp_peer_fault(peer, 2, FAULT_DROP, 0);
    tcp_peer_fault(peer, 3, FAULT_DROP, 0);
    for (unsigned n = 1; n <= 2; n++) {
        queue_read(n);
        UNTIL(requests[n].status != MBM_PENDING);
        IS(MBM_RESPONSE_TIMED_OUT, requests[n].status);
    }
    OK(mbm_client_setResponseTimeout(&a.client, PATIENCE_MS));
    read_over_tcp(3);
    assert_int_equal(tcp_peer_count(peer).connections, 2);
    assert_int_equal(tcp_peer_count(peer).requests, 4);
}

TEST(the_loss_wakes_a_program_that_waits_for_an_hour)
{
    read_over_tcp(0);
    tcp_peer_hang_up(peer);
    assert_int_equal(mbm_tcp_wait(&a.tcp, 1, NULL, -1, 3600000000u), 1);
    (void)mbm_client_poll(&a.client);
    assert_int_equal(counters.lost, 1);
    assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_DOWN);
}

TEST(a_server_that_was_away_is_found_again)
{
    unsigned i;

    read_over_tcp(0);
    tcp_peer_halt(peer);
    UNTIL(counters.failed >= 3);
    assert_int_equal(counters.lost, 1);
    assert_int_equal(a.tcp.error != 0, 1);
    /* Without a server, requests end. */
    queue_read(1);
    UNTIL(requests[1].status != MBM_PENDING);
    IS(MBM_LINK_LOST, requests[1].status);
    /* If they may wait, they are sent once the server is back. */
    OK(mbm_link_setRequestsWait(&kept, 1));
    for (i = 0; i < MANY; i++)
        queue_read(i);
    i = counters.failed;
    UNTIL(counters.failed == i + 2);
    assert_int_equal(mbm_client_pending(&a.client), MANY);
    tcp_peer_start(peer, port);
    UNTIL(mbm_client_pending(&a.client) == 0);
    for (i = 0; i < MANY; i++) {
        IS(MBM_OK, requests[i].status);
        assert_int_equal(words[i][1], tcp_peer_word(10 * i + 1));
    }
    assert_int_equal(counters.connected, 2);
}

TEST(requests_in_flight_when_the_server_dies_end_and_the_others_wait)
{
    unsigned i, lost = 0;

    OK(mbm_link_setRequestsWait(&kept, 1));
    OK(mbm_client_setInFlight(&a.client, 4));
    /* The first two are answered, then the server resets the connection. */
    tcp_peer_fault(peer, 3, FAULT_RESET, 0);
    for (i = 0; i < MANY; i++)
        queue_read(i);
    UNTIL(mbm_client_pending(&a.client) == 0);
    for (i = 0; i < MANY; i++)
        if (requests[i].status == MBM_LINK_LOST)
            lost++;
        else
            IS(MBM_OK, requests[i].status);
    assert_in_range(lost, 1, 4);
    assert_int_equal(counters.lost, 1);
    assert_int_equal(counters.connected, 2);
}

TEST(half_a_reply_before_the_loss_does_not_disturb_the_next_connection)
{
    tcp_peer_fault(peer, 1, FAULT_HALF, 7);
    queue_read(0);
    UNTIL(requests[0].status != MBM_PENDING);
    IS(MBM_LINK_LOST, requests[0].status);
    UNTIL(counters.connected == 2);
    read_over_tcp(1);
    assert_int_equal(a.counters.resynchronisations, 0);
}

/* A terminal whose far end is a libmodbus server, while there is one. */
static server far_end;
static int is_there;

static uint8_t open_tty(void *context)
{
    return is_there && mbm_tty_attach(&a.tty, dup(far_end.line.ours)) == 0 ? MBM_OK : MBM_LINK_LOST;
}

static void close_tty(void *context)
{
    mbm_tty_close(&a.tty);
}

static uint8_t status_of_tty(void *context)
{
    return a.tty.isOpen ? MBM_OK : MBM_LINK_LOST;
}

static void come(void)
{
    memset(&far_end, 0, sizeof far_end);
    server_start(&far_end, UNIT);
    is_there = 1;
}

static void go(void)
{
    is_there = 0;
    server_stop(&far_end);
}

static void read_over_tty(void)
{
    queue_read(3);
    UNTIL(requests[3].status != MBM_PENDING);
    IS(MBM_OK, requests[3].status);
    assert_int_equal(words[3][1], server_pattern(31));
}

TEST_WITH(a_terminal_that_is_unplugged_is_opened_again, NULL, NULL)
{
    const mbm_linkHooks hooks = {NULL, close_tty, open_tty, status_of_tty};

    come();
    asker_begin_rtu(&a, dup(far_end.line.ours));
    keep(&hooks);
    for (unsigned i = 1; i < 3; i++) {
        read_over_tty();
        assert_int_equal(counters.connected, i);
        go();
        UNTIL(counters.lost == i);
        UNTIL(counters.failed >= 2 * i);
        come();
        UNTIL(counters.connected == i + 1);
    }
    read_over_tty();
    go();
    UNTIL(counters.lost == 3);
}

TEST_WITH(a_terminal_that_is_unplugged_during_a_request_ends_it, NULL, NULL)
{
    const mbm_linkHooks hooks = {NULL, close_tty, open_tty, status_of_tty};

    come();
    asker_begin_rtu(&a, dup(far_end.line.ours));
    keep(&hooks);
    OK(mbm_link_setRequestsWait(&kept, 1));
    read_over_tty();
    /* No device answers the first request. So it is in flight, and the second waits. */
    requests[3] = asker_request(UNIT + 1, words[3], sizeof words[3], NULL);
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&a.client, &requests[3], 0, 2));
    queue_read(4);
    do
        (void)mbm_client_poll(&a.client);
    while (a.counters.requests < 2);
    go();
    UNTIL(counters.lost == 1);
    UNTIL(requests[3].status != MBM_PENDING);
    IS(MBM_LINK_LOST, requests[3].status);
    come();
    UNTIL(requests[4].status != MBM_PENDING);
    IS(MBM_OK, requests[4].status);
    assert_int_equal(words[4][1], server_pattern(41));
    OK(mbm_link_end(&kept));
    mbm_tty_close(&a.tty);
    go();
}
