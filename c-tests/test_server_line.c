/* mbm's server on a serial line, a pty. libmodbus's client and the test itself send requests. */
#include "asked.h"
#include "await.h"
#include "crc.h"
#include "test.h"

#include <string.h>
#include <unistd.h>

static served rtu, ascii;
static modbus_t *client;

static void start(void)
{
    served_prepare(&rtu);
    served_on_line(&rtu, MBM_FRAMING_RTU);
    served_prepare(&ascii);
    served_on_line(&ascii, MBM_FRAMING_ASCII);
    client = modbus_new_rtu(rtu.line.path, 115200, 'N', 8, 1);
    assert_int_equal(asked_connect(client, SERVED_UNIT), 0);
}

static void stop(void)
{
    modbus_close(client);
    modbus_free(client);
    served_stop(&rtu);
    served_stop(&ascii);
}

fixture each_test = {start, stop};

TEST(libmodbus_reads_every_table)
{
    asked_reads(client);
}

TEST(libmodbus_writes_every_table)
{
    asked_writes(client, &rtu);
}

TEST(accesses_at_the_limits_of_every_table_are_right)
{
    asked_edges(client);
}

TEST(a_refused_write_changes_nothing)
{
    asked_refusals(client, &rtu);
}

TEST(the_server_id_is_reported)
{
    uint8_t id[64];

    assert_int_equal(modbus_report_slave_id(client, sizeof id, id), 8);
    assert_memory_equal(id, "mbm\xFFtest", 8);
}

TEST(every_function_is_served)
{
    asked_functions(modbus_get_socket(client), MBM_FRAMING_RTU, &rtu);
}

TEST(wrong_byte_counts_are_refused_in_time)
{
    asked_lies(modbus_get_socket(client), MBM_FRAMING_RTU, &rtu);
}

TEST(ascii_serves_every_function_too)
{
    asked_functions(ascii.line.theirs, MBM_FRAMING_ASCII, &ascii);
    asked_lies(ascii.line.theirs, MBM_FRAMING_ASCII, &ascii);
}

TEST(a_broadcast_is_carried_out_and_not_answered)
{
    asked_frames(modbus_get_socket(client), MBM_FRAMING_RTU, 0,
                 (const uint8_t *)"\x06\0\x64\x33\x44", 5, NULL, 0);
    AWAIT(rtu.words[0] == 0x3344);
    assert_int_equal(modbus_write_register(client, SERVED_BASE, 1), 1);
}

TEST(foreign_frames_around_requests_are_ignored)
{
    static const uint8_t ours[] = {SERVED_UNIT, 3, 0, SERVED_BASE, 0, 1, 0, 0};
    uint8_t bytes[600], answer[600];

    for (unsigned round = 0; round < 20; round++) {
        size_t n = 0;

        /* A request and the response of another unit, with no silence between any frames. */
        for (unsigned i = 0; i < round % 4; i++) {
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

TEST(damaged_and_cut_frames_are_not_answered)
{
    uint8_t bytes[8] = {SERVED_UNIT, 3, 0, SERVED_BASE, 0, 1}, answer[600];

    seal(bytes, 6);
    for (size_t length = 1; length < 8; length++)
        assert_int_equal(asked_bytes(modbus_get_socket(client), bytes, length, answer, 0), 0);
    bytes[4] ^= 0x40;
    assert_int_equal(asked_bytes(modbus_get_socket(client), bytes, 8, answer, 0), 0);
    bytes[4] ^= 0x40;
    assert_int_equal(asked_bytes(modbus_get_socket(client), bytes, 8, answer, 7), 7);
}

TEST(listen_only_mode_is_silent_until_a_restart)
{
    int fd = modbus_get_socket(client);
    uint16_t messages;

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
