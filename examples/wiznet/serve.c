/* A Modbus TCP server for four clients on a W5500 with WIZnet's ioLibrary: ten holding registers of
 * unit 1. Each client takes one of the chip's eight sockets. Licence: MIT OR Apache-2.0. */
#include "board.h"
#include "mbm_wiznet.h"

enum { PLACES = 4, REGISTERS = 10, IDLE_TIME_MS = 60000 };

static uint16_t words[REGISTERS];
static mbm_registerTable holding = {.words = words, .size = REGISTERS};
static mbm_unit unit = {.id = 1};
static mbm_wiznet places[PLACES];
static mbm_server servers[PLACES] = MBM_INIT;
static uint8_t frames[PLACES][MBM_MAX_TCP_FRAME];

int main(void)
{
    uint8_t i;

    board_begin();
    (void)mbm_unit_serveHoldingRegisters(&unit, &holding);
    for (i = 0; i < PLACES; i++) {
        places[i].number = i;
        places[i].micros = board_micros;
        places[i].idleTimeMs = IDLE_TIME_MS;
    }
    for (;;) {
        for (i = 0; i < PLACES; i++) {
            const mbm_port port = mbm_wiznet_port(&places[i]);
            const int there = mbm_wiznet_serve(&places[i]);

            if (there == 1)
                (void)mbm_server_beginTcp(&servers[i], &port, &unit, 1, frames[i],
                                          sizeof frames[i]);
            if (there > 0)
                (void)mbm_server_poll(&servers[i]);
        }
    }
}
