/* Reads holding registers 100 and 101 of unit 17 on RS-485 once a second. The devicetree's alias
 * modbus-line names the UART, modbus-driver-gpios of /zephyr,user the pin at DE and /RE. Without
 * such a pin nothing is switched. Licence: MIT OR Apache-2.0. */
#include "mbm_zephyr.h"

#include <zephyr/sys/printk.h>

enum { UNIT = 17, FIRST = 100, COUNT = 2, BAUD = 19200 };

static mbm_zephyrLine serial = {
    MBM_ZEPHYR_UART(DT_ALIAS(modbus_line)),
    .driver = GPIO_DT_SPEC_GET_OR(DT_PATH(zephyr_user), modbus_driver_gpios, {0}),
    .baud = BAUD,
    .parity = UART_CFG_PARITY_EVEN,
};
static mbm_port port;
static mbm_line line = MBM_INIT;
static mbm_node meter = MBM_INIT;
static uint16_t response[COUNT];
static uint8_t frame[MBM_FRAME_BYTES(COUNT)];

int main(void)
{
    int error = mbm_zephyr_open(&serial, &port);
    uint8_t status;

    if (error != 0) {
        printk("the line does not open: %d\n", error);
        return 0;
    }
    mbm_line_beginRtu(&line, &port, frame, sizeof frame);
    mbm_line_setBaudRate(&line, serial.baud);
    mbm_node_begin(&meter, &line, UNIT, response, COUNT, NULL, 0);
    mbm_node_setResponseTimeout(&meter, 500); /* milliseconds */
    for (;;) {
        status = mbm_node_readHoldingRegisters(&meter, FIRST, COUNT);
        if (status == MBM_OK)
            printk("registers %d and %d: %u %u\n", FIRST, FIRST + 1, response[0], response[1]);
        else
            printk("no registers: %s\n", mbm_status_text(status));
        k_msleep(1000);
    }
}
