/* In place of the sample: the server of the module's tests on the sample's line. Licence: MIT OR
 * Apache-2.0. */
#include "../../../tests/late.h"
#include "mbm_zephyr.h"

static mbm_zephyrLine line = {
    MBM_ZEPHYR_UART(DT_ALIAS(modbus_line)),
    .driver = GPIO_DT_SPEC_GET_OR(DT_PATH(zephyr_user), modbus_driver_gpios, {0}),
    .baud = 19200,
    .parity = UART_CFG_PARITY_EVEN,
};

int main(void)
{
    mbm_port port;

    late_begin();
    if (mbm_zephyr_open(&line, &port) != 0)
        return 1;
    late_serve(&port, line.baud);
    for (;;)
        mbm_zephyr_wait(&line, late_poll());
}
