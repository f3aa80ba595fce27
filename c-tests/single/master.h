/* A master: reads two registers, and writes two. */
#ifndef MASTER_H
#define MASTER_H

#include "mbm.h"
#include "wire.h"

#include <stddef.h>

static uint8_t run_master(void)
{
    static const mbm_port port = {.read = wire_read, .write = wire_write, .micros = wire_micros};
    static mbm_line line = MBM_INIT;
    static mbm_node node = MBM_INIT;
    static uint16_t words[COUNT], transmit[COUNT];
    static uint8_t frame[FRAME_BYTES];

    mbm_line_beginRtu(&line, &port, frame, sizeof frame);
    mbm_node_begin(&node, &line, UNIT, words, COUNT, transmit, COUNT);
    mbm_line_setBaudRate(&line, 19200);
    wire_expect(&READ, &READ_REPLY);
    if (mbm_node_readHoldingRegisters(&node, FIRST, COUNT) != MBM_OK)
        return 1;
    if (words[0] != 0x1234 || words[1] != 0x5678)
        return 2;
    transmit[0] = 0x9ABC;
    transmit[1] = 0xDEF0;
    wire_expect(&WRITE, &WRITE_REPLY);
    if (mbm_node_writeMultipleRegisters(&node, FIRST, COUNT) != MBM_OK)
        return 3;
    return wire_is_done() ? 0 : 4;
}

#endif
