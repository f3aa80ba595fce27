/* The port over TCP sockets: as a client of a peer that plays faults, as a server, and what
 * it does while there is no connection. */
#define _GNU_SOURCE
#include "tcp_peer.h"
#include "mbm_tcp.h"
#include "await.h"
#include "clock.h"
#include "skip.h"
#include "model.h"
#include "tcp_server.h"
#include "test.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <pthread.h>
#include <unistd.h>

static tcp_peer *peer;
static mbm_tcp tcp;
static mbm_tcp_addresses addresses;
static mbm_port port;
static char service[8];

static void begin(void)
{
    peer = tcp_peer_new();
    snprintf(service, sizeof service, "%u", tcp_peer_start(peer, 0));
    memset(&tcp, 0, sizeof tcp);
    port = mbm_tcp_port(&tcp);
}

static void end(void)
{
    mbm_tcp_close(&tcp);
    tcp_peer_stop(peer);
}

fixture each_test = {begin, end};

enum { SECOND = 1000000, PATIENCE = 1000 * PATIENCE_MS };

/* Reads until `length` bytes have arrived or the link is lost. */
static int16_t read_all(uint8_t *bytes, uint16_t length)
{
    uint16_t have = 0;

    while (have < length) {
        int16_t count = port.read(port.context, bytes + have, (uint16_t)(length - have));

        if (count < 0)
            return count;
        have = (uint16_t)(have + count);
        if (count == 0)
            assert_true(mbm_tcp_wait(&tcp, 1, NULL, -1, PATIENCE) == 1);
    }
    return (int16_t)have;
}

static void await_connection(void)
{
    while (mbm_tcp_isConnected(&tcp) == 0)
        assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, PATIENCE), 1);
}

/* Reads register 5. Returns the length of the reply, 11 bytes, or the negative result of
 * read or write. */
static int16_t read_register(void)
{
    const uint8_t read_one[12] = {0, 1, 0, 0, 0, 6, 7, 3, 0, 5, 0, 1};
    uint8_t reply[11] = {0};

    await_connection();
    int16_t count = port.write(port.context, read_one, sizeof read_one);
    if (count < 0)
        return count;
    assert_int_equal(count, sizeof read_one);
    count = read_all(reply, sizeof reply);
    if (count > 0)
        assert_int_equal(reply[9] << 8 | reply[10], tcp_peer_word(5));
    return count;
}

TEST(a_client_asks_and_reads_the_reply)
{
    assert_int_equal(mbm_tcp_open(&tcp, &addresses, "127.0.0.1", service), 0);
    assert_int_equal(read_register(), 11);
    assert_int_equal(read_register(), 11);
    assert_int_equal(tcp.error, 0);
    double begun = seconds();
    uint32_t before = port.micros(port.context);
    usleep(2000);
    uint32_t after = port.micros(port.context);
    double took = seconds() - begun;
    assert_true(after - before >= 2000 && (after - before) * 1e-6 <= took + 2e-6);
}

static int option(int level, int name)
{
    socklen_t size = sizeof(int);
    int value = 0;

    assert_int_equal(getsockopt(tcp.fd, level, name, &value, &size), 0);
    return value;
}

TEST(a_socket_sends_at_once_and_finds_a_dead_peer)
{
    assert_int_equal(mbm_tcp_open(&tcp, &addresses, "127.0.0.1", service), 0);
    assert_true(option(IPPROTO_TCP, TCP_NODELAY));
    assert_true(option(SOL_SOCKET, SO_KEEPALIVE));
    assert_in_range(option(IPPROTO_TCP, TCP_KEEPIDLE) +
                        option(IPPROTO_TCP, TCP_KEEPINTVL) * option(IPPROTO_TCP, TCP_KEEPCNT),
                    1, 30);
    assert_int_equal(option(IPPROTO_TCP, TCP_USER_TIMEOUT), 30000);
    assert_true(fcntl(tcp.fd, F_GETFL) & O_NONBLOCK);
    assert_true(fcntl(tcp.fd, F_GETFD) & FD_CLOEXEC);
}

/* A listener whose queue is full completes no connection until it accepts one. */
TEST(until_connected_nothing_is_read_or_written)
{
    struct sockaddr_in address = {0};
    socklen_t size = sizeof address;
    int listener = socket(AF_INET, SOCK_STREAM, 0), first, second, taken;
    uint8_t byte = 0;

    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    assert_int_equal(bind(listener, (struct sockaddr *)&address, size), 0);
    assert_int_equal(listen(listener, 0), 0);
    assert_int_equal(getsockname(listener, (struct sockaddr *)&address, &size), 0);
    first = tcp_connectTo(ntohs(address.sin_port));
    snprintf(service, sizeof service, "%u", ntohs(address.sin_port));

    assert_int_equal(mbm_tcp_open(&tcp, &addresses, "127.0.0.1", service), 0);
    assert_int_equal(mbm_tcp_isConnected(&tcp), 0);
    assert_int_equal(port.read(port.context, &byte, 1), 0);
    assert_int_equal(port.write(port.context, &byte, 1), 0);
    assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, 20000), 0);

    taken = accept(listener, NULL, NULL);
    await_connection();
    assert_int_equal(port.write(port.context, (const uint8_t *)"x", 1), 1);
    second = accept(listener, NULL, NULL);
    assert_int_equal(read(second, &byte, 1), 1);
    assert_int_equal(byte, 'x');
    close(first);
    close(second);
    close(taken);
    close(listener);
}

TEST(a_refused_connection_is_a_lost_link)
{
    uint8_t byte = 0;

    tcp_peer_halt(peer);
    if (mbm_tcp_open(&tcp, &addresses, "127.0.0.1", service) == 0) {
        await_connection();
        assert_int_equal(port.read(port.context, &byte, 1), -1);
        assert_int_equal(port.write(port.context, &byte, 1), -1);
    }
    assert_int_equal(tcp.error, ECONNREFUSED);
    assert_int_equal(mbm_tcp_isConnected(&tcp), -1);
}

TEST(of_several_addresses_the_one_that_answers_is_used)
{
    assert_int_equal(mbm_tcp_open(&tcp, &addresses, NULL, service), 0);
    assert_int_equal(read_register(), 11);
}

TEST(a_failed_open_sets_errno)
{
    FAILS(ENXIO, mbm_tcp_open(&tcp, &addresses, "127.0.0.1", "no-such-service"));
    FAILS(EBADF, mbm_tcp_attach(&tcp, -1));
    IS(MBM_LINK_LOST, mbm_tcp_connect(&tcp));
    assert_int_equal(tcp.error, ENOTCONN);
    mbm_tcp_close(&tcp);
    assert_int_equal(mbm_tcp_open(&tcp, &addresses, "127.0.0.1", service), 0);
    FAILS(EBUSY, mbm_tcp_open(&tcp, &addresses, "127.0.0.1", service));
    FAILS(EBUSY, mbm_tcp_attach(&tcp, 0));
}

TEST(the_end_of_a_stream_and_a_reset_have_different_errors)
{
    uint8_t byte;

    tcp_peer_fault(peer, 1, FAULT_CLOSE, 0);
    tcp_peer_fault(peer, 2, FAULT_RESET, 0);
    assert_int_equal(mbm_tcp_open(&tcp, &addresses, "127.0.0.1", service), 0);
    assert_int_equal(read_register(), -1);
    assert_int_equal(tcp.error, EPIPE);
    assert_int_equal(port.read(port.context, &byte, 1), -1);
    assert_int_equal(mbm_tcp_isConnected(&tcp), -1);
    assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, 1000), 0);

    assert_in_set(mbm_tcp_connect(&tcp), ((const unsigned long[]){MBM_OK, MBM_PENDING}), 2);
    assert_int_equal(read_register(), -1);
    assert_int_equal(tcp.error, ECONNRESET);

    assert_in_set(mbm_tcp_connect(&tcp), ((const unsigned long[]){MBM_OK, MBM_PENDING}), 2);
    assert_int_equal(read_register(), 11);
    assert_int_equal(tcp.error, 0);
}

TEST(bytes_before_the_end_of_the_stream_are_still_read)
{
    uint8_t bytes[4];

    tcp_peer_fault(peer, 1, FAULT_HALF, 4);
    assert_int_equal(mbm_tcp_open(&tcp, &addresses, "127.0.0.1", service), 0);
    await_connection();
    assert_int_equal(
        port.write(port.context, (const uint8_t[12]){0, 1, 0, 0, 0, 6, 7, 3, 0, 5, 0, 1}, 12), 12);
    assert_int_equal(read_all(bytes, 4), 4);
    assert_int_equal(read_all(bytes, 1), -1);
}

TEST(a_disconnected_link_is_lost_until_it_is_connected)
{
    uint8_t byte = 0;

    mbm_tcp_disconnect(&tcp);
    assert_int_equal(mbm_tcp_open(&tcp, &addresses, "127.0.0.1", service), 0);
    assert_int_equal(read_register(), 11);
    mbm_tcp_disconnect(&tcp);
    assert_int_equal(port.write(port.context, &byte, 1), -1);
    mbm_tcp_connect(&tcp);
    assert_int_equal(read_register(), 11);
    assert_int_equal(tcp_peer_count(peer).connections, 2);
}

TEST(the_error_says_why_the_link_was_lost_until_it_is_opened_again)
{
    tcp_peer_fault(peer, 1, FAULT_CLOSE, 0);
    assert_int_equal(mbm_tcp_open(&tcp, &addresses, "127.0.0.1", service), 0);
    assert_int_equal(read_register(), -1);
    mbm_tcp_disconnect(&tcp); /* as a link does before it waits */
    assert_int_equal(tcp.error, EPIPE);
    mbm_tcp_connect(&tcp);
    assert_int_equal(read_register(), 11);
    assert_int_equal(tcp.error, 0);
    mbm_tcp_disconnect(&tcp);
    assert_int_equal(tcp.error, ENOTCONN);
}

TEST(a_full_socket_accepts_no_bytes_until_wait_says_so)
{
    static uint8_t much[60000];
    int pair[2], rounds = 0;
    int16_t taken;

    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, pair), 0);
    assert_int_equal(mbm_tcp_attach(&tcp, pair[0]), 0);
    while ((taken = port.write(port.context, much, sizeof much)) > 0)
        assert_true(++rounds < 1000);
    assert_int_equal(taken, 0);
    assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, 10000), 0);
    assert_int_equal(fcntl(pair[1], F_SETFL, O_NONBLOCK), 0);
    while (read(pair[1], much, sizeof much) > 0)
        ;
    assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, MBM_TCP_FOREVER), 1);
    assert_true(port.write(port.context, much, 10) == 10);
    assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, 1000), 0);
    close(pair[1]);
    assert_int_equal(port.write(port.context, much, 10), -1);
    assert_int_equal(tcp.error, EPIPE);
}

TEST(wait_ends_with_the_time_or_with_any_of_its_sockets)
{
    static mbm_tcp many[MBM_TCP_WAITS];
    mbm_tcp_listener listener = {0};
    int pipes[2], client;
    double start = seconds();
    char byte;

    assert_int_equal(mbm_tcp_wait(many, MBM_TCP_WAITS - 2, NULL, -1, 20500), 0);
    assert_true(seconds() - start >= 0.0205);
    FAILS(EINVAL, mbm_tcp_wait(many, MBM_TCP_WAITS - 1, NULL, -1, 0));

    assert_int_equal(pipe(pipes), 0);
    assert_int_equal(mbm_tcp_listen(&listener, "127.0.0.1", "0"), 0);
    assert_int_equal(mbm_tcp_wait(many, 3, &listener, pipes[0], 1000), 0);
    assert_int_equal(write(pipes[1], "x", 1), 1);
    assert_int_equal(mbm_tcp_wait(many, 3, &listener, pipes[0], MBM_TCP_FOREVER), 1);
    assert_int_equal(read(pipes[0], &byte, 1), 1);

    client = tcp_connectTo(listener.port);
    assert_int_equal(mbm_tcp_wait(many, 3, &listener, pipes[0], MBM_TCP_FOREVER), 1);
    assert_int_equal(mbm_tcp_accept(&listener, many + 1, 2), 0);
    assert_int_equal(mbm_tcp_wait(many, 3, &listener, pipes[0], 1000), 0);
    assert_int_equal(write(client, "x", 1), 1);
    assert_int_equal(mbm_tcp_wait(many, 3, &listener, pipes[0], MBM_TCP_FOREVER), 1);
    close(client);
    close(pipes[0]);
    close(pipes[1]);
    mbm_tcp_close(&many[1]);
    mbm_tcp_closeListener(&listener);
}

/* Returns how many connections wait to be accepted. */
static unsigned waiting(const mbm_tcp_listener *listener)
{
    struct tcp_info info = {0};
    socklen_t size = sizeof info;

    SKIP_IF_EMULATED();
    assert_int_equal(getsockopt(listener->fd, IPPROTO_TCP, TCP_INFO, &info, &size), 0);
    return info.tcpi_unacked;
}

TEST(a_connection_without_a_place_is_ended_without_a_reset)
{
    mbm_tcp_listener listener = {0};
    mbm_tcp places[2] = {0};
    int clients[4], i;
    char byte;

    assert_int_equal(mbm_tcp_listen(&listener, "127.0.0.1", "0"), 0);
    FAILS(EAGAIN, mbm_tcp_accept(&listener, places, 2));
    for (i = 0; i < 4; i++) {
        clients[i] = tcp_connectTo(listener.port);
        assert_int_equal(write(clients[i], "x", 1), 1);
    }
    AWAIT(waiting(&listener) == 4);
    assert_int_equal(mbm_tcp_accept(&listener, places, 2), 0);
    assert_int_equal(mbm_tcp_accept(&listener, places, 2), 1);
    FAILS(EAGAIN, mbm_tcp_accept(&listener, places, 2));
    assert_int_equal(listener.refused, 2);
    assert_int_equal(read(clients[2], &byte, 1), 0);
    assert_int_equal(read(clients[3], &byte, 1), 0);

    /* A lost connection keeps its place, since an object still uses it. */
    close(clients[0]);
    mbm_port line = mbm_tcp_port(&places[0]);
    AWAIT(line.read(line.context, (uint8_t *)&byte, 1) == 1);
    AWAIT(line.read(line.context, (uint8_t *)&byte, 1) < 0);
    clients[0] = tcp_connectTo(listener.port);
    AWAIT(waiting(&listener) == 1);
    FAILS(EAGAIN, mbm_tcp_accept(&listener, places, 2));
    assert_int_equal(listener.refused, 3);
    mbm_tcp_close(&places[0]);
    close(clients[2]);
    clients[2] = tcp_connectTo(listener.port);
    AWAIT(waiting(&listener) == 1);
    assert_int_equal(mbm_tcp_accept(&listener, places, 2), 0);

    for (i = 0; i < 4; i++)
        close(clients[i]);
    mbm_tcp_close(&places[0]);
    mbm_tcp_close(&places[1]);
    mbm_tcp_closeListener(&listener);
    mbm_tcp_closeListener(&listener);
    FAILS(EBADF, mbm_tcp_accept(&listener, places, 2));
}

TEST(listening_at_a_port_in_use_fails)
{
    mbm_tcp_listener first = {0}, second = {0};
    int listens = -1, tries;
    char number[8];

    /* Now and then another program may get the port between the two calls. */
    for (tries = 0; tries < 10 && listens < 0; tries++) {
        assert_int_equal(mbm_tcp_listen(&first, "127.0.0.1", "0"), 0);
        snprintf(number, sizeof number, "%u", first.port);
        FAILS(EBUSY, mbm_tcp_listen(&first, "127.0.0.1", "0"));
        FAILS(EADDRINUSE, mbm_tcp_listen(&second, "127.0.0.1", number));
        mbm_tcp_closeListener(&first);
        listens = mbm_tcp_listen(&second, NULL, number);
    }
    assert_int_equal(listens, 0);
    mbm_tcp_closeListener(&second);
}

/* A device for one connection, with RTU frames in a TCP stream. */
static void *device(void *argument)
{
    mbm_tcp_listener *listener = (mbm_tcp_listener *)argument;
    static model memory;
    mbm_tcp place = {0};
    mbm_port line = mbm_tcp_port(&place);
    uint8_t frame[MBM_MAX_FRAME], reply[MBM_MAX_FRAME];
    size_t have = 0;
    int16_t count = 0;

    model_start(&memory);
    while (mbm_tcp_accept(listener, &place, 1) < 0)
        mbm_tcp_wait(NULL, 0, listener, -1, SECOND);
    for (; count >= 0; mbm_tcp_wait(&place, 1, NULL, -1, SECOND)) {
        request asked;

        count = line.read(line.context, frame + have, (uint16_t)(sizeof frame - have));
        if (count > 0)
            have += (size_t)count;
        if (have > 0 && request_parse(&asked, frame, have)) {
            line.write(line.context, reply, (uint16_t)model_answer(&memory, &asked, reply));
            have = 0;
        }
    }
    mbm_tcp_close(&place);
    return NULL;
}

TEST(a_master_reads_rtu_through_a_stream)
{
    static mbm_line line;
    static mbm_node node;
    static uint16_t response[100];
    static uint8_t frame[MBM_FRAME_BYTES(100)];
    static model memory;
    mbm_tcp_listener listener = {0};
    pthread_t thread;

    model_start(&memory);
    assert_int_equal(mbm_tcp_listen(&listener, "127.0.0.1", "0"), 0);
    assert_int_equal(pthread_create(&thread, NULL, device, &listener), 0);
    snprintf(service, sizeof service, "%u", listener.port);
    assert_int_equal(mbm_tcp_open(&tcp, &addresses, "127.0.0.1", service), 0);
    port = mbm_tcp_port(&tcp);
    OK(mbm_line_beginRtu(&line, &port, frame, sizeof frame));
    OK(mbm_node_begin(&node, &line, MODEL_FIRST_UNIT, response, 100, NULL, 0));
    OK(mbm_line_setGap(&line, 0));
    OK(mbm_node_setResponseTimeout(&node, PATIENCE_MS));
    for (unsigned i = 1; i <= 100; i++) {
        OK(mbm_node_readHoldingRegisters(&node, (uint16_t)i, (uint16_t)i));
        assert_memory_equal(response, &memory.holding[0][i], 2 * i);
    }
    mbm_tcp_disconnect(&tcp);
    IS(MBM_LINK_LOST, mbm_node_readHoldingRegisters(&node, 0, 1));
    pthread_join(thread, NULL);
    mbm_tcp_closeListener(&listener);
}

/* The side that closes first keeps its port in TIME_WAIT. */
TEST(a_server_listens_again_at_once_after_it_closed_a_connection)
{
    mbm_tcp_listener listener = MBM_INIT;
    mbm_tcp accepted = MBM_INIT;

    assert_int_equal(mbm_tcp_listen(&listener, "127.0.0.1", "0"), 0);
    snprintf(service, sizeof service, "%u", listener.port);
    int client = tcp_connectTo(listener.port);
    assert_int_equal(mbm_tcp_wait(NULL, 0, &listener, -1, PATIENCE), 1);
    assert_int_equal(mbm_tcp_accept(&listener, &accepted, 1), 0);
    mbm_tcp_close(&accepted);
    close(client);
    mbm_tcp_closeListener(&listener);
    assert_int_equal(mbm_tcp_listen(&listener, "127.0.0.1", service), 0);
    mbm_tcp_closeListener(&listener);
}

/* --- mbm_tcp_wait sleeps where the program would not react to what it could report --- */

TEST(a_completed_connection_ends_the_wait_once)
{
    assert_int_equal(mbm_tcp_open(&tcp, &addresses, "127.0.0.1", service), 0);
    assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, 5 * SECOND), 1);
    assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, 1000), 0);
}

/* The peer sends, and does not read. The program cannot answer, so it sleeps. */
TEST(unread_bytes_do_not_end_the_wait_again)
{
    static uint8_t much[60000];
    uint8_t bytes[4];
    int pair[2];

    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, pair), 0);
    assert_int_equal(mbm_tcp_attach(&tcp, pair[0]), 0);
    assert_int_equal(write(pair[1], "abcd", 4), 4);
    assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, MBM_TCP_FOREVER), 1);
    assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, 1000), 0);
    /* They end it again once the program has read, or has written everything that it had to
     * write. */
    assert_int_equal(port.read(port.context, bytes, 2), 2);
    assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, MBM_TCP_FOREVER), 1);
    while (port.write(port.context, much, sizeof much) > 0)
        ;
    assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, 1000), 0);
    assert_int_equal(fcntl(pair[1], F_SETFL, O_NONBLOCK), 0);
    while (read(pair[1], much, sizeof much) > 0)
        ;
    assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, MBM_TCP_FOREVER), 1);
    assert_int_equal(port.write(port.context, much, 10), 10);
    assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, MBM_TCP_FOREVER), 1);
    assert_int_equal(port.read(port.context, bytes, 4), 2);
    /* Nor does the end of the stream, once it was reported. */
    assert_int_equal(read(pair[1], much, sizeof much), 10);
    close(pair[1]);
    assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, MBM_TCP_FOREVER), 1);
    assert_int_equal(mbm_tcp_wait(&tcp, 1, NULL, -1, 1000), 0);
    assert_int_equal(mbm_tcp_isConnected(&tcp), -1);
    assert_int_equal(tcp.error, EPIPE);
}
