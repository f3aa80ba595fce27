/* Compares loops of servers with many connections: of mbm, of libmodbus, in straight C, and another
 * program. */
#define _GNU_SOURCE
#include "bench_server.h"
#include "clock.h"
#include "mbm_tcp.h"

#include <netinet/in.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/resource.h>
#include <sys/select.h>
#include <sys/wait.h>
#include <unistd.h>
#include <valgrind/callgrind.h>

enum { CLIENTS = 32, ROUNDS = 9, PER_ROUND = 20000, MANY = 1000, ASKING = 16, COUNTED = 200 };

static const uint8_t request[] = {0, 1, 0, 0, 0, 6, UNIT, 3, 0, 7, 0, 10};
static uint8_t expected[29] = {0, 1, 0, 0, 0, 23, UNIT, 3, 20};

/* --- the servers --- */

static mbm_tcp_set set;
static mbm_tcp places[MANY];
static mbm_server servers[MANY];
static uint8_t buffers[MANY][MBM_MAX_TCP_FRAME];

/* Goes through the loop once. Returns how many connections ended. */
static int go_round_by_mbm(mbm_tcp_listener *listener)
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

/* The loop of libmodbus's own example with many connections. */
static modbus_t *host;
static fd_set watched;
static int top;

static void begin_libmodbus(mbm_tcp_listener *listener)
{
    host = modbus_new_tcp("127.0.0.1", 1502);
    if (!host)
        fail("libmodbus");
    FD_ZERO(&watched);
    FD_SET(listener->fd, &watched);
    top = listener->fd;
}

/* Goes through the loop once. Returns how many connections ended. */
static int go_round_by_libmodbus(mbm_tcp_listener *listener)
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

/* Straight C: epoll, a read, a comparison of header, unit, function and range, a write. It answers
 * 03 alone, and closes a connection that sends anything else or a part of a request. */
static int watch;
static uint16_t registers[128];

static void begin_floor(mbm_tcp_listener *listener)
{
    struct epoll_event event = {.events = EPOLLIN, .data = {.fd = listener->fd}};
    unsigned i;

    for (i = 0; i < 128; i++)
        registers[i] = pattern(i);
    watch = epoll_create1(0);
    if (watch < 0 || epoll_ctl(watch, EPOLL_CTL_ADD, listener->fd, &event) != 0)
        fail("epoll");
}

/* Serves one request. Returns 0 if the connection is to be closed. */
static int serve_request(int fd)
{
    uint8_t in[MOST], out[MOST];
    unsigned address, quantity, i;
    ssize_t length;

    if (read(fd, in, sizeof in) != sizeof request || in[2] || in[3] || in[4] || in[5] != 6 ||
        in[6] != UNIT || in[7] != 3)
        return 0;
    address = (unsigned)(in[8] << 8 | in[9]);
    quantity = (unsigned)(in[10] << 8 | in[11]);
    if (quantity < 1 || quantity > 125 || address + quantity > 128)
        return 0;
    memcpy(out, in, 8);
    out[5] = (uint8_t)(3 + 2 * quantity);
    out[8] = (uint8_t)(2 * quantity);
    for (i = 0; i < quantity; i++) {
        out[9 + 2 * i] = (uint8_t)(registers[address + i] >> 8);
        out[10 + 2 * i] = (uint8_t)registers[address + i];
    }
    length = 9 + 2 * (ssize_t)quantity;
    return write(fd, out, (size_t)length) == length;
}

static int go_round_by_floor(mbm_tcp_listener *listener)
{
    struct epoll_event events[CLIENTS];
    int ready = epoll_wait(watch, events, CLIENTS, -1), ended = 0, i;

    for (i = 0; i < ready; i++) {
        int fd = events[i].data.fd;

        if (fd == listener->fd) {
            struct epoll_event event = {.events = EPOLLIN};

            event.data.fd = accept(fd, NULL, NULL);
            if (event.data.fd >= 0)
                (void)epoll_ctl(watch, EPOLL_CTL_ADD, event.data.fd, &event);
        } else if (!serve_request(fd)) {
            close(fd);
            ended++;
        }
    }
    return ended;
}

static const struct {
    const char *name;
    void (*begin)(mbm_tcp_listener *listener);
    /* Goes through the loop once. Returns how many connections ended. */
    int (*go_round)(mbm_tcp_listener *listener);
} loops[] = {{"mbm", begin_mbm, go_round_by_mbm},
             {"libmodbus", begin_libmodbus, go_round_by_libmodbus},
             {"straight C", begin_floor, go_round_by_floor}};

enum { MBM, LIBMODBUS, FLOOR, LOOPS, OTHER = LOOPS, SERVERS };

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
static void count_rounds(const char *name, int who, int connections, int asking)
{
    mbm_tcp_listener listener = {0};
    uint8_t answer[MOST];
    char title[100];
    int i, round;

    if (mbm_tcp_listen(&listener, "127.0.0.1", "0") != 0)
        fail("listen");
    loops[who].begin(&listener);
    for (i = 0; i < connections; i++) {
        sockets[i] = connect_to(listener.port);
        (void)loops[who].go_round(&listener);
    }
    for (round = 0; round < COUNTED; round++) {
        for (i = 0; i < asking; i++)
            if (write(sockets[i * connections / asking], request, sizeof request) != sizeof request)
                fail("write");
        CALLGRIND_TOGGLE_COLLECT;
        loops[who].go_round(&listener);
        CALLGRIND_TOGGLE_COLLECT;
        for (i = 0; i < asking; i++)
            if (recv(sockets[i * connections / asking], answer, sizeof answer, MSG_DONTWAIT) !=
                    sizeof expected ||
                memcmp(answer, expected, sizeof expected) != 0)
                fail("wrong answer");
    }
    snprintf(title, sizeof title, "loop\t%s\t%s\t%d", name, loops[who].name, COUNTED * asking);
    CALLGRIND_DUMP_STATS_AT(title);
    CALLGRIND_ZERO_STATS;
    for (i = 0; i < connections; i++)
        close(sockets[i]);
    for (i = who == LIBMODBUS ? 0 : connections; i > 0;)
        i -= loops[who].go_round(&listener);
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
    count_rounds("32 connections, all of them asking", MBM, CLIENTS, CLIENTS);
    count_rounds("32 connections, all of them asking", LIBMODBUS, CLIENTS, CLIENTS);
    count_rounds("32 connections, all of them asking", FLOOR, CLIENTS, CLIENTS);
    count_rounds("1000 connections, 16 of them asking", MBM, MANY, ASKING);
    count_rounds("1000 connections, 16 of them asking", FLOOR, MANY, ASKING);
}

/* --- requests per second --- */

static pid_t start(int who, uint16_t *port)
{
    mbm_tcp_listener listener = {0};
    int left = CLIENTS;
    pid_t child;

    if (mbm_tcp_listen(&listener, "127.0.0.1", "0") != 0)
        fail("listen");
    *port = listener.port;
    child = fork();
    if (child < 0)
        fail("fork");
    if (child == 0) {
        loops[who].begin(&listener);
        while (left > 0)
            left -= loops[who].go_round(&listener);
        _exit(0);
    }
    mbm_tcp_closeListener(&listener);
    return child;
}

/* Starts a program that prints its port. */
static pid_t start_other(const char *program, uint16_t *port)
{
    char words[16] = {0};
    int ends[2];
    pid_t child;

    if (pipe(ends) != 0)
        fail("pipe");
    child = fork();
    if (child < 0)
        fail("fork");
    if (child == 0) {
        dup2(ends[1], STDOUT_FILENO);
        close(ends[0]);
        close(ends[1]);
        execl(program, program, (char *)NULL);
        _exit(127);
    }
    close(ends[1]);
    if (read(ends[0], words, sizeof words - 1) <= 0)
        fail(program);
    close(ends[0]);
    *port = (uint16_t)atoi(words);
    return child;
}

/* 32 connections, each with one pending request. */
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

        c->fds[i] = connect_to(port);
        event.data.fd = i;
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

/* Requests per second, and p50 and p99 of the time of a request in microseconds. */
typedef struct rates {
    double per_second, p50, p99;
} rates;

static int by_size(const void *left, const void *right);

static void ask(const crowd *c, int i, double *since)
{
    *since = seconds();
    if (write(c->fds[i], request, sizeof request) != sizeof request)
        fail("write");
}

static rates measure(const crowd *c, unsigned long total)
{
    static double taken[PER_ROUND], since[CLIENTS];
    uint8_t answer[MOST];
    double from = seconds();
    unsigned long sent = 0, done = 0;
    int i;

    for (; sent < CLIENTS; sent++)
        ask(c, (int)sent, &since[sent]);
    while (done < total) {
        struct epoll_event events[CLIENTS];
        int ready = epoll_wait(c->wait, events, CLIENTS, 10000);

        if (ready <= 0)
            fail("no answer");
        for (i = 0; i < ready; i++) {
            int which = events[i].data.fd;
            ssize_t got = read(c->fds[which], answer, sizeof answer);

            if (got != sizeof expected || memcmp(answer, expected, sizeof expected) != 0)
                fail("wrong answer");
            taken[done++] = (seconds() - since[which]) * 1e6;
            if (sent == total)
                continue;
            sent++;
            ask(c, which, &since[which]);
        }
    }
    from = seconds() - from;
    qsort(taken, total, sizeof *taken, by_size);
    return (rates){(double)total / from, taken[total / 2], taken[total * 99 / 100]};
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

static double median(double *values)
{
    qsort(values, ROUNDS, sizeof *values, by_size);
    return values[ROUNDS / 2];
}

/* Measures all servers in each round, and begins each round with another one, so that the load of
 * the machine affects all alike. Prints a line for each: medians of the rounds. */
static void compare(const char *where, const crowd *crowds)
{
    double per_second[SERVERS][ROUNDS], p50[SERVERS][ROUNDS], p99[SERVERS][ROUNDS];
    int who, turn, round;

    for (who = 0; who < SERVERS; who++)
        measure(&crowds[who], PER_ROUND / 10);
    for (round = 0; round < ROUNDS; round++)
        for (turn = 0; turn < SERVERS; turn++) {
            rates each;

            who = (round + turn) % SERVERS;
            each = measure(&crowds[who], PER_ROUND);
            per_second[who][round] = each.per_second;
            p50[who][round] = each.p50;
            p99[who][round] = each.p99;
        }
    for (who = 0; who < SERVERS; who++)
        printf("%s\t%s\t%.0f\t%.0f\t%.0f\n", where, who == OTHER ? "tokio-modbus" : loops[who].name,
               median(per_second[who]), median(p50[who]), median(p99[who]));
    fflush(stdout);
}

void compare_loops(const char *other)
{
    pid_t children[SERVERS];
    uint16_t ports[SERVERS];
    crowd crowds[SERVERS];
    int who;

    expect();
    for (who = 0; who < LOOPS; who++)
        children[who] = start(who, &ports[who]);
    children[OTHER] = start_other(other, &ports[OTHER]);
    for (who = 0; who < SERVERS; who++)
        gather(&crowds[who], ports[who]);
    for (who = 0; who < SERVERS; who++)
        pin(children[who], 1);
    compare("on CPUs of their own", crowds);
    for (who = 0; who < SERVERS; who++)
        pin(children[who], 0);
    pin(0, 0);
    compare("clients and server on one CPU", crowds);
    for (who = 0; who < SERVERS; who++)
        leave(&crowds[who]);
    kill(children[OTHER], SIGKILL);
    for (who = 0; who < SERVERS; who++)
        waitpid(children[who], NULL, 0);
}

void make_requests(const char *port, const char *total)
{
    unsigned long left = strtoul(total, NULL, 10);
    crowd all;

    expect();
    gather(&all, (uint16_t)atoi(port));
    for (; left > PER_ROUND; left -= PER_ROUND)
        measure(&all, PER_ROUND);
    measure(&all, left);
    leave(&all);
}
