/* The gateway between libmodbus's TCP client and two devices on ptys: a libmodbus
 * server and an mbm server. */
#define _GNU_SOURCE
#include "asked.h"
#include "await.h"
#include "clock.h"
#include "program.h"
#include "server.h"
#include "tcp_server.h"
#include "test.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

/* The timeout is long enough for a device in a thread of a busy machine. */
enum { PEER_UNIT = 5, ABSENT = 6, NO_LINE = 200, DEAD_LINE = 40, TIMEOUT_MS = 3000, PLACES = 16 };

static program gateway;
static int port;
static modbus_t *client;
static served ours;

/* A libmodbus server at the near end of a pty, whose far end the gateway opens. */
static pty line;
static modbus_t *peer;
static modbus_mapping_t *mapping;
static pthread_t thread;
static int stop_peer[2];
static int peer_runs;
static int peer_is_plain; /* the peer does not know what modbus_receive does after a 0 */
static char name[64];     /* a symbolic link to the terminal of the peer's line */

static void *serve(void *argument)
{
    uint8_t request[MODBUS_RTU_MAX_ADU_LENGTH];

    for (;;) {
        struct pollfd waits[2] = {{line.ours, POLLIN, 0}, {stop_peer[0], POLLIN, 0}};
        int length;

        poll(waits, 2, -1);
        if (waits[1].revents)
            return NULL;
        /* After a frame for another unit libmodbus takes the next frame for its reply: see
         * server.c. */
        length = modbus_receive(peer, request);
        if (length == 0 && !peer_is_plain)
            modbus_receive(peer, request);
        if (length > 0)
            modbus_reply(peer, request, length, mapping);
    }
}

static void run_peer(void)
{
    assert_int_equal(pipe(stop_peer), 0);
    assert_int_equal(pthread_create(&thread, NULL, serve, NULL), 0);
    peer_runs = 1;
}

static void halt_peer(void)
{
    if (!peer_runs)
        return;
    assert_int_equal(write(stop_peer[1], "", 1), 1);
    pthread_join(thread, NULL);
    close(stop_peer[0]);
    close(stop_peer[1]);
    peer_runs = 0;
}

static void start(void)
{
    char paths[3][128], text[64];
    const char *arguments[] = {"gateway", "--timeout", "3s",     "tcp://:0", paths[0], "1-10",
                               paths[1],  "11-30",     paths[2], "40-41",    NULL};

    pty_open(&line);
    peer = modbus_new_rtu("/dev/null", 115200, 'N', 8, 1);
    mapping = modbus_mapping_new(SERVER_BITS, SERVER_BITS, SERVER_REGISTERS, SERVER_REGISTERS);
    assert_true(peer && mapping && !modbus_set_slave(peer, PEER_UNIT) &&
                !modbus_set_socket(peer, line.ours) &&
                !modbus_set_response_timeout(peer, 0, 20000));
    run_peer();
    for (unsigned i = 0; i < SERVER_REGISTERS; i++)
        mapping->tab_registers[i] = server_pattern(i);
    for (unsigned i = 0; i < SERVER_BITS; i++)
        mapping->tab_bits[i] = server_bit_pattern(i);
    served_prepare(&ours);
    served_on_line(&ours, MBM_FRAMING_RTU);

    snprintf(name, sizeof name, "/tmp/mbm-gateway-%d", (int)getpid());
    assert_int_equal(symlink(line.path, name), 0);
    snprintf(paths[0], sizeof paths[0], "rtu:%s?baud=115200&parity=none", name);
    snprintf(paths[1], sizeof paths[1], "rtu:%s?baud=115200&parity=none", ours.line.path);
    snprintf(paths[2], sizeof paths[2], "rtu:/dev/no-such-line?baud=9600");
    program_start(&gateway, "mbm", arguments);
    program_line(&gateway, text, sizeof text);
    assert_int_equal(sscanf(text, "ready %d", &port), 1);
    client = modbus_new_tcp("127.0.0.1", port);
    assert_true(client && !modbus_connect(client));
    modbus_set_response_timeout(client, PATIENCE_MS / 1000, 0);
}

static void stop(void)
{
    modbus_close(client);
    modbus_free(client);
    kill(gateway.pid, SIGTERM);
    assert_int_equal(program_end(&gateway), 0);
    halt_peer();
    modbus_free(peer);
    modbus_mapping_free(mapping);
    pty_close(&line);
    unlink(name);
    served_stop(&ours);
}

fixture each_test = {start, stop};

static void expect_exception(int code, uint8_t unit)
{
    uint16_t word;

    modbus_set_slave(client, unit);
    errno = 0;
    assert_int_equal(modbus_read_registers(client, 0, 1, &word), -1);
    assert_int_equal(errno, MODBUS_ENOBASE + code);
}

TEST(libmodbus_reads_and_writes_through_the_gateway)
{
    uint16_t words[125], values[] = {1, 0xFFFE, 0x1234};
    uint8_t cells[2000];

    modbus_set_slave(client, PEER_UNIT);
    assert_int_equal(modbus_read_registers(client, 3, 125, words), 125);
    assert_memory_equal(words, mapping->tab_registers + 3, sizeof words);
    assert_int_equal(modbus_read_bits(client, 1, 2000, cells), 2000);
    for (int i = 0; i < 2000; i++)
        assert_int_equal(cells[i], mapping->tab_bits[1 + i]);
    assert_int_equal(modbus_write_register(client, 7, 0xABCD), 1);
    assert_int_equal(mapping->tab_registers[7], 0xABCD);
    assert_int_equal(modbus_write_registers(client, 20, 3, values), 3);
    assert_memory_equal(mapping->tab_registers + 20, values, sizeof values);
    assert_int_equal(modbus_write_bit(client, 9, 1), 1);
    assert_int_equal(mapping->tab_bits[9], 1);
    assert_int_equal(modbus_mask_write_register(client, 7, 0x00F0, 0x000F), 1);
    assert_int_equal(mapping->tab_registers[7], 0x00CF);
    assert_int_equal(modbus_write_and_read_registers(client, 30, 3, values, 29, 4, words), 4);
    assert_memory_equal(words + 1, values, sizeof values);
}

TEST(exceptions_of_a_device_pass_through)
{
    uint16_t word;

    modbus_set_slave(client, PEER_UNIT);
    assert_int_equal(modbus_read_registers(client, SERVER_REGISTERS, 1, &word), -1);
    assert_int_equal(errno, EMBXILADD);
    modbus_set_slave(client, SERVED_UNIT);
    assert_int_equal(modbus_write_register(client, SERVED_REFUSED, 0xBEEF), -1);
    assert_int_equal(errno, EMBXILVAL);
}

TEST(every_function_passes_through)
{
    int fd = tcp_connectTo((uint16_t)port);

    asked_functions(fd, MBM_FRAMING_TCP, &ours);
    close(fd);
    fd = tcp_connectTo((uint16_t)port);
    asked_lies(fd, MBM_FRAMING_TCP, &ours);
    close(fd);
}

/* A busy machine can only make the times longer, so the shortest of some attempts counts. */
enum { ATTEMPTS = 5 };

TEST(a_request_to_an_absent_device_gets_0b_after_the_timeout)
{
    double took = TIMEOUT_MS;

    for (unsigned i = 0; i < ATTEMPTS && took > TIMEOUT_MS * 2e-3; i++) {
        double before = seconds();

        expect_exception(0x0B, ABSENT);
        took = seconds() - before;
    }
    assert_true(took > TIMEOUT_MS * 0.9e-3 && took < TIMEOUT_MS * 2e-3);
    modbus_set_slave(client, PEER_UNIT);
    libmodbus_reads_and_writes_through_the_gateway();
}

TEST(a_request_to_a_unit_without_a_line_gets_0a)
{
    double took = TIMEOUT_MS;

    for (unsigned i = 0; i < ATTEMPTS && took > TIMEOUT_MS * 0.9e-3; i++) {
        double before = seconds();

        expect_exception(0x0A, NO_LINE);
        expect_exception(0x0A, 31);
        expect_exception(0x0A, DEAD_LINE);
        took = seconds() - before;
    }
    /* Three requests took less than one timeout, so no device was waited for. */
    assert_true(took < TIMEOUT_MS * 0.9e-3);
}

TEST(requests_of_many_connections_wait_for_their_turn)
{
    enum { MANY = 12 };
    int fds[MANY];

    for (unsigned i = 0; i < MANY; i++)
        fds[i] = tcp_connectTo((uint16_t)port);
    for (unsigned round = 0; round < 5; round++) {
        for (unsigned i = 0; i < MANY; i++) {
            uint8_t request[] = {
                (uint8_t)round,     (uint8_t)i, 0, 0, 0, 6, i % 2 ? PEER_UNIT : SERVED_UNIT, 3, 0,
                (uint8_t)(160 + i), 0,          1};

            assert_int_equal(write(fds[i], request, sizeof request), sizeof request);
        }
        for (unsigned i = 0; i < MANY; i++) {
            uint8_t answer[600];
            uint16_t word = i % 2 ? mapping->tab_registers[160 + i] : ours.words[60 + i];
            const uint8_t expected[] = {(uint8_t)round,
                                        (uint8_t)i,
                                        0,
                                        0,
                                        0,
                                        5,
                                        i % 2 ? PEER_UNIT : SERVED_UNIT,
                                        3,
                                        2,
                                        (uint8_t)(word >> 8),
                                        (uint8_t)word};

            assert_int_equal(asked_bytes(fds[i], expected, 0, answer, sizeof expected),
                             sizeof expected);
            assert_memory_equal(answer, expected, sizeof expected);
        }
    }
    for (unsigned i = 0; i < MANY; i++)
        close(fds[i]);
}

TEST(a_line_that_waits_does_not_delay_another)
{
    static const uint8_t absent[] = {0, 1, 0, 0, 0, 6, ABSENT, 3, 0, 0, 0, 1};
    uint8_t answer[600];
    uint16_t word;
    int fd = tcp_connectTo((uint16_t)port);
    unsigned i, attempts;

    modbus_set_slave(client, SERVED_UNIT);
    for (i = attempts = 0; i < 5 && attempts < ATTEMPTS; attempts++) {
        struct pollfd pending = {fd, POLLIN, 0};

        assert_int_equal(write(fd, absent, sizeof absent), sizeof absent);
        for (i = 0; i < 5 && poll(&pending, 1, 0) == 0; i++)
            assert_int_equal(modbus_read_registers(client, SERVED_BASE, 1, &word), 1);
        i = poll(&pending, 1, 0) == 0 ? i : 0;
        assert_int_equal(asked_bytes(fd, absent, 0, answer, 9), 9);
        assert_int_equal(answer[8], 0x0B);
    }
    /* All were answered while the first line was still waiting for its device. */
    assert_int_equal(i, 5);
    close(fd);
}

TEST(a_connection_that_breaks_gives_up_its_request)
{
    for (unsigned i = 0; i < 40; i++) {
        static const uint8_t request[] = {0, 1, 0, 0, 0, 6, PEER_UNIT, 3, 0, 0, 0, 1};
        int fd = tcp_connectTo((uint16_t)port);

        assert_int_equal(write(fd, request, sizeof request), sizeof request);
        if (i % 2)
            (void)tcp_resetAtClose(fd);
        if (i % 3)
            usleep(1000);
        close(fd);
    }
    libmodbus_reads_and_writes_through_the_gateway();
}

TEST(connections_beyond_the_places_are_closed)
{
    int fds[40];

    for (unsigned i = 0; i < COUNT(fds); i++)
        fds[i] = tcp_connectTo((uint16_t)port);
    /* One of the places is the client's. */
    for (unsigned i = 0; i < COUNT(fds); i++)
        assert_int_equal(asked_is_served(fds[i], NO_LINE, 0x0A), i < PLACES - 1);
    libmodbus_reads_and_writes_through_the_gateway();
    for (unsigned i = 0; i < COUNT(fds); i++)
        close(fds[i]);
}

static void lose_line(void)
{
    halt_peer();
    /* Another program may get a terminal of the same name. */
    assert_int_equal(unlink(name), 0);
    pty_close(&line);
}

static void have_line(void)
{
    pty_open(&line);
    assert_int_equal(symlink(line.path, name), 0);
    modbus_set_socket(peer, line.ours);
    run_peer();
}

TEST(a_request_to_a_lost_line_gets_0a_until_the_line_is_back)
{
    uint16_t word;

    lose_line();
    expect_exception(0x0A, PEER_UNIT);
    expect_exception(0x0A, PEER_UNIT);
    modbus_set_slave(client, SERVED_UNIT);
    assert_int_equal(modbus_read_registers(client, SERVED_BASE, 1, &word), 1);
    have_line();
    double start = seconds();
    modbus_set_slave(client, PEER_UNIT);
    while (modbus_read_registers(client, 0, 1, &word) != 1)
        assert_true(seconds() - start < PATIENCE_MS * 1e-3);
}

TEST(a_line_that_was_lost_between_requests_fails_no_request)
{
    uint16_t word;

    /* The gateway has opened the line when it answers. */
    modbus_set_slave(client, PEER_UNIT);
    assert_int_equal(modbus_read_registers(client, 0, 1, &word), 1);
    lose_line();
    have_line();
    assert_int_equal(modbus_read_registers(client, 0, 1, &word), 1);
}

/* After a request to another unit, libmodbus's server takes the next frame for the response of that
 * unit. docs/gateway.md says so. */
TEST(a_libmodbus_server_ignores_the_request_after_one_to_an_absent_unit)
{
    uint16_t word;

    halt_peer();
    peer_is_plain = 1;
    modbus_set_response_timeout(peer, PATIENCE_MS / 1000, 0);
    run_peer();
    expect_exception(0x0B, ABSENT);
    expect_exception(0x0B, PEER_UNIT);
    modbus_set_slave(client, PEER_UNIT);
    assert_int_equal(modbus_read_registers(client, 0, 1, &word), 1);
    /* A server that calls modbus_receive again at once, with a timeout below the gateway's, misses
     * no request. */
    halt_peer();
    peer_is_plain = 0;
    modbus_set_response_timeout(peer, 0, 20000);
    run_peer();
    expect_exception(0x0B, ABSENT);
    libmodbus_reads_and_writes_through_the_gateway();
}

/* A gateway with bad arguments prints no `ready` line and ends with exit code 2. */
TEST(bad_arguments_end_the_program)
{
    static const char *const bad[][8] = {
        {"gateway"},
        {"gateway", "tcp://:0"},
        {"gateway", "tcp://:0", "rtu:/dev/null"},
        {"gateway", "0", "rtu:/dev/null", "1-9"},
        {"gateway", "tcp://:65536", "rtu:/dev/null", "1-9"},
        {"gateway", "udp://:0", "rtu:/dev/null", "1-9"},
        {"gateway", "rtu:/dev/null", "rtu:/dev/null", "1-9"},
        {"gateway", "tcp://:0", "rtu:/dev/null", "9-1"},
        {"gateway", "tcp://:0", "rtu:/dev/null", "1-9,"},
        {"gateway", "tcp://:0", "rtu:/dev/null", ""},
        {"gateway", "tcp://:0", "rtu:/dev/null", "1-9,and more"},
        {"gateway", "tcp://:0", "rtu:/dev/null", "ascii"},
        {"gateway", "tcp://:0", "rtu:/dev/null", "1-9,9-10"},
        {"gateway", "tcp://:0", "rtu:/dev/null", "1-256"},
        {"gateway", "tcp://:0", "rtu:/dev/null", "1-"},
        {"gateway", "tcp://:0", "rtu:/dev/null", "-1"},
        {"gateway", "tcp://:0", "rtu:/dev/null", "1-9="},
        {"gateway", "tcp://:0", "rtu:/dev/null", "1-9x5"},
        {"gateway", "tcp://:0", "rtu:/dev/null", "1-9=248"}, /* the last one would be 256 */
        {"gateway", "tcp://:0", "rtu:/dev/null", "1-9", "rtu:/dev/zero"},
        {"gateway", "tcp://:0", "rtu:/dev/null", "1-9", "rtu:/dev/zero", "9-12"},
        {"gateway", "tcp://:0", "rtu:/dev/null?baud=1", "1-9"},
        {"gateway", "tcp://:0", "rtu:/dev/null?parity=X", "1-9"},
        {"gateway", "tcp://:0", "rtu:/dev/null?stop=3", "1-9"},
        {"gateway", "tcp://:0", "rtu:?baud=19200", "1-9"},
        {"gateway", "tcp://:0", "tcp://:502", "1-9"},
        {"gateway", "tcp://:0", "tcp://127.0.0.1:50x", "1-9"},
        {"gateway", "tcp://:0", "tcp://127.0.0.1:502:503", "1-9"},
        {"gateway", "tcp://:0", "rtu+tcp://127.0.0.1", "1-9"},
        {"gateway", "tcp://:0", "udp://127.0.0.1", "1-9"},
        {"gateway", "tcp://:0", "pty:", "1-9"},
        {"gateway", "--timeout", "300", "tcp://:0", "rtu:/dev/null", "1-9"},
        {"gateway", "--timeout", "0ms", "tcp://:0", "rtu:/dev/null", "1-9"},
        {"gateway", "--requests", "0", "tcp://:0", "rtu:/dev/null", "1-9"},
        {"gateway", "--requests", "129", "tcp://:0", "rtu:/dev/null", "1-9"},
        {"gateway", "--queue-time", "65536ms", "tcp://:0", "rtu:/dev/null", "1-9"},
        {"gateway", "--connections", "0", "tcp://:0", "rtu:/dev/null", "1-9"},
        {"gateway", "--connections", "256", "tcp://:0", "rtu:/dev/null", "1-9"},
        {"gateway", "--in-flight", "17", "tcp://:0", "rtu:/dev/null", "1-9"},
    };
    char text[64];

    for (unsigned i = 0; i < COUNT(bad); i++) {
        program one;

        program_start(&one, "mbm", bad[i]);
        assert_int_equal(program_rest(&one, text, sizeof text), 0);
        assert_int_equal(program_end(&one), 2);
    }
}
