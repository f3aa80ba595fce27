/* A Modbus TCP client that calls the two user-defined functions of custom_server.c.
 *
 *     custom_client HOST PORT ADDRESS QUANTITY     reads registers, by function 41
 *     custom_client HOST PORT ADDRESS = VALUE      writes one register, by function 42
 *
 * Licence: MIT OR Apache-2.0. */
#include "mbm_call.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { READ = 0x41, WRITE = 0x42 };

static mbm_tcp tcp = MBM_INIT;
static mbm_tcp_addresses addresses;
static mbm_client client = MBM_INIT;
static uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
static uint8_t data[7], reply[252];
static mbm_clientRequest request = {
    .unit = 1, .data = data, .reply = reply, .replyBytes = sizeof reply};

static void put_word(uint8_t *bytes, const char *number)
{
    const unsigned long word = strtoul(number, NULL, 10);

    bytes[0] = (uint8_t)(word >> 8);
    bytes[1] = (uint8_t)word;
}

int main(int argc, char **argv)
{
    const mbm_caller server = mbm_call_overTcp(&tcp, &client, &request);
    const mbm_port port = mbm_tcp_port(&tcp);
    const mbm_rule any = {0}; /* a TCP frame has a length, so the response may have any */
    const int is_write = argc == 6 && strcmp(argv[4], "=") == 0;
    uint8_t status;
    unsigned i;

    if (argc != 5 && !is_write) {
        fprintf(stderr, "usage: custom_client HOST PORT ADDRESS QUANTITY\n"
                        "       custom_client HOST PORT ADDRESS = VALUE\n");
        return 2;
    }
    if (mbm_tcp_open(&tcp, &addresses, argv[1], argv[2]) != 0) {
        perror(argv[1]);
        return 1;
    }
    mbm_client_beginTcp(&client, &port, incoming, sizeof incoming, outgoing, sizeof outgoing);
    put_word(data, argv[3]);
    put_word(data + 2, is_write ? "1" : argv[4]);
    data[4] = 2;
    if (is_write)
        put_word(data + 5, argv[5]);
    status = mbm_call(&server, mbm_client_custom(&client, &request, is_write ? WRITE : READ,
                                                 is_write ? 7 : 4, &any));
    /* Only the application knows what the response must be. */
    if (status == MBM_OK && (request.length < 3 || memcmp(reply, data, 2) != 0 ||
                             (!is_write && request.length != 3 + reply[2])))
        status = MBM_MALFORMED_REPLY;
    if (status != MBM_OK)
        fprintf(stderr, "%s\n", mbm_status_textOf(status, request.exception));
    else if (is_write)
        printf("written\n");
    for (i = 3; !is_write && status == MBM_OK && i + 1 < request.length; i += 2)
        printf("%u\n", (unsigned)reply[i] << 8 | reply[i + 1]);
    mbm_tcp_close(&tcp);
    return status != MBM_OK;
}
