/* The port for a WIZnet chip in the test kit for ports, on the model of a W5500: one socket of the
 * chip is a client of another. The network has no baud rate, so no time on a wire is judged. */
#include "await.h"
#include "chip_model.h"
#include "mbm_wiznet.h"
#include "porttest.h"
#include "test.h"

enum { STEP = 2 /* microseconds */ };

static mbm_wiznet near_end, far_end;
static mbm_port near_port, far_port;
static mbm_portTest test;

/* The clock goes on while the program looks at it. */
static uint32_t micros(void *context)
{
    (void)context;
    return the_chip.micros += STEP;
}

/* Connects, and again. */
static uint8_t begin(void *context)
{
    (void)context;
    mbm_wiznet_disconnect(&near_end);
    AWAIT(mbm_wiznet_serve(&far_end) == 0);
    if (mbm_wiznet_connect(&near_end) != MBM_PENDING)
        return 1;
    AWAIT(mbm_wiznet_status(&near_end) == MBM_OK);
    AWAIT(mbm_wiznet_serve(&far_end) == 1);
    return 0;
}

static void hang_up(void *context)
{
    (void)context;
    mbm_wiznet_disconnect(&far_end);
}

static void setup(void)
{
    chip_begin();
    memset(&near_end, 0, sizeof near_end);
    memset(&far_end, 0, sizeof far_end);
    near_end.micros = far_end.micros = micros;
    near_end.number = 7;
    near_end.address[0] = 127;
    near_end.address[3] = 1;
    near_end.port = chip_port();
    assert_int_equal(begin(NULL), 0);
    near_port = mbm_wiznet_port(&near_end);
    far_port = mbm_wiznet_port(&far_end);
    test = porttest_connection(&near_port, &far_port, begin, hang_up);
}

fixture each_test = {setup, chip_end};

TEST(the_port_passes_the_test_kit)
{
    porttest_passes(&test);
}

TEST(the_port_passes_it_if_the_chip_sends_and_shows_a_few_bytes_at_a_time)
{
    the_chip.most_sent = 7;
    the_chip.most_received = 5;
    porttest_passes(&test);
}

TEST(the_port_passes_it_if_the_peer_acknowledges_late)
{
    the_chip.busy_sends = 200;
    porttest_passes(&test);
}
