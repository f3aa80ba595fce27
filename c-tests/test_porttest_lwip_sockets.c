/* The port for lwIP's sockets in the test kit for ports, in a task beside lwIP's own thread: a
 * connection and its far end. There is no baud rate, so no time on a wire is judged. */
#include "await.h"
#include "clock.h"
#include "lwip_relay.h"
#include "mbm_tcp.h"
#include "porttest.h"
#include "test.h"

#define SERVICE "502"

static mbm_tcp_listener listener;
static mbm_tcp near_end, far_end;
static mbm_tcp_addresses addresses;
static mbm_port near_port, far_port;

static void yield(void *context)
{
    poll(NULL, 0, 1);
}

/* Connects, and again. */
static uint8_t begin(void *context)
{
    mbm_tcp_close(&near_end);
    mbm_tcp_close(&far_end);
    if (mbm_tcp_open(&near_end, &addresses, "127.0.0.1", SERVICE) != 0)
        return 1;
    AWAIT(mbm_tcp_accept(&listener, &far_end, 1) == 0);
    AWAIT(mbm_tcp_isConnected(&near_end) == 1);
    return 0;
}

static void hang_up(void *context)
{
    mbm_tcp_close(&far_end);
}

TEST(the_port_passes_the_test_kit)
{
    static mbm_portTest test;

    relay_begin();
    assert_int_equal(mbm_tcp_listen(&listener, NULL, SERVICE), 0);
    assert_int_equal(begin(NULL), 0);
    near_port = mbm_tcp_port(&near_end);
    far_port = mbm_tcp_port(&far_end);
    test = porttest_connection(&near_port, &far_port, begin, hang_up);
    test.reference = raw_micros;
    test.yield = yield;
    porttest_passes(&test);
    mbm_tcp_close(&near_end);
    mbm_tcp_close(&far_end);
    mbm_tcp_closeListener(&listener);
}
