/* Every function of a line, a node or a server, called from within each of its hooks. Where no call
 * is allowed, it returns MBM_BUSY and changes nothing. Where calls are allowed, they work. */
#include "unchanged.h"
#include "hooked_port.h"
#include "test.h"

#include <string.h>

static hooked_port wire;
static mbm_port port;
static uint8_t small_frame[MBM_MAX_TCP_FRAME], other_frame[MBM_MAX_TCP_FRAME];
static uint16_t words[8];

static mbm_line line;
static mbm_node master;
static mbm_server server;
static mbm_unit unit;

static void reset(void)
{
    memset(&wire, 0, sizeof wire);
    memset(&line, 0, sizeof line);
    memset(&master, 0, sizeof master);
    memset(&server, 0, sizeof server);
    memset(&unit, 0, sizeof unit);
    memset(words, 0, sizeof words);
    wire.step = 500;
    port = hooked_port_of(&wire);
    entered = 0;
}

fixture each_test = {reset, NULL};

/* --- master --- */

static void every_function_of_the_line_is_busy(void)
{
    mbm_counters counters;
    mbm_node *m = &master;

    IS(MBM_BUSY, mbm_line_beginRtu(&line, &port, other_frame, 8));
    IS(MBM_BUSY, mbm_line_setFrame(&line, other_frame, 8));
    IS(MBM_BUSY, mbm_line_cancel(&line));
    IS(MBM_BUSY, mbm_line_setBaudRate(&line, 1));
    IS(MBM_BUSY, mbm_line_setGap(&line, 1));
    IS(MBM_BUSY, mbm_line_setTurnaroundDelay(&line, 1));
    IS(MBM_BUSY, mbm_line_setQuietTime(&line, 1));
    IS(MBM_BUSY, mbm_line_setRetries(&line, 1));
    IS(MBM_BUSY, mbm_line_setEchoDiscard(&line, 1));
    IS(MBM_BUSY, mbm_line_setPostFlushHold(&line, 1));
    IS(MBM_BUSY, mbm_line_setCounters(&line, &counters));
    IS(MBM_BUSY, mbm_line_used(&line));
    IS(MBM_BUSY, mbm_line_usedAt(&line, 0));
    IS(MBM_BUSY, mbm_node_readCoils(m, 0, 1));
    IS(MBM_BUSY, mbm_node_readDiscreteInputs(m, 0, 1));
    IS(MBM_BUSY, mbm_node_readHoldingRegisters(m, 0, 1));
    IS(MBM_BUSY, mbm_node_readInputRegisters(m, 0, 1));
    IS(MBM_BUSY, mbm_node_writeSingleCoil(m, 0, 1));
    IS(MBM_BUSY, mbm_node_writeSingleRegister(m, 0, 1));
    IS(MBM_BUSY, mbm_node_writeMultipleCoils(m, 0, 1));
    IS(MBM_BUSY, mbm_node_writeQueuedCoils(m));
    IS(MBM_BUSY, mbm_node_writeMultipleRegisters(m, 0, 1));
    IS(MBM_BUSY, mbm_node_writeQueuedRegisters(m));
    IS(MBM_BUSY, mbm_node_maskWriteRegister(m, 0, 1, 2));
    IS(MBM_BUSY, mbm_node_readWriteMultipleRegisters(m, 0, 1, 0, 1));
    IS(MBM_BUSY, mbm_node_readWriteQueuedRegisters(m, 0, 1));
}

/* Of a node whose request is pending. */
static void its_request_is_busy(void)
{
    IS(MBM_BUSY, mbm_node_setLenient(&master, 1));
    IS(MBM_BUSY, mbm_node_begin(&master, &line, 1, words, 1, words, 1));
    IS(MBM_BUSY, mbm_node_poll(&master));
    assert_int_equal(mbm_node_pollDelay(&master), 0);
    IS(MBM_BUSY, mbm_node_cancel(&master));
    IS(MBM_BUSY, mbm_node_status(&master));
}

/* A node's own words and settings may be used. */
static void its_words_and_settings_are_free(void)
{
    mbm_node *m = &master;

    assert_int_equal(mbm_node_getSlaveID(m), 17);
    OK(mbm_node_setSlaveID(m, 17));
    OK(mbm_node_setResponseTimeout(m, 2000));
    OK(mbm_node_beginTransmission(m, 1));
    OK(mbm_node_send(m, 0x77));
    assert_int_equal(mbm_node_getExceptionCode(m), 0);
    assert_int_equal(mbm_node_available(m), 0);
    assert_int_equal(mbm_node_receive(m), 0xFFFF);
}

/* A request is pending. */
static int is_pending;

static void within_master(int hook)
{
    if (hook != HOOK_IDLE) {
        UNCHANGED_BY(line, every_function_of_the_line_is_busy());
        UNCHANGED_BY(master, every_function_of_the_line_is_busy());
        if (is_pending) {
            UNCHANGED_BY(line, its_request_is_busy());
            UNCHANGED_BY(master, its_request_is_busy());
        }
        its_words_and_settings_are_free();
    }
    if (hook == HOOK_POST)
        hooked_port_arrive_rtu(&wire, 17, "\3\2\x12\x34", 4);
}

static void begin_master(void)
{
    OK(mbm_line_beginRtu(&line, &port, small_frame, 64));
    OK(mbm_node_begin(&master, &line, 17, words, 4, words + 4, 4));
    wire.within = within_master;
    is_pending = 0;
}

TEST(no_hook_of_a_masters_port_may_call_the_master)
{
    begin_master();
    is_pending = 1;
    OK(mbm_node_readHoldingRegisters(&master, 0, 1));
    assert_int_equal(mbm_node_receive(&master), 0x1234);
    for (int i = 0; i < HOOKS; i++)
        assert_true(wire.called[i] > 0);
    /* The same outside of a request. */
    entered = 0;
    is_pending = 0;
    OK(mbm_line_used(&line));
    is_pending = 1;
    OK(mbm_node_setBlocking(&master, 0));
    IS(MBM_PENDING, mbm_node_readHoldingRegisters(&master, 0, 1));
    assert_true(mbm_node_pollDelay(&master) < 0xFFFFFFFFu);
    assert_true(entered >= 2);
    /* A cancel calls the hook that switches the driver off. */
    entered = 0;
    wire.called[HOOK_POST] = 0;
    while (wire.called[HOOK_WRITE] < 2)
        IS(MBM_PENDING, mbm_node_poll(&master));
    OK(mbm_node_cancel(&master));
    assert_true(entered > 0);
    OK(mbm_node_getSlaveID(&master) == 17 ? MBM_OK : MBM_BUSY);
}

/* What the idle hook does. Each value is tried in a request of its own. */
static int idle_does;

static void within_idle(int hook)
{
    mbm_node fresh;

    if (hook == HOOK_POST && idle_does != 2)
        hooked_port_arrive_rtu(&wire, 17, "\3\2\x12\x34", 4);
    if (hook != HOOK_IDLE)
        return;
    entered++;
    switch (idle_does) {
    case 0:
        IS(MBM_BUSY, mbm_node_readCoils(&master, 0, 1));
        IS(MBM_BUSY, mbm_node_begin(&master, &line, 17, words, 1, words, 1));
        IS(MBM_BUSY, mbm_line_setFrame(&line, small_frame, 8));
        IS(MBM_PENDING, mbm_node_status(&master));
        assert_int_equal(mbm_node_getSlaveID(&master), 17);
        assert_true(mbm_node_pollDelay(&master) < 0xFFFFFFFFu);
        OK(mbm_line_setQuietTime(&line, 1));
        break;
    case 1: mbm_node_poll(&master); break;
    case 2: OK(mbm_node_cancel(&master)); break;
    case 3: OK(mbm_line_cancel(&line)); break;
    default: memset(&fresh, 0, sizeof fresh); memcpy(&master, &fresh, sizeof master);
    }
}

TEST(an_idle_hook_may_call_its_master)
{
    static const uint8_t ends[] = {MBM_OK, MBM_OK, MBM_CANCELLED, MBM_CANCELLED,
                                   MBM_NOT_INITIALISED};

    for (idle_does = 0; idle_does < (int)sizeof ends; idle_does++) {
        begin_master();
        entered = 0;
        wire.within = within_idle;
        IS(ends[idle_does], mbm_node_readHoldingRegisters(&master, 0, 1));
        assert_true(entered > 0);
        wire.within = NULL;
        OK(mbm_line_cancel(&line)); /* the last node is lost with its request */
    }
}

/* --- server --- */

static void every_function_of_the_server_is_busy(void)
{
    IS(MBM_BUSY, mbm_server_beginRtu(&server, &port, &unit, 1, other_frame, 260));
    IS(MBM_BUSY, mbm_server_beginAscii(&server, &port, &unit, 1, other_frame, 260));
    IS(MBM_BUSY, mbm_server_beginTcp(&server, &port, &unit, 1, other_frame, 260));
    IS(MBM_BUSY, mbm_server_beginRtuOverTcp(&server, &port, &unit, 1, other_frame, 260));
    IS(MBM_BUSY, mbm_server_setSilence(&server, 1));
    IS(MBM_BUSY, mbm_server_setBaudRate(&server, 9600));
    IS(MBM_BUSY, mbm_server_setEchoDiscard(&server, 1));
    IS(MBM_BUSY, mbm_server_setReceiveLatency(&server, 1));
    IS(MBM_BUSY, mbm_server_poll(&server));
    assert_int_equal(mbm_server_pollDelay(&server), 0);
}

static void within_server(int hook)
{
    (void)hook;
    UNCHANGED_BY(server, every_function_of_the_server_is_busy());
}

static mbm_registerTable table, late_table;
static mbm_dataCallbacks cells;
static mbm_custom custom;
static mbm_diagnostics diagnostics;
static mbm_files files;
static const mbm_file file = {words, 8, 1};
static unsigned hooks_called;

/* A hook may change what its unit serves. */
static mbm_accessHooks access_hooks;

static void within_unit(void)
{
    hooks_called++;
    within_server(0);
    OK(mbm_unit_serveInputRegisters(&unit, &late_table));
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(mbm_unit_serveCallbacks(&unit, &cells, 1));
    OK(mbm_unit_serveCustom(&unit, &custom));
    OK(mbm_unit_serveFiles(&unit, &files));
    OK(mbm_unit_serveDiagnostics(&unit, &diagnostics));
    OK(mbm_registerTable_setHooks(&table, NULL));
    OK(mbm_registerTable_setHooks(&table, &access_hooks));
    OK(mbm_dataCallbacks_setHooks(&cells, NULL));
    OK(mbm_dataCallbacks_setHooks(&cells, &access_hooks));
    OK(mbm_files_setHooks(&files, NULL));
    OK(mbm_files_setHooks(&files, &access_hooks));
}

static uint8_t before_access(void *context, const mbm_access *access)
{
    (void)context;
    (void)access;
    within_unit();
    return 0;
}

static void after_access(void *context, const mbm_access *access)
{
    before_access(context, access);
}

static uint8_t cell_is_valid(void *context, uint16_t address)
{
    (void)context;
    (void)address;
    within_unit();
    return 1;
}

static uint16_t cell_get(void *context, uint16_t address)
{
    return cell_is_valid(context, address);
}

static void cell_set(void *context, uint16_t address, uint16_t value)
{
    (void)value;
    cell_is_valid(context, address);
}

static uint16_t carry_out(void *context, const mbm_request *asked, uint8_t *response,
                          uint16_t capacity)
{
    static mbm_functionMask switches;

    (void)context;
    (void)capacity;
    (void)asked;
    within_unit();
    OK(mbm_unit_switchFunction(&unit, &switches, 7, 0));
    response[0] = 1;
    return 1;
}

static void restarted(void *context, uint8_t clears)
{
    cell_is_valid(context, clears);
}

static void serve_all(void)
{
    access_hooks.beforeRead = access_hooks.beforeWrite = before_access;
    access_hooks.afterWrite = after_access;
    memset(&table, 0, sizeof table);
    memset(&late_table, 0, sizeof late_table);
    memset(&cells, 0, sizeof cells);
    memset(&custom, 0, sizeof custom);
    memset(&diagnostics, 0, sizeof diagnostics);
    memset(&files, 0, sizeof files);
    unit.id = 17;
    table.words = late_table.words = words;
    table.size = late_table.size = 8;
    OK(mbm_registerTable_setHooks(&table, &access_hooks));
    cells.isValid = cell_is_valid;
    cells.get = cell_get;
    cells.set = cell_set;
    OK(mbm_dataCallbacks_setHooks(&cells, &access_hooks));
    custom.serve = carry_out;
    custom.code = 65;
    diagnostics.restart = restarted;
    files.files = &file;
    files.count = 1;
    OK(mbm_files_setHooks(&files, &access_hooks));
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(mbm_registerTable_serveMaskAndReadWrite(&table));
    OK(mbm_unit_serveCallbacks(&unit, &cells, 1));
    OK(mbm_unit_serveCustom(&unit, &custom));
    OK(mbm_unit_serveDiagnostics(&unit, &diagnostics));
    OK(mbm_unit_serveFiles(&unit, &files));
}

static size_t exchange(const char *pdu, size_t length)
{
    wire.length = 0;
    hooked_port_arrive_rtu(&wire, 17, pdu, length);
    for (unsigned i = 0; i < 100; i++)
        OK(mbm_server_poll(&server));
    return wire.length;
}

#define ASK(pdu) exchange(pdu, sizeof pdu - 1)

TEST(no_hook_of_a_server_may_call_the_server)
{
    static const struct {
        const char *pdu;
        size_t length, answer;
        unsigned hooks;
    } requests[] = {
        {"\x06\0\0\0\1", 5, 8, 2},
        {"\x03\0\0\0\1", 5, 7, 1},
        {"\x16\0\0\0\0\0\1", 7, 10, 3},
        {"\x17\0\0\0\1\0\0\0\1\2\0\1", 12, 7, 3},
        {"\x01\0\0\0\2", 5, 6, 5},
        {"\x05\0\0\xFF\0", 5, 8, 4},
        {"\x41", 1, 5, 1},
        {"\x08\0\1\0\0", 5, 8, 1},
        {"\x14\x07\6\0\1\0\0\0\1", 9, 9, 1},
        {"\x15\x09\6\0\1\0\0\0\1\0\2", 11, 14, 2},
    };

    serve_all();
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, small_frame, 256));
    wire.within = within_server;
    for (unsigned i = 0; i < COUNT(requests); i++) {
        hooks_called = 0;
        assert_int_equal(exchange(requests[i].pdu, requests[i].length), requests[i].answer);
        assert_true(hooks_called >= requests[i].hooks);
    }
    assert_int_equal(ASK("\x04\0\0\0\1"), 7); /* the value of the hook that is registered first */
    for (unsigned i = 0; i < HOOK_IDLE; i++)
        assert_true(wire.called[i] > 0);
    /* After the time of an echo it sleeps. */
    wire.now += mbm_server_pollDelay(&server);
    OK(mbm_server_poll(&server));
    assert_int_equal(mbm_server_pollDelay(&server), 0xFFFFFFFFu);
    OK(mbm_server_setSilence(&server, 1000));
}

/* A restart hook that zeroes the server, or begins it anew with another framing. */
static int begins_anew;

static void start_over(void *context, uint8_t clears)
{
    (void)context;
    (void)clears;
    hooks_called++;
    memset(&server, 0, sizeof server);
    if (begins_anew)
        OK(mbm_server_beginTcp(&server, &port, &unit, 1, other_frame, 260));
}

TEST(a_server_that_its_hook_zeroes_is_not_accessed_again)
{
    static const mbm_server zero;

    for (begins_anew = 0; begins_anew < 2; begins_anew++) {
        unsigned i;

        serve_all();
        diagnostics.restart = start_over;
        OK(mbm_server_beginRtu(&server, &port, &unit, 1, small_frame, 256));
        hooked_port_arrive_rtu(&wire, 17, "\x08\0\1\0\0", 5);
        hooks_called = 0;
        wire.length = 0;
        for (i = 0; i < 100 && hooks_called == 0; i++)
            OK(mbm_server_poll(&server));
        assert_int_equal(hooks_called, 1);
        assert_int_equal(wire.length, 0);
        if (begins_anew) {
            hooked_port_arrive(&wire, "\0\1\0\0\0\6\x11\x03\0\0\0\1", 12);
            OK(mbm_server_poll(&server));
            OK(mbm_server_poll(&server));
            assert_int_equal(wire.length, 11);
        } else {
            assert_memory_equal(&server, &zero, sizeof zero);
            IS(MBM_NOT_INITIALISED, mbm_server_poll(&server));
        }
        memset(&server, 0, sizeof server);
    }
}
