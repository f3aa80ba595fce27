/* A call that is refused changes nothing: the object is compared byte for byte with its
 * state before the call, and pending requests go on. Buffers have exactly the size that
 * begin is given. */
#include "refused.h"
#include "refused_wire.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

fixture each_test = {reset, NULL};

/* --- server --- */

static mbm_server server;
static mbm_unit unit;
static mbm_registerTable table;
static uint16_t words[MBM_MAX_READ_REGISTERS];
static unsigned not_yet;

static uint16_t later(void *context, const mbm_request *request, uint8_t *response,
                      uint16_t capacity)
{
    (void)context;
    (void)request;
    if (not_yet > 0) {
        not_yet--;
        return MBM_REPLY_PENDING;
    }
    assert_true(capacity >= 250);
    memset(response, 0x5A, 250);
    return 250;
}

static void all_begins_are_refused(uint8_t *frame)
{
    mbm_port without_read = port;
    mbm_unit other;

    without_read.read = NULL;
    memset(&other, 0, sizeof other);
    REFUSED(MBM_INVALID_ARGUMENT, server,
            mbm_server_beginRtu(&server, &without_read, &other, 1, frame, 20));
    REFUSED(MBM_INVALID_ARGUMENT, server, mbm_server_beginRtu(&server, NULL, &other, 1, frame, 20));
    REFUSED(MBM_INVALID_ARGUMENT, server, mbm_server_beginRtu(&server, &port, NULL, 1, frame, 20));
    REFUSED(MBM_INVALID_ARGUMENT, server, mbm_server_beginRtu(&server, &port, &other, 1, NULL, 20));
    REFUSED(MBM_INVALID_ARGUMENT, server,
            mbm_server_beginRtu(&server, &port, &other, 1, frame, 15));
    REFUSED(MBM_INVALID_ARGUMENT, server,
            mbm_server_beginAscii(&server, &port, &other, 1, frame, 20));
    REFUSED(MBM_INVALID_ARGUMENT, server,
            mbm_server_beginTcp(&server, &port, &other, 1, frame, 20));
    REFUSED(MBM_INVALID_ARGUMENT, server,
            mbm_server_beginRtuOverTcp(&server, &port, &other, 1, frame, 15));
    other.id = 300; /* not 44 */
    REFUSED(MBM_INVALID_ARGUMENT, server,
            mbm_server_beginRtu(&server, &port, &other, 1, frame, 20));
    other.id = 256; /* not a unit for every id */
    REFUSED(MBM_INVALID_ARGUMENT, server,
            mbm_server_beginRtuOverTcp(&server, &port, &other, 1, frame, 20));
}

static void poll_for_a_while(void)
{
    for (unsigned i = 0; i < 200; i++)
        OK(mbm_server_poll(&server));
}

TEST(a_server_goes_on_after_a_refused_begin)
{
    uint8_t *frame = (uint8_t *)malloc(MBM_MAX_FRAME), *small = (uint8_t *)malloc(20);
    mbm_custom custom = {.serve = later, .code = 65};

    memset(&server, 0, sizeof server);
    memset(&unit, 0, sizeof unit);
    memset(&table, 0, sizeof table);
    unit.id = 17;
    table.words = words;
    table.size = MBM_MAX_READ_REGISTERS;
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(mbm_unit_serveCustom(&unit, &custom));
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, MBM_MAX_FRAME));
    all_begins_are_refused(small);
    /* The next request. */
    hooked_port_arrive_rtu(&wire, 17, "\x03\0\0\0\x7D", 5);
    poll_for_a_while();
    assert_int_equal(wire.length, 5 + 250);
    /* A part of a request has arrived. */
    wire.length = 0;
    hooked_port_arrive_rtu(&wire, 17, "\x03\0\0\0\x7D", 5);
    wire.last -= 4;
    OK(mbm_server_poll(&server));
    all_begins_are_refused(small);
    wire.last += 4;
    poll_for_a_while();
    assert_int_equal(wire.length, 5 + 250);
    /* A request that is being carried out. */
    wire.length = 0;
    not_yet = 150;
    hooked_port_arrive_rtu(&wire, 17, "\x41\1", 2);
    while (not_yet > 20)
        OK(mbm_server_poll(&server));
    all_begins_are_refused(small);
    poll_for_a_while();
    assert_int_equal(wire.length, 4 + 250);
    free(frame);
    free(small);
}

TEST(a_zeroed_server_stays_zero_when_a_begin_is_refused)
{
    uint8_t *small = (uint8_t *)malloc(20);
    static const mbm_server zero;

    memset(&server, 0, sizeof server);
    all_begins_are_refused(small);
    assert_memory_equal(&server, &zero, sizeof server);
    free(small);
}

TEST(settings_of_a_server_that_are_refused_change_nothing)
{
    static uint8_t frame[MBM_MAX_TCP_FRAME];

    memset(&server, 0, sizeof server);
    REFUSED(MBM_NOT_INITIALISED, server, mbm_server_setSilence(&server, 1));
    REFUSED(MBM_NOT_INITIALISED, server, mbm_server_setBaudRate(&server, 9600));
    REFUSED(MBM_NOT_INITIALISED, server, mbm_server_setEchoDiscard(&server, 1));
    OK(mbm_server_beginTcp(&server, &port, &unit, 1, frame, sizeof frame));
    REFUSED(MBM_INVALID_ARGUMENT, server, mbm_server_setEchoDiscard(&server, 1));
}

/* Neither the records that are refused nor the units that refuse them change. */
TEST(refused_records_are_unchanged)
{
    mbm_registerTable fresh;
    mbm_dataCallbacks cells;
    mbm_custom custom;
    mbm_functionMask switches;

    memset(&unit, 0, sizeof unit);
    memset(&fresh, 0, sizeof fresh);
    memset(&cells, 0, sizeof cells);
    memset(&custom, 0, sizeof custom);
    memset(&switches, 0, sizeof switches);
    REFUSED(MBM_INVALID_ARGUMENT, fresh, mbm_unit_serveHoldingRegisters(NULL, &fresh));
    REFUSED(MBM_INVALID_ARGUMENT, fresh, mbm_registerTable_serveMaskAndReadWrite(&fresh));
    REFUSED(MBM_INVALID_ARGUMENT, cells, mbm_unit_serveCallbacks(&unit, &cells, 3));
    REFUSED(MBM_INVALID_ARGUMENT, unit, mbm_unit_serveCallbacks(&unit, &cells, 3));
    REFUSED(MBM_INVALID_ARGUMENT, unit, mbm_unit_serveCustom(&unit, &custom));
    custom.serve = later;
    custom.code = 128;
    REFUSED(MBM_INVALID_ARGUMENT, custom, mbm_unit_serveCustom(&unit, &custom));
    REFUSED(MBM_INVALID_ARGUMENT, unit, mbm_unit_serveCustom(&unit, &custom));
    custom.code = 65;
    custom.length.kind = 9;
    REFUSED(MBM_INVALID_ARGUMENT, custom, mbm_unit_serveCustom(&unit, &custom));
    REFUSED(MBM_INVALID_ARGUMENT, switches, mbm_unit_switchFunction(NULL, &switches, 3, 0));
    REFUSED(MBM_INVALID_ARGUMENT, switches, mbm_unit_switchFunction(&unit, &switches, 128, 0));
    REFUSED(MBM_INVALID_ARGUMENT, switches, mbm_unit_switchFunction(&unit, &switches, 0, 1));
    REFUSED(MBM_INVALID_ARGUMENT, unit, mbm_unit_switchFunction(&unit, &switches, 0, 0));
    REFUSED(MBM_INVALID_ARGUMENT, unit, mbm_unit_serveFiles(&unit, NULL));
    REFUSED(MBM_INVALID_ARGUMENT, unit, mbm_unit_serveFifos(&unit, NULL));
    REFUSED(MBM_INVALID_ARGUMENT, unit, mbm_unit_serveDiagnostics(&unit, NULL));
    REFUSED(MBM_INVALID_ARGUMENT, unit, mbm_unit_serveIdentification(&unit, NULL));
}

/* --- master --- */

TEST(a_master_goes_on_after_refused_calls)
{
    static mbm_line line;
    static mbm_node m;
    uint8_t *frame = (uint8_t *)malloc(MBM_MAX_FRAME), *small = (uint8_t *)malloc(8);
    uint16_t *response = (uint16_t *)malloc(250), *transmit = (uint16_t *)malloc(4), one[1];
    uint8_t answer[252] = {3, 250};
    mbm_port mute = port;

    memset(&line, 0, sizeof line);
    memset(&m, 0, sizeof m);
    REFUSED(MBM_INVALID_ARGUMENT, line, mbm_line_beginRtu(&line, NULL, small, 8));
    mute.write = NULL;
    REFUSED(MBM_INVALID_ARGUMENT, line, mbm_line_beginRtu(&line, &mute, small, 8));
    REFUSED(MBM_INVALID_ARGUMENT, line, mbm_line_beginRtu(&line, &port, small, 7));
    REFUSED(MBM_INVALID_ARGUMENT, m, mbm_node_begin(&m, NULL, 17, one, 1, one, 1));
    OK(mbm_line_beginRtu(&line, &port, frame, MBM_MAX_FRAME));
    OK(mbm_node_begin(&m, &line, 17, response, 125, transmit, 2));
    OK(mbm_node_setBlocking(&m, 0));
    transmit[0] = transmit[1] = 0x1234;
    IS(MBM_PENDING, mbm_node_readHoldingRegisters(&m, 0, 125));

    REFUSED(MBM_INVALID_ARGUMENT, line, mbm_line_beginRtu(&line, &mute, small, 8));
    REFUSED(MBM_BUSY, line, mbm_line_beginRtu(&line, &port, small, 8));
    REFUSED(MBM_BUSY, line, mbm_line_setFrame(&line, small, 8));
    REFUSED(MBM_BUSY, m, mbm_node_begin(&m, &line, 17, one, 1, one, 1));
    REFUSED(MBM_INVALID_ARGUMENT, m, mbm_node_begin(&m, &line, 17, one, 256, one, 1));
    REFUSED(MBM_BUSY, m, mbm_node_readCoils(&m, 0, 1));
    REFUSED(MBM_BUSY, m, mbm_node_writeSingleRegister(&m, 1, 2));
    REFUSED(MBM_BUSY, m, mbm_node_writeMultipleRegisters(&m, 1, 2));
    REFUSED(MBM_BUSY, m, mbm_node_writeQueuedRegisters(&m));
    REFUSED(MBM_BUSY, m, mbm_node_maskWriteRegister(&m, 1, 2, 3));
    REFUSED(MBM_BUSY, m, mbm_node_readWriteMultipleRegisters(&m, 1, 2, 3, 2));
    assert_int_equal(transmit[0], 0x1234);
    assert_int_equal(transmit[1], 0x1234);

    for (unsigned i = 0; i < 300 && wire.length == 0; i++)
        IS(MBM_PENDING, mbm_node_poll(&m));
    hooked_port_arrive_rtu(&wire, 17, answer, sizeof answer);
    for (unsigned i = 0; i < 300 && mbm_node_poll(&m) == MBM_PENDING; i++) {
    }
    OK(mbm_node_status(&m));
    /* The queue of words is full. */
    OK(mbm_node_send(&m, 1));
    OK(mbm_node_send(&m, 2));
    REFUSED(MBM_BUFFER_TOO_SMALL, m, mbm_node_send(&m, 3));
    REFUSED(MBM_BUFFER_TOO_SMALL, m, mbm_node_send(&m, 3));
    REFUSED(MBM_BUFFER_TOO_SMALL, m, mbm_node_sendBit(&m, 1));
    free(frame);
    free(small);
    free(response);
    free(transmit);
}

/* --- sniffer and ring --- */

TEST(a_sniffer_goes_on_after_refused_calls)
{
    static mbm_sniffer sniffer;
    uint8_t *buffer = (uint8_t *)malloc(MBM_MAX_FRAME), *small = (uint8_t *)malloc(31);
    mbm_event event;

    memset(&sniffer, 0, sizeof sniffer);
    REFUSED(MBM_BUFFER_TOO_SMALL, sniffer, mbm_sniffer_begin(&sniffer, MBM_FRAMING_RTU, small, 31));
    OK(mbm_sniffer_begin(&sniffer, MBM_FRAMING_RTU, buffer, MBM_MAX_FRAME));
    hooked_port_arrive_rtu(&wire, 17, "\3\0\0\0\1", 5);
    assert_int_equal(mbm_sniffer_feed(&sniffer, MBM_DIRECTION_BOTH, wire.arriving, 4, 0), 4);
    REFUSED(MBM_BUFFER_TOO_SMALL, sniffer, mbm_sniffer_begin(&sniffer, MBM_FRAMING_RTU, small, 31));
    REFUSED(MBM_INVALID_ARGUMENT, sniffer, mbm_sniffer_begin(&sniffer, MBM_FRAMING_RTU, NULL, 256));
    REFUSED(MBM_INVALID_ARGUMENT, sniffer, mbm_sniffer_setFunctions(&sniffer, NULL, 1));
    REFUSED(MBM_INVALID_ARGUMENT, sniffer, mbm_sniffer_setDelimiter(&sniffer, '\r'));
    REFUSED(MBM_INVALID_ARGUMENT, sniffer, mbm_sniffer_setResponseTimeout(&sniffer, 0));
    REFUSED(MBM_INVALID_ARGUMENT, sniffer, mbm_sniffer_setFrameTimeout(&sniffer, 0));
    REFUSED(0, sniffer, mbm_sniffer_feed(&sniffer, 3, wire.arriving, 4, 0));
    REFUSED(0, sniffer, mbm_sniffer_feed(&sniffer, MBM_DIRECTION_BOTH, NULL, 4, 0));
    REFUSED(0, sniffer, mbm_sniffer_next(&sniffer, 0, NULL));
    assert_int_equal(mbm_sniffer_feed(&sniffer, MBM_DIRECTION_BOTH, wire.arriving + 4, 4, 0), 4);
    assert_int_equal(mbm_sniffer_next(&sniffer, 100000, &event), 1);
    assert_int_equal(event.kind, MBM_EVENT_REQUEST);
    free(buffer);
    free(small);
}

TEST(a_ring_keeps_its_bytes_when_a_begin_is_refused)
{
    mbm_ring ring = {0};
    uint8_t *bytes = (uint8_t *)malloc(8), *one = (uint8_t *)malloc(1), got[8];

    REFUSED(MBM_INVALID_ARGUMENT, ring, mbm_ring_begin(&ring, one, 1));
    OK(mbm_ring_begin(&ring, bytes, 8));
    assert_int_equal(mbm_ring_write(&ring, (const uint8_t *)"abcd", 4), 4);
    REFUSED(MBM_INVALID_ARGUMENT, ring, mbm_ring_begin(&ring, one, 1));
    REFUSED(MBM_INVALID_ARGUMENT, ring, mbm_ring_begin(&ring, NULL, 8));
    REFUSED(0, ring, mbm_ring_write(&ring, NULL, 4));
    REFUSED(0, ring, mbm_ring_read(&ring, NULL, 4));
    assert_int_equal(mbm_ring_read(&ring, got, 8), 4);
    assert_memory_equal(got, "abcd", 4);
    free(bytes);
    free(one);
}
