/* mbm's server on a socket: TCP and RTU over TCP, several connections, and clients that
 * misbehave. */
#define _GNU_SOURCE
#include "asked.h"
#include "await.h"
#include "crc.h"
#include "tcp_server.h"
#include "test.h"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

static served tcp, rtu;
static modbus_t *client;

/* One of the server's places is the client's. */
enum { FREE = SERVED_CONNECTIONS - 1 };

static void start(void)
{
    served_prepare(&tcp);
    served_on_tcp(&tcp, MBM_FRAMING_TCP);
    served_prepare(&rtu);
    served_on_tcp(&rtu, MBM_FRAMING_RTU_OVER_TCP);
    client = modbus_new_tcp("127.0.0.1", tcp.port);
    assert_int_equal(asked_connect(client, SERVED_UNIT), 0);
}

static void stop(void)
{
    modbus_close(client);
    modbus_free(client);
    served_stop(&tcp);
    served_stop(&rtu);
}

fixture each_test = {start, stop};

/* Makes the server go through its loop, so that it has seen what its sockets received before. */
static void go_round(void)
{
    uint16_t word;

    for (unsigned i = 0; i < 3; i++)
        assert_int_equal(modbus_read_registers(client, SERVED_BASE, 1, &word), 1);
}

/* Waits until every place except the client's is free. */
static void all_places_are_free(void)
{
    int fds[FREE];
    unsigned i, taken = 0, tries = 0;

    while (taken < FREE) {
        if (tries++ == PATIENCE_MS / 10)
            fail_msg("of %u places %u are free", FREE, taken);
        for (i = 0; i < FREE; i++)
            fds[i] = tcp_connectTo((uint16_t)tcp.port);
        for (i = taken = 0; i < FREE; i++)
            taken += (unsigned)asked_is_served(fds[i], SERVED_UNIT, 0x6D);
        for (i = 0; i < FREE; i++)
            close(fds[i]);
        poll(NULL, 0, taken < FREE ? 10 : 0);
    }
}

TEST(libmodbus_reads_and_writes_every_table)
{
    asked_reads(client);
    asked_writes(client, &tcp);
    asked_edges(client);
    asked_refusals(client, &tcp);
}

TEST(libmodbus_without_a_unit_is_answered)
{
    uint16_t word;

    modbus_set_slave(client, MODBUS_TCP_SLAVE);
    assert_int_equal(modbus_read_registers(client, SERVED_BASE, 1, &word), 1);
    modbus_set_slave(client, SERVED_UNIT);
}

TEST(every_function_is_served)
{
    int fd = tcp_connectTo((uint16_t)tcp.port), other = tcp_connectTo((uint16_t)rtu.port);

    asked_functions(fd, MBM_FRAMING_TCP, &tcp);
    asked_lies(fd, MBM_FRAMING_TCP, &tcp);
    asked_functions(other, MBM_FRAMING_RTU_OVER_TCP, &rtu);
    asked_lies(other, MBM_FRAMING_RTU_OVER_TCP, &rtu);
    close(fd);
    close(other);
}

TEST(requests_in_one_segment_are_answered_in_turn)
{
    static const uint8_t one[] = {0, 1, 0, 0, 0, 6, SERVED_UNIT, 4, 0, SERVED_BASE, 0, 1};
    uint8_t bytes[20 * sizeof one], answer[600];
    int fd = tcp_connectTo((uint16_t)tcp.port);

    for (unsigned i = 0; i < 20; i++) {
        memcpy(bytes + i * sizeof one, one, sizeof one);
        bytes[i * sizeof one + 1] = (uint8_t)i;
    }
    assert_int_equal(asked_bytes(fd, bytes, sizeof bytes, answer, 20 * 11), 20 * 11);
    for (unsigned i = 0; i < 20; i++)
        assert_int_equal(answer[i * 11 + 1], i);
    close(fd);
}

/* One client sends a byte now and then, one sends nothing. The server serves the others. */
TEST(slow_and_half_open_connections_do_not_stall_others)
{
    static const uint8_t one[] = {0, 7, 0, 0, 0, 6, SERVED_UNIT, 4, 0, SERVED_BASE, 0, 1};
    int slow = tcp_connectTo((uint16_t)tcp.port), silent = tcp_connectTo((uint16_t)tcp.port);
    uint8_t answer[600];
    uint16_t word;
    unsigned i;

    assert_int_equal(write(silent, one, 5), 5);
    for (i = 0; i < sizeof one - 1; i++) {
        assert_int_equal(asked_bytes(slow, &one[i], 1, answer, 0), 0);
        for (unsigned k = 0; k < 20; k++)
            assert_int_equal(modbus_read_registers(client, SERVED_BASE, 1, &word), 1);
    }
    usleep(1100000);
    assert_int_equal(asked_bytes(slow, &one[i], 1, answer, 11), 11);
    close(slow);
    close(silent);
}

/* The server's socket of a connection. */
static int far_end(int fd)
{
    struct sockaddr_in ours, theirs;
    socklen_t size = sizeof ours;

    assert_int_equal(getsockname(fd, (struct sockaddr *)&ours, &size), 0);
    for (unsigned i = 0; i < SERVED_CONNECTIONS; i++) {
        size = sizeof theirs;
        if (tcp.fds[i] >= 0 && getpeername(tcp.fds[i], (struct sockaddr *)&theirs, &size) == 0 &&
            theirs.sin_port == ours.sin_port)
            return tcp.fds[i];
    }
    fail_msg("the server has no such connection");
    return -1;
}

static int is_full(int fd)
{
    struct pollfd writable = {fd, POLLOUT, 0};

    return poll(&writable, 1, 0) == 0;
}

/* Sends until neither end accepts more bytes. Then all requests that were sent are
 * answered, in order. */
TEST(a_client_that_reads_nothing_does_not_stall_others)
{
    static uint8_t answers[300];
    uint8_t one[] = {0, 0, 0, 0, 0, 6, SERVED_UNIT, 4, 0, SERVED_BASE, 0, 125};
    int fd = tcp_connectTo((uint16_t)tcp.port), theirs;
    size_t sent = 0, i;
    unsigned naps = 0;

    assert_true(asked_is_served(fd, SERVED_UNIT, 0x6D));
    theirs = far_end(fd);
    while (!is_full(fd) || !is_full(theirs)) {
        ssize_t count;

        one[0] = (uint8_t)(sent / sizeof one >> 8);
        one[1] = (uint8_t)(sent / sizeof one);
        i = sent % sizeof one;
        count = send(fd, one + i, sizeof one - i, MSG_DONTWAIT);
        if (count > 0) {
            sent += (size_t)count;
        } else {
            assert_int_equal(errno, EAGAIN);
            assert_true(naps++ < PATIENCE_MS);
            poll(NULL, 0, 1);
        }
    }
    assert_true(sent > 1000 * sizeof one);
    for (i = 0; i < 20; i++)
        go_round();
    for (i = 0; i < sent / sizeof one; i++) {
        await_bytes(fd, answers, 259);
        assert_int_equal(answers[0] << 8 | answers[1], i & 0xFFFF);
        assert_int_equal(answers[8], 250);
    }
    close(fd);
}

TEST(further_connections_are_closed_and_the_others_served)
{
    int fds[SERVED_CONNECTIONS + 8];

    for (unsigned i = 0; i < COUNT(fds); i++) {
        fds[i] = tcp_connectTo((uint16_t)tcp.port);
        go_round();
    }
    for (unsigned i = 0; i < COUNT(fds); i++)
        assert_int_equal(asked_is_served(fds[i], SERVED_UNIT, 0x6D), i < FREE);
    for (unsigned i = 0; i < COUNT(fds); i++)
        close(fds[i]);
    all_places_are_free();
}

TEST(a_stream_that_is_not_modbus_is_closed)
{
    uint8_t byte;
    int fd = tcp_connectTo((uint16_t)tcp.port);
    struct pollfd readable = {fd, POLLIN, 0};

    assert_int_equal(write(fd, "GET / HTTP/1.0\r\n\r\n", 18), 18);
    assert_int_equal(poll(&readable, 1, PATIENCE_MS), 1);
    assert_true(read(fd, &byte, 1) <= 0);
    close(fd);
}

TEST(a_connection_that_breaks_frees_its_place)
{
    for (unsigned i = 0; i < 50; i++) {
        int fd = tcp_connectTo((uint16_t)tcp.port);

        assert_int_equal(write(fd, "\0\1\0\0\0\6", i % 7), i % 7);
        if (i % 2)
            (void)tcp_resetAtClose(fd);
        close(fd);
        go_round();
    }
    all_places_are_free();
}

/* mbm's server on a serial line, a pty. libmodbus's client and the test itself send requests. */

static served line_rtu, ascii;

static void start_lines(void)
{
    served_prepare(&line_rtu);
    served_on_line(&line_rtu, MBM_FRAMING_RTU);
    served_prepare(&ascii);
    served_on_line(&ascii, MBM_FRAMING_ASCII);
    client = modbus_new_rtu(line_rtu.line.path, 115200, 'N', 8, 1);
    assert_int_equal(asked_connect(client, SERVED_UNIT), 0);
}

static void stop_lines(void)
{
    modbus_close(client);
    modbus_free(client);
    served_stop(&line_rtu);
    served_stop(&ascii);
}

TEST_ROW_WITH(libmodbus_reads_every_table, start_lines, stop_lines, asked_reads(client))
TEST_ROW_WITH(libmodbus_writes_every_table, start_lines, stop_lines,
              asked_writes(client, &line_rtu))
TEST_ROW_WITH(accesses_at_the_limits_of_every_table_are_right, start_lines, stop_lines,
              asked_edges(client))
TEST_ROW_WITH(a_refused_write_changes_nothing, start_lines, stop_lines,
              asked_refusals(client, &line_rtu))

TEST_WITH(the_server_id_is_reported, start_lines, stop_lines)
{
    uint8_t id[64];

    assert_int_equal(modbus_report_slave_id(client, sizeof id, id), 8);
    assert_memory_equal(id, "mbm\xFFtest", 8);
}

TEST_ROW_WITH(every_function_is_served_on_a_line, start_lines, stop_lines,
              asked_functions(modbus_get_socket(client), MBM_FRAMING_RTU, &line_rtu))
TEST_ROW_WITH(wrong_byte_counts_are_refused_in_time, start_lines, stop_lines,
              asked_lies(modbus_get_socket(client), MBM_FRAMING_RTU, &line_rtu))

TEST_WITH(ascii_serves_every_function_too, start_lines, stop_lines)
{
    asked_functions(ascii.line.theirs, MBM_FRAMING_ASCII, &ascii);
    asked_lies(ascii.line.theirs, MBM_FRAMING_ASCII, &ascii);
}

TEST_WITH(a_broadcast_is_carried_out_and_not_answered, start_lines, stop_lines)
{
    asked_frames(modbus_get_socket(client), MBM_FRAMING_RTU, 0,
                 (const uint8_t *)"\x06\0\x64\x33\x44", 5, NULL, 0);
    AWAIT(line_rtu.words[0] == 0x3344);
    assert_int_equal(modbus_write_register(client, SERVED_BASE, 1), 1);
}

TEST_WITH(foreign_frames_around_requests_are_ignored, start_lines, stop_lines)
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

TEST_WITH(damaged_and_cut_frames_are_not_answered, start_lines, stop_lines)
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

TEST_WITH(listen_only_mode_is_silent_until_a_restart, start_lines, stop_lines)
{
    int fd = modbus_get_socket(client);

    /* A wait follows each frame: if two requests come without silence between, only one counts. */
    asked_frames(fd, MBM_FRAMING_RTU, SERVED_UNIT, (const uint8_t *)"\x08\0\x04\0\0", 5, NULL, 0);
    AWAIT(line_rtu.diagnostics.listenOnly == 1);
    uint16_t messages = line_rtu.diagnostics.busMessages;
    asked_frames(fd, MBM_FRAMING_RTU, SERVED_UNIT, (const uint8_t *)"\x07", 1, NULL, 0);
    AWAIT(line_rtu.diagnostics.busMessages != messages);
    assert_int_equal(line_rtu.diagnostics.listenOnly, 1);
    asked_frames(fd, MBM_FRAMING_RTU, SERVED_UNIT, (const uint8_t *)"\x08\0\x01\0\0", 5, NULL, 0);
    AWAIT(line_rtu.diagnostics.listenOnly == 0);
    asked_frames(fd, MBM_FRAMING_RTU, SERVED_UNIT, (const uint8_t *)"\x07", 1,
                 (const uint8_t *)"\x07\x6D", 2);
}
