/* A gateway of two RTU lines and three connections, all in memory, with one clock. The test
 * is the TCP clients and the devices. */
#ifndef GATEWAY_BENCH_H
#define GATEWAY_BENCH_H

#include "memory_port.h"

enum { BENCH_LINES = 2, BENCH_CONNECTIONS = 3, BENCH_REQUESTS = 8 };

typedef struct gateway_bench {
    mbm_gateway gateway;
    mbm_gatewayConfig config;
    mbm_gatewayLine lines[BENCH_LINES];
    mbm_client clients[BENCH_LINES];
    mbm_gatewayConnection connections[BENCH_CONNECTIONS];
    mbm_gatewayRequest requests[BENCH_REQUESTS];
    memory_port wires[BENCH_LINES], sockets[BENCH_CONNECTIONS];
    uint8_t frames[BENCH_LINES][MBM_MAX_ASCII_FRAME];
} gateway_bench;

/* Begins all of it: response timeout 100 ms, no retries; all connections open. */
void gateway_bench_start(gateway_bench *b, const mbm_gatewayRoute *routes, unsigned count);

/* Opens a connection again, with nothing in its socket. */
void gateway_bench_open(gateway_bench *b, unsigned connection);

/* Lets the time of pollDelay pass, or less if bytes have arrived, and polls the gateway once.
 * Returns 0 when there is nothing more to do. */
int gateway_bench_step(gateway_bench *b);

/* Polls until there is nothing more to do. */
void gateway_bench_settle(gateway_bench *b);

/* A request arrives from a TCP client. The PDU has `length` bytes. */
void gateway_bench_ask(gateway_bench *b, unsigned connection, unsigned transaction, uint8_t unit,
                       const char *pdu, size_t length);

/* Expects a frame to the TCP client as the next one. */
void gateway_bench_expect(gateway_bench *b, unsigned connection, unsigned transaction, uint8_t unit,
                          const char *pdu, size_t length);

/* Expects an RTU frame on a line as the next one. */
void gateway_bench_on_line(gateway_bench *b, unsigned line, uint8_t unit, const char *pdu,
                           size_t length);

/* A device on a line replies. */
void gateway_bench_reply(gateway_bench *b, unsigned line, uint8_t unit, const char *pdu,
                         size_t length);

/* The PDU is a string literal. */
#define ASK(connection, transaction, unit, pdu)                                                    \
    gateway_bench_ask(&b, connection, transaction, unit, pdu, sizeof(pdu) - 1)
#define EXPECT(connection, transaction, unit, pdu)                                                 \
    gateway_bench_expect(&b, connection, transaction, unit, pdu, sizeof(pdu) - 1)
#define ON_LINE(line, unit, pdu) gateway_bench_on_line(&b, line, unit, pdu, sizeof(pdu) - 1)
#define REPLY(line, unit, pdu) gateway_bench_reply(&b, line, unit, pdu, sizeof(pdu) - 1)

/* The gateway has sent nothing to a TCP client, or on a line, and will send nothing. */
#define SILENT(port)                                                                               \
    do {                                                                                           \
        gateway_bench_settle(&b);                                                                  \
        assert_int_equal((port).sent_count, 0);                                                    \
    } while (0)

#endif
