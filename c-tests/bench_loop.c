/* Counts what a transaction takes in a program with many links, with the wait: 1000 links of which
 * 100 have a request under way. Three programs: one that waits with a set of sockets and forgets
 * the timeouts, one that asks each client for its pollDelay before each wait, and one with
 * mbm_loop.
 *
 *     bench_loop          for callgrind, which counts only what is toggled on here
 *     bench_loop memory   prints the bytes of each part
 */
#define _GNU_SOURCE
#include "mbm_loop.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>
#include <valgrind/callgrind.h>

enum { MOST = 10000, MANY = 1000, BUSY = 100, ROUNDS = 40, UNIT = 17, FIRST = 7, WORDS = 10 };

typedef enum program { WITH_SET, ASKING_EACH, WITH_LOOP, PROGRAMS } program;

static const char *const names[PROGRAMS] = {"without timeouts", "asking each", "mbm_loop"};

typedef struct device {
    mbm_tcp tcp;
    mbm_client client;
    mbm_link link;
    mbm_clientRequest request;
    mbm_loop_entry entry;
    uint16_t words[WORDS];
    uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
    int fd;                         /* the server's end; of a simulated one -1 */
    uint8_t sent[12], waiting, got; /* of a simulated one */
    uint8_t answer[9 + 2 * WORDS];
} device;

static device devices[MOST];
static mbm_loop_place places[MOST];
static mbm_tcp_set set;
static mbm_loop loop;
static unsigned long ended;

static void fail(const char *what)
{
    perror(what);
    exit(1);
}

static uint16_t pattern(unsigned address)
{
    return (uint16_t)(address * 259u + 17u);
}

/* --- the devices: each answers the request that it has got. None of this is counted. */

static void make_answer(device *d, const uint8_t *request)
{
    unsigned i;

    memcpy(d->answer, request, 8);
    d->answer[4] = 0;
    d->answer[5] = sizeof d->answer - 6;
    d->answer[8] = 2 * WORDS;
    for (i = 0; i < WORDS; i++) {
        d->answer[9 + 2 * i] = (uint8_t)(pattern(FIRST + i) >> 8);
        d->answer[10 + 2 * i] = (uint8_t)pattern(FIRST + i);
    }
}

static void answer(device *d)
{
    uint8_t request[sizeof d->sent];

    if (recv(d->fd, request, sizeof request, 0) != sizeof request)
        fail("no request");
    make_answer(d, request);
    if (write(d->fd, d->answer, sizeof d->answer) != sizeof d->answer)
        fail("answer");
}

static int16_t simulated_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    device *d = (device *)context;

    if (!d->waiting || capacity < sizeof d->answer)
        return 0;
    d->waiting = 0;
    memcpy(bytes, d->answer, sizeof d->answer);
    return sizeof d->answer;
}

static int16_t simulated_write(void *context, const uint8_t *bytes, uint16_t length)
{
    device *d = (device *)context;

    memcpy(d->sent, bytes, length < sizeof d->sent ? length : sizeof d->sent);
    return (int16_t)length;
}

static uint8_t is_open(void *context)
{
    (void)context;
    return MBM_OK;
}

/* --- the program */

static void ask(device *d)
{
    if (mbm_client_readHoldingRegisters(&d->client, &d->request, FIRST, WORDS) != MBM_PENDING)
        fail("request");
}

static void done(void *context, mbm_clientRequest *request)
{
    device *d = (device *)context;

    if (request->status != MBM_OK || d->words[WORDS - 1] != pattern(FIRST + WORDS - 1))
        fail("wrong answer");
    ended++;
    ask(d);
}

static void connect_device(device *d, int listener, const struct sockaddr_in *at)
{
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0), on = 1;

    if (fd < 0 || connect(fd, (const struct sockaddr *)at, sizeof *at) != 0 ||
        (d->fd = accept(listener, NULL, NULL)) < 0 ||
        setsockopt(d->fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on) != 0 ||
        mbm_tcp_attach(&d->tcp, fd) != 0)
        fail("connect");
}

static void begin_device(device *d, int simulated)
{
    mbm_linkHooks hooks = mbm_tcp_link(&d->tcp);
    mbm_port port = mbm_tcp_port(&d->tcp);

    if (simulated) {
        port.context = d;
        port.read = simulated_read;
        port.write = simulated_write;
        port.micros = mbm_tcp_port(&d->tcp).micros;
        hooks = (mbm_linkHooks){.context = d, .connect = is_open, .status = is_open};
    }
    d->request = (mbm_clientRequest){
        .unit = UNIT, .reply = d->words, .replyBytes = sizeof d->words, .done = done, .context = d};
    d->entry.poll = mbm_loop_pollClient;
    d->entry.context = &d->client;
    if (mbm_client_beginTcp(&d->client, &port, d->incoming, sizeof d->incoming, d->outgoing,
                            sizeof d->outgoing) != MBM_OK ||
        mbm_link_begin(&d->link, &d->client, &hooks) != MBM_OK)
        fail("begin");
}

/* Waits once, and polls the clients that are ready or, except WITH_SET, due. */
static void go_round(program which, unsigned count)
{
    uint32_t least = MBM_TCP_FOREVER;
    unsigned i;
    mbm_tcp *tcp;

    if (which == WITH_LOOP) {
        mbm_loop_wait(&loop, MBM_LOOP_FOREVER);
        return;
    }
    if (which == ASKING_EACH)
        for (i = 0; i < count; i++) {
            const uint32_t delay = mbm_client_pollDelay(&devices[i].client);

            if (delay == 0)
                mbm_client_poll(&devices[i].client);
            if (delay < least)
                least = delay;
        }
    mbm_tcp_waitSet(&set, least);
    while ((tcp = mbm_tcp_nextReady(&set)))
        mbm_client_poll(&((device *)(void *)((char *)tcp - offsetof(device, tcp)))->client);
}

static void count_program(program which, unsigned count)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr = {htonl(INADDR_LOOPBACK)}};
    int listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    socklen_t length = sizeof at;
    unsigned i, round;
    char title[100];

    memset(devices, 0, sizeof devices);
    if (bind(listener, (struct sockaddr *)&at, sizeof at) != 0 || listen(listener, 64) != 0 ||
        getsockname(listener, (struct sockaddr *)&at, &length) != 0)
        fail("listen");
    if (which == WITH_LOOP ? mbm_loop_open(&loop, places, count) != 0 : mbm_tcp_openSet(&set) != 0)
        fail("open");
    for (i = 0; i < count; i++) {
        connect_device(&devices[i], listener, &at);
        begin_device(&devices[i], 0);
        if (which == WITH_LOOP ? mbm_loop_addTcp(&loop, &devices[i].entry, &devices[i].tcp) != 0
                               : mbm_tcp_add(&set, &devices[i].tcp) != 0)
            fail("add");
        mbm_client_poll(&devices[i].client);
    }
    for (i = 0; i < count; i += count / BUSY) {
        ask(&devices[i]);
        if (which != WITH_LOOP)
            mbm_client_poll(&devices[i].client);
    }
    if (which == WITH_LOOP)
        mbm_loop_wait(&loop, 0);
    ended = 0;
    for (round = 1; round <= ROUNDS; round++) {
        for (i = 0; i < count; i += count / BUSY)
            answer(&devices[i]);
        CALLGRIND_TOGGLE_COLLECT;
        while (ended < (unsigned long)round * BUSY)
            go_round(which, count);
        CALLGRIND_TOGGLE_COLLECT;
    }
    snprintf(title, sizeof title, "many\t%s\t%u\t%lu", names[which], count, ended);
    CALLGRIND_DUMP_STATS_AT(title);
    CALLGRIND_ZERO_STATS;
    for (i = 0; i < count; i++) {
        mbm_loop_remove(&devices[i].entry);
        mbm_tcp_close(&devices[i].tcp);
        close(devices[i].fd);
    }
    close(listener);
    mbm_tcp_closeSet(&set);
    mbm_loop_close(&loop);
}

/* The same with simulated sockets: the program wakes the entries of those that got an answer. */
static void count_simulated(unsigned count)
{
    unsigned i, round;
    char title[100];

    memset(devices, 0, sizeof devices);
    if (mbm_loop_open(&loop, places, count) != 0)
        fail("open");
    for (i = 0; i < count; i++) {
        begin_device(&devices[i], 1);
        if (mbm_loop_addFd(&loop, &devices[i].entry, -1) != 0)
            fail("add");
    }
    mbm_loop_wait(&loop, 0);
    for (i = 0; i < count; i += count / BUSY)
        ask(&devices[i]), mbm_loop_wake(&devices[i].entry);
    mbm_loop_wait(&loop, 0);
    ended = 0;
    for (round = 1; round <= ROUNDS; round++) {
        for (i = 0; i < count; i += count / BUSY) {
            make_answer(&devices[i], devices[i].sent);
            devices[i].waiting = 1;
        }
        CALLGRIND_TOGGLE_COLLECT;
        for (i = 0; i < count; i += count / BUSY)
            mbm_loop_wake(&devices[i].entry);
        mbm_loop_wait(&loop, 0);
        CALLGRIND_TOGGLE_COLLECT;
    }
    snprintf(title, sizeof title, "many\tmbm_loop, simulated\t%u\t%lu", count, ended);
    CALLGRIND_DUMP_STATS_AT(title);
    CALLGRIND_ZERO_STATS;
    for (i = 0; i < count; i++)
        mbm_loop_remove(&devices[i].entry);
    mbm_loop_close(&loop);
}

int main(int argc, char **argv)
{
    struct rlimit limit;
    unsigned which;

    if (argc == 2 && strcmp(argv[1], "memory") == 0) {
        printf(
            "entry\t%zu\nplace\t%zu\ntcp\t%zu\naddresses\t%zu\nclient\t%zu\nlink\t%zu\nloop\t%zu\n",
            sizeof(mbm_loop_entry), sizeof(mbm_loop_place), sizeof(mbm_tcp),
            sizeof(mbm_tcp_addresses), sizeof(mbm_client), sizeof(mbm_link), sizeof(mbm_loop));
        return 0;
    }
    if (getrlimit(RLIMIT_NOFILE, &limit) != 0)
        fail("getrlimit");
    limit.rlim_cur = limit.rlim_max;
    if (setrlimit(RLIMIT_NOFILE, &limit) != 0)
        fail("setrlimit");
    for (which = 0; which < PROGRAMS; which++)
        count_program((program)which, MANY);
    count_program(WITH_LOOP, BUSY);
    count_simulated(MANY);
    count_simulated(MOST);
    return 0;
}
