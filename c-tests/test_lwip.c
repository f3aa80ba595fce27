/* The port for lwIP's raw API, client and server, over Debian's lwIP and a wire in memory: bytes
 * that come in other pieces than frames, and bytes that lwIP or the peer does not take. */
#include "lwip_pair.h"
#include "test.h"

#include "lwip/priv/tcp_priv.h"

fixture each_test = {pair_begin, pair_end};

TEST(a_client_reads_what_a_server_has)
{
    client_connect();
    client_reads();
    client_reads();
}

#if LWIP_IPV6
TEST(a_client_reads_over_ipv6_what_a_server_has)
{
    IS(MBM_PENDING, mbm_lwip_open(&device, &the_wire.far6, PORT));
    client_start();
    client_reads();
    assert_int_equal(IP_GET_TYPE(&places[0].pcb->remote_ip), IPADDR_TYPE_V6);
    wire_unplug();
    client_queue(1);
    wire_pass(100, only_poll);
    IS(MBM_LINK_LOST, request.status);
    assert_int_equal(device.error, ERR_RTE);
    wire_plug();
    IS(MBM_PENDING, mbm_lwip_connect(&device));
    client_reads();
}
#endif

/* Requests and responses too: the header of a packet, then a first and further pbufs. */
TEST(a_chain_of_pbufs_may_be_split_at_every_byte)
{
    client_connect();
    for (the_wire.first = 1; the_wire.first <= 259; the_wire.first++)
        client_reads();
    the_wire.first = 1;
    for (the_wire.others = 1; the_wire.others <= 20; the_wire.others++)
        client_reads();
}

TEST(two_requests_in_one_pbuf_are_both_answered)
{
    uint8_t both[2 * FRAME] = {0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0, 5,
                               0, 2, 0, 0, 0, 6, 1, 3, 0, 0, 0, 5};

    peer_connect(&peers[0]);
    peer_send(&peers[0], both, sizeof both);
    wire_pass(500, serve);
    peer_expects(&peers[0], 1, 2, 5);
}

TEST(half_a_request_waits_for_its_rest)
{
    const uint8_t bytes[FRAME] = {0, 9, 0, 0, 0, 6, 1, 3, 0, 0, 0, 7};
    uint16_t part;

    peer_connect(&peers[0]);
    for (part = 1; part < FRAME; part++) {
        peers[0].count = 0;
        peer_send(&peers[0], bytes, part);
        wire_pass(500, serve);
        assert_int_equal(peers[0].count, 0);
        peer_send(&peers[0], bytes + part, (uint16_t)(FRAME - part));
        wire_pass(500, serve);
        peer_expects(&peers[0], 9, 1, 7);
    }
}

TEST(a_request_that_is_cut_off_by_the_end_is_not_carried_out)
{
    const uint8_t bytes[FRAME] = {0, 9, 0, 0, 0, 6, 1, 6, 0, 0, 0xAA, 0xAA};

    peer_connect(&peers[0]);
    peer_send(&peers[0], bytes, FRAME - 1);
    peer_close(&peers[0]);
    wire_pass(500, serve);
    assert_int_equal(words[0], 7);
    assert_int_equal(ends, 1);
    assert_false(mbm_lwip_isInUse(&places[0]));
}

TEST(a_write_that_lwip_has_no_memory_for_is_made_later)
{
    client_connect();
    failing_writes = 5;
    client_reads();
    assert_int_equal(failing_writes, 0);
    /* Nothing is sent twice: the server has seen one request, the client one response. */
    assert_int_equal(writes, 7);
}

TEST(responses_leave_in_order_when_lwip_has_memory_only_now_and_then)
{
    uint16_t i, count = 0;

    peer_connect(&peers[0]);
    for (i = 0; i < 400; i++) {
        failing_writes = 0;
        if (i < 200 && peer_canAsk(&peers[0]))
            peer_ask(&peers[0], count++, 125);
        failing_writes = i % 3;
        wire_pass(10, serve);
    }
    failing_writes = 0;
    /* lwIP may have dropped requests that no pbuf was left for, and the peer sends them again. */
    wire_pass(60000, serve);
    assert_true(count > 50);
    peer_expects(&peers[0], 0, count, 125);
}

/* What a server does not read closes the window of its peer, and nothing is lost. */
TEST(the_window_is_given_back_only_as_bytes_are_read)
{
    static uint8_t sent[0x18000], got[sizeof sent];
    const mbm_port port = mbm_lwip_port(&places[0]);
    uint32_t left = sizeof sent, i, at = 0;

    for (i = 0; i < sizeof sent; i++)
        sent[i] = (uint8_t)(i * 7 + (i >> 8));
    peer_connect(&peers[0]);
    assert_int_equal(mbm_lwip_accept(&listener), 0);
    for (i = 0; i < 4000 && at < sizeof sent; i++) {
        const uint16_t room = (uint16_t)LWIP_MIN(tcp_sndbuf(peers[0].pcb), left);

        if (room > 0 && tcp_write(peers[0].pcb, sent + sizeof sent - left, room, 0) == ERR_OK)
            left -= room;
        tcp_output(peers[0].pcb);
        wire_pass(50, NULL);
        if (i == 100) {
            assert_true(left > 0);
            /* Five seconds, and nothing was read. */
            assert_int_equal(
                places[0].pcb->rcv_wnd,
                TCP_WND - places[0].received->tot_len -
                    (places[0].pcb->refused_data ? places[0].pcb->refused_data->tot_len : 0));
            assert_true(pbuf_clen(places[0].received) <= MBM_LWIP_PBUFS);
        }
        if (i >= 100) {
            const int16_t count = port.read(port.context, got + at, 300);

            assert_true(count >= 0);
            at += (uint16_t)count;
        }
    }
    assert_int_equal(at, sizeof sent);
    assert_memory_equal(got, sent, sizeof sent);
}

TEST(small_segments_take_a_bounded_number_of_pbufs)
{
    uint16_t count = 0, most = 0;

    peer_connect(&peers[0]);
    wire_pass(50, serve);
    while (count < 100) {
        for (; count < 100 && peer_canAsk(&peers[0]); count++) {
            peer_ask(&peers[0], count, 2);
            wire_deliver();
        }
        most = LWIP_MAX(most, places[0].received ? pbuf_clen(places[0].received) : 0);
        wire_pass(50, NULL);
        if (!peer_canAsk(&peers[0]))
            wire_pass(5000, serve);
    }
    assert_true(most > 1);
    assert_true(most <= MBM_LWIP_PBUFS);
    wire_pass(30000, serve);
    peer_expects(&peers[0], 0, 100, 2);
}

/* More than windows and buffers of both ends hold. */
TEST(responses_to_a_peer_that_reads_late_are_all_sent)
{
    uint16_t count;

    peer_connect(&peers[0]);
    count = peer_askDeaf(&peers[0], serve);
    wire_pass(5000, serve);
    assert_true(places[0].flags & MBM_LWIP_WAITS);
    assert_true(peers[0].count < count * 259u);
    tcp_recved(peers[0].pcb, (u16_t)peers[0].count);
    peers[0].isDeaf = 0;
    wire_pass(20000, serve);
    peer_expects(&peers[0], 0, count, 125);
}

TEST(a_peer_that_never_reads_is_given_up_and_harms_no_other)
{
    peer_connect(&peers[0]);
    client_connect();
    (void)peer_askDeaf(&peers[0], serve);
    client_reads();
    assert_true(mbm_lwip_isInUse(&places[0]));
    wire_pass(MBM_LWIP_UNACKNOWLEDGED_MS + 10000, serve);
    assert_false(mbm_lwip_isInUse(&places[0]));
    /* It hears so when it sends. */
    if (peers[0].pcb && peer_canAsk(&peers[0]))
        peer_ask(&peers[0], 0, 1);
    wire_pass(120000, serve);
    assert_int_equal(peers[0].error, ERR_RST);
    client_reads();
}

TEST(a_peer_that_says_it_sends_no_more_still_gets_its_response)
{
    peer_connect(&peers[0]);
    peer_ask(&peers[0], 3, 4);
    assert_int_equal(tcp_shutdown(peers[0].pcb, 0, 1), ERR_OK);
    wire_pass(500, serve);
    peer_expects(&peers[0], 3, 1, 4);
    assert_true(peers[0].isEnded);
    assert_int_equal(ends, 1);
}

TEST(a_response_that_was_written_before_close_still_leaves)
{
    const mbm_port port = mbm_lwip_port(&places[0]);

    peer_connect(&peers[0]);
    assert_int_equal(mbm_lwip_accept(&listener), 0);
    assert_int_equal(port.write(port.context, (const uint8_t *)"12345", 5), 5);
    mbm_lwip_close(&places[0]);
    wire_pass(500, NULL);
    assert_int_equal(peers[0].count, 5);
    assert_true(peers[0].isEnded);
}

TEST(a_second_write_leaves_before_the_first_is_acknowledged)
{
    const mbm_port port = mbm_lwip_port(&places[0]);

    peer_connect(&peers[0]);
    assert_int_equal(mbm_lwip_accept(&listener), 0);
    assert_int_equal(port.write(port.context, (const uint8_t *)"1", 1), 1);
    assert_int_equal(wire_underWay(), 1);
    assert_int_equal(port.write(port.context, (const uint8_t *)"2", 1), 1);
    assert_int_equal(wire_underWay(), 2);
}

TEST(bytes_that_came_before_a_reset_can_be_read)
{
    const mbm_port port = mbm_lwip_port(&places[0]);
    uint8_t bytes[10];

    peer_connect(&peers[0]);
    assert_int_equal(mbm_lwip_accept(&listener), 0);
    peer_send(&peers[0], "12345", 5);
    wire_deliver();
    peer_reset(&peers[0]);
    wire_deliver();
    assert_int_equal(port.read(port.context, bytes, 3), 3);
    assert_int_equal(port.read(port.context, bytes + 3, 7), 2);
    assert_memory_equal(bytes, "12345", 5);
    assert_int_equal(port.read(port.context, bytes, 10), -1);
    assert_int_equal(places[0].error, ERR_RST);
}

TEST(several_clients_get_each_its_own_answers)
{
    uint16_t i, j;

    for (j = 0; j < PLACES; j++)
        peer_connect(&peers[j]);
    for (i = 0; i < 50; i++) {
        for (j = 0; j < PLACES; j++)
            peer_ask(&peers[j], (uint16_t)(1000 * j + i), (uint8_t)(j + 1));
        wire_pass(20, serve);
    }
    for (j = 0; j < PLACES; j++)
        peer_expects(&peers[j], (uint16_t)(1000 * j), 50, (uint8_t)(j + 1));
}

/* Chance decides how many bytes each end sends and reads, in which pbufs they come, and when lwIP
 * has no memory. What is read is what was sent, in its order. */
TEST(any_pieces_in_any_order_are_the_same_stream)
{
    enum { BYTES = 60000 };
    static uint8_t got[2][BYTES];
    const mbm_port ports[2] = {mbm_lwip_port(&device), mbm_lwip_port(&places[0])};
    uint32_t sent[2] = {0, 0}, read[2] = {0, 0}, seed = 1, i, rounds;
    uint8_t bytes[2000];

    client_connect();
    assert_int_equal(mbm_lwip_accept(&listener), 0);
    for (rounds = 0; rounds < 200000 && (read[0] < BYTES || read[1] < BYTES); rounds++) {
        uint16_t length;
        int end, got_now;

        seed = seed * 1664525 + 1013904223;
        end = (int)(seed >> 31);
        length = (uint16_t)(1 + (seed >> 8) % ((seed >> 20) % 8 ? 30 : 1500));
        the_wire.first = (uint16_t)((seed >> 24) % 20);
        the_wire.others = (uint16_t)((seed >> 16) % 40);
        failing_writes = (seed >> 12) % 7 == 0;
        if ((seed >> 5) % 2) {
            length = (uint16_t)LWIP_MIN(length, BYTES - sent[end]);
            for (i = 0; i < length; i++)
                bytes[i] = (uint8_t)((sent[end] + i) * 7 + ((sent[end] + i) >> 8));
            got_now = ports[end].write(ports[end].context, bytes, length);
            assert_true(got_now >= 0);
            sent[end] += (uint32_t)got_now;
        } else {
            length = (uint16_t)LWIP_MIN(length, BYTES - read[end]);
            got_now = ports[end].read(ports[end].context, got[end] + read[end], length);
            assert_true(got_now >= 0);
            read[end] += (uint32_t)got_now;
        }
        if ((seed >> 3) % 3 == 0)
            wire_pass((seed >> 10) % 4 ? 1 : 300, NULL);
    }
    for (i = 0; i < BYTES; i++) {
        assert_int_equal(got[0][i], (uint8_t)(i * 7 + (i >> 8)));
        assert_int_equal(got[1][i], (uint8_t)(i * 7 + (i >> 8)));
    }
}

TEST(twenty_thousand_requests_and_ten_resets)
{
    static mbm_link kept;
    const mbm_linkHooks hooks = mbm_lwip_link(&device);
    uint32_t resets = 0, i;

    client_start();
    IS(MBM_PENDING, mbm_lwip_open(&device, &the_wire.far, PORT));
    memset(&kept, 0, sizeof kept);
    OK(mbm_link_begin(&kept, &client, &hooks));
    OK(mbm_link_setRequestsWait(&kept, 1));
    for (i = 0; i < 20000; i++) {
        client_reads();
        if (i % 2000 == 1000) {
            int j;

            for (j = 0; j < PLACES; j++)
                mbm_lwip_disconnect(&places[j]);
            resets++;
        }
    }
    assert_int_equal(resets, 10);
}
