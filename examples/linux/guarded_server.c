/* A Modbus TCP server that measures when a client reads, and that allows one client what it
 * refuses another.
 *
 *     guarded_server PORT     PORT 0 takes a free one
 *
 * Unit 1 has ten holding registers. Registers 0 and 1 are read-only: a measured value, and how
 * often it was measured. The first client that connects may write the others. Every other client
 * gets exception 01 for a write, and each gets exception 02 for a write of registers 0 and 1.
 *
 * Licence: MIT OR Apache-2.0. */
#include "mbm_tcp.h"

#include <stdio.h>

enum { PLACES = 4, REGISTERS = 10, READ_ONLY = 2 };

static uint16_t words[REGISTERS];
static mbm_registerTable holding = {.words = words, .size = REGISTERS};
static mbm_unit unit = {.id = 1};
static mbm_tcp_listener listener = MBM_INIT;
static mbm_tcp places[PLACES] = MBM_INIT;
static mbm_server servers[PLACES] = MBM_INIT;
static uint8_t frames[PLACES][MBM_MAX_TCP_FRAME];

/* The context of a server's port is its mbm_tcp, so that is the connection of a request. */
static long client_of(const mbm_access *access)
{
    return (const mbm_tcp *)access->connection - places + 1;
}

static uint8_t before_read(void *context, const mbm_access *access)
{
    (void)context;
    if (access->address < READ_ONLY) {
        words[1]++;
        words[0] = (uint16_t)(200 + words[1]); /* ask the sensor here */
    }
    printf("client %ld reads %u from %u on\n", client_of(access), access->quantity,
           access->address);
    return MBM_OK;
}

static uint8_t before_write(void *context, const mbm_access *access)
{
    uint8_t status = MBM_OK;

    (void)context;
    if (client_of(access) != 1)
        status = MBM_ILLEGAL_FUNCTION;
    else if (access->address < READ_ONLY)
        status = MBM_ILLEGAL_DATA_ADDRESS;
    printf("client %ld writes %u from %u on: %s\n", client_of(access), access->quantity,
           access->address, mbm_status_text(status));
    return status;
}

static const mbm_accessHooks hooks = {.beforeRead = before_read, .beforeWrite = before_write};

int main(int argc, char **argv)
{
    int i;

    if (argc != 2) {
        fprintf(stderr, "usage: guarded_server PORT\n");
        return 2;
    }
    if (mbm_unit_serveHoldingRegisters(&unit, &holding) != MBM_OK ||
        mbm_registerTable_setHooks(&holding, &hooks) != MBM_OK ||
        mbm_tcp_listen(&listener, NULL, argv[1]) != 0) {
        perror(argv[1]);
        return 1;
    }
    (void)setvbuf(stdout, NULL, _IOLBF, 0);
    printf("ready %u\n", listener.port);
    for (;;) {
        mbm_tcp_wait(places, PLACES, &listener, -1, MBM_TCP_FOREVER);
        while ((i = mbm_tcp_accept(&listener, places, PLACES)) >= 0) {
            const mbm_port port = mbm_tcp_port(&places[i]);

            mbm_server_beginTcp(&servers[i], &port, &unit, 1, frames[i], MBM_MAX_TCP_FRAME);
        }
        for (i = 0; i < PLACES; i++)
            if (mbm_tcp_isInUse(&places[i]) && mbm_server_poll(&servers[i]) != MBM_OK)
                mbm_tcp_close(&places[i]);
    }
}
