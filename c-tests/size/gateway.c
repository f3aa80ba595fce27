/* A gateway from two TCP connections to one RTU line. */
#define SIZE_CLIENT_H
#include "size.h"

#ifndef WITHOUT_MBM
static mbm_client client;
static mbm_gateway gateway;
static mbm_gatewayLine line;
static mbm_gatewayConnection connections[2];
static mbm_gatewayRequest requests[2];
static const mbm_gatewayRoute routes[] = {{1, 31, 0, 0}};
#endif
static uint8_t line_frame[MBM_MAX_FRAME];

int main(void)
{
    static const mbm_port port = {.read = port_read, .write = port_write, .micros = port_micros};
#ifndef WITHOUT_MBM
    static const mbm_gatewayConfig config = {routes, &line, connections, requests, 2, 1, 1, 2};

    line.client = &client;
#endif
    USED(&port);
    USED(response);
    USED(transmit);
    USED(frame);
    USED(line_frame);
    (void)CALL(mbm_client_beginRtu(&client, &port, line_frame, sizeof line_frame));
    (void)CALL(mbm_client_setResponseTimeout(&client, 500));
    (void)CALL(mbm_gateway_begin(&gateway, &config));
    (void)CALL(mbm_gateway_open(&gateway, 0, &port));
    (void)CALL(mbm_gateway_open(&gateway, 1, &port));
    for (;;) {
        uart = CALL(mbm_gateway_poll(&gateway));
        uart = CALL(mbm_gateway_status(&gateway, ticks != 0));
        (void)CALL(mbm_gateway_close(&gateway, ticks != 0));
    }
}
