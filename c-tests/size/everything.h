/* A server with every function that a server can serve, in RTU, ASCII and TCP. */
#ifndef SIZE_EVERYTHING_H
#define SIZE_EVERYTHING_H

#include "server.h"

#ifndef WITHOUT_MBM
static mbm_diagnostics diagnostics;
static mbm_exceptionStatus exceptions;
static mbm_serverId id;
static mbm_files files;
static mbm_fifos fifos;
static mbm_serverIdentification identification;
static mbm_custom custom;
static mbm_dataCallbacks cells;
static mbm_functionMask switches;
#endif

static inline void serve_everything(void)
{
    serve();
    (void)CALL(mbm_registerTable_serveMaskAndReadWrite(&holding));
    (void)CALL(mbm_unit_serveDiagnostics(&unit, &diagnostics));
    (void)CALL(mbm_unit_serveExceptionStatus(&unit, &exceptions));
    (void)CALL(mbm_unit_serveServerId(&unit, &id));
    (void)CALL(mbm_unit_serveFiles(&unit, &files));
    (void)CALL(mbm_unit_serveFifos(&unit, &fifos));
    (void)CALL(mbm_unit_serveIdentification(&unit, &identification));
    (void)CALL(mbm_unit_serveCustom(&unit, &custom));
    (void)CALL(mbm_unit_serveCallbacks(&unit, &cells, 3));
    (void)CALL(mbm_unit_switchFunction(&unit, &switches, 8, 0));
    (void)CALL(mbm_server_beginAscii(&server, (const mbm_port *)0, &unit, 1, frame, sizeof frame));
    (void)CALL(mbm_server_beginTcp(&server, (const mbm_port *)0, &unit, 1, frame, sizeof frame));
}

#endif
