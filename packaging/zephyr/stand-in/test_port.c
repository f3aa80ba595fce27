/* In place of the sample: the test kit for ports, whose sources come before, on the sample's line.
 * Licence: MIT OR Apache-2.0. */
#include "../../../tests/line.h"
#include "mbm_zephyr.h"
#include "test_port.h"

static mbm_port port;
static mbm_zephyrLine line = {
    MBM_ZEPHYR_UART(DT_ALIAS(modbus_line)),
    .driver = GPIO_DT_SPEC_GET_OR(DT_PATH(zephyr_user), modbus_driver_gpios, {0}),
    .baud = 19200,
    .parity = UART_CFG_PARITY_EVEN,
};

static uint8_t begin(void *context)
{
    (void)context;
    return mbm_zephyr_open(&line, &port) != 0;
}

int main(void)
{
    test_port_begin();
    if (mbm_zephyr_open(&line, &port) != 0)
        return 1;
    test_port(&port, line.baud, 0, begin);
    return 1;
}
