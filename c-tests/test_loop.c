/* One wait for many clients, links and servers: over TCP with libmodbus's replies, on a serial line
 * beside libmodbus's server, and over UDP. */
#define _GNU_SOURCE
#include "await.h"
#include "skip.h"
#include "mbm_loop.h"
#include "server.h"
#include "tcp_peer.h"
#include "tcp_server.h"
#include "test.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum { PEERS = 4, CLIENTS = PEERS * TCP_PEER_CONNECTIONS, PLACES = 200, UNIT = 17, MS = 1000 };

typedef struct device {
    mbm_tcp tcp;
    mbm_tcp_addresses addresses;
    mbm_client client;
    mbm_link link;
    mbm_linkCounters counters;
    mbm_clientRequest request;
    mbm_loop_entry entry;
    uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
    uint16_t words[4], address;
    unsigned left, right, failed; /* requests that are still to be made, and those that ended */
} device;

static mbm_loop loop;
static mbm_loop_place places[PLACES];
static device devices[CLIENTS];
static tcp_peer *peers[PEERS];
static uint16_t ports[PEERS];
static struct rlimit found;

static void begin(void)
{
    alarm(3 * PATIENCE_MS / 1000);
    memset(&loop, 0, sizeof loop);
    memset(devices, 0, sizeof devices);
    memset(peers, 0, sizeof peers);
    assert_int_equal(getrlimit(RLIMIT_NOFILE, &found), 0);
    assert_int_equal(mbm_loop_open(&loop, places, PLACES), 0);
}

static void end(void)
{
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &found), 0);
    for (unsigned i = 0; i < CLIENTS; i++) {
        mbm_loop_remove(&devices[i].entry);
        mbm_tcp_close(&devices[i].tcp);
    }
    for (unsigned i = 0; i < PEERS; i++)
        if (peers[i])
            tcp_peer_stop(peers[i]);
    assert_int_equal(loop.count, 0);
    assert_int_equal(mbm_loop_pollDelay(&loop), MBM_LOOP_FOREVER);
    mbm_loop_close(&loop);
    mbm_loop_close(&loop);
    alarm(0);
}

static void start_peers(unsigned count)
{
    for (unsigned i = 0; i < count; i++) {
        peers[i] = tcp_peer_new();
        ports[i] = tcp_peer_start(peers[i], 0);
    }
}

static void ask(device *d)
{
    if (d->left == 0)
        return;
    d->left--;
    d->address = (uint16_t)(d->left % 100);
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&d->client, &d->request, d->address, 4));
}

static void done(void *context, mbm_clientRequest *request)
{
    device *d = (device *)context;

    if (request->status != MBM_OK) {
        d->failed++;
    } else {
        assert_int_equal(d->words[0], tcp_peer_word(d->address));
        assert_int_equal(d->words[3], tcp_peer_word(d->address + 3u));
        d->right++;
    }
    ask(d);
}

/* Adds a client with a link to a port of this machine. The client makes `requests` requests. */
static void begin_device(device *d, uint16_t at, unsigned requests)
{
    const mbm_linkHooks hooks = mbm_tcp_link(&d->tcp);
    const mbm_port port = mbm_tcp_port(&d->tcp);
    char service[8];

    snprintf(service, sizeof service, "%u", at);
    assert_int_equal(mbm_tcp_openLater(&d->tcp, &d->addresses, "127.0.0.1", service), 0);
    OK(mbm_client_beginTcp(&d->client, &port, d->incoming, sizeof d->incoming, d->outgoing,
                           sizeof d->outgoing));
    OK(mbm_client_setResponseTimeout(&d->client, PATIENCE_MS));
    OK(mbm_link_begin(&d->link, &d->client, &hooks));
    OK(mbm_link_setBackoff(&d->link, MBM_BACKOFF_EXPONENTIAL, 5, 20));
    OK(mbm_link_setCounters(&d->link, &d->counters));
    OK(mbm_link_setRequestsWait(&d->link, 1));
    d->request = (mbm_clientRequest){
        .unit = UNIT, .reply = d->words, .replyBytes = sizeof d->words, .done = done, .context = d};
    d->entry.poll = mbm_loop_pollClient;
    d->entry.context = &d->client;
    d->left = requests;
    ask(d);
    assert_int_equal(mbm_loop_addTcp(&loop, &d->entry, &d->tcp), 0);
}

static void begin_devices(unsigned count, unsigned requests)
{
    for (unsigned i = 0; i < count; i++)
        begin_device(&devices[i], ports[i / TCP_PEER_CONNECTIONS], requests);
}

static int all_are_right(unsigned count, unsigned requests)
{
    for (unsigned i = 0; i < count; i++)
        if (devices[i].right < requests)
            return 0;
    return 1;
}

/* --- over TCP --- */

TEST_WITH(many_clients_are_served_by_one_wait, begin, end)
{
    enum { REQUESTS = 50 };

    start_peers(PEERS);
    begin_devices(CLIENTS, REQUESTS);
    LOOP_UNTIL(&loop, all_are_right(CLIENTS, REQUESTS));
    for (unsigned i = 0; i < CLIENTS; i++) {
        assert_int_equal(devices[i].right, REQUESTS);
        assert_int_equal(devices[i].failed, 0);
        assert_int_equal(devices[i].counters.connected, 1);
    }
}

TEST_WITH(a_client_that_gets_no_answer_ends_while_others_are_busy, begin, end)
{
    device *silent = &devices[TCP_PEER_CONNECTIONS];
    uint16_t port;
    int listener = tcp_listenOnFree(&port);

    start_peers(1);
    begin_devices(TCP_PEER_CONNECTIONS, 1000000);
    begin_device(silent, port, 1);
    silent->request.timeoutMs = 0;
    OK(mbm_client_setResponseTimeout(&silent->client, 150));
    uint32_t from = mbm_tcp_port(&silent->tcp).micros(&silent->tcp);
    LOOP_UNTIL(&loop, silent->failed == 1);
    IS(MBM_RESPONSE_TIMED_OUT, silent->request.status);
    assert_true(mbm_tcp_port(&silent->tcp).micros(&silent->tcp) - from >= 150 * MS);
    assert_true(devices[0].right > 0 && devices[0].failed == 0);
    close(listener);
}

TEST_WITH(a_link_that_is_lost_is_opened_and_waited_for_again, begin, end)
{
    start_peers(1);
    begin_devices(4, 5);
    LOOP_UNTIL(&loop, all_are_right(4, 5));
    for (unsigned round = 2; round <= 4; round++) {
        if (round % 2 == 0) {
            tcp_peer_hang_up(peers[0]);
        } else {
            tcp_peer_halt(peers[0]);
            LOOP_UNTIL(&loop, devices[0].counters.failed > 2 && devices[3].counters.failed > 2);
            assert_int_equal(tcp_peer_start(peers[0], ports[0]), ports[0]);
        }
        for (unsigned i = 0; i < 4; i++)
            LOOP_UNTIL(&loop, devices[i].counters.connected >= round);
        for (unsigned i = 0; i < 4; i++) {
            devices[i].right = devices[i].failed = 0;
            devices[i].left = 5;
            ask(&devices[i]);
            mbm_loop_wake(&devices[i].entry);
        }
        LOOP_UNTIL(&loop, all_are_right(4, 5));
    }
    for (unsigned i = 0; i < 4; i++)
        assert_true(devices[i].counters.lost >= 3);
}

TEST_WITH(a_request_that_is_queued_outside_needs_a_wake, begin, end)
{
    start_peers(1);
    begin_devices(1, 0);
    LOOP_UNTIL(&loop, devices[0].counters.connected == 1);
    devices[0].left = 2;
    ask(&devices[0]);
    mbm_loop_wake(&devices[0].entry);
    mbm_loop_wake(&devices[0].entry);
    assert_int_equal(mbm_loop_pollDelay(&loop), 0);
    LOOP_UNTIL(&loop, devices[0].right == 2);
}

TEST_WITH(without_a_descriptor_links_wait_and_connect_later, begin, end)
{
    struct rlimit limit;

    SKIP_WITHOUT_LIMITS();
    start_peers(1);
    int next = dup(0);
    close(next);
    limit = (struct rlimit){(rlim_t)next + 2, found.rlim_max};
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &limit), 0);
    begin_devices(4, 5);
    /* Each end of a connection takes one. */
    for (int i = 0; i < 200; i++)
        assert_true(mbm_loop_wait(&loop, 1000) >= 0);
    assert_true(devices[3].counters.failed > 0);
    assert_int_equal(devices[3].tcp.error, EMFILE);
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &found), 0);
    LOOP_UNTIL(&loop, all_are_right(4, 5));
}

/* --- entries that come and go --- */

enum { PIPES = 100 };

typedef struct inlet {
    mbm_loop_entry entry;
    int ends[2];
    unsigned polls;
    void (*within)(struct inlet *own);
} inlet;

static inlet inlets[PIPES];

static uint32_t poll_inlet(mbm_loop_entry *entry)
{
    inlet *own = (inlet *)(void *)entry;

    own->polls++;
    if (own->within)
        own->within(own);
    return MBM_LOOP_FOREVER;
}

static void add_inlet(inlet *one)
{
    one->entry.poll = poll_inlet;
    assert_int_equal(mbm_loop_addFd(&loop, &one->entry, one->ends[0]), 0);
}

static void begin_inlets(void)
{
    begin();
    memset(inlets, 0, sizeof inlets);
    for (unsigned i = 0; i < PIPES; i++)
        assert_int_equal(pipe2(inlets[i].ends, O_CLOEXEC | O_NONBLOCK), 0);
}

static void end_inlets(void)
{
    for (unsigned i = 0; i < PIPES; i++) {
        mbm_loop_remove(&inlets[i].entry);
        close(inlets[i].ends[0]);
        close(inlets[i].ends[1]);
    }
    end();
}

fixture each_test = {begin_inlets, end_inlets};

static void make_ready(unsigned i)
{
    assert_int_equal(write(inlets[i].ends[1], "x", 1), 1);
}

static void read_one(inlet *own)
{
    char byte;

    assert_int_equal(read(own->ends[0], &byte, 1), 1);
}

TEST(descriptors_that_are_always_ready_keep_no_other_waiting)
{
    for (unsigned i = 0; i < PIPES; i++)
        add_inlet(&inlets[i]);
    assert_int_equal(mbm_loop_wait(&loop, 0), PIPES);
    for (unsigned i = 0; i < PIPES; i++)
        make_ready(i);
    for (unsigned i = 0; i < 20; i++)
        assert_int_equal(mbm_loop_wait(&loop, MBM_LOOP_FOREVER), MBM_LOOP_READY);
    for (unsigned i = 0; i < PIPES; i++)
        assert_in_range(inlets[i].polls, 1 + 20 * MBM_LOOP_READY / PIPES - 1,
                        1 + 20 * MBM_LOOP_READY / PIPES + 1);
}

static void remove_all_others(inlet *own)
{
    for (unsigned i = 0; i < 10; i++) {
        if (&inlets[i] == own)
            continue;
        mbm_loop_remove(&inlets[i].entry);
        /* Its storage is free. */
        memset(&inlets[i].entry, 0xA5, sizeof inlets[i].entry);
    }
    own->within = NULL;
}

/* Adds all but one, and has each remove the others when it is polled. */
static void add_inlets_but(const inlet *that)
{
    for (unsigned i = 0; i < 10; i++)
        if (&inlets[i] != that) {
            memset(&inlets[i].entry, 0, sizeof inlets[i].entry);
            add_inlet(&inlets[i]);
        }
}

TEST(an_entry_that_was_removed_in_the_poll_of_another_is_not_polled)
{
    add_inlets_but(NULL);
    for (unsigned i = 0; i < 10; i++) {
        make_ready(i);
        inlets[i].within = remove_all_others;
    }
    /* The first is polled because it was added, and because it is ready. */
    assert_int_equal(mbm_loop_wait(&loop, 0), 2);
    assert_int_equal(inlets[0].polls, 2);
    assert_int_equal(loop.count, 1);
    for (unsigned i = 1; i < 10; i++) {
        assert_int_equal(inlets[i].polls, 0);
        inlets[i].within = NULL;
    }
    add_inlets_but(&inlets[0]);
    assert_int_equal(mbm_loop_wait(&loop, 0), 9 + 10);
    inlets[4].within = remove_all_others;
    /* Those that were ready before it are polled, those after it are not. */
    assert_in_range(mbm_loop_wait(&loop, 0), 1, 10);
    assert_int_equal(loop.count, 1);
    assert_int_equal(mbm_loop_wait(&loop, 0), 1);
    for (unsigned i = 0; i < 10; i++)
        if (i != 4)
            memset(&inlets[i].entry, 0, sizeof inlets[i].entry);
}

static void remove_self(inlet *own)
{
    mbm_loop_remove(&own->entry);
    memset(&own->entry, 0, sizeof own->entry);
    add_inlet(own + 1);
    mbm_loop_wake(&own->entry);
}

TEST(an_entry_removes_itself_and_adds_another_in_its_poll)
{
    inlets[0].within = inlets[1].within = remove_self;
    add_inlet(&inlets[0]);
    assert_int_equal(mbm_loop_wait(&loop, MBM_LOOP_FOREVER), 1);
    assert_int_equal(mbm_loop_wait(&loop, MBM_LOOP_FOREVER), 1);
    assert_int_equal(mbm_loop_wait(&loop, MBM_LOOP_FOREVER), 1);
    make_ready(0);
    make_ready(1);
    make_ready(2);
    assert_int_equal(mbm_loop_wait(&loop, MBM_LOOP_FOREVER), 1);
    assert_int_equal(inlets[0].polls, 1);
    assert_int_equal(inlets[1].polls, 1);
    assert_int_equal(inlets[2].polls, 2);
    assert_int_equal(loop.count, 1);
}

static void wait_within(inlet *own)
{
    FAILS(EBUSY, mbm_loop_wait(&loop, 0));
    mbm_loop_close(&loop);
    read_one(own);
}

TEST(the_loop_cannot_wait_or_end_within_a_poll)
{
    make_ready(0);
    inlets[0].within = wait_within;
    add_inlet(&inlets[0]);
    make_ready(0);
    assert_int_equal(mbm_loop_wait(&loop, 0), 2);
    assert_int_equal(mbm_loop_wait(&loop, 0), 0);
}

TEST(the_wait_ends_when_its_time_is_over)
{
    struct timespec from, to;

    add_inlet(&inlets[0]);
    assert_int_equal(mbm_loop_wait(&loop, 0), 1);
    clock_gettime(CLOCK_MONOTONIC, &from);
    assert_int_equal(mbm_loop_wait(&loop, 3 * MS), 0);
    assert_int_equal(mbm_loop_wait(&loop, 120 * MS), 0);
    clock_gettime(CLOCK_MONOTONIC, &to);
    assert_true((to.tv_sec - from.tv_sec) * 1000000000LL + (to.tv_nsec - from.tv_nsec) >=
                123 * 1000000LL);
}

TEST(another_loop_can_wait_for_this_one)
{
    struct pollfd wait;

    inlets[0].within = NULL;
    add_inlet(&inlets[0]);
    assert_int_equal(mbm_loop_pollDelay(&loop), 0);
    assert_int_equal(mbm_loop_wait(&loop, 0), 1);
    wait = (struct pollfd){mbm_loop_fd(&loop), POLLIN, 0};
    assert_int_equal(poll(&wait, 1, 0), 0);
    make_ready(0);
    assert_int_equal(poll(&wait, 1, PATIENCE_MS), 1);
    assert_int_equal(mbm_loop_wait(&loop, 0), 1);
}

TEST(a_call_that_is_refused_changes_nothing)
{
    static mbm_loop closed, other;
    static mbm_loop_place one_place[1];
    static mbm_udp udp;
    static mbm_tty tty;
    static mbm_tcp tcp;
    static mbm_tcp_listener listener, second;
    mbm_loop_entry entry = {0}, another = {0};

    FAILS(EBUSY, mbm_loop_open(&loop, places, PLACES));
    FAILS(EINVAL, mbm_loop_open(&closed, NULL, 1));
    FAILS(EINVAL, mbm_loop_open(&closed, one_place, 0));
    FAILS(EBADF, mbm_loop_wait(&closed, 0));
    FAILS(EINVAL, mbm_loop_addFd(&loop, &entry, -1));
    entry.poll = another.poll = poll_inlet;
    FAILS(EBADF, mbm_loop_addFd(&closed, &entry, -1));
    FAILS(EBADF, mbm_loop_addTcp(&loop, &entry, &tcp));
    FAILS(EBADF, mbm_loop_addTty(&loop, &entry, &tty));
    FAILS(EBADF, mbm_loop_addUdp(&loop, &entry, &udp));
    FAILS(EBADF, mbm_loop_addListener(&loop, &entry, &listener));
    int file = open("/proc/self/exe", O_RDONLY | O_CLOEXEC);
    FAILS(EPERM, mbm_loop_addFd(&loop, &entry, file));
    close(file);
    FAILS(EBADF, mbm_loop_addFd(&loop, &entry, file));
    mbm_loop_wake(&entry);
    mbm_loop_remove(&entry);
    assert_int_equal(loop.count, 0);
    assert_int_equal(mbm_loop_wait(&loop, 0), 0);
    /* An entry or a port is in one loop only. */
    assert_int_equal(mbm_loop_open(&other, one_place, 1), 0);
    assert_int_equal(mbm_loop_addFd(&loop, &inlets[0].entry, -1), -1);
    add_inlet(&inlets[0]);
    FAILS(EBUSY, mbm_loop_addFd(&other, &inlets[0].entry, inlets[0].ends[0]));
    assert_int_equal(mbm_udp_listen(&udp, "127.0.0.1", "0"), 0);
    assert_int_equal(mbm_loop_addUdp(&loop, &entry, &udp), 0);
    FAILS(EBUSY, mbm_loop_addUdp(&other, &another, &udp));
    mbm_loop_remove(&entry);
    assert_int_equal(mbm_loop_addUdp(&other, &another, &udp), 0);
    FAILS(ENOSPC, mbm_loop_addFd(&other, &entry, -1));
    mbm_loop_remove(&another);
    mbm_udp_close(&udp);
    assert_int_equal(mbm_tcp_attach(&tcp, socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)), 0);
    assert_int_equal(mbm_loop_addTcp(&other, &another, &tcp), 0);
    FAILS(EBUSY, mbm_loop_addTcp(&loop, &entry, &tcp));
    mbm_loop_remove(&another);
    assert_int_equal(mbm_loop_addTcp(&loop, &entry, &tcp), 0);
    mbm_loop_remove(&entry);
    mbm_tcp_close(&tcp);
    assert_int_equal(mbm_tcp_listen(&listener, "127.0.0.1", "0"), 0);
    assert_int_equal(mbm_tcp_listen(&second, "127.0.0.1", "0"), 0);
    assert_int_equal(mbm_loop_addListener(&loop, &entry, &listener), 0);
    FAILS(EBUSY, mbm_loop_addListener(&loop, &another, &second));
    mbm_loop_remove(&entry);
    assert_int_equal(mbm_loop_addListener(&loop, &another, &second), 0);
    mbm_loop_remove(&another);
    mbm_tcp_closeListener(&listener);
    mbm_tcp_closeListener(&second);
    mbm_loop_close(&other);
}
