/* The gateway with lines over TCP: a libmodbus server, and devices that the test plays,
 * whose connections come and go. And its places for clients, and too few descriptors. */
#define _GNU_SOURCE
#include "asked.h"
#include "await.h"
#include "crc.h"
#include "program.h"
#include "server.h"
#include "tcp_server.h"
#include "test.h"
#include "skip.h"
#include "pty.h"

#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

enum { UNIT = 5, NO_LINE = 200, MANY = 40 };

/* Longer than a busy machine takes to run the other end of a connection. */
#define TIMEOUT "8s"

static program gateway;
static uint16_t port;
static int listener, client = -1;
static uint16_t device_port;

/* Starts a gateway with one line at a TCP port: `host` is tcp://HOST or rtu+tcp://HOST. */
static void start_without_client(const char *host, uint16_t to, const char *const *options)
{
    char text[64], line[64];
    char units[32];
    const char *arguments[10] = {"gateway", "--timeout", TIMEOUT, "tcp://:0", line, units};
    unsigned number, count = 6;

    snprintf(line, sizeof line, "%s:%u", host, to);
    snprintf(units, sizeof units, "1-30,100=%d", UNIT);
    while (options && *options)
        arguments[count++] = *options++;
    program_start(&gateway, "mbm", arguments);
    program_line(&gateway, text, sizeof text);
    assert_int_equal(sscanf(text, "ready %u", &number), 1);
    port = (uint16_t)number;
}

static void start(const char *host, uint16_t to, const char *const *options)
{
    start_without_client(host, to, options);
    client = tcp_connectTo(port);
}

static void stop(void)
{
    if (client >= 0)
        close(client);
    client = -1;
    kill(gateway.pid, SIGTERM);
    assert_int_equal(program_end(&gateway), 0);
}

static void begin(void)
{
    alarm(6 * PATIENCE_MS / 1000);
}

static void end(void)
{
    alarm(0);
}

fixture each_test = {begin, end};

/* The next connection of the gateway to the device. */
static int accept_gateway(void)
{
    struct pollfd waiting = {listener, POLLIN, 0};

    assert_int_equal(poll(&waiting, 1, PATIENCE_MS), 1);
    int fd = accept(listener, NULL, NULL);
    assert_true(fd >= 0);
    return fd;
}

/* The client asks for one register at an address; the address is the transaction identifier too. */
static void ask(uint8_t address)
{
    const uint8_t request[] = {0, address, 0, 0, 0, 6, UNIT, 3, 0, address, 0, 1};

    assert_int_equal(send(client, request, sizeof request, MSG_NOSIGNAL), sizeof request);
}

/* The device takes a request for one register, and returns the transaction identifier. */
static uint16_t take(int device, uint8_t address)
{
    const uint8_t wanted[] = {0, 0, 0, 6, UNIT, 3, 0, address, 0, 1};
    uint8_t request[12];

    await_bytes(device, request, sizeof request);
    assert_memory_equal(request + 2, wanted, sizeof wanted);
    return (uint16_t)(request[0] << 8 | request[1]);
}

static void reply(int device, uint16_t transaction, uint8_t value)
{
    const uint8_t response[] = {
        (uint8_t)(transaction >> 8), (uint8_t)transaction, 0, 0, 0, 5, UNIT, 3, 2, 0, value};

    assert_int_equal(write(device, response, sizeof response), sizeof response);
}

static void expect_register(uint8_t address, uint8_t value)
{
    const uint8_t wanted[] = {0, address, 0, 0, 0, 5, UNIT, 3, 2, 0, value};
    uint8_t response[11];

    await_bytes(client, response, 9);
    assert_memory_equal(response, wanted, 9);
    await_bytes(client, response + 9, 2);
    assert_memory_equal(response, wanted, sizeof wanted);
}

static void expect_exception(uint8_t address, uint8_t exception)
{
    const uint8_t wanted[] = {0, address, 0, 0, 0, 3, UNIT, 0x83, exception};
    uint8_t response[9];

    await_bytes(client, response, sizeof response);
    assert_memory_equal(response, wanted, sizeof wanted);
}

TEST(libmodbus_reaches_a_libmodbus_server_over_tcp)
{
    uint16_t words[125], values[] = {1, 0xFFFE, 0x1234};
    tcp_server far;

    memset(&far, 0, sizeof far);
    tcp_server_start(&far);
    start("tcp://127.0.0.1", far.port, NULL);
    modbus_t *peer = modbus_new_tcp("127.0.0.1", port);
    assert_non_null(peer);
    assert_int_equal(modbus_connect(peer), 0);
    modbus_set_response_timeout(peer, PATIENCE_MS / 1000, 0);
    for (int i = 1; i <= 100; i += 99) {
        modbus_set_slave(peer, i);
        assert_int_equal(modbus_read_registers(peer, 3, 125, words), 125);
        assert_memory_equal(words, far.mapping->tab_registers + 3, sizeof words);
        assert_int_equal(modbus_write_registers(peer, 20, 3, values), 3);
        assert_memory_equal(far.mapping->tab_registers + 20, values, sizeof values);
    }
    assert_int_equal(modbus_read_registers(peer, SERVER_REGISTERS, 1, words), -1);
    assert_int_equal(errno, EMBXILADD);
    modbus_close(peer);
    modbus_free(peer);
    stop();
    tcp_server_stop(&far);
}

TEST(a_line_of_rtu_over_tcp_has_frames_of_rtu)
{
    uint8_t request[] = {UNIT, 3, 0, 7, 0, 1, 0, 0}, response[] = {UNIT, 3, 2, 0, 9, 0, 0};
    uint8_t found[sizeof request];

    listener = tcp_listenOnFree(&device_port);
    start("rtu+tcp://127.0.0.1", device_port, NULL);
    int device = accept_gateway();
    ask(7);
    await_bytes(device, found, sizeof found);
    seal(request, sizeof request - 2);
    assert_memory_equal(found, request, sizeof request);
    seal(response, sizeof response - 2);
    assert_int_equal(write(device, response, sizeof response), sizeof response);
    expect_register(7, 9);
    close(device);
    stop();
    close(listener);
}

TEST(a_device_that_closes_an_idle_connection_costs_no_request)
{
    int device;

    listener = tcp_listenOnFree(&device_port);
    start("tcp://127.0.0.1", device_port, NULL);
    for (uint8_t round = 1; round < 6; round++) {
        device = accept_gateway();
        ask(round);
        reply(device, take(device, round), round);
        expect_register(round, round);
        close(device);
        /* The gateway has seen it in every other round. */
        if (round % 2)
            AWAIT(program_sleeps(&gateway));
        ask((uint8_t)(round + 100));
        device = accept_gateway();
        reply(device, take(device, (uint8_t)(round + 100)), round);
        expect_register((uint8_t)(round + 100), round);
        close(device);
    }
    stop();
    close(listener);
}

TEST(a_request_whose_connection_is_lost_gets_0a_and_is_not_sent_again)
{
    listener = tcp_listenOnFree(&device_port);
    start("tcp://127.0.0.1", device_port, NULL);
    int device = accept_gateway();
    ask(1);
    (void)take(device, 1);
    close(device);
    expect_exception(1, 0x0A);
    /* The first request on the next connection is the next one. */
    ask(2);
    device = accept_gateway();
    reply(device, take(device, 2), 22);
    expect_register(2, 22);
    close(device);
    stop();
    close(listener);
}

TEST(requests_to_a_device_that_does_not_listen_get_0a_until_it_does)
{
    int device, reserved = tcp_reserve(&device_port);

    start("tcp://127.0.0.1", device_port, NULL);
    ask(1);
    expect_exception(1, 0x0A);
    ask(2);
    expect_exception(2, 0x0A);
    assert_int_equal(listen(reserved, 4), 0);
    listener = reserved;
    /* The link connects by itself, also without a request. */
    device = accept_gateway();
    ask(3);
    reply(device, take(device, 3), 33);
    expect_register(3, 33);
    close(device);
    stop();
    close(listener);
}

TEST(requests_to_a_host_that_is_not_found_get_0a)
{
    start("tcp://no-such-host.invalid", 502, NULL);
    for (uint8_t i = 0; i < 3; i++) {
        ask(i);
        expect_exception(i, 0x0A);
    }
    AWAIT(program_sleeps(&gateway));
    stop();
}

TEST(a_line_of_tcp_has_as_many_requests_at_once_as_the_option_says)
{
    static const char *const options[] = {"--in-flight", "4", NULL};
    uint16_t transactions[4];
    uint8_t byte;

    listener = tcp_listenOnFree(&device_port);
    start("tcp://127.0.0.1", device_port, options);
    int device = accept_gateway();
    for (int i = 0; i < 6; i++)
        ask((uint8_t)(10 + i));
    for (int i = 0; i < 4; i++)
        transactions[i] = take(device, (uint8_t)(10 + i));
    assert_int_equal(recv(device, &byte, 1, MSG_DONTWAIT), -1);
    /* The device replies to the last one first. */
    for (int i = 3; i >= 0; i--) {
        reply(device, transactions[i], (uint8_t)(50 + i));
        expect_register((uint8_t)(10 + i), (uint8_t)(50 + i));
    }
    for (int i = 4; i < 6; i++)
        reply(device, take(device, (uint8_t)(10 + i)), (uint8_t)i);
    for (int i = 4; i < 6; i++)
        expect_register((uint8_t)(10 + i), (uint8_t)i);
    close(device);
    stop();
    close(listener);
}

/* Connects many clients. The first `places` are served, and the others are closed. */
static void expect_places(const char *const *options, unsigned places)
{
    int fds[MANY];

    listener = tcp_listenOnFree(&device_port);
    start_without_client("tcp://127.0.0.1", device_port, options);
    for (unsigned i = 0; i < MANY; i++)
        fds[i] = tcp_connectTo(port);
    for (unsigned i = 0; i < MANY; i++)
        assert_int_equal(asked_is_served(fds[i], NO_LINE, 0x0A), i < places);
    for (unsigned i = 0; i < MANY; i++)
        close(fds[i]);
    stop();
    close(listener);
}

TEST(forty_clients_are_served_if_there_are_places_for_them)
{
    static const char *const options[] = {"-c", "40", NULL};

    expect_places(options, MANY);
}

TEST(of_forty_clients_those_without_a_place_are_closed_at_once)
{
    static const char *const one[] = {"-c", "1", NULL}, *const three[] = {"-c", "3", NULL};

    expect_places(NULL, 16);
    expect_places(three, 3);
    expect_places(one, 1);
}

/* --- without enough descriptors or places: the gateway serves the connections that it has, sleeps,
 * accepts waiting connections when there is a free place again, and ends on SIGTERM --- */

/* The gateway needs 6 descriptors itself: 3 for the terminal, 2 to listen and 1 for the line. */
enum { OWN = 6, ABSENT = 6, PLACES = 16, TIMEOUT_MS = 3000 };

static pty line;
static char name[64];
static int fds[MANY];

static void begin_shortage(void)
{
    for (unsigned i = 0; i < MANY; i++)
        fds[i] = -1;
    alarm(6 * PATIENCE_MS / 1000);
    pty_open(&line);
    snprintf(name, sizeof name, "/tmp/mbm-shortage-%d", (int)getpid());
    unlink(name);
    assert_int_equal(symlink(line.path, name), 0);
}

static void end_shortage(void)
{
    for (unsigned i = 0; i < MANY; i++)
        if (fds[i] >= 0)
            close(fds[i]);
    unlink(name);
    pty_close(&line);
    alarm(0);
}

#define SHORTAGE_TEST(name) TEST_WITH(name, begin_shortage, end_shortage)

static void start_limited(unsigned descriptors, const char *idle)
{
    char text[64], path[128];
    const char *arguments[] = {"gateway",  "--idle", idle,   "--timeout", "3s",
                               "tcp://:0", path,     "1-10", NULL};
    int number;

    snprintf(path, sizeof path, "rtu:%s?baud=115200&parity=none", name);
    program_start_limited(&gateway, "mbm", arguments, descriptors);
    program_line(&gateway, text, sizeof text);
    assert_int_equal(sscanf(text, "ready %d", &number), 1);
    port = (uint16_t)number;
}

static void connect_to(unsigned first, unsigned last)
{
    for (; first < last; first++)
        fds[first] = tcp_connectTo(port);
}

static int is_served(int fd)
{
    return asked_is_served(fd, NO_LINE, 0x0A);
}

static void close_from_to(unsigned first, unsigned last)
{
    for (; first < last; first++) {
        close(fds[first]);
        fds[first] = -1;
    }
}

SHORTAGE_TEST(with_few_descriptors_the_gateway_serves_sleeps_and_ends)
{
    static const unsigned limits[] = {OWN + 1, OWN + 3, OWN + 15, OWN + 16, OWN + 17};

    SKIP_WITHOUT_LIMITS();
    for (unsigned i = 0; i < COUNT(limits); i++) {
        const unsigned most = limits[i] - OWN < PLACES ? limits[i] - OWN : PLACES;

        start_limited(limits[i], "60s");
        connect_to(0, most);
        for (unsigned k = 0; k < most; k++)
            assert_int_equal(is_served(fds[k]), 1);
        AWAIT(program_sleeps(&gateway));
        stop();
        close_from_to(0, most);
    }
}

SHORTAGE_TEST(connections_beyond_the_descriptors_are_closed_at_once)
{
    enum { SERVED = 4, ALL = MANY };
    unsigned i;

    SKIP_WITHOUT_LIMITS();
    start_limited(OWN + SERVED, "60s");
    connect_to(0, ALL);
    for (i = 0; i < SERVED; i++)
        assert_int_equal(is_served(fds[i]), 1);
    AWAIT(program_sleeps(&gateway));
    for (i = 0; i < SERVED; i++)
        assert_int_equal(is_served(fds[i]), 1);
    for (; i < ALL; i++)
        assert_int_equal(is_served(fds[i]), 0);
    close_from_to(0, ALL);
    AWAIT((fds[0] = tcp_connectTo(port), is_served(fds[0])) || (close(fds[0]), 0));
    stop();
}

SHORTAGE_TEST(a_new_client_gets_the_place_of_an_idle_one)
{
    char byte;

    start_limited(0, "1s");
    connect_to(0, PLACES);
    /* The connections are silent for at least a second. */
    AWAIT((fds[PLACES] = tcp_connectTo(port), is_served(fds[PLACES])) || (close(fds[PLACES]), 0));
    /* The first connection has been idle for longest. */
    assert_int_equal(recv(fds[0], &byte, 1, 0), 0);
    assert_int_equal(is_served(fds[PLACES]), 1);
    stop();
}

SHORTAGE_TEST(a_new_client_gets_the_descriptor_of_an_idle_one)
{
    enum { SERVED = 4 };

    SKIP_WITHOUT_LIMITS();
    start_limited(OWN + SERVED, "1s");
    connect_to(0, SERVED);
    for (unsigned i = SERVED; i < SERVED + 2; i++)
        AWAIT((fds[i] = tcp_connectTo(port), is_served(fds[i])) || (close(fds[i]), 0));
    stop();
}

SHORTAGE_TEST(an_idle_time_of_0_closes_none)
{
    start_limited(0, "0s");
    connect_to(0, PLACES + 1);
    assert_int_equal(is_served(fds[PLACES]), 0);
    for (unsigned i = 0; i < PLACES; i++)
        assert_int_equal(is_served(fds[i]), 1);
    stop();
}

SHORTAGE_TEST(a_connection_that_waits_for_its_device_is_not_idle)
{
    static const uint8_t request[] = {0, 1, 0, 0, 0, 6, ABSENT, 3, 0, 0, 0, 1};
    uint8_t answer[9];

    start_limited(0, "1s");
    connect_to(0, 1);
    assert_int_equal(write(fds[0], request, sizeof request), sizeof request);
    /* The request is on the line before the other clients connect. */
    assert_int_equal(read(line.ours, answer, 1), 1);
    connect_to(1, PLACES);
    AWAIT((fds[PLACES] = tcp_connectTo(port), is_served(fds[PLACES])) || (close(fds[PLACES]), 0));
    assert_int_equal(recv(fds[0], answer, sizeof answer, MSG_WAITALL), sizeof answer);
    assert_int_equal(answer[8], 0x0B);
    stop();
}

SHORTAGE_TEST(a_lost_line_keeps_its_descriptor)
{
    enum { SERVED = 4 };
    static const uint8_t request[] = {0, 1, 0, 0, 0, 6, ABSENT, 3, 0, 0, 0, 1};
    struct pollfd input;

    SKIP_WITHOUT_LIMITS();
    start_limited(OWN + SERVED, "60s");
    connect_to(0, SERVED + 2);
    for (unsigned i = 0; i < SERVED; i++)
        assert_int_equal(is_served(fds[i]), 1);
    /* Another program may get a terminal of the same name. */
    assert_int_equal(unlink(name), 0);
    pty_close(&line);
    assert_int_equal(asked_is_served(fds[0], ABSENT, 0x0A), 1);
    AWAIT(program_sleeps(&gateway));
    pty_open(&line);
    assert_int_equal(symlink(line.path, name), 0);
    /* The gateway opens the line again when a request needs it, at most once a second. */
    input = (struct pollfd){line.ours, POLLIN, 0};
    AWAIT((send(fds[0], request, sizeof request, MSG_NOSIGNAL), poll(&input, 1, 100) == 1));
    stop();
}
