/* The ports for Linux in the test kit for ports: a terminal and TCP. That of UDP carries whole
 * frames of Modbus TCP alone, and the kit sends bytes. None has a baud rate here, so no time on a
 * wire is judged. */
#define _GNU_SOURCE
#include "mbm_tcp.h"
#include "mbm_tty.h"
#include "await.h"
#include "clock.h"
#include "porttest.h"
#include "pty.h"
#include "test.h"

#include <sys/socket.h>
#include <unistd.h>

static mbm_portTest test;
static mbm_port near_port, far_port;

static void begin(void)
{
    memset(&test, 0, sizeof test);
    test.port = &near_port;
    test.other = &far_port;
    test.reference = raw_micros;
    test.say = porttest_say;
}

fixture each_test = {begin, NULL};

static void passes(void)
{
    porttest_passes(&test);
}

/* --- a terminal */

static pty line;
static mbm_tty here, there;

static uint8_t open_again(void *context)
{
    mbm_tty_close(&here);
    return mbm_tty_open(&here, line.path, 19200, 'E', 1) != 0;
}

TEST(the_port_of_a_terminal)
{
    pty_open(&line);
    assert_int_equal(mbm_tty_open(&here, line.path, 19200, 'E', 1), 0);
    assert_int_equal(mbm_tty_attach(&there, line.ours), 0);
    near_port = mbm_tty_port(&here);
    far_port = mbm_tty_port(&there);
    test.holds = 256;
    test.begin = open_again;
    passes();
    mbm_tty_close(&here);
    pty_close(&line);
}

/* --- TCP */

static mbm_tcp_listener listener;
static mbm_tcp server, client;

/* Connects, and again. */
static uint8_t connect_again(void *context)
{
    static mbm_tcp_addresses addresses;
    char service[8];

    mbm_tcp_close(&client);
    mbm_tcp_close(&server);
    snprintf(service, sizeof service, "%u", listener.port);
    if (mbm_tcp_open(&client, &addresses, "127.0.0.1", service) != 0)
        return 1;
    AWAIT(mbm_tcp_accept(&listener, &server, 1) >= 0);
    return 0;
}

static void hang_up(void *context)
{
    mbm_tcp_close(&server);
}

TEST(the_port_of_a_tcp_connection)
{
    assert_int_equal(mbm_tcp_listen(&listener, "127.0.0.1", "0"), 0);
    assert_int_equal(connect_again(NULL), 0);
    near_port = mbm_tcp_port(&client);
    far_port = mbm_tcp_port(&server);
    test.holds = 256;
    test.begin = connect_again;
    test.hangUp = hang_up;
    passes();
    mbm_tcp_close(&client);
    mbm_tcp_close(&server);
    mbm_tcp_closeListener(&listener);
}
