#include "served_unit.h"

#include "machine.h"
#include "test.h"

uint16_t cells[125];
mbm_server server;

static mbm_registerTable holding;
static mbm_unit unit;
static uint8_t frame[MBM_MAX_FRAME];

void served_unit_start(uint8_t byDma, uint16_t base)
{
    memset(&server, 0, sizeof server);
    memset(&unit, 0, sizeof unit);
    holding = (mbm_registerTable){.words = cells, .base = base, .size = COUNT(cells)};
    unit.id = UNIT;
    uart_start(byDma);
    uart_open();
    OK(mbm_unit_serveHoldingRegisters(&unit, &holding));
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    OK(mbm_server_setBaudRate(&server, 115200));
}

void served_unit_sends(unsigned characters, unsigned polls, uint32_t pause)
{
    const unsigned end = m.sentCount + characters;

    for (; polls > 0 && m.sentCount < end; polls--) {
        machine_run(pause);
        mbm_server_poll(&server);
    }
    assert_int_equal(m.sentCount, end);
}
