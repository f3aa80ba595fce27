/* A Modbus TCP server with two user-defined functions (V1.1b3, 5.1).
 *
 *     custom_server PORT     PORT 0 takes a free one
 *
 * Function 41 reads and function 42 writes ten registers of unit 1:
 *
 *     41   request: address, quantity                        response: address, byte count, values
 *     42   request: address, quantity, byte count, values    response: address, quantity
 *
 * A read past the last register is refused with exception 02, a write with 04, a wrong length with
 * 03.
 *
 * custom_client.c is the other side. Licence: MIT OR Apache-2.0. */
#include "mbm_tcp.h"

#include <stdio.h>

enum { READ = 0x41, WRITE = 0x42, REGISTERS = 10, PLACES = 4 };

static uint8_t registers[2 * REGISTERS]; /* the high byte of a register first, as in frames */

static unsigned word_at(const uint8_t *bytes)
{
    return (unsigned)bytes[0] << 8 | bytes[1];
}

static uint16_t serve_read(void *context, const mbm_request *request, uint8_t *response,
                           uint16_t capacity)
{
    const uint8_t *data = request->data;
    unsigned bytes, i;

    (void)context;
    if (request->length != 4 || word_at(data + 2) == 0)
        return MBM_REPLY_EXCEPTION | MBM_ILLEGAL_DATA_VALUE;
    if (word_at(data) + word_at(data + 2) > REGISTERS)
        return MBM_REPLY_EXCEPTION | MBM_ILLEGAL_DATA_ADDRESS;
    bytes = 2 * word_at(data + 2);
    if (3 + bytes > capacity)
        return MBM_REPLY_EXCEPTION | MBM_SERVER_DEVICE_FAILURE;
    response[0] = data[0];
    response[1] = data[1];
    response[2] = (uint8_t)bytes;
    for (i = 0; i < bytes; i++)
        response[3 + i] = registers[2 * word_at(data) + i];
    return (uint16_t)(3 + bytes);
}

static uint16_t serve_write(void *context, const mbm_request *request, uint8_t *response,
                            uint16_t capacity)
{
    const uint8_t *data = request->data;
    unsigned address, i;

    (void)context;
    if (request->length < 6 || data[4] != request->length - 5 || data[4] != 2 * word_at(data + 2))
        return MBM_REPLY_EXCEPTION | MBM_ILLEGAL_DATA_VALUE;
    address = word_at(data);
    /* 04, as Qt's example of custom commands answers a write that its registers do not take. */
    if (address + word_at(data + 2) > REGISTERS || capacity < 4)
        return MBM_REPLY_EXCEPTION | MBM_SERVER_DEVICE_FAILURE;
    for (i = 0; i < data[4]; i++)
        registers[2 * address + i] = data[5 + i];
    for (i = 0; i < 4; i++)
        response[i] = data[i];
    return 4;
}

static mbm_custom functions[] = {{.code = READ, .serve = serve_read},
                                 {.code = WRITE, .serve = serve_write}};
static mbm_unit unit = {.id = 1};
static mbm_tcp_listener listener = MBM_INIT;
static mbm_tcp places[PLACES] = MBM_INIT;
static mbm_server servers[PLACES] = MBM_INIT;
static uint8_t frames[PLACES][MBM_MAX_TCP_FRAME];

int main(int argc, char **argv)
{
    int i;

    if (argc != 2 || mbm_unit_serveCustom(&unit, &functions[0]) != MBM_OK ||
        mbm_unit_serveCustom(&unit, &functions[1]) != MBM_OK ||
        mbm_tcp_listen(&listener, NULL, argv[1]) != 0) {
        perror(argc == 2 ? argv[1] : "usage: custom_server PORT");
        return argc == 2 ? 1 : 2;
    }
    printf("ready %u\n", listener.port);
    fflush(stdout);
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
