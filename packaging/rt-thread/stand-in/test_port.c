/* In place of the example: the test kit for ports, whose sources come before, on the example's
 * line. Licence: MIT OR Apache-2.0. */
#include "../tests/line.h"
#include "mbm_rt_thread.h"
#include "test_port.h"

static mbm_port port;
static mbm_rtThreadLine line = {
    .uart = MBM_EXAMPLE_UART,
    .driverPin = MBM_EXAMPLE_DRIVER_PIN,
    .baud = 19200,
    .parity = PARITY_EVEN,
    .tail = MBM_EXAMPLE_TAIL,
};

static uint8_t begin(void *context)
{
    (void)context;
    mbm_rtThread_close(&line);
    return mbm_rtThread_open(&line, &port) != RT_EOK;
}

static int run_kit(int argc, char **argv)
{
    (void)argc;
    (void)argv;
    test_port_begin();
    if (mbm_rtThread_open(&line, &port) != RT_EOK)
        return 1;
    test_port(&port, line.baud, 1, begin); /* its write waits while the bytes leave */
    return 1;
}
MSH_CMD_EXPORT(run_kit, test the port of the line);
