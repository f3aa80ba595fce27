/* The shell's command read_registers: reads holding registers 100 and 101 of unit 17 on RS-485
 * five times. The package's options set UART and pin. Licence: MIT OR Apache-2.0. */
#include "mbm_rt_thread.h"

enum { UNIT = 17, FIRST = 100, COUNT = 2, BAUD = 19200, TIMES = 5 };

static mbm_rtThreadLine line = {
    .uart = MBM_EXAMPLE_UART,
    .driverPin = MBM_EXAMPLE_DRIVER_PIN,
    .baud = BAUD,
    .parity = PARITY_EVEN,
    .tail = MBM_EXAMPLE_TAIL,
};
static mbm_port port;
static mbm_master master = MBM_INIT;
static uint16_t response[COUNT];
static uint8_t frame[MBM_FRAME_BYTES(COUNT)];

static void read_once(void)
{
    uint8_t status = mbm_master_readHoldingRegisters(&master, FIRST, COUNT);

    if (status == MBM_OK)
        rt_kprintf("registers %d and %d: %d %d\n", FIRST, FIRST + 1, response[0], response[1]);
    else
        rt_kprintf("no registers: %s\n", mbm_status_text(status));
}

static int read_registers(int argc, char **argv)
{
    rt_err_t error = mbm_rtThread_open(&line, &port);
    int i;

    (void)argc;
    (void)argv;
    if (error != RT_EOK) {
        rt_kprintf("%s does not open: %d\n", line.uart, (int)error);
        return (int)error;
    }
    mbm_master_setBuffers(&master, response, COUNT, RT_NULL, 0, frame, sizeof frame);
    mbm_master_beginRtu(&master, UNIT, &port);
    mbm_master_setBaudRate(&master, BAUD);
    mbm_master_setResponseTimeout(&master, 500); /* milliseconds */
    for (i = 0; i < TIMES; i++) {
        read_once();
        rt_thread_mdelay(1000);
    }
    mbm_rtThread_close(&line);
    return 0;
}
MSH_CMD_EXPORT(read_registers, read two holding registers of unit 17);
