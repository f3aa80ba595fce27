/* User-defined functions among the other services of a unit. */
#include "crc.h"
#include "hooked_port.h"
#include "test.h"

enum { UNIT = 17, HEAD = 7, FIRST_CODE = 65 };

static hooked_port wire;
static mbm_port port;
static mbm_server server;
static mbm_unit unit;
static mbm_registerTable table;
static mbm_custom ours[MBM_MAX_SERVICES];
static uint16_t words[4];
static uint8_t frame[MBM_MAX_TCP_FRAME];

/* Responds with the number of its record. */
static uint16_t serve(void *context, const mbm_request *request, uint8_t *response,
                      uint16_t capacity)
{
    assert_true(capacity > 0);
    response[0] = (uint8_t)((const mbm_custom *)context - ours);
    return 1;
}

static void add(unsigned which, uint8_t code)
{
    ours[which].serve = serve;
    ours[which].context = &ours[which];
    ours[which].code = code;
    OK(mbm_unit_serveCustom(&unit, &ours[which]));
}

static void reset(void)
{
    memset(&server, 0, sizeof server);
    memset(&unit, 0, sizeof unit);
    memset(&table, 0, sizeof table);
    memset(ours, 0, sizeof ours);
    port = hooked_port_of(&wire);
    unit.id = UNIT;
    table.words = words;
    table.size = 4;
    OK(mbm_server_beginTcp(&server, &port, &unit, 1, frame, sizeof frame));
}

fixture each_test = {reset, NULL};

/* Returns the number of the record that answers a request of this function, -1 for the
 * table, -2 for exception 01. */
static int answers(uint8_t function)
{
    const uint8_t request[] = {0, 1, 0, 0, 0, 6, UNIT, function, 0, 0, 0, 1};

    hooked_port_arrive(&wire, request, sizeof request);
    wire.length = 0;
    OK(mbm_server_poll(&server));
    assert_true(wire.length > HEAD + 1);
    if (wire.sent[HEAD] == (function | 0x80)) {
        assert_int_equal(wire.sent[HEAD + 1], 1);
        return -2;
    }
    assert_int_equal(wire.sent[HEAD], function);
    return wire.length == HEAD + 2 ? wire.sent[HEAD + 1] : -1;
}

TEST(a_custom_function_is_found_at_any_place)
{
    unsigned at;

    for (unsigned count = 0; count <= MBM_MAX_SERVICES; count++) {
        /* The table stands at each place among them, or is not registered. */
        for (at = 0; at <= MBM_MAX_SERVICES; at++) {
            if (count == MBM_MAX_SERVICES && at < MBM_MAX_SERVICES)
                continue;
            reset();
            for (unsigned i = 0; i < count; i++) {
                if (i == at)
                    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
                add(i, (uint8_t)(FIRST_CODE + i));
            }
            for (unsigned i = 0; i < count; i++)
                assert_int_equal(answers((uint8_t)(FIRST_CODE + i)), (int)i);
            if (count > 0) {
                assert_int_equal(answers((uint8_t)(FIRST_CODE + count)), -2);
                assert_int_equal(answers(3), at < count ? -1 : -2);
            }
        }
    }
}

TEST(a_custom_function_of_code_0_is_called_in_its_order)
{
    for (unsigned zero = 0; zero < MBM_MAX_SERVICES; zero++) {
        reset();
        for (unsigned i = 0; i < MBM_MAX_SERVICES; i++)
            add(i, i == zero ? 0 : (uint8_t)(FIRST_CODE + i));
        for (unsigned i = 0; i < MBM_MAX_SERVICES; i++)
            assert_int_equal(answers((uint8_t)(FIRST_CODE + i)), (int)(i < zero ? i : zero));
        assert_int_equal(answers(3), (int)zero);
    }
}

TEST(a_code_that_is_changed_counts_from_then_on)
{
    for (unsigned i = 0; i < MBM_MAX_SERVICES; i++)
        add(i, (uint8_t)(FIRST_CODE + i));
    ours[13].code = 100;
    assert_int_equal(answers(100), 13);
    assert_int_equal(answers(FIRST_CODE + 13), -2);
}

TEST(a_record_that_was_zeroed_serves_nothing)
{
    for (unsigned i = 0; i < MBM_MAX_SERVICES; i++)
        add(i, (uint8_t)(FIRST_CODE + i));
    memset(&ours[6], 0, sizeof ours[6]);
    assert_int_equal(answers(FIRST_CODE + 6), -2);
    assert_int_equal(answers(FIRST_CODE + 7), 7);
}

/* The result of the declining function, and its last request. */
static struct {
    uint16_t reply;
    unsigned calls;
    uint8_t unit, function, first;
    const void *connection;
} declining;

static uint16_t decline(void *context, const mbm_request *request, uint8_t *response,
                        uint16_t capacity)
{
    declining.calls++;
    declining.unit = request->unit;
    declining.function = request->function;
    declining.first = request->length > 0 ? request->data[0] : 0xFF;
    declining.connection = request->connection;
    /* A function that declines may have written already. */
    memset(response, 0xEE, capacity);
    return declining.reply;
}

static void add_declining(unsigned which, uint8_t code)
{
    memset(&declining, 0, sizeof declining);
    declining.reply = MBM_REPLY_DECLINED;
    ours[which].serve = decline;
    ours[which].code = code;
    OK(mbm_unit_serveCustom(&unit, &ours[which]));
}

TEST(a_function_that_declines_leaves_the_request_to_the_built_in_one)
{
    for (unsigned before = 0; before < MBM_MAX_SERVICES - 1; before++) {
        reset();
        for (unsigned i = 0; i < before; i++)
            add(i, (uint8_t)(FIRST_CODE + i));
        add_declining(before, 3);
        OK(mbm_unit_serveHoldingRegisters(&unit, &table));
        words[0] = 0xABCD;
        assert_int_equal(answers(3), -1);
        assert_memory_equal(wire.sent + HEAD, "\3\2\xAB\xCD", 4);
        assert_int_equal(declining.calls, 1);
    }
}

TEST(a_function_before_the_built_in_one_may_answer_or_refuse)
{
    add_declining(0, 3);
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    declining.reply = 1;
    assert_int_equal(answers(3), 0xEE);
    declining.reply = MBM_REPLY_EXCEPTION | MBM_ILLEGAL_FUNCTION;
    assert_int_equal(answers(3), -2);
    declining.reply = MBM_REPLY_DECLINED;
    assert_int_equal(answers(3), -1);
    assert_int_equal(declining.calls, 3);
}

TEST(a_function_that_declines_leaves_the_request_to_the_next_of_its_code)
{
    add_declining(0, FIRST_CODE);
    add_declining(1, 0);
    add(2, FIRST_CODE);
    add(3, FIRST_CODE);
    assert_int_equal(answers(FIRST_CODE), 2);
    assert_int_equal(declining.calls, 2);
}

TEST(a_request_that_all_decline_is_answered_with_exception_01)
{
    for (unsigned i = 0; i < MBM_MAX_SERVICES; i++)
        add_declining(i, i % 2 ? FIRST_CODE : 0);
    assert_int_equal(answers(FIRST_CODE), -2);
    assert_int_equal(declining.calls, MBM_MAX_SERVICES);
}

TEST(a_function_that_was_pending_may_decline_then)
{
    add_declining(0, 3);
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    declining.reply = MBM_REPLY_PENDING;
    hooked_port_arrive(&wire, "\0\1\0\0\0\6\x11\3\0\0\0\1", 12);
    wire.length = 0;
    OK(mbm_server_poll(&server));
    OK(mbm_server_poll(&server));
    assert_int_equal(wire.length, 0);
    declining.reply = MBM_REPLY_DECLINED;
    OK(mbm_server_poll(&server));
    assert_int_equal(wire.length, HEAD + 4);
    assert_int_equal(declining.calls, 3);
}

TEST(a_declined_request_is_counted_as_the_record_that_answers_has_it)
{
    static mbm_diagnostics diagnostics;

    memset(&diagnostics, 0, sizeof diagnostics);
    add_declining(0, 0);
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(mbm_unit_serveDiagnostics(&unit, &diagnostics));
    assert_int_equal(answers(3), -1);
    assert_int_equal(diagnostics.events, 1);
    assert_int_equal(diagnostics.exceptionErrors, 0);
    assert_int_equal(answers(FIRST_CODE), -2);
    assert_int_equal(diagnostics.events, 1);
    assert_int_equal(diagnostics.exceptionErrors, 1);
}

TEST(a_decline_with_other_bits_is_exception_04)
{
    add_declining(0, 3);
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    declining.reply = MBM_REPLY_DECLINED | 1;
    hooked_port_arrive(&wire, "\0\1\0\0\0\6\x11\3\0\0\0\1", 12);
    wire.length = 0;
    OK(mbm_server_poll(&server));
    assert_memory_equal(wire.sent + HEAD, "\x83\4", 2);
}

TEST(a_function_gets_the_connection_of_its_request)
{
    uint8_t request[MBM_MAX_FRAME] = {UNIT, FIRST_CODE, 7};
    uint16_t length;

    add_declining(0, FIRST_CODE);
    assert_int_equal(answers(FIRST_CODE), -2);
    assert_ptr_equal(declining.connection, &wire);
    assert_int_equal(declining.unit, UNIT);
    assert_int_equal(declining.function, FIRST_CODE);
    seal(request, 3);
    OK(mbm_unit_respond(&unit, 1, words, FRAMING(MBM_FRAMING_RTU), request, 5, sizeof request,
                        &length));
    assert_int_equal(length, 5);
    assert_int_equal(declining.first, 7);
    assert_ptr_equal(declining.connection, words);
}
