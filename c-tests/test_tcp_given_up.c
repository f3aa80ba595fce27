/* The port over TCP: a request without a reply is given up with its connection. The system would
 * send its bytes for up to half a minute after the close otherwise, so a write that failed would be
 * carried out later. The tests have a network of their own, and take it down. */
#define _GNU_SOURCE
#include "await.h"
#include "clock.h"
#include "mbm_call.h"
#include "own_network.h"
#include "tcp_server.h"
#include "test.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

enum { TIMEOUT_MS = 100, JUST_WRITTEN_US = 20000 };

/* Writes 7 to register 100 of unit 1, as the first request of a client does. */
static const uint8_t write_one[12] = {0, 1, 0, 0, 0, 6, 1, 6, 0, 100, 0, 7};

static int listener_fd, peer;
static mbm_tcp tcp;
static mbm_tcp_addresses addresses;
static mbm_port port;
static mbm_client client;
static mbm_clientRequest request;
static uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
static uint16_t local;

static void begin(void)
{
    struct sockaddr_in at;
    socklen_t size = sizeof at;
    uint16_t peer_port;
    char service[8];

    own_network();
    listener_fd = tcp_listenOnFree(&peer_port);
    snprintf(service, sizeof service, "%u", peer_port);
    memset(&tcp, 0, sizeof tcp);
    memset(&client, 0, sizeof client);
    memset(&request, 0, sizeof request);
    port = mbm_tcp_port(&tcp);
    assert_int_equal(mbm_tcp_open(&tcp, &addresses, "127.0.0.1", service), 0);
    AWAIT(mbm_tcp_isConnected(&tcp) == 1);
    peer = accept(listener_fd, NULL, NULL);
    assert_true(peer >= 0);
    assert_int_equal(getsockname(tcp.fd, (struct sockaddr *)&at, &size), 0);
    local = ntohs(at.sin_port);
    OK(mbm_client_beginTcp(&client, &port, incoming, sizeof incoming, outgoing, sizeof outgoing));
    OK(mbm_client_setResponseTimeout(&client, TIMEOUT_MS));
    request.unit = 1;
}

static void end(void)
{
    mbm_tcp_close(&tcp);
    close(peer);
    close(listener_fd);
}

/* Writes a register by the client, and returns the status. */
static uint8_t write_register(void)
{
    const mbm_caller device = mbm_call_overTcp(&tcp, &client, &request);

    return mbm_call(&device, mbm_client_writeSingleRegister(&client, &request, 100, 7));
}

/* The request of the client times out in a network that is down. */
static void time_out(void)
{
    own_network_set(0);
    IS(MBM_RESPONSE_TIMED_OUT, write_register());
}

/* Neither the system nor the peer has the request. */
static void is_given_up(void)
{
    uint8_t byte;

    assert_int_equal(own_network_sockets(local), 0);
    own_network_set(1);
    assert_int_equal(recv(peer, &byte, 1, MSG_DONTWAIT), -1);
    assert_int_equal(errno, EAGAIN);
}

fixture each_test = {begin, end};

TEST(a_write_that_timed_out_does_not_follow_a_close)
{
    time_out();
    mbm_tcp_close(&tcp);
    is_given_up();
}

TEST(a_write_that_timed_out_does_not_follow_a_disconnect)
{
    time_out();
    mbm_tcp_disconnect(&tcp);
    is_given_up();
}

TEST(a_write_that_timed_out_does_not_follow_a_second_connection)
{
    time_out();
    (void)mbm_tcp_connect(&tcp);
    is_given_up();
}

TEST(a_write_that_timed_out_in_a_set_does_not_follow_a_close)
{
    static mbm_tcp_set set;

    assert_int_equal(mbm_tcp_openSet(&set), 0);
    assert_int_equal(mbm_tcp_add(&set, &tcp), 0);
    time_out();
    mbm_tcp_close(&tcp);
    is_given_up();
    mbm_tcp_closeSet(&set);
}

TEST(a_link_that_connects_anew_gives_up_what_timed_out)
{
    static mbm_link kept;
    const mbm_linkHooks hooks = mbm_tcp_link(&tcp);

    memset(&kept, 0, sizeof kept);
    OK(mbm_link_begin(&kept, &client, &hooks));
    time_out();
    OK(mbm_link_reconnect(&kept));
    AWAIT((mbm_client_poll(&client), own_network_sockets(local) == 0));
    is_given_up();
}

/* The request before has timed out, and this one was written a moment ago. */
TEST(the_requests_before_the_last_one_are_given_up_too)
{
    own_network_set(0);
    assert_int_equal(port.write(&tcp, write_one, sizeof write_one), sizeof write_one);
    assert_int_equal(port.write(&tcp, write_one, sizeof write_one), sizeof write_one);
    mbm_tcp_close(&tcp);
    is_given_up();
}

/* The peer does not read, and its window is full. */
TEST(a_request_behind_a_full_window_is_given_up)
{
    static uint8_t zeros[4096], into[65536];
    long written = 0, got = 0;
    ssize_t count = 1;

    while (count > 0) {
        count = port.write(&tcp, zeros, sizeof zeros);
        assert_true(count >= 0);
        written += count;
    }
    mbm_tcp_disconnect(&tcp);
    while ((count = recv(peer, into, sizeof into, 0)) > 0)
        got += count;
    assert_int_equal(count, -1);
    assert_int_equal(errno, ECONNRESET);
    assert_true(got < written);
}

/* --- what is not given up */

TEST(a_connection_whose_request_was_answered_ends_without_a_reset)
{
    uint8_t bytes[sizeof write_one];

    OK(mbm_client_setResponseTimeout(&client, UINT16_MAX));
    IS(MBM_PENDING, mbm_client_writeSingleRegister(&client, &request, 100, 7));
    IS(MBM_PENDING, mbm_client_poll(&client));
    /* The reply has the same bytes. */
    await_bytes(peer, bytes, sizeof bytes);
    assert_int_equal(send(peer, bytes, sizeof bytes, MSG_NOSIGNAL), sizeof bytes);
    AWAIT((mbm_client_poll(&client), request.status != MBM_PENDING));
    IS(MBM_OK, request.status);
    mbm_tcp_close(&tcp);
    assert_int_equal(recv(peer, bytes, 1, 0), 0);
}

/* The peer has the request, in its system: a reset would change nothing. */
TEST(a_connection_whose_request_was_acknowledged_ends_without_a_reset)
{
    uint8_t bytes[sizeof write_one + 1];

    IS(MBM_RESPONSE_TIMED_OUT, write_register());
    mbm_tcp_close(&tcp);
    assert_int_equal(recv(peer, bytes, sizeof bytes, MSG_WAITALL), sizeof write_one);
}

/* As the alert that ends a session of TLS, or a request that has no reply. */
TEST(bytes_that_were_written_just_before_a_close_are_still_sent)
{
    uint8_t bytes[sizeof write_one + 1];
    uint32_t began;

    /* Again, if this program had to wait between the write and the close. */
    for (;;) {
        own_network_set(0);
        began = raw_micros(NULL);
        assert_int_equal(port.write(&tcp, write_one, sizeof write_one), sizeof write_one);
        mbm_tcp_close(&tcp);
        if (raw_micros(NULL) - began < JUST_WRITTEN_US)
            break;
        end();
        begin();
    }
    assert_int_equal(own_network_sockets(local), 1);
    own_network_set(1);
    assert_int_equal(recv(peer, bytes, sizeof bytes, MSG_WAITALL), sizeof write_one);
    assert_memory_equal(bytes, write_one, sizeof write_one);
}

TEST(the_response_of_a_server_is_sent_after_a_close)
{
    mbm_tcp place = MBM_INIT;
    const mbm_port of_place = mbm_tcp_port(&place);
    uint8_t bytes[sizeof write_one];

    assert_int_equal(mbm_tcp_attach(&place, peer), 0);
    own_network_set(0);
    assert_int_equal(of_place.write(&place, write_one, sizeof write_one), sizeof write_one);
    poll(NULL, 0, 2 * JUST_WRITTEN_US / 1000);
    mbm_tcp_close(&place);
    own_network_set(1);
    await_bytes(tcp.fd, bytes, sizeof bytes);
    peer = -1;
}
