/* A set of sockets: one wait for any number of them, which says which of them are ready. */
#define _GNU_SOURCE
#include "await.h"
#include "skip.h"
#include "mbm_tcp.h"
#include "tcp_peer.h"
#include "tcp_server.h"
#include "tcp_waiting.h"
#include "test.h"

#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

enum { MANY = 300, PLACES = 3, MINUTE_MS = 60000 };

static mbm_tcp_set set;
static mbm_tcp_listener listener;
static mbm_tcp tcps[MANY];
static int peers[MANY];
static unsigned peer_count;
static int taken = -1; /* the listener's spare descriptor, if the test took it away */
static struct rlimit found;
static time_t ahead;            /* seconds by which the clock of the port is fast */
static struct timespec stopped; /* the time at which it stands still, or 0: it runs */
static long look_ms;            /* milliseconds that each read of a clock that stands still takes */

/* This function replaces that of libc. */
int clock_gettime(clockid_t id, struct timespec *time)
{
    const int result = (int)syscall(SYS_clock_gettime, id, time);

    if (result == 0)
        time->tv_sec += ahead;
    if (result == 0 && stopped.tv_sec) {
        stopped.tv_nsec += look_ms * 1000000;
        *time = stopped;
    }
    return result;
}

static void begin(void)
{
    alarm(3 * PATIENCE_MS / 1000);
    ahead = 0;
    stopped = (struct timespec){0};
    look_ms = 0;
    peer_count = 0;
    memset(&set, 0, sizeof set);
    memset(&listener, 0, sizeof listener);
    memset(tcps, 0, sizeof tcps);
    assert_int_equal(getrlimit(RLIMIT_NOFILE, &found), 0);
    assert_int_equal(mbm_tcp_openSet(&set), 0);
}

static void end(void)
{
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &found), 0);
    for (unsigned i = 0; i < MANY; i++)
        mbm_tcp_close(&tcps[i]);
    for (unsigned i = 0; i < peer_count; i++)
        close(peers[i]);
    mbm_tcp_closeListener(&listener);
    if (taken >= 0)
        close(taken);
    taken = -1;
    mbm_tcp_closeSet(&set);
    mbm_tcp_closeSet(&set);
    alarm(0);
}

fixture each_test = {begin, end};

/* Puts `count` sockets into the set, each connected with a peer. */
static void fill(unsigned count)
{
    int pair[2];

    while (count-- > 0) {
        assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, pair), 0);
        assert_int_equal(mbm_tcp_attach(&tcps[peer_count], pair[0]), 0);
        assert_int_equal(mbm_tcp_add(&set, &tcps[peer_count]), 0);
        peers[peer_count++] = pair[1];
    }
}

static void peer_sends(unsigned place, const char *text)
{
    assert_int_equal(write(peers[place], text, strlen(text)), strlen(text));
}

static int16_t read_some(unsigned place, uint16_t most)
{
    const mbm_port port = mbm_tcp_port(&tcps[place]);
    uint8_t bytes[16];

    return port.read(port.context, bytes, most);
}

static int is_lost(unsigned place)
{
    return read_some(place, 1) < 0;
}

/* Expects that the wait reports this socket and no other. */
static void expect_ready(const mbm_tcp *tcp)
{
    assert_int_equal(mbm_tcp_waitSet(&set, MBM_TCP_FOREVER), 1);
    assert_ptr_equal(mbm_tcp_nextReady(&set), tcp);
    assert_null(mbm_tcp_nextReady(&set));
}

static void expect_silence(void)
{
    assert_int_equal(mbm_tcp_waitSet(&set, 1000), 0);
    assert_null(mbm_tcp_nextReady(&set));
}

TEST_ROW(a_connection_takes_little_memory, assert_true(sizeof(mbm_tcp) <= 64))

TEST(the_wait_says_which_of_many_sockets_are_ready)
{
    uint8_t seen[MANY] = {0};
    unsigned i, count = 0;
    mbm_tcp *tcp;

    fill(MANY);
    expect_silence();
    peer_sends(7, "x");
    expect_ready(&tcps[7]);
    assert_int_equal(read_some(7, 16), 1);
    expect_silence();
    /* More sockets than one wait reports. */
    for (i = 0; i < MANY; i += 2)
        peer_sends(i, "x");
    while (count < MANY / 2) {
        assert_int_equal(mbm_tcp_waitSet(&set, MBM_TCP_FOREVER), 1);
        while ((tcp = mbm_tcp_nextReady(&set))) {
            i = (unsigned)(tcp - tcps);
            assert_int_equal(i % 2, 0);
            assert_int_equal(seen[i]++, 0);
            assert_int_equal(read_some(i, 16), 1);
            count++;
        }
    }
    expect_silence();
}

TEST(a_ready_socket_that_was_not_taken_is_reported_again)
{
    fill(2);
    peer_sends(0, "x");
    assert_int_equal(mbm_tcp_waitSet(&set, MBM_TCP_FOREVER), 1);
    peer_sends(1, "y");
    assert_int_equal(mbm_tcp_waitSet(&set, MBM_TCP_FOREVER), 1);
    assert_ptr_equal(mbm_tcp_nextReady(&set), &tcps[0]);
    assert_ptr_equal(mbm_tcp_nextReady(&set), &tcps[1]);
    assert_null(mbm_tcp_nextReady(&set));
}

TEST(bytes_that_are_not_read_do_not_end_the_wait_again)
{
    fill(2);
    peer_sends(0, "abcd");
    expect_ready(&tcps[0]);
    expect_silence();
    peer_sends(0, "e");
    expect_silence();
    /* Other sockets are reported as before. */
    peer_sends(1, "x");
    expect_ready(&tcps[1]);
    assert_int_equal(read_some(1, 16), 1);
    /* Once the program has used the port, the remaining bytes are reported. */
    assert_int_equal(read_some(0, 2), 2);
    expect_ready(&tcps[0]);
    assert_int_equal(read_some(0, 16), 3);
    expect_silence();
    /* Nor does the end of the stream end the wait again. */
    close(peers[0]);
    peers[0] = peers[--peer_count];
    expect_ready(&tcps[0]);
    expect_silence();
    assert_int_equal(is_lost(0), 1);
    expect_silence();
}

TEST(a_full_socket_is_ready_once_it_accepts_bytes_again)
{
    static uint8_t much[60000];

    fill(1);
    mbm_port port = mbm_tcp_port(&tcps[0]);
    peer_sends(0, "x");
    expect_ready(&tcps[0]);
    while (port.write(port.context, much, sizeof much) > 0)
        ;
    expect_silence();
    while (read(peers[0], much, sizeof much) > 0)
        ;
    expect_ready(&tcps[0]);
    /* After a complete write the socket is waited on for bytes again, and the byte from
     * before is still there. */
    assert_int_equal(port.write(port.context, much, 10), 10);
    expect_ready(&tcps[0]);
    assert_int_equal(read_some(0, 16), 1);
    expect_silence();
}

TEST(a_closed_socket_is_not_reported)
{
    fill(4);
    for (unsigned i = 0; i < 4; i++)
        peer_sends(i, "x");
    assert_int_equal(mbm_tcp_waitSet(&set, MBM_TCP_FOREVER), 1);
    mbm_tcp_close(&tcps[1]);
    mbm_tcp_close(&tcps[3]);
    assert_ptr_equal(mbm_tcp_nextReady(&set), &tcps[0]);
    mbm_tcp_close(&tcps[2]);
    assert_null(mbm_tcp_nextReady(&set));
    assert_int_equal(read_some(0, 16), 1);
    expect_silence();
    /* The same while another descriptor keeps the socket open, as in a child process. */
    int other = dup(tcps[0].fd);
    mbm_tcp_close(&tcps[0]);
    peer_sends(0, "x");
    expect_silence();
    close(other);
}

TEST(a_connection_is_reported_when_it_is_made_and_made_anew)
{
    tcp_peer *peer = tcp_peer_new();
    mbm_tcp_addresses addresses;
    char service[8];

    snprintf(service, sizeof service, "%u", tcp_peer_start(peer, 0));
    assert_int_equal(mbm_tcp_open(&tcps[0], &addresses, "127.0.0.1", service), 0);
    assert_int_equal(mbm_tcp_add(&set, &tcps[0]), 0);
    for (unsigned round = 0; round < 2; round++) {
        const uint8_t read_one[12] = {0, 1, 0, 0, 0, 6, 7, 3, 0, 5, 0, 1};
        const mbm_port port = mbm_tcp_port(&tcps[0]);

        while (mbm_tcp_isConnected(&tcps[0]) == 0)
            expect_ready(&tcps[0]);
        assert_int_equal(mbm_tcp_isConnected(&tcps[0]), 1);
        assert_int_equal(port.write(port.context, read_one, 12), 12);
        expect_ready(&tcps[0]);
        assert_int_equal(read_some(0, 16), 11);
        mbm_tcp_disconnect(&tcps[0]);
        expect_silence();
        assert_in_set(mbm_tcp_connect(&tcps[0]), ((const unsigned long[]){MBM_OK, MBM_PENDING}), 2);
    }
    mbm_tcp_close(&tcps[0]);
    tcp_peer_stop(peer);
}

TEST(a_failed_add_to_a_set_sets_errno)
{
    mbm_tcp_set closed = {0};

    FAILS(EBUSY, mbm_tcp_openSet(&set));
    FAILS(EBADF, mbm_tcp_waitSet(&closed, 0));
    FAILS(EBADF, mbm_tcp_add(&set, &tcps[0]));
    fill(1);
    FAILS(EBADF, mbm_tcp_add(&closed, &tcps[0]));
    FAILS(EBUSY, mbm_tcp_add(&set, &tcps[0]));
    FAILS(EBADF, mbm_tcp_addListener(&set, &listener));
    assert_int_equal(mbm_tcp_listen(&listener, "127.0.0.1", "0"), 0);
    assert_int_equal(mbm_tcp_addListener(&set, &listener), 0);
    FAILS(EBUSY, mbm_tcp_addListener(&set, &listener));
}

TEST(a_socket_that_has_left_its_set_is_waited_for_alone)
{
    fill(2);
    peer_sends(0, "abc");
    expect_ready(&tcps[0]);
    expect_silence();
    mbm_tcp_remove(&tcps[0]);
    mbm_tcp_remove(&tcps[0]);
    assert_int_equal(mbm_tcp_wait(&tcps[0], 1, NULL, -1, MBM_TCP_FOREVER), 1);
    assert_int_equal(read_some(0, 16), 3);
    peer_sends(0, "d");
    peer_sends(1, "e");
    expect_ready(&tcps[1]);
    assert_int_equal(mbm_tcp_add(&set, &tcps[0]), 0);
    expect_ready(&tcps[0]);
    /* It is not reported any more, though it was ready. */
    assert_int_equal(read_some(1, 16), 1);
    assert_int_equal(read_some(0, 16), 1);
    peer_sends(0, "f");
    peer_sends(1, "g");
    assert_int_equal(mbm_tcp_waitSet(&set, MBM_TCP_FOREVER), 1);
    mbm_tcp_remove(&tcps[0]);
    assert_ptr_equal(mbm_tcp_nextReady(&set), &tcps[1]);
    assert_null(mbm_tcp_nextReady(&set));
}

/* An object looks at the clock in each poll; a program need not. */
TEST(the_idle_time_counts_from_the_last_byte)
{
    const mbm_port port = mbm_tcp_port(&tcps[0]);

    fill(1);
    mbm_tcp_remove(&tcps[0]);
    for (unsigned i = 0; i < 300; i++) {
        peer_sends(0, "x");
        (void)port.micros(port.context);
        assert_int_equal(read_some(0, 1), 1);
        assert_in_range(mbm_tcp_idleFor(&tcps[0]), 0, MINUTE_MS);
    }
    assert_int_equal(port.write(port.context, (const uint8_t *)"y", 1), 1);
    ahead += 61;
    assert_in_range(mbm_tcp_idleFor(&tcps[0]), MINUTE_MS, 2 * MINUTE_MS);
    peer_sends(0, "x");
    assert_int_equal(read_some(0, 1), 1);
    assert_in_range(mbm_tcp_idleFor(&tcps[0]), 0, MINUTE_MS);
}

/* --- with a listener --- */

static void begin_to_listen(void)
{
    assert_int_equal(mbm_tcp_listen(&listener, "127.0.0.1", "0"), 0);
    assert_int_equal(mbm_tcp_addListener(&set, &listener), 0);
}

static void connect_some(unsigned count)
{
    tcp_connect_some(peers + peer_count, count, listener.fd, listener.port);
    peer_count += count;
}

static int accept_one(void)
{
    return mbm_tcp_accept(&listener, tcps, PLACES);
}

static void wait_for_connection(void)
{
    assert_int_equal(mbm_tcp_waitSet(&set, MBM_TCP_FOREVER), 1);
    assert_null(mbm_tcp_nextReady(&set));
}

static void take_all_places(void)
{
    connect_some(PLACES);
    wait_for_connection();
    for (int i = 0; i < PLACES; i++)
        assert_int_equal(accept_one(), i);
    FAILS(EAGAIN, accept_one());
}

TEST(an_accepted_connection_is_in_the_set_of_its_listener)
{
    begin_to_listen();
    FAILS(EAGAIN, accept_one());
    connect_some(1);
    wait_for_connection();
    assert_int_equal(accept_one(), 0);
    FAILS(EAGAIN, accept_one());
    peer_sends(0, "x");
    expect_ready(&tcps[0]);
    assert_int_equal(read_some(0, 16), 1);
    expect_silence();
    mbm_tcp_closeListener(&listener);
    peer_sends(0, "x");
    expect_ready(&tcps[0]);
}

TEST(accept_looks_only_once_the_set_knows_of_a_connection)
{
    begin_to_listen();
    FAILS(EAGAIN, accept_one());
    connect_some(1);
    FAILS(EAGAIN, accept_one());
    wait_for_connection();
    wait_for_connection();
    assert_int_equal(accept_one(), 0);
}

TEST(a_connection_that_is_closed_as_idle_is_ready)
{
    begin_to_listen();
    listener.idleTimeMs = MINUTE_MS;
    take_all_places();
    ahead = 61;
    peer_sends(0, "x");
    expect_ready(&tcps[0]);
    assert_int_equal(read_some(0, 16), 1);
    connect_some(1);
    wait_for_connection();
    FAILS(EAGAIN, accept_one());
    assert_int_equal(listener.idle, 1);
    /* The program of the idle connection frees the place, and the new connection takes it. */
    assert_int_equal(mbm_tcp_waitSet(&set, MBM_TCP_FOREVER), 1);
    assert_ptr_equal(mbm_tcp_nextReady(&set), &tcps[1]);
    assert_null(mbm_tcp_nextReady(&set));
    assert_int_equal(is_lost(1), 1);
    assert_int_equal(tcps[1].error, ETIMEDOUT);
    mbm_tcp_close(&tcps[1]);
    assert_int_equal(accept_one(), 1);
    FAILS(EAGAIN, accept_one());
    assert_int_equal(is_lost(0), 0);
    assert_int_equal(listener.refused, 0);
}

/* On a slow machine time passes while accept looks at the connections. */
TEST(of_connections_with_equal_idle_times_the_first_is_closed)
{
    begin_to_listen();
    listener.idleTimeMs = MINUTE_MS;
    stopped.tv_sec = 1000;
    take_all_places();
    stopped.tv_sec += 61;
    look_ms = 1;
    connect_some(1);
    wait_for_connection();
    FAILS(EAGAIN, accept_one());
    assert_int_equal(listener.idle, 1);
    assert_int_equal(is_lost(0), 1);
    assert_int_equal(is_lost(1), 0);
}

/* Takes the listener's spare descriptor away, and lowers the limit so that the next descriptor
 * would exceed it. */
static void leave_no_descriptor(void)
{
    const int next = dup(0);
    const struct rlimit limit = {(rlim_t)next, found.rlim_max};

    assert_true(next >= 0);
    close(next);
    taken = dup2(0, listener.spare);
    assert_true(taken > 0);
    listener.spare = 0;
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &limit), 0);
}

TEST(without_a_descriptor_the_set_sleeps_and_tries_again)
{
    SKIP_WITHOUT_LIMITS();
    begin_to_listen();
    connect_some(1);
    wait_for_connection();
    assert_int_equal(accept_one(), 0);
    connect_some(2);
    leave_no_descriptor();
    FAILS(EMFILE, accept_one());
    expect_silence();
    FAILS(EAGAIN, accept_one());
    /* The wait ends when it is time to try again. The connections are served meanwhile. */
    assert_int_equal(mbm_tcp_waitSet(&set, MBM_TCP_FOREVER), 0);
    while (accept_one() < 0 && errno == EAGAIN)
        assert_int_equal(mbm_tcp_waitSet(&set, MBM_TCP_FOREVER), 0);
    assert_int_equal(errno, EMFILE);
    peer_sends(0, "x");
    expect_ready(&tcps[0]);
    assert_int_equal(listener.refused, 0);
    /* A closed place frees a descriptor, and the waiting connection takes it without
     * waiting for that time. */
    ahead = -3600;
    mbm_tcp_close(&tcps[0]);
    assert_int_equal(mbm_tcp_waitSet(&set, MBM_TCP_FOREVER), 0);
    assert_int_equal(accept_one(), 0);
    FAILS(EMFILE, accept_one());
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &found), 0);
    ahead = 0;
    (void)mbm_tcp_waitSet(&set, MBM_TCP_FOREVER);
    assert_int_equal(accept_one(), 1);
}
