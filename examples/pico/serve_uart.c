/* A Modbus server on a Pico, on an RS-485 line: GPIO 4 sends, GPIO 5 receives, GPIO 6 is at DE and
 * /RE. */
#include "mbm_pico.h"

#include "pico/stdlib.h"

static uint16_t holding[4] = {555, 100};
static mbm_registerTable holdingTable = {.words = holding, .size = 4};
static mbm_unit unit = {.id = 1};
static mbm_server server = MBM_INIT;
static mbm_picoUart line;
static uint8_t frame[MBM_MAX_FRAME];

int main(void)
{
    mbm_port port;

    line.uart = uart1;
    line.baud = 19200;
    line.parity = UART_PARITY_EVEN;
    line.txPin = 4;
    line.rxPin = 5;
    line.driverPin = 6;
    line.hasDriver = true;
    if (mbm_picoUart_open(&line, &port) != MBM_OK)
        return 1;
    mbm_unit_serveHoldingRegisters(&unit, &holdingTable);
    mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame);
    mbm_server_setBaudRate(&server, line.baud);
    for (;;)
        mbm_server_poll(&server);
}
