/* The times of a loop: thousands of entries without descriptors, on a clock of the test's. */
#define _GNU_SOURCE
#include "mbm_loop.h"
#include "test.h"

#include <sys/socket.h>
#include <time.h>
#include <unistd.h>
#include <valgrind/valgrind.h>

enum { MANY = 10000, SOME = 300, UNIT = 7, MS = 1000 };

typedef struct device {
    mbm_client client;
    mbm_clientRequest request;
    mbm_loop_entry entry;
    uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
    uint16_t words[4];
    int64_t due, ended; /* when the request should end, and when it did */
    unsigned polls, sent;
    uint8_t reply[32];
    uint8_t replyLength;
} device;

static device *devices;
static mbm_loop_place *places;
static mbm_loop loop;
static int64_t now; /* microseconds */
static uint32_t seed;

/* This function replaces that of libc. */
int clock_gettime(clockid_t id, struct timespec *time)
{
    time->tv_sec = now / 1000000;
    time->tv_nsec = now % 1000000 * 1000;
    return 0;
}

static uint32_t chance(uint32_t below)
{
    seed = seed * 1664525u + 1013904223u;
    return (seed >> 8) % below;
}

static void begin(void)
{
    now = 5000000;
    seed = 1;
    devices = (device *)test_calloc(MANY, sizeof *devices);
    places = (mbm_loop_place *)test_calloc(MANY, sizeof *places);
    memset(&loop, 0, sizeof loop);
    assert_int_equal(mbm_loop_open(&loop, places, MANY), 0);
}

static void end(void)
{
    mbm_loop_close(&loop);
    test_free(devices);
    test_free(places);
}

fixture each_test = {begin, end};

/* Lets the time pass until the next entry is due, and waits. Returns 0 if none ever is. */
static int step(void)
{
    const uint32_t delay = mbm_loop_pollDelay(&loop);

    if (delay == MBM_LOOP_FOREVER)
        return 0;
    now += delay;
    assert_true(mbm_loop_wait(&loop, 0) >= 0);
    return 1;
}

/* --- clients --- */

static int16_t sim_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    device *d = (device *)context;
    const uint8_t count = d->replyLength;

    assert_true(count <= capacity);
    memcpy(bytes, d->reply, count);
    d->replyLength = 0;
    return count;
}

static int16_t sim_write(void *context, const uint8_t *bytes, uint16_t length)
{
    device *d = (device *)context;

    assert_true(length <= sizeof d->reply);
    memcpy(d->reply, bytes, length);
    d->sent++;
    return (int16_t)length;
}

static uint32_t sim_micros(void *context)
{
    return (uint32_t)now;
}

static void note_end(void *context, mbm_clientRequest *request)
{
    device *d = (device *)context;

    d->ended = now;
}

static uint32_t poll_counted(mbm_loop_entry *entry)
{
    ((device *)(void *)((char *)entry - offsetof(device, entry)))->polls++;
    return mbm_loop_pollClient(entry);
}

static void begin_client(device *d)
{
    const mbm_port port = {
        .context = d, .read = sim_read, .write = sim_write, .micros = sim_micros};

    OK(mbm_client_beginTcp(&d->client, &port, d->incoming, sizeof d->incoming, d->outgoing,
                           sizeof d->outgoing));
    d->request = (mbm_clientRequest){.unit = UNIT,
                                     .reply = d->words,
                                     .replyBytes = sizeof d->words,
                                     .done = note_end,
                                     .context = d};
    d->entry.poll = poll_counted;
    d->entry.context = &d->client;
    assert_int_equal(mbm_loop_addFd(&loop, &d->entry, -1), 0);
}

static void begin_clients(unsigned count)
{
    for (unsigned i = 0; i < count; i++)
        begin_client(&devices[i]);
    assert_int_equal(mbm_loop_wait(&loop, 0), count);
    assert_int_equal(mbm_loop_pollDelay(&loop), MBM_LOOP_FOREVER);
}

static void ask(device *d, uint32_t timeoutMs)
{
    d->request.timeoutMs = timeoutMs;
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&d->client, &d->request, 0, 1));
    mbm_loop_wake(&d->entry);
    d->due = now + (int64_t)timeoutMs * MS;
    d->ended = 0;
}

/* The device answers the request that it has got. */
static void answer(device *d)
{
    static const uint8_t rest[] = {0, 0, 0, 5, UNIT, 3, 2, 0x12, 0x34};

    memcpy(d->reply + 2, rest, sizeof rest);
    d->replyLength = 2 + sizeof rest;
}

TEST(each_of_ten_thousand_timeouts_ends_at_its_time)
{
    begin_clients(MANY);
    for (unsigned i = 0; i < MANY; i++) {
        ask(&devices[i], 1 + chance(3000));
        devices[i].polls = 0;
    }
    while (step())
        ;
    for (unsigned i = 0; i < MANY; i++) {
        IS(MBM_RESPONSE_TIMED_OUT, devices[i].request.status);
        assert_int_equal(devices[i].ended, devices[i].due);
        /* Once to send the request, once when its time was over. */
        assert_int_equal(devices[i].polls, 2);
    }
}

TEST(a_timeout_ends_at_its_time_though_others_are_busy)
{
    device *silent = &devices[SOME];
    unsigned i, rounds = 0;

    begin_clients(SOME + 1);
    ask(silent, 250);
    silent->polls = 0;
    for (i = 0; i < SOME; i++)
        ask(&devices[i], 100);
    assert_int_equal(mbm_loop_wait(&loop, 0), SOME + 1);
    while (silent->request.status == MBM_PENDING) {
        now += 700;
        rounds++;
        for (i = 0; i < SOME; i++) {
            if (devices[i].request.status != MBM_PENDING) {
                IS(MBM_OK, devices[i].request.status);
                ask(&devices[i], 100);
            } else if (devices[i].replyLength == 0) {
                answer(&devices[i]);
                mbm_loop_wake(&devices[i].entry);
            }
        }
        assert_true(mbm_loop_wait(&loop, 0) > 0);
    }
    IS(MBM_RESPONSE_TIMED_OUT, silent->request.status);
    assert_in_range(silent->ended, silent->due, silent->due + 700);
    assert_int_equal(silent->polls, 2);
    assert_true(rounds > 300);
    /* The times of the busy ones were put right when they came up, and not more often. */
    for (i = 0; i < SOME; i++)
        assert_true(devices[i].polls <= 2 * rounds + 4);
}

TEST(a_client_without_requests_is_not_polled)
{
    begin_clients(SOME);
    ask(&devices[5], 100);
    while (step())
        ;
    for (unsigned i = 0; i < SOME; i++)
        assert_int_equal(devices[i].polls, i == 5 ? 3 : 1);
}

TEST(after_a_jump_of_the_clock_no_timeout_is_missing)
{
    begin_clients(SOME);
    for (unsigned i = 0; i < SOME; i++)
        ask(&devices[i], 1000 + i);
    assert_int_equal(mbm_loop_wait(&loop, 0), SOME);
    now += 30LL * 60 * 1000000;
    assert_int_equal(mbm_loop_wait(&loop, 0), SOME);
    for (unsigned i = 0; i < SOME; i++)
        IS(MBM_RESPONSE_TIMED_OUT, devices[i].request.status);
    assert_int_equal(mbm_loop_pollDelay(&loop), MBM_LOOP_FOREVER);
}

TEST(a_clock_that_steps_back_only_delays)
{
    begin_clients(1);
    ask(&devices[0], 100);
    assert_int_equal(mbm_loop_wait(&loop, 0), 1);
    now -= 30 * MS;
    assert_int_equal(mbm_loop_wait(&loop, 0), 0);
    while (step())
        ;
    IS(MBM_RESPONSE_TIMED_OUT, devices[0].request.status);
}

/* --- any entries: the loop against a list that is searched in full --- */

typedef struct chore {
    mbm_loop_entry entry;
    int64_t due; /* when it is to be polled next; -1: never */
    uint8_t isIn, isWoken;
    unsigned wokenIn; /* the wait in which it was woken, or the last one before */
} chore;

static chore chores[SOME];
static unsigned polls, changes, round_now;

static void add_chore(chore *one)
{
    assert_int_equal(mbm_loop_addFd(&loop, &one->entry, -1), 0);
    one->isIn = one->isWoken = 1;
    one->wokenIn = round_now;
}

static void wake_chore(chore *one)
{
    mbm_loop_wake(&one->entry);
    if (!one->isIn || one->isWoken)
        return;
    one->isWoken = 1;
    one->wokenIn = round_now;
}

static void remove_chore(chore *one)
{
    mbm_loop_remove(&one->entry);
    one->isIn = 0;
}

static uint32_t poll_chore(mbm_loop_entry *entry)
{
    chore *one = (chore *)(void *)entry, *other = &chores[chance(SOME)];

    assert_true(one->isIn);
    assert_true(one->isWoken || (one->due >= 0 && one->due <= now));
    polls++;
    one->isWoken = 0;
    switch (chance(12)) {
    case 0:
        if (other->isIn)
            remove_chore(other);
        else
            add_chore(other);
        changes++;
        break;
    case 1: wake_chore(other); break;
    case 2:
        /* It leaves, and comes again at once. */
        remove_chore(one);
        add_chore(one);
        return 5;
    default: break;
    }
    if (!one->isIn)
        return chance(100);
    uint32_t delay = chance(8) == 0 ? MBM_LOOP_FOREVER : chance(8) == 0 ? 0 : 1 + chance(50 * MS);
    one->due = delay == MBM_LOOP_FOREVER ? -1 : now + delay;
    if (delay == 0 && !one->isWoken) {
        one->isWoken = 1;
        one->wokenIn = round_now;
    }
    return delay;
}

TEST(entries_are_polled_when_they_are_due_and_never_else)
{
    const unsigned rounds = RUNNING_ON_VALGRIND ? 3000 : 30000;

    memset(chores, 0, sizeof chores);
    polls = changes = round_now = 0;
    for (unsigned i = 0; i < SOME; i++) {
        chores[i].entry.poll = poll_chore;
        if (i % 3)
            add_chore(&chores[i]);
    }
    while (round_now < rounds) {
        now += chance(3) ? chance(300) : mbm_loop_pollDelay(&loop) % 100000;
        if (chance(2))
            wake_chore(&chores[chance(SOME)]);
        round_now++;
        assert_true(mbm_loop_wait(&loop, 0) >= 0);
        for (unsigned i = 0; i < SOME; i++) {
            const chore *one = &chores[i];

            /* Only one that was woken in this wait may be left. */
            if (one->isIn && one->isWoken)
                assert_int_equal(one->wokenIn, round_now);
            else if (one->isIn)
                assert_true(one->due < 0 || one->due > now);
        }
    }
    assert_true(polls > rounds && changes > rounds / 50);
    for (unsigned i = 0; i < SOME; i++)
        mbm_loop_remove(&chores[i].entry);
    assert_int_equal(mbm_loop_pollDelay(&loop), MBM_LOOP_FOREVER);
}

static unsigned eager_polls, calm_polls;

static uint32_t poll_eager(mbm_loop_entry *entry)
{
    eager_polls++;
    return 0;
}

static uint32_t poll_calm(mbm_loop_entry *entry)
{
    calm_polls++;
    return 10 * MS;
}

TEST(an_entry_that_always_has_something_to_do_is_polled_once_in_a_wait)
{
    static mbm_loop_entry eager, calm;

    eager.poll = poll_eager;
    calm.poll = poll_calm;
    assert_int_equal(mbm_loop_addFd(&loop, &eager, -1), 0);
    assert_int_equal(mbm_loop_addFd(&loop, &calm, -1), 0);
    assert_int_equal(mbm_loop_wait(&loop, MBM_LOOP_FOREVER), 2);
    for (unsigned i = 0; i < 100; i++) {
        now += MS;
        assert_in_range(mbm_loop_wait(&loop, MBM_LOOP_FOREVER), 1, 2);
    }
    assert_int_equal(eager_polls, 101);
    assert_int_equal(calm_polls, 11);
    mbm_loop_remove(&eager);
    mbm_loop_remove(&calm);
}

/* --- a socket --- */

static uint32_t poll_in_20_ms(mbm_loop_entry *entry)
{
    ++*(unsigned *)entry->context;
    return 20 * MS;
}

/* Its `poll` does not look at the clock of the port, which others did long ago. */
TEST(a_delay_counts_from_its_poll)
{
    mbm_loop_entry entry = {.poll = poll_in_20_ms};
    unsigned count = 0, i;
    mbm_tcp tcp = {0};
    int pair[2];

    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair), 0);
    assert_int_equal(mbm_tcp_attach(&tcp, pair[0]), 0);
    (void)mbm_tcp_port(&tcp).micros(&tcp);
    entry.context = &count;
    now += 1000 * MS;
    assert_int_equal(mbm_loop_addTcp(&loop, &entry, &tcp), 0);
    for (i = 1; i <= 5; i++) {
        assert_int_equal(mbm_loop_wait(&loop, 0), 1);
        assert_int_equal(mbm_loop_pollDelay(&loop), 20 * MS);
        assert_int_equal(mbm_loop_wait(&loop, 0), 0);
        now += 20 * MS;
    }
    assert_int_equal(count, 5);
    mbm_loop_remove(&entry);
    mbm_tcp_close(&tcp);
    close(pair[1]);
}

/* --- plans --- */

TEST(a_plan_reads_at_its_intervals)
{
    static const mbm_planField fields[] = {{.unit = UNIT,
                                            .table = MBM_TABLE_HOLDING_REGISTERS,
                                            .type = MBM_TYPE_UINT16,
                                            .intervalMs = 1000}};
    static mbm_planPosition positions[1];
    static mbm_planRead reads[1];
    static mbm_clientRequest requests[1];
    static uint16_t data[1];
    const mbm_planSetup setup = {.fields = fields,
                                 .positions = positions,
                                 .reads = reads,
                                 .data = data,
                                 .requests = requests,
                                 .fieldCount = 1,
                                 .readCount = 1,
                                 .dataWords = 1,
                                 .requestCount = 1};
    static mbm_plan plan;
    mbm_loop_planned planned = {&devices[0].client, &plan};
    const int64_t from = now;
    double value;

    begin_client(&devices[0]);
    OK(mbm_plan_begin(&plan, &devices[0].client, &setup, NULL));
    devices[0].entry.poll = mbm_loop_pollPlan;
    devices[0].entry.context = &planned;
    for (unsigned i = 1; i <= 20; i++) {
        while (devices[0].sent < i)
            assert_true(step());
        assert_in_range(now, from + (i - 1) * 1000LL * MS, from + (i - 1) * 1000LL * MS + 2 * MS);
        now += 3 * MS;
        answer(&devices[0]);
        mbm_loop_wake(&devices[0].entry);
        assert_true(mbm_loop_wait(&loop, 0) > 0);
        OK(mbm_plan_getStatus(&plan, 0, NULL));
        OK(mbm_plan_getNumber(&plan, 0, 0, &value));
        assert_int_equal((int)value, 0x1234);
    }
}
