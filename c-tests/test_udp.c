/* The port over UDP: datagrams that are lost, late, twice, or no frame; clients whose responses
 * must not go to others. */
#define _GNU_SOURCE
#include "await.h"
#include "mbm_udp.h"
#include "test.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <unistd.h>

enum { UNIT = 17, FIRST = 100, WORDS = 125, PATIENCE = 1000 * PATIENCE_MS, FRAME = 12, REPLY = 11 };

static mbm_udp receiver, sender;
static mbm_server server;
static mbm_client client;
static mbm_unit unit;
static mbm_registerTable holding;
static uint16_t words[WORDS], read_words[WORDS];
static uint8_t frame[MBM_MAX_TCP_FRAME], incoming[600], outgoing[600];
static mbm_clientRequest request;
static char service[8];

static void listen_again(void)
{
    const mbm_port port = mbm_udp_port(&receiver);

    assert_int_equal(mbm_udp_listen(&receiver, "127.0.0.1", "0"), 0);
    snprintf(service, sizeof service, "%u", receiver.port);
    OK(mbm_server_beginTcp(&server, &port, &unit, 1, frame, sizeof frame));
}

static void begin(void)
{
    const mbm_port port = mbm_udp_port(&sender);

    unit = (mbm_unit){.id = UNIT};
    holding = (mbm_registerTable){.words = words, .base = FIRST, .size = WORDS};
    for (unsigned i = 0; i < WORDS; i++)
        words[i] = (uint16_t)(0xB000 + i);
    OK(mbm_unit_serveHoldingRegisters(&unit, &holding));
    memset(&receiver, 0, sizeof receiver);
    memset(&sender, 0, sizeof sender);
    listen_again();
    assert_int_equal(mbm_udp_open(&sender, "127.0.0.1", service), 0);
    OK(mbm_client_beginTcp(&client, &port, incoming, sizeof incoming, outgoing, sizeof outgoing));
    OK(mbm_client_setResponseTimeout(&client, UINT16_MAX));
    memset(&request, 0, sizeof request);
    request.unit = UNIT;
    request.reply = read_words;
    request.replyBytes = sizeof read_words;
}

static void end(void)
{
    mbm_udp_close(&receiver);
    mbm_udp_close(&sender);
}

fixture each_test = {begin, end};

/* Lets the server serve until it has received what was sent. The loopback loses nothing. */
static void serve(void)
{
    while (mbm_udp_wait(&receiver, 1, -1, 0) == 1)
        OK(mbm_server_poll(&server));
}

static void exchange(void)
{
    while (mbm_client_poll(&client) == MBM_PENDING) {
        serve();
        assert_int_equal(mbm_udp_wait(&sender, 1, -1, PATIENCE), 1);
    }
}

static void ask(uint16_t count)
{
    memset(read_words, 0, sizeof read_words);
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &request, FIRST, count));
}

static void is_answered(uint16_t count)
{
    IS(MBM_OK, request.status);
    assert_memory_equal(read_words, words, 2u * count);
}

/* A socket of the test, connected to a port of this machine. */
static int plain_socket(uint16_t port)
{
    const struct sockaddr_in address = {
        .sin_family = AF_INET, .sin_port = htons(port), .sin_addr = {htonl(INADDR_LOOPBACK)}};
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);

    assert_true(fd >= 0);
    assert_int_equal(connect(fd, (const struct sockaddr *)&address, sizeof address), 0);
    return fd;
}

/* Sends a request for one register with a number of the test's. */
static void send_request(int fd, uint8_t number, uint8_t address)
{
    const uint8_t bytes[FRAME] = {0, number, 0, 0, 0, 6, UNIT, 3, 0, address, 0, 1};

    assert_int_equal(write(fd, bytes, sizeof bytes), sizeof bytes);
}

static void assert_reply(int fd, uint8_t number, uint8_t address)
{
    uint8_t bytes[300];

    assert_int_equal(read(fd, bytes, sizeof bytes), REPLY);
    assert_int_equal(bytes[1], number);
    assert_int_equal(bytes[9] << 8 | bytes[10], words[address - FIRST]);
}

static void assert_silent(int fd)
{
    uint8_t byte;

    assert_int_equal(read(fd, &byte, 1), -1);
    assert_int_equal(errno, EAGAIN);
}

TEST(a_request_and_its_reply_are_a_datagram_each)
{
    ask(WORDS);
    exchange();
    is_answered(WORDS);
    assert_int_equal(receiver.dropped + sender.dropped + sender.unsent, 0);
}

TEST(requests_of_one_write_are_a_datagram_each)
{
    static mbm_clientRequest more[16];
    static uint16_t values[16];

    memset(more, 0, sizeof more);
    for (unsigned i = 0; i < COUNT(more); i++) {
        more[i].unit = UNIT;
        more[i].reply = &values[i];
        more[i].replyBytes = sizeof values[i];
        IS(MBM_PENDING,
           mbm_client_readHoldingRegisters(&client, &more[i], (uint16_t)(FIRST + i), 1));
    }
    exchange();
    for (unsigned i = 0; i < COUNT(more); i++) {
        IS(MBM_OK, more[i].status);
        assert_int_equal(values[i], words[i]);
    }
}

TEST(each_client_gets_the_responses_to_its_own_requests)
{
    int fds[8];

    for (unsigned i = 0; i < COUNT(fds); i++)
        fds[i] = plain_socket(receiver.port);
    /* All use the same number. */
    for (unsigned i = 0; i < COUNT(fds); i++)
        send_request(fds[i], 7, (uint8_t)(FIRST + i));
    send_request(fds[0], 8, FIRST + 20);
    serve();
    for (unsigned i = 0; i < COUNT(fds); i++)
        assert_reply(fds[i], 7, (uint8_t)(FIRST + i));
    assert_reply(fds[0], 8, FIRST + 20);
    for (unsigned i = 0; i < COUNT(fds); i++) {
        assert_silent(fds[i]);
        close(fds[i]);
    }
}

/* The device answers no request to another unit. */
TEST(a_request_without_a_response_does_not_shift_the_next)
{
    static const uint8_t other[FRAME] = {0, 1, 0, 0, 0, 6, UNIT + 1, 3, 0, FIRST, 0, 1};
    int first = plain_socket(receiver.port), second = plain_socket(receiver.port);

    assert_int_equal(write(first, other, sizeof other), sizeof other);
    send_request(second, 2, FIRST + 1);
    serve();
    assert_silent(first);
    assert_reply(second, 2, FIRST + 1);
    close(first);
    close(second);
}

TEST(a_datagram_that_is_not_one_frame_is_dropped_and_counted)
{
    uint8_t bytes[1400] = {0, 1, 0, 0, 0, 6, UNIT, 3, 0, FIRST, 0, 1};
    int fd = plain_socket(receiver.port);
    unsigned i, wrong = 0;

    for (i = 0; i < FRAME; i++, wrong++) /* too short, also empty */
        assert_int_equal(write(fd, bytes, i), i);
    assert_int_equal(write(fd, bytes, FRAME + 1), FRAME + 1);
    assert_int_equal(write(fd, bytes, MBM_MAX_TCP_FRAME + 1), MBM_MAX_TCP_FRAME + 1);
    assert_int_equal(write(fd, bytes, sizeof bytes), sizeof bytes);
    memcpy(bytes + FRAME, bytes, FRAME); /* two frames */
    assert_int_equal(write(fd, bytes, 2 * FRAME), 2 * FRAME);
    bytes[3] = 1; /* another protocol */
    assert_int_equal(write(fd, bytes, FRAME), FRAME);
    bytes[3] = 0;
    bytes[4] = 1; /* a length that no frame has, and that a long datagram has */
    assert_int_equal(write(fd, bytes, 6 + 0x106), 6 + 0x106);
    wrong += 6;
    serve();
    assert_silent(fd);
    assert_int_equal(receiver.dropped, wrong);
    send_request(fd, 9, FIRST);
    serve();
    assert_reply(fd, 9, FIRST);
    close(fd);
}

/* The test is the server. Returns the number of a request that arrives, and its sender. */
static uint8_t receive_request(int fd, struct sockaddr_in *from)
{
    socklen_t size = sizeof *from;
    uint8_t bytes[300];

    AWAIT(mbm_client_poll(&client) == MBM_PENDING &&
          recvfrom(fd, bytes, sizeof bytes, 0, (struct sockaddr *)from, &size) == FRAME);
    return bytes[1];
}

static void send_reply(int fd, const struct sockaddr_in *to, uint8_t number, uint16_t word)
{
    const uint8_t bytes[REPLY] = {
        0, number, 0, 0, 0, 5, UNIT, 3, 2, (uint8_t)(word >> 8), (uint8_t)word};

    assert_int_equal(sendto(fd, bytes, sizeof bytes, 0, (const struct sockaddr *)to, sizeof *to),
                     REPLY);
}

static void the_client_finishes(void)
{
    while (mbm_client_poll(&client) == MBM_PENDING)
        assert_int_equal(mbm_udp_wait(&sender, 1, -1, PATIENCE), 1);
}

/* The first request is lost, and its reply comes later than that to the repetition. */
TEST(a_lost_datagram_is_repeated_and_a_late_or_second_reply_is_passed_over)
{
    struct sockaddr_in own = {.sin_family = AF_INET, .sin_addr = {htonl(INADDR_LOOPBACK)}}, from;
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    uint8_t second;

    own.sin_port = htons(receiver.port);
    mbm_udp_close(&receiver);
    assert_int_equal(bind(fd, (const struct sockaddr *)&own, sizeof own), 0);
    OK(mbm_client_setResponseTimeout(&client, 30));
    OK(mbm_client_setRetries(&client, 255));
    ask(1);
    uint8_t first = receive_request(fd, &from);
    do
        second = receive_request(fd, &from);
    while (second == first);
    send_reply(fd, &from, second, 0x2222);
    send_reply(fd, &from, second, 0x3333);
    send_reply(fd, &from, first, 0x1111);
    the_client_finishes();
    IS(MBM_OK, request.status);
    assert_int_equal(read_words[0], 0x2222);
    OK(mbm_client_setResponseTimeout(&client, UINT16_MAX));
    ask(1);
    second = receive_request(fd, &from);
    send_reply(fd, &from, second, 0x4444);
    the_client_finishes();
    IS(MBM_OK, request.status);
    assert_int_equal(read_words[0], 0x4444);
    close(fd);
}

TEST(datagrams_of_others_do_not_reach_the_client)
{
    struct sockaddr_in own = {.sin_family = AF_INET, .sin_addr = {htonl(INADDR_LOOPBACK)}};
    const int stranger = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);

    own.sin_port = htons(sender.port);
    ask(1);
    IS(MBM_PENDING, mbm_client_poll(&client));
    send_reply(stranger, &own, 1, 0x6666);
    send_reply(stranger, &own, 0, 0x6666);
    exchange();
    is_answered(1);
    close(stranger);
}

/* The system reports that no program listens there. The datagram counts as lost. */
TEST(a_server_that_is_not_there_yet_is_no_lost_link)
{
    const mbm_port port = mbm_udp_port(&receiver);

    mbm_udp_close(&receiver);
    OK(mbm_client_setResponseTimeout(&client, 30));
    OK(mbm_client_setRetries(&client, 255));
    ask(5);
    AWAIT(mbm_client_poll(&client) == MBM_PENDING && sender.unsent > 0);
    assert_int_equal(sender.error, ECONNREFUSED);
    assert_int_equal(mbm_udp_listen(&receiver, "127.0.0.1", service), 0);
    OK(mbm_server_beginTcp(&server, &port, &unit, 1, frame, sizeof frame));
    while (mbm_client_poll(&client) == MBM_PENDING) {
        serve();
        (void)mbm_udp_wait(&sender, 1, receiver.fd, mbm_client_pollDelay(&client));
    }
    is_answered(5);
}

TEST(a_frame_is_sent_when_its_last_byte_is_written)
{
    const mbm_port port = mbm_udp_port(&sender);
    const uint8_t bytes[FRAME] = {0, 1, 0, 0, 0, 6, UNIT, 3, 0, FIRST, 0, 1};
    uint8_t reply[REPLY];

    for (unsigned i = 0; i < FRAME; i++) {
        assert_int_equal(mbm_udp_wait(&receiver, 1, -1, 0), 0);
        assert_int_equal(port.write(&sender, &bytes[i], 1), 1);
    }
    serve();
    for (unsigned i = 0; i < REPLY; i++)
        assert_int_equal(port.read(&sender, &reply[i], 1), 1);
    assert_int_equal(port.read(&sender, reply, 1), 0);
    assert_int_equal(reply[9] << 8 | reply[10], words[0]);
}

TEST(bytes_that_are_no_frame_lose_the_link)
{
    const mbm_port port = mbm_udp_port(&sender);
    const uint8_t bytes[] = {17, 3, 0, FIRST, 0, 1, 0, 0};
    uint8_t byte;

    assert_int_equal(port.write(&sender, bytes, sizeof bytes), -1);
    assert_int_equal(sender.error, EPROTO);
    assert_int_equal(port.read(&sender, &byte, 1), -1);
    assert_int_equal(mbm_udp_wait(&receiver, 1, -1, 0), 0);
}

TEST(a_server_without_a_request_cannot_send)
{
    const mbm_port port = mbm_udp_port(&receiver);
    const uint8_t bytes[REPLY] = {0, 1, 0, 0, 0, 5, UNIT, 3, 2, 0, 0};

    assert_int_equal(port.write(&receiver, bytes, sizeof bytes), -1);
    assert_int_equal(receiver.error, EDESTADDRREQ);
}

TEST(calls_out_of_order_are_refused)
{
    mbm_udp zero = {0}, *many = &zero;
    const mbm_port port = mbm_udp_port(&zero);
    uint8_t byte = 0;

    assert_int_equal(port.read(&zero, &byte, 1), -1);
    assert_int_equal(port.write(&zero, &byte, 1), -1);
    mbm_udp_close(&zero);
    mbm_udp_close(&zero);
    assert_int_equal(mbm_udp_open(&sender, "127.0.0.1", service), -1);
    assert_int_equal(errno, EBUSY);
    assert_int_equal(mbm_udp_open(&zero, "127.0.0.1", "no such service"), -1);
    assert_int_equal(errno, ENXIO);
    assert_true(zero.lookupError != 0);
    assert_int_equal(mbm_udp_listen(&zero, "127.0.0.1", service), -1);
    assert_int_equal(errno, EADDRINUSE);
    assert_int_equal(zero.port, 0);
    assert_int_equal(mbm_udp_wait(many, MBM_UDP_WAITS + 1, -1, 0), -1);
    assert_int_equal(errno, EINVAL);
}
