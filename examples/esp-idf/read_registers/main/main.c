/* Reads holding registers 100 and 101 of a meter on RS-485 once a second. `idf.py menuconfig`
 * sets pins, rate and unit id, in its menu "Read registers". Licence: MIT OR Apache-2.0. */
#include "mbm_esp_idf.h"

#include "freertos/FreeRTOS.h"
#include "freertos/task.h"
#include "sdkconfig.h"

#include <stdio.h>

enum { FIRST = 100, COUNT = 2 };

#if defined CONFIG_METER_DRIVER_BY_UART
#define DRIVER MBM_ESP_IDF_DRIVER_BY_UART
#elif defined CONFIG_METER_DRIVER_BY_PIN
#define DRIVER MBM_ESP_IDF_DRIVER_BY_PIN
#else
#define DRIVER MBM_ESP_IDF_NO_DRIVER
#define CONFIG_METER_DRIVER_PIN UART_PIN_NO_CHANGE
#endif

static mbm_espIdfLine serial = {
    .uart = (uart_port_t)CONFIG_METER_UART,
    .txPin = CONFIG_METER_TX_PIN,
    .rxPin = CONFIG_METER_RX_PIN,
    .driverPin = CONFIG_METER_DRIVER_PIN,
    .driver = DRIVER,
    .baud = CONFIG_METER_BAUD,
    .parity = UART_PARITY_EVEN,
};
static mbm_port port;
static mbm_line line = MBM_INIT;
static mbm_node meter = MBM_INIT;
static uint16_t response[COUNT];
static uint8_t frame[MBM_FRAME_BYTES(COUNT)];

void app_main(void)
{
    uint8_t status;

    ESP_ERROR_CHECK(mbm_espIdf_open(&serial, &port));
    mbm_line_beginRtu(&line, &port, frame, sizeof frame);
    mbm_line_setBaudRate(&line, CONFIG_METER_BAUD);
    mbm_node_begin(&meter, &line, CONFIG_METER_UNIT, response, COUNT, NULL, 0);
    mbm_node_setResponseTimeout(&meter, 500); /* milliseconds */
    for (;;) {
        status = mbm_node_readHoldingRegisters(&meter, FIRST, COUNT);
        if (status == MBM_OK)
            printf("registers %d and %d: %u %u\n", FIRST, FIRST + 1, response[0], response[1]);
        else
            printf("no registers: %s\n", mbm_status_text(status));
        vTaskDelay(pdMS_TO_TICKS(1000));
    }
}
