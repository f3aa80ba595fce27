/* Faults of a network as a client with a link sees them, over mbm_tcp.h: a test program for Linux
 * and one for lwIP's sockets include it. Each has a server in the same thread, and functions of its
 * own for the network. */
#ifndef TCP_FAULTS_H
#define TCP_FAULTS_H

#include "await.h"
#include "mbm_tcp.h"
#include "test.h"

#include <sys/socket.h>

/* Milliseconds: the response timeout of a request that fails, and of one that is made again until
 * it is right. */
enum { FAILS_AFTER = 200, AGAIN_AFTER = 1000 };

/* Of the program: takes the network down or up. */
static void set_network(int is_up);

static struct {
    mbm_tcp_listener listener;
    mbm_tcp place, tcp;
    mbm_tcp_addresses addresses;
    mbm_server server;
    mbm_client client;
    mbm_link link;
    mbm_linkCounters counters;
    mbm_clientRequest request;
    mbm_registerTable holding;
    mbm_unit unit;
    uint16_t word, reply;
    uint8_t frame[MBM_MAX_TCP_FRAME], incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
    char service[8];
} faulty;

static void fault_serve(void)
{
    if (mbm_tcp_accept(&faulty.listener, &faulty.place, 1) == 0) {
        const mbm_port port = mbm_tcp_port(&faulty.place);

        OK(mbm_server_beginTcp(&faulty.server, &port, &faulty.unit, 1, faulty.frame,
                               sizeof faulty.frame));
    }
    if (mbm_tcp_isInUse(&faulty.place) && mbm_server_poll(&faulty.server) != MBM_OK)
        mbm_tcp_close(&faulty.place);
}

/* Begins the server, and a client that does not connect yet. */
static void fault_begin(const char *service)
{
    const mbm_port port = mbm_tcp_port(&faulty.tcp);
    const mbm_linkHooks hooks = mbm_tcp_link(&faulty.tcp);

    memset(&faulty, 0, sizeof faulty);
    faulty.word = 42;
    faulty.holding.words = &faulty.word;
    faulty.holding.size = 1;
    faulty.unit.id = 1;
    faulty.request.unit = 1;
    OK(mbm_unit_serveHoldingRegisters(&faulty.unit, &faulty.holding));
    assert_int_equal(mbm_tcp_listen(&faulty.listener, "127.0.0.1", service), 0);
    snprintf(faulty.service, sizeof faulty.service, "%u", faulty.listener.port);
    OK(mbm_client_beginTcp(&faulty.client, &port, faulty.incoming, sizeof faulty.incoming,
                           faulty.outgoing, sizeof faulty.outgoing));
    OK(mbm_link_begin(&faulty.link, &faulty.client, &hooks));
    OK(mbm_link_setBackoff(&faulty.link, MBM_BACKOFF_FIXED, 5, 5));
    OK(mbm_link_setConnectTimeout(&faulty.link, AGAIN_AFTER));
    OK(mbm_link_setCounters(&faulty.link, &faulty.counters));
}

static void fault_end(void)
{
    set_network(1);
    mbm_tcp_close(&faulty.tcp);
    mbm_tcp_close(&faulty.place);
    mbm_tcp_closeListener(&faulty.listener);
}

static void fault_open(void)
{
    assert_int_equal(mbm_tcp_openLater(&faulty.tcp, &faulty.addresses, "127.0.0.1", faulty.service),
                     0);
}

static void fault_queue(uint16_t timeout)
{
    OK(mbm_client_setResponseTimeout(&faulty.client, timeout));
    faulty.reply = 0;
    faulty.request.reply = &faulty.reply;
    faulty.request.replyBytes = sizeof faulty.reply;
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&faulty.client, &faulty.request, 0, 1));
}

/* Returns the status of a request, while the server runs or not. */
static uint8_t fault_read(uint16_t timeout, int has_server)
{
    fault_queue(timeout);
    while (faulty.request.status == MBM_PENDING) {
        (void)mbm_client_poll(&faulty.client);
        if (has_server)
            fault_serve();
        poll(NULL, 0, 1);
    }
    return faulty.request.status;
}

/* Requests end with a status each, until the cause is gone for the client: then they are right. */
static void fault_is_over(void)
{
    AWAIT(fault_read(AGAIN_AFTER, 1) == MBM_OK);
    assert_int_equal(faulty.reply, 42);
}

TEST(a_socket_that_was_never_opened_is_a_lost_link_until_it_is)
{
    const mbm_port port = mbm_tcp_port(&faulty.tcp);
    uint8_t byte = 0;

    assert_int_equal(port.read(&faulty.tcp, &byte, 1), -1);
    assert_int_equal(port.write(&faulty.tcp, &byte, 1), -1);
    IS(MBM_LINK_LOST, mbm_tcp_connect(&faulty.tcp));
    assert_int_equal(faulty.tcp.error, ENOTCONN);
    IS(MBM_LINK_LOST, fault_read(FAILS_AFTER, 1));
    assert_true(faulty.counters.failed > 0);
    /* What the program forgot. */
    mbm_tcp_close(&faulty.tcp);
    fault_open();
    fault_is_over();
}

TEST(a_network_that_is_down_is_a_status_and_then_works_again)
{
    fault_open();
    fault_is_over();
    set_network(0);
    IS(STATUS_WHILE_DOWN, fault_read(FAILS_AFTER, 1));
    set_network(1);
    fault_is_over();
}

TEST(a_network_that_comes_later_is_waited_for)
{
    uint8_t status;

    set_network(0);
    fault_open();
    status = fault_read(FAILS_AFTER, 1);
    /* A system without a route refuses the connection at once, or waits for one. */
    assert_true(status == MBM_LINK_LOST || status == MBM_CONNECT_TIMED_OUT);
    set_network(1);
    fault_is_over();
}

/* Writes until the socket takes no more. */
static void fault_fill(void)
{
    static const uint8_t zeros[1000];
    const mbm_port port = mbm_tcp_port(&faulty.tcp);
    int16_t taken = 1;

    while (taken > 0)
        taken = port.write(&faulty.tcp, zeros, sizeof zeros);
    assert_int_equal(taken, 0);
}

/* The peer reads nothing, and its window and the buffer of this side are full. */
TEST(a_buffer_that_is_full_is_a_busy_line_and_then_a_new_connection)
{
    fault_open();
    fault_is_over();
    OK(mbm_link_setReplaceAfter(&faulty.link, 0));
    /* The system may give more space while a request waits. */
    AWAIT((fault_fill(), fault_read(FAILS_AFTER, 0) == MBM_LINE_BUSY));
    assert_int_equal(faulty.counters.lost, 0);
    OK(mbm_link_setReplaceAfter(&faulty.link, 1));
    assert_int_not_equal(fault_read(FAILS_AFTER, 0), MBM_OK);
    fault_is_over();
    assert_true(faulty.counters.lost > 0);
}

#endif
