/* Begins plans of 10 to 10000 fields, polls them when nothing is due, and reads in rounds, for
 * callgrind, which scripts/bench/speed starts. A device in memory answers every request at once,
 * except those to units that are silent. */
#include "mbm.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <valgrind/callgrind.h>

enum { MOST = 10000, WORDS = 65535, POLLS = 100 };

static mbm_planField fields[MOST];
static mbm_planPosition positions[MOST];
static mbm_planRead reads[MOST];
static uint16_t data[WORDS];
static mbm_clientRequest request = MBM_INIT;
static mbm_client client = MBM_INIT;
static mbm_plan plan = MBM_INIT;
static uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];

/* --- the device: its reply to the last request */

static uint8_t reply[MBM_MAX_TCP_FRAME];
static uint16_t length, taken;
static unsigned first_silent = 256; /* the first unit that does not answer */
static unsigned sent;               /* how many requests */

static int16_t device_write(void *context, const uint8_t *bytes, uint16_t count)
{
    const unsigned quantity = (unsigned)bytes[10] << 8 | bytes[11];
    const unsigned size =
        bytes[7] <= MBM_FC_READ_DISCRETE_INPUTS ? (quantity + 7) / 8 : 2 * quantity;

    memcpy(reply, bytes, 8);
    reply[5] = (uint8_t)(3 + size);
    reply[8] = (uint8_t)size;
    length = (uint16_t)(9 + size);
    taken = 0;
    sent++;
    if (bytes[6] >= first_silent)
        length = 0;
    return (int16_t)count;
}

static int16_t device_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    const uint16_t left = (uint16_t)(length - taken), count = left < capacity ? left : capacity;

    memcpy(bytes, reply + taken, count);
    taken = (uint16_t)(taken + count);
    return (int16_t)count;
}

static uint32_t now;

static uint32_t micros(void *context)
{
    return now;
}

/* --- the tables, each in random order */

static mbm_planField floats(unsigned i)
{
    return (mbm_planField){.unit = (uint16_t)(1 + i / 5000),
                           .table = MBM_TABLE_HOLDING_REGISTERS,
                           .type = MBM_TYPE_FLOAT,
                           .address = (uint16_t)(2 * (i % 5000)),
                           .intervalMs = 1000};
}

static mbm_planField scattered(unsigned i)
{
    return (mbm_planField){.unit = (uint16_t)(1 + i / 5000),
                           .table = MBM_TABLE_INPUT_REGISTERS,
                           .type = MBM_TYPE_UINT16,
                           .address = (uint16_t)(3 * (i % 5000) + i % 7 % 2),
                           .intervalMs = i % 3 ? 1000 : 5000};
}

static mbm_planField bits_of_registers(unsigned i)
{
    return (mbm_planField){.unit = 1,
                           .table = MBM_TABLE_HOLDING_REGISTERS,
                           .type = MBM_TYPE_BIT,
                           .bit = (uint8_t)(i % 16),
                           .address = (uint16_t)(i / 16),
                           .intervalMs = 1000};
}

static mbm_planField coils(unsigned i)
{
    return (mbm_planField){.unit = 1,
                           .table = MBM_TABLE_COILS,
                           .type = MBM_TYPE_BIT,
                           .address = (uint16_t)(2 * i),
                           .intervalMs = 1000};
}

static const struct {
    const char *name;
    mbm_planField (*field)(unsigned i);
} tables[] = {{"floats side by side", floats},
              {"registers with gaps, two intervals", scattered},
              {"16 bits of each register", bits_of_registers},
              {"every second coil", coils}};

static void fill(unsigned table, unsigned count)
{
    unsigned i;

    srand(1);
    for (i = 0; i < count; i++)
        fields[i] = tables[table].field(i);
    for (i = count; i > 1; i--) {
        const unsigned other = (unsigned)rand() % i;
        const mbm_planField field = fields[i - 1];

        fields[i - 1] = fields[other];
        fields[other] = field;
    }
}

static void dump(const char *what, const char *name, unsigned count, unsigned found, unsigned times)
{
    char text[128];

    snprintf(text, sizeof text, "%s\t%s\t%u\t%u\t%u", what, name, count, found, times);
    CALLGRIND_DUMP_STATS_AT(text);
    CALLGRIND_ZERO_STATS;
}

/* Begins the plan of the first fields. */
static void begin(unsigned count)
{
    static mbm_planSetup setup;
    const mbm_port port = {.read = device_read, .write = device_write, .micros = micros};

    setup = (mbm_planSetup){.fields = fields,
                            .positions = positions,
                            .reads = reads,
                            .data = data,
                            .requests = &request,
                            .fieldCount = (uint16_t)count,
                            .readCount = (uint16_t)count,
                            .dataWords = WORDS,
                            .registerGap = 10,
                            .bitGap = 16,
                            .requestCount = 1};
    mbm_client_beginTcp(&client, &port, incoming, sizeof incoming, outgoing, sizeof outgoing);
    CALLGRIND_TOGGLE_COLLECT;
    if (mbm_plan_begin(&plan, &client, &setup, NULL) != MBM_OK)
        abort();
    CALLGRIND_TOGGLE_COLLECT;
}

static void measure(unsigned table, unsigned count)
{
    mbm_planReadInfo info;
    unsigned found = 0, i;

    fill(table, count);
    begin(count);
    while (mbm_plan_getRead(&plan, (uint16_t)found, &info) == MBM_OK)
        found++;
    dump("begin", tables[table].name, count, found, 1);
    for (i = 0; i < 4 * found; i++) {
        mbm_plan_poll(&plan);
        mbm_client_poll(&client);
    }
    for (i = 0; i < found; i++)
        if (mbm_plan_getRead(&plan, (uint16_t)i, &info) != MBM_OK || info.status != MBM_OK)
            abort();
    CALLGRIND_TOGGLE_COLLECT;
    for (i = 0; i < POLLS; i++)
        mbm_plan_poll(&plan);
    CALLGRIND_TOGGLE_COLLECT;
    dump("poll", tables[table].name, count, found, POLLS);
    CALLGRIND_TOGGLE_COLLECT;
    for (i = 0; i < POLLS; i++)
        mbm_plan_pollDelay(&plan);
    CALLGRIND_TOGGLE_COLLECT;
    dump("pollDelay", tables[table].name, count, found, POLLS);
    mbm_plan_end(&plan);
}

/* --- rounds: each field is a read of its own, of ten units and two intervals */

enum { UNITS = 10, SPACING = 10 }; /* milliseconds from one read to the next, about */

static const struct {
    const char *name;
    unsigned first_silent;
    unsigned line_ms; /* how long the line takes for a read that is answered */
    unsigned rounds;
} rounds[] = {{"all units answer", UNITS + 1, 1, 3},
              {"the line is too slow", UNITS + 1, 5 * SPACING, 3},
              {"one unit of ten is silent", UNITS, 1, 3},
              {"all units are silent", 1, 1, 3}};

/* Polls plan and client as a program does, until this many requests were sent. */
static void run(unsigned requests, unsigned line_ms)
{
    for (sent = 0; sent < requests;) {
        const unsigned before = sent;
        uint32_t delay, other;

        CALLGRIND_TOGGLE_COLLECT;
        mbm_plan_poll(&plan);
        mbm_client_poll(&client);
        delay = mbm_plan_pollDelay(&plan);
        CALLGRIND_TOGGLE_COLLECT;
        other = mbm_client_pollDelay(&client);
        if (sent != before && length > 0)
            now += 1000 * line_ms;
        else
            now += delay < other ? delay : other;
    }
}

static void measure_round(unsigned kind, unsigned count)
{
    unsigned i;

    for (i = 0; i < count; i++)
        fields[i] = (mbm_planField){.unit = (uint16_t)(1 + i % UNITS),
                                    .table = MBM_TABLE_HOLDING_REGISTERS,
                                    .type = MBM_TYPE_UINT16,
                                    .address = (uint16_t)(20 * (i / UNITS)),
                                    .intervalMs = SPACING * count * (i / UNITS % 2 ? 1 : 2)};
    first_silent = rounds[kind].first_silent;
    begin(count);
    run(2 * count, rounds[kind].line_ms);
    CALLGRIND_ZERO_STATS;
    run(rounds[kind].rounds * count, rounds[kind].line_ms);
    dump("round", rounds[kind].name, count, count, sent);
    mbm_plan_end(&plan);
}

int main(void)
{
    unsigned kind, table, count;

    for (table = 0; table < sizeof tables / sizeof *tables; table++)
        for (count = 10; count <= MOST; count *= 10)
            measure(table, count);
    for (kind = 0; kind < sizeof rounds / sizeof *rounds; kind++)
        for (count = 10; count <= MOST; count *= 10)
            measure_round(kind, count);
    return 0;
}
