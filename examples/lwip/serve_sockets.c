/* A Modbus TCP server for four clients, over lwIP's sockets in a task of its own, which sleeps
 * until bytes come. Licence: MIT OR Apache-2.0. */
#include "sockets.h"

#include "mbm_tcp.h"

#include "lwip/sys.h"

enum { PLACES = 4, IDLE_TIME_MS = 60000 };

uint16_t served[SERVED];
static mbm_registerTable holding = {.words = served, .size = SERVED};
static mbm_unit unit = {.id = 1};
static mbm_tcp_listener listener = {.idleTimeMs = IDLE_TIME_MS};
static mbm_tcp places[PLACES] = MBM_INIT;
static mbm_server servers[PLACES] = MBM_INIT;
static uint8_t frames[PLACES][MBM_MAX_TCP_FRAME];

/* Begins a server for each connection that has arrived. */
static void accept_all(void)
{
    int i;

    while ((i = mbm_tcp_accept(&listener, places, PLACES)) >= 0) {
        const mbm_port port = mbm_tcp_port(&places[i]);

        (void)mbm_server_beginTcp(&servers[i], &port, &unit, 1, frames[i], sizeof frames[i]);
    }
}

/* Polls each server. Returns for how many microseconds the task may sleep. */
static uint32_t poll_all(void)
{
    uint32_t sleep = MBM_TCP_FOREVER, delay;
    int i;

    for (i = 0; i < PLACES; i++) {
        if (!mbm_tcp_isInUse(&places[i]))
            continue;
        if (mbm_server_poll(&servers[i]) != MBM_OK) {
            mbm_tcp_close(&places[i]); /* the link is lost */
            continue;
        }
        delay = mbm_server_pollDelay(&servers[i]);
        if (delay < sleep)
            sleep = delay;
    }
    return sleep;
}

void serve_sockets(void *none)
{
    (void)none;
    (void)mbm_unit_serveHoldingRegisters(&unit, &holding);
    while (mbm_tcp_listen(&listener, NULL, MBM_TCP_SERVICE) != 0)
        sys_msleep(1000);
    for (;;) {
        accept_all();
        (void)mbm_tcp_wait(places, PLACES, &listener, -1, poll_all());
    }
}
