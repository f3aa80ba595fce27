/* The examples that use a network, on simulated boards. The network libraries of
 * firmware-tests/avr/libraries have a UART as their connection. This test carries its bytes
 * to the sockets of a real libmodbus. */
#define _GNU_SOURCE
#include "sketch.h"
#include "tcp_server.h"
#include "test.h"

#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <sys/socket.h>
#include <unistd.h>

enum { HEADER = 6, PATIENCE_MS = 60000 };

/* Reads exactly `length` bytes of a connection, however long the host needs. */
static void take(int fd, uint8_t *bytes, size_t length)
{
    while (length > 0) {
        struct pollfd wait = {fd, POLLIN, 0};
        ssize_t count;

        assert_int_equal(poll(&wait, 1, PATIENCE_MS), 1);
        count = recv(fd, bytes, length, 0);
        assert_true(count > 0);
        bytes += count;
        length -= (size_t)count;
    }
}

/* Sends the requests of a board to a server. Simulated time stands still until the server
 * has replied to each. */
static void to_server(wire *w, const uint8_t *frames, size_t length)
{
    const int *fd = w->context;
    uint8_t reply[FRAME];

    while (length >= HEADER) {
        size_t request = HEADER + ((size_t)frames[4] << 8 | frames[5]), bytes;

        assert_true(request <= length);
        assert_int_equal(send(*fd, frames, request, MSG_NOSIGNAL), request);
        take(*fd, reply, HEADER);
        bytes = (size_t)reply[4] << 8 | reply[5];
        assert_true(HEADER + bytes <= sizeof reply);
        take(*fd, reply + HEADER, bytes);
        wire_play(w, MS, reply, HEADER + bytes);
        frames += request;
        length -= request;
    }
    assert_int_equal(length, 0);
}

TEST(the_tcp_client_reads_and_writes_a_device)
{
    board *b = kind_start(&uno, "TcpClient");
    tcp_server s;
    wire *network;
    int fd;

    tcp_server_start(&s);
    s.mapping->tab_registers[10] = 300;
    s.mapping->tab_registers[11] = 33;
    fd = tcp_connectTo(s.port);
    network = board_uart(b, '0', to_server, &fd);
    assert_true(board_run(b, 350 * MS));
    assert_int_equal(s.mapping->tab_registers[20], 333);
    assert_true(is_high(b, uno.led));
    s.mapping->tab_registers[11] = 34;
    assert_true(board_run(b, 200 * MS));
    assert_int_equal(s.mapping->tab_registers[20], 334);
    assert_in_range(network->frames, 8, 12); /* a read and a write every 100 ms */
    /* A device that is silent for longer than its time. */
    network->device = NULL;
    assert_true(board_run(b, 1300 * MS));
    assert_false(is_high(b, uno.led));
    close(fd);
    tcp_server_stop(&s);
    board_free(b);
}

/* A libmodbus client in a thread. */
typedef struct task {
    int (*work)(modbus_t *peer);
    int result, over;
    uint16_t port;
    pthread_t thread;
} task;

static void *run(void *argument)
{
    task *t = argument;
    modbus_t *peer = modbus_new_tcp("127.0.0.1", t->port);

    modbus_set_response_timeout(peer, PATIENCE_MS / 1000, 0);
    t->result = modbus_connect(peer) == 0 ? t->work(peer) : -3;
    modbus_close(peer);
    modbus_free(peer);
    __atomic_store_n(&t->over, 1, __ATOMIC_SEQ_CST);
    return NULL;
}

/* Sends the responses of a board to the client. */
static void to_client(wire *w, const uint8_t *frame, size_t length)
{
    const int *fd = w->context;

    assert_int_equal(send(*fd, frame, length, MSG_NOSIGNAL), length);
}

/* Returns the result of a client's work. The board runs until the work is done. */
static int gets(board *b, wire *network, int (*work)(modbus_t *peer))
{
    task t = {.work = work, .result = -2};
    int listener = tcp_listenOnFree(&t.port), fd;

    assert_int_equal(pthread_create(&t.thread, NULL, run, &t), 0);
    fd = accept(listener, NULL, NULL);
    network->context = &fd;
    while (!__atomic_load_n(&t.over, __ATOMIC_SEQ_CST)) {
        struct pollfd wait = {fd, POLLIN, 0};
        uint8_t request[FRAME];
        ssize_t count;

        if (poll(&wait, 1, 1) == 1 && (count = recv(fd, request, sizeof request, 0)) > 0)
            wire_play(network, 0, request, (size_t)count);
        assert_true(board_run(b, 5 * MS));
    }
    pthread_join(t.thread, NULL);
    close(fd);
    close(listener);
    return t.result;
}

static int reads_the_sensor_and_sets_the_relay(modbus_t *peer)
{
    uint16_t word;

    return modbus_read_input_registers(peer, 0, 1, &word) == 1 && modbus_write_bit(peer, 0, 1) == 1
               ? word
               : -1;
}

static int resets_the_relay(modbus_t *peer)
{
    return modbus_write_bit(peer, 0, 0);
}

static void tcp_server_sketch(const kind *k)
{
    board *b = kind_start(k, "TcpServer");
    wire *network = board_uart(b, '0', to_client, NULL);

    board_sensor(b, 0, 2500);
    assert_true(board_run(b, 250 * MS));
    assert_in_range(gets(b, network, reads_the_sensor_and_sets_the_relay), 505, 518);
    assert_true(is_high(b, k->pin4));
    assert_int_equal(gets(b, network, resets_the_relay), 1);
    assert_false(is_high(b, k->pin4));
    board_free(b);
}

TEST(the_tcp_server_serves_a_sensor_and_a_relay)
{
    tcp_server_sketch(&uno);
    tcp_server_sketch(&mega);
}

static uint16_t words[100];

static int reads_a_device(modbus_t *peer)
{
    modbus_set_slave(peer, 17);
    return modbus_read_registers(peer, 3, 60, words);
}

static int writes_to_a_device(modbus_t *peer)
{
    static const uint16_t values[2] = {0x1234, 0x5678};

    modbus_set_slave(peer, 17);
    return modbus_write_registers(peer, 40, 2, values);
}

static int asks_a_unit_of_no_line(modbus_t *peer)
{
    modbus_set_slave(peer, 40);
    return modbus_read_registers(peer, 3, 1, words) < 0 ? errno : 0;
}

TEST(the_gateway_passes_requests_to_its_line)
{
    board *b = kind_start(&mega, "TcpToRtuGateway");
    wire *network, *line;
    server device;

    server_start(&device, 17);
    line = board_uart(b, '0', peer_libmodbus, &device);
    network = board_uart(b, '1', to_client, NULL);
    assert_true(board_run(b, 50 * MS));
    assert_int_equal(gets(b, network, reads_a_device), 60);
    for (unsigned i = 0; i < 60; i++)
        assert_int_equal(words[i], server_pattern(3 + i));
    assert_int_equal(gets(b, network, writes_to_a_device), 2);
    assert_int_equal(device.mapping->tab_registers[41], 0x5678);
    assert_int_equal(line->frames, 2);
    assert_int_equal(gets(b, network, asks_a_unit_of_no_line), EMBXGPATH);
    assert_int_equal(line->frames, 2);
    server_stop(&device);
    board_free(b);
}
