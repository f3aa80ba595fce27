/* mbm's server on a serial line, a pty. libmodbus's client and the test itself send requests. */
#include "asked.h"
#include "await.h"
#include "crc.h"
#include "test.h"

#include <string.h>
#include <unistd.h>

static served rtu, ascii;
static modbus_t *client;

static int start(void **state)
{
    (void)state;
    served_prepare(&rtu);
    served_on_line(&rtu, MBM_FRAMING_RTU);
    served_prepare(&ascii);
    served_on_line(&ascii, MBM_FRAMING_ASCII);
    client = modbus_new_rtu(rtu.line.path, 115200, 'N', 8, 1);
    return asked_connect(client, SERVED_UNIT);
}

static int stop(void **state)
{
    (void)state;
    modbus_close(client);
    modbus_free(client);
    served_stop(&rtu);
    served_stop(&ascii);
    return 0;
}

static void libmodbus_reads_every_table(void **state)
{
    (void)state;
    asked_reads(client);
}

static void libmodbus_writes_every_table(void **state)
{
    (void)state;
    asked_writes(client, &rtu);
}

static void accesses_at_the_limits_of_every_table_are_right(void **state)
{
    (void)state;
    asked_edges(client);
}

static void a_refused_write_changes_nothing(void **state)
{
    (void)state;
    asked_refusals(client, &rtu);
}

static void the_server_id_is_reported(void **state)
{
    uint8_t id[64];

    (void)state;
    assert_int_equal(modbus_report_slave_id(client, sizeof id, id), 8);
    assert_memory_equal(id, "mbm\xFFtest", 8);
}

static void every_function_is_served(void **state)
{
    (void)state;
    asked_functions(modbus_get_socket(client), MBM_FRAMING_RTU, &rtu);
}

static void wrong_byte_counts_are_refused_in_time(void **state)
{
    (void)state;
    asked_lies(modbus_get_socket(client), MBM_FRAMING_RTU, &rtu);
}

static void ascii_serves_every_function_too(void **state)
{
    (void)state;
    asked_functions(ascii.line.theirs, MBM_FRAMING_ASCII, &ascii);
    asked_lies(ascii.line.theirs, MBM_FRAMING_ASCII, &ascii);
}

static void a_broadcast_is_carried_out_and_not_answered(void **state)
{
    (void)state;
    asked_frames(modbus_get_socket(client), MBM_FRAMING_RTU, 0,
                 (const uint8_t *)"\x06\0\x64\x33\x44", 5, NULL, 0);
    AWAIT(rtu.words[0] == 0x3344);
    assert_int_equal(modbus_write_register(client, SERVED_BASE, 1), 1);
}

static void foreign_frames_around_requests_are_ignored(void **state)
{
    static const uint8_t ours[] = {SERVED_UNIT, 3, 0, SERVED_BASE, 0, 1, 0, 0};
    uint8_t bytes[600], answer[600];
    unsigned round, i;

    (void)state;
    for (round = 0; round < 20; round++) {
        size_t n = 0;

        /* A request and the response of another unit, with no silence between any frames. */
        for (i = 0; i < round % 4; i++) {
            memcpy(bytes + n, "\x30\x03\x00\x00\x00\x10", 6);
            seal(bytes + n, 6);
            n += 8;
            memset(bytes + n, SERVED_UNIT, 35);
            memcpy(bytes + n, "\x30\x03\x20", 3);
            seal(bytes + n, 35);
            n += 37;
        }
        memcpy(bytes + n, ours, 6);
        seal(bytes + n, 6);
        assert_int_equal(asked_bytes(modbus_get_socket(client), bytes, n + 8, answer, 7), 7);
        assert_int_equal(answer[0], SERVED_UNIT);
    }
}

static void damaged_and_cut_frames_are_not_answered(void **state)
{
    uint8_t bytes[8] = {SERVED_UNIT, 3, 0, SERVED_BASE, 0, 1}, answer[600];
    size_t length;

    (void)state;
    seal(bytes, 6);
    for (length = 1; length < 8; length++)
        assert_int_equal(asked_bytes(modbus_get_socket(client), bytes, length, answer, 0), 0);
    bytes[4] ^= 0x40;
    assert_int_equal(asked_bytes(modbus_get_socket(client), bytes, 8, answer, 0), 0);
    bytes[4] ^= 0x40;
    assert_int_equal(asked_bytes(modbus_get_socket(client), bytes, 8, answer, 7), 7);
}

static void listen_only_mode_is_silent_until_a_restart(void **state)
{
    int fd = modbus_get_socket(client);
    uint16_t messages;

    (void)state;
    /* Each frame is followed by a wait: of two requests without silence between, only one
     * counts. */
    asked_frames(fd, MBM_FRAMING_RTU, SERVED_UNIT, (const uint8_t *)"\x08\0\x04\0\0", 5, NULL, 0);
    AWAIT(rtu.diagnostics.listenOnly == 1);
    messages = rtu.diagnostics.busMessages;
    asked_frames(fd, MBM_FRAMING_RTU, SERVED_UNIT, (const uint8_t *)"\x07", 1, NULL, 0);
    AWAIT(rtu.diagnostics.busMessages != messages);
    assert_int_equal(rtu.diagnostics.listenOnly, 1);
    asked_frames(fd, MBM_FRAMING_RTU, SERVED_UNIT, (const uint8_t *)"\x08\0\x01\0\0", 5, NULL, 0);
    AWAIT(rtu.diagnostics.listenOnly == 0);
    asked_frames(fd, MBM_FRAMING_RTU, SERVED_UNIT, (const uint8_t *)"\x07", 1,
                 (const uint8_t *)"\x07\x6D", 2);
}

/* Each test starts a server of its own, so that no test finds the state of another. */
#define TEST(test) cmocka_unit_test_setup_teardown(test, start, stop)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(libmodbus_reads_every_table),
        TEST(libmodbus_writes_every_table),
        TEST(accesses_at_the_limits_of_every_table_are_right),
        TEST(a_refused_write_changes_nothing),
        TEST(the_server_id_is_reported),
        TEST(every_function_is_served),
        TEST(wrong_byte_counts_are_refused_in_time),
        TEST(ascii_serves_every_function_too),
        TEST(a_broadcast_is_carried_out_and_not_answered),
        TEST(foreign_frames_around_requests_are_ignored),
        TEST(damaged_and_cut_frames_are_not_answered),
        TEST(listen_only_mode_is_silent_until_a_restart),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
