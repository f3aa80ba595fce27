/* User-defined functions among the other services of a unit. */
#include "mbm.h"
#include "test.h"

#include <string.h>

enum { UNIT = 17, HEAD = 7, FIRST_CODE = 65 };

static struct {
    uint8_t request[12], sent[MBM_MAX_TCP_FRAME];
    /* Bytes of the request that have not been read yet. */
    size_t left;
    size_t length;
} wire;

static mbm_server server;
static mbm_unit unit;
static mbm_registerTable table;
static mbm_custom ours[MBM_MAX_SERVICES];
static uint16_t words[4];
static uint8_t frame[MBM_MAX_TCP_FRAME];

static int16_t wire_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    (void)context;
    size_t count = wire.left < capacity ? wire.left : capacity;
    memcpy(bytes, wire.request + sizeof wire.request - wire.left, count);
    wire.left -= count;
    return (int16_t)count;
}

static int16_t wire_write(void *context, const uint8_t *bytes, uint16_t length)
{
    (void)context;
    memcpy(wire.sent + wire.length, bytes, length);
    wire.length += length;
    return (int16_t)length;
}

static uint32_t wire_micros(void *context)
{
    (void)context;
    return 0;
}

static const mbm_port port = {.read = wire_read, .write = wire_write, .micros = wire_micros};

/* Responds with the number of its record. */
static uint16_t serve(void *context, const mbm_request *request, uint8_t *response,
                      uint16_t capacity)
{
    (void)request;
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

static int reset(void **state)
{
    (void)state;
    memset(&server, 0, sizeof server);
    memset(&unit, 0, sizeof unit);
    memset(&table, 0, sizeof table);
    memset(ours, 0, sizeof ours);
    unit.id = UNIT;
    table.words = words;
    table.size = 4;
    OK(mbm_server_beginTcp(&server, &port, &unit, 1, frame, sizeof frame));
    return 0;
}

/* Returns the number of the record that answers a request of this function, -1 for the
 * table, -2 for exception 01. */
static int answers(uint8_t function)
{
    const uint8_t request[] = {0, 1, 0, 0, 0, 6, UNIT, function, 0, 0, 0, 1};

    memcpy(wire.request, request, sizeof request);
    wire.left = sizeof wire.request;
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

static void a_custom_function_is_found_at_any_place(void **state)
{
    unsigned count, at, i;

    for (count = 0; count <= MBM_MAX_SERVICES; count++) {
        /* The table stands at each place among them, or is not registered. */
        for (at = 0; at <= MBM_MAX_SERVICES; at++) {
            if (count == MBM_MAX_SERVICES && at < MBM_MAX_SERVICES)
                continue;
            reset(state);
            for (i = 0; i < count; i++) {
                if (i == at)
                    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
                add(i, (uint8_t)(FIRST_CODE + i));
            }
            for (i = 0; i < count; i++)
                assert_int_equal(answers((uint8_t)(FIRST_CODE + i)), (int)i);
            if (count > 0) {
                assert_int_equal(answers((uint8_t)(FIRST_CODE + count)), -2);
                assert_int_equal(answers(3), at < count ? -1 : -2);
            }
        }
    }
}

static void a_custom_function_of_code_0_is_called_in_its_order(void **state)
{
    unsigned zero, i;

    for (zero = 0; zero < MBM_MAX_SERVICES; zero++) {
        reset(state);
        for (i = 0; i < MBM_MAX_SERVICES; i++)
            add(i, i == zero ? 0 : (uint8_t)(FIRST_CODE + i));
        for (i = 0; i < MBM_MAX_SERVICES; i++)
            assert_int_equal(answers((uint8_t)(FIRST_CODE + i)), (int)(i < zero ? i : zero));
        assert_int_equal(answers(3), (int)zero);
    }
}

static void a_code_that_is_changed_counts_from_then_on(void **state)
{
    unsigned i;

    (void)state;
    for (i = 0; i < MBM_MAX_SERVICES; i++)
        add(i, (uint8_t)(FIRST_CODE + i));
    ours[13].code = 100;
    assert_int_equal(answers(100), 13);
    assert_int_equal(answers(FIRST_CODE + 13), -2);
}

static void a_record_that_was_zeroed_serves_nothing(void **state)
{
    unsigned i;

    (void)state;
    for (i = 0; i < MBM_MAX_SERVICES; i++)
        add(i, (uint8_t)(FIRST_CODE + i));
    memset(&ours[6], 0, sizeof ours[6]);
    assert_int_equal(answers(FIRST_CODE + 6), -2);
    assert_int_equal(answers(FIRST_CODE + 7), 7);
}

#define TEST(test) cmocka_unit_test_setup(test, reset)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_custom_function_is_found_at_any_place),
        TEST(a_custom_function_of_code_0_is_called_in_its_order),
        TEST(a_code_that_is_changed_counts_from_then_on),
        TEST(a_record_that_was_zeroed_serves_nothing),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
