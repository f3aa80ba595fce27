/* A loop over ports other than clients over TCP: serial lines, UDP, and servers with their
 * listener. */
#define _GNU_SOURCE
#include "await.h"
#include "skip.h"
#include "mbm_loop.h"
#include "server.h"
#include "tcp_peer.h"
#include "tcp_server.h"
#include "test.h"

#include <fcntl.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

enum { PLACES = 8, UNIT = 17, WORDS = 10, BAUD = 115200 };

typedef struct asking {
    mbm_client client;
    mbm_link link;
    mbm_linkCounters counters;
    mbm_clientRequest request;
    mbm_loop_entry entry;
    uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
    uint16_t words[WORDS];
    unsigned left, right, failed, polls;
} asking;

static mbm_loop loop;
static mbm_loop_place storage[2 * PLACES];
static asking by_line, by_tcp, by_udp;
static mbm_tty tty;
static mbm_tcp tcp;
static mbm_tcp_addresses addresses;
static mbm_udp udp_client, udp_server;
static struct rlimit found;

static void begin(void)
{
    alarm(3 * PATIENCE_MS / 1000);
    memset(&loop, 0, sizeof loop);
    memset(&by_line, 0, sizeof by_line);
    memset(&by_tcp, 0, sizeof by_tcp);
    memset(&by_udp, 0, sizeof by_udp);
    memset(&tty, 0, sizeof tty);
    memset(&tcp, 0, sizeof tcp);
    memset(&udp_client, 0, sizeof udp_client);
    memset(&udp_server, 0, sizeof udp_server);
    assert_int_equal(getrlimit(RLIMIT_NOFILE, &found), 0);
    assert_int_equal(mbm_loop_open(&loop, storage, COUNT(storage)), 0);
}

static void end(void)
{
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &found), 0);
    mbm_loop_remove(&by_line.entry);
    mbm_loop_remove(&by_tcp.entry);
    mbm_loop_remove(&by_udp.entry);
    assert_int_equal(loop.count, 0);
    mbm_tty_close(&tty);
    mbm_tcp_close(&tcp);
    mbm_udp_close(&udp_client);
    mbm_udp_close(&udp_server);
    mbm_loop_close(&loop);
    alarm(0);
}

fixture each_test = {begin, end};

static uint32_t poll_client(mbm_loop_entry *entry)
{
    ((asking *)(void *)((char *)entry - offsetof(asking, entry)))->polls++;
    return mbm_loop_pollClient(entry);
}

static void ask(asking *a)
{
    if (a->left == 0)
        return;
    a->left--;
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&a->client, &a->request, 0, WORDS));
}

static void done(void *context, mbm_clientRequest *request)
{
    asking *a = (asking *)context;

    if (request->status == MBM_OK)
        a->right++;
    else
        a->failed++;
    ask(a);
}

static void prepare(asking *a, unsigned requests)
{
    OK(mbm_client_setResponseTimeout(&a->client, PATIENCE_MS));
    a->request = (mbm_clientRequest){
        .unit = UNIT, .reply = a->words, .replyBytes = sizeof a->words, .done = done, .context = a};
    a->entry.poll = poll_client;
    a->entry.context = &a->client;
    a->left = requests;
    ask(a);
}

static void keep(asking *a, const mbm_linkHooks *hooks)
{
    OK(mbm_link_begin(&a->link, &a->client, hooks));
    OK(mbm_link_setBackoff(&a->link, MBM_BACKOFF_EXPONENTIAL, 5, 20));
    OK(mbm_link_setCounters(&a->link, &a->counters));
    OK(mbm_link_setRequestsWait(&a->link, 1));
}

static void begin_line(const char *path, unsigned requests)
{
    const mbm_tty_options options = {.baud = BAUD, .parity = 'N', .stop = 1};
    const mbm_port port = mbm_tty_port(&tty);
    const mbm_linkHooks hooks = mbm_tty_link(&tty);

    assert_int_equal(mbm_tty_openLater(&tty, path, &options), 0);
    OK(mbm_client_beginRtu(&by_line.client, &port, by_line.incoming, sizeof by_line.incoming));
    OK(mbm_client_setBaudRate(&by_line.client, BAUD));
    keep(&by_line, &hooks);
    prepare(&by_line, requests);
    assert_int_equal(mbm_loop_addTty(&loop, &by_line.entry, &tty), 0);
}

static void begin_tcp(uint16_t at, unsigned requests)
{
    const mbm_port port = mbm_tcp_port(&tcp);
    const mbm_linkHooks hooks = mbm_tcp_link(&tcp);
    char service[8];

    snprintf(service, sizeof service, "%u", at);
    assert_int_equal(mbm_tcp_openLater(&tcp, &addresses, "127.0.0.1", service), 0);
    OK(mbm_client_beginTcp(&by_tcp.client, &port, by_tcp.incoming, sizeof by_tcp.incoming,
                           by_tcp.outgoing, sizeof by_tcp.outgoing));
    keep(&by_tcp, &hooks);
    prepare(&by_tcp, requests);
    assert_int_equal(mbm_loop_addTcp(&loop, &by_tcp.entry, &tcp), 0);
}

/* --- serial lines --- */

TEST(a_serial_line_takes_part_beside_tcp)
{
    tcp_peer *peer = tcp_peer_new();
    const mbm_port port = mbm_tty_port(&tty);
    server s;

    server_start(&s, UNIT);
    assert_int_equal(mbm_tty_attach(&tty, s.line.ours), 0);
    OK(mbm_client_beginRtu(&by_line.client, &port, by_line.incoming, sizeof by_line.incoming));
    OK(mbm_client_setBaudRate(&by_line.client, BAUD));
    prepare(&by_line, 20);
    assert_int_equal(mbm_loop_addTty(&loop, &by_line.entry, &tty), 0);
    begin_tcp(tcp_peer_start(peer, 0), 100);
    LOOP_UNTIL(&loop, by_line.right == 20 && by_tcp.right == 100);
    for (unsigned i = 0; i < WORDS; i++) {
        assert_int_equal(by_line.words[i], server_pattern(i));
        assert_int_equal(by_tcp.words[i], tcp_peer_word(i));
    }
    mbm_loop_remove(&by_line.entry);
    mbm_tty_detach(&tty);
    server_stop(&s);
    mbm_loop_remove(&by_tcp.entry);
    tcp_peer_stop(peer);
}

static uint32_t poll_nothing(mbm_loop_entry *entry)
{
    ++*(unsigned *)entry->context;
    return MBM_LOOP_FOREVER;
}

/* The port is one that a program uses only now and then. */
TEST(bytes_that_are_not_read_do_not_end_the_wait_again)
{
    const struct sockaddr_in none = {.sin_family = AF_INET};
    const mbm_port serial = mbm_tty_port(&tty), datagrams = mbm_udp_port(&udp_server);
    const mbm_port sockets = mbm_tcp_port(&tcp);
    mbm_loop_entry line = {.poll = poll_nothing}, udp = {.poll = poll_nothing};
    mbm_loop_entry stream = {.poll = poll_nothing};
    unsigned line_polls = 0, udp_polls = 0, stream_polls = 0;
    int pair[2];
    struct sockaddr_in to = none;
    uint8_t bytes[16];
    pty ends;

    pty_open(&ends);
    assert_int_equal(mbm_tty_attach(&tty, dup(ends.ours)), 0);
    assert_int_equal(mbm_udp_listen(&udp_server, "127.0.0.1", "0"), 0);
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair), 0);
    assert_int_equal(mbm_tcp_attach(&tcp, pair[0]), 0);
    line.context = &line_polls;
    udp.context = &udp_polls;
    stream.context = &stream_polls;
    assert_int_equal(mbm_loop_addTcp(&loop, &stream, &tcp), 0);
    assert_int_equal(mbm_loop_addTty(&loop, &line, &tty), 0);
    assert_int_equal(mbm_loop_addUdp(&loop, &udp, &udp_server), 0);
    assert_int_equal(mbm_loop_wait(&loop, 0), 3);
    assert_int_equal(write(pair[1], "abcd", 4), 4);
    assert_int_equal(write(ends.theirs, "abcd", 4), 4);
    int sender = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    to.sin_port = htons(udp_server.port);
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    assert_int_equal(sendto(sender, "x", 1, 0, (struct sockaddr *)&to, sizeof to), 1);
    LOOP_UNTIL(&loop, line_polls == 2 && udp_polls == 2 && stream_polls == 2);
    assert_int_equal(mbm_loop_wait(&loop, 1000), 0);
    assert_int_equal(mbm_loop_wait(&loop, 1000), 0);
    /* Once the program has used the port, and polled the entry, the rest is reported. */
    assert_int_equal(serial.read(serial.context, bytes, 2), 2);
    assert_int_equal(datagrams.read(datagrams.context, bytes, 2), 0);
    mbm_loop_wake(&line);
    mbm_loop_wake(&udp);
    LOOP_UNTIL(&loop, line_polls == 4);
    assert_int_equal(udp_polls, 3);
    assert_int_equal(mbm_loop_wait(&loop, 1000), 0);
    assert_int_equal(stream_polls, 2);
    assert_int_equal(sockets.read(sockets.context, bytes, 2), 2);
    LOOP_UNTIL(&loop, stream_polls == 3);
    assert_int_equal(mbm_loop_wait(&loop, 1000), 0);
    mbm_loop_remove(&stream);
    close(pair[1]);
    mbm_loop_remove(&line);
    mbm_loop_remove(&udp);
    close(sender);
    close(tty.fd);
    memset(&tty, 0, sizeof tty);
    pty_close(&ends);
}

/* A child process has the descriptor too, so the system would go on reporting it. */
TEST(a_terminal_that_is_closed_is_not_reported)
{
    mbm_loop_entry line = {.poll = poll_nothing};
    unsigned polls = 0;
    pty ends;

    pty_open(&ends);
    assert_int_equal(mbm_tty_attach(&tty, dup(ends.ours)), 0);
    line.context = &polls;
    assert_int_equal(mbm_loop_addTty(&loop, &line, &tty), 0);
    assert_int_equal(mbm_loop_wait(&loop, 0), 1);
    int other = dup(tty.fd);
    mbm_tty_close(&tty);
    assert_int_equal(write(ends.theirs, "x", 1), 1);
    assert_int_equal(mbm_loop_wait(&loop, 1000), 0);
    mbm_loop_remove(&line);
    close(other);
    pty_close(&ends);
}

/* --- servers --- */

static mbm_unit unit;
static uint16_t words[WORDS];
static mbm_registerTable table = {.words = words, .size = WORDS};
static mbm_tcp_listener listener;
static mbm_tcp places[PLACES];
static mbm_server servers[PLACES], lone;
static mbm_loop_entry served[PLACES], accepting, lone_entry;
static uint8_t frames[PLACES][MBM_MAX_TCP_FRAME], lone_frame[MBM_MAX_TCP_FRAME];

static void begin_unit(void)
{
    memset(places, 0, sizeof places);
    memset(served, 0, sizeof served);
    memset(&listener, 0, sizeof listener);
    memset(&accepting, 0, sizeof accepting);
    memset(&lone_entry, 0, sizeof lone_entry);
    unit = (mbm_unit){.id = UNIT};
    for (unsigned i = 0; i < WORDS; i++)
        words[i] = (uint16_t)(0x1200 + i);
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
}

static uint32_t accept_all(mbm_loop_entry *entry)
{
    int i;

    while ((i = mbm_tcp_accept(&listener, places, PLACES)) >= 0) {
        const mbm_port port = mbm_tcp_port(&places[i]);

        OK(mbm_server_beginTcp(&servers[i], &port, &unit, 1, frames[i], sizeof frames[i]));
        served[i].poll = mbm_loop_pollServer;
        served[i].context = &servers[i];
        assert_int_equal(mbm_loop_addTcp(&loop, &served[i], &places[i]), 0);
    }
    return MBM_LOOP_FOREVER;
}

static void begin_to_listen(void)
{
    begin_unit();
    assert_int_equal(mbm_tcp_listen(&listener, "127.0.0.1", "0"), 0);
    accepting.poll = accept_all;
    assert_int_equal(mbm_loop_addListener(&loop, &accepting, &listener), 0);
}

static void end_listening(void)
{
    for (unsigned i = 0; i < PLACES; i++) {
        mbm_loop_remove(&served[i]);
        mbm_tcp_close(&places[i]);
    }
    mbm_loop_remove(&accepting);
    mbm_tcp_closeListener(&listener);
}

static unsigned places_in_use(void)
{
    unsigned i, count = 0;

    for (i = 0; i < PLACES; i++)
        count += (unsigned)mbm_tcp_isInUse(&places[i]);
    return count;
}

TEST(servers_and_clients_share_a_loop)
{
    begin_to_listen();
    begin_tcp(listener.port, 50);
    LOOP_UNTIL(&loop, by_tcp.right == 50);
    assert_memory_equal(by_tcp.words, words, sizeof words);
    assert_int_equal(places_in_use(), 1);
    /* The client goes: its place is free. */
    mbm_loop_remove(&by_tcp.entry);
    mbm_tcp_close(&tcp);
    LOOP_UNTIL(&loop, places_in_use() == 0);
    assert_int_equal(loop.count, 1);
    begin_tcp(listener.port, 0);
    LOOP_UNTIL(&loop, by_tcp.counters.connected == 2 && places_in_use() == 1);
    end_listening();
}

TEST(bytes_that_are_no_modbus_end_the_connection_of_a_server)
{
    begin_to_listen();
    int peer = tcp_connectTo(listener.port);
    LOOP_UNTIL(&loop, places_in_use() == 1);
    assert_int_equal(write(peer, "GET / HTTP/1.1\r\n\r\n", 18), 18);
    LOOP_UNTIL(&loop, places_in_use() == 0);
    close(peer);
    end_listening();
}

TEST(without_a_descriptor_connections_wait_and_are_accepted_later)
{
    struct rlimit limit;
    int peers[3], next, i;

    SKIP_WITHOUT_LIMITS();
    begin_to_listen();
    peers[0] = tcp_connectTo(listener.port);
    LOOP_UNTIL(&loop, places_in_use() == 1);
    for (i = 1; i < 3; i++)
        peers[i] = tcp_connectTo(listener.port);
    /* The spare descriptor is gone too, so the connections cannot even be closed. */
    close(listener.spare);
    next = dup(0);
    listener.spare = 0;
    limit = (struct rlimit){(rlim_t)next + 1, found.rlim_max};
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &limit), 0);
    for (i = 0; i < 5; i++)
        assert_true(mbm_loop_wait(&loop, 20000) >= 0);
    assert_int_equal(places_in_use(), 1);
    assert_int_equal(listener.refused, 0);
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &found), 0);
    LOOP_UNTIL(&loop, places_in_use() == 3);
    for (i = 0; i < 3; i++)
        close(peers[i]);
    LOOP_UNTIL(&loop, places_in_use() == 0);
    close(next);
    end_listening();
}

static mbm_tty far_end;
static pty line;

/* A server of mbm at the far end of a pty. */
static void begin_far_end(void)
{
    const mbm_port port = mbm_tty_port(&far_end);

    pty_open(&line);
    memset(&far_end, 0, sizeof far_end);
    assert_int_equal(mbm_tty_attach(&far_end, line.ours), 0);
    OK(mbm_server_beginRtu(&lone, &port, &unit, 1, lone_frame, sizeof lone_frame));
    OK(mbm_server_setBaudRate(&lone, BAUD));
    lone_entry.poll = mbm_loop_pollServer;
    lone_entry.context = &lone;
    assert_int_equal(mbm_loop_addTty(&loop, &lone_entry, &far_end), 0);
}

static void end_far_end(void)
{
    mbm_loop_remove(&lone_entry);
    mbm_tty_detach(&far_end);
    pty_close(&line);
}

TEST(a_server_on_a_serial_line_takes_part)
{
    begin_unit();
    begin_far_end();
    begin_line(line.path, 20);
    LOOP_UNTIL(&loop, by_line.right == 20);
    assert_memory_equal(by_line.words, words, sizeof words);
    end_far_end();
}

/* The adapter is unplugged and plugged in again, and gets another descriptor. */
TEST(a_terminal_that_comes_back_is_waited_for_again)
{
    char folder[] = "/tmp/mbm-loop-XXXXXX", path[64];
    int taken[3];

    begin_unit();
    assert_non_null(mkdtemp(folder));
    snprintf(path, sizeof path, "%s/tty", folder);
    begin_line(path, 0);
    for (unsigned round = 1; round <= 3; round++) {
        LOOP_UNTIL(&loop, by_line.counters.failed >= 2 * round);
        begin_far_end();
        assert_int_equal(symlink(line.path, path), 0);
        LOOP_UNTIL(&loop, by_line.counters.connected == round);
        assert_int_equal(by_line.entry.fd, tty.fd);
        by_line.left = 3;
        by_line.right = 0;
        ask(&by_line);
        mbm_loop_wake(&by_line.entry);
        LOOP_UNTIL(&loop, by_line.right == 3);
        unlink(path);
        end_far_end();
        LOOP_UNTIL(&loop, by_line.counters.lost == round);
        taken[round - 1] = dup(0);
    }
    for (unsigned round = 0; round < 3; round++)
        close(taken[round]);
    rmdir(folder);
}

/* --- UDP --- */

TEST(a_client_and_a_server_over_udp_take_part)
{
    const mbm_port at = mbm_udp_port(&udp_server), from = mbm_udp_port(&udp_client);
    char service[8];

    begin_unit();
    assert_int_equal(mbm_udp_listen(&udp_server, "127.0.0.1", "0"), 0);
    snprintf(service, sizeof service, "%u", udp_server.port);
    assert_int_equal(mbm_udp_open(&udp_client, "127.0.0.1", service), 0);
    OK(mbm_server_beginTcp(&lone, &at, &unit, 1, lone_frame, sizeof lone_frame));
    lone_entry.poll = mbm_loop_pollServer;
    lone_entry.context = &lone;
    assert_int_equal(mbm_loop_addUdp(&loop, &lone_entry, &udp_server), 0);
    OK(mbm_client_beginTcp(&by_udp.client, &from, by_udp.incoming, sizeof by_udp.incoming,
                           by_udp.outgoing, sizeof by_udp.outgoing));
    prepare(&by_udp, 50);
    assert_int_equal(mbm_loop_addUdp(&loop, &by_udp.entry, &udp_client), 0);
    LOOP_UNTIL(&loop, by_udp.right == 50);
    assert_memory_equal(by_udp.words, words, sizeof words);
    /* No poll more than the requests need: one to begin, one for each reply. */
    assert_in_range(by_udp.polls, 50, 60);
    /* Bytes that arrive without a request do not keep the program busy. */
    mbm_udp_close(&udp_server);
    mbm_loop_remove(&lone_entry);
    assert_true(mbm_loop_wait(&loop, 1000) >= 0);
    assert_int_equal(mbm_loop_wait(&loop, 1000), 0);
}
