/* How mbm_server_* answers bad input, and what can only be tested from C. */
#include "crc.h"
#include "hooked_port.h"
#include "test.h"

static mbm_server server;
static mbm_unit unit;
static mbm_registerTable table;
static mbm_custom custom;
static mbm_functionMask switches;
static mbm_diagnostics diagnostics;
static uint16_t words[10];
static uint8_t frame[MBM_MAX_ASCII_FRAME];

static hooked_port wire;
static mbm_port port;

static void reset(void)
{
    memset(&server, 0, sizeof server);
    memset(&unit, 0, sizeof unit);
    memset(&table, 0, sizeof table);
    memset(&custom, 0, sizeof custom);
    memset(&switches, 0, sizeof switches);
    memset(&diagnostics, 0, sizeof diagnostics);
    memset(&wire, 0, sizeof wire);
    memset(words, 0, sizeof words);
    wire.step = 100;
    port = hooked_port_of(&wire);
    unit.id = 17;
    table.words = words;
    table.size = 10;
}

fixture each_test = {reset, NULL};

/* Lets the frame of a PDU arrive and polls. Returns the length of what was sent. */
static size_t exchange(uint8_t to, const char *pdu, size_t length)
{
    wire.length = 0;
    hooked_port_arrive_rtu(&wire, to, pdu, length);
    for (unsigned i = 0; i < 100; i++)
        OK(mbm_server_poll(&server));
    return wire.length;
}

#define ASK(pdu) exchange(17, pdu, sizeof pdu - 1)
#define BROADCAST(pdu) exchange(0, pdu, sizeof pdu - 1)

TEST(a_function_that_is_not_served_gets_exception_01)
{
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    assert_int_equal(ASK("\x04\0\0\0\1"), 5);
    assert_memory_equal(wire.sent, "\x11\x84\x01", 3);
}

TEST(a_unit_without_services_does_not_answer)
{
    static mbm_unit places[3];

    memset(places, 0, sizeof places);
    OK(mbm_server_beginRtu(&server, &port, places, 3, frame, sizeof frame));
    assert_int_equal(ASK("\x03\0\0\0\1"), 0);
    places[1].id = 17;
    assert_int_equal(ASK("\x03\0\0\0\1"), 0);
    /* The next unit with this id answers. */
    places[2].id = 17;
    OK(mbm_unit_serveHoldingRegisters(&places[2], &table));
    assert_int_equal(ASK("\x03\0\0\0\1"), 7);
    assert_int_equal(BROADCAST("\x06\0\1\x56\x78"), 0);
    assert_int_equal(words[1], 0x5678);
}

/* A peer that sends requests to another unit faster than they are read. */
static char flood[] = "\0\1\0\0\0\6\x63\x03\0\0\0\1";

static int16_t flooded_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    for (uint16_t i = 0; i < capacity; i++)
        bytes[i] = (uint8_t)flood[wire.first++ % 12];
    assert_true(wire.first < 12 * 1000);
    return (int16_t)capacity;
}

TEST(a_poll_ends_while_a_peer_floods)
{
    mbm_port flooded = port;

    flooded.read = flooded_read;
    OK(mbm_server_beginTcp(&server, &flooded, &unit, 1, frame, sizeof frame));
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(mbm_server_poll(&server));
    assert_int_equal(wire.length, 0);
    flood[6] = 17;
    wire.first = 0;
    OK(mbm_server_poll(&server));
    assert_int_equal(wire.length, 11);
    /* To a server of RTU over TCP these bytes are noise. */
    wire.first = wire.length = 0;
    OK(mbm_server_beginRtuOverTcp(&server, &flooded, &unit, 1, frame, sizeof frame));
    OK(mbm_server_poll(&server));
    assert_int_equal(wire.length, 0);
}

TEST(tables_without_storage_have_no_addresses)
{
    table.words = NULL;
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    assert_int_equal(ASK("\x03\0\0\0\1"), 5);
    assert_memory_equal(wire.sent, "\x11\x83\x02", 3);
}

TEST(registering_twice_is_the_same_as_once)
{
    mbm_registerTable inputs = {.words = words, .size = 10};

    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(mbm_unit_serveInputRegisters(&unit, &inputs));
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    assert_int_equal(ASK("\x04\0\0\0\1"), 7);
    assert_int_equal(ASK("\x05\0\0\0\0"), 5);
    assert_memory_equal(wire.sent, "\x11\x85\x01", 3);
}

TEST(mask_and_read_write_need_holding_registers)
{
    IS(MBM_INVALID_ARGUMENT, mbm_registerTable_serveMaskAndReadWrite(&table));
    OK(mbm_unit_serveInputRegisters(&unit, &table));
    IS(MBM_INVALID_ARGUMENT, mbm_registerTable_serveMaskAndReadWrite(&table));
}

TEST(a_function_is_switched_off_and_on)
{
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    OK(mbm_unit_switchFunction(&unit, &switches, MBM_FC_WRITE_SINGLE_REGISTER, 0));
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(mbm_unit_switchFunction(&unit, &switches, MBM_FC_READ_FIFO_QUEUE, 0));
    assert_int_equal(ASK("\x06\0\0\1\2"), 5);
    assert_memory_equal(wire.sent, "\x11\x86\x01", 3);
    assert_int_equal(words[0], 0);
    assert_int_equal(ASK("\x03\0\0\0\1"), 7);
    OK(mbm_unit_switchFunction(&unit, &switches, MBM_FC_WRITE_SINGLE_REGISTER, 1));
    assert_int_equal(ASK("\x06\0\0\1\2"), 8);
    assert_int_equal(words[0], 0x0102);
}

static uint16_t custom_result;
static mbm_request seen;
static unsigned calls;

static uint16_t own(void *context, const mbm_request *request, uint8_t *response, uint16_t capacity)
{
    assert_ptr_equal(context, &custom_result);
    assert_true(capacity >= 252);
    seen = *request;
    calls++;
    memset(response, 0x5A, custom_result < 253 ? custom_result : 0);
    return custom_result;
}

TEST(a_custom_function_determines_the_response)
{
    custom.serve = own;
    custom.context = &custom_result;
    custom.code = 0x64;
    OK(mbm_unit_serveDiagnostics(&unit, &diagnostics));
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    OK(mbm_unit_serveCustom(&unit, &custom));
    custom_result = 2;
    assert_int_equal(ASK("\144abc"), 6); /* in octal: hexadecimal would include the letters */
    assert_memory_equal(wire.sent, "\x11\x64\x5A\x5A", 4);
    assert_int_equal(seen.length, 3);
    assert_int_equal(seen.unit, 17);
    assert_int_equal(seen.function, 0x64);
    custom_result = 252;
    assert_int_equal(ASK("\x64"), 256);
    custom_result = MBM_REPLY_EXCEPTION | 0x0B;
    assert_int_equal(ASK("\x64"), 5);
    assert_int_equal(wire.sent[2], 0x0B);
    custom_result = MBM_REPLY_NONE;
    assert_int_equal(ASK("\x64"), 0);
    /* A value that is no response length is a failure of the server. */
    for (custom_result = 253; custom_result < 0x101; custom_result++) {
        assert_int_equal(ASK("\x64"), 5);
        assert_int_equal(wire.sent[2], 4);
    }
    custom_result = 0xFFFF;
    assert_int_equal(ASK("\x64"), 5);
    assert_int_equal(wire.sent[2], 4);
    calls = 0;
    diagnostics.serverMessages = 0;
    custom_result = MBM_REPLY_PENDING;
    assert_int_equal(ASK("\x64"), 0);
    assert_true(calls > 10);
    assert_int_equal(diagnostics.serverMessages, 1);
    assert_int_equal(mbm_server_pollDelay(&server), 1000);
    custom_result = 0;
    OK(mbm_server_poll(&server));
    OK(mbm_server_poll(&server));
    assert_int_equal(wire.length, 4);
}

TEST(a_custom_function_of_code_0_serves_all_others)
{
    custom.serve = own;
    custom.context = &custom_result;
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(mbm_unit_serveCustom(&unit, &custom));
    custom_result = 0;
    calls = 0;
    assert_int_equal(ASK("\x03\0\0\0\1"), 7);
    assert_int_equal(calls, 0);
    assert_int_equal(ASK("\x04\0\0\0\1"), 4);
    assert_int_equal(ASK("\x2A"), 4);
    assert_int_equal(calls, 2);
}

static unsigned reads;

static uint16_t count_reads(void *context, uint16_t address)
{
    return (uint16_t)++reads;
}

/* Serial line guide V1.02, 2.1: only writes may be broadcast. */
TEST(a_broadcast_is_carried_out_only_if_it_only_writes)
{
    static mbm_dataCallbacks cells;

    cells = (mbm_dataCallbacks){.get = count_reads};
    custom.serve = own;
    custom.context = &custom_result;
    custom_result = 0;
    calls = reads = 0;
    OK(mbm_unit_serveDiagnostics(&unit, &diagnostics));
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(mbm_registerTable_serveMaskAndReadWrite(&table));
    OK(mbm_unit_serveCallbacks(&unit, &cells, 4));
    OK(mbm_unit_serveCustom(&unit, &custom));
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    diagnostics.diagnosticRegister = 7;
    assert_int_equal(BROADCAST("\x17\0\0\0\1\0\0\0\1\2\x12\x34"), 0);
    assert_int_equal(BROADCAST("\x08\0\x0A\0\0"), 0);
    assert_int_equal(BROADCAST("\x04\0\0\0\1"), 0);
    assert_int_equal(BROADCAST("\x2A"), 0);
    assert_int_equal(words[0], 0);
    assert_int_equal(diagnostics.diagnosticRegister, 7);
    assert_int_equal(diagnostics.noResponses, 4);
    assert_int_equal(calls + reads, 0);
    /* Requests that only write are carried out, and so are user-defined functions. */
    assert_int_equal(BROADCAST("\x16\0\0\xFF\xFF\x12\x34"), 0);
    assert_int_equal(BROADCAST("\x06\0\1\x56\x78"), 0);
    assert_int_equal(BROADCAST("\x41"), 0);
    assert_int_equal(words[1], 0x5678);
    assert_int_equal(calls, 1);
    assert_int_equal(diagnostics.noResponses, 7);
    assert_int_equal(ASK("\x04\0\0\0\1"), 7);
    assert_int_equal(reads, 1);
}

TEST(a_response_that_the_port_accepts_in_pieces_is_sent_completely)
{
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    for (wire.piece = 1; wire.piece < 9; wire.piece++) {
        wire.drains = wire.piece % 3;
        assert_int_equal(ASK("\x03\0\0\0\1"), 7);
        assert_memory_equal(wire.sent, "\x11\x03\x02\0\0", 5);
        assert_int_equal(wire.draining, 0);
    }
}

TEST(the_length_rule_of_a_custom_function_frames_rtu_over_tcp)
{
    mbm_rule rules[] = {{MBM_RULE_FIXED, 4, 0}, {MBM_RULE_COUNTED, 1, 1}, {MBM_RULE_SILENCE, 0, 0}};
    const char *pdus[] = {"\144abc", "\144\1x!", "\14412345"};
    const size_t lengths[] = {4, 4, 6};

    custom.serve = own;
    custom.context = &custom_result;
    custom.code = 0x64;
    custom.length = (mbm_rule){MBM_RULE_FIXED, 0, 0};
    IS(MBM_INVALID_ARGUMENT, mbm_unit_serveCustom(&unit, &custom));
    custom_result = 1;
    for (unsigned i = 0; i < COUNT(rules); i++) {
        unsigned k;

        custom.length = rules[i];
        OK(mbm_unit_serveCustom(&unit, &custom));
        OK(mbm_server_beginRtuOverTcp(&server, &port, &unit, 1, frame, sizeof frame));
        wire.first = wire.last = wire.length = 0;
        /* Two requests at once. Without a rule for their length, only one at a time. */
        for (k = 0; k < (rules[i].kind == MBM_RULE_SILENCE ? 1u : 2u); k++) {
            wire.arriving[wire.last] = 17;
            memcpy(wire.arriving + wire.last + 1, pdus[i], lengths[i]);
            wire.last += seal(wire.arriving + wire.last, lengths[i] + 1);
        }
        for (k = 0; k < 10; k++)
            OK(mbm_server_poll(&server));
        assert_int_equal(wire.length, rules[i].kind == MBM_RULE_SILENCE ? 5 : 10);
        assert_int_equal(seen.length, lengths[i] - 1);
    }
}

static unsigned restarts, cleared;

static void restart(void *context, uint8_t clear_log)
{
    assert_ptr_equal(context, &diagnostics);
    restarts++;
    cleared += clear_log;
}

TEST(a_restart_is_reported)
{
    diagnostics.restart = restart;
    diagnostics.context = &diagnostics;
    diagnostics.diagnosticRegister = 0xABCD;
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    OK(mbm_unit_serveDiagnostics(&unit, &diagnostics));
    assert_int_equal(ASK("\x08\0\2\0\0"), 8);
    assert_memory_equal(wire.sent, "\x11\x08\0\2\xAB\xCD", 6);
    assert_int_equal(ASK("\x08\0\1\0\0"), 8);
    assert_int_equal(restarts * 10 + cleared, 10);
    assert_int_equal(ASK("\x08\0\1\xFF\0"), 8);
    assert_int_equal(restarts * 10 + cleared, 21);
}

TEST(a_lost_link_is_reported_and_poll_delay_is_the_silence)
{
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    OK(mbm_server_setSilence(&server, 5000));
    OK(mbm_server_poll(&server));
    assert_int_equal(mbm_server_pollDelay(&server), 0xFFFFFFFFu);
    wire.arriving[0] = 17;
    wire.last = 1;
    OK(mbm_server_poll(&server));
    assert_int_equal(mbm_server_pollDelay(&server), 4900);
    wire.lost = 1;
    IS(MBM_LINK_LOST, mbm_server_poll(&server));
}
