/* A Modbus server on a Pico, over its USB: coils, discrete inputs, holding and input registers of
 * unit 1. The host sees a serial port, for example /dev/ttyACM0. */
#include "mbm_pico.h"

#include "pico/stdlib.h"
#include "tusb.h"

static uint8_t coils[64], inputs[1] = {0x0D};
static uint16_t holding[4] = {555, 100}, readings[4] = {2301, 50};
static mbm_bitTable coilTable = {.bits = coils, .size = 512};
static mbm_bitTable inputTable = {.bits = inputs, .size = 4};
static mbm_registerTable holdingTable = {.words = holding, .size = 4};
static mbm_registerTable readingTable = {.words = readings, .size = 4};
static mbm_unit unit = {.id = 1};
static mbm_server server = MBM_INIT;
static mbm_picoUsb usb;
static uint8_t frame[MBM_MAX_FRAME];

int main(void)
{
    mbm_port port;

    tusb_init();
    mbm_unit_serveCoils(&unit, &coilTable);
    mbm_unit_serveDiscreteInputs(&unit, &inputTable);
    mbm_unit_serveHoldingRegisters(&unit, &holdingTable);
    mbm_unit_serveInputRegisters(&unit, &readingTable);
    mbm_picoUsb_open(&usb, &port);
    for (;;) {
        /* Again when the cable was pulled: part of a request may be left. */
        mbm_server_beginRtuOverTcp(&server, &port, &unit, 1, frame, sizeof frame);
        while (mbm_server_poll(&server) != MBM_LINK_LOST)
            ;
    }
}
