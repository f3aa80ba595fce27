/* Compares the speed of mbm's non-blocking client with that of libmodbus: both read ten
 * registers by FC03 from one server over loopback TCP and over one pty. The server is a
 * process of its own, so that a profiler sees only the client. */
#define _GNU_SOURCE
#include "clock.h"
#include "mbm_tcp.h"
#include "mbm_tty.h"
#include "pty.h"
#include "server.h"

#include <arpa/inet.h>
#include <modbus.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

enum {
    UNIT = 17,
    ADDRESS = 7,
    QUANTITY = 10,
    ROUNDS = 11,
    PER_ROUND = 4000,
    RTU_REQUEST = 8,
    RTU_RESPONSE = 5 + 2 * QUANTITY,
    TCP_REQUEST = 12,
    TCP_RESPONSE = 9 + 2 * QUANTITY,
    FLIGHT = MBM_CLIENT_DEPTH
};

static uint16_t expected[QUANTITY];

static void fail(const char *what)
{
    perror(what);
    exit(1);
}

/* --- the server: it answers all complete requests that have arrived, in order, in one write */

static size_t answer(int is_tcp, const uint8_t *request, uint8_t *response, const uint8_t *rtu)
{
    unsigned i;

    if (!is_tcp) {
        memcpy(response, rtu, RTU_RESPONSE);
        return RTU_RESPONSE;
    }
    memcpy(response, request, 8);
    response[4] = 0;
    response[5] = TCP_RESPONSE - 6;
    response[8] = 2 * QUANTITY;
    for (i = 0; i < QUANTITY; i++) {
        response[9 + 2 * i] = (uint8_t)(expected[i] >> 8);
        response[10 + 2 * i] = (uint8_t)expected[i];
    }
    return TCP_RESPONSE;
}

static uint16_t crc(const uint8_t *bytes, size_t length)
{
    uint16_t sum = 0xFFFF;
    unsigned bit;

    for (; length > 0; length--)
        for (sum ^= *bytes++, bit = 0; bit < 8; bit++)
            sum = (uint16_t)(sum & 1 ? sum >> 1 ^ 0xA001 : sum >> 1);
    return sum;
}

static int serve(const char *kind, int fd)
{
    static uint8_t in[4096], out[4096 / RTU_REQUEST * TCP_RESPONSE];
    uint8_t rtu[RTU_RESPONSE] = {UNIT, 3, 2 * QUANTITY};
    int is_tcp = strcmp(kind, "tcp") == 0;
    size_t request = is_tcp ? TCP_REQUEST : RTU_REQUEST, have = 0;
    unsigned i;

    for (i = 0; i < QUANTITY; i++) {
        rtu[3 + 2 * i] = (uint8_t)(expected[i] >> 8);
        rtu[4 + 2 * i] = (uint8_t)expected[i];
    }
    rtu[RTU_RESPONSE - 2] = (uint8_t)crc(rtu, RTU_RESPONSE - 2);
    rtu[RTU_RESPONSE - 1] = (uint8_t)(crc(rtu, RTU_RESPONSE - 2) >> 8);
    for (;;) {
        ssize_t got = read(fd, in + have, sizeof in - have);
        size_t at = 0, filled = 0;

        if (got <= 0)
            return 0;
        for (have += (size_t)got; have - at >= request; at += request)
            filled += answer(is_tcp, in + at, out + filled, rtu);
        have -= at;
        memmove(in, in + at, have);
        if (filled > 0 && write(fd, out, filled) != (ssize_t)filled)
            return 1;
    }
}

/* Starts this program again as the server at the far end of `fd`. */
static pid_t start_server(const char *program, const char *kind, int fd)
{
    char number[12];
    pid_t child = fork();

    if (child < 0)
        fail("fork");
    if (child == 0) {
        snprintf(number, sizeof number, "%d", fd);
        execl(program, program, "serve", kind, number, (char *)NULL);
        _exit(127);
    }
    close(fd);
    return child;
}

/* --- the clients; each function makes `count` transactions */

typedef struct bench {
    mbm_client client;
    mbm_clientRequest requests[FLIGHT];
    uint16_t replies[FLIGHT][QUANTITY];
    uint8_t incoming[1024], outgoing[1024];
    mbm_tcp tcp;
    mbm_tty tty;
    modbus_t *peer;
    int fd; /* of the pty */
    unsigned flight;
    unsigned long to_queue, to_end, wrong;
} bench;

static bench line, stream;

static void queue(bench *b, mbm_clientRequest *request)
{
    if (b->to_queue == 0)
        return;
    b->to_queue--;
    if (mbm_client_readHoldingRegisters(&b->client, request, ADDRESS, QUANTITY) != MBM_PENDING)
        b->wrong++;
}

static void done(void *context, mbm_clientRequest *request)
{
    bench *b = (bench *)context;

    b->to_end--;
    b->wrong += request->status != MBM_OK || memcmp(request->reply, expected, sizeof expected);
    queue(b, request);
}

static void wait_for(bench *b)
{
    uint32_t micros = mbm_client_pollDelay(&b->client);

    if (b == &stream)
        mbm_tcp_wait(&b->tcp, 1, NULL, -1, micros);
    else
        mbm_tty_wait(&b->tty, micros);
}

static int by_mbm(bench *b, unsigned long count)
{
    unsigned i;

    b->to_queue = b->to_end = count;
    b->wrong = 0;
    for (i = 0; i < b->flight; i++)
        queue(b, &b->requests[i]);
    while (mbm_client_poll(&b->client) == MBM_PENDING)
        wait_for(b);
    return b->to_end == 0 && b->wrong == 0;
}

static int by_libmodbus(bench *b, unsigned long count)
{
    uint16_t words[QUANTITY];

    for (; count > 0; count--)
        if (modbus_read_registers(b->peer, ADDRESS, QUANTITY, words) != QUANTITY ||
            memcmp(words, expected, sizeof expected) != 0)
            return 0;
    return 1;
}

typedef int (*transact)(bench *, unsigned long);

static int by_mbm_16(bench *b, unsigned long count)
{
    int right;

    b->flight = FLIGHT;
    right = by_mbm(b, count);
    b->flight = 1;
    return right;
}

static void run(transact clients, bench *b, unsigned long count)
{
    if (!clients(b, count)) {
        fprintf(stderr, "bench: a transaction returned wrong data\n");
        exit(1);
    }
}

/* --- the measurements */

static int by_size(const void *left, const void *right)
{
    double a = *(const double *)left, b = *(const double *)right;

    return (a > b) - (a < b);
}

/* Prints one line: the name, the CPUs, and the median of the transactions per second of up
 * to three clients. The clients are measured in alternate rounds, so that the load of the
 * machine affects all alike. */
static void compare(const char *name, const char *where, bench *b, const transact *clients,
                    unsigned count)
{
    double rates[3][ROUNDS];
    unsigned round, i;

    for (round = 0; round < ROUNDS; round++)
        for (i = 0; i < count; i++) {
            double from = seconds();

            run(clients[i], b, PER_ROUND);
            rates[i][round] = PER_ROUND / (seconds() - from);
        }
    printf("%s\t%s", name, where);
    for (i = 0; i < count; i++) {
        qsort(rates[i], ROUNDS, sizeof *rates[i], by_size);
        printf("\t%.0f", rates[i][ROUNDS / 2]);
    }
    printf("\n");
    fflush(stdout);
}

static const transact clients[] = {by_mbm, by_libmodbus, by_mbm_16};

static void on_one_cpu(const pid_t *servers)
{
    cpu_set_t all, one;
    size_t cpu = 0;
    unsigned i;

    if (sched_getaffinity(0, sizeof all, &all) != 0)
        fail("sched_getaffinity");
    while (!CPU_ISSET(cpu, &all))
        cpu++;
    CPU_ZERO(&one);
    CPU_SET(cpu, &one);
    for (i = 0; i < 3; i++)
        if (sched_setaffinity(i < 2 ? servers[i] : 0, sizeof one, &one) != 0)
            fail("sched_setaffinity");
    compare("tcp", "one", &stream, clients, 3);
    compare("rtu", "one", &line, clients, 2);
    for (i = 0; i < 3; i++)
        if (sched_setaffinity(i < 2 ? servers[i] : 0, sizeof all, &all) != 0)
            fail("sched_setaffinity");
}

/* A port on which nothing arrives, with a clock that stands still. */
static int16_t quiet_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    (void)context, (void)bytes, (void)capacity;
    return 0;
}

static int16_t quiet_write(void *context, const uint8_t *bytes, uint16_t length)
{
    (void)context, (void)bytes;
    return (int16_t)length;
}

static uint32_t quiet_micros(void *context)
{
    (void)context;
    return 0;
}

/* Makes `count` polls while `flight` requests are under way. No timeout is due. */
static void poll_with(unsigned flight, unsigned long count)
{
    static bench b;
    mbm_port port = {0};
    unsigned i;

    memset(&b, 0, sizeof b);
    port.read = quiet_read;
    port.write = quiet_write;
    port.micros = quiet_micros;
    if (mbm_client_beginTcp(&b.client, &port, b.incoming, sizeof b.incoming, b.outgoing,
                            sizeof b.outgoing) != MBM_OK)
        fail("mbm");
    b.to_queue = flight;
    for (i = 0; i < flight; i++) {
        b.requests[i].unit = UNIT;
        queue(&b, &b.requests[i]);
    }
    mbm_client_poll(&b.client);
    for (; count > 0; count--)
        if (mbm_client_poll(&b.client) != (flight ? MBM_PENDING : MBM_OK))
            fail("poll");
}

static void time_polls(unsigned flight)
{
    enum { POLLS = 2000000 };
    double best = 1e9;
    unsigned round;

    for (round = 0; round < ROUNDS; round++) {
        double from = seconds(), took;

        poll_with(flight, POLLS);
        took = (seconds() - from) / POLLS * 1e9;
        if (took < best)
            best = took;
    }
    printf("poll\t%u\t%.1f\n", flight, best);
}

static void begin(bench *b, const mbm_port *port)
{
    unsigned i;
    uint8_t begun = b == &stream
                        ? mbm_client_beginTcp(&b->client, port, b->incoming, sizeof b->incoming,
                                              b->outgoing, sizeof b->outgoing)
                        : mbm_client_beginRtu(&b->client, port, b->incoming, sizeof b->incoming);

    /* libmodbus keeps no gap before a request, so mbm keeps none here either. */
    if (begun != MBM_OK || mbm_client_setGap(&b->client, 0) != MBM_OK)
        fail("mbm");
    b->flight = 1;
    for (i = 0; i < FLIGHT; i++) {
        b->requests[i].unit = UNIT;
        b->requests[i].reply = b->replies[i];
        b->requests[i].replyBytes = sizeof b->replies[i];
        b->requests[i].done = done;
        b->requests[i].context = b;
    }
    if (!b->peer || modbus_set_slave(b->peer, UNIT) != 0 || modbus_set_socket(b->peer, b->fd) != 0)
        fail("libmodbus client");
}

/* Connects a stream over the loopback device. Returns the server's end. */
static int begin_stream(void)
{
    struct sockaddr_in at = {0};
    socklen_t length = sizeof at;
    int listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0), far = -1, on = 1;
    mbm_port port;

    at.sin_family = AF_INET;
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    stream.fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (listener < 0 || stream.fd < 0 || bind(listener, (struct sockaddr *)&at, sizeof at) != 0 ||
        listen(listener, 1) != 0 || getsockname(listener, (struct sockaddr *)&at, &length) != 0 ||
        connect(stream.fd, (struct sockaddr *)&at, sizeof at) != 0 ||
        (far = accept(listener, NULL, NULL)) < 0 ||
        setsockopt(far, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on) != 0)
        fail("loopback");
    close(listener);
    /* Both clients use the same descriptor. libmodbus needs the address only to make its
     * object. */
    if (mbm_tcp_attach(&stream.tcp, stream.fd) != 0)
        fail("tcp");
    port = mbm_tcp_port(&stream.tcp);
    stream.peer = modbus_new_tcp("127.0.0.1", 502);
    begin(&stream, &port);
    return far;
}

static void begin_line(int fd)
{
    mbm_port port;

    line.fd = fd;
    if (mbm_tty_attach(&line.tty, fd) != 0)
        fail("tty");
    port = mbm_tty_port(&line.tty);
    line.peer = modbus_new_rtu("/dev/null", 115200, 'N', 8, 1);
    begin(&line, &port);
}

int main(int argc, char **argv)
{
    pid_t servers[2];
    pty ends;
    unsigned i;

    for (i = 0; i < QUANTITY; i++)
        expected[i] = server_pattern(ADDRESS + i);
    if (argc == 4 && strcmp(argv[1], "serve") == 0)
        return serve(argv[2], atoi(argv[3]));
    if (argc == 3 && strncmp(argv[1], "poll", 4) == 0) {
        poll_with((unsigned)atoi(argv[1] + 4), strtoul(argv[2], NULL, 10));
        return 0;
    }
    servers[0] = start_server(argv[0], "tcp", begin_stream());
    pty_open(&ends);
    begin_line(ends.ours);
    servers[1] = start_server(argv[0], "rtu", dup(ends.theirs));
    if (argc == 1) {
        on_one_cpu(servers);
        /* Over a pty on several CPUs the scheduler decides the result, not the client. */
        compare("tcp", "any", &stream, clients, 3);
        time_polls(0);
        time_polls(1);
        time_polls(FLIGHT);
    } else if (argc == 3) {
        unsigned long count = strtoul(argv[2], NULL, 10);
        bench *b = strstr(argv[1], "rtu") ? &line : &stream;

        stream.flight = strstr(argv[1], "16") ? FLIGHT : 1;
        run(strncmp(argv[1], "libmodbus", 9) == 0 ? by_libmodbus : by_mbm, b, count);
    } else {
        fprintf(stderr, "usage: bench_client [mbm-tcp | mbm-tcp16 | libmodbus-tcp | mbm-rtu | "
                        "libmodbus-rtu | poll0 | poll16] N\n");
    }
    for (i = 0; i < 2; i++) {
        kill(servers[i], SIGKILL);
        waitpid(servers[i], NULL, 0);
    }
    modbus_free(line.peer);
    modbus_free(stream.peer);
    pty_close(&ends);
    return 0;
}
