/* Reads and writes a device over Modbus TCP, one line for each call, as a program with
 * libmodbus does.
 *
 *     calls 192.168.0.7 502 17
 *
 * Licence: MIT OR Apache-2.0. */
#include "mbm_call.h"

#include <stdio.h>
#include <stdlib.h>

enum { FIRST = 100, COUNT = 4 };

/* All storage is the program's own; mbm allocates nothing. */
static mbm_client client = MBM_INIT;
static mbm_clientRequest words = MBM_INIT, bits = MBM_INIT;
static uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
static uint16_t registers[COUNT];
static uint8_t coils[1];
static mbm_tcp tcp = MBM_INIT;
static mbm_tcp_addresses addresses;

static int failed(const char *what, uint8_t status)
{
    if (status != MBM_OK)
        fprintf(stderr, "%s: %s\n", what, mbm_status_text(status));
    return status != MBM_OK;
}

int main(int argc, char **argv)
{
    const mbm_caller read_words = mbm_call_overTcp(&tcp, &client, &words);
    const mbm_caller read_bits = mbm_call_overTcp(&tcp, &client, &bits);
    const mbm_port port = mbm_tcp_port(&tcp);
    const unsigned long unit = argc == 4 ? strtoul(argv[3], NULL, 10) : 0;
    int i;

    if (unit < 1 || unit > 255) {
        fprintf(stderr, "usage: %s host port unit\n", argv[0]);
        return 2;
    }
    if (mbm_tcp_open(&tcp, &addresses, argv[1], argv[2]) != 0) {
        perror(argv[1]);
        return 1;
    }
    mbm_client_beginTcp(&client, &port, incoming, sizeof incoming, outgoing, sizeof outgoing);
    words.unit = bits.unit = (uint8_t)unit;
    words.reply = registers;
    words.replyBytes = sizeof registers;
    bits.reply = coils;
    bits.replyBytes = sizeof coils;

    if (failed("read registers", mbm_call(&read_words, mbm_client_readHoldingRegisters(
                                                           &client, &words, FIRST, COUNT))) ||
        failed("read coils",
               mbm_call(&read_bits, mbm_client_readCoils(&client, &bits, FIRST, COUNT))))
        return 1;
    for (i = 0; i < COUNT; i++)
        printf("register %d: %u\ncoil %d: %d\n", FIRST + i, registers[i], FIRST + i,
               coils[0] >> i & 1);

    /* Writes the register back that was read. */
    if (failed("write", mbm_call(&read_words, mbm_client_writeSingleRegister(&client, &words, FIRST,
                                                                             registers[0]))))
        return 1;
    mbm_tcp_close(&tcp);
    return 0;
}
