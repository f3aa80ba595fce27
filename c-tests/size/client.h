/* What the measured programs with a client share. See size.h. The data and the reply of a
 * request are in the buffers of size.h. */
#ifndef SIZE_CLIENT_H
#define SIZE_CLIENT_H

#ifdef WITHOUT_MBM
#include "size.h"
#else
#include "size.h"
static mbm_client client;
static mbm_clientRequest request;
#endif

static mbm_port port;

static inline void begin_port(void)
{
    port.read = port_read;
    port.write = port_write;
    port.micros = port_micros;
    USED(&port);
    USED(response);
    USED(transmit);
    USED(frame);
}

/* The setup of a plan with a table of fields and its storage: the arrays `positions`, `reads` and
 * `data`. Its other members follow. */
#define PLAN_SETUP(table, ...)                                                                     \
    {                                                                                              \
        .fields = (table), .positions = positions, .reads = reads, .data = data,                   \
        .requests = &request, .fieldCount = sizeof positions / sizeof positions[0],                \
        .dataWords = sizeof data / sizeof data[0], .requestCount = 1, __VA_ARGS__                  \
    }

/* Queues a request of every function of the standard, and of one user-defined function. */
static inline void every_function(void)
{
    static const mbm_rule rule = {MBM_RULE_FIXED, 5, 0};

    USED(&rule);
#ifndef WITHOUT_MBM
    request.unit = 1;
    request.data = transmit;
    request.reply = response;
    request.replyBytes = sizeof response;
#endif
    uart = CALL(mbm_client_readCoils(&client, &request, 2, 10));
    uart = CALL(mbm_client_readDiscreteInputs(&client, &request, 2, 10));
    uart = CALL(mbm_client_readHoldingRegisters(&client, &request, 2, 10));
    uart = CALL(mbm_client_readInputRegisters(&client, &request, 2, 10));
    uart = CALL(mbm_client_writeSingleCoil(&client, &request, 2, 1));
    uart = CALL(mbm_client_writeSingleRegister(&client, &request, 2, 10));
    uart = CALL(mbm_client_readExceptionStatus(&client, &request));
    uart = CALL(mbm_client_diagnostics(&client, &request, 0, 1));
    uart = CALL(mbm_client_getCommEventCounter(&client, &request));
    uart = CALL(mbm_client_getCommEventLog(&client, &request));
    uart = CALL(mbm_client_writeMultipleCoils(&client, &request, 2, 10));
    uart = CALL(mbm_client_writeMultipleRegisters(&client, &request, 2, 10));
    uart = CALL(mbm_client_reportServerId(&client, &request));
    uart = CALL(mbm_client_readFileRecord(&client, &request, 4, 1, 2));
    uart = CALL(mbm_client_writeFileRecord(&client, &request, 4, 1, 2));
    uart = CALL(mbm_client_maskWriteRegister(&client, &request, 2, 0xFF00, 0x0012));
    uart = CALL(mbm_client_readWriteMultipleRegisters(&client, &request, 2, 10, 20, 10));
    uart = CALL(mbm_client_readFifoQueue(&client, &request, 2));
    uart = CALL(mbm_client_readDeviceIdentification(&client, &request, 1, 0));
    uart = CALL(mbm_client_custom(&client, &request, 0x41, 2, &rule));
    uart = CALL(mbm_client_poll(&client));
}

#endif
