/* In place of the example, on its line: the test kit for ports, if its sources come before; else
 * the server of the package's tests. Licence: MIT OR Apache-2.0. */
#include "../tests/late.h"
#include "../tests/line.h"
#include "mbm_rt_thread.h"

static mbm_port port;
static mbm_rtThreadLine line = {
    .uart = MBM_EXAMPLE_UART,
    .driverPin = MBM_EXAMPLE_DRIVER_PIN,
    .baud = 19200,
    .parity = PARITY_EVEN,
    .tail = MBM_EXAMPLE_TAIL,
};

#if defined MBM_PORTTEST_H
#include "test_port.h"

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
#else
static int serve_late(int argc, char **argv)
{
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
#endif
