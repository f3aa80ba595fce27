/* In place of the example: the server of the component's tests on the example's line. Licence: MIT
 * OR Apache-2.0. */
#include "../../../tests/late.h"
#include "mbm_esp_idf.h"

#include "sdkconfig.h"

static mbm_espIdfLine line = {
    .uart = (uart_port_t)CONFIG_METER_UART,
    .txPin = CONFIG_METER_TX_PIN,
    .rxPin = CONFIG_METER_RX_PIN,
    .driverPin = CONFIG_METER_DRIVER_PIN,
    .driver = MBM_ESP_IDF_DRIVER_BY_PIN,
    .baud = CONFIG_METER_BAUD,
    .parity = UART_PARITY_EVEN,
};

void app_main(void)
{
    mbm_port port;

    late_begin();
    ESP_ERROR_CHECK(mbm_espIdf_open(&line, &port));
    late_serve(&port, CONFIG_METER_BAUD);
    for (;;)
        mbm_espIdf_wait(late_poll());
}
