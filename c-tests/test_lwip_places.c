/* The listener of the port for lwIP's raw API: which connection gets a place, and which is
 * closed or reset. */
#include "lwip_pair.h"
#include "test.h"

#include "lwip/priv/tcp_priv.h"

fixture each_test = {pair_begin, pair_end};

/* Takes all places. */
static void fill(void)
{
    int i;

    for (i = 0; i < PLACES; i++) {
        peer_connect(&peers[i]);
        wire_pass(100, serve);
    }
    for (i = 0; i < PLACES; i++)
        assert_int_equal(mbm_lwip_isInUse(&places[i]), 1);
}

/* A peer that has a place is answered. */
static void is_served(peer *one)
{
    one->count = 0;
    peer_ask(one, 5, 2);
    wire_pass(500, serve);
    peer_expects(one, 5, 1, 2);
}

TEST(a_server_without_a_place_resets_a_new_connection_at_once)
{
    fill();
    peer_connect(&peers[PLACES]);
    wire_pass(50, serve);
    assert_int_equal(peers[PLACES].error, ERR_RST);
    assert_int_equal(listener.refused, 1);
    is_served(&peers[0]);
    peer_close(&peers[0]);
    wire_pass(50, serve);
    peer_connect(&peers[PLACES]);
    is_served(&peers[PLACES]);
    assert_int_equal(listener.refused, 1);
}

TEST(the_connection_that_was_idle_for_longest_makes_place)
{
    listener.idleTimeMs = 5000;
    fill();
    wire_pass(1000, serve);
    is_served(&peers[1]);
    wire_pass(6000, serve);
    is_served(&peers[0]);
    peer_connect(&peers[PLACES]);
    is_served(&peers[PLACES]);
    is_served(&peers[0]);
    is_served(&peers[1]);
    assert_int_equal(peers[2].isEnded, 1);
    assert_int_equal(listener.idle, 1);
    assert_int_equal(listener.refused, 0);
    assert_int_equal(ends, 1);
}

TEST(a_connection_that_is_busy_or_not_idle_for_long_enough_keeps_its_place)
{
    listener.idleTimeMs = 5000;
    fill();
    places[0].isBusy = places[1].isBusy = places[2].isBusy = 1;
    wire_pass(6000, serve);
    peer_connect(&peers[PLACES]);
    wire_pass(50, serve);
    assert_int_equal(peers[PLACES].error, ERR_RST);
    places[0].isBusy = places[1].isBusy = places[2].isBusy = 0;
    is_served(&peers[0]);
    is_served(&peers[1]);
    is_served(&peers[2]);
    peer_connect(&peers[PLACES]);
    wire_pass(50, serve);
    assert_int_equal(peers[PLACES].error, ERR_RST);
    assert_int_equal(listener.refused, 2);
    assert_int_equal(listener.idle, 0);
}

TEST(a_byte_that_is_read_or_written_ends_the_idle_time)
{
    const mbm_port reader = mbm_lwip_port(&places[0]), writer = mbm_lwip_port(&places[1]);
    uint8_t byte = 1;
    int i;

    listener.idleTimeMs = 5000;
    for (i = 0; i < PLACES; i++)
        peer_connect(&peers[i]);
    wire_pass(4000, NULL);
    peer_send(&peers[0], "1", 1);
    assert_int_equal(mbm_lwip_accept(&listener), 0);
    assert_int_equal(mbm_lwip_accept(&listener), 1);
    wire_pass(2000, NULL);
    /* The third is idle since it was handed over, and not since it has come. */
    assert_int_equal(mbm_lwip_accept(&listener), 2);
    wire_pass(2000, NULL);
    assert_int_equal(reader.read(reader.context, &byte, 1), 1);
    assert_int_equal(writer.write(writer.context, &byte, 1), 1);
    wire_pass(2000, NULL);
    peer_connect(&peers[PLACES]);
    wire_deliver();
    assert_int_equal(listener.idle, 0);
    assert_int_equal(peers[PLACES].error, ERR_RST);
    wire_pass(2000, NULL);
    peer_connect(&peers[PLACES]);
    wire_deliver();
    assert_int_equal(listener.idle, 1);
    IS(MBM_CONNECT_TIMED_OUT, mbm_lwip_status(&places[2]));
}

TEST(the_program_sees_the_end_of_a_connection_before_the_one_that_takes_its_place)
{
    const mbm_port port = mbm_lwip_port(&places[0]);
    uint8_t byte;

    listener.idleTimeMs = 1000;
    fill();
    wire_pass(2000, NULL);
    peer_connect(&peers[PLACES]);
    peer_ask(&peers[PLACES], 5, 2);
    wire_deliver();
    /* Nothing of the new one before that. */
    assert_int_equal(mbm_lwip_accept(&listener), -1);
    assert_int_equal(mbm_lwip_isInUse(&places[0]), 1);
    assert_int_equal(port.read(port.context, &byte, 1), -1);
    assert_int_equal(port.write(port.context, &byte, 1), -1);
    IS(MBM_CONNECT_TIMED_OUT, mbm_lwip_status(&places[0]));
    assert_int_equal(places[0].error, ERR_TIMEOUT);
    mbm_lwip_close(&places[0]);
    assert_int_equal(mbm_lwip_isInUse(&places[0]), 0);
    assert_int_equal(port.read(port.context, &byte, 1), 0);
    assert_int_equal(port.write(port.context, &byte, 1), 0);
    mbm_lwip_close(&places[0]);
    assert_int_equal(places[0].error, ERR_OK);
    wire_pass(500, serve);
    peer_expects(&peers[PLACES], 5, 1, 2);
}

/* Its client connects again before the server's main loop has seen the end of the first connection.
 */
TEST(a_place_whose_connection_is_lost_is_taken_at_once)
{
    fill();
    peer_reset(&peers[1]);
    wire_deliver();
    peer_connect(&peers[1]);
    is_served(&peers[1]);
    peer_close(&peers[2]);
    wire_deliver();
    peer_connect(&peers[2]);
    is_served(&peers[2]);
    assert_int_equal(listener.refused, 0);
    assert_int_equal(ends, 2);
}

TEST(a_connection_that_ends_before_it_is_handed_over_is_never_seen)
{
    peer_connect(&peers[0]);
    peer_reset(&peers[0]);
    wire_deliver();
    assert_int_equal(mbm_lwip_accept(&listener), -1);
    listener.idleTimeMs = 1000;
    fill();
    wire_pass(2000, NULL);
    peer_connect(&peers[PLACES]);
    peer_reset(&peers[PLACES]);
    wire_deliver();
    /* The one before it was closed. */
    IS(MBM_CONNECT_TIMED_OUT, mbm_lwip_status(&places[0]));
    wire_pass(50, serve);
    assert_int_equal(ends, 1);
    assert_int_equal(mbm_lwip_isInUse(&places[0]), 0);
    peer_connect(&peers[PLACES]);
    is_served(&peers[PLACES]);
}

TEST(a_connection_that_its_peer_has_closed_before_it_is_handed_over_makes_place)
{
    const mbm_port port = mbm_lwip_port(&places[2]);
    uint8_t byte;

    peer_connect(&peers[0]);
    peer_connect(&peers[1]);
    serve();
    peer_connect(&peers[2]);
    peer_close(&peers[2]);
    wire_deliver();
    assert_int_equal(port.read(port.context, &byte, 1), 0);
    peer_connect(&peers[PLACES]);
    is_served(&peers[PLACES]);
    assert_int_equal(listener.refused, 0);
    assert_int_equal(ends, 0);
    /* If no other comes, it is handed over, and then it is lost. */
    peer_close(&peers[0]);
    wire_pass(100, serve);
    peer_connect(&peers[0]);
    peer_close(&peers[0]);
    wire_deliver();
    assert_int_equal(mbm_lwip_accept(&listener), 0);
    IS(MBM_LINK_LOST, mbm_lwip_status(&places[0]));
    assert_int_equal(places[0].error, ERR_CLSD);
}

TEST(a_request_that_its_peer_has_sent_before_it_closed_keeps_the_place)
{
    fill();
    peer_ask(&peers[1], 5, 2);
    assert_int_equal(tcp_shutdown(peers[1].pcb, 0, 1), ERR_OK);
    wire_deliver();
    peer_connect(&peers[PLACES]);
    wire_deliver();
    assert_int_equal(listener.refused, 1);
    wire_pass(500, serve);
    peer_expects(&peers[1], 5, 1, 2);
}

/* lwIP itself has no memory for one more connection. */
TEST(a_connection_that_lwip_has_no_memory_for_closes_an_idle_one)
{
    listener.idleTimeMs = 1000;
    fill();
    wire_pass(2000, serve);
    /* As lwIP calls it. */
    assert_int_equal(((struct tcp_pcb_listen *)listener.pcb)->accept(&listener, NULL, ERR_MEM),
                     ERR_MEM);
    assert_int_equal(listener.shortages, 1);
    assert_int_equal(listener.idle, 1);
    wire_pass(50, serve);
    assert_int_equal(ends, 1);
    assert_int_equal(mbm_lwip_isInUse(&places[0]), 0);
    is_served(&peers[1]);
}

/* lwIP tries for minutes to end a connection whose peer is gone. With a fixed number of control
 * blocks, as in `make check-real KIT=lwip`, a new connection takes that of such a one. */
TEST(connections_to_peers_that_are_gone_make_way_in_lwip)
{
    int i;

    listener.idleTimeMs = 1;
    fill();
    for (i = 0; i < 40; i++) {
        /* It vanishes without a word. */
        the_wire.isCut = 1;
        peer_reset(&peers[i % PLACES]);
        wire_pass(2, serve);
        the_wire.isCut = 0;
        peer_connect(&peers[i % PLACES]);
        the_wire.isCut = 1; /* nothing of what lwIP sends for the others arrives */
        serve();
        the_wire.isCut = 0;
        assert_int_equal(peers[i % PLACES].isConnected, 1);
        assert_int_equal(peers[i % PLACES].error, ERR_OK);
    }
    assert_int_equal(listener.refused, 0);
    assert_int_equal(listener.idle, 40);
}

TEST(a_thousand_connections_one_after_the_other_leave_nothing_behind)
{
    int i;

    for (i = 0; i < 1000; i++) {
        peer_connect(&peers[0]);
        is_served(&peers[0]);
        if (i % 2)
            peer_reset(&peers[0]);
        else
            peer_close(&peers[0]);
        wire_pass(50, serve);
    }
    assert_int_equal(ends, 1000);
    assert_int_equal(listener.refused, 0);
    assert_null(tcp_active_pcbs);
}

TEST(a_listener_that_is_closed_keeps_the_connections_that_were_handed_over)
{
    peer_connect(&peers[0]);
    wire_pass(50, serve);
    peer_connect(&peers[1]);
    mbm_lwip_closeListener(&listener);
    wire_deliver();
    assert_true(peers[1].isEnded);
    is_served(&peers[0]);
    peer_connect(&peers[2]);
    assert_int_equal(peers[2].error, ERR_RST);
    /* It begins again while connections of its TCP port are there. */
    IS(MBM_BUSY, mbm_lwip_listen(&listener, NULL, PORT, places, PLACES));
    mbm_lwip_close(&places[0]);
    wire_deliver();
    /* lwIP without SO_REUSE remembers a connection for two minutes. */
    if (!SO_REUSE)
        wire_pass(2 * TCP_MSL + 1000, NULL);
    OK(mbm_lwip_listen(&listener, NULL, PORT, places, PLACES));
    peer_connect(&peers[1]);
    is_served(&peers[1]);
}

TEST(a_tcp_port_that_is_taken_is_refused)
{
    static mbm_lwip_listener other;
    static mbm_lwip place;

    int i;

    for (i = 0; i < 50; i++) {
        IS(MBM_LINK_LOST, mbm_lwip_listen(&other, NULL, PORT, &place, 1));
        assert_int_equal(other.error, ERR_USE);
    }
    assert_string_equal(mbm_lwip_text(other.error), "the TCP port is taken");
    failing_connections = 1;
    IS(MBM_LINK_LOST, mbm_lwip_listen(&other, NULL, 503, &place, 1));
    assert_int_equal(other.error, ERR_MEM);
    OK(mbm_lwip_listen(&other, NULL, 503, &place, 1));
    mbm_lwip_closeListener(&other);
}
