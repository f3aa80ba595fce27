/* The two sides of a gateway, to compare gateways with one another.
 *
 *     bench_gateway devices COUNT    prints the paths of so many serial lines, and answers as unit
 * 1 to 247 on each, at once, until standard input ends bench_gateway ask CLIENTS EACH PORT UNIT
 * [PORT UNIT]...    CLIENTS clients, spread over these units, send EACH requests, one after the
 * other; prints the seconds for all of them, and p50 and p99 of a request in microseconds */
#define _GNU_SOURCE
#include "crc.h"
#include "pty.h"

#include <arpa/inet.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum {
    QUANTITY = 10,
    ASKED = 8, /* bytes of a request on a line */
    REPLY = 9 + 2 * QUANTITY,
    LINES = 16,
    CLIENTS = 64,
    PATIENCE_MS = 60000
};

static int fail(const char *what)
{
    perror(what);
    exit(1);
}

/* --- devices --- */

typedef struct device {
    pty line;
    uint8_t bytes[ASKED];
    size_t have;
} device;

/* Takes bytes of requests for 03, and answers each. */
static void serve(device *of)
{
    uint8_t reply[5 + 2 * QUANTITY] = {0, 3, 2 * QUANTITY};
    const ssize_t got = read(of->line.ours, of->bytes + of->have, ASKED - of->have);

    if (got <= 0)
        return;
    of->have += (size_t)got;
    if (of->have < ASKED)
        return;
    of->have = 0;
    reply[0] = of->bytes[0];
    if (write(of->line.ours, reply, seal(reply, sizeof reply - 2)) < 0)
        fail("write");
}

static int run_devices(unsigned count)
{
    static device devices[LINES];
    struct pollfd waits[1 + LINES] = {{STDIN_FILENO, POLLIN, 0}};
    unsigned i;

    for (i = 0; i < count; i++) {
        pty_open(&devices[i].line);
        puts(devices[i].line.path);
        waits[1 + i] = (struct pollfd){devices[i].line.ours, POLLIN, 0};
    }
    fflush(stdout);
    while (poll(waits, 1 + count, -1) >= 0 && !waits[0].revents)
        for (i = 0; i < count; i++)
            if (waits[1 + i].revents)
                serve(&devices[i]);
    return 0;
}

/* --- clients --- */

typedef struct asker {
    int fd;
    uint8_t unit;
    unsigned left;
    double sent;
    uint8_t bytes[REPLY];
    size_t have;
} asker;

static asker askers[CLIENTS];
static float *times;
static unsigned answered;

static double seconds(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + (double)now.tv_nsec * 1e-9;
}

static int connect_to(int port)
{
    const struct sockaddr_in to = {.sin_family = AF_INET,
                                   .sin_port = htons((uint16_t)port),
                                   .sin_addr = {htonl(INADDR_LOOPBACK)}};
    const int fd = socket(AF_INET, SOCK_STREAM, 0), on = 1;

    if (fd < 0 || connect(fd, (const struct sockaddr *)&to, sizeof to) != 0)
        fail("connect");
    (void)setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    return fd;
}

static void ask(asker *who)
{
    const uint8_t request[] = {0, (uint8_t)who->left, 0, 0, 0, 6, who->unit, 3, 0, 7, 0, QUANTITY};

    who->have = 0;
    who->sent = seconds();
    if (send(who->fd, request, sizeof request, MSG_NOSIGNAL) != sizeof request)
        fail("send");
}

/* Takes bytes of the reply, and asks again. */
static void take(asker *who)
{
    const ssize_t got = recv(who->fd, who->bytes + who->have, REPLY - who->have, 0);

    if (got <= 0)
        fail("recv");
    who->have += (size_t)got;
    if (who->have >= 8 && (who->bytes[7] != 3 || who->bytes[1] != (uint8_t)who->left)) {
        fprintf(stderr, "a client got another reply\n");
        exit(1);
    }
    if (who->have < REPLY)
        return;
    times[answered++] = (float)((seconds() - who->sent) * 1e6);
    if (--who->left > 0)
        ask(who);
}

static int compare(const void *one, const void *other)
{
    const float a = *(const float *)one, b = *(const float *)other;

    return (a > b) - (a < b);
}

static int run_clients(unsigned count, unsigned each, int targets, char **target)
{
    struct pollfd waits[CLIENTS];
    const unsigned all = count * each;
    double begun;
    unsigned i;

    times = (float *)calloc(all, sizeof *times);
    for (i = 0; i < count; i++) {
        char **to = target + 2 * (i % (unsigned)targets);

        askers[i] =
            (asker){.fd = connect_to(atoi(to[0])), .unit = (uint8_t)atoi(to[1]), .left = each};
        waits[i] = (struct pollfd){askers[i].fd, POLLIN, 0};
    }
    begun = seconds();
    for (i = 0; i < count; i++)
        ask(&askers[i]);
    while (times && answered < all) {
        if (poll(waits, count, PATIENCE_MS) <= 0)
            fail("poll");
        for (i = 0; i < count; i++)
            if (waits[i].revents && askers[i].left > 0)
                take(&askers[i]);
    }
    begun = seconds() - begun;
    qsort(times, all, sizeof *times, compare);
    printf("%.6f\t%.0f\t%.0f\n", begun, (double)times[all / 2], (double)times[all * 99 / 100]);
    return 0;
}

int main(int argc, char **argv)
{
    if (argc == 3 && strcmp(argv[1], "devices") == 0 && atoi(argv[2]) <= LINES)
        return run_devices((unsigned)atoi(argv[2]));
    if (argc >= 6 && argc % 2 == 0 && strcmp(argv[1], "ask") == 0 && atoi(argv[2]) <= CLIENTS)
        return run_clients((unsigned)atoi(argv[2]), (unsigned)atoi(argv[3]), (argc - 4) / 2,
                           argv + 4);
    fprintf(stderr, "usage: bench_gateway devices COUNT | ask CLIENTS EACH PORT UNIT...\n");
    return 2;
}
