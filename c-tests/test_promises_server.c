/* Each function of servers and units is held to its comment in mbm.h: results, limits, NULL. */
#include "refused.h"
#include "crc.h"
#include "hooked_port.h"
#include "mbm.h"
#include "test.h"

static hooked_port wire;
static mbm_port port;
static mbm_server server;
static mbm_unit unit;
static mbm_registerTable table;
static mbm_bitTable bit_table;
static uint16_t words[4];
static uint8_t frame[MBM_MAX_ASCII_FRAME], bits[1];

static void setup(void)
{
    memset(&wire, 0, sizeof wire);
    memset(&server, 0, sizeof server);
    memset(&unit, 0, sizeof unit);
    memset(&table, 0, sizeof table);
    memset(&bit_table, 0, sizeof bit_table);
    port = hooked_port_of(&wire);
    unit.id = 17;
    table.words = words;
    table.size = COUNT(words);
    bit_table.bits = bits;
    bit_table.size = 8;
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
}

fixture each_test = {setup, NULL};

typedef uint8_t (*begins_server)(mbm_server *server, const mbm_port *port, mbm_unit *units,
                                 uint8_t count, uint8_t *frame, uint16_t bytes);

/* The begin functions: the shortest buffer, and the silence by default in microseconds. */
static const struct {
    begins_server begin;
    uint16_t least;
    uint32_t silence;
    uint8_t is_rtu;
} begins[] = {{mbm_server_beginRtu, 16, 4000, 1},
              {mbm_server_beginAscii, 32, 1000000, 0},
              {mbm_server_beginTcp, MBM_MAX_TCP_FRAME, 0, 0},
              {mbm_server_beginRtuOverTcp, 16, 500000, 0}};

/* --- servers --- */

TEST(a_begin_is_refused_without_a_change)
{
    for (unsigned i = 0; i < COUNT(begins); i++) {
        begins_server begin = begins[i].begin;
        uint16_t least = begins[i].least;
        mbm_port lacking;

        setup();
        OK(begin(&server, &port, &unit, 1, frame, least));
        IS(MBM_INVALID_ARGUMENT, begin(NULL, &port, &unit, 1, frame, least));
        REFUSED(MBM_INVALID_ARGUMENT, server, begin(&server, NULL, &unit, 1, frame, least));
        REFUSED(MBM_INVALID_ARGUMENT, server, begin(&server, &port, NULL, 1, frame, least));
        REFUSED(MBM_INVALID_ARGUMENT, server, begin(&server, &port, &unit, 1, NULL, least));
        REFUSED(MBM_INVALID_ARGUMENT, server, begin(&server, &port, &unit, 1, frame, least - 1));
        REFUSED(MBM_INVALID_ARGUMENT, server, begin(&server, &port, &unit, 1, frame, 0));
        lacking = port;
        lacking.read = NULL;
        REFUSED(MBM_INVALID_ARGUMENT, server, begin(&server, &lacking, &unit, 1, frame, 300));
        lacking = port;
        lacking.write = NULL;
        REFUSED(MBM_INVALID_ARGUMENT, server, begin(&server, &lacking, &unit, 1, frame, 300));
        lacking = port;
        lacking.micros = NULL;
        REFUSED(MBM_INVALID_ARGUMENT, server, begin(&server, &lacking, &unit, 1, frame, 300));
    }
}

/* The silence that ends a frame after its first byte, which arrives just now. */
static uint32_t silence(void)
{
    hooked_port_arrive(&wire, ":", 1);
    OK(mbm_server_poll(&server));
    OK(mbm_server_poll(&server));
    return mbm_server_pollDelay(&server);
}

TEST(a_begin_restores_the_defaults_of_its_framing)
{
    for (unsigned first = 0; first < COUNT(begins); first++) {
        for (unsigned i = 0; i < COUNT(begins); i++) {
            setup();
            OK(begins[first].begin(&server, &port, &unit, 1, frame, 300));
            OK(mbm_server_setSilence(&server, 77));
            OK(mbm_server_setReceiveLatency(&server, 7));
            if (begins[first].is_rtu)
                OK(mbm_server_setEchoDiscard(&server, 1));
            OK(begins[i].begin(&server, &port, &unit, 1, frame, 300));
            /* In TCP no silence ends a frame. */
            assert_int_equal(silence(), begins[i].silence ? begins[i].silence : UINT32_MAX);
        }
    }
}

TEST(a_server_that_was_never_begun_does_nothing)
{
    REFUSED(MBM_NOT_INITIALISED, server, mbm_server_poll(&server));
    REFUSED(MBM_NOT_INITIALISED, server, mbm_server_setSilence(&server, 1));
    REFUSED(MBM_NOT_INITIALISED, server, mbm_server_setReceiveLatency(&server, 1));
    REFUSED(MBM_NOT_INITIALISED, server, mbm_server_setBaudRate(&server, 9600));
    REFUSED(MBM_NOT_INITIALISED, server, mbm_server_setEchoDiscard(&server, 1));
    assert_int_equal(mbm_server_pollDelay(&server), 0xFFFFFFFF);
    IS(MBM_INVALID_ARGUMENT, mbm_server_poll(NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_server_setSilence(NULL, 1));
    IS(MBM_INVALID_ARGUMENT, mbm_server_setReceiveLatency(NULL, 1));
    IS(MBM_INVALID_ARGUMENT, mbm_server_setBaudRate(NULL, 9600));
    IS(MBM_INVALID_ARGUMENT, mbm_server_setEchoDiscard(NULL, 1));
    assert_int_equal(mbm_server_pollDelay(NULL), 0xFFFFFFFF);
}

TEST(settings_of_rtu_are_refused_in_other_framings)
{
    for (unsigned i = 0; i < COUNT(begins); i++) {
        setup();
        OK(begins[i].begin(&server, &port, &unit, 1, frame, 300));
        if (begins[i].is_rtu) {
            OK(mbm_server_setBaudRate(&server, 9600));
            assert_int_equal(silence(), 4011); /* 3.5 * 11 / 9600 s */
            OK(mbm_server_setBaudRate(&server, 115200));
            assert_int_equal(silence(), 1750);
            OK(mbm_server_setBaudRate(&server, 0));
            assert_int_equal(silence(), 4000);
            OK(mbm_server_setEchoDiscard(&server, 200));
            OK(mbm_server_setEchoDiscard(&server, 0));
        } else {
            REFUSED(MBM_INVALID_ARGUMENT, server, mbm_server_setBaudRate(&server, 9600));
            REFUSED(MBM_INVALID_ARGUMENT, server, mbm_server_setEchoDiscard(&server, 1));
        }
        OK(mbm_server_setReceiveLatency(&server, 0xFFFF));
        OK(mbm_server_setSilence(&server, 0xFFFFFFFF));
        if (begins[i].is_rtu)
            assert_int_equal(silence(), 0x80000000);
        OK(mbm_server_setSilence(&server, 0));
    }
}

TEST(a_poll_reports_what_its_comment_says)
{
    static const uint8_t no_tcp[8] = {1, 2, 3, 4, 5, 6, 7, 8};

    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, 256));
    assert_int_equal(mbm_server_pollDelay(&server), 0);
    OK(mbm_server_poll(&server));
    assert_int_equal(mbm_server_pollDelay(&server), 0xFFFFFFFF);
    hooked_port_arrive_rtu(&wire, 17, "\3\0\0\0\1", 5);
    OK(mbm_server_poll(&server));
    assert_int_equal(mbm_server_pollDelay(&server), 4000);
    wire.now += 4000;
    assert_int_equal(mbm_server_pollDelay(&server), 0);
    OK(mbm_server_poll(&server));
    assert_int_equal(wire.length, 7);
    wire.lost = 1;
    IS(MBM_LINK_LOST, mbm_server_poll(&server));
    wire.lost = 0;
    OK(mbm_server_beginTcp(&server, &port, &unit, 1, frame, MBM_MAX_TCP_FRAME));
    hooked_port_arrive(&wire, no_tcp, sizeof no_tcp);
    IS(MBM_MALFORMED_FRAME, mbm_server_poll(&server));
}

/* --- units --- */

static uint16_t serve_nothing(void *context, const mbm_request *request, uint8_t *response,
                              uint16_t capacity)
{
    return 0;
}

TEST(records_are_refused_without_a_change)
{
    static mbm_dataCallbacks cells;
    static mbm_custom custom;
    static mbm_functionMask mask;
    static mbm_diagnostics diagnostics, other;
    static mbm_files files;
    static mbm_fifos fifos;
    static mbm_exceptionStatus status;
    static mbm_serverId id;
    static mbm_serverIdentification identification;
    static mbm_registerTable other_table;

#define NULLS(function, record)                                                                    \
    do {                                                                                           \
        REFUSED(MBM_INVALID_ARGUMENT, unit, function(&unit, NULL));                                \
        REFUSED(MBM_INVALID_ARGUMENT, record, function(NULL, &record));                            \
    } while (0)
    NULLS(mbm_unit_serveCoils, bit_table);
    NULLS(mbm_unit_serveDiscreteInputs, bit_table);
    NULLS(mbm_unit_serveHoldingRegisters, table);
    NULLS(mbm_unit_serveInputRegisters, table);
    NULLS(mbm_unit_serveCustom, custom);
    NULLS(mbm_unit_serveDiagnostics, diagnostics);
    NULLS(mbm_unit_serveFiles, files);
    NULLS(mbm_unit_serveFifos, fifos);
    NULLS(mbm_unit_serveExceptionStatus, status);
    NULLS(mbm_unit_serveServerId, id);
    NULLS(mbm_unit_serveIdentification, identification);
    REFUSED(MBM_INVALID_ARGUMENT, unit, mbm_unit_serveCallbacks(&unit, NULL, 3));
    REFUSED(MBM_INVALID_ARGUMENT, cells, mbm_unit_serveCallbacks(NULL, &cells, 3));
    /* Without `get`. */
    REFUSED(MBM_INVALID_ARGUMENT, unit, mbm_unit_serveCallbacks(&unit, &cells, 3));
    /* Without `serve`. */
    custom.code = 0x41;
    REFUSED(MBM_INVALID_ARGUMENT, unit, mbm_unit_serveCustom(&unit, &custom));
    custom.serve = serve_nothing;
    custom.code = 128;
    REFUSED(MBM_INVALID_ARGUMENT, custom, mbm_unit_serveCustom(&unit, &custom));
    REFUSED(MBM_INVALID_ARGUMENT, unit, mbm_unit_serveCustom(&unit, &custom));
    custom.code = 0x41;
    custom.length.kind = 9;
    REFUSED(MBM_INVALID_ARGUMENT, custom, mbm_unit_serveCustom(&unit, &custom));
    REFUSED(MBM_INVALID_ARGUMENT, cells, mbm_unit_serveCallbacks(&unit, &cells, 3));
    for (unsigned code = 0; code < 256; code++) {
        if (code >= 1 && code <= 127)
            continue;
        REFUSED(MBM_INVALID_ARGUMENT, unit,
                mbm_unit_switchFunction(&unit, &mask, (uint8_t)code, 0));
        REFUSED(MBM_INVALID_ARGUMENT, mask,
                mbm_unit_switchFunction(&unit, &mask, (uint8_t)code, 1));
    }
    REFUSED(MBM_INVALID_ARGUMENT, unit, mbm_unit_switchFunction(&unit, NULL, 3, 0));
    REFUSED(MBM_INVALID_ARGUMENT, mask, mbm_unit_switchFunction(NULL, &mask, 3, 0));
    memset(&other_table, 0, sizeof other_table);
    IS(MBM_INVALID_ARGUMENT, mbm_registerTable_serveMaskAndReadWrite(NULL));
    REFUSED(MBM_INVALID_ARGUMENT, other_table,
            mbm_registerTable_serveMaskAndReadWrite(&other_table));
    OK(mbm_unit_serveInputRegisters(&unit, &other_table));
    REFUSED(MBM_INVALID_ARGUMENT, other_table,
            mbm_registerTable_serveMaskAndReadWrite(&other_table));
    OK(mbm_registerTable_serveMaskAndReadWrite(&table));
    /* A table is served as one kind; a unit has one diagnostics. */
    REFUSED(MBM_BUSY, table, mbm_unit_serveInputRegisters(&unit, &table));
    OK(mbm_unit_serveCoils(&unit, &bit_table));
    REFUSED(MBM_BUSY, bit_table, mbm_unit_serveDiscreteInputs(&unit, &bit_table));
    OK(mbm_unit_serveDiagnostics(&unit, &diagnostics));
    REFUSED(MBM_BUSY, unit, mbm_unit_serveDiagnostics(&unit, &other));
}

TEST(hooks_are_set_and_removed)
{
    static const mbm_accessHooks hooks;
    static mbm_dataCallbacks cells;
    static mbm_files files;

    IS(MBM_INVALID_ARGUMENT, mbm_registerTable_setHooks(NULL, &hooks));
    IS(MBM_INVALID_ARGUMENT, mbm_bitTable_setHooks(NULL, &hooks));
    IS(MBM_INVALID_ARGUMENT, mbm_dataCallbacks_setHooks(NULL, &hooks));
    IS(MBM_INVALID_ARGUMENT, mbm_files_setHooks(NULL, &hooks));
#define SET(set, record)                                                                           \
    do {                                                                                           \
        OK(set(&record, &hooks));                                                                  \
        OK(set(&record, NULL));                                                                    \
    } while (0)
    SET(mbm_registerTable_setHooks, table);
    SET(mbm_bitTable_setHooks, bit_table);
    SET(mbm_dataCallbacks_setHooks, cells);
    SET(mbm_files_setHooks, files);
}

static mbm_fifos spare[MBM_MAX_SERVICES + 1];

TEST(a_unit_has_as_many_records_as_the_header_says)
{
    static mbm_functionMask mask;

    /* One of them is the table of `setup`. */
    for (unsigned i = 1; i < MBM_MAX_SERVICES; i++)
        OK(mbm_unit_serveFifos(&unit, &spare[i]));
    REFUSED(MBM_BUFFER_TOO_SMALL, unit, mbm_unit_serveFifos(&unit, &spare[0]));
    REFUSED(MBM_BUFFER_TOO_SMALL, unit, mbm_unit_serveCoils(&unit, &bit_table));
    REFUSED(MBM_BUFFER_TOO_SMALL, unit, mbm_unit_switchFunction(&unit, &mask, 3, 0));
}

TEST(a_function_that_is_off_is_illegal)
{
    static mbm_functionMask mask;
    uint8_t request[260] = {17, 3, 0, 0, 0, 1};
    uint16_t response;

    memset(&mask, 0, sizeof mask);
    for (unsigned round = 0; round < 3; round++) {
        memcpy(request, "\x11\x03\0\0\0\1", 6);
        seal(request, 6);
        OK(mbm_unit_respond(&unit, 1, NULL, FRAMING(MBM_FRAMING_RTU), request, 8, 260, &response));
        assert_int_equal(response, round == 1 ? 5 : 7);
        assert_int_equal(request[1], round == 1 ? 0x83 : 3);
        if (round == 1)
            assert_int_equal(request[2], MBM_ILLEGAL_FUNCTION);
        OK(mbm_unit_switchFunction(&unit, &mask, 3, round == 1));
    }
}

TEST(a_response_has_no_bytes_where_no_device_answers)
{
    static const struct {
        uint8_t unit, damage;
    } rows[] = {{17, 1}, {18, 0}, {0, 0}};
    uint8_t request[260];
    uint16_t response;

    for (unsigned i = 0; i < COUNT(rows); i++) {
        memcpy(request, "\x11\x03\0\0\0\1", 6);
        request[0] = rows[i].unit;
        seal(request, 6);
        request[7] ^= rows[i].damage;
        response = 9;
        OK(mbm_unit_respond(&unit, 1, NULL, FRAMING(MBM_FRAMING_RTU), request, 8, 260, &response));
        assert_int_equal(response, 0);
    }
    response = 9;
#define NO_RESPONSE(call)                                                                          \
    do {                                                                                           \
        response = 9;                                                                              \
        IS(MBM_INVALID_ARGUMENT, call);                                                            \
        assert_int_equal(response, 0);                                                             \
    } while (0)
    NO_RESPONSE(mbm_unit_respond(NULL, 1, NULL, FRAMING(0), request, 8, 260, &response));
    NO_RESPONSE(mbm_unit_respond(&unit, 1, NULL, NULL, request, 8, 260, &response));
    NO_RESPONSE(mbm_unit_respond(&unit, 1, NULL, FRAMING(0), NULL, 8, 260, &response));
    NO_RESPONSE(mbm_unit_respond(&unit, 1, NULL, FRAMING(0), request, 261, 260, &response));
    NO_RESPONSE(mbm_unit_respond(&unit, 1, NULL, FRAMING(9), request, 8, 260, &response));
    IS(MBM_INVALID_ARGUMENT, mbm_unit_respond(&unit, 1, NULL, FRAMING(0), request, 8, 260, NULL));
    unit.id = 300;
    NO_RESPONSE(mbm_unit_respond(&unit, 1, NULL, FRAMING(0), request, 8, 260, &response));
}
