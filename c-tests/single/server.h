/* A server of the holding registers 0 to 127. */
#ifndef SERVER_H
#define SERVER_H

#include "mbm.h"
#include "wire.h"

#include <stddef.h>

static uint8_t run_server(void)
{
    static const mbm_port port = {.read = wire_read, .write = wire_write, .micros = wire_micros};
    static mbm_server server = MBM_INIT;
    static uint16_t words[128];
    static mbm_registerTable holding = {.words = words, .size = 128};
    static mbm_unit unit = {.id = UNIT};
    static uint8_t frame[FRAME_BYTES];
    unsigned polls;

    words[FIRST] = 0x1234;
    words[FIRST + 1] = 0x5678;
    if (mbm_unit_serveHoldingRegisters(&unit, &holding) != MBM_OK)
        return 5;
    if (mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame) != MBM_OK)
        return 6;
    mbm_server_setBaudRate(&server, 19200);
    wire_expect(&READ_REPLY, NULL);
    wire_say(&READ);
    for (polls = 0; polls < 1000; polls++)
        mbm_server_poll(&server);
    if (!wire_is_done())
        return 7;
    wire_expect(&WRITE_REPLY, NULL);
    wire_say(&WRITE);
    for (polls = 0; polls < 1000; polls++)
        mbm_server_poll(&server);
    if (!wire_is_done())
        return 8;
    return words[FIRST] == 0x9ABC && words[FIRST + 1] == 0xDEF0 ? 0 : 9;
}

#endif
