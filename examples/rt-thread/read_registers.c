/* The shell's command read_registers: reads holding registers 100 and 101 of unit 17 on RS-485
 * five times. The package's options set UART and pin. Licence: MIT OR Apache-2.0. */
#include "mbm_rt_thread.h"

enum { UNIT = 17, FIRST = 100, COUNT = 2, BAUD = 19200, TIMES = 5 };

static mbm_rtThreadLine serial = {
    .uart = MBM_EXAMPLE_UART,
    .driverPin = MBM_EXAMPLE_DRIVER_PIN,
    .baud = BAUD,
    .parity = PARITY_EVEN,
    .tail = MBM_EXAMPLE_TAIL,
};
static mbm_port port;
static mbm_line line = MBM_INIT;
static mbm_node meter = MBM_INIT;
static uint16_t response[COUNT];
static uint8_t frame[MBM_FRAME_BYTES(COUNT)];

static void read_once(void)
{
    uint8_t status = mbm_node_readHoldingRegisters(&meter, FIRST, COUNT);

    if (status == MBM_OK)
        rt_kprintf("registers %d and %d: %d %d\n", FIRST, FIRST + 1, response[0], response[1]);
    else
        rt_kprintf("no registers: %s\n", mbm_status_text(status));
}

static int read_registers(int argc, char **argv)
{
    rt_err_t error = mbm_rtThread_open(&serial, &port);
    int i;

    (void)argc;
    (void)argv;
    if (error != RT_EOK) {
        if (rt_device_find(serial.uart) == RT_NULL)
            rt_kprintf("there is no device %s; the command list_device shows all\n", serial.uart);
        else
            rt_kprintf("%s does not open: %d\n", serial.uart, (int)error);
        return (int)error;
    }
    mbm_line_beginRtu(&line, &port, frame, sizeof frame);
    mbm_line_setBaudRate(&line, BAUD);
    mbm_node_begin(&meter, &line, UNIT, response, COUNT, RT_NULL, 0);
    mbm_node_setResponseTimeout(&meter, 500); /* milliseconds */
    for (i = 0; i < TIMES; i++) {
        read_once();
        rt_thread_mdelay(1000);
    }
    mbm_rtThread_close(&serial);
    return 0;
}
MSH_CMD_EXPORT(read_registers, read two holding registers of unit 17);
