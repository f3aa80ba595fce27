/* Our server beside libmodbus's, for the same requests.
 *
 *     bench_server          requests per second of two server loops, 32 connections
 *     bench_server count    the requests one by one, for callgrind to count */
#define _GNU_SOURCE
#include "crc.h"
#include "mbm_tcp.h"
#include "mbm_tty.h"

#include <fcntl.h>
#include <modbus.h>
#include <netinet/in.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/select.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
#include <valgrind/callgrind.h>

enum {
    UNIT = 17,
    CELLS = 200,
    CLIENTS = 32,
    ROUNDS = 9,
    PER_ROUND = 20000,
    COUNTED = 500,
    MOST = 260
};

static void fail(const char *what)
{
    perror(what);
    exit(1);
}

static uint16_t pattern(unsigned address)
{
    return (uint16_t)(address * 40503u + 0x1234u);
}

/* What both serve: four tables with one pattern. */
static mbm_unit unit;
static mbm_registerTable holding, inputs;
static mbm_bitTable coils, discrete;
static uint16_t words[CELLS], input_words[CELLS];
static uint8_t bits[CELLS / 8], input_bits[CELLS / 8];
static modbus_mapping_t *mapping;

static void prepare(void)
{
    unsigned i;

    mapping = modbus_mapping_new(CELLS, CELLS, CELLS, CELLS);
    if (!mapping)
        fail("mapping");
    for (i = 0; i < CELLS; i++) {
        words[i] = mapping->tab_registers[i] = pattern(i);
        input_words[i] = mapping->tab_input_registers[i] = (uint16_t)~pattern(i);
        mapping->tab_bits[i] = mapping->tab_input_bits[i] = pattern(i) >> 7 & 1;
        bits[i / 8] |= (uint8_t)(mapping->tab_bits[i] << i % 8);
        input_bits[i / 8] = bits[i / 8];
    }
    unit.id = UNIT;
    holding.words = words;
    inputs.words = input_words;
    coils.bits = bits;
    discrete.bits = input_bits;
    holding.size = inputs.size = coils.size = discrete.size = CELLS;
    if (mbm_server_serveCoils(&unit, &coils) || mbm_server_serveDiscreteInputs(&unit, &discrete) ||
        mbm_server_serveHoldingRegisters(&unit, &holding) ||
        mbm_server_serveMaskAndReadWrite(&holding) ||
        mbm_server_serveInputRegisters(&unit, &inputs))
        fail("unit");
}

/* Requests, without unit and what frames them. */
typedef struct asked {
    const char *name;
    uint16_t length;
    uint8_t pdu[40];
} asked;

static const asked requests[] = {
    {"01 Read Coils, 19", 5, {1, 0, 7, 0, 19}},
    {"02 Read Discrete Inputs, 19", 5, {2, 0, 7, 0, 19}},
    {"03 Read Holding Registers, 10", 5, {3, 0, 7, 0, 10}},
    {"03 Read Holding Registers, 125", 5, {3, 0, 7, 0, 125}},
    {"04 Read Input Registers, 10", 5, {4, 0, 7, 0, 10}},
    {"05 Write Single Coil", 5, {5, 0, 7, 0xFF, 0}},
    {"06 Write Single Register", 5, {6, 0, 7, 0x12, 0x34}},
    {"0F Write Multiple Coils, 19", 9, {15, 0, 7, 0, 19, 3, 0xA5, 0x5A, 0x02}},
    {"10 Write Multiple Registers, 10", 26, {16, 0, 7, 0, 10, 20, 1, 2, 3, 4, 5, 6, 7, 8, 9}},
    {"16 Mask Write Register", 7, {22, 0, 7, 0, 0xF2, 0, 0x25}},
    {"17 Read/Write Multiple Registers, 10", 30, {23, 0, 7, 0, 10, 0, 7, 0, 10, 20, 9, 8, 7, 6, 5}},
    {"03 Read Holding Registers, none there", 5, {3, 0x77, 0, 0, 1}},
};

enum { REQUESTS = sizeof requests / sizeof *requests };

static uint16_t frame_of(const asked *request, int is_rtu, uint8_t *frame)
{
    uint16_t length = request->length;

    if (is_rtu) {
        frame[0] = UNIT;
        memcpy(frame + 1, request->pdu, length);
        seal(frame, length + 1u);
        return (uint16_t)(length + 3);
    }
    memset(frame, 0, 7);
    frame[1] = 1;
    frame[5] = (uint8_t)(length + 1);
    frame[6] = UNIT;
    memcpy(frame + 7, request->pdu, length);
    return (uint16_t)(length + 7);
}

/* --- instructions --- */

static int ends[2];
static mbm_server server;
static uint8_t buffer[MBM_MAX_TCP_FRAME];
static mbm_tcp tcp;
static mbm_tty tty;
static modbus_t *peer;

static void serve_by_mbm(void)
{
    struct pollfd more = {ends[1], POLLIN, 0};

    do {
        if (mbm_server_poll(&server) != MBM_OK)
            fail("mbm");
    } while (poll(&more, 1, 0) == 0);
}

static void serve_by_libmodbus(void)
{
    uint8_t request[MOST];
    int length = modbus_receive(peer, request);

    if (length > 0)
        modbus_reply(peer, request, length, mapping);
}

static void begin(int is_rtu)
{
    mbm_port port;

    if (socketpair(AF_UNIX, SOCK_STREAM, 0, ends) != 0)
        fail("socketpair");
    memset(&server, 0, sizeof server);
    if (is_rtu) {
        /* A frame ends where nothing more is there: libmodbus keeps no silence. */
        if (mbm_tty_attach(&tty, ends[0]) != 0)
            fail("tty");
        port = mbm_tty_port(&tty);
        if (mbm_server_begin(&server, &port, &unit, 1, buffer, sizeof buffer) ||
            mbm_server_setSilence(&server, 0))
            fail("mbm");
        peer = modbus_new_rtu("/dev/null", 115200, 'N', 8, 1);
    } else {
        if (mbm_tcp_attach(&tcp, ends[0]) != 0)
            fail("tcp");
        port = mbm_tcp_port(&tcp);
        if (mbm_server_beginTcp(&server, &port, &unit, 1, buffer, sizeof buffer))
            fail("mbm");
        peer = modbus_new_tcp("127.0.0.1", 1502);
    }
    if (!peer || modbus_set_slave(peer, UNIT) || modbus_set_socket(peer, ends[0]))
        fail("libmodbus");
}

static void end(void)
{
    modbus_free(peer);
    mbm_tcp_close(&tcp);
    close(ends[0]);
    close(ends[1]);
}

/* Both answer alike, byte for byte. */
static void count(int is_rtu)
{
    void (*const serves[])(void) = {serve_by_libmodbus, serve_by_mbm};
    const char *const names[] = {"libmodbus", "mbm"};
    uint8_t request[MOST], first[MOST], answer[MOST];
    ssize_t got, expected;
    unsigned r, s, i;
    char title[100];

    for (r = 0; r < REQUESTS; r++) {
        uint16_t length = frame_of(&requests[r], is_rtu, request);

        expected = 0;
        for (s = 0; s < 2; s++) {
            for (i = 0; i <= COUNTED; i++) {
                if (i == 1)
                    CALLGRIND_ZERO_STATS;
                if (write(ends[1], request, length) != length)
                    fail("write");
                serves[s]();
                got = read(ends[1], answer, sizeof answer);
                if (s == 0 && i == 0) {
                    memcpy(first, answer, sizeof first);
                    expected = got;
                }
                if (got <= 0 || got != expected || memcmp(answer, first, (size_t)got) != 0) {
                    fprintf(stderr, "bench: %s answers %s otherwise\n", names[s], requests[r].name);
                    exit(1);
                }
            }
            snprintf(title, sizeof title, "%s\t%s\t%s\t%d", is_rtu ? "RTU" : "TCP",
                     requests[r].name, names[s], COUNTED);
            CALLGRIND_DUMP_STATS_AT(title);
        }
    }
}

/* --- two server loops --- */

static mbm_tcp places[CLIENTS];
static mbm_server servers[CLIENTS];
static uint8_t buffers[CLIENTS][MBM_MAX_TCP_FRAME];

static void loop_of_mbm(mbm_tcp_listener *listener)
{
    struct pollfd waits[CLIENTS + 1];
    int i, used = 0;

    waits[CLIENTS] = (struct pollfd){listener->fd, POLLIN, 0};
    for (i = 0; i < CLIENTS; i++)
        waits[i] = (struct pollfd){-1, POLLIN, 0};
    for (;;) {
        poll(waits, CLIENTS + 1, -1);
        if (waits[CLIENTS].revents && (i = mbm_tcp_accept(listener, places, CLIENTS)) >= 0) {
            mbm_port port = mbm_tcp_port(&places[i]);

            if (mbm_server_beginTcp(&servers[i], &port, &unit, 1, buffers[i], MBM_MAX_TCP_FRAME))
                fail("begin");
            waits[i].fd = places[i].fd;
            used++;
        }
        for (i = 0; i < CLIENTS; i++) {
            if (waits[i].fd >= 0 && waits[i].revents && mbm_server_poll(&servers[i]) != MBM_OK) {
                mbm_tcp_close(&places[i]);
                waits[i].fd = -1;
                if (--used == 0)
                    return;
            }
        }
    }
}

/* As its own program with many connections does. */
static void loop_of_libmodbus(const mbm_tcp_listener *listener)
{
    modbus_t *host = modbus_new_tcp("127.0.0.1", 1502);
    uint8_t request[MODBUS_TCP_MAX_ADU_LENGTH];
    int fd, top = listener->fd, used = 0, length;
    fd_set all, ready;

    if (!host)
        fail("libmodbus");
    FD_ZERO(&all);
    FD_SET(listener->fd, &all);
    for (;;) {
        ready = all;
        if (select(top + 1, &ready, NULL, NULL, NULL) < 0)
            fail("select");
        for (fd = 0; fd <= top; fd++) {
            if (!FD_ISSET(fd, &ready))
                continue;
            if (fd == listener->fd) {
                int client = accept(fd, NULL, NULL);

                if (client < 0)
                    continue;
                FD_SET(client, &all);
                top = client > top ? client : top;
                used++;
                continue;
            }
            modbus_set_socket(host, fd);
            length = modbus_receive(host, request);
            if (length > 0) {
                modbus_reply(host, request, length, mapping);
            } else if (length < 0) {
                close(fd);
                FD_CLR(fd, &all);
                if (--used == 0)
                    return;
            }
        }
    }
}

static pid_t start(int is_mbm, uint16_t *port)
{
    mbm_tcp_listener listener = {0};
    pid_t child;

    if (mbm_tcp_listen(&listener, "127.0.0.1", "0") != 0)
        fail("listen");
    *port = listener.port;
    child = fork();
    if (child < 0)
        fail("fork");
    if (child == 0) {
        if (is_mbm)
            loop_of_mbm(&listener);
        else
            loop_of_libmodbus(&listener);
        _exit(0);
    }
    mbm_tcp_closeListener(&listener);
    return child;
}

/* 32 connections, each with one request under way. */
typedef struct crowd {
    int wait;
    int fds[CLIENTS];
} crowd;

static void gather(crowd *c, uint16_t port)
{
    struct sockaddr_in address = {.sin_family = AF_INET,
                                  .sin_addr = {htonl(INADDR_LOOPBACK)},
                                  .sin_port = htons(port)};
    int i;

    c->wait = epoll_create1(0);
    for (i = 0; i < CLIENTS; i++) {
        struct epoll_event event = {.events = EPOLLIN};

        c->fds[i] = event.data.fd = socket(AF_INET, SOCK_STREAM, 0);
        if (connect(c->fds[i], (struct sockaddr *)&address, sizeof address) != 0 ||
            epoll_ctl(c->wait, EPOLL_CTL_ADD, c->fds[i], &event) != 0)
            fail("connect");
    }
}

static void leave(crowd *c)
{
    int i;

    for (i = 0; i < CLIENTS; i++)
        close(c->fds[i]);
    close(c->wait);
}

/* Requests per second. */
static double ask(const crowd *c, unsigned long total)
{
    static const uint8_t request[] = {0, 1, 0, 0, 0, 6, UNIT, 3, 0, 7, 0, 10};
    uint8_t expected[29] = {0, 1, 0, 0, 0, 23, UNIT, 3, 20}, answer[MOST];
    struct timespec from, to;
    unsigned long sent = 0, done = 0;
    int i;

    for (i = 0; i < 10; i++) {
        expected[9 + 2 * i] = (uint8_t)(pattern(7u + (unsigned)i) >> 8);
        expected[10 + 2 * i] = (uint8_t)pattern(7u + (unsigned)i);
    }
    clock_gettime(CLOCK_MONOTONIC, &from);
    for (; sent < CLIENTS; sent++)
        if (write(c->fds[sent], request, sizeof request) != sizeof request)
            fail("write");
    while (done < total) {
        struct epoll_event events[CLIENTS];
        int ready = epoll_wait(c->wait, events, CLIENTS, 10000);

        if (ready <= 0)
            fail("no answer");
        for (i = 0; i < ready; i++) {
            ssize_t got = read(events[i].data.fd, answer, sizeof answer);

            if (got != sizeof expected || memcmp(answer, expected, sizeof expected) != 0)
                fail("wrong answer");
            done++;
            if (sent == total)
                continue;
            sent++;
            if (write(events[i].data.fd, request, sizeof request) != sizeof request)
                fail("write");
        }
    }
    clock_gettime(CLOCK_MONOTONIC, &to);
    return (double)total /
           ((double)(to.tv_sec - from.tv_sec) + (double)(to.tv_nsec - from.tv_nsec) * 1e-9);
}

static int by_size(const void *left, const void *right)
{
    double a = *(const double *)left, b = *(const double *)right;

    return (a > b) - (a < b);
}

static void pin(pid_t process, int cpu)
{
    cpu_set_t all, one;
    size_t index = 0;

    if (sched_getaffinity(0, sizeof all, &all) != 0)
        fail("sched_getaffinity");
    CPU_ZERO(&one);
    for (; index < CPU_SETSIZE; index++)
        if (CPU_ISSET(index, &all) && cpu-- == 0)
            CPU_SET(index, &one);
    /* A machine of one CPU has no second. */
    if (CPU_COUNT(&one) && sched_setaffinity(process, sizeof one, &one) != 0)
        fail("sched_setaffinity");
}

/* Rounds alternate, so that both meet the same weather. */
static void compare(const char *where, const crowd *ours, const crowd *theirs)
{
    double mbm[ROUNDS], libmodbus[ROUNDS];
    unsigned round;

    ask(ours, PER_ROUND / 10);
    ask(theirs, PER_ROUND / 10);
    for (round = 0; round < ROUNDS; round++) {
        mbm[round] = ask(ours, PER_ROUND);
        libmodbus[round] = ask(theirs, PER_ROUND);
    }
    qsort(mbm, ROUNDS, sizeof *mbm, by_size);
    qsort(libmodbus, ROUNDS, sizeof *libmodbus, by_size);
    printf("%s\t%.0f\t%.0f\t%.2f\n", where, mbm[ROUNDS / 2], libmodbus[ROUNDS / 2],
           mbm[ROUNDS / 2] / libmodbus[ROUNDS / 2]);
    fflush(stdout);
}

static void compare_loops(void)
{
    pid_t children[2];
    uint16_t ports[2];
    crowd ours, theirs;

    children[0] = start(1, &ports[0]);
    children[1] = start(0, &ports[1]);
    gather(&ours, ports[0]);
    gather(&theirs, ports[1]);
    pin(children[0], 1);
    pin(children[1], 1);
    compare("on CPUs of their own", &ours, &theirs);
    pin(children[0], 0);
    pin(children[1], 0);
    pin(0, 0);
    compare("clients and server on one CPU", &ours, &theirs);
    leave(&ours);
    leave(&theirs);
    waitpid(children[0], NULL, 0);
    waitpid(children[1], NULL, 0);
}

int main(int argc, char **argv)
{
    int is_rtu;

    signal(SIGPIPE, SIG_IGN);
    prepare();
    if (argc == 1) {
        compare_loops();
    } else if (argc == 2 && strcmp(argv[1], "count") == 0) {
        for (is_rtu = 0; is_rtu < 2; is_rtu++) {
            begin(is_rtu);
            count(is_rtu);
            end();
        }
    } else {
        fprintf(stderr, "usage: bench_server [count]\n");
        return 2;
    }
    modbus_mapping_free(mapping);
    return 0;
}
