/* The port for lwIP's raw API in the test kit for ports, in a task beside lwIP's own thread: a
 * connection and its far end. There is no baud rate, so no time on a wire is judged. */
#include "await.h"
#include "clock.h"
#include "lwip_relay.h"
#include "mbm_lwip.h"
#include "porttest.h"
#include "test.h"

enum { PORT = 502 };

static mbm_lwip_listener listener;
static mbm_lwip near_end, far_end;
static mbm_port near_port, far_port;

static void yield(void *context)
{
    poll(NULL, 0, 1);
}

/* Connects, and again. */
static uint8_t begin(void *context)
{
    mbm_lwip_close(&near_end);
    mbm_lwip_close(&far_end);
    if (mbm_lwip_open(&near_end, &relay_loop, PORT) != MBM_PENDING)
        return 1;
    AWAIT(mbm_lwip_accept(&listener) == 0);
    AWAIT(mbm_lwip_status(&near_end) == MBM_OK);
    return 0;
}

static void hang_up(void *context)
{
    mbm_lwip_close(&far_end);
}

TEST(the_port_passes_the_test_kit)
{
    static mbm_portTest test;

    relay_begin();
    listener.isTask = near_end.isTask = 1;
    OK(mbm_lwip_listen(&listener, NULL, PORT, &far_end, 1));
    assert_int_equal(begin(NULL), 0);
    near_port = mbm_lwip_port(&near_end);
    far_port = mbm_lwip_port(&far_end);
    test = porttest_connection(&near_port, &far_port, begin, hang_up);
    test.reference = raw_micros;
    test.yield = yield;
    porttest_passes(&test);
    mbm_lwip_close(&near_end);
    mbm_lwip_close(&far_end);
    mbm_lwip_closeListener(&listener);
}
