/* Our server behind a socket: TCP and RTU over TCP, several connections, and
 * clients that do not behave. */
#define _GNU_SOURCE
#include "asked.h"
#include "crc.h"
#include "tcp_server.h"
#include "test.h"

#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static served tcp, rtu;
static modbus_t *client;

static int start(void **state)
{
    (void)state;
    served_prepare(&tcp);
    served_on_tcp(&tcp, MBM_FRAMING_TCP);
    served_prepare(&rtu);
    served_on_tcp(&rtu, MBM_FRAMING_RTU_OVER_TCP);
    client = modbus_new_tcp("127.0.0.1", tcp.port);
    if (!client || modbus_set_slave(client, SERVED_UNIT) || modbus_connect(client))
        return -1;
    modbus_set_response_timeout(client, 2, 0);
    return 0;
}

static int stop(void **state)
{
    (void)state;
    modbus_close(client);
    modbus_free(client);
    served_stop(&tcp);
    served_stop(&rtu);
    return 0;
}

static void libmodbus_finds_every_table(void **state)
{
    (void)state;
    asked_reads(client);
    asked_writes(client, &tcp);
    asked_edges(client);
    asked_refusals(client, &tcp);
}

static void libmodbus_without_a_unit_is_answered(void **state)
{
    uint16_t word;

    (void)state;
    modbus_set_slave(client, MODBUS_TCP_SLAVE);
    assert_int_equal(modbus_read_registers(client, SERVED_BASE, 1, &word), 1);
    modbus_set_slave(client, SERVED_UNIT);
}

static void every_function_is_served(void **state)
{
    int fd = tcp_connect((uint16_t)tcp.port), other = tcp_connect((uint16_t)rtu.port);

    (void)state;
    asked_functions(fd, MBM_FRAMING_TCP, &tcp);
    asked_lies(fd, MBM_FRAMING_TCP, &tcp);
    asked_functions(other, MBM_FRAMING_RTU_OVER_TCP, &rtu);
    asked_lies(other, MBM_FRAMING_RTU_OVER_TCP, &rtu);
    close(fd);
    close(other);
}

static void requests_in_one_segment_are_answered_in_turn(void **state)
{
    static const uint8_t one[] = {0, 1, 0, 0, 0, 6, SERVED_UNIT, 4, 0, SERVED_BASE, 0, 1};
    uint8_t bytes[20 * sizeof one], answer[600];
    int fd = tcp_connect((uint16_t)tcp.port);
    unsigned i;

    (void)state;
    for (i = 0; i < 20; i++) {
        memcpy(bytes + i * sizeof one, one, sizeof one);
        bytes[i * sizeof one + 1] = (uint8_t)i;
    }
    assert_int_equal(asked_bytes(fd, bytes, sizeof bytes, answer, 2000), 20 * 11);
    for (i = 0; i < 20; i++)
        assert_int_equal(answer[i * 11 + 1], i);
    close(fd);
}

/* The others are served while one sends a byte now and then and one nothing. */
static void slow_and_half_open_connections_stall_nobody(void **state)
{
    static const uint8_t one[] = {0, 7, 0, 0, 0, 6, SERVED_UNIT, 4, 0, SERVED_BASE, 0, 1};
    int slow = tcp_connect((uint16_t)tcp.port), silent = tcp_connect((uint16_t)tcp.port);
    uint8_t answer[600];
    uint16_t word;
    unsigned i, k;

    (void)state;
    assert_int_equal(write(silent, one, 5), 5);
    for (i = 0; i < sizeof one - 1; i++) {
        assert_int_equal(asked_bytes(slow, &one[i], 1, answer, 0), 0);
        for (k = 0; k < 20; k++)
            assert_int_equal(modbus_read_registers(client, SERVED_BASE, 1, &word), 1);
    }
    usleep(1100000);
    assert_int_equal(asked_bytes(slow, &one[i], 1, answer, 2000), 11);
    close(slow);
    close(silent);
}

/* Until its socket takes no more; then all that was taken is answered, in turn. */
static void a_client_that_reads_nothing_stalls_nobody(void **state)
{
    static uint8_t answers[300];
    uint8_t one[] = {0, 0, 0, 0, 0, 6, SERVED_UNIT, 4, 0, SERVED_BASE, 0, 125};
    int fd = tcp_connect((uint16_t)tcp.port);
    size_t sent = 0, got, i;
    uint16_t word;

    (void)state;
    for (;;) {
        struct pollfd writable = {fd, POLLOUT, 0};

        if (poll(&writable, 1, 200) <= 0)
            break;
        one[0] = (uint8_t)(sent / sizeof one >> 8);
        one[1] = (uint8_t)(sent / sizeof one);
        i = sent % sizeof one;
        {
            ssize_t count = send(fd, one + i, sizeof one - i, MSG_DONTWAIT);

            assert_true(count > 0);
            sent += (size_t)count;
        }
    }
    assert_true(sent > 1000 * sizeof one);
    for (i = 0; i < 20; i++)
        assert_int_equal(modbus_read_registers(client, SERVED_BASE, 1, &word), 1);
    for (i = 0; i < sent / sizeof one; i++) {
        for (got = 0; got < 259;) {
            ssize_t count = read(fd, answers + got, 259 - got);

            assert_true(count > 0);
            got += (size_t)count;
        }
        assert_int_equal(answers[0] << 8 | answers[1], i & 0xFFFF);
        assert_int_equal(answers[8], 250);
    }
    close(fd);
}

static void connections_beyond_the_storage_are_closed_and_the_others_served(void **state)
{
    int fds[SERVED_CONNECTIONS + 8];
    uint8_t byte;
    uint16_t word;
    unsigned i, refused = 0;

    (void)state;
    usleep(50000);
    for (i = 0; i < COUNT(fds); i++) {
        fds[i] = tcp_connect((uint16_t)tcp.port);
        assert_int_equal(modbus_read_registers(client, SERVED_BASE, 1, &word), 1);
    }
    usleep(50000);
    for (i = 0; i < COUNT(fds); i++)
        refused += recv(fds[i], &byte, 1, MSG_DONTWAIT) == 0;
    /* One of the places is the client's. */
    assert_int_equal(refused, COUNT(fds) - (SERVED_CONNECTIONS - 1));
    for (i = 0; i < COUNT(fds); i++)
        close(fds[i]);
    usleep(50000);
    i = (unsigned)tcp_connect((uint16_t)tcp.port);
    asked_frames((int)i, MBM_FRAMING_TCP, SERVED_UNIT, (const uint8_t *)"\x07", 1,
                 (const uint8_t *)"\x07\x6D", 2);
    close((int)i);
}

static void a_stream_that_is_no_modbus_is_closed(void **state)
{
    uint8_t byte;
    int fd = tcp_connect((uint16_t)tcp.port);
    struct pollfd readable = {fd, POLLIN, 0};

    (void)state;
    assert_int_equal(write(fd, "GET / HTTP/1.0\r\n\r\n", 18), 18);
    assert_int_equal(poll(&readable, 1, 2000), 1);
    assert_true(read(fd, &byte, 1) <= 0);
    close(fd);
}

static void a_connection_that_breaks_leaves_its_place(void **state)
{
    const struct linger hard = {1, 0};
    unsigned i;

    (void)state;
    for (i = 0; i < 50; i++) {
        int fd = tcp_connect((uint16_t)tcp.port);

        assert_int_equal(write(fd, "\0\1\0\0\0\6", i % 7), i % 7);
        if (i % 2)
            setsockopt(fd, SOL_SOCKET, SO_LINGER, &hard, sizeof hard);
        close(fd);
        usleep(2000);
    }
    libmodbus_without_a_unit_is_answered(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(libmodbus_finds_every_table),
        cmocka_unit_test(libmodbus_without_a_unit_is_answered),
        cmocka_unit_test(every_function_is_served),
        cmocka_unit_test(requests_in_one_segment_are_answered_in_turn),
        cmocka_unit_test(slow_and_half_open_connections_stall_nobody),
        cmocka_unit_test(a_client_that_reads_nothing_stalls_nobody),
        cmocka_unit_test(connections_beyond_the_storage_are_closed_and_the_others_served),
        cmocka_unit_test(a_stream_that_is_no_modbus_is_closed),
        cmocka_unit_test(a_connection_that_breaks_leaves_its_place),
    };

    return cmocka_run_group_tests(tests, start, stop);
}
