/* The gateway passes on some replies of a device, and not others. The test plays the device. */
#define _GNU_SOURCE
#include "asked.h"
#include "await.h"
#include "clock.h"
#include "crc.h"
#include "program.h"
#include "tcp_server.h"
#include "test.h"

#include <poll.h>
#include <signal.h>
#include <unistd.h>

enum { UNIT = 5 };

/* How long the gateway waits for its device, in milliseconds: longer than a busy machine
 * takes to run the device, and much shorter than PATIENCE_MS, for which a test waits for
 * the gateway. */
#define TIMEOUT "4s"

/* A gateway and its one line. The test is the device at the other end of the line. */
typedef struct gateway {
    program program;
    pty line;
    uint16_t port;
} gateway;

/* Starts a gateway whose line is at `path`. The options come after the line. */
static void start_at(gateway *g, const char *path, const char *timeout, const char *const *options)
{
    char text[64], line[128];
    const char *arguments[10] = {"gateway", "--timeout", timeout, "tcp://:0", line, "1-30"};
    unsigned number, count = 6;

    snprintf(line, sizeof line, "rtu:%s?baud=115200&parity=none", path);
    while (options && *options)
        arguments[count++] = *options++;
    program_start(&g->program, "mbm", arguments);
    program_line(&g->program, text, sizeof text);
    assert_int_equal(sscanf(text, "ready %u", &number), 1);
    g->port = (uint16_t)number;
}

static void start(gateway *g, const char *timeout, const char *const *options)
{
    pty_open(&g->line);
    start_at(g, g->line.path, timeout, options);
}

static void end(gateway *g)
{
    kill(g->program.pid, SIGTERM);
    assert_int_equal(program_end(&g->program), 0);
}

static void stop(gateway *g)
{
    end(g);
    pty_close(&g->line);
}

/* Sends a request PDU as a TCP client. */
static void send_request(int fd, const uint8_t *pdu, size_t length)
{
    uint8_t frame[MBM_MAX_TCP_FRAME] = {0x12, 0x34, 0, 0, 0, (uint8_t)(length + 1), UNIT};

    memcpy(frame + 7, pdu, length);
    assert_int_equal(write(fd, frame, length + 7), length + 7);
}

/* Expects the next response as a TCP client. */
static void expect(int fd, const uint8_t *pdu, size_t length)
{
    const uint8_t head[] = {0x12, 0x34, 0, 0, 0, (uint8_t)(length + 1), UNIT};
    uint8_t frame[MBM_MAX_TCP_FRAME];

    await_bytes(fd, frame, 9);
    assert_memory_equal(frame, head, sizeof head);
    await_bytes(fd, frame + 9, length - 2);
    assert_memory_equal(frame + 7, pdu, length);
}

/* Expects a request on the line, as the device. */
static void expect_request(const gateway *g, const uint8_t *pdu, size_t length)
{
    uint8_t wanted[MBM_MAX_FRAME] = {UNIT}, frame[MBM_MAX_FRAME];

    memcpy(wanted + 1, pdu, length);
    length = seal(wanted, length + 1);
    await_bytes(g->line.ours, frame, length);
    assert_memory_equal(frame, wanted, length);
}

/* Replies, as the device. */
static void reply(const gateway *g, const uint8_t *pdu, size_t length)
{
    uint8_t frame[MBM_MAX_FRAME] = {UNIT};

    memcpy(frame + 1, pdu, length);
    length = seal(frame, length + 1);
    assert_int_equal(write(g->line.ours, frame, length), length);
}

#define ASK(fd, pdu) send_request(fd, (const uint8_t *)(pdu), sizeof(pdu) - 1)
#define EXPECT(fd, pdu) expect(fd, (const uint8_t *)(pdu), sizeof(pdu) - 1)
#define REQUEST(g, pdu) expect_request(g, (const uint8_t *)(pdu), sizeof(pdu) - 1)
#define REPLY(g, pdu) reply(g, (const uint8_t *)(pdu), sizeof(pdu) - 1)

/* The device replies to the request of one client too late: after the request of another
 * client and before its own reply to that. The PDUs end with their last byte. */
typedef struct late {
    const char *request, *late_reply, *other, *other_reply;
    size_t lengths[4];
} late;

#define LATE(request, reply, other, other_reply)                                                   \
    {                                                                                              \
        request, reply, other, other_reply,                                                        \
        {                                                                                          \
            sizeof request - 1, sizeof reply - 1, sizeof other - 1, sizeof other_reply - 1         \
        }                                                                                          \
    }

TEST(a_late_reply_to_one_client_does_not_reach_another)
{
    static const late cases[] = {
        LATE("\x03\x00\x00\x00\x03",
             "\x03\x06\x00\x01\x00\x02\x00\x03", /* replies of different lengths */
             "\x03\x00\x10\x00\x01", "\x03\x02\xAB\xCD"),
        LATE("\x01\x00\x00\x00\x10", "\x01\x02\xFF\xFF", "\x01\x00\x20\x00\x08", "\x01\x01\x55"),
        LATE("\x06\x00\x05\x00\x07",
             "\x06\x00\x05\x00\x07", /* responses with different addresses and values */
             "\x06\x00\x06\x00\x08", "\x06\x00\x06\x00\x08"),
        LATE("\x10\x00\x05\x00\x01\x02\x11\x11", "\x10\x00\x05\x00\x01",
             "\x10\x00\x09\x00\x01\x02\x22\x22", "\x10\x00\x09\x00\x01"),
        LATE("\x08\x00\x00\x11\x11", "\x08\x00\x00\x11\x11", "\x08\x00\x00\x22\x22",
             "\x08\x00\x00\x22\x22"),
        LATE("\x14\x07\x06\x00\x01\x00\x00\x00\x02", "\x14\x06\x05\x06\x00\x01\x00\x02",
             "\x14\x07\x06\x00\x01\x00\x00\x00\x01", "\x14\x04\x03\x06\xAB\xCD"),
        LATE("\x2B\x0E\x01\x00", "\x2B\x0E\x01\x01\x00\x00\x01\x00\x01\x41", "\x2B\x0E\x04\x02",
             "\x2B\x0E\x04\x81\x00\x00\x01\x02\x01\x42"),
    };
    /* Each case has a gateway of its own, so that all of them wait for the timeout at the
     * same time. */
    gateway gateways[COUNT(cases)];
    int first[COUNT(cases)], second;

    for (unsigned i = 0; i < COUNT(cases); i++) {
        const late *c = &cases[i];

        start(&gateways[i], TIMEOUT, NULL);
        first[i] = tcp_connectTo(gateways[i].port);
        send_request(first[i], (const uint8_t *)c->request, c->lengths[0]);
        expect_request(&gateways[i], (const uint8_t *)c->request, c->lengths[0]);
    }
    for (unsigned i = 0; i < COUNT(cases); i++) {
        const late *c = &cases[i];
        const uint8_t no_response[] = {(uint8_t)(c->request[0] | 0x80), 0x0B};

        expect(first[i], no_response, sizeof no_response);
        second = tcp_connectTo(gateways[i].port);
        send_request(second, (const uint8_t *)c->other, c->lengths[2]);
        expect_request(&gateways[i], (const uint8_t *)c->other, c->lengths[2]);
        reply(&gateways[i], (const uint8_t *)c->late_reply, c->lengths[1]);
        reply(&gateways[i], (const uint8_t *)c->other_reply, c->lengths[3]);
        expect(second, (const uint8_t *)c->other_reply, c->lengths[3]);
        close(first[i]);
        close(second);
        stop(&gateways[i]);
    }
}

TEST(a_reply_that_does_not_answer_the_request_becomes_0b)
{
    static const char *const no_answers[][2] = {
        {"\x03\x00\x64\x00\x03", "\x03\x02\x12\x34"}, /* one register instead of three */
        {"\x03\x00\x64\x00\x01",
         "\x03\x06\x11\x11\x22\x22\x33\x33"},             /* three registers instead of one */
        {"\x01\x00\x64\x00\x09", "\x01\x01\xFF"},         /* one byte for nine coils */
        {"\x05\x00\x64\xFF\x00", "\x05\x00\x64\x00\x00"}, /* another value */
        {"\x06\x00\x64\x12\x34", "\x06\x00\x65\x12\x34"}, /* another address */
    };
    static const uint8_t lengths[][2] = {{5, 4}, {5, 8}, {5, 3}, {5, 5}, {5, 5}};
    gateway g;

    start(&g, "500ms", NULL);
    int fd = tcp_connectTo(g.port);
    for (unsigned i = 0; i < COUNT(no_answers); i++) {
        const uint8_t *request = (const uint8_t *)no_answers[i][0];
        const uint8_t no_response[] = {request[0] | 0x80, 0x0B};

        send_request(fd, request, lengths[i][0]);
        expect_request(&g, request, lengths[i][0]);
        reply(&g, (const uint8_t *)no_answers[i][1], lengths[i][1]);
        expect(fd, no_response, sizeof no_response);
    }
    close(fd);
    stop(&g);
}

TEST(a_request_that_the_standard_forbids_does_not_reach_the_line)
{
    gateway g;
    struct pollfd asked = {0, POLLIN, 0};

    start(&g, TIMEOUT, NULL);
    int fd = tcp_connectTo(g.port);
    ASK(fd, "\x03\x00\x64\x00\x00");
    EXPECT(fd, "\x83\x03");
    ASK(fd, "\x03\xFF\xFF\x00\x02");
    EXPECT(fd, "\x83\x02");
    ASK(fd, "\x10\x00\x64\x00\x02\x02\x12\x34");
    EXPECT(fd, "\x90\x03");
    asked.fd = g.line.ours;
    assert_int_equal(poll(&asked, 1, 0), 0);
    close(fd);
    stop(&g);
}

TEST(force_listen_only_mode_is_passed_on_and_gets_no_response)
{
    gateway g;

    start(&g, TIMEOUT, NULL);
    int fd = tcp_connectTo(g.port);
    ASK(fd, "\x08\x00\x04\x00\x00");
    REQUEST(&g, "\x08\x00\x04\x00\x00");
    ASK(fd, "\x07");
    REQUEST(&g, "\x07");
    REPLY(&g, "\x07\x6D");
    EXPECT(fd, "\x07\x6D");
    close(fd);
    stop(&g);
}

TEST(unknown_functions_pass_through)
{
    gateway g;

    start(&g, TIMEOUT, NULL);
    int fd = tcp_connectTo(g.port);
    ASK(fd, "\x64 any data");
    REQUEST(&g, "\x64 any data");
    REPLY(&g, "\x64 of any length at all");
    EXPECT(fd, "\x64 of any length at all");
    /* A sub-function of diagnostics that the standard reserves. */
    ASK(fd, "\x08\x00\x15\x00\x03\x00\x00");
    REQUEST(&g, "\x08\x00\x15\x00\x03\x00\x00");
    REPLY(&g, "\x08\x00\x15\x00\x04\x12\x34\x56\x78");
    EXPECT(fd, "\x08\x00\x15\x00\x04\x12\x34\x56\x78");
    /* CANopen. */
    ASK(fd, "\x2B\x0D\x01\x02\x03");
    REQUEST(&g, "\x2B\x0D\x01\x02\x03");
    REPLY(&g, "\x2B\x0D\x04\x05");
    EXPECT(fd, "\x2B\x0D\x04\x05");
    close(fd);
    stop(&g);
}

TEST(every_function_of_our_server_passes_through)
{
    gateway g;
    static served ours;

    served_prepare(&ours);
    served_on_line(&ours, MBM_FRAMING_RTU);
    start_at(&g, ours.line.path, TIMEOUT, NULL);
    int fd = tcp_connectTo(g.port);
    asked_functions(fd, MBM_FRAMING_TCP, &ours);
    close(fd);
    fd = tcp_connectTo(g.port);
    asked_lies(fd, MBM_FRAMING_TCP, &ours);
    close(fd);
    modbus_t *client = modbus_new_tcp("127.0.0.1", g.port);
    assert_non_null(client);
    assert_int_equal(modbus_connect(client), 0);
    modbus_set_response_timeout(client, PATIENCE_MS / 1000, 0);
    modbus_set_slave(client, SERVED_UNIT);
    asked_reads(client);
    asked_writes(client, &ours);
    asked_edges(client);
    asked_refusals(client, &ours);
    modbus_close(client);
    modbus_free(client);
    end(&g);
    served_stop(&ours);
}

/* The test checks only the shortest time, since a busy machine makes times longer. */
TEST(the_quiet_time_is_an_option)
{
    static const char *const options[] = {"--quiet-time", "1s", NULL};
    static const char *const bad[][7] = {
        {"gateway", "--quiet-time", "65536ms", "tcp://:0", "rtu:/dev/null", "1-9"},
        {"gateway", "--quiet-time", "-1ms", "tcp://:0", "rtu:/dev/null", "1-9"},
        {"gateway", "--quiet-time", "1x", "tcp://:0", "rtu:/dev/null", "1-9"},
        {"gateway", "--quiet-time", "", "tcp://:0", "rtu:/dev/null", "1-9"},
        {"gateway", "--no-such-time", "1s", "tcp://:0", "rtu:/dev/null", "1-9"},
    };
    gateway g;

    start(&g, "200ms", options);
    int fd = tcp_connectTo(g.port);
    double before = seconds();
    ASK(fd, "\x03\x00\x00\x00\x03");
    REQUEST(&g, "\x03\x00\x00\x00\x03");
    EXPECT(fd, "\x83\x0B");
    ASK(fd, "\x03\x00\x00\x00\x03");
    REQUEST(&g, "\x03\x00\x00\x00\x03");
    assert_true(seconds() - before >= 1.2);
    close(fd);
    stop(&g);
    for (unsigned i = 0; i < COUNT(bad); i++) {
        char text[64];

        program_start(&g.program, "mbm", bad[i]);
        assert_int_equal(program_rest(&g.program, text, sizeof text), 0);
        assert_int_equal(program_end(&g.program), 2);
    }
}
