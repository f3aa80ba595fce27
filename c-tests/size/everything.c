/* A client and a server with everything: the ten functions, and every family
 * that a server serves, on a serial line in RTU and ASCII and over TCP. */
#include "server.h"

#ifndef WITHOUT_MBM
static mbm_diagnostics diagnostics;
static mbm_exceptionStatus exceptions;
static mbm_serverId id;
static mbm_files files;
static mbm_fifos fifos;
static mbm_identification identification;
static mbm_custom custom;
static mbm_cells cells;
static mbm_switches switches;
#endif

int main(void)
{
    serve();
    begin();
    (void)CALL(mbm_server_serveMaskAndReadWrite(&holding));
    (void)CALL(mbm_server_serveDiagnostics(&unit, &diagnostics));
    (void)CALL(mbm_server_serveExceptionStatus(&unit, &exceptions));
    (void)CALL(mbm_server_serveServerId(&unit, &id));
    (void)CALL(mbm_server_serveFiles(&unit, &files));
    (void)CALL(mbm_server_serveFifos(&unit, &fifos));
    (void)CALL(mbm_server_serveIdentification(&unit, &identification));
    (void)CALL(mbm_server_serveCustom(&unit, &custom));
    (void)CALL(mbm_server_serveCallbacks(&unit, &cells, 3));
    (void)CALL(mbm_server_switchOff(&unit, &switches, 8));
    (void)CALL(mbm_server_beginAscii(&server, (const mbm_port *)0, &unit, 1, frame, sizeof frame));
    (void)CALL(mbm_server_beginTcp(&server, (const mbm_port *)0, &unit, 1, frame, sizeof frame));
    for (;;) {
        uart = CALL(mbm_server_poll(&server));
        uart = CALL(mbm_master_readCoils(&node, 2, 10));
        uart = CALL(mbm_master_readDiscreteInputs(&node, 2, 10));
        uart = CALL(mbm_master_readHoldingRegisters(&node, 2, 10));
        uart = CALL(mbm_master_readInputRegisters(&node, 2, 10));
        uart = CALL(mbm_master_writeSingleCoil(&node, 2, 1));
        uart = CALL(mbm_master_writeSingleRegister(&node, 2, 10));
        uart = CALL(mbm_master_writeMultipleCoils(&node, 2, 10));
        uart = CALL(mbm_master_writeMultipleRegisters(&node, 2, 10));
        uart = CALL(mbm_master_maskWriteRegister(&node, 2, 0xFF00, 0x0012));
        uart = CALL(mbm_master_readWriteMultipleRegisters(&node, 2, 10, 20, 10));
        (void)CALL(mbm_master_setTransmitBuffer(&node, 0, 1));
        uart = (uint8_t)CALL(mbm_master_getResponseBuffer(&node, 0));
    }
}
