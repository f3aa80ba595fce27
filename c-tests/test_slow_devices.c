/* Devices that answer in order and within the response timeout, but slowly. Some of their replies
 * are late once. No read may return the data of another one, whatever the latency is. (A reply that
 * comes when the device was silent for two response timeouts is beyond that promise: with pauses as
 * long as those of 700 ms, none is later than the timeout by more than itself.) Prints the second
 * table of docs/reports/fault-table.md. On a simulated clock. */
#include "crc.h"
#include "mbm.h"
#include "test.h"

enum {
    UNIT = 17,
    READS = 1000,
    FIRST_LATE = 3,   /* number of the first request whose reply is late; the first is 1 */
    SECOND_LATE = 40, /* and of the second; the device has no other request to answer then */
    MS = 1000,
    CHARACTER = 87, /* microseconds of a byte at 115200 baud */
    FAST = 9,       /* a unit that answers at once */
    SILENT = 5      /* a unit that does not answer */
};

/* Which replies are late. */
typedef enum lateness {
    ONE,        /* one reply */
    TWO_APART,  /* two replies, with right ones between them */
    BURST,      /* all replies stay in a network for a while, and then come at once */
    SLOW_AFTER, /* one reply; and for a while the device is slower than ever before */
    LATENESSES
} lateness;

/* The line, the device and the clock. */
typedef struct world {
    uint64_t now, started;
    uint32_t latency, timeout, late; /* microseconds */
    lateness kind;
    unsigned requests;   /* requests that the device has received */
    uint64_t free;       /* when the device has sent its last reply */
    uint64_t blocked;    /* no reply arrives before */
    uint8_t sent[64];    /* the request that is being received */
    uint16_t sent_count; /* its bytes so far */
    struct {
        uint64_t at;
        uint8_t byte;
    } line[4096]; /* bytes that arrive, by time */
    unsigned first, last;
} world;

typedef struct outcome {
    unsigned right, failed, wrong;
    uint64_t longest; /* microseconds of the longest read after a failed one */
} outcome;

static uint16_t value_of(uint16_t address)
{
    return (uint16_t)(address * 31u + 7u);
}

static uint32_t micros(void *context)
{
    return (uint32_t)((world *)context)->now;
}

static int16_t read_bytes(void *context, uint8_t *bytes, uint16_t capacity)
{
    world *w = (world *)context;
    uint16_t count = 0;

    while (count < capacity && w->first < w->last && w->line[w->first].at <= w->now)
        bytes[count++] = w->line[w->first++].byte;
    if (w->first == w->last)
        w->first = w->last = 0;
    return (int16_t)count;
}

static uint32_t takes(const world *w)
{
    unsigned number = w->requests;

    if (number == FIRST_LATE)
        return w->timeout + w->late;
    if (w->kind == TWO_APART && number == SECOND_LATE)
        return w->timeout + w->late;
    if (w->kind == SLOW_AFTER && number > FIRST_LATE && number < FIRST_LATE + 10)
        return w->timeout - 20 * MS;
    return w->latency;
}

/* Lets a byte arrive at a time, before the bytes that arrive later. */
static void deliver(world *w, uint64_t at, uint8_t byte)
{
    unsigned place = w->last++;

    assert_true(w->last <= COUNT(w->line));
    for (; place > w->first && w->line[place - 1].at > at; place--)
        w->line[place] = w->line[place - 1];
    w->line[place].at = at;
    w->line[place].byte = byte;
}

static void answer(world *w)
{
    uint16_t value = value_of((uint16_t)(w->sent[2] << 8 | w->sent[3]));
    uint8_t frame[7] = {0, 3, 2, (uint8_t)(value >> 8), (uint8_t)value};
    uint64_t at;

    frame[0] = w->sent[0];
    (void)seal(frame, 5);
    if (w->sent[0] == SILENT)
        return;
    if (w->sent[0] == FAST) {
        at = w->now + 2 * MS;
    } else {
        w->requests++;
        if (w->kind == BURST) {
            if (w->requests == FIRST_LATE)
                w->blocked = w->now + w->timeout + w->late;
            at = w->now + w->latency > w->blocked ? w->now + w->latency : w->blocked;
            at = at > w->free ? at : w->free;
        } else {
            at = (w->free > w->now ? w->free : w->now) + takes(w);
        }
        w->free = at + sizeof frame * CHARACTER;
    }
    for (size_t i = 0; i < sizeof frame; i++)
        deliver(w, at + i * CHARACTER, frame[i]);
}

static int16_t write_bytes(void *context, const uint8_t *bytes, uint16_t count)
{
    world *w = (world *)context;

    for (uint16_t i = 0; i < count; i++) {
        w->sent[w->sent_count++] = bytes[i];
        if (w->sent_count == 8) {
            w->now += 8 * CHARACTER;
            answer(w);
            w->sent_count = 0;
        }
    }
    return (int16_t)count;
}

static mbm_port port_of(world *w)
{
    mbm_port port = {.read = read_bytes, .write = write_bytes, .micros = micros, .context = w};

    return port;
}

/* Sleeps as a program would: until a byte arrives, at most `delay`. */
static void sleep_until_a_byte(world *w, uint32_t delay)
{
    uint64_t until = w->now + (delay > 0 ? delay : 1);

    if (w->first < w->last && w->line[w->first].at > w->now && w->line[w->first].at < until)
        until = w->line[w->first].at;
    w->now = until;
}

static uint8_t node_reads(world *w, mbm_node *m, uint8_t unit, uint16_t address, uint16_t *value)
{
    OK(mbm_node_setSlaveID(m, unit));
    uint8_t status = mbm_node_readHoldingRegisters(m, address, 1);
    while (status == MBM_PENDING) {
        sleep_until_a_byte(w, mbm_node_pollDelay(m));
        status = mbm_node_poll(m);
    }
    *value = mbm_node_receive(m);
    return status;
}

static uint8_t client_reads(world *w, mbm_client *c, uint8_t unit, uint16_t address,
                            uint16_t *value)
{
    mbm_clientRequest request = {.unit = unit, .reply = value, .replyBytes = sizeof *value};

    IS(MBM_PENDING, mbm_client_readHoldingRegisters(c, &request, address, 1));
    while (request.status == MBM_PENDING) {
        sleep_until_a_byte(w, mbm_client_pollDelay(c));
        (void)mbm_client_poll(c);
    }
    return request.status;
}

/* A line in use: the device, and who reads it. */
typedef struct user {
    world w;
    mbm_port port;
    mbm_line line;
    mbm_node node;
    mbm_client client;
    uint8_t buffer[MBM_MAX_FRAME];
    uint16_t words[1];
    int has_client;
} user;

static uint8_t reads(user *u, uint8_t unit, uint16_t address, uint16_t *value)
{
    return u->has_client ? client_reads(&u->w, &u->client, unit, address, value)
                         : node_reads(&u->w, &u->node, unit, address, value);
}

static void begin(user *u, int has_client, uint32_t timeout)
{
    u->has_client = has_client;
    u->port = port_of(&u->w);
    if (has_client) {
        OK(mbm_client_beginRtu(&u->client, &u->port, u->buffer, sizeof u->buffer));
        OK(mbm_client_setBaudRate(&u->client, 115200));
        OK(mbm_client_setResponseTimeout(&u->client, (uint16_t)(timeout / MS)));
    } else {
        OK(mbm_line_beginRtu(&u->line, &u->port, u->buffer, sizeof u->buffer));
        OK(mbm_node_begin(&u->node, &u->line, UNIT, u->words, 1, NULL, 0));
        OK(mbm_line_setBaudRate(&u->line, 115200));
        OK(mbm_node_setResponseTimeout(&u->node, (uint16_t)(timeout / MS)));
        OK(mbm_node_setBlocking(&u->node, 0));
    }
}

/* Reads READS registers, one after the other, and adds up how the reads end. */
static void add_reads(outcome *sum, int has_client, lateness kind, uint32_t latency,
                      uint32_t timeout, uint32_t late, uint32_t pause, int mixed)
{
    user *u = (user *)calloc(1, sizeof *u);
    uint8_t before = MBM_OK;

    assert_non_null(u);
    u->w.latency = latency;
    u->w.timeout = timeout;
    u->w.late = late;
    u->w.kind = kind;
    begin(u, has_client, timeout);
    for (uint16_t i = 0; i < READS; i++) {
        uint16_t value = 0;
        uint64_t began = u->w.now;
        uint8_t status = reads(u, UNIT, i, &value);

        if (status != MBM_OK)
            sum->failed++;
        else if (value == value_of(i))
            sum->right++;
        else
            sum->wrong++;
        if (before != MBM_OK && status == MBM_OK && u->w.now - began > sum->longest)
            sum->longest = u->w.now - began;
        before = status;
        u->w.now += pause;
        if (mixed) {
            uint16_t other = (uint16_t)~i;

            if (reads(u, FAST, other, &value) == MBM_OK)
                assert_int_equal(value, value_of(other));
        }
    }
    free(u);
}

static const uint32_t latencies[] = {3, 50, 90, 105, 150, 450, 1900};
static const uint32_t timeouts[] = {500, 2000};
static const uint32_t pauses[] = {0, 60, 700};
static const uint32_t late_by[] = {1, 20, 90, 250, 1000, 2600, 7000};

/* All kinds of lateness, for the master and the client. */
static outcome outcome_of(uint32_t latency, uint32_t timeout, uint32_t pause, int mixed)
{
    outcome sum = {0};

    for (unsigned kind = 0; kind < LATENESSES; kind++)
        for (unsigned late = 0; late < COUNT(late_by); late++)
            for (int has_client = 0; has_client < 2 && (pause < timeout || late_by[late] < timeout);
                 has_client++)
                add_reads(&sum, has_client, (lateness)kind, latency * MS, timeout * MS,
                          late_by[late] * MS, pause * MS, mixed);
    return sum;
}

static void assert_never_wrong(int mixed, FILE *table)
{
    for (unsigned i = 0; i < COUNT(latencies); i++)
        for (unsigned j = 0; j < COUNT(timeouts); j++) {
            if (latencies[i] >= timeouts[j])
                continue;
            if (table)
                fprintf(table, "| %u | %u |", (unsigned)latencies[i], (unsigned)timeouts[j]);
            for (unsigned k = 0; k < COUNT(pauses); k++) {
                outcome o = outcome_of(latencies[i], timeouts[j], pauses[k], mixed);

                if (table)
                    fprintf(table, " %u, %u, %u |", o.right, o.failed, o.wrong);
                if (o.wrong > 0)
                    fail_msg("%u wrong: latency %u, timeout %u, pause %u", o.wrong,
                             (unsigned)latencies[i], (unsigned)timeouts[j], (unsigned)pauses[k]);
                /* A failed read costs its timeout; the next right one at most this. */
                assert_in_range(o.longest, 0, 4 * timeouts[j] * MS + 200 * MS);
            }
            if (table)
                fprintf(table, "\n");
        }
}

TEST(a_device_of_any_latency_never_gives_the_data_of_another_read)
{
    const char *path = getenv("MBM_FAULT_TABLE");
    FILE *table = path ? fopen(path, "w") : NULL;

    if (table)
        fprintf(
            table,
            "| latency, ms | response timeout, ms | back to back | pauses of 60 ms | pauses of 700 ms |\n"
            "|---|---|---|---|---|\n");
    assert_never_wrong(0, table);
    if (table)
        (void)fclose(table);
}

TEST_ROW(reads_of_a_fast_device_in_between_do_not_shift_those_of_a_slow_one,
         assert_never_wrong(1, NULL))

/* The second unit that does not answer must not make the master forget the first. */
TEST(a_late_reply_is_expected_though_another_unit_is_silent)
{
    for (int has_client = 0; has_client < 2; has_client++) {
        user *u = (user *)calloc(1, sizeof *u);
        uint16_t i, value;

        assert_non_null(u);
        u->w.latency = 105 * MS;
        u->w.timeout = 500 * MS;
        u->w.late = 390 * MS;
        begin(u, has_client, u->w.timeout);
        for (i = 0; i < 50; i++) {
            uint8_t status = reads(u, UNIT, i, &value);

            assert_true(status == MBM_OK ? value == value_of(i) : i < 4);
            if (i == FIRST_LATE - 1)
                assert_int_not_equal(reads(u, SILENT, i, &value), MBM_OK);
        }
        free(u);
    }
}
