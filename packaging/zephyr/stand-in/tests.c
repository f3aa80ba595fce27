/* In place of the sample, on its line: the test kit for ports, if its sources come before; else the
 * server of the module's tests. Licence: MIT OR Apache-2.0. */
#include "../../../tests/late.h"
#include "../../../tests/line.h"
#include "mbm_zephyr.h"

static mbm_port port;
static mbm_zephyrLine line = {
    MBM_ZEPHYR_UART(DT_ALIAS(modbus_line)),
    .driver = GPIO_DT_SPEC_GET_OR(DT_PATH(zephyr_user), modbus_driver_gpios, {0}),
    .baud = 19200,
    .parity = UART_CFG_PARITY_EVEN,
};

#if defined MBM_PORTTEST_H
#include "test_port.h"

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
#else
int main(void)
{
    late_begin();
    if (mbm_zephyr_open(&line, &port) != 0)
        return 1;
    late_serve(&port, line.baud);
    for (;;)
        mbm_zephyr_wait(&line, late_poll());
}
#endif
