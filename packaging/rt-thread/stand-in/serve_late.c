/* In place of the example: the server of the package's tests on the example's line. Licence: MIT OR
 * Apache-2.0. */
#include "../tests/late.h"
#include "mbm_rt_thread.h"

static mbm_rtThreadLine line = {
    .uart = MBM_EXAMPLE_UART,
    .driverPin = MBM_EXAMPLE_DRIVER_PIN,
    .baud = 19200,
    .parity = PARITY_EVEN,
    .tail = MBM_EXAMPLE_TAIL,
};

static int serve_late(int argc, char **argv)
{
    mbm_port port;

    (void)argc;
    (void)argv;
    late_begin();
    if (mbm_rtThread_open(&line, &port) != RT_EOK)
        return 1;
    late_serve(&port, line.baud);
    for (;;)
        mbm_rtThread_wait(late_poll());
}
MSH_CMD_EXPORT(serve_late, serve holding registers of unit 17);
