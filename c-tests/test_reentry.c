/* Every function of a line, a node or a server, called from within each of its hooks. Where no call
 * is allowed, it returns MBM_BUSY and changes nothing. Where calls are allowed, they work. */
#include "refused.h"
#include "every_call.h"
#include "hooked_port.h"

/* How often a hook has made its calls. */
static unsigned entered;

/* Asserts that the calls leave the object as it was. */
#define UNCHANGED_BY(object, calls)                                                                \
    do {                                                                                           \
        UNCHANGED(object, calls);                                                                  \
        entered++;                                                                                 \
    } while (0)

static hooked_port wire;
static mbm_port port;
static uint8_t small_frame[MBM_MAX_TCP_FRAME], other_frame[MBM_MAX_TCP_FRAME];
static uint16_t words[8];

static mbm_line line;
static mbm_node master;
static mbm_server server;
static mbm_unit unit;
static mbm_client client;
static mbm_clientRequest request, another;
static mbm_identification identification;

static void reset(void)
{
    memset(&wire, 0, sizeof wire);
    memset(&line, 0, sizeof line);
    memset(&master, 0, sizeof master);
    memset(&server, 0, sizeof server);
    memset(&unit, 0, sizeof unit);
    memset(&client, 0, sizeof client);
    memset(&request, 0, sizeof request);
    memset(&another, 0, sizeof another);
    memset(&identification, 0, sizeof identification);
    memset(words, 0, sizeof words);
    wire.step = 500;
    port = hooked_port_of(&wire);
    entered = 0;
}

fixture each_test = {reset, NULL};

/* --- master --- */

static void every_function_of_the_line_is_busy(void)
{
    IS(MBM_BUSY, mbm_line_beginRtu(&line, &port, other_frame, 8));
    IS(MBM_BUSY, mbm_line_setFrame(&line, other_frame, 8));
    every_line_call_returns(MBM_BUSY, &line);
    every_node_request_returns(MBM_BUSY, &master);
}

/* Calls on a node whose request is pending. */
static void its_request_is_busy(void)
{
    IS(MBM_BUSY, mbm_node_setLenient(&master, 1));
    IS(MBM_BUSY, mbm_node_begin(&master, &line, 1, words, 1, words, 1));
    IS(MBM_BUSY, mbm_node_poll(&master));
    assert_int_equal(mbm_node_pollDelay(&master), 0);
    IS(MBM_BUSY, mbm_node_cancel(&master));
    IS(MBM_BUSY, mbm_node_status(&master));
    IS(MBM_BUSY, mbm_node_idle(&master, NULL));
    IS(MBM_BUSY, mbm_node_preTransmission(&master, NULL));
    IS(MBM_BUSY, mbm_node_postTransmission(&master, NULL));
    assert_int_equal(mbm_node_requestFrom(&master, 0, 1), 0);
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
    OK(mbm_node_send8(m, 0x78));
    OK(mbm_node_send32(m, 0x79));
    OK(mbm_node_clearTransmitBuffer(m));
    OK(mbm_node_setTransmitBuffer(m, 0, 0x77));
    OK(mbm_node_clearResponseBuffer(m));
    assert_int_equal(mbm_node_getResponseBuffer(m, 0), 0);
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

/* The actions of the idle hook. Each value is tried in a request of its own. */
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
    within_unit();
    return 0;
}

static void after_access(void *context, const mbm_access *access)
{
    before_access(context, access);
}

static uint8_t cell_is_valid(void *context, uint16_t address)
{
    within_unit();
    return 1;
}

static uint16_t cell_get(void *context, uint16_t address)
{
    return cell_is_valid(context, address);
}

static void cell_set(void *context, uint16_t address, uint16_t value)
{
    cell_is_valid(context, address);
}

static uint16_t carry_out(void *context, const mbm_request *asked, uint8_t *response,
                          uint16_t capacity)
{
    static mbm_functionMask switches;

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
    unit.id = 17;
    table = late_table = (mbm_registerTable){.words = words, .size = 8};
    cells = (mbm_dataCallbacks){.isValid = cell_is_valid, .get = cell_get, .set = cell_set};
    custom = (mbm_custom){.serve = carry_out, .code = 65};
    diagnostics = (mbm_diagnostics){.restart = restarted};
    files = (mbm_files){.files = &file, .count = 1};
    OK(mbm_registerTable_setHooks(&table, &access_hooks));
    OK(mbm_dataCallbacks_setHooks(&cells, &access_hooks));
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

/* Every function of a client, called from within each of its hooks. Where no call is
 * allowed, it returns MBM_BUSY and changes nothing. Calls from `done` work. */

/* No read begins an identification, or it is cancelled again. */
static void an_identification_answers(uint8_t status)
{
    const mbm_identification kept = identification;

    identification.request.unit = 17;
    identification.request.reply = words;
    IS(status, mbm_identification_read(&identification, &client, MBM_DEVICE_ID_BASIC, 0));
    if (status == MBM_PENDING)
        OK(mbm_client_cancel(&client, &identification.request));
    identification = kept;
}

static void every_function_of_the_client_is_busy(void)
{
    static mbm_line borrower;
    static const mbm_node zero;
    static const mbm_linkHooks link = {.context = NULL};
    static uint8_t asked[sizeof another];

    IS(MBM_BUSY, mbm_client_beginRtu(&client, &port, other_frame, 260));
    IS(MBM_BUSY, mbm_client_beginAscii(&client, &port, other_frame, 260));
    IS(MBM_BUSY, mbm_client_beginRtuOverTcp(&client, &port, other_frame, 260));
    IS(MBM_BUSY, mbm_client_beginTcp(&client, &port, other_frame, 260, other_frame, 260));
    every_client_setting_returns(MBM_BUSY, &client);
    another.data = words;
    memcpy(asked, &another, sizeof another);
    every_client_request_returns(MBM_BUSY, &client, &another);
    assert_memory_equal(asked, &another, sizeof another);
    an_identification_answers(MBM_BUSY);
    memcpy(asked, &request, sizeof request);
    every_client_request_returns(MBM_BUSY, &client, &request);
    IS(MBM_BUSY, mbm_client_cancel(&client, &request));
    assert_memory_equal(asked, &request, sizeof request);
    IS(MBM_BUSY, mbm_client_setDelimiter(&client, '!'));
    IS(MBM_BUSY, mbm_client_reconnect(&client, &link));
    IS(MBM_BUSY, mbm_client_suspend(&client, NULL));
    IS(MBM_BUSY, mbm_client_suspend(&client, &borrower));
    IS(MBM_BUSY, mbm_client_resume(&client, &borrower));
    assert_memory_equal(&borrower, &zero, sizeof zero);
    IS(MBM_BUSY, mbm_client_poll(&client));
    assert_int_equal(mbm_client_pollDelay(&client), 0);
    assert_int_equal(mbm_client_pending(&client), 0);
    assert_int_equal(mbm_client_isConnected(&client), 0);
}

static void within_client(int hook)
{
    UNCHANGED_BY(client, every_function_of_the_client_is_busy());
}

static unsigned drawn;

static uint32_t reentrant_random(void *context)
{
    drawn++;
    UNCHANGED_BY(client, every_function_of_the_client_is_busy());
    return 7;
}

/* Begins the client in framing 0 to 3. */
static void begin_client(int framing)
{
    memset(&client, 0, sizeof client);
    OK(client_begin(&client, (unsigned)framing, &port, small_frame, 256, other_frame, 260));
    OK(mbm_client_setResponseTimeout(&client, 20));
    OK(mbm_client_setQuietTime(&client, 1));
}

static void poll_until_all_have_ended(void)
{
    for (unsigned i = 0; i < 3000 && mbm_client_poll(&client) == MBM_PENDING; i++) {
    }
    assert_int_equal(mbm_client_pending(&client), 0);
}

TEST(no_hook_of_a_clients_port_nor_its_random_function_may_call_the_client)
{
    for (int framing = 0; framing < 4; framing++) {
        wire.within = framing == 2 ? NULL : within_client; /* the begin of TCP calls no hook */
        begin_client(framing);
        wire.within = within_client;
        OK(mbm_client_setRetries(&client, 2));
        OK(mbm_client_setBackoff(&client, MBM_BACKOFF_FIXED, 1, 1));
        OK(mbm_client_setJitter(&client, 100, reentrant_random, NULL));
        request = (mbm_clientRequest){.unit = 17};
        entered = drawn = 0;
        IS(MBM_PENDING, mbm_client_readCoils(&client, &request, 0, 1));
        assert_true(mbm_client_pollDelay(&client) < 0xFFFFFFFFu);
        poll_until_all_have_ended();
        IS(MBM_RESPONSE_TIMED_OUT, request.status);
        assert_int_equal(drawn, 2);
        assert_true(entered > drawn);
        /* While the driver is on, cancelling and connecting anew call hooks. */
        IS(MBM_PENDING, mbm_client_readCoils(&client, &request, 0, 1));
        IS(MBM_PENDING, mbm_client_poll(&client));
        OK(mbm_client_reconnect(&client, NULL));
        poll_until_all_have_ended();
        IS(MBM_LINK_LOST, request.status);
        IS(MBM_PENDING, mbm_client_readCoils(&client, &request, 0, 1));
        IS(MBM_PENDING, mbm_client_poll(&client));
        OK(mbm_client_cancel(&client, &request));
    }
    for (int framing = 0; framing < HOOK_IDLE; framing++)
        assert_true(wire.called[framing] > 0);
}

static int done_does, framing_of_done;

static void connect_anew(void *context)
{
    entered++;
    /* Only the poll that called `done` is running. */
    IS(MBM_BUSY, mbm_client_poll(&client));
    assert_int_equal(mbm_client_isConnected(&client), 1);
}

static void done(void *context, mbm_clientRequest *ended)
{
    const mbm_linkHooks link = {.disconnect = connect_anew};
    static mbm_line borrower;

    entered++;
    IS(MBM_BUSY, mbm_client_poll(&client));
    switch (done_does) {
    case 0:
        every_client_setting_returns(MBM_OK, &client);
        another.unit = ended->unit = 17;
        another.data = ended->data = words;
        every_client_request_returns(MBM_PENDING, &client, &another);
        every_client_request_returns(MBM_PENDING, &client, ended);
        an_identification_answers(MBM_PENDING);
        assert_true(mbm_client_pollDelay(&client) == 0xFFFFFFFFu);
        assert_int_equal(mbm_client_pending(&client), 0);
        IS(framing_of_done == 1 ? MBM_OK : MBM_INVALID_ARGUMENT,
           mbm_client_setDelimiter(&client, '!'));
        break;
    case 1: OK(mbm_client_reconnect(&client, &link)); break;
    case 2:
        OK(mbm_client_suspend(&client, NULL));
        IS(MBM_BUSY, mbm_client_suspend(&client, NULL));
        OK(mbm_client_resume(&client, NULL));
        memset(&borrower, 0, sizeof borrower);
        if (framing_of_done % 3 == 0) {
            OK(mbm_client_suspend(&client, &borrower));
            OK(mbm_client_resume(&client, &borrower));
        }
        break;
    case 3:
        /* The object is zeroed. Its other requests are given up. */
        memset(&client, 0, sizeof client);
        break;
    default:
        /* The object is begun again with another framing. */
        begin_client((framing_of_done + 1) % 4);
        OK(mbm_client_poll(&client));
    }
}

TEST(a_done_function_may_call_its_client)
{
    for (framing_of_done = 0; framing_of_done < 4; framing_of_done++) {
        for (done_does = 0; done_does < 5; done_does++) {
            static mbm_clientRequest waits;

            begin_client(framing_of_done);
            memset(&request, 0, sizeof request);
            memset(&another, 0, sizeof another);
            memset(&waits, 0, sizeof waits);
            request.unit = waits.unit = 17;
            request.done = done;
            entered = 0;
            wire.lost = 1;
            IS(MBM_PENDING, mbm_client_readCoils(&client, &request, 0, 1));
            if (done_does >= 3)
                IS(MBM_PENDING, mbm_client_readCoils(&client, &waits, 0, 1));
            poll_until_all_have_ended();
            assert_true(entered > 0);
            wire.lost = 0;
            if (done_does == 3)
                IS(MBM_NOT_INITIALISED, mbm_client_poll(&client));
            else
                OK(mbm_client_poll(&client));
        }
    }
}

TEST(the_clock_may_not_call_the_client_that_gives_its_port_to_a_line)
{
    static mbm_line shared;

    memset(&shared, 0, sizeof shared);
    begin_client(0);
    request.unit = 17;
    IS(MBM_PENDING, mbm_client_readCoils(&client, &request, 0, 1));
    wire.within = within_client;
    OK(mbm_client_suspend(&client, &shared));
    wire.within = NULL;
    assert_int_equal(entered, 1);
    OK(mbm_client_resume(&client, &shared));
}
