/* The loop of the manual, wait for pollDelay, then poll, on a tty, TCP, RTU over TCP and UDP. A
 * function is pending while the client gives up and sends its next request: the server goes on
 * after the reply. */
#define _GNU_SOURCE
#include "hooked_port.h"
#include "await.h"
#include "crc.h"
#include "mbm_tcp.h"
#include "mbm_tty.h"
#include "mbm_udp.h"
#include "pty.h"
#include "test.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

enum { UNIT = 17, SLOW = 0x41, PATIENCE_US = 1000 * PATIENCE_MS };

/* A port under test, and the descriptor of the test's client. */
typedef struct {
    int (*wait)(uint32_t timeoutUs);
    int fd;
    int has_header; /* Modbus TCP frames, not RTU */
} link_under_test;

static link_under_test link_;
static mbm_server server;
static mbm_unit unit;
static mbm_registerTable holding;
static mbm_custom custom;
static uint16_t words[4] = {0x1234, 2, 3, 4};
static uint8_t frame[MBM_MAX_TCP_FRAME];
static unsigned calls;
static uint16_t slow_reply;

static uint16_t slow(void *context, const mbm_request *request, uint8_t *response,
                     uint16_t capacity)
{
    calls++;
    return slow_reply;
}

static void reset(void)
{
    memset(&server, 0, sizeof server);
    memset(&holding, 0, sizeof holding);
    memset(&custom, 0, sizeof custom);
    unit = (mbm_unit){.id = UNIT};
    holding.words = words;
    holding.size = 4;
    custom.code = SLOW;
    custom.serve = slow;
    OK(mbm_unit_serveHoldingRegisters(&unit, &holding));
    OK(mbm_unit_serveCustom(&unit, &custom));
    calls = 0;
    slow_reply = MBM_REPLY_PENDING;
}

/* --- the client's end */

static size_t framed(uint8_t *bytes, const uint8_t *pdu, size_t length)
{
    size_t head = 0;

    if (link_.has_header) {
        memset(bytes, 0, 6);
        bytes[5] = (uint8_t)(1 + length);
        head = 6;
    }
    bytes[head] = UNIT;
    memcpy(bytes + head + 1, pdu, length);
    return link_.has_header ? head + 1 + length : seal(bytes, 1 + length);
}

static void send_pdu(const uint8_t *pdu, size_t length)
{
    uint8_t bytes[32];
    const size_t count = framed(bytes, pdu, length);

    assert_int_equal(write(link_.fd, bytes, count), count);
}

static void send_slow_request(void)
{
    send_pdu((const uint8_t[]){SLOW}, 1);
}

static void send_read(void)
{
    send_pdu((const uint8_t[]){3, 0, 0, 0, 1}, 5);
}

/* The program's loop until this response has arrived. A wait without a limit ends the test when
 * nothing ends it in time. */
static void loop_until(const uint8_t *pdu, size_t length)
{
    uint8_t expected[32], got[32];
    const size_t all = framed(expected, pdu, length);
    size_t count = 0;

    while (count < all) {
        const uint32_t delay = mbm_server_pollDelay(&server);
        const int woken = link_.wait(delay < PATIENCE_US ? delay : PATIENCE_US);
        ssize_t more;

        assert_true(woken == 1 || delay != 0xFFFFFFFF);
        OK(mbm_server_poll(&server));
        more = read(link_.fd, got + count, all - count);
        count += more > 0 ? (size_t)more : 0;
    }
    assert_memory_equal(got, expected, all);
}

static void loop_until_read_is_answered(void)
{
    loop_until((const uint8_t[]){3, 2, 0x12, 0x34}, 4);
}

static void goes_on_after_the_reply(uint16_t reply)
{
    slow_reply = MBM_REPLY_PENDING;
    calls = 0;
    send_slow_request();
    while (calls == 0) {
        const uint32_t delay = mbm_server_pollDelay(&server);

        assert_true(link_.wait(delay < PATIENCE_US ? delay : PATIENCE_US) == 1 ||
                    delay != 0xFFFFFFFF);
        OK(mbm_server_poll(&server));
    }
    /* The client gives up. The wait reports its next request, which the server cannot read. */
    send_read();
    assert_int_equal(link_.wait(PATIENCE_US), 1);
    OK(mbm_server_poll(&server));
    assert_int_equal(mbm_server_pollDelay(&server), 1000);
    slow_reply = reply;
    if (reply == 0)
        loop_until((const uint8_t[]){SLOW}, 1);
    loop_until_read_is_answered();
    send_read();
    loop_until_read_is_answered();
}

static void goes_on_after_each_reply(void)
{
    assert_int_equal(fcntl(link_.fd, F_SETFL, O_NONBLOCK), 0);
    goes_on_after_the_reply(0);
    goes_on_after_the_reply(MBM_REPLY_NONE);
}

/* --- the ports */

static pty line;
static mbm_tty tty;

static int wait_for_tty(uint32_t timeoutUs)
{
    return mbm_tty_wait(&tty, timeoutUs);
}

TEST(on_a_tty_the_server_goes_on_after_the_reply)
{
    reset();
    pty_open(&line);
    assert_int_equal(mbm_tty_open(&tty, line.path, 115200, 'E', 1), 0);
    mbm_port port = mbm_tty_port(&tty);
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    link_ = (link_under_test){wait_for_tty, line.ours, 0};
    goes_on_after_each_reply();
    mbm_tty_close(&tty);
    pty_close(&line);
}

static mbm_tcp tcp;
static mbm_tcp_set set;

static int wait_for_tcp(uint32_t timeoutUs)
{
    return mbm_tcp_wait(&tcp, 1, NULL, -1, timeoutUs);
}

/* The program takes the socket from the set whenever the set reports it. */
static int wait_for_set(uint32_t timeoutUs)
{
    const int ready = mbm_tcp_waitSet(&set, timeoutUs);

    (void)mbm_tcp_nextReady(&set);
    return ready;
}

static void open_tcp(int in_set, int has_header)
{
    int pair[2];

    reset();
    memset(&tcp, 0, sizeof tcp);
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, pair), 0);
    assert_int_equal(mbm_tcp_attach(&tcp, pair[0]), 0);
    if (in_set) {
        assert_int_equal(mbm_tcp_openSet(&set), 0);
        assert_int_equal(mbm_tcp_add(&set, &tcp), 0);
    }
    mbm_port port = mbm_tcp_port(&tcp);
    if (has_header)
        OK(mbm_server_beginTcp(&server, &port, &unit, 1, frame, sizeof frame));
    else
        OK(mbm_server_beginRtuOverTcp(&server, &port, &unit, 1, frame, sizeof frame));
    link_ = (link_under_test){in_set ? wait_for_set : wait_for_tcp, pair[1], has_header};
}

static void close_tcp(int in_set)
{
    mbm_tcp_close(&tcp);
    if (in_set)
        mbm_tcp_closeSet(&set);
    close(link_.fd);
}

TEST(over_tcp_the_server_goes_on_after_the_reply)
{
    for (int in_set = 0; in_set < 2; in_set++)
        for (int has_header = 0; has_header < 2; has_header++) {
            open_tcp(in_set, has_header);
            goes_on_after_each_reply();
            close_tcp(in_set);
        }
}

static mbm_udp udp;

static int wait_for_udp(uint32_t timeoutUs)
{
    return mbm_udp_wait(&udp, 1, -1, timeoutUs);
}

TEST(over_udp_the_server_goes_on_after_the_reply)
{
    const mbm_port port = mbm_udp_port(&udp);
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr = {htonl(INADDR_LOOPBACK)}};

    reset();
    assert_int_equal(mbm_udp_listen(&udp, "127.0.0.1", "0"), 0);
    address.sin_port = htons(udp.port);
    link_ = (link_under_test){wait_for_udp, socket(AF_INET, SOCK_DGRAM, 0), 1};
    assert_int_equal(connect(link_.fd, (const struct sockaddr *)&address, sizeof address), 0);
    OK(mbm_server_beginTcp(&server, &port, &unit, 1, frame, sizeof frame));
    goes_on_after_each_reply();
    mbm_udp_close(&udp);
    close(link_.fd);
}

/* --- A server that is begun again, baud rates that it takes, and how it handles noise --- */

typedef uint8_t (*begin)(mbm_server *, const mbm_port *, mbm_unit *, uint8_t, uint8_t *, uint16_t);

static mbm_registerTable table;
static uint16_t cells[10];
static uint8_t begin_frame[MBM_MAX_ASCII_FRAME];
static hooked_port wire;
static mbm_port port;

static void reset_for_begin(void)
{
    memset(&server, 0, sizeof server);
    memset(&unit, 0, sizeof unit);
    memset(&table, 0, sizeof table);
    memset(&wire, 0, sizeof wire);
    memset(cells, 0, sizeof cells);
    wire.step = 100;
    port = hooked_port_of(&wire);
    unit.id = 17;
    table.words = cells;
    table.size = 10;
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
}

/* Polls until a request that has arrived is answered. Returns the length of what was sent. */
static size_t answer(void)
{
    wire.length = 0;
    for (unsigned i = 0; i < 100; i++)
        OK(mbm_server_poll(&server));
    return wire.length;
}

static uint8_t never_drained(void *context)
{
    return 0;
}

static void calls_within_the_driver_hook(int hook)
{
    if (hook == HOOK_POST) {
        IS(MBM_BUSY, mbm_server_poll(&server));
        IS(MBM_BUSY,
           mbm_server_beginRtu(&server, &port, &unit, 1, begin_frame, sizeof begin_frame));
    }
}

TEST_WITH(a_begin_while_a_response_is_sent_switches_the_driver_off, reset_for_begin, NULL)
{
    static const begin begins[] = {mbm_server_beginRtu, mbm_server_beginAscii, mbm_server_beginTcp,
                                   mbm_server_beginRtuOverTcp};
    mbm_port stuck = port, other = port;

    stuck.flush = never_drained;
    other.postTransmission = NULL;
    wire.within = calls_within_the_driver_hook;
    for (unsigned i = 0; i < COUNT(begins); i++) {
        memset(wire.called, 0, sizeof wire.called);
        OK(mbm_server_beginRtu(&server, &stuck, &unit, 1, begin_frame, sizeof begin_frame));
        hooked_port_arrive_rtu(&wire, 17, "\x03\0\0\0\1", 5);
        assert_int_equal(answer(), 7);
        assert_int_equal(wire.called[HOOK_PRE], 1);
        /* A begin that is refused changes nothing. */
        IS(MBM_INVALID_ARGUMENT, begins[i](&server, &port, &unit, 1, begin_frame, 1));
        assert_int_equal(wire.called[HOOK_POST], 0);
        OK(begins[i](&server, &other, &unit, 1, begin_frame, sizeof begin_frame));
        assert_int_equal(wire.called[HOOK_POST], 1);
        OK(begins[i](&server, &port, &unit, 1, begin_frame, sizeof begin_frame));
        assert_int_equal(wire.called[HOOK_POST], 1);
    }
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, begin_frame, sizeof begin_frame));
    hooked_port_arrive_rtu(&wire, 17, "\x03\0\0\0\1", 5);
    assert_int_equal(answer(), 7);
}

TEST_WITH(a_refused_baud_rate_leaves_the_silence_of_ascii, reset_for_begin, NULL)
{
    static const char request[] = ":110300000001EB\r\n", response[] = ":1103020000EA\r\n";

    OK(mbm_server_beginAscii(&server, &port, &unit, 1, begin_frame, sizeof begin_frame));
    IS(MBM_INVALID_ARGUMENT, mbm_server_setBaudRate(&server, 115200));
    /* A pause of half a second between two characters does not end an ASCII frame. */
    for (unsigned i = 0; request[i] != '\0'; i++) {
        hooked_port_arrive(&wire, request + i, 1);
        OK(mbm_server_poll(&server));
        wire.now += 500000;
    }
    OK(mbm_server_poll(&server));
    assert_int_equal(wire.length, sizeof response - 1);
    assert_memory_equal(wire.sent, response, sizeof response - 1);
}

/* Noise without an end: 20000 bytes of it. */
static int16_t noisy_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    hooked_port *p = context;

    if (p->first > 20000)
        return 0;
    memset(bytes, 0x41, capacity);
    p->first += capacity;
    return (int16_t)capacity;
}

TEST_WITH(a_poll_reads_at_most_1200_bytes_of_noise, reset_for_begin, NULL)
{
    static const begin begins[] = {mbm_server_beginRtu, mbm_server_beginAscii,
                                   mbm_server_beginRtuOverTcp};
    mbm_port noisy = port;

    noisy.read = noisy_read;
    for (unsigned i = 0; i < COUNT(begins); i++) {
        OK(begins[i](&server, &noisy, &unit, 1, begin_frame, 64));
        for (unsigned polls = 0; polls < 10; polls++) {
            wire.first = 0;
            OK(mbm_server_poll(&server));
            assert_in_range(wire.first, 1, 1200);
        }
    }
}

TEST_WITH(a_frame_that_fills_the_buffer_after_noise_is_answered, reset_for_begin, NULL)
{
    uint8_t bytes[120] = {0};

    OK(mbm_server_beginRtu(&server, &port, &unit, 1, begin_frame, 16));
    for (unsigned noise = 0; noise < 100; noise++) {
        memset(bytes, 0x5A, noise);
        memcpy(bytes + noise, "\x11\x10\0\0\0\2\4\1\2\3\4", 11);
        hooked_port_arrive(&wire, bytes, noise + seal(bytes + noise, 11));
        cells[1] = 0;
        assert_int_equal(answer(), 8);
        assert_int_equal(cells[1], 0x0304);
    }
}
