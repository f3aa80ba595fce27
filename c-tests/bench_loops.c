/* Compares loops of servers with many connections: mbm's and libmodbus's. */
#define _GNU_SOURCE
#include "bench_server.h"
#include "mbm_tcp.h"

#include <netinet/in.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/resource.h>
#include <sys/select.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
#include <valgrind/callgrind.h>

enum { CLIENTS = 32, ROUNDS = 9, PER_ROUND = 20000, MANY = 1000, ASKING = 16, COUNTED = 200 };

static const uint8_t request[] = {0, 1, 0, 0, 0, 6, UNIT, 3, 0, 7, 0, 10};
static uint8_t expected[29] = {0, 1, 0, 0, 0, 23, UNIT, 3, 20};

/* --- the two servers --- */

static mbm_tcp_set set;
static mbm_tcp places[MANY];
static mbm_server servers[MANY];
static uint8_t buffers[MANY][MBM_MAX_TCP_FRAME];

/* Goes through the loop once. Returns how many connections ended. */
static int go_round(mbm_tcp_listener *listener)
{
    int ended = 0, i;
    mbm_tcp *tcp;

    mbm_tcp_waitSet(&set, MBM_TCP_FOREVER);
    while ((i = mbm_tcp_accept(listener, places, MANY)) >= 0) {
        mbm_port port = mbm_tcp_port(&places[i]);

        if (mbm_server_beginTcp(&servers[i], &port, &unit, 1, buffers[i], MBM_MAX_TCP_FRAME))
            fail("begin");
    }
    while ((tcp = mbm_tcp_nextReady(&set))) {
        if (mbm_server_poll(&servers[tcp - places]) != MBM_OK) {
            mbm_tcp_close(tcp);
            ended++;
        }
    }
    return ended;
}

static void begin_mbm(mbm_tcp_listener *listener)
{
    if (mbm_tcp_openSet(&set) != 0 || mbm_tcp_addListener(&set, listener) != 0)
        fail("set");
}

static void loop_of_mbm(mbm_tcp_listener *listener)
{
    int left = CLIENTS;

    begin_mbm(listener);
    while (left > 0)
        left -= go_round(listener);
}

/* The loop of libmodbus's own example with many connections. */
static modbus_t *host;
static fd_set watched;
static int top;

static void begin_libmodbus(const mbm_tcp_listener *listener)
{
    host = modbus_new_tcp("127.0.0.1", 1502);
    if (!host)
        fail("libmodbus");
    FD_ZERO(&watched);
    FD_SET(listener->fd, &watched);
    top = listener->fd;
}

/* Goes through the loop once. Returns how many connections ended. */
static int go_round_by_libmodbus(const mbm_tcp_listener *listener)
{
    uint8_t query[MODBUS_TCP_MAX_ADU_LENGTH];
    int fd, length, ended = 0;
    fd_set ready = watched;

    if (select(top + 1, &ready, NULL, NULL, NULL) < 0)
        fail("select");
    for (fd = 0; fd <= top; fd++) {
        if (!FD_ISSET(fd, &ready))
            continue;
        if (fd == listener->fd) {
            int client = accept(fd, NULL, NULL);

            if (client < 0)
                continue;
            FD_SET(client, &watched);
            top = client > top ? client : top;
            continue;
        }
        modbus_set_socket(host, fd);
        length = modbus_receive(host, query);
        if (length > 0) {
            modbus_reply(host, query, length, mapping);
        } else if (length < 0) {
            close(fd);
            FD_CLR(fd, &watched);
            ended++;
        }
    }
    return ended;
}

static void loop_of_libmodbus(const mbm_tcp_listener *listener)
{
    int left = CLIENTS;

    begin_libmodbus(listener);
    while (left > 0)
        left -= go_round_by_libmodbus(listener);
}

/* --- instructions --- */

static int sockets[MANY];

static int connect_to(uint16_t port)
{
    struct sockaddr_in address = {
        .sin_family = AF_INET, .sin_addr = {htonl(INADDR_LOOPBACK)}, .sin_port = htons(port)};
    int fd = socket(AF_INET, SOCK_STREAM, 0);

    if (fd < 0 || connect(fd, (struct sockaddr *)&address, sizeof address) != 0)
        fail("connect");
    return fd;
}

static void expect(void)
{
    unsigned i;

    for (i = 0; i < 10; i++) {
        expected[9 + 2 * i] = (uint8_t)(pattern(7u + i) >> 8);
        expected[10 + 2 * i] = (uint8_t)pattern(7u + i);
    }
}

/* Makes rounds in which `asking` of the `connections` clients have sent a request. The
 * server answers in the same process. Callgrind counts only the server's instructions. */
static void count_rounds(const char *name, int is_mbm, int connections, int asking)
{
    mbm_tcp_listener listener = {0};
    uint8_t answer[MOST];
    char title[100];
    int i, round;

    if (mbm_tcp_listen(&listener, "127.0.0.1", "0") != 0)
        fail("listen");
    if (is_mbm)
        begin_mbm(&listener);
    else
        begin_libmodbus(&listener);
    for (i = 0; i < connections; i++) {
        sockets[i] = connect_to(listener.port);
        (void)(is_mbm ? go_round(&listener) : go_round_by_libmodbus(&listener));
    }
    for (round = 0; round < COUNTED; round++) {
        for (i = 0; i < asking; i++)
            if (write(sockets[i * connections / asking], request, sizeof request) != sizeof request)
                fail("write");
        CALLGRIND_TOGGLE_COLLECT;
        if (is_mbm)
            go_round(&listener);
        else
            go_round_by_libmodbus(&listener);
        CALLGRIND_TOGGLE_COLLECT;
        for (i = 0; i < asking; i++)
            if (recv(sockets[i * connections / asking], answer, sizeof answer, MSG_DONTWAIT) !=
                    sizeof expected ||
                memcmp(answer, expected, sizeof expected) != 0)
                fail("wrong answer");
    }
    snprintf(title, sizeof title, "loop\t%s\t%s\t%d", name, is_mbm ? "mbm" : "libmodbus",
             COUNTED * asking);
    CALLGRIND_DUMP_STATS_AT(title);
    CALLGRIND_ZERO_STATS;
    for (i = 0; i < connections; i++)
        close(sockets[i]);
    for (i = is_mbm ? connections : 0; i > 0;)
        i -= go_round(&listener);
    mbm_tcp_closeListener(&listener);
    mbm_tcp_closeSet(&set);
    modbus_free(host);
    host = NULL;
}

void count_loops(void)
{
    struct rlimit limit;

    if (getrlimit(RLIMIT_NOFILE, &limit) != 0)
        fail("getrlimit");
    limit.rlim_cur = limit.rlim_max;
    if (setrlimit(RLIMIT_NOFILE, &limit) != 0)
        fail("setrlimit");
    expect();
    count_rounds("32 connections, all of them asking", 1, CLIENTS, CLIENTS);
    count_rounds("32 connections, all of them asking", 0, CLIENTS, CLIENTS);
    count_rounds("1000 connections, 16 of them asking", 1, MANY, ASKING);
}

/* --- requests per second --- */

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
    int i;

    c->wait = epoll_create1(0);
    for (i = 0; i < CLIENTS; i++) {
        struct epoll_event event = {.events = EPOLLIN};

        c->fds[i] = event.data.fd = connect_to(port);
        if (epoll_ctl(c->wait, EPOLL_CTL_ADD, c->fds[i], &event) != 0)
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

/* Returns the requests per second. */
static double measure(const crowd *c, unsigned long total)
{
    uint8_t answer[MOST];
    struct timespec from, to;
    unsigned long sent = 0, done = 0;
    int i;

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
    /* A machine with one CPU has no second one. */
    if (CPU_COUNT(&one) && sched_setaffinity(process, sizeof one, &one) != 0)
        fail("sched_setaffinity");
}

/* Measures both in alternate rounds, so that the load of the machine affects both alike. */
static void compare(const char *where, const crowd *ours, const crowd *theirs)
{
    double mbm[ROUNDS], libmodbus[ROUNDS];
    unsigned round;

    measure(ours, PER_ROUND / 10);
    measure(theirs, PER_ROUND / 10);
    for (round = 0; round < ROUNDS; round++) {
        mbm[round] = measure(ours, PER_ROUND);
        libmodbus[round] = measure(theirs, PER_ROUND);
    }
    qsort(mbm, ROUNDS, sizeof *mbm, by_size);
    qsort(libmodbus, ROUNDS, sizeof *libmodbus, by_size);
    printf("%s\t%.0f\t%.0f\t%.2f\n", where, mbm[ROUNDS / 2], libmodbus[ROUNDS / 2],
           mbm[ROUNDS / 2] / libmodbus[ROUNDS / 2]);
    fflush(stdout);
}

void compare_loops(void)
{
    pid_t children[2];
    uint16_t ports[2];
    crowd ours, theirs;

    expect();
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
