/* Each function of servers and units is held to its comment in mbm.h: results, limits, NULL. */
#include "every_call.h"
#include "refused.h"
#include "crc.h"
#include "hooked_port.h"
#include "test.h"

static hooked_port wire;
static mbm_port port;
static mbm_server server;
static mbm_unit unit;
static mbm_registerTable table;
static mbm_bitTable bit_table;
static mbm_functionMask mask;
static uint16_t words[4];
static uint8_t frame[MBM_MAX_ASCII_FRAME], bits[1];

static void setup(void)
{
    memset(&wire, 0, sizeof wire);
    memset(&server, 0, sizeof server);
    port = hooked_port_of(&wire);
    unit = (mbm_unit){.id = 17};
    table = (mbm_registerTable){.words = words, .size = COUNT(words)};
    bit_table = (mbm_bitTable){.bits = bits, .size = 8};
    mask = (mbm_functionMask){0};
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
}

fixture each_test = {setup, NULL};

/* The begin functions by framing: the shortest buffer, and the silence by default in microseconds.
 * In TCP no silence ends a frame. */
static const struct {
    uint16_t least;
    uint32_t silence;
} begins[] = {{16, 4000}, {32, 1000000}, {MBM_MAX_TCP_FRAME, UINT32_MAX}, {16, 500000}};

static void begin(unsigned framing)
{
    OK(server_begin(&server, framing, &port, &unit, 1, frame, 300));
}

/* --- servers --- */

TEST(a_begin_is_refused_without_a_change)
{
    for (unsigned i = 0; i < COUNT(begins); i++) {
        const uint16_t least = begins[i].least;

        setup();
        OK(server_begin(&server, i, &port, &unit, 1, frame, least));
        IS(MBM_INVALID_ARGUMENT, server_begin(NULL, i, &port, &unit, 1, frame, least));
#define BEGIN(port, unit, frame, bytes)                                                            \
    INVALID(server, server_begin(&server, i, port, unit, 1, frame, bytes))
        BEGIN(NULL, &unit, frame, least);
        BEGIN(&port, NULL, frame, least);
        BEGIN(&port, &unit, NULL, least);
        BEGIN(&port, &unit, frame, least - 1);
        BEGIN(&port, &unit, frame, 0);
        for (int hook = HOOK_READ; hook <= HOOK_MICROS; hook++) {
            const mbm_port lacking = hooked_port_without(&wire, hook);

            BEGIN(&lacking, &unit, frame, 300);
        }
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
    for (unsigned first = 0; first < COUNT(begins); first++)
        for (unsigned i = 0; i < COUNT(begins); i++) {
            setup();
            begin(first);
            OK(mbm_server_setSilence(&server, 77));
            OK(mbm_server_setReceiveLatency(&server, 7));
            if (first == MBM_FRAMING_RTU)
                OK(mbm_server_setEchoDiscard(&server, 1));
            begin(i);
            assert_int_equal(silence(), begins[i].silence);
        }
}

TEST(a_server_that_was_never_begun_does_nothing)
{
    mbm_server *const servers[] = {NULL, &server};

    for (unsigned i = 0; i < COUNT(servers); i++) {
        const uint8_t status = i == 0 ? MBM_INVALID_ARGUMENT : MBM_NOT_INITIALISED;

        REFUSED(status, server, mbm_server_poll(servers[i]));
        REFUSED(status, server, mbm_server_setSilence(servers[i], 1));
        REFUSED(status, server, mbm_server_setReceiveLatency(servers[i], 1));
        REFUSED(status, server, mbm_server_setBaudRate(servers[i], 9600));
        REFUSED(status, server, mbm_server_setEchoDiscard(servers[i], 1));
        assert_int_equal(mbm_server_pollDelay(servers[i]), 0xFFFFFFFF);
    }
}

TEST(settings_of_rtu_are_refused_in_other_framings)
{
    /* The silence is that of 3.5 characters, each of 11 bits. */
    static const uint32_t rates[][2] = {{9600, 4011}, {115200, 1750}, {0, 4000}};

    for (unsigned i = 0; i < COUNT(begins); i++) {
        setup();
        begin(i);
        if (i == MBM_FRAMING_RTU) {
            for (unsigned k = 0; k < COUNT(rates); k++) {
                OK(mbm_server_setBaudRate(&server, rates[k][0]));
                assert_int_equal(silence(), rates[k][1]);
            }
            OK(mbm_server_setEchoDiscard(&server, 200));
            OK(mbm_server_setEchoDiscard(&server, 0));
        } else {
            INVALID(server, mbm_server_setBaudRate(&server, 9600));
            INVALID(server, mbm_server_setEchoDiscard(&server, 1));
        }
        OK(mbm_server_setReceiveLatency(&server, 0xFFFF));
        OK(mbm_server_setSilence(&server, 0xFFFFFFFF));
        if (i == MBM_FRAMING_RTU)
            assert_int_equal(silence(), 0x80000000);
        OK(mbm_server_setSilence(&server, 0));
    }
}

TEST(a_poll_reports_what_its_comment_says)
{
    static const uint8_t no_tcp[8] = {1, 2, 3, 4, 5, 6, 7, 8};

    begin(MBM_FRAMING_RTU);
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
    begin(MBM_FRAMING_TCP);
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
    static mbm_diagnostics diagnostics, other;
    static mbm_files files;
    static mbm_fifos fifos;
    static mbm_exceptionStatus status;
    static mbm_serverId id;
    static mbm_serverIdentification identification;
    static mbm_registerTable other_table;

#define NULLS(serve, record)                                                                       \
    INVALID(unit, mbm_unit_##serve(&unit, NULL));                                                  \
    INVALID(record, mbm_unit_##serve(NULL, &record))
    NULLS(serveCoils, bit_table);
    NULLS(serveDiscreteInputs, bit_table);
    NULLS(serveHoldingRegisters, table);
    NULLS(serveInputRegisters, table);
    NULLS(serveCustom, custom);
    NULLS(serveDiagnostics, diagnostics);
    NULLS(serveFiles, files);
    NULLS(serveFifos, fifos);
    NULLS(serveExceptionStatus, status);
    NULLS(serveServerId, id);
    NULLS(serveIdentification, identification);
    INVALID(unit, mbm_unit_serveCallbacks(&unit, NULL, 3));
    INVALID(cells, mbm_unit_serveCallbacks(NULL, &cells, 3));
    /* Without `get`. */
    INVALID(cells, mbm_unit_serveCallbacks(&unit, &cells, 3));
    INVALID(unit, mbm_unit_serveCallbacks(&unit, &cells, 3));
    /* Without `serve`. */
    custom.code = 0x41;
    INVALID(unit, mbm_unit_serveCustom(&unit, &custom));
    custom.serve = serve_nothing;
    custom.code = 128;
    INVALID(custom, mbm_unit_serveCustom(&unit, &custom));
    INVALID(unit, mbm_unit_serveCustom(&unit, &custom));
    custom.code = 0x41;
    custom.length.kind = 9;
    INVALID(custom, mbm_unit_serveCustom(&unit, &custom));
    for (unsigned code = 0; code < 256; code += code == 0 ? 128 : 1) {
        INVALID(unit, mbm_unit_switchFunction(&unit, &mask, (uint8_t)code, 0));
        INVALID(mask, mbm_unit_switchFunction(&unit, &mask, (uint8_t)code, 1));
    }
    INVALID(unit, mbm_unit_switchFunction(&unit, NULL, 3, 0));
    INVALID(mask, mbm_unit_switchFunction(NULL, &mask, 3, 0));
    /* A table that is not served, and one of input registers. */
    IS(MBM_INVALID_ARGUMENT, mbm_registerTable_serveMaskAndReadWrite(NULL));
    INVALID(other_table, mbm_registerTable_serveMaskAndReadWrite(&other_table));
    OK(mbm_unit_serveInputRegisters(&unit, &other_table));
    INVALID(other_table, mbm_registerTable_serveMaskAndReadWrite(&other_table));
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

#define SET(set, record)                                                                           \
    IS(MBM_INVALID_ARGUMENT, set(NULL, &hooks));                                                   \
    OK(set(&record, &hooks));                                                                      \
    OK(set(&record, NULL))
    SET(mbm_registerTable_setHooks, table);
    SET(mbm_bitTable_setHooks, bit_table);
    SET(mbm_dataCallbacks_setHooks, cells);
    SET(mbm_files_setHooks, files);
}

static mbm_fifos spare[MBM_MAX_SERVICES + 1];

TEST(a_unit_has_as_many_records_as_the_header_says)
{
    /* One of them is the table of `setup`. */
    for (unsigned i = 1; i < MBM_MAX_SERVICES; i++)
        OK(mbm_unit_serveFifos(&unit, &spare[i]));
    REFUSED(MBM_BUFFER_TOO_SMALL, unit, mbm_unit_serveFifos(&unit, &spare[0]));
    REFUSED(MBM_BUFFER_TOO_SMALL, unit, mbm_unit_serveCoils(&unit, &bit_table));
    REFUSED(MBM_BUFFER_TOO_SMALL, unit, mbm_unit_switchFunction(&unit, &mask, 3, 0));
}

/* Lets the unit respond to a read of one register, sent to `id`, with a damaged CRC or not. Returns
 * how many bytes the response in `frame` has. */
static uint16_t response_to_read(uint8_t id, uint8_t damage)
{
    uint16_t response = 9;

    memcpy(frame, "\x11\x03\0\0\0\1", 6);
    frame[0] = id;
    seal(frame, 6);
    frame[7] ^= damage;
    OK(mbm_unit_respond(&unit, 1, NULL, FRAMING(MBM_FRAMING_RTU), frame, 8, 260, &response));
    return response;
}

TEST(a_function_that_is_off_is_illegal)
{
    for (unsigned round = 0; round < 3; round++) {
        assert_int_equal(response_to_read(17, 0), round == 1 ? 5 : 7);
        assert_int_equal(frame[1], round == 1 ? 0x83 : 3);
        if (round == 1)
            IS(MBM_ILLEGAL_FUNCTION, frame[2]);
        OK(mbm_unit_switchFunction(&unit, &mask, 3, round == 1));
    }
}

TEST(a_response_has_no_bytes_where_no_device_answers)
{
    uint16_t response;

    assert_int_equal(response_to_read(17, 1), 0);
    assert_int_equal(response_to_read(18, 0), 0);
    assert_int_equal(response_to_read(0, 0), 0);
#define NO_RESPONSE(units, framing, frame, length)                                                 \
    response = 9;                                                                                  \
    IS(MBM_INVALID_ARGUMENT,                                                                       \
       mbm_unit_respond(units, 1, NULL, framing, frame, length, 260, &response));                  \
    assert_int_equal(response, 0)
    NO_RESPONSE(NULL, FRAMING(0), frame, 8);
    NO_RESPONSE(&unit, NULL, frame, 8);
    NO_RESPONSE(&unit, FRAMING(0), NULL, 8);
    NO_RESPONSE(&unit, FRAMING(0), frame, 261);
    NO_RESPONSE(&unit, FRAMING(9), frame, 8);
    IS(MBM_INVALID_ARGUMENT, mbm_unit_respond(&unit, 1, NULL, FRAMING(0), frame, 8, 260, NULL));
    unit.id = 300;
    NO_RESPONSE(&unit, FRAMING(0), frame, 8);
}
