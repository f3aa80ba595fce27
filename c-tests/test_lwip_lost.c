/* The port for lwIP's raw API when a connection is not made or is lost: each time the status says
 * so, and the next request works once the cause is gone. */
#include "lwip_pair.h"
#include "test.h"

#include "lwip/priv/tcp_priv.h"

static mbm_link kept;

static void begin(void)
{
    memset(&kept, 0, sizeof kept);
    pair_begin();
}

fixture each_test = {begin, pair_end};

/* A client that connects by itself. */
static void begin_link(void)
{
    const mbm_linkHooks hooks = mbm_lwip_link(&device);

    client_start();
    OK(mbm_link_begin(&kept, &client, &hooks));
    OK(mbm_link_setBackoff(&kept, MBM_BACKOFF_EXPONENTIAL, 100, 100));
}

/* Lets the time pass until the request has ended. */
static uint8_t ended(uint32_t ms)
{
    const uint32_t end = the_wire.ms + ms;

    while (request.status == MBM_PENDING && (int32_t)(end - the_wire.ms) > 0)
        wire_pass(50, serve_and_poll);
    return request.status;
}

/* Lets the time pass until the connection is made or lost. Returns its status. */
static uint8_t connected(uint32_t ms)
{
    const uint32_t end = the_wire.ms + ms;

    while (mbm_lwip_status(&device) == MBM_PENDING && (int32_t)(end - the_wire.ms) > 0)
        wire_pass(50, NULL);
    return mbm_lwip_status(&device);
}

TEST(a_server_that_does_not_listen_refuses_at_once)
{
    mbm_lwip_closeListener(&listener);
    IS(MBM_PENDING, mbm_lwip_open(&device, &the_wire.far, PORT));
    client_start();
    wire_deliver();
    IS(MBM_LINK_LOST, mbm_lwip_status(&device));
    assert_int_equal(device.error, ERR_RST);
    assert_string_equal(mbm_lwip_text(device.error), "the peer refused or reset the connection");
    client_queue(REGISTERS);
    IS(MBM_LINK_LOST, ended(100));
    OK(mbm_lwip_listen(&listener, NULL, PORT, places, PLACES));
    IS(MBM_PENDING, mbm_lwip_connect(&device));
    wire_deliver();
    client_reads();
}

TEST(a_server_that_never_answers_is_a_connection_timed_out)
{
    the_wire.isCut = 1;
    IS(MBM_PENDING, mbm_lwip_open(&device, &the_wire.far, PORT));
    assert_int_equal(device.error, ERR_INPROGRESS);
    IS(MBM_CONNECT_TIMED_OUT, connected(600000));
    assert_int_equal(device.error, ERR_TIMEOUT);
    the_wire.isCut = 0;
    IS(MBM_PENDING, mbm_lwip_connect(&device));
    client_start();
    wire_deliver();
    client_reads();
}

TEST(an_attempt_that_is_given_up_is_a_connection_timed_out)
{
    the_wire.isCut = 1;
    IS(MBM_PENDING, mbm_lwip_open(&device, &the_wire.far, PORT));
    mbm_lwip_disconnect(&device);
    IS(MBM_CONNECT_TIMED_OUT, mbm_lwip_status(&device));
    assert_null(tcp_active_pcbs);
}

TEST(a_link_that_gives_up_an_attempt_makes_the_next)
{
    the_wire.isCut = 1;
    IS(MBM_PENDING, mbm_lwip_open(&device, &the_wire.far, PORT));
    begin_link();
    client_queue(REGISTERS);
    IS(MBM_CONNECT_TIMED_OUT, ended(60000));
    the_wire.isCut = 0;
    wire_pass(1000, serve_and_poll);
    client_reads();
}

TEST(a_network_that_comes_later_is_waited_for)
{
    wire_unplug();
    IS(MBM_LINK_LOST, mbm_lwip_open(&device, &the_wire.far, PORT));
    assert_int_equal(device.error, ERR_RTE);
    assert_int_equal(mbm_lwip_isInUse(&device), 1);
    begin_link();
    client_queue(REGISTERS);
    IS(MBM_LINK_LOST, ended(1000));
    wire_plug();
    wire_pass(1000, serve_and_poll);
    client_reads();
}

TEST(no_memory_for_a_connection_is_a_lost_link_until_there_is_some)
{
    failing_connections = 3;
    IS(MBM_LINK_LOST, mbm_lwip_open(&device, &the_wire.far, PORT));
    assert_int_equal(device.error, ERR_MEM);
    begin_link();
    wire_pass(1000, serve_and_poll);
    assert_int_equal(failing_connections, 0);
    client_reads();
}

TEST(no_memory_for_a_request_is_a_busy_line_until_there_is_some)
{
    client_connect();
    client_reads();
    failing_writes = UINT32_MAX;
    client_queue(REGISTERS);
    IS(MBM_LINE_BUSY, ended(60000));
    failing_writes = 0;
    client_reads();
    assert_int_equal(ends, 0);
}

TEST(a_reset_while_a_request_is_pending_ends_it)
{
    client_connect();
    client_queue(REGISTERS);
    only_poll();
    wire_deliver();
    assert_int_equal(mbm_lwip_accept(&listener), 0);
    mbm_lwip_disconnect(&places[0]); /* unread bytes: lwIP resets */
    mbm_lwip_close(&places[0]);
    IS(MBM_LINK_LOST, ended(100));
    assert_int_equal(device.error, ERR_RST);
    IS(MBM_PENDING, mbm_lwip_connect(&device));
    wire_deliver();
    client_reads();
}

TEST(a_reset_of_an_idle_connection_is_seen_by_the_link)
{
    IS(MBM_PENDING, mbm_lwip_open(&device, &the_wire.far, PORT));
    begin_link();
    client_reads();
    serve_reset();
    wire_deliver();
    IS(MBM_LINK_LOST, mbm_lwip_status(&device));
    client_reads();
    client_reads();
}

/* The connection is reset by its peer in each state that it can be in. */
TEST(a_server_survives_a_reset_at_every_moment)
{
    enum { NEW, IDLE, HALF_A_REQUEST, UNREAD, UNSENT, CLOSED_BY_PEER, MOMENTS };
    const uint8_t bytes[5] = {0, 9, 0, 0, 0};
    int moment;

    client_connect();
    client_reads();
    for (moment = 0; moment < MOMENTS; moment++) {
        peer_connect(&peers[0]);
        if (moment != NEW)
            wire_pass(50, serve);
        if (moment == HALF_A_REQUEST)
            peer_send(&peers[0], bytes, sizeof bytes);
        if (moment == UNREAD)
            peer_ask(&peers[0], 1, 1);
        if (moment == UNSENT) {
            peer_ask(&peers[0], 1, 1);
            failing_writes = UINT32_MAX;
        }
        if (moment == CLOSED_BY_PEER)
            assert_int_equal(tcp_shutdown(peers[0].pcb, 0, 1), ERR_OK);
        if (moment == UNREAD)
            wire_deliver();
        else if (moment != NEW)
            wire_pass(50, serve);
        peer_reset(&peers[0]);
        wire_deliver();
        failing_writes = 0;
        wire_pass(50, serve);
        assert_int_equal(places_inUse(), 1);
        client_reads();
    }
}

TEST(a_close_by_the_server_between_requests_costs_no_request)
{
    IS(MBM_PENDING, mbm_lwip_open(&device, &the_wire.far, PORT));
    begin_link();
    client_reads();
    mbm_lwip_close(&places[0]);
    wire_deliver();
    client_reads();
    assert_int_equal(device.error, ERR_OK);
}

TEST(a_close_while_a_request_is_pending_ends_it)
{
    client_connect();
    client_queue(REGISTERS);
    only_poll();
    wire_deliver();
    mbm_lwip_close(&device);
    IS(MBM_LINK_LOST, ended(100));
    wire_pass(500, serve);
    assert_int_equal(ends, 1);
    client_connect();
    client_reads();
}

TEST(a_cable_that_is_out_ends_a_request_at_once_and_sends_it_never)
{
    IS(MBM_PENDING, mbm_lwip_open(&device, &the_wire.far, PORT));
    begin_link();
    client_reads();
    wire_unplug();
    request.data = &(const uint16_t){0xAAAA};
    IS(MBM_PENDING, mbm_client_writeSingleRegister(&client, &request, 0, 0xAAAA));
    IS(MBM_LINK_LOST, ended(100));
    assert_int_equal(device.error, ERR_RTE);
    wire_plug();
    wire_pass(60000, serve_and_poll);
    assert_int_equal(words[0], 7);
    client_reads();
}

TEST(a_cable_that_is_pulled_during_a_request_ends_it_and_repeats_it_never)
{
    IS(MBM_PENDING, mbm_lwip_open(&device, &the_wire.far, PORT));
    begin_link();
    OK(mbm_client_setResponseTimeout(&client, 5000));
    client_reads();
    IS(MBM_PENDING, mbm_client_writeSingleRegister(&client, &request, 0, 0xAAAA));
    the_wire.isCut = 1;
    only_poll();
    wire_unplug();
    IS(MBM_LINK_LOST, ended(1000));
    assert_int_equal(device.error, ERR_RTE);
    the_wire.isCut = 0;
    wire_plug();
    wire_pass(60000, serve_and_poll);
    assert_int_equal(words[0], 7);
    client_reads();
}

TEST(a_new_address_of_the_interface_costs_the_connections_alone)
{
    IS(MBM_PENDING, mbm_lwip_open(&device, &the_wire.far, PORT));
    begin_link();
    client_reads();
    wire_readdress(9);
    IS(MBM_LINK_LOST, mbm_lwip_status(&device));
    assert_int_equal(device.error, ERR_ABRT);
    client_reads();
    client_queue(REGISTERS);
    only_poll();
    wire_readdress(1);
    IS(MBM_LINK_LOST, ended(1000));
    client_reads();
    assert_int_equal(ends, 2);
}

/* A switch between the two has no power: nothing comes back, and the interface stays up. */
TEST(a_network_that_swallows_all_is_a_response_timed_out_and_then_works_again)
{
    IS(MBM_PENDING, mbm_lwip_open(&device, &the_wire.far, PORT));
    begin_link();
    client_reads();
    the_wire.isCut = 1;
    client_queue(REGISTERS);
    IS(MBM_RESPONSE_TIMED_OUT, ended(10000));
    wire_pass(120000, serve_and_poll);
    the_wire.isCut = 0;
    wire_pass(60000, serve_and_poll);
    client_reads();
}

TEST(a_short_outage_costs_no_connection)
{
    client_connect();
    client_reads();
    /* Longer than an answer may take. */
    wire_pass(MBM_LWIP_UNACKNOWLEDGED_MS + 10000, serve_and_poll);
    OK(mbm_client_setResponseTimeout(&client, 20000));
    the_wire.isCut = 1;
    client_queue(REGISTERS);
    wire_pass(3000, serve_and_poll);
    the_wire.isCut = 0;
    OK(ended(20000));
    client_reads();
    assert_int_equal(ends, 0);
}

TEST(an_idle_peer_that_is_gone_is_noticed)
{
    client_connect();
    client_reads();
    the_wire.isCut = 1;
    wire_pass(45000, serve);
    assert_int_equal(ends, 1);
    IS(MBM_LINK_LOST, mbm_lwip_status(&device));
    assert_int_equal(device.error, ERR_ABRT);
}

TEST(a_connection_that_is_given_up_does_not_keep_its_memory)
{
    int i;

    for (i = 0; i < 200; i++) {
        client_connect();
        client_reads();
        mbm_lwip_close(&device);
        wire_pass(100, serve);
    }
    assert_null(tcp_active_pcbs);
}
