/* The port for lwIP's sockets: the sources of the port for Linux, compiled for lwIP, and the
 * examples in tasks beside lwIP's own thread. The peers are libmodbus's client and server, through
 * a relay. */
#include "await.h"
#include "lwip_relay.h"
#include "mbm_tcp.h"
#include "server.h"
#include "sockets.h"
#include "tcp_server.h"
#include "test.h"

#include <modbus.h>
#include <pthread.h>

enum { CLIENTS = 3, REQUESTS = 1000, RESETS = 10, TO_LIBMODBUS = 1502, FREE_PORT = 1600 };

static uint16_t to_board;
static tcp_server peer;
static device meter = {.host = "127.0.0.1", .service = "1502"};

static void *serve_task(void *none)
{
    serve_sockets(none);
    return NULL;
}

static void *read_task(void *of)
{
    read_sockets(of);
    return NULL;
}

/* The tasks run until the program ends. */
static void begin(void)
{
    pthread_t task;

    relay_begin();
    tcp_server_start(&peer);
    relay_toMachine(TO_LIBMODBUS, peer.port);
    to_board = relay_toLwip(502);
    assert_int_equal(pthread_create(&task, NULL, serve_task, NULL), 0);
    assert_int_equal(pthread_create(&task, NULL, read_task, &meter), 0);
}

static void fault_setup(void);
static void fault_end(void);

fixture all_tests = {begin, NULL}, each_test;

/* --- the server */

typedef struct reader {
    pthread_t thread;
    unsigned address, right;
} reader;

static void *write_and_read(void *of)
{
    reader *r = of;
    modbus_t *client = tcp_clientOf(to_board, 1);
    uint16_t words[SERVED];
    unsigned i;

    if (modbus_connect(client) == 0)
        for (i = 0; i < REQUESTS; i++)
            r->right += modbus_write_register(client, (int)r->address, (uint16_t)i) == 1 &&
                        modbus_read_registers(client, 0, SERVED, words) == SERVED &&
                        words[r->address] == i;
    modbus_close(client);
    modbus_free(client);
    return NULL;
}

/* Whether libmodbus reads a register of the server. */
static int reads_board(void)
{
    modbus_t *client = tcp_clientOf(to_board, 1);
    uint16_t words[SERVED];
    const int done =
        modbus_connect(client) == 0 && modbus_read_registers(client, 0, SERVED, words) == SERVED;

    modbus_close(client);
    modbus_free(client);
    return done;
}

TEST(libmodbus_writes_and_reads_a_server_over_three_connections)
{
    reader readers[CLIENTS];
    unsigned i;

    /* Its connection may still have the fourth place. */
    AWAIT(reads_board());
    for (i = 0; i < CLIENTS; i++) {
        readers[i].address = i;
        readers[i].right = 0;
        assert_int_equal(pthread_create(&readers[i].thread, NULL, write_and_read, &readers[i]), 0);
    }
    for (i = 0; i < CLIENTS; i++)
        pthread_join(readers[i].thread, NULL);
    for (i = 0; i < CLIENTS; i++)
        assert_int_equal(readers[i].right, REQUESTS);
}

TEST(a_server_serves_on_after_resets)
{
    unsigned i;

    for (i = 0; i < RESETS; i++) {
        modbus_t *client = tcp_clientOf(to_board, 1);
        uint16_t word;

        assert_int_equal(modbus_connect(client), 0);
        assert_int_equal(modbus_read_registers(client, 0, 1, &word), 1);
        relay_reset();
        modbus_close(client);
        modbus_free(client);
        AWAIT(reads_board());
    }
}

/* --- the client */

TEST(a_client_reads_libmodbus_and_connects_anew_after_a_reset)
{
    unsigned i;

    for (i = 0; i < 3; i++) {
        const uint32_t before = meter.reads;

        AWAIT(meter.reads >= before + 2 && meter.status == MBM_OK);
        assert_int_equal(meter.words[0], server_pattern(0));
        assert_int_equal(meter.words[1], server_pattern(1));
        relay_reset();
    }
}

TEST(a_refused_connection_is_a_lost_link_with_a_reason)
{
    mbm_tcp tcp = MBM_INIT;
    mbm_tcp_addresses addresses;
    mbm_port port = mbm_tcp_port(&tcp);
    uint8_t byte;

    if (mbm_tcp_open(&tcp, &addresses, "127.0.0.1", "1601") == 0) {
        AWAIT(mbm_tcp_isConnected(&tcp) != 0);
        assert_int_equal(mbm_tcp_status(&tcp), MBM_LINK_LOST);
        assert_int_equal(port.read(port.context, &byte, 1), -1);
        assert_int_equal(port.write(port.context, &byte, 1), -1);
        assert_int_not_equal(tcp.error, 0);
    }
    mbm_tcp_close(&tcp);
}

TEST(a_name_or_service_that_is_none_is_refused)
{
    mbm_tcp tcp = MBM_INIT;
    mbm_tcp_addresses addresses;
    char longest[MBM_TCP_HOST_BYTES + 1];

    FAILS(ENXIO, mbm_tcp_open(&tcp, &addresses, "127.0.0.1", "modbus"));
    FAILS(ENXIO, mbm_tcp_open(&tcp, &addresses, "127.0.0.1", "65536"));
    FAILS(ENXIO, mbm_tcp_open(&tcp, &addresses, "127.0.0.1", ""));
    assert_int_equal(mbm_tcp_open(&tcp, &addresses, "no address", "502"), -1);
    memset(longest, 'a', sizeof longest);
    longest[sizeof longest - 1] = '\0';
    FAILS(ENAMETOOLONG, mbm_tcp_open(&tcp, &addresses, longest, "502"));
    assert_int_equal(mbm_tcp_isInUse(&tcp), 0);
}

TEST(a_listener_closes_what_finds_no_place_and_serves_on)
{
    mbm_tcp_listener listener = MBM_INIT;
    mbm_tcp place = MBM_INIT, first = MBM_INIT, second = MBM_INIT;
    mbm_tcp_addresses of_first, of_second;

    assert_int_equal(mbm_tcp_listen(&listener, NULL, "1600"), 0);
    assert_int_equal(listener.port, FREE_PORT);
    FAILS(EBUSY, mbm_tcp_listen(&listener, NULL, "1600"));
    assert_int_equal(mbm_tcp_open(&first, &of_first, "127.0.0.1", "1600"), 0);
    AWAIT(mbm_tcp_accept(&listener, &place, 1) == 0);
    assert_int_equal(mbm_tcp_open(&second, &of_second, "127.0.0.1", "1600"), 0);
    AWAIT((mbm_tcp_accept(&listener, &place, 1), listener.refused == 1));
    AWAIT(mbm_tcp_isConnected(&second) < 0);
    assert_int_equal(mbm_tcp_isConnected(&first), 1);
    mbm_tcp_close(&first);
    AWAIT(mbm_tcp_isConnected(&place) < 0);
    mbm_tcp_close(&second);
    mbm_tcp_close(&place);
    mbm_tcp_closeListener(&listener);
    assert_int_equal(mbm_tcp_listen(&listener, "127.0.0.1", "1600"), 0);
    mbm_tcp_closeListener(&listener);
}

TEST(a_wait_ends_when_bytes_come_and_when_the_time_is_over)
{
    mbm_tcp_listener listener = MBM_INIT;
    mbm_tcp place = MBM_INIT, client = MBM_INIT;
    mbm_tcp_addresses addresses;
    mbm_port to = mbm_tcp_port(&client), from = mbm_tcp_port(&place);
    uint8_t byte = 0x2A;

    assert_int_equal(mbm_tcp_listen(&listener, NULL, "1600"), 0);
    assert_int_equal(mbm_tcp_open(&client, &addresses, "127.0.0.1", "1600"), 0);
    AWAIT(mbm_tcp_accept(&listener, &place, 1) == 0);
    assert_int_equal(mbm_tcp_wait(&place, 1, NULL, -1, 0), 0);
    assert_int_equal(mbm_tcp_wait(&place, 1, NULL, -1, 500), 0);
    AWAIT(mbm_tcp_isConnected(&client) == 1);
    assert_int_equal(to.write(to.context, &byte, 1), 1);
    assert_int_equal(mbm_tcp_wait(&place, 1, NULL, -1, MBM_TCP_FOREVER), 1);
    byte = 0;
    assert_int_equal(from.read(from.context, &byte, 1), 1);
    assert_int_equal(byte, 0x2A);
    assert_int_equal(from.read(from.context, &byte, 1), 0);
    mbm_tcp_close(&client);
    mbm_tcp_close(&place);
    mbm_tcp_closeListener(&listener);
}

/* lwIP would send the bytes for minutes otherwise. */
static void is_given_up_by(void (*leave)(void *context))
{
    mbm_tcp_listener listener = MBM_INIT;
    mbm_tcp place = MBM_INIT, client = MBM_INIT;
    mbm_tcp_addresses addresses;
    mbm_port to = mbm_tcp_port(&client);
    static const uint8_t bytes[1000];
    int16_t taken = 1;
    long sum = 0, got = 0;
    uint8_t into[1000];

    assert_int_equal(mbm_tcp_listen(&listener, NULL, "1600"), 0);
    assert_int_equal(mbm_tcp_open(&client, &addresses, "127.0.0.1", "1600"), 0);
    AWAIT(mbm_tcp_accept(&listener, &place, 1) == 0);
    AWAIT(mbm_tcp_isConnected(&client) == 1);
    /* More than the window of the peer, which reads nothing. */
    while (taken > 0) {
        taken = to.write(to.context, bytes, sizeof bytes);
        assert_true(taken >= 0);
        sum += taken;
    }
    leave(&client);
    AWAIT((taken = mbm_tcp_port(&place).read(&place, into, sizeof into),
           got += taken > 0 ? taken : 0, taken < 0));
    assert_true(got < sum);
    mbm_tcp_close(&client);
    mbm_tcp_close(&place);
    mbm_tcp_closeListener(&listener);
}

static void close_client(void *context)
{
    mbm_tcp_close(context);
}

TEST_ROW(a_request_without_an_answer_is_given_up_by_a_disconnect,
         is_given_up_by(mbm_tcp_disconnect))
TEST_ROW(a_request_without_an_answer_is_given_up_by_a_close, is_given_up_by(close_client))

TEST(a_connection_whose_request_was_answered_ends_without_a_reset)
{
    mbm_tcp_listener listener = MBM_INIT;
    mbm_tcp place = MBM_INIT, client = MBM_INIT;
    mbm_tcp_addresses addresses;
    const mbm_port near_end = mbm_tcp_port(&client), far_end = mbm_tcp_port(&place);
    uint8_t byte = 7;

    assert_int_equal(mbm_tcp_listen(&listener, NULL, "1600"), 0);
    assert_int_equal(mbm_tcp_open(&client, &addresses, "127.0.0.1", "1600"), 0);
    AWAIT(mbm_tcp_accept(&listener, &place, 1) == 0);
    AWAIT(mbm_tcp_isConnected(&client) == 1);
    assert_int_equal(near_end.write(&client, &byte, 1), 1);
    AWAIT(far_end.read(&place, &byte, 1) == 1);
    assert_int_equal(far_end.write(&place, &byte, 1), 1);
    AWAIT(near_end.read(&client, &byte, 1) == 1);
    poll(NULL, 0, 30);
    mbm_tcp_close(&client);
    AWAIT(far_end.read(&place, &byte, 1) < 0);
    assert_int_equal(place.error, EPIPE);
    mbm_tcp_close(&place);
    mbm_tcp_closeListener(&listener);
}

/* --- the faults that Linux has too */

/* lwIP has no route, and says so at once. */
#define STATUS_WHILE_DOWN MBM_LINK_LOST

#undef TEST
#define TEST(name) TEST_WITH(name, fault_setup, fault_end)
#include "tcp_faults.h"

static void set_network(int is_up)
{
    relay_setNetwork(is_up);
}

static void fault_setup(void)
{
    fault_begin("1600");
}
