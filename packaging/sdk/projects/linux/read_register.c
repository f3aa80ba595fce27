/* Reads holding register 100 of unit 17 on a serial line, 19200 baud, 8N1.
 *
 *     read_register /dev/ttyUSB0
 *
 * Licence: MIT OR Apache-2.0. */
#include "mbm_tty.h"

#include <stdio.h>

/* All memory is the program's own: mbm allocates nothing. */
static mbm_line line = MBM_INIT;
static mbm_node meter = MBM_INIT;
static uint16_t response[1];
static uint8_t frame[MBM_FRAME_BYTES(1)];

int main(int argc, char **argv)
{
    mbm_tty tty = MBM_INIT;
    mbm_port port;
    uint8_t status;

    if (argc != 2 || mbm_tty_open(&tty, argv[1], 19200, 'N', 1) != 0) {
        perror(argc == 2 ? argv[1] : "usage: read_register PATH");
        return 1;
    }
    port = mbm_tty_port(&tty);
    mbm_line_beginRtu(&line, &port, frame, sizeof frame);
    mbm_line_setBaudRate(&line, 19200);
    mbm_node_begin(&meter, &line, 17, response, 1, NULL, 0);

    status = mbm_node_readHoldingRegisters(&meter, 100, 1);
    if (status == MBM_OK)
        printf("register 100: 0x%04X\n", response[0]);
    else
        fprintf(stderr, "%s\n", mbm_status_text(status));
    mbm_tty_close(&tty);
    return status == MBM_OK ? 0 : 1;
}
