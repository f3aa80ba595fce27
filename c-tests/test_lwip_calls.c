/* The port for lwIP's raw API, called in the wrong order, twice, with NULL, and from lwIP's own
 * callbacks. */
#include "lwip_pair.h"
#include "test.h"

#include "lwip/priv/tcp_priv.h"

fixture each_test = {pair_begin, pair_end};

TEST(every_function_takes_null)
{
    const mbm_port port = mbm_lwip_port(NULL);

    IS(MBM_INVALID_ARGUMENT, mbm_lwip_open(NULL, &the_wire.far, PORT));
    IS(MBM_INVALID_ARGUMENT, mbm_lwip_open(&device, NULL, PORT));
    IS(MBM_INVALID_ARGUMENT, mbm_lwip_open(&device, IP_ADDR_ANY, PORT));
    IS(MBM_INVALID_ARGUMENT, mbm_lwip_open(&device, &the_wire.far, 0));
    IS(MBM_INVALID_ARGUMENT, mbm_lwip_connect(NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_lwip_status(NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_lwip_listen(NULL, NULL, PORT, places, PLACES));
    IS(MBM_INVALID_ARGUMENT, mbm_lwip_listen(&listener, NULL, PORT, NULL, PLACES));
    IS(MBM_INVALID_ARGUMENT, mbm_lwip_listen(&listener, NULL, PORT, places, 0));
    IS(MBM_INVALID_ARGUMENT, mbm_lwip_listen(&listener, NULL, 0, places, PLACES));
    mbm_lwip_close(NULL);
    mbm_lwip_disconnect(NULL);
    mbm_lwip_closeListener(NULL);
    assert_int_equal(mbm_lwip_isInUse(NULL), 0);
    assert_int_equal(mbm_lwip_accept(NULL), -1);
    assert_null(port.read);
    IS(MBM_INVALID_ARGUMENT, mbm_client_beginTcp(&client, &port, NULL, 0, NULL, 0));
    assert_int_equal(mbm_lwip_isInUse(&device), 0);
}

TEST(a_connection_that_was_never_opened_is_a_lost_link)
{
    const mbm_port port = mbm_lwip_port(&device);
    uint8_t byte = 1;

    IS(MBM_LINK_LOST, mbm_lwip_connect(&device));
    IS(MBM_LINK_LOST, mbm_lwip_status(&device));
    mbm_lwip_disconnect(&device);
    mbm_lwip_close(&device);
    assert_int_equal(port.read(port.context, &byte, 1), -1);
    assert_int_equal(port.write(port.context, &byte, 1), -1);
    client_start();
    client_queue(1);
    wire_pass(100, only_poll);
    IS(MBM_LINK_LOST, request.status);
    client_connect();
    client_reads();
}

TEST(a_second_open_is_refused_and_changes_nothing)
{
    ip_addr_t other;

    IP_ADDR4(&other, 10, 0, 0, 77);
    client_connect();
    IS(MBM_BUSY, mbm_lwip_open(&device, &other, 1));
    client_reads();
    mbm_lwip_disconnect(&device);
    IS(MBM_BUSY, mbm_lwip_open(&device, &other, 1));
    IS(MBM_PENDING, mbm_lwip_connect(&device));
    wire_deliver();
    client_reads();
}

TEST(a_second_connect_replaces_the_connection)
{
    client_connect();
    IS(MBM_PENDING, mbm_lwip_connect(&device));
    IS(MBM_PENDING, mbm_lwip_connect(&device));
    wire_deliver();
    client_reads();
    wire_pass(100, serve);
    assert_int_equal(places_inUse(), 1);
}

TEST(a_second_close_and_a_second_disconnect_do_nothing)
{
    client_connect();
    mbm_lwip_disconnect(&device);
    assert_int_equal(device.error, ERR_CONN);
    mbm_lwip_disconnect(&device);
    assert_int_equal(device.error, ERR_CONN);
    mbm_lwip_close(&device);
    mbm_lwip_close(&device);
    mbm_lwip_disconnect(&device);
    assert_int_equal(mbm_lwip_isInUse(&device), 0);
    assert_int_equal(mbm_lwip_connect(&device), MBM_LINK_LOST);
    mbm_lwip_closeListener(&listener);
    mbm_lwip_closeListener(&listener);
    assert_int_equal(mbm_lwip_accept(&listener), -1);
}

TEST(a_server_place_cannot_be_connected)
{
    client_connect();
    client_reads();
    IS(MBM_LINK_LOST, mbm_lwip_connect(&places[0]));
    client_reads();
}

TEST(no_byte_is_read_for_no_capacity)
{
    const mbm_port port = mbm_lwip_port(&places[0]);
    uint8_t byte;

    peer_connect(&peers[0]);
    assert_int_equal(mbm_lwip_accept(&listener), 0);
    peer_send(&peers[0], "1", 1);
    wire_deliver();
    assert_int_equal(port.read(port.context, &byte, 0), 0);
    assert_int_equal(port.write(port.context, &byte, 0), 0);
    assert_int_equal(port.read(port.context, &byte, 1), 1);
    assert_int_equal(byte, '1');
}

TEST(more_bytes_than_a_result_holds_are_taken_in_part)
{
    static uint8_t bytes[0xFFFF];
    const mbm_port port = mbm_lwip_port(&places[0]);
    int16_t count;
    uint32_t left = sizeof bytes;

    peer_connect(&peers[0]);
    assert_int_equal(mbm_lwip_accept(&listener), 0);
    while (left > 0) {
        count = port.write(port.context, bytes, (uint16_t)left);
        assert_true(count >= 0);
        left -= (uint16_t)count;
        wire_pass(10, NULL);
    }
    wire_pass(5000, NULL);
    assert_int_equal(peers[0].count, sizeof bytes);
}

/* --- from lwIP's callbacks */

static uint32_t calls;

static void poll_client(void *context)
{
    calls++;
    do {
        (void)mbm_client_poll(&client);
    } while (mbm_client_pollDelay(&client) == 0);
}

static void poll_server(void *context)
{
    int i;

    calls++;
    serve();
    for (i = 0; i < PLACES; i++) {
        while (mbm_lwip_isInUse(&places[i]) && mbm_server_pollDelay(&servers[i]) == 0)
            serve();
    }
}

/* No main loop at all: as in tcpip_thread. */
static void run_by_callbacks(void)
{
    int i;

    listener.ready = poll_server;
    for (i = 0; i < PLACES; i++)
        places[i].ready = poll_server;
    device.ready = poll_client;
    calls = 0;
}

static void reads_by_callbacks(void)
{
    client_queue(REGISTERS);
    only_poll();
    wire_pass(1000, NULL);
    IS(MBM_OK, request.status);
    assert_memory_equal(reply, words, sizeof words);
}

TEST(client_and_server_run_by_callbacks_alone)
{
    int i;

    run_by_callbacks();
    client_connect();
    for (i = 0; i < 100; i++)
        reads_by_callbacks();
    assert_true(calls >= 200);
}

TEST(a_response_that_found_no_memory_is_sent_by_a_callback)
{
    run_by_callbacks();
    peer_connect(&peers[0]);
    peer_ask(&peers[0], 4, 4);
    failing_writes = 3;
    wire_pass(3000, NULL);
    peer_expects(&peers[0], 4, 1, 4);
}

TEST(a_response_that_found_no_room_is_sent_as_soon_as_there_is_some)
{
    uint32_t before;
    uint16_t count;

    run_by_callbacks();
    peer_connect(&peers[0]);
    count = peer_askDeaf(&peers[0], NULL);
    assert_true(places[0].flags & MBM_LWIP_WAITS);
    before = calls;
    peers[0].isDeaf = 0;
    tcp_recved(peers[0].pcb, (u16_t)peers[0].count);
    wire_deliver(); /* no time has passed */
    assert_true(calls > before);
    wire_pass(10000, NULL);
    peer_expects(&peers[0], 0, count, 125);
}

TEST(a_connection_that_replaces_an_idle_one_is_served_by_callbacks)
{
    int i;

    run_by_callbacks();
    listener.idleTimeMs = 1000;
    for (i = 0; i < PLACES; i++)
        peer_connect(&peers[i]);
    wire_pass(2000, NULL);
    peer_connect(&peers[PLACES]);
    peer_ask(&peers[PLACES], 4, 4);
    wire_pass(3000, NULL);
    peer_expects(&peers[PLACES], 4, 1, 4);
    assert_int_equal(ends, 1);
}

static void close_place(void *context)
{
    (void)mbm_lwip_accept(&listener);
    mbm_lwip_close(context);
}

TEST(a_connection_may_be_closed_in_its_callback)
{
    int i;

    places[0].context = &places[0];
    for (i = 0; i < 10; i++) {
        places[0].ready = NULL;
        peer_connect(&peers[0]);
        assert_int_equal(mbm_lwip_accept(&listener), 0);
        places[0].ready = close_place;
        peer_ask(&peers[0], 1, 1);
        wire_pass(100, NULL);
        assert_int_equal(mbm_lwip_isInUse(&places[0]), 0);
        assert_null(peers[0].pcb);
    }
    /* When it arrives. */
    peer_connect(&peers[0]);
    wire_pass(100, NULL);
    assert_true(peers[0].isEnded || peers[0].pcb == NULL);
    assert_int_equal(mbm_lwip_isInUse(&places[0]), 0);
}

/* Bytes that were not acknowledged are given up: lwIP aborts the connection in its own callback. */
static void disconnect_place(void *context)
{
    (void)mbm_lwip_accept(&listener);
    mbm_lwip_disconnect(context);
}

TEST(a_connection_may_be_reset_in_its_callback)
{
    const mbm_port port = mbm_lwip_port(&places[0]);
    int i;

    places[0].context = &places[0];
    for (i = 0; i < 10; i++) {
        places[0].ready = NULL;
        peer_connect(&peers[0]);
        assert_int_equal(mbm_lwip_accept(&listener), 0);
        the_wire.isCut = 1;
        assert_int_equal(port.write(port.context, (const uint8_t *)"1", 1), 1);
        the_wire.isCut = 0;
        places[0].ready = disconnect_place;
        peer_ask(&peers[0], 1, 1);
        wire_pass(100, NULL);
        IS(MBM_LINK_LOST, mbm_lwip_status(&places[0]));
        assert_int_equal(peers[0].error, ERR_RST);
        mbm_lwip_close(&places[0]);
    }
}

static void connect_again(void *context)
{
    calls++;
    if (mbm_lwip_status(context) == MBM_LINK_LOST)
        (void)mbm_lwip_connect(context);
}

TEST(a_client_may_connect_again_in_its_callback)
{
    device.ready = connect_again;
    device.context = &device;
    client_connect();
    client_reads();
    serve_reset();
    wire_pass(100, serve);
    OK(mbm_lwip_status(&device));
    client_reads();
    /* Also while bytes wait that were not acknowledged. */
    the_wire.isCut = 1;
    client_queue(1);
    only_poll();
    the_wire.isCut = 0;
    serve_reset();
    /* The client does not know that it is another connection. */
    wire_pass(2000, serve_and_poll);
    IS(MBM_RESPONSE_TIMED_OUT, request.status);
    client_reads();
}

static void close_listener(void *context)
{
    mbm_lwip_closeListener(&listener);
}

TEST(a_listener_may_be_closed_in_its_callback)
{
    listener.ready = close_listener;
    peer_connect(&peers[0]);
    wire_pass(100, serve);
    assert_int_equal(peers[0].error, ERR_RST);
    assert_int_equal(mbm_lwip_isInUse(&places[0]), 0);
}
