/* Counts what a transaction takes in a program with many links, with the wait: 1000 links, 100 of
 * them with a pending request. Three programs: one that waits with a set of sockets and forgets the
 * timeouts, one that asks each client for its pollDelay before each wait, and one with mbm_loop.
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
    mbm_tcp_addresses addresses;
    mbm_client client;
    mbm_link link;
    mbm_clientRequest request;
    mbm_loop_entry entry;
    mbm_plan plan;
    mbm_planSetup setup;
    mbm_planField field;
    mbm_planPosition position;
    mbm_planRead read;
    mbm_loop_planned planned;
    uint16_t words[WORDS];
    uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
    int fd;                    /* the server's end; of a simulated one -1 */
    uint8_t sent[12], waiting; /* of a simulated one */
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

/* --- the devices: each answers the request that it has got. The benchmark does not count this. */

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

static void begin_device(device *d, int is_simulated, int has_link)
{
    mbm_linkHooks hooks = mbm_tcp_link(&d->tcp);
    mbm_port port = mbm_tcp_port(&d->tcp);

    if (is_simulated) {
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
        (has_link && mbm_link_begin(&d->link, &d->client, &hooks) != MBM_OK))
        fail("begin");
}

static void updated(void *context, mbm_plan *plan, uint16_t field)
{
    device *d = (device *)context;

    if (mbm_plan_getStatus(plan, field, NULL) != MBM_OK ||
        d->words[WORDS - 1] != pattern(FIRST + WORDS - 1))
        fail("wrong answer to a plan");
    ended++;
}

/* A busy one reads every millisecond, which under callgrind is always over; another once a day. */
static void begin_plan(device *d, int is_busy)
{
    d->field = (mbm_planField){.unit = UNIT,
                               .table = MBM_TABLE_HOLDING_REGISTERS,
                               .type = MBM_TYPE_UINT16,
                               .address = FIRST,
                               .count = WORDS,
                               .intervalMs = is_busy ? 1 : MBM_PLAN_LONGEST_INTERVAL};
    d->setup = (mbm_planSetup){.fields = &d->field,
                               .positions = &d->position,
                               .reads = &d->read,
                               .data = d->words,
                               .requests = &d->request,
                               .update = updated,
                               .context = d,
                               .fieldCount = 1,
                               .readCount = 1,
                               .dataWords = WORDS,
                               .requestCount = 1};
    d->request = (mbm_clientRequest){.unit = 0};
    d->planned = (mbm_loop_planned){&d->client, &d->plan};
    d->entry.poll = mbm_loop_pollPlan;
    d->entry.context = &d->planned;
    if (mbm_plan_begin(&d->plan, &d->client, &d->setup, NULL) != MBM_OK)
        fail("plan");
}

/* Waits once, and polls the clients that are ready or, except WITH_SET, due. */
static void go_round(program which, unsigned count, uint32_t timeout)
{
    uint32_t least = timeout;
    unsigned i;
    mbm_tcp *tcp;

    if (which == WITH_LOOP) {
        mbm_loop_wait(&loop, timeout);
        return;
    }
    for (i = 0; which == ASKING_EACH && i < count; i++) {
        device *d = &devices[i];
        uint32_t delay = mbm_client_pollDelay(&d->client);

        if (d->planned.plan && mbm_plan_pollDelay(&d->plan) < delay)
            delay = mbm_plan_pollDelay(&d->plan);
        if (delay == 0 && d->planned.plan)
            mbm_plan_poll(&d->plan);
        if (delay == 0)
            mbm_client_poll(&d->client);
        if (delay < least)
            least = delay;
    }
    mbm_tcp_waitSet(&set, least);
    while ((tcp = mbm_tcp_nextReady(&set))) {
        device *d = (device *)(void *)((char *)tcp - offsetof(device, tcp));

        mbm_client_poll(&d->client);
        if (d->planned.plan)
            mbm_plan_poll(&d->plan);
    }
}

static void begin_program(program which, unsigned count, int has_links, int has_plans)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr = {htonl(INADDR_LOOPBACK)}};
    int listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    socklen_t length = sizeof at;
    unsigned i;

    memset(devices, 0, sizeof devices);
    if (bind(listener, (struct sockaddr *)&at, sizeof at) != 0 || listen(listener, 64) != 0 ||
        getsockname(listener, (struct sockaddr *)&at, &length) != 0)
        fail("listen");
    if (which == WITH_LOOP ? mbm_loop_open(&loop, places, count) != 0 : mbm_tcp_openSet(&set) != 0)
        fail("open");
    for (i = 0; i < count; i++) {
        const int is_busy = i % (count / BUSY) == 0;

        connect_device(&devices[i], listener, &at);
        begin_device(&devices[i], 0, has_links);
        if (has_plans)
            begin_plan(&devices[i], is_busy);
        if (which == WITH_LOOP ? mbm_loop_addTcp(&loop, &devices[i].entry, &devices[i].tcp) != 0
                               : mbm_tcp_add(&set, &devices[i].tcp) != 0)
            fail("add");
        mbm_client_poll(&devices[i].client);
        if (is_busy && !has_plans)
            ask(&devices[i]);
        if (which != WITH_LOOP)
            mbm_client_poll(&devices[i].client);
    }
    go_round(which, count, 0);
    ended = 0;
    close(listener);
}

static void end_program(const char *kind, const char *name, unsigned count)
{
    char title[100];
    unsigned i;

    snprintf(title, sizeof title, "%s\t%s\t%u\t%lu", kind, name, count, ended);
    CALLGRIND_DUMP_STATS_AT(title);
    CALLGRIND_ZERO_STATS;
    for (i = 0; i < count; i++) {
        mbm_loop_remove(&devices[i].entry);
        mbm_tcp_close(&devices[i].tcp);
        if (devices[i].fd > 0)
            close(devices[i].fd);
    }
    mbm_tcp_closeSet(&set);
    mbm_loop_close(&loop);
}

/* Each client has one pending request, and queues the next one when it ends. */
static void count_requests(program which, unsigned count, int has_links)
{
    unsigned i, round;

    begin_program(which, count, has_links, 0);
    for (round = 1; round <= ROUNDS; round++) {
        for (i = 0; i < count; i += count / BUSY)
            answer(&devices[i]);
        CALLGRIND_TOGGLE_COLLECT;
        while (ended < (unsigned long)round * BUSY)
            go_round(which, count, MBM_LOOP_FOREVER);
        CALLGRIND_TOGGLE_COLLECT;
    }
    end_program(has_links ? "requests" : "no links", names[which], count);
}

/* Each plan reads when its time has come. */
static void count_plans(program which, unsigned count)
{
    unsigned i, round;

    begin_program(which, count, 1, 1);
    /* All plans read once when they begin. */
    for (i = 0; i < count; i++)
        answer(&devices[i]);
    while (ended < count)
        go_round(which, count, MBM_LOOP_FOREVER);
    ended = 0;
    for (round = 1; round <= ROUNDS; round++) {
        usleep(2000);
        CALLGRIND_TOGGLE_COLLECT;
        go_round(which, count, 0);
        CALLGRIND_TOGGLE_COLLECT;
        for (i = 0; i < count; i += count / BUSY)
            answer(&devices[i]);
        CALLGRIND_TOGGLE_COLLECT;
        while (ended < (unsigned long)round * BUSY)
            go_round(which, count, MBM_LOOP_FOREVER);
        CALLGRIND_TOGGLE_COLLECT;
    }
    end_program("plans", names[which], count);
}

/* The same with simulated sockets: the program wakes the entries of those that got an answer. */
static void count_simulated(unsigned count)
{
    unsigned i, round;

    memset(devices, 0, sizeof devices);
    if (mbm_loop_open(&loop, places, count) != 0)
        fail("open");
    for (i = 0; i < count; i++) {
        begin_device(&devices[i], 1, 1);
        if (mbm_loop_addFd(&loop, &devices[i].entry, -1) != 0)
            fail("add");
        if (i % (count / BUSY) == 0)
            ask(&devices[i]);
    }
    mbm_loop_wait(&loop, 0); /* opens the links */
    mbm_loop_wait(&loop, 0); /* sends the requests */
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
    end_program("simulated", names[WITH_LOOP], count);
}

int main(int argc, char **argv)
{
    const device *d = devices;
    struct rlimit limit;
    unsigned which;

    if (argc == 2 && strcmp(argv[1], "memory") == 0) {
        printf("entry\t%zu\nplace\t%zu\ntcp\t%zu\naddresses\t%zu\nclient\t%zu\nlink\t%zu\n",
               sizeof d->entry, sizeof *places, sizeof d->tcp, sizeof d->addresses,
               sizeof d->client, sizeof d->link);
        printf("buffers\t%zu\nplan\t%zu\n", sizeof d->incoming + sizeof d->outgoing,
               sizeof d->plan + sizeof d->setup + sizeof d->field + sizeof d->position +
                   sizeof d->read + sizeof d->request);
        return 0;
    }
    if (getrlimit(RLIMIT_NOFILE, &limit) != 0)
        fail("getrlimit");
    limit.rlim_cur = limit.rlim_max;
    if (setrlimit(RLIMIT_NOFILE, &limit) != 0)
        fail("setrlimit");
    for (which = 0; which < PROGRAMS; which++)
        count_requests((program)which, MANY, 0);
    for (which = 0; which < PROGRAMS; which++)
        count_requests((program)which, MANY, 1);
    count_requests(WITH_LOOP, BUSY, 1);
    count_plans(ASKING_EACH, MANY);
    count_plans(WITH_LOOP, MANY);
    count_plans(WITH_LOOP, BUSY);
    count_simulated(MANY);
    count_simulated(MOST);
    return 0;
}
