/* Reads holding register 100 of unit 17, 2400 baud, 8N1. The board's functions are those of
 * ports/baremetal/board.h in the SDK.
 * Licence: MIT OR Apache-2.0. */
#include "board.h"
#include "mbm.h"

/* All memory is the program's own: mbm allocates nothing. */
static mbm_line line = MBM_INIT;
static mbm_node meter = MBM_INIT;
static uint16_t response[1];
static uint8_t frame[MBM_FRAME_BYTES(1)];

static void print_hexadecimal(uint16_t value)
{
    char text[] = "0x0000\n";
    uint8_t i;

    for (i = 0; i < 4; i++)
        text[2 + i] = "0123456789ABCDEF"[value >> (12 - 4 * i) & 15];
    console_print(text);
}

int main(void)
{
    static const mbm_port port = {
        .read = uart_read, .write = uart_write, .micros = clock_micros, .flush = uart_flush};
    uint8_t status;

    uart_start();
    clock_start();
    mbm_line_beginRtu(&line, &port, frame, sizeof frame);
    mbm_line_setBaudRate(&line, BAUD);
    mbm_node_begin(&meter, &line, 17, response, 1, 0, 0);

    status = mbm_node_readHoldingRegisters(&meter, 100, 1);
    if (status == MBM_OK) {
        console_print("register 100: ");
        print_hexadecimal(response[0]);
    } else {
        console_print(mbm_status_text(status));
    }
    console_exit(status);
}
