/* A Modbus TCP server for four clients, over lwIP's raw API in a main loop (NO_SYS): ten holding
 * registers of unit 1. Licence: MIT OR Apache-2.0. */
#include "board.h"
#include "mbm_lwip.h"

enum { PLACES = 4, REGISTERS = 10, IDLE_TIME_MS = 60000 };

static uint16_t words[REGISTERS];
static mbm_registerTable holding = {.words = words, .size = REGISTERS};
static mbm_unit unit = {.id = 1};
static mbm_lwip_listener listener = {.idleTimeMs = IDLE_TIME_MS};
static mbm_lwip places[PLACES] = MBM_INIT;
static mbm_server servers[PLACES] = MBM_INIT;
static uint8_t frames[PLACES][MBM_MAX_TCP_FRAME];

int main(void)
{
    int i;

    board_begin();
    (void)mbm_unit_serveHoldingRegisters(&unit, &holding);
    if (mbm_lwip_listen(&listener, NULL, MBM_LWIP_PORT, places, PLACES) != MBM_OK)
        board_print(mbm_lwip_text(listener.error));
    for (;;) {
        board_poll();
        while ((i = mbm_lwip_accept(&listener)) >= 0) {
            const mbm_port port = mbm_lwip_port(&places[i]);

            (void)mbm_server_beginTcp(&servers[i], &port, &unit, 1, frames[i], sizeof frames[i]);
        }
        for (i = 0; i < PLACES; i++)
            if (mbm_lwip_isInUse(&places[i]) && mbm_server_poll(&servers[i]) != MBM_OK)
                mbm_lwip_close(&places[i]);
    }
}
