/* TLS over a wire in memory that is slow, full, cut or lies: what crosses it, and what the
 * port says. */
#define _GNU_SOURCE
#include "test.h"
#include "tls_pair.h"

enum { FIRST = 100, WORDS = 125 };

static tls_pair pair;
static mbm_server server;
static mbm_client client;
static mbm_unit unit;
static mbm_registerTable holding;
static uint16_t words[WORDS], read_words[WORDS];
static uint8_t frame[2 * MBM_MAX_TCP_FRAME], incoming[600], outgoing[600];
static mbm_clientRequest request;

static const uint8_t secret[] = "Modbus in the clear";

static void begin(void)
{
    tls_pair_begin(&pair, "operator", "server");
    memset(&unit, 0, sizeof unit);
    holding = (mbm_registerTable){.words = words, .base = FIRST, .size = WORDS};
    for (unsigned i = 0; i < WORDS; i++)
        words[i] = (uint16_t)(0xA55A ^ i);
    unit.id = 17;
    OK(mbm_unit_serveHoldingRegisters(&unit, &holding));
    request = (mbm_clientRequest){.unit = 17, .reply = read_words, .replyBytes = sizeof read_words};
    OK(mbm_client_beginTcp(&client, &pair.client.port, incoming, sizeof incoming, outgoing,
                           sizeof outgoing));
    OK(mbm_server_beginTcp(&server, &pair.server.port, &unit, 1, frame, sizeof frame));
}

static void end(void)
{
    tls_pair_end(&pair);
}

fixture each_test = {begin, end};

/* Polls client and server, and nothing else, until the request has ended. */
static void exchange(void)
{
    unsigned rounds = 0;

    while (request.status == MBM_PENDING) {
        if (rounds++ == 200000)
            fail_msg("the request does not end: client %u, server %u", pair.client.tls.status,
                     pair.server.tls.status);
        (void)mbm_client_poll(&client);
        (void)mbm_server_poll(&server);
    }
}

static void read_all_words(void)
{
    memset(read_words, 0, sizeof read_words);
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &request, FIRST, WORDS));
    exchange();
    OK(request.status);
    assert_memory_equal(read_words, words, sizeof words);
}

static int16_t send_from(tls_end *one, const void *bytes, size_t length)
{
    return one->port.write(one->port.context, (const uint8_t *)bytes, (uint16_t)length);
}

static int16_t read_at(tls_end *one, void *bytes, size_t capacity)
{
    return one->port.read(one->port.context, (uint8_t *)bytes, (uint16_t)capacity);
}

static void assert_over(tls_end *one, uint8_t status)
{
    uint8_t byte = 0;

    assert_int_equal(one->tls.status, status);
    assert_true(send_from(one, &byte, 1) < 0);
    assert_true(read_at(one, &byte, 1) < 0);
    assert_int_equal(mbm_tls_poll(&one->tls), status);
    assert_null(mbm_tls_role(&one->tls));
}

TEST(a_request_is_answered_and_does_not_cross_the_wire_in_the_clear)
{
    read_all_words();
    assert_int_equal(pair.client.tls.status, MBM_TLS_OPEN);
    assert_int_equal(pair.server.tls.status, MBM_TLS_OPEN);
    assert_string_equal(mbm_tls_role(&pair.server.tls), "Operator");
    assert_null(mbm_tls_role(&pair.client.tls));
    assert_false(tls_lane_carried(&pair.to_server, "\x11\x03\x00\x64\x00\x7D", 6));
    assert_false(tls_lane_carried(&pair.to_client, words, 4));
}

TEST(the_handshake_and_requests_pass_in_pieces_of_one_byte)
{
    pair.to_server.piece = pair.to_client.piece = 1;
    read_all_words();
    read_all_words();
}

/* The wire holds few bytes, so each message waits for space in its middle. */
TEST(a_wire_that_is_often_full_delays_everything_and_breaks_nothing)
{
    for (unsigned i = 1; i < 60; i += (unsigned)tls_step(19, 40)) {
        pair.to_server.capacity = pair.to_client.capacity = i;
        tls_pair_open(&pair, NULL);
        OK(mbm_client_reconnect(&client, NULL));
        OK(mbm_server_beginTcp(&server, &pair.server.port, &unit, 1, frame, sizeof frame));
        read_all_words();
    }
}

TEST(the_port_moves_no_byte_before_the_handshake_is_over)
{
    uint8_t byte;

    assert_int_equal(send_from(&pair.client, secret, sizeof secret), 0);
    assert_int_equal(read_at(&pair.client, &byte, 1), 0);
    assert_int_equal(send_from(&pair.server, secret, sizeof secret), 0);
    assert_int_equal(read_at(&pair.server, &byte, 1), 0);
    assert_int_equal(pair.client.tls.status, MBM_TLS_HANDSHAKE);
    assert_null(mbm_tls_role(&pair.server.tls));
    tls_pair_run(&pair);
    assert_int_equal(pair.client.tls.status, MBM_TLS_OPEN);
    assert_false(tls_lane_carried(&pair.to_server, secret, 6));
    assert_false(tls_lane_carried(&pair.to_client, secret, 6));
}

TEST(a_long_write_is_accepted_in_parts_while_the_wire_is_full)
{
    static uint8_t sent[3000], received[3000];
    size_t accepted = 0, have = 0;
    int16_t count;

    for (unsigned i = 0; i < sizeof sent; i++)
        sent[i] = (uint8_t)(i * 7);
    tls_pair_run(&pair);
    pair.to_server.capacity = 100;
    while (have < sizeof sent) {
        count = send_from(&pair.client, sent + accepted, sizeof sent - accepted);
        assert_in_range(count, 0, MBM_MAX_TCP_FRAME);
        accepted += (size_t)count;
        /* Accepted bytes are sent without further writes. */
        assert_int_equal(pair.client.port.flush(pair.client.port.context),
                         pair.client.tls.toSend == 0);
        count = read_at(&pair.server, received + have, sizeof received - have);
        assert_true(count >= 0);
        have += (size_t)count;
    }
    assert_memory_equal(received, sent, sizeof sent);
    pair.to_server.capacity = TLS_LANE;
    assert_int_equal(send_from(&pair.client, sent, sizeof sent), sizeof sent);
    assert_int_equal(pair.client.port.flush(pair.client.port.context), 1);
}

/* One record has more bytes than the reader takes: no byte below would wake it for the rest. */
TEST(bytes_that_stay_in_the_port_are_due_at_once_and_are_told_once)
{
    uint8_t part[8];

    tls_pair_run(&pair);
    assert_int_equal(mbm_tls_pollDelay(&pair.server.tls), UINT32_MAX);
    assert_int_equal(send_from(&pair.client, secret, 20), 20);
    assert_int_equal(read_at(&pair.server, part, 8), 8);
    assert_int_equal(pair.to_server.count, 0);
    assert_int_equal(mbm_tls_pollDelay(&pair.server.tls), 0);
    assert_int_equal(mbm_tls_pollDelay(&pair.server.tls), UINT32_MAX);
    assert_int_equal(read_at(&pair.server, part, 8), 8);
    assert_int_equal(mbm_tls_pollDelay(&pair.server.tls), 0);
    assert_int_equal(read_at(&pair.server, part, 8), 4);
    assert_memory_equal(part, secret + 16, 4);
    assert_int_equal(mbm_tls_pollDelay(&pair.server.tls), UINT32_MAX);
}

/* No byte below reports the requests that are left after one poll. */
TEST(requests_in_one_record_are_answered_in_turn)
{
    static const uint8_t one[] = {0, 1, 0, 0, 0, 6, 17, 3, 0, FIRST, 0, 1};
    uint8_t all[20 * sizeof one], reply[11];

    tls_pair_run(&pair);
    for (unsigned i = 0; i < 20; i++) {
        memcpy(all + i * sizeof one, one, sizeof one);
        all[i * sizeof one + 1] = (uint8_t)i;
    }
    assert_int_equal(send_from(&pair.client, all, sizeof all), sizeof all);
    OK(mbm_server_poll(&server));
    while (mbm_tls_pollDelay(&pair.server.tls) == 0)
        OK(mbm_server_poll(&server));
    for (unsigned i = 0; i < 20; i++) {
        assert_int_equal(read_at(&pair.client, reply, sizeof reply), sizeof reply);
        assert_int_equal(reply[1], i);
        assert_int_equal(reply[9] << 8 | reply[10], words[0]);
    }
}

TEST(a_poll_keeps_the_bytes_that_arrive)
{
    uint8_t bytes[20];

    tls_pair_run(&pair);
    assert_int_equal(send_from(&pair.client, secret, 20), 20);
    assert_int_equal(mbm_tls_poll(&pair.server.tls), MBM_TLS_OPEN);
    assert_int_equal(mbm_tls_poll(&pair.server.tls), MBM_TLS_OPEN);
    assert_int_equal(read_at(&pair.server, bytes, sizeof bytes), 20);
    assert_memory_equal(bytes, secret, 20);
}

TEST(a_peer_that_is_silent_in_the_handshake_is_given_up_in_time)
{
    assert_int_equal(mbm_tls_poll(&pair.server.tls), MBM_TLS_HANDSHAKE);
    assert_int_equal(mbm_tls_pollDelay(&pair.server.tls), TLS_HANDSHAKE_US);
    pair.now -= 65000; /* the clock steps back */
    assert_int_equal(mbm_tls_poll(&pair.server.tls), MBM_TLS_HANDSHAKE);
    assert_int_equal(mbm_tls_pollDelay(&pair.server.tls), TLS_HANDSHAKE_US);
    pair.now += 65000;
    pair.now += TLS_HANDSHAKE_US - 1;
    assert_int_equal(mbm_tls_poll(&pair.server.tls), MBM_TLS_HANDSHAKE);
    assert_int_equal(mbm_tls_pollDelay(&pair.server.tls), 1);
    pair.now++;
    assert_int_equal(mbm_tls_pollDelay(&pair.server.tls), 0);
    assert_int_equal(mbm_tls_poll(&pair.server.tls), MBM_TLS_TIMED_OUT);
    assert_int_equal(mbm_tls_pollDelay(&pair.server.tls), UINT32_MAX);
    assert_over(&pair.server, MBM_TLS_TIMED_OUT);
}

/* The client is gone after each number of bytes that it sends in a handshake. */
TEST(a_peer_that_is_gone_in_the_handshake_is_a_lost_link)
{
    unsigned polls;

    tls_pair_run(&pair);
    size_t whole = pair.to_server.moved;
    assert_true(whole > 500);
    for (size_t cut = 0; cut < whole - 100; cut += tls_step(151, 500)) {
        tls_pair_open(&pair, NULL);
        for (polls = 0; polls < 100 && !pair.to_server.is_cut; polls++) {
            (void)mbm_tls_poll(&pair.client.tls);
            pair.to_server.is_cut = pair.to_server.moved >= cut;
            if (pair.to_server.is_cut)
                pair.to_server.count -= pair.to_server.moved - cut;
            (void)mbm_tls_poll(&pair.server.tls);
        }
        while (pair.server.tls.status == MBM_TLS_HANDSHAKE && polls++ < 200)
            (void)mbm_tls_poll(&pair.server.tls);
        assert_over(&pair.server, MBM_TLS_LINK_LOST);
    }
}

/* A message may take a long computation. Between two, the program can poll other connections. */
TEST(one_poll_takes_the_handshake_on_by_one_message)
{
    unsigned polls = 0;

    (void)mbm_tls_poll(&pair.client.tls);
    (void)mbm_tls_poll(&pair.server.tls);
    assert_int_equal(mbm_tls_progress(&pair.server.tls), MBM_TLS_GREETED);
    assert_int_equal(pair.to_client.moved, 0);
    while (mbm_tls_pollDelay(&pair.server.tls) == 0) {
        /* pollDelay says so once: a program that does not poll the connection sleeps. */
        assert_int_equal(mbm_tls_pollDelay(&pair.server.tls), TLS_HANDSHAKE_US);
        (void)mbm_tls_poll(&pair.server.tls);
        polls++;
    }
    /* ServerHello, Certificate, ServerKeyExchange, CertificateRequest, ServerHelloDone. */
    assert_in_range(polls, 5, 7);
    tls_pair_run(&pair);
    assert_int_equal(pair.server.tls.status, MBM_TLS_OPEN);
    assert_int_equal(mbm_tls_progress(&pair.server.tls), MBM_TLS_PROVEN);
}

TEST(a_peer_that_ends_the_session_is_told_from_a_lost_link)
{
    tls_pair_run(&pair);
    assert_int_equal(mbm_tls_shutDown(&pair.client.tls), MBM_TLS_CLOSED);
    assert_over(&pair.client, MBM_TLS_CLOSED);
    assert_int_equal(mbm_tls_poll(&pair.server.tls), MBM_TLS_PEER_CLOSED);
    assert_over(&pair.server, MBM_TLS_PEER_CLOSED);

    tls_pair_open(&pair, NULL);
    tls_pair_run(&pair);
    pair.to_server.is_cut = 1;
    assert_int_equal(mbm_tls_poll(&pair.server.tls), MBM_TLS_LINK_LOST);
    assert_over(&pair.server, MBM_TLS_LINK_LOST);
    assert_int_equal(mbm_tls_shutDown(&pair.server.tls), MBM_TLS_LINK_LOST);
}

TEST(the_end_of_the_session_waits_for_a_full_wire)
{
    uint8_t bytes[20];

    tls_pair_run(&pair);
    pair.to_server.capacity = 10;
    assert_int_equal(send_from(&pair.client, secret, 20), 20);
    assert_int_equal(mbm_tls_shutDown(&pair.client.tls), MBM_TLS_CLOSING);
    assert_true(send_from(&pair.client, secret, 1) < 0);
    pair.to_server.capacity = 60;
    assert_int_equal(mbm_tls_poll(&pair.client.tls), MBM_TLS_CLOSING);
    pair.to_server.capacity = TLS_LANE;
    assert_int_equal(mbm_tls_poll(&pair.client.tls), MBM_TLS_CLOSED);
    /* Bytes that were accepted before the end arrive, then the end does. */
    assert_int_equal(read_at(&pair.server, bytes, sizeof bytes), 20);
    assert_memory_equal(bytes, secret, 20);
    assert_true(read_at(&pair.server, bytes, sizeof bytes) < 0);
    assert_int_equal(pair.server.tls.status, MBM_TLS_PEER_CLOSED);
}

/* A byte in each part of a record is changed: none of its plain text comes out. */
TEST(a_forged_record_ends_the_session)
{
    uint8_t bytes[64];
    size_t i, length = 1;

    for (i = 0; i < length; i += tls_step(6, 24)) {
        tls_pair_open(&pair, NULL);
        tls_pair_run(&pair);
        assert_int_equal(send_from(&pair.client, secret, 20), 20);
        length = pair.to_server.count;
        pair.to_server.bytes[pair.to_server.from + i] ^= 0x20;
        /* A longer record is waited for, until the link is lost. */
        pair.to_server.is_cut = 1;
        assert_true(read_at(&pair.server, bytes, sizeof bytes) < 0);
        assert_true(pair.server.tls.status == MBM_TLS_BAD_STREAM ||
                    pair.server.tls.status == MBM_TLS_LINK_LOST);
        assert_over(&pair.server, pair.server.tls.status);
    }
    assert_in_range(length, 40, 60);
}

TEST(a_record_that_is_sent_twice_ends_the_session)
{
    uint8_t bytes[64], copy[64];

    tls_pair_run(&pair);
    assert_int_equal(send_from(&pair.client, secret, 20), 20);
    size_t length = pair.to_server.count;
    assert_true(length <= sizeof copy);
    memcpy(copy, pair.to_server.bytes + pair.to_server.from, length);
    assert_int_equal(read_at(&pair.server, bytes, sizeof bytes), 20);
    memcpy(pair.to_server.bytes, copy, length);
    pair.to_server.count = length;
    assert_true(read_at(&pair.server, bytes, sizeof bytes) < 0);
    assert_over(&pair.server, MBM_TLS_BAD_STREAM);
}

TEST(a_plain_request_is_not_served)
{
    static const uint8_t plain[] = {0, 1, 0, 0, 0, 6, 17, 3, 0, FIRST, 0, 1};

    memcpy(pair.to_server.bytes, plain, sizeof plain);
    pair.to_server.count = sizeof plain;
    (void)mbm_server_poll(&server);
    assert_over(&pair.server, MBM_TLS_NOT_TLS);
    IS(MBM_LINK_LOST, mbm_server_poll(&server));
    /* An alert of 7 bytes is all that may have been sent. */
    assert_true(pair.to_client.moved <= 7);
}

static int connects;
static uint8_t connect_status;

static void cut(void *context)
{
    pair.to_server.is_cut = pair.to_client.is_cut = 1;
}

static uint8_t join(void *context)
{
    connects++;
    pair.to_server.is_cut = pair.to_client.is_cut = 0;
    pair.to_server.count = pair.to_client.count = 0;
    pair.to_server.from = pair.to_client.from = 0;
    return connect_status;
}

TEST(a_client_connects_anew_with_a_new_handshake)
{
    const mbm_linkHooks below = {.disconnect = cut, .connect = join};
    const mbm_linkHooks link = {
        .context = &pair.client.tls, .disconnect = mbm_tls_disconnect, .connect = mbm_tls_connect};

    connects = 0;
    connect_status = MBM_PENDING;
    mbm_tls_close(&pair.client.tls);
    pair.client.tls.link = below;
    for (unsigned i = 0; i < 3; i++) {
        mbm_port own = {.context = &pair.client,
                        .micros = pair.client.tls.below.micros,
                        .read = pair.client.tls.below.read,
                        .write = pair.client.tls.below.write};

        if (i == 0)
            assert_int_equal(
                mbm_tls_open(&pair.client.tls, &pair.client_identity, &own, "localhost", &below),
                MBM_TLS_HANDSHAKE);
        else
            IS(MBM_PENDING, mbm_client_reconnect(&client, &link));
        tls_pair_open_end(&pair, &pair.server, NULL);
        OK(mbm_server_beginTcp(&server, &pair.server.port, &unit, 1, frame, sizeof frame));
        read_all_words();
        mbm_tls_close(&pair.server.tls);
        tls_pair_run(&pair);
        assert_int_equal(pair.client.tls.status, MBM_TLS_PEER_CLOSED);
    }
    assert_int_equal(connects, 2);
    connect_status = MBM_LINK_LOST;
    IS(MBM_LINK_LOST, mbm_client_reconnect(&client, &link));
    assert_over(&pair.client, MBM_TLS_LINK_LOST);
}

TEST(calls_out_of_order_are_refused_and_change_nothing)
{
    const mbm_port none = {0};
    mbm_tls zero = {0};
    mbm_port port = mbm_tls_port(&zero), below = pair.client.tls.below;
    uint8_t byte;

    assert_true(port.read(&zero, &byte, 1) < 0 && port.write(&zero, &byte, 1) < 0);
    assert_int_equal(port.micros(&zero), 0);
    assert_int_equal(port.flush(&zero), 1);
    assert_int_equal(mbm_tls_poll(&zero), MBM_TLS_CLOSED);
    assert_int_equal(mbm_tls_shutDown(&zero), MBM_TLS_CLOSED);
    assert_int_equal(mbm_tls_pollDelay(&zero), UINT32_MAX);
    assert_null(mbm_tls_role(&zero));
    mbm_tls_close(&zero);
    mbm_tls_disconnect(&zero);
    IS(MBM_LINK_LOST, mbm_tls_connect(&zero));
    assert_int_equal(mbm_tls_open(&zero, &pair.client_identity, &none, NULL, NULL),
                     MBM_TLS_INVALID_ARGUMENT);
    assert_int_equal(mbm_tls_open(&zero, &pair.server_identity, &below, "localhost", NULL),
                     MBM_TLS_INVALID_ARGUMENT);
    assert_int_equal(mbm_tls_open(&zero, &(mbm_tls_identity){0}, &below, NULL, NULL),
                     MBM_TLS_INVALID_ARGUMENT);
    assert_int_equal(zero.isSetUp, 0);
    tls_pair_run(&pair);
    assert_int_equal(tls_pair_open_end(&pair, &pair.client, NULL), MBM_TLS_IN_USE);
    assert_int_equal(pair.client.tls.status, MBM_TLS_OPEN);
    read_all_words();
    mbm_tls_close(&pair.client.tls);
    mbm_tls_close(&pair.client.tls);
    assert_over(&pair.client, MBM_TLS_CLOSED);
}

TEST(every_status_has_a_text)
{
    for (unsigned i = 0; i <= MBM_TLS_AUTHORITY_NOT_YET_VALID; i++)
        assert_string_not_equal(mbm_tls_text((uint8_t)i), "unknown status");
    assert_string_equal(mbm_tls_text(MBM_TLS_AUTHORITY_NOT_YET_VALID + 1), "unknown status");
    assert_string_equal(mbm_tls_alertText(48), "unknown ca");
    assert_string_equal(mbm_tls_alertText(255), "unknown alert");
}
