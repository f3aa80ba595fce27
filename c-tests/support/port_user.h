/* What uses a port in a test of its faults: a master that reads from unit 17, or a server with that
 * unit. A program includes this once. */
#ifndef PORT_USER_H
#define PORT_USER_H

#include "test.h"

enum { UNIT = 17 };

static mbm_port port;
static mbm_line line;
static mbm_node node;
static mbm_server server;
static mbm_unit unit;
static mbm_registerTable table;
static uint16_t words[120], response[2];
static uint8_t frame[MBM_MAX_FRAME];
/* Reads registers 0 and 1 of unit 17, and the reply. */
static const uint8_t request[] = {17, 3, 0, 0, 0, 2, 0xC6, 0x9B};
static const uint8_t reply[] = {17, 3, 4, 2, 0x2B, 0, 100, 0x9B, 0xA9};

static void user_forget(void)
{
    memset(&line, 0, sizeof line);
    memset(&node, 0, sizeof node);
    memset(&server, 0, sizeof server);
    memset(&unit, 0, sizeof unit);
}

static void user_begin_master(void)
{
    OK(mbm_line_beginRtu(&line, &port, frame, sizeof frame));
    OK(mbm_node_begin(&node, &line, UNIT, response, COUNT(response), NULL, 0));
    OK(mbm_line_setBaudRate(&line, 19200));
}

static void user_begin_server(void)
{
    words[0] = 555;
    words[1] = 100;
    table = (mbm_registerTable){.words = words, .size = COUNT(words)};
    unit.id = UNIT;
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    OK(mbm_server_setBaudRate(&server, 19200));
}

/* Reads all that the port has; returns how many bytes these were. */
static unsigned user_read_all(void)
{
    uint8_t bytes[100];
    unsigned count = 0;
    int16_t taken;

    while ((taken = port.read(port.context, bytes, sizeof bytes)) > 0)
        count += (unsigned)taken;
    assert_int_equal(taken, 0);
    return count;
}

#endif
