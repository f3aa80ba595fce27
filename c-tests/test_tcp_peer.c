/* Checks on a plain socket that the TCP peer plays each fault, so that a failure in the
 * tests of clients is the client's fault. */
#define _GNU_SOURCE
#include "await.h"
#include "skip.h"
#include "tcp_peer.h"
#include "tcp_server.h"
#include "test.h"

#include <errno.h>
#include <linux/tcp.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

/* REPLY: bytes of a reply of one register. HELD_MS: how long a reply waits for others. */
enum { SHORT_MS = 40, REPLY = 11, HELD_MS = 250 };

static tcp_peer *peer;
static uint16_t port;
static int s;

static void begin(void)
{
    peer = tcp_peer_new();
    port = tcp_peer_start(peer, 0);
    s = tcp_connectTo(port);
}

static void end(void)
{
    close(s);
    tcp_peer_stop(peer);
}

fixture each_test = {begin, end};

static int64_t now_ms(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

/* Sends requests to unit 7, in one send, so that the peer receives them at once. They read
 * the registers from `id` on, so the replies differ in their data as well as in their ids. */
static void send_requests(unsigned id, unsigned count)
{
    uint8_t requests[12 * 8];

    for (unsigned i = 0; i < count; i++, id++) {
        const uint8_t request[12] = {(uint8_t)(id >> 8), (uint8_t)id, 0, 0, 0, 6, 7, 3,
                                     (uint8_t)(id >> 8), (uint8_t)id, 0, 1};

        memcpy(requests + 12 * i, request, 12);
    }
    assert_int_equal(send(s, requests, 12 * count, MSG_NOSIGNAL), 12 * count);
}

static void send_request(unsigned id)
{
    send_requests(id, 1);
}

/* Returns what one recv returns: 0 at the end of the stream. Returns -1 if nothing arrived
 * within `ms` milliseconds. */
static ssize_t receive(uint8_t *bytes, size_t capacity, int ms)
{
    struct pollfd wait = {s, POLLIN, 0};

    return poll(&wait, 1, ms) == 0 ? -1 : recv(s, bytes, capacity, 0);
}

/* Receives exactly `length` bytes. */
static void receive_all(uint8_t *bytes, size_t length)
{
    while (length > 0) {
        ssize_t count = receive(bytes, length, PATIENCE_MS);

        assert_true(count > 0);
        bytes += count;
        length -= (size_t)count;
    }
}

static void right_reply(uint8_t *reply, unsigned id)
{
    const uint8_t head[9] = {(uint8_t)(id >> 8), (uint8_t)id, 0, 0, 0, 5, 7, 3, 2};

    memcpy(reply, head, sizeof head);
    reply[9] = (uint8_t)(tcp_peer_word(id) >> 8);
    reply[10] = (uint8_t)tcp_peer_word(id);
}

static void expect(unsigned id)
{
    uint8_t reply[REPLY], right[REPLY];

    right_reply(right, id);
    receive_all(reply, sizeof reply);
    assert_memory_equal(reply, right, sizeof right);
}

/* Returns how many segments with data have arrived, whether they were read or not. */
static unsigned segments(void)
{
    struct tcp_info info = {0};
    socklen_t size = sizeof info;

    SKIP_IF_EMULATED();
    assert_int_equal(getsockopt(s, IPPROTO_TCP, TCP_INFO, &info, &size), 0);
    return info.tcpi_data_segs_in;
}

static void expect_silence(void)
{
    uint8_t byte;

    assert_int_equal(receive(&byte, 1, SHORT_MS), -1);
}

TEST(the_right_reply_comes_from_the_memory)
{
    const uint8_t write_one[12] = {0, 9, 0, 0, 0, 6, 7, 6, 0, 30, 0xAB, 0xCD};
    const uint8_t no_such[12] = {0, 9, 0, 0, 0, 6, 7, 3, 0xFF, 0, 0, 1};
    const uint8_t no_function[9] = {0, 9, 0, 0, 0, 3, 7, 7, 0};
    const uint8_t unknown[9] = {0, 9, 0, 0, 0, 3, 7, 0x87, 1};
    uint8_t reply[12];

    send_request(1);
    expect(1);
    assert_int_equal(send(s, write_one, 12, 0), 12);
    receive_all(reply, 12);
    assert_memory_equal(reply, write_one, 12);
    assert_int_equal(tcp_peer_memory(peer)->tab_registers[30], 0xABCD);
    assert_int_equal(send(s, no_such, 12, 0), 12);
    receive_all(reply, 9);
    assert_int_equal(reply[7], 0x83);
    assert_int_equal(reply[8], 2);
    assert_int_equal(send(s, no_function, 9, 0), 9);
    receive_all(reply, 9);
    assert_memory_equal(reply, unknown, 9);
    send_request(2);
    expect(2);
}

TEST(requests_in_one_send_and_in_pieces_are_found)
{
    const uint8_t two[24] = {0, 1, 0, 0, 0, 6, 7, 3, 0, 1, 0, 1,
                             0, 2, 0, 0, 0, 6, 7, 3, 0, 2, 0, 1};

    assert_int_equal(send(s, two, sizeof two, 0), sizeof two);
    expect(1);
    expect(2);
    for (size_t i = 0; i < sizeof two; i++) {
        assert_int_equal(send(s, two + i, 1, 0), 1);
        usleep(500);
    }
    expect(1);
    expect(2);
    assert_int_equal(tcp_peer_count(peer).requests, 4);
    assert_int_equal(tcp_peer_count(peer).replies, 4);
}

TEST(a_delay_delays_one_reply_only)
{
    int64_t start = now_ms();

    tcp_peer_fault(peer, 1, FAULT_DELAY, 300);
    send_requests(1, 2);
    expect(2);
    expect(1);
    assert_true(now_ms() - start >= 300);
}

TEST(hold_changes_the_order_of_replies)
{
    tcp_peer_fault(peer, 1, FAULT_HOLD, 2);
    tcp_peer_fault(peer, 4, FAULT_HOLD, 3);
    send_requests(1, 3);
    expect(2);
    expect(3);
    expect(1);
    /* No other reply follows, so it is sent when its time is over. */
    int64_t start = now_ms();
    send_request(4);
    expect(4);
    assert_true(now_ms() - start >= HELD_MS);
}

TEST(join_puts_replies_into_one_send)
{
    uint8_t got[64], right[3 * REPLY];
    unsigned before = segments();

    tcp_peer_fault(peer, 1, FAULT_JOIN, 2);
    send_requests(1, 3);
    receive_all(got, sizeof right);
    right_reply(right, 1);
    right_reply(right + REPLY, 2);
    right_reply(right + 2 * REPLY, 3);
    assert_memory_equal(got, right, sizeof right);
    assert_int_equal(segments() - before, 1);
    /* Another reply should join it, but none comes, so it is sent alone. */
    tcp_peer_fault(peer, 4, FAULT_JOIN, 1);
    int64_t start = now_ms();
    send_request(4);
    expect(4);
    assert_true(now_ms() - start >= HELD_MS);
}

TEST(drop_carries_out_the_request_and_does_not_answer)
{
    const uint8_t write_one[12] = {0, 9, 0, 0, 0, 6, 7, 6, 0, 30, 0, 5};

    tcp_peer_fault(peer, 1, FAULT_DROP, 0);
    assert_int_equal(send(s, write_one, 12, 0), 12);
    expect_silence();
    send_request(1);
    expect(1);
    assert_int_equal(tcp_peer_memory(peer)->tab_registers[30], 5);
    assert_int_equal(tcp_peer_count(peer).faults[FAULT_DROP], 1);
    assert_int_equal(tcp_peer_count(peer).replies, 1);
}

TEST(twice_sends_the_reply_twice)
{
    tcp_peer_fault(peer, 1, FAULT_TWICE, 0);
    send_request(1);
    expect(1);
    expect(1);
    expect_silence();
}

TEST(split_sends_single_bytes)
{
    int64_t start = now_ms();
    unsigned before = segments();

    tcp_peer_fault(peer, 1, FAULT_SPLIT, 20);
    send_request(1);
    expect(1);
    assert_int_equal(segments() - before, REPLY);
    assert_true(now_ms() - start >= 20 * (REPLY - 1));
    expect_silence();
}

/* Sends one request. Expects the right reply except for one byte. */
static void expect_changed(tcp_fault fault, unsigned argument, size_t at, uint8_t to)
{
    uint8_t reply[REPLY], right[REPLY];

    tcp_peer_fault(peer, tcp_peer_count(peer).requests + 1, fault, argument);
    send_request(5);
    right_reply(right, 5);
    right[at] = to;
    receive_all(reply, sizeof reply);
    assert_memory_equal(reply, right, sizeof right);
}

TEST(a_wrong_field_is_wrong_and_the_rest_is_right)
{
    expect_changed(FAULT_OTHER_ID, 3, 1, 8);
    expect_changed(FAULT_OTHER_ID, 0x8000, 0, 0x80);
    expect_changed(FAULT_WRONG_PROTOCOL, 1, 3, 1);
    expect_changed(FAULT_WRONG_UNIT, 2, 6, 9);
    expect_changed(FAULT_WRONG_FUNCTION, 4, 7, 4);
    expect_changed(FAULT_SHORT_LENGTH, 1, 5, 4);
    expect_silence();
    expect_changed(FAULT_ALSO_OTHER_ID, 3, 1, 8);
    expect(5);
}

TEST(an_exception_leaves_the_memory_alone)
{
    const uint8_t write_one[12] = {0, 9, 0, 0, 0, 6, 7, 6, 0, 30, 0, 5};
    const uint8_t busy[9] = {0, 9, 0, 0, 0, 3, 7, 0x86, 6};
    uint8_t reply[9];

    tcp_peer_fault(peer, 1, FAULT_EXCEPTION, 6);
    assert_int_equal(send(s, write_one, 12, 0), 12);
    receive_all(reply, 9);
    assert_memory_equal(reply, busy, 9);
    assert_int_equal(tcp_peer_memory(peer)->tab_registers[30], tcp_peer_word(30));
}

TEST(garbage_comes_before_the_reply_and_is_no_header)
{
    uint8_t got[7 + REPLY];

    tcp_peer_fault(peer, 1, FAULT_GARBAGE, 7);
    send_request(0x100);
    receive_all(got, 7);
    for (size_t i = 0; i < 7; i++)
        assert_int_equal(got[i], 0xA5);
    receive_all(got + 7, REPLY - 2);
    for (size_t i = 0; i < 7; i++) {
        unsigned protocol = (unsigned)got[i + 2] << 8 | got[i + 3];
        unsigned length = (unsigned)got[i + 4] << 8 | got[i + 5];

        assert_true(protocol != 0 || length < 2 || length > 254);
    }
}

TEST(half_a_reply_is_followed_by_the_end_of_the_stream)
{
    uint8_t got[64];

    tcp_peer_fault(peer, 1, FAULT_HALF, 4);
    send_request(1);
    send_request(2);
    receive_all(got, 4);
    assert_int_equal(receive(got, sizeof got, PATIENCE_MS), 0);
    assert_int_equal(tcp_peer_count(peer).replies, 0);
}

TEST(close_ends_the_stream_and_reset_resets_it)
{
    uint8_t byte;

    tcp_peer_fault(peer, 1, FAULT_CLOSE, 0);
    tcp_peer_fault(peer, 2, FAULT_RESET, 0);
    send_request(1);
    assert_int_equal(receive(&byte, 1, PATIENCE_MS), 0);
    close(s);
    s = tcp_connectTo(port);
    send_request(2);
    assert_int_equal(receive(&byte, 1, PATIENCE_MS), -1);
    assert_int_equal(errno, ECONNRESET);
    close(s);
    s = tcp_connectTo(port);
    send_request(3);
    expect(3);
    assert_int_equal(tcp_peer_count(peer).connections, 3);
}

TEST(bytes_that_are_no_request_end_the_connection)
{
    const uint8_t nonsense[8] = {0, 1, 0, 1, 0, 6, 7, 3};
    uint8_t byte;

    assert_int_equal(send(s, nonsense, sizeof nonsense, 0), sizeof nonsense);
    assert_true(receive(&byte, 1, PATIENCE_MS) <= 0);
    assert_int_equal(tcp_peer_count(peer).malformed, 1);
}

TEST(a_connection_beyond_the_limit_is_refused)
{
    int others[TCP_PEER_CONNECTIONS], first = s;
    uint8_t byte;

    send_request(1);
    expect(1);
    for (unsigned i = 0; i < TCP_PEER_CONNECTIONS; i++)
        others[i] = tcp_connectTo(port);
    s = others[TCP_PEER_CONNECTIONS - 1];
    assert_true(receive(&byte, 1, PATIENCE_MS) <= 0);
    s = others[TCP_PEER_CONNECTIONS - 2];
    send_request(2);
    expect(2);
    assert_int_equal(tcp_peer_count(peer).refused, 1);
    for (unsigned i = 0; i < TCP_PEER_CONNECTIONS; i++)
        close(others[i]);
    s = first;
}

TEST(hang_up_and_a_restart_at_the_same_port)
{
    uint8_t byte;

    send_request(1);
    expect(1);
    tcp_peer_hang_up(peer);
    assert_int_equal(receive(&byte, 1, PATIENCE_MS), 0);
    tcp_peer_halt(peer);
    close(s);
    assert_int_equal(tcp_peer_start(peer, port), port);
    s = tcp_connectTo(port);
    send_request(2);
    expect(2);
}

/* Returns the counts of one run with random faults. */
static tcp_peer_counts run_chaos(uint32_t seed)
{
    static const tcp_fault kinds[] = {FAULT_DROP, FAULT_TWICE, FAULT_OTHER_ID, FAULT_GARBAGE};
    tcp_peer_counts counts;
    uint8_t got[512];

    tcp_peer_chaos(peer, seed, 40, kinds, COUNT(kinds), 0);
    for (unsigned i = 0; i < 200; i++)
        send_request(i);
    do
        usleep(1000);
    while ((counts = tcp_peer_count(peer)).requests < 200);
    while (receive(got, sizeof got, SHORT_MS) > 0)
        ;
    return counts;
}

TEST(random_faults_of_one_seed_repeat)
{
    tcp_peer_counts first = run_chaos(7), again, other;

    end();
    begin();
    again = run_chaos(7);
    end();
    begin();
    other = run_chaos(8);
    assert_memory_equal(first.faults, again.faults, sizeof first.faults);
    assert_memory_not_equal(first.faults, other.faults, sizeof first.faults);
    assert_in_range(200 - first.faults[FAULT_NONE], 50, 110);
    assert_true(first.faults[FAULT_DROP] > 0 && first.faults[FAULT_GARBAGE] > 0);
    assert_int_equal(first.replies, 200 - first.faults[FAULT_DROP] - first.faults[FAULT_OTHER_ID]);
}
