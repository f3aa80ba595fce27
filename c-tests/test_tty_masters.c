/* Blocking masters over a terminal and over a TCP socket without a device: each request
 * ends with its status, whenever the port was made and whichever masters share it. If one
 * does not end, a watchdog ends the program. */
#define _GNU_SOURCE
#include "await.h"
#include "mbm_tcp.h"
#include "mbm_tty.h"
#include "pty.h"
#include "test.h"

#include <unistd.h>

enum { TIMEOUT_MS = 20 };

typedef struct node {
    mbm_line line;
    mbm_node node;
    uint16_t words[2];
    uint8_t frame[MBM_FRAME_BYTES(2)];
} node;

static const mbm_tty_options OPTIONS = {.baud = 115200, .parity = 'N', .stop = 1};
static pty line;
static mbm_tty tty;
static mbm_tcp tcp;
static mbm_tcp_addresses addresses;
static mbm_tcp_listener listener;
static node first, second;
static char service[8];

static void begin(void)
{
    alarm(PATIENCE_MS / 1000);
    memset(&tty, 0, sizeof tty);
    memset(&tcp, 0, sizeof tcp);
    memset(&first, 0, sizeof first);
    memset(&second, 0, sizeof second);
    pty_open(&line);
    assert_int_equal(mbm_tcp_listen(&listener, "127.0.0.1", "0"), 0);
    snprintf(service, sizeof service, "%u", listener.port);
}

static void end(void)
{
    mbm_tty_close(&tty);
    mbm_tcp_close(&tcp);
    mbm_tcp_closeListener(&listener);
    pty_close(&line);
    alarm(0);
}

fixture each_test = {begin, end};

static void begin_node(node *n, uint8_t unit, const mbm_port *port)
{
    OK(mbm_line_beginRtu(&n->line, port, n->frame, sizeof n->frame));
    OK(mbm_node_begin(&n->node, &n->line, unit, n->words, 2, n->words, 2));
    OK(mbm_node_setResponseTimeout(&n->node, TIMEOUT_MS));
    OK(mbm_line_setQuietTime(&n->line, 0));
}

static void times_out(node *n)
{
    IS(MBM_RESPONSE_TIMED_OUT, mbm_node_readHoldingRegisters(&n->node, 0, 1));
}

static void both_time_out(void)
{
    times_out(&first);
    times_out(&second);
    times_out(&first);
}

static mbm_port open_tty(void)
{
    assert_int_equal(mbm_tty_openWith(&tty, line.path, &OPTIONS), 0);
    return mbm_tty_port(&tty);
}

static mbm_port open_socket(void)
{
    assert_int_equal(mbm_tcp_open(&tcp, &addresses, "127.0.0.1", service), 0);
    return mbm_tcp_port(&tcp);
}

TEST(a_tty_closed_and_opened_again_keeps_its_port)
{
    mbm_port port = open_tty();

    begin_node(&first, 1, &port);
    times_out(&first);
    mbm_tty_close(&tty);
    IS(MBM_LINK_LOST, mbm_node_readHoldingRegisters(&first.node, 0, 1));
    assert_int_equal(mbm_tty_openWith(&tty, line.path, &OPTIONS), 0);
    times_out(&first);
}

TEST(a_port_made_before_the_tty_is_open_works_once_it_is)
{
    mbm_port port = mbm_tty_port(&tty);

    begin_node(&first, 1, &port);
    /* The descriptor in a zeroed tty is 0, the program's standard input. */
    IS(MBM_LINK_LOST, mbm_node_readHoldingRegisters(&first.node, 0, 1));
    assert_int_equal(tty.error, EBADF);
    assert_int_equal(mbm_tty_wait(&tty, MBM_TTY_FOREVER), -1);
    mbm_tty_close(&tty);
    mbm_tty_detach(&tty);
    assert_int_equal(mbm_tty_openWith(&tty, line.path, &OPTIONS), 0);
    times_out(&first);
}

TEST(two_masters_on_one_tty_each_end_in_time)
{
    mbm_port port = open_tty();

    begin_node(&first, 1, &port);
    port = mbm_tty_port(&tty);
    begin_node(&second, 2, &port);
    both_time_out();
}

TEST(two_masters_with_one_port_struct_each_end_in_time)
{
    mbm_port port = open_tty();

    begin_node(&first, 1, &port);
    begin_node(&second, 2, &port);
    both_time_out();
}

/* A clock that moves by at most a millisecond between two looks at it. So a master whose process
 * did not run for a while still finds the noise before its timeout. */
static uint32_t patient_micros(void *context)
{
    static uint32_t before, shown;
    const uint32_t now = mbm_tty_port(&tty).micros(context), passed = now - before;

    before = now;
    shown += passed < 1000 ? passed : 1000;
    return shown;
}

/* Bytes that are no reply have arrived before the request. */
TEST(noise_does_not_keep_a_request_from_ending)
{
    mbm_port port = open_tty();

    port.micros = patient_micros;
    begin_node(&first, 1, &port);
    assert_int_equal(write(line.ours, "\x07\x03\x02", 3), 3);
    IS(MBM_RESPONSE_TIMED_OUT, mbm_node_readHoldingRegisters(&first.node, 0, 1));
}

TEST(a_socket_closed_and_opened_again_keeps_its_port)
{
    mbm_port port = open_socket();

    begin_node(&first, 1, &port);
    times_out(&first);
    mbm_tcp_close(&tcp);
    IS(MBM_LINK_LOST, mbm_node_readHoldingRegisters(&first.node, 0, 1));
    assert_int_equal(mbm_tcp_open(&tcp, &addresses, "127.0.0.1", service), 0);
    times_out(&first);
}

TEST(a_port_made_before_the_socket_is_open_works_once_it_is)
{
    mbm_port port = mbm_tcp_port(&tcp);

    begin_node(&first, 1, &port);
    IS(MBM_LINK_LOST, mbm_node_readHoldingRegisters(&first.node, 0, 1));
    assert_int_equal(mbm_tcp_open(&tcp, &addresses, "127.0.0.1", service), 0);
    times_out(&first);
}

TEST(two_masters_on_one_socket_each_end_in_time)
{
    mbm_port port = open_socket();

    begin_node(&first, 1, &port);
    begin_node(&second, 2, &port);
    both_time_out();
}
