/* A Modbus TCP client that calls the two user-defined functions of custom_server.c.
 *
 *     custom_client HOST PORT ADDRESS QUANTITY     reads registers, by function 41
 *     custom_client HOST PORT ADDRESS = VALUE...   writes up to ten registers, by function 42
 *
 * Licence: MIT OR Apache-2.0. */
#include "mbm_call.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { READ = 0x41, WRITE = 0x42, MOST = 10 };

static mbm_tcp tcp = MBM_INIT;
static mbm_tcp_addresses addresses;
static mbm_client client = MBM_INIT;
static uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
static uint8_t data[5 + 2 * MOST], reply[252];
static mbm_clientRequest request = {
    .unit = 1, .data = data, .reply = reply, .replyBytes = sizeof reply};

static void put_word(uint8_t *bytes, unsigned long word)
{
    bytes[0] = (uint8_t)(word >> 8);
    bytes[1] = (uint8_t)word;
}

/* Only the application knows what a response must be. */
static uint8_t check(uint8_t function)
{
    const int is_written = request.length == 4 && memcmp(reply, data, 4) == 0;
    const int is_read = request.length >= 3 && memcmp(reply, data, 2) == 0 &&
                        request.length == 3 + reply[2] && reply[2] % 2 == 0;

    return (function == WRITE ? is_written : is_read) ? MBM_OK : MBM_MALFORMED_REPLY;
}

int main(int argc, char **argv)
{
    const mbm_caller server = mbm_call_overTcp(&tcp, &client, &request);
    const mbm_port port = mbm_tcp_port(&tcp);
    const mbm_rule any = {0}; /* a TCP frame has a length, so the response may have any */
    const int is_write = argc > 5 && argc <= 5 + MOST && strcmp(argv[4], "=") == 0;
    const uint8_t function = is_write ? WRITE : READ;
    const uint16_t values = is_write ? (uint16_t)(argc - 5) : 0;
    uint8_t status;
    unsigned i;

    if (argc != 5 && !is_write) {
        fprintf(stderr, "usage: custom_client HOST PORT ADDRESS QUANTITY\n"
                        "       custom_client HOST PORT ADDRESS = VALUE...\n");
        return 2;
    }
    if (mbm_tcp_open(&tcp, &addresses, argv[1], argv[2]) != 0) {
        perror(argv[1]);
        return 1;
    }
    mbm_client_beginTcp(&client, &port, incoming, sizeof incoming, outgoing, sizeof outgoing);
    put_word(data, strtoul(argv[3], NULL, 10));
    put_word(data + 2, is_write ? values : strtoul(argv[4], NULL, 10));
    data[4] = (uint8_t)(2 * values);
    for (i = 0; i < values; i++)
        put_word(data + 5 + 2 * i, strtoul(argv[5 + i], NULL, 10));
    status = mbm_call(&server, mbm_client_custom(&client, &request, function,
                                                 is_write ? (uint16_t)(5 + data[4]) : 4, &any));
    if (status == MBM_OK)
        status = check(function);
    if (status != MBM_OK)
        fprintf(stderr, "%s\n", mbm_status_textOf(status, request.exception));
    else if (is_write)
        printf("written\n");
    for (i = 3; !is_write && status == MBM_OK && i + 1 < request.length; i += 2)
        printf("%u\n", (unsigned)reply[i] << 8 | reply[i + 1]);
    mbm_tcp_close(&tcp);
    return status != MBM_OK;
}
