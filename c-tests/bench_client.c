/* Compares the speed of mbm's master and client with that of other clients: all read ten registers
 * by FC03 from the same server over loopback TCP or over a pty. The server is a process of its own,
 * so that a profiler sees only the client.
 *
 *     bench_client listen           prints the port of a server, which serves until it is killed
 *     bench_client NAME COUNT       makes that many transactions, for callgrind; of TCP with the
 * port before COUNT bench_client NAME rounds      the same as often as a line with a count comes,
 * and prints for each the seconds, and p50 and p99 of one transaction in microseconds bench_client
 * names            prints the names, and whether each is over TCP bench_client polls prints how
 * long a poll without anything to do takes bench_client pollN COUNT      polls with N requests
 * in flight, for callgrind */
#define _GNU_SOURCE
#include "bench_client.h"

#include "clock.h"
#include "mbm_tcp.h"
#include "mbm_tty.h"
#include "pty.h"
#include "server.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <modbus.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

enum {
    RTU_REQUEST = 8,
    RTU_RESPONSE = 5 + 2 * QUANTITY,
    TCP_REQUEST = 12,
    TCP_RESPONSE = 9 + 2 * QUANTITY,
    FLIGHT = MBM_CLIENT_DEPTH
};

uint16_t expected[QUANTITY];

void fail(const char *what)
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

static int serve(int is_tcp, int fd)
{
    static uint8_t in[4096], out[4096 / RTU_REQUEST * TCP_RESPONSE];
    uint8_t rtu[RTU_RESPONSE] = {UNIT, 3, 2 * QUANTITY};
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

static int listening_socket(struct sockaddr_in *at)
{
    socklen_t length = sizeof *at;
    int listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);

    memset(at, 0, sizeof *at);
    at->sin_family = AF_INET;
    at->sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (listener < 0 || bind(listener, (struct sockaddr *)at, sizeof *at) != 0 ||
        listen(listener, 8) != 0 || getsockname(listener, (struct sockaddr *)at, &length) != 0)
        fail("listen");
    return listener;
}

/* Serves each connection in a process of its own. */
static int listen_and_serve(void)
{
    struct sockaddr_in at;
    int listener = listening_socket(&at), on = 1;

    (void)signal(SIGCHLD, SIG_IGN);
    printf("%u\n", ntohs(at.sin_port));
    fflush(stdout);
    for (;;) {
        int fd = accept(listener, NULL, NULL);

        if (fd < 0 || setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on) != 0)
            fail("accept");
        if (fork() == 0)
            _exit(serve(1, fd));
        close(fd);
    }
}

static int connect_to(const char *port)
{
    struct sockaddr_in at = {.sin_family = AF_INET,
                             .sin_addr = {htonl(INADDR_LOOPBACK)},
                             .sin_port = htons((uint16_t)atoi(port))};
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0), on = 1;

    if (fd < 0 || connect(fd, (struct sockaddr *)&at, sizeof at) != 0 ||
        setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on) != 0)
        fail("connect");
    return fd;
}

/* Opens a pty, and starts this program again as the server at its far end, which ends when this
 * process ends. */
static int open_line(const char *program)
{
    char number[12];
    pty line;

    pty_open(&line);
    switch (fork()) {
    case -1: fail("fork"); break;
    case 0:
        close(line.ours);
        snprintf(number, sizeof number, "%d", line.theirs);
        execl(program, program, "serve-line", number, (char *)NULL);
        _exit(127);
    default: close(line.theirs);
    }
    return line.ours;
}

/* --- how long each transaction took --- */

enum { MOST = 100000 };

static float taken[MOST];
static unsigned long noted;
static int is_noting;

static void note(double from, double to)
{
    if (noted < MOST)
        taken[noted++] = (float)((to - from) * 1e6);
}

/* --- mbm's client --- */

typedef struct bench {
    mbm_client client;
    mbm_clientRequest requests[FLIGHT];
    uint16_t replies[FLIGHT][QUANTITY];
    double begun[FLIGHT];
    uint8_t incoming[1024], outgoing[1024];
    mbm_tcp tcp;
    mbm_tty tty;
    int is_tcp;
    unsigned long to_queue, to_end, wrong;
} bench;

static bench mbm;

static void queue(bench *b, mbm_clientRequest *request)
{
    if (b->to_queue == 0)
        return;
    b->to_queue--;
    if (is_noting)
        b->begun[request - b->requests] = seconds();
    if (mbm_client_readHoldingRegisters(&b->client, request, ADDRESS, QUANTITY) != MBM_PENDING)
        b->wrong++;
}

static void done(void *context, mbm_clientRequest *request)
{
    bench *b = (bench *)context;

    b->to_end--;
    b->wrong += request->status != MBM_OK || memcmp(request->reply, expected, sizeof expected);
    if (is_noting)
        note(b->begun[request - b->requests], seconds());
    queue(b, request);
}

static int run_client(unsigned long count, unsigned flight)
{
    unsigned i;

    mbm.to_queue = mbm.to_end = count;
    mbm.wrong = 0;
    for (i = 0; i < flight; i++)
        queue(&mbm, &mbm.requests[i]);
    while (mbm_client_poll(&mbm.client) == MBM_PENDING) {
        uint32_t micros = mbm_client_pollDelay(&mbm.client);

        if (mbm.is_tcp)
            mbm_tcp_wait(&mbm.tcp, 1, NULL, -1, micros);
        else
            mbm_tty_wait(&mbm.tty, micros);
    }
    return mbm.to_end == 0 && mbm.wrong == 0;
}

/* The other clients keep no gap before a request, so mbm keeps none here either. */
static void begin_client(bench *b, const mbm_port *port)
{
    unsigned i;
    uint8_t begun = b->is_tcp
                        ? mbm_client_beginTcp(&b->client, port, b->incoming, sizeof b->incoming,
                                              b->outgoing, sizeof b->outgoing)
                        : mbm_client_beginRtu(&b->client, port, b->incoming, sizeof b->incoming);

    if (begun != MBM_OK || mbm_client_setGap(&b->client, 0) != MBM_OK)
        fail("mbm");
    if (b->is_tcp)
        (void)mbm_client_setInFlight(&b->client, FLIGHT);
    for (i = 0; i < FLIGHT; i++) {
        b->requests[i].unit = UNIT;
        b->requests[i].reply = b->replies[i];
        b->requests[i].replyBytes = sizeof b->replies[i];
        b->requests[i].done = done;
        b->requests[i].context = b;
    }
}

static void mbm_begin_tcp(int fd)
{
    mbm_port port;

    if (mbm_tcp_attach(&mbm.tcp, fd) != 0)
        fail("tcp");
    port = mbm_tcp_port(&mbm.tcp);
    mbm.is_tcp = 1;
    begin_client(&mbm, &port);
}

static void mbm_begin_rtu(int fd)
{
    mbm_port port;

    if (mbm_tty_attach(&mbm.tty, fd) != 0)
        fail("tty");
    port = mbm_tty_port(&mbm.tty);
    begin_client(&mbm, &port);
}

/* --- mbm's master --- */

static mbm_line line;
static mbm_node node;
static uint16_t response[QUANTITY], transmit[1];
static uint8_t frame[MBM_FRAME_BYTES(QUANTITY)];

static void master_begin(int fd)
{
    static mbm_port port;

    if (mbm_tty_attach(&mbm.tty, fd) != 0)
        fail("tty");
    port = mbm_tty_port(&mbm.tty);
    if (mbm_line_beginRtu(&line, &port, frame, sizeof frame) != MBM_OK ||
        mbm_node_begin(&node, &line, UNIT, response, QUANTITY, transmit, 1) != MBM_OK ||
        mbm_line_setGap(&line, 0) != MBM_OK)
        fail("mbm");
}

static const uint16_t *master_read(void)
{
    return mbm_node_readHoldingRegisters(&node, ADDRESS, QUANTITY) == MBM_OK ? response : NULL;
}

/* --- libmodbus --- */

static modbus_t *peer;

/* libmodbus needs the names only to make its object. Its own descriptors do not block. */
static void libmodbus_begin(int fd)
{
    if (!peer || modbus_set_slave(peer, UNIT) != 0 || modbus_set_socket(peer, fd) != 0 ||
        fcntl(fd, F_SETFL, O_NONBLOCK) != 0)
        fail("libmodbus");
}

static void libmodbus_begin_tcp(int fd)
{
    peer = modbus_new_tcp("127.0.0.1", 502);
    libmodbus_begin(fd);
}

static void libmodbus_begin_rtu(int fd)
{
    peer = modbus_new_rtu("/dev/null", 115200, 'N', 8, 1);
    libmodbus_begin(fd);
}

static const uint16_t *libmodbus_read(void)
{
    static uint16_t words[QUANTITY];

    return modbus_read_registers(peer, ADDRESS, QUANTITY, words) == QUANTITY ? words : NULL;
}

/* --- the measurements --- */

/* A client of mbm has no `read`: its requests are queued, one or 16 at a time. */
static const contender contenders[] = {
    {"mbm-master-rtu", 0, master_begin, master_read},
    {"mbm-rtu", 0, mbm_begin_rtu, NULL},
    {"libmodbus-rtu", 0, libmodbus_begin_rtu, libmodbus_read},
    {"floor-rtu", 0, floor_begin, floor_read_rtu},
    {"mbm-tcp", 1, mbm_begin_tcp, NULL},
    {"mbm16-tcp", 1, mbm_begin_tcp, NULL},
    {"libmodbus-tcp", 1, libmodbus_begin_tcp, libmodbus_read},
    {"floor-tcp", 1, floor_begin, floor_read_tcp},
#ifdef WITH_NANOMODBUS
    {"nanomodbus-rtu", 0, nano_begin_rtu, nano_read_registers},
    {"nanomodbus-tcp", 1, nano_begin_tcp, nano_read_registers},
#endif
};

enum { CONTENDERS = sizeof contenders / sizeof *contenders };

static int run_one_by_one(const contender *client, unsigned long count)
{
    double from = is_noting ? seconds() : 0;

    for (; count > 0; count--) {
        const uint16_t *words = client->read();

        if (!words || memcmp(words, expected, sizeof expected) != 0)
            return 0;
        if (is_noting) {
            double now = seconds();

            note(from, now);
            from = now;
        }
    }
    return 1;
}

static void run(const contender *client, unsigned long count)
{
    int is_right = client->read
                       ? run_one_by_one(client, count)
                       : run_client(count, strncmp(client->name, "mbm16", 5) == 0 ? FLIGHT : 1);

    if (!is_right) {
        fprintf(stderr, "bench: %s returned wrong data\n", client->name);
        exit(1);
    }
}

static int by_size(const void *left, const void *right)
{
    float a = *(const float *)left, b = *(const float *)right;

    return (a > b) - (a < b);
}

static void run_rounds(const contender *client)
{
    char words[32];

    is_noting = 1;
    while (fgets(words, sizeof words, stdin)) {
        double from = seconds(), took;

        noted = 0;
        run(client, strtoul(words, NULL, 10));
        took = seconds() - from;
        qsort(taken, noted, sizeof *taken, by_size);
        printf("%.6f\t%.1f\t%.1f\n", took, taken[noted / 2], taken[noted * 99 / 100]);
        fflush(stdout);
    }
}

/* A port on which nothing arrives, with a clock that stands still. */
static int16_t quiet_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    return 0;
}

static int16_t quiet_write(void *context, const uint8_t *bytes, uint16_t length)
{
    return (int16_t)length;
}

static uint32_t quiet_micros(void *context)
{
    return 0;
}

/* Makes `count` polls while `flight` requests are in flight. No timeout is due. */
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
                            sizeof b.outgoing) != MBM_OK ||
        mbm_client_setInFlight(&b.client, FLIGHT) != MBM_OK)
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
    enum { POLLS = 1000000, POLL_ROUNDS = 11 };
    float took[POLL_ROUNDS];
    unsigned round;

    for (round = 0; round < POLL_ROUNDS; round++) {
        double from = seconds();

        poll_with(flight, POLLS);
        took[round] = (float)((seconds() - from) / POLLS * 1e9);
    }
    qsort(took, POLL_ROUNDS, sizeof *took, by_size);
    printf("%u\t%.1f\n", flight, took[POLL_ROUNDS / 2]);
}

static int usage(void)
{
    fprintf(stderr,
            "usage: bench_client listen | names | polls | pollN COUNT | NAME [PORT] COUNT | "
            "NAME [PORT] rounds\n");
    return 2;
}

int main(int argc, char **argv)
{
    const contender *client = NULL;
    unsigned i;

    for (i = 0; i < QUANTITY; i++)
        expected[i] = server_pattern(ADDRESS + i);
    if (argc == 2 && strcmp(argv[1], "listen") == 0)
        return listen_and_serve();
    if (argc == 3 && strcmp(argv[1], "serve-line") == 0)
        return serve(0, atoi(argv[2]));
    if (argc == 2 && strcmp(argv[1], "names") == 0) {
        for (i = 0; i < CONTENDERS; i++)
            printf("%s\t%d\n", contenders[i].name, contenders[i].is_tcp);
        return 0;
    }
    if (argc == 2 && strcmp(argv[1], "polls") == 0) {
        time_polls(0);
        time_polls(1);
        time_polls(FLIGHT);
        return 0;
    }
    if (argc == 3 && strncmp(argv[1], "poll", 4) == 0) {
        poll_with((unsigned)atoi(argv[1] + 4), strtoul(argv[2], NULL, 10));
        return 0;
    }
    for (i = 0; argc > 1 && i < CONTENDERS; i++)
        if (strcmp(argv[1], contenders[i].name) == 0)
            client = &contenders[i];
    if (!client || argc != 3 + client->is_tcp)
        return usage();
    client->begin(client->is_tcp ? connect_to(argv[2]) : open_line(argv[0]));
    if (strcmp(argv[argc - 1], "rounds") == 0)
        run_rounds(client);
    else
        run(client, strtoul(argv[argc - 1], NULL, 10));
    return 0;
}
