/* The port over the sockets of a WIZnet chip, client and server, over a W5500 that is played:
 * libmodbus at the far end, and a fault at each command to the chip. */
#include "await.h"
#include "chip_model.h"
#include "mbm_wiznet.h"
#include "server.h"
#include "tcp_server.h"
#include "test.h"

#include <modbus.h>
#include <pthread.h>
#include <sys/socket.h>

enum { PLACES = 3, REGISTERS = 125, READS = 200, MAX_CALLS = 60 };

static uint16_t words[REGISTERS];
static mbm_registerTable holding;
static mbm_unit unit;
static mbm_wiznet places[PLACES];
static mbm_server servers[PLACES];
static uint8_t frames[PLACES][MBM_MAX_TCP_FRAME];
static uint32_t begun;

static mbm_wiznet device;
static mbm_client client;
static mbm_link kept;
static uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
static uint16_t reply[REGISTERS];
static mbm_clientRequest request;

static uint32_t micros(void *context)
{
    (void)context;
    return the_chip.micros;
}

/* A round of the main loop of a server, and a millisecond. */
static void serve(void)
{
    int i;

    the_chip.micros += 1000;
    for (i = 0; i < PLACES; i++) {
        const mbm_port port = mbm_wiznet_port(&places[i]);
        const int there = mbm_wiznet_serve(&places[i]);

        if (there == 1) {
            begun++;
            OK(mbm_server_beginTcp(&servers[i], &port, &unit, 1, frames[i], sizeof frames[i]));
        }
        if (there > 0)
            (void)mbm_server_poll(&servers[i]);
    }
}

static void setup(void)
{
    int i;

    chip_begin();
    memset(&holding, 0, sizeof holding);
    memset(&unit, 0, sizeof unit);
    memset(places, 0, sizeof places);
    memset(servers, 0, sizeof servers);
    memset(&device, 0, sizeof device);
    memset(&client, 0, sizeof client);
    memset(&kept, 0, sizeof kept);
    memset(&request, 0, sizeof request);
    begun = 0;
    for (i = 0; i < REGISTERS; i++)
        words[i] = (uint16_t)(0x100 * i + 7);
    holding.words = words;
    holding.size = REGISTERS;
    unit.id = 1;
    OK(mbm_unit_serveHoldingRegisters(&unit, &holding));
    for (i = 0; i < PLACES; i++) {
        places[i].number = (uint8_t)i;
        places[i].micros = micros;
    }
    device.number = 7;
    device.micros = micros;
    device.address[0] = 127;
    device.address[3] = 1;
}

fixture each_test = {setup, chip_end};

/* --- the server */

/* A client of libmodbus in a thread. */
typedef struct reader {
    pthread_t thread;
    int reads, right;
    volatile int ended;
} reader;

static void *read_many(void *of)
{
    reader *r = of;
    modbus_t *peer = tcp_clientOf(chip_port(), 1);
    uint16_t read[REGISTERS];
    int i;

    if (modbus_connect(peer) == 0)
        for (i = 0; i < r->reads; i++)
            r->right += modbus_read_registers(peer, 0, REGISTERS, read) == REGISTERS &&
                        memcmp(read, words, sizeof read) == 0;
    modbus_close(peer);
    modbus_free(peer);
    r->ended = 1;
    return NULL;
}

static void start(reader *r, int reads)
{
    memset(r, 0, sizeof *r);
    r->reads = reads;
    assert_int_equal(pthread_create(&r->thread, NULL, read_many, r), 0);
}

static void finish(reader *r)
{
    while (!r->ended) {
        serve();
        poll(NULL, 0, 1);
    }
    pthread_join(r->thread, NULL);
}

static void read_right(int reads)
{
    reader r;

    start(&r, reads);
    finish(&r);
    assert_int_equal(r.right, reads);
}

TEST(libmodbus_reads_a_server_in_each_place_at_once)
{
    reader r[PLACES];
    int i;

    for (i = 0; i < PLACES; i++)
        start(&r[i], READS);
    for (i = 0; i < PLACES; i++)
        finish(&r[i]);
    for (i = 0; i < PLACES; i++)
        assert_int_equal(r[i].right, READS);
    assert_int_equal(begun, PLACES);
}

TEST(a_place_listens_again_after_each_connection)
{
    int i;

    for (i = 0; i < 3 * PLACES; i++)
        read_right(1);
    assert_int_equal(begun, 3 * PLACES);
}

TEST(the_end_of_a_stream_is_answered_by_the_end_of_the_other_side)
{
    read_right(1);
    AWAIT((serve(), the_chip.soft_closes == 1));
    assert_int_equal(the_chip.hard_closes, 0);
}

TEST(a_response_leaves_in_as_many_pieces_as_the_chip_has_place_for)
{
    the_chip.most_sent = 7;
    read_right(3);
}

TEST(a_request_may_show_byte_by_byte)
{
    the_chip.most_received = 1;
    read_right(3);
}

TEST(a_response_waits_while_the_last_bytes_are_not_acknowledged)
{
    the_chip.busy_sends = 9;
    read_right(3);
    assert_int_equal(the_chip.busy_sends, 0);
}

TEST(a_request_before_the_end_of_the_stream_gets_its_response)
{
    static const uint8_t read_one[] = {0, 9, 0, 0, 0, 6, 1, 3, 0, 0, 0, 1};
    uint8_t response[11];
    int fd;

    serve();
    fd = tcp_connectTo(chip_port());
    assert_int_equal(send(fd, read_one, sizeof read_one, MSG_NOSIGNAL), sizeof read_one);
    shutdown(fd, SHUT_WR);
    while (recv(fd, response, sizeof response, MSG_PEEK | MSG_DONTWAIT) != sizeof response)
        serve();
    assert_int_equal(recv(fd, response, sizeof response, 0), sizeof response);
    assert_int_equal(response[10], 7);
    close(fd);
}

TEST(after_a_reset_at_each_command_the_place_serves_again)
{
    unsigned fault, last = 0;

    for (fault = 1; fault < MAX_CALLS; fault++) {
        reader r;

        the_chip.calls = 0;
        the_chip.fail_at = fault;
        start(&r, 2);
        finish(&r);
        last = the_chip.calls;
        the_chip.fail_at = 0;
        read_right(1);
        if (last < fault)
            break;
    }
    assert_true(last < fault);
    assert_true(fault > 8);
}

TEST(an_idle_connection_frees_its_place)
{
    reader r;
    int fds[PLACES], i;

    for (i = 0; i < PLACES; i++)
        places[i].idleTimeMs = 60000;
    serve();
    for (i = 0; i < PLACES; i++) {
        fds[i] = tcp_connectTo(chip_port());
        AWAIT((serve(), begun == (uint32_t)i + 1));
    }
    the_chip.micros += 59000000;
    serve();
    assert_int_equal(the_chip.hard_closes, 0);
    start(&r, 1);
    the_chip.micros += 1000000;
    finish(&r);
    assert_int_equal(r.right, 1);
    assert_int_equal(the_chip.hard_closes, PLACES);
    for (i = 0; i < PLACES; i++)
        close(fds[i]);
}

TEST(a_peer_is_probed_when_it_is_silent)
{
    read_right(1);
    assert_int_equal(the_chip.keep_alive[0], 3);
}

TEST(a_peer_that_never_acknowledges_the_end_keeps_its_place_until_the_chip_gives_up)
{
    int fd, i;

    serve();
    fd = tcp_connectTo(chip_port());
    AWAIT((serve(), begun == 1));
    the_chip.is_deaf = 1;
    shutdown(fd, SHUT_WR);
    AWAIT((serve(), the_chip.soft_closes == 1));
    the_chip.is_deaf = 0;
    the_chip.calls = 0;
    for (i = 0; i < 100; i++)
        assert_int_equal(mbm_wiznet_serve(&places[0]), 0);
    assert_int_equal(the_chip.calls, 0);
    chip_timeOut(0);
    close(fd);
    for (i = 0; i < 2 * PLACES; i++)
        read_right(1);
}

TEST(a_chip_without_an_address_does_not_listen_until_it_has_one)
{
    the_chip.has_no_address = 1;
    assert_int_equal(mbm_wiznet_serve(&places[0]), -1);
    assert_int_equal(places[0].error, -3);
    the_chip.has_no_address = 0;
    assert_int_equal(mbm_wiznet_serve(&places[0]), 0);
    assert_int_equal(places[0].error, 0);
    read_right(1);
}

TEST(a_chip_that_is_not_there_is_an_error_and_no_endless_wait)
{
    the_chip.is_absent = 1;
    assert_int_equal(mbm_wiznet_serve(&places[0]), -1);
    assert_int_equal(places[0].error, -3);
    IS(MBM_LINK_LOST, mbm_wiznet_connect(&device));
    assert_int_equal(device.error, -3);
    mbm_wiznet_disconnect(&device);
    the_chip.is_absent = 0;
    read_right(1);
}

TEST(a_number_that_no_socket_has_is_an_error)
{
    places[0].number = CHIP_SOCKETS;
    assert_int_equal(mbm_wiznet_serve(&places[0]), -1);
    assert_int_equal(places[0].error, -1);
}

/* --- the client */

static void begin_client(uint16_t tcp_port)
{
    const mbm_port port = mbm_wiznet_port(&device);
    const mbm_linkHooks hooks = mbm_wiznet_link(&device);

    device.port = tcp_port;
    OK(mbm_client_beginTcp(&client, &port, incoming, sizeof incoming, outgoing, sizeof outgoing));
    OK(mbm_client_setResponseTimeout(&client, 1000));
    OK(mbm_link_begin(&kept, &client, &hooks));
    OK(mbm_link_setBackoff(&kept, MBM_BACKOFF_EXPONENTIAL, 10, 100));
}

/* Reads registers within ten minutes of the board's time. A millisecond of it lasts until the peer
 * had a chance to run. */
static uint8_t read_by_client(void)
{
    long rounds = 0;

    memset(reply, 0, sizeof reply);
    request.unit = 1;
    request.reply = reply;
    request.replyBytes = sizeof reply;
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &request, 0, 10));
    while (request.status == MBM_PENDING) {
        (void)mbm_client_poll(&client);
        /* A peer in a thread gets real time; only a fault lets the clock run. */
        if (the_chip.is_unplugged || rounds++ % 16 == 0)
            the_chip.micros += the_chip.is_unplugged ? 1000 : 1;
        poll(NULL, 0, the_chip.is_unplugged ? 0 : 1);
        assert_true(rounds < PATIENCE_MS);
    }
    return request.status;
}

static void is_right(void)
{
    int i;

    /* The waits after a loss. */
    for (i = 0; i < 40 && read_by_client() != MBM_OK; i++)
        the_chip.micros += 200000;
    IS(MBM_OK, request.status);
    for (i = 0; i < 10; i++)
        assert_int_equal(reply[i], server_pattern((unsigned)i));
}

TEST(a_client_reads_libmodbus)
{
    tcp_server peer;
    int i;

    tcp_server_start(&peer);
    begin_client(peer.port);
    for (i = 0; i < 20; i++) {
        IS(MBM_OK, read_by_client());
        is_right();
    }
    tcp_server_stop(&peer);
}

TEST(a_client_sends_and_reads_in_pieces)
{
    tcp_server peer;

    tcp_server_start(&peer);
    begin_client(peer.port);
    the_chip.most_sent = 1;
    the_chip.most_received = 1;
    IS(MBM_OK, read_by_client());
    the_chip.busy_sends = 5;
    IS(MBM_OK, read_by_client());
    is_right();
    tcp_server_stop(&peer);
}

TEST(after_a_reset_at_each_command_a_client_reads_again)
{
    unsigned fault, last = 0;
    tcp_server peer;

    tcp_server_start(&peer);
    begin_client(peer.port);
    for (fault = 1; fault < MAX_CALLS; fault++) {
        mbm_wiznet_disconnect(&device);
        the_chip.calls = 0;
        the_chip.fail_at = fault;
        (void)read_by_client();
        last = the_chip.calls;
        the_chip.fail_at = 0;
        is_right();
        if (last < fault)
            break;
    }
    assert_true(last < fault);
    assert_true(fault > 4);
    tcp_server_stop(&peer);
}

TEST(a_refused_connection_is_a_lost_link_and_later_one_works)
{
    tcp_server peer;
    uint16_t port;
    int reserved = tcp_reserve(&port);

    begin_client(port);
    IS(MBM_LINK_LOST, read_by_client());
    assert_int_equal(device.error, -4);
    close(reserved);
    tcp_server_start(&peer);
    device.port = peer.port;
    is_right();
    tcp_server_stop(&peer);
}

TEST(a_client_in_a_network_that_is_down_times_out_and_reads_once_it_is_up)
{
    tcp_server peer;

    tcp_server_start(&peer);
    begin_client(peer.port);
    IS(MBM_OK, read_by_client());
    the_chip.is_unplugged = 1;
    IS(MBM_RESPONSE_TIMED_OUT, read_by_client());
    chip_timeOut(device.number);
    (void)read_by_client();
    assert_int_equal(device.error, -13);
    the_chip.is_unplugged = 0;
    is_right();
    tcp_server_stop(&peer);
}

/* The chip takes no bytes while the last ones are not acknowledged. */
TEST(a_client_whose_last_bytes_are_not_acknowledged_is_busy_and_reads_once_they_are)
{
    tcp_server peer;

    tcp_server_start(&peer);
    begin_client(peer.port);
    IS(MBM_OK, read_by_client());
    the_chip.busy_sends = CHIP_ALWAYS;
    the_chip.is_unplugged = 1;
    IS(MBM_LINE_BUSY, read_by_client());
    assert_int_equal(the_chip.hard_closes, 0);
    the_chip.busy_sends = 0;
    the_chip.is_unplugged = 0;
    is_right();
    tcp_server_stop(&peer);
}

TEST(a_socket_that_was_never_connected_is_a_lost_link_until_it_is)
{
    const mbm_port port = mbm_wiznet_port(&device);
    tcp_server peer;
    uint8_t byte = 0;

    assert_int_equal(port.read(&device, &byte, 1), -1);
    assert_int_equal(port.write(&device, &byte, 1), -1);
    IS(MBM_LINK_LOST, mbm_wiznet_status(&device));
    mbm_wiznet_disconnect(&device);
    assert_int_equal(the_chip.calls, 0);
    tcp_server_start(&peer);
    begin_client(peer.port);
    is_right();
    tcp_server_stop(&peer);
}

TEST(each_connection_of_a_client_has_another_local_port)
{
    uint16_t first;
    int i;

    device.localPort = 65277;
    device.port = chip_port();
    for (i = 0; i < 4; i++) {
        first = the_chip.local_port[device.number];
        IS(MBM_PENDING, mbm_wiznet_connect(&device));
        assert_int_not_equal(the_chip.local_port[device.number], first);
        assert_true(the_chip.local_port[device.number] >= 49152);
        mbm_wiznet_disconnect(&device);
    }
}

TEST(what_is_not_acknowledged_is_given_up_with_the_connection)
{
    tcp_server peer;

    tcp_server_start(&peer);
    begin_client(peer.port);
    IS(MBM_OK, read_by_client());
    mbm_wiznet_disconnect(&device);
    assert_int_equal(the_chip.hard_closes, 1);
    assert_int_equal(the_chip.soft_closes, 0);
    tcp_server_stop(&peer);
}
