/* In place of the example, on its line: the test kit for ports, if its sources come before; else
 * the server of the component's tests. Licence: MIT OR Apache-2.0. */
#include "../../../tests/late.h"
#include "../../../tests/line.h"
#include "mbm_esp_idf.h"
#include "sdkconfig.h"

static mbm_port port;
static mbm_espIdfLine line = {
    .uart = (uart_port_t)CONFIG_METER_UART,
    .txPin = CONFIG_METER_TX_PIN,
    .rxPin = CONFIG_METER_RX_PIN,
    .driverPin = CONFIG_METER_DRIVER_PIN,
    .driver = MBM_ESP_IDF_DRIVER_BY_PIN,
    .baud = CONFIG_METER_BAUD,
    .parity = UART_PARITY_EVEN,
};

#if defined MBM_PORTTEST_H
#include "test_port.h"

static uint8_t begin(void *context)
{
    (void)context;
    mbm_espIdf_close(&line);
    return mbm_espIdf_open(&line, &port) != ESP_OK;
}

void app_main(void)
{
    test_port_begin();
    ESP_ERROR_CHECK(mbm_espIdf_open(&line, &port));
    test_port(&port, CONFIG_METER_BAUD, 0, begin);
}
#else
void app_main(void)
{
    late_begin();
    ESP_ERROR_CHECK(mbm_espIdf_open(&line, &port));
    late_serve(&port, CONFIG_METER_BAUD);
    for (;;)
        mbm_espIdf_wait(late_poll());
}
#endif
