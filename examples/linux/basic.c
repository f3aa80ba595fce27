/* Reads and writes registers of a device on a serial line.
 *
 *     basic /dev/ttyUSB0 19200 17
 *
 * Licence: MIT OR Apache-2.0. */
#include "mbm_tty.h"

#include <stdio.h>
#include <stdlib.h>

enum { READ_WORDS = 6, WRITE_WORDS = 2 };

/* All storage is the program's own; mbm allocates nothing. */
static mbm_line line = MBM_INIT;
static mbm_node node = MBM_INIT;
static uint16_t response[READ_WORDS];
static uint16_t transmit[WRITE_WORDS];
static uint8_t frame[MBM_FRAME_BYTES(READ_WORDS)];

static int failed(const char *what, uint8_t status)
{
    if (status != MBM_OK)
        fprintf(stderr, "%s: %s\n", what,
                mbm_status_textOf(status, mbm_node_getExceptionCode(&node)));
    return status != MBM_OK;
}

int main(int argc, char **argv)
{
    mbm_tty tty = MBM_INIT;
    mbm_port port;
    const unsigned long unit = argc == 4 ? strtoul(argv[3], NULL, 10) : 0;
    uint32_t baud;
    uint8_t i;

    if (unit < 1 || unit > 247) {
        fprintf(stderr, "usage: %s path baud unit\n", argv[0]);
        return 2;
    }
    baud = (uint32_t)strtoul(argv[2], NULL, 10);
    if (mbm_tty_open(&tty, argv[1], baud, 'N', 1) != 0) {
        perror(argv[1]);
        return 1;
    }
    port = mbm_tty_port(&tty);
    mbm_line_beginRtu(&line, &port, frame, sizeof frame);
    mbm_line_setBaudRate(&line, baud);
    mbm_node_begin(&node, &line, (uint8_t)unit, response, READ_WORDS, transmit, WRITE_WORDS);

    /* Two words to registers 0 and 1, then six words from register 2 on. */
    transmit[0] = 0x1234;
    transmit[1] = 0xABCD;
    if (failed("write", mbm_node_writeMultipleRegisters(&node, 0, WRITE_WORDS)) ||
        failed("read", mbm_node_readHoldingRegisters(&node, 2, READ_WORDS)))
        return 1;
    for (i = 0; i < READ_WORDS; i++)
        printf("register %d: 0x%04X\n", 2 + i, response[i]);

    mbm_tty_close(&tty);
    return 0;
}
