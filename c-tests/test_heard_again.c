/* A device that has lost a reply, or is late with one, is heard again in bounded time, whatever
 * limit the program has after which it cancels a request; and no unit waits for another. Prints the
 * third table of docs/reports/fault-table.md. On a simulated clock. */
#include "faults.h"
#include "reader.h"
#include "test.h"

fixture each_test = {sim_setup, sim_teardown};

enum {
    TIMEOUT = 500 * MS,
    QUIET = 100 * MS,            /* the default quiet time */
    CLEAN = 2 * TIMEOUT + QUIET, /* the silence after which a unit owes nothing */
    GAP = 4 * MS,                /* the default gap */
    EXCHANGE = 50 * MS,          /* more than a request, a reply and their gap take */
    OTHER = 3,
    ABSENT = 100 /* a unit without a device */
};

static void begin(bench *b, sim *s, reader_kind kind)
{
    bench_begin(b, s, kind, TIMEOUT);
}

static void reads_well(bench *b, uint8_t unit, unsigned count)
{
    while (count-- > 0)
        OK(bench_reads(b, unit, (uint16_t)(100 + count), EXCHANGE));
}

/* One reply is lost, and the program gives up after 20 ms. Returns when the request was sent. */
static uint64_t loses_one(bench *b, device *d)
{
    device_loses(d, 1);
    IS(MBM_CANCELLED, bench_reads(b, d->unit, 9, 20 * MS));
    return b->s->frames[b->s->sent - 1].begin;
}

static const uint32_t limits[] = {20, 40, 80, 160, 500, 1000, 0};
static const uint32_t timeouts[] = {500, 2000};
static const uint32_t pauses[] = {0, 200, 1000, 60000};
static const unsigned losses[] = {1, 5};

/* Returns how many ms pass from the begin of the first read that fails to the first good value.
 * Afterwards all reads must succeed. */
static unsigned time_to_the_first_value(sim *s, reader_kind kind, uint32_t limit, uint32_t timeout,
                                        uint32_t pause, unsigned lost)
{
    bench b;
    uint64_t began, well;
    uint16_t i;
    uint8_t status;

    begin(&b, s, kind);
    bench_set_timeout(&b, timeout);
    device *d = bench_add(&b, UNIT, PROMPT);
    for (i = 0; i < 10; i++)
        OK(bench_reads(&b, UNIT, i, limit));
    device_loses(d, lost);
    began = well = s->now;
    do {
        uint64_t read = s->now;

        status = bench_reads(&b, UNIT, i++, limit);
        if (d->requests < d->lost + lost)
            well = s->now;
        /* From the last loss on, the device answers. */
        assert_true(status == MBM_OK || read <= well + UINT64_C(5) * timeout);
        if (status != MBM_OK)
            s->now += pause;
    } while (status != MBM_OK);
    began = (s->now - began + MS / 2) / MS;
    for (i = 0; i < 50; i++) {
        s->now += pause;
        OK(bench_reads(&b, UNIT, i, limit));
    }
    return (unsigned)began;
}

static void one_row(sim *s, FILE *table, uint32_t timeout, uint32_t limit, unsigned lost)
{
    char text[16] = "none";

    if (limit > 0)
        (void)snprintf(text, sizeof text, "%u", (unsigned)limit);
    if (table)
        fprintf(table, "| %u | %s | %u |", (unsigned)timeout, text, lost);
    for (unsigned pause = 0; pause < COUNT(pauses); pause++)
        for (unsigned kind = NODE_READS; kind <= CLIENT_READS; kind++) {
            unsigned ms =
                time_to_the_first_value(s, (reader_kind)kind, limit ? limit * MS : (uint32_t)NEVER,
                                        timeout * MS, pauses[pause] * MS, lost);

            if (table)
                fprintf(table, kind == NODE_READS ? " %u, " : "%u |", ms);
        }
    if (table)
        fprintf(table, "\n");
}

SIM_TEST(a_device_is_heard_again_whatever_limit_and_pause_a_program_has)
{
    const char *path = getenv("MBM_FAULT_TABLE");
    FILE *table = path ? fopen(path, "w") : NULL;

    if (table)
        fprintf(table,
                "| response timeout, ms | limit, ms | lost replies | no pause | pauses of 200 ms | "
                "pauses of 1 s | pauses of 1 min |\n|---|---|---|---|---|---|---|\n");
    for (unsigned i = 0; i < COUNT(timeouts); i++)
        for (unsigned j = 0; j < COUNT(limits); j++)
            for (unsigned k = 0; k < COUNT(losses); k++)
                one_row(s, table, timeouts[i], limits[j], losses[k]);
    if (table)
        (void)fclose(table);
}

/* A test that each kind of reader from `first` to `last` passes, with each of these values. */
#define BENCH_TEST(name, first, last, ...)                                                         \
    static void each_##name(sim *s, bench *b, int kind, uint32_t with);                            \
    SIM_TEST(name)                                                                                 \
    {                                                                                              \
        static const uint32_t with[] = {__VA_ARGS__};                                              \
        bench b;                                                                                   \
                                                                                                   \
        for (int kind = first; kind <= last; kind++)                                               \
            for (unsigned i = 0; i < COUNT(with); i++) {                                           \
                begin(&b, s, (reader_kind)kind);                                                   \
                each_##name(s, &b, kind, with[i]);                                                 \
            }                                                                                      \
    }                                                                                              \
    static void each_##name(__attribute__((unused)) sim *s, bench *b, int kind, uint32_t with)
#define READERS_TEST(name, first) BENCH_TEST(name, first, READERS - 1, 0)
/* A node reads; the program gives up the first request after 50 ms, or waits in vain. */
#define NODE_TEST(name) BENCH_TEST(name, NODE_READS, NODE_READS, 50 * MS, (uint32_t)NEVER)

/* Cancelled while it waits for the gap. */
READERS_TEST(a_request_that_is_cancelled_before_its_frame_left_changes_nothing, NODE_READS)
{
    unsigned sent;

    if (kind == ASCII_CLIENT_READS)
        OK(mbm_client_setGap(&b->client, GAP));
    bench_add(b, UNIT, PROMPT);
    reads_well(b, UNIT, 1);
    sent = s->sent;
    IS(MBM_CANCELLED, bench_reads(b, UNIT, 1, GAP / 2));
    assert_int_equal(s->sent, sent);
    OK(bench_reads(b, UNIT, 2, EXCHANGE));
    assert_int_equal(s->sent, sent + 1);
    sim_assert_time(s->frames[sent].silence, GAP);
    assert_in_range(s->now - s->last_byte, 0, SIM_SLACK);
}

READERS_TEST(a_request_that_is_cancelled_in_the_middle_of_its_frame_changes_nothing, NODE_READS)
{
    bench_add(b, UNIT, PROMPT);
    reads_well(b, UNIT, 1);
    s->now += EXCHANGE;
    s->write_piece = 5;
    s->write_busy = 1;
    IS(MBM_PENDING, bench_starts(b, UNIT, 1));
    while (s->sent < 2) {
        IS(MBM_PENDING, bench_polls(b));
        s->now += 10;
    }
    bench_cancels(b);
    s->write_piece = s->write_busy = 0;
    reads_well(b, UNIT, 2);
    assert_false(s->frames[1].whole);
    assert_in_range(s->now - s->last_byte, 0, SIM_SLACK);
    s->cut_allowed = 1; /* in the frames since `begin` */
}

/* Like a program that looks in each round whether the unit is there again. */
READERS_TEST(requests_that_are_cancelled_while_they_wait_make_the_wait_no_longer, NODE_READS)
{
    uint64_t sent = loses_one(b, bench_add(b, UNIT, PROMPT));
    unsigned count = s->sent;
    while (s->now < sent + CLEAN - 60 * MS)
        IS(MBM_CANCELLED, bench_reads(b, UNIT, 1, 30 * MS));
    assert_int_equal(s->sent, count);
    OK(bench_reads(b, UNIT, 2, 2 * EXCHANGE));
    assert_in_range(s->frames[count].begin - sent, CLEAN, CLEAN + 20 * MS);
    reads_well(b, UNIT, 20);
}

READERS_TEST(a_request_that_waits_does_not_stop_the_clients_queue, CLIENT_READS)
{
    mbm_clientRequest other = {0};
    uint16_t word = 0;
    uint64_t began;

    bench_add(b, OTHER, PROMPT);
    uint64_t sent = loses_one(b, bench_add(b, UNIT, PROMPT));
    s->now += QUIET;
    IS(MBM_PENDING, bench_starts(b, UNIT, 1));
    other.unit = OTHER;
    other.reply = &word;
    other.replyBytes = sizeof word;
    /* The other unit is read again and again; the one that waits has its turn when it is due.
     */
    do {
        IS(MBM_PENDING, mbm_client_readHoldingRegisters(&b->client, &other, 7, 1));
        began = s->now;
        while (mbm_client_poll(&b->client) == MBM_PENDING && other.status == MBM_PENDING)
            sleep_until_a_byte(s, mbm_client_pollDelay(&b->client), UINT64_MAX);
        OK(other.status);
        assert_int_equal(word, fault_value(7));
        assert_in_range(s->now - began, 0, 2 * EXCHANGE);
        s->now += GAP;
    } while (b->request.status == MBM_PENDING && s->now < sent + 2 * CLEAN);
    OK(b->request.status);
    assert_int_equal(b->word, fault_value(1));
    assert_in_range(s->now - sent, CLEAN, CLEAN + 2 * EXCHANGE);
}

/* The other node, with a word of its own. */
static mbm_node second;
static uint16_t second_word;

static void begin_second(sim *s, uint8_t unit)
{
    memset(&second, 0, sizeof second);
    OK(mbm_node_begin(&second, &s->line, unit, &second_word, 1, NULL, 0));
    OK(mbm_node_setResponseTimeout(&second, TIMEOUT / MS));
}

BENCH_TEST(a_request_of_a_node_that_waits_gives_way_to_that_of_another_node, NODE_READS, NODE_READS,
           0, 1)
{
    uint64_t sent, began;

    begin_second(s, OTHER);
    OK(mbm_node_setBlocking(&second, (uint8_t)with));
    bench_add(b, OTHER, PROMPT);
    sent = loses_one(b, bench_add(b, UNIT, PROMPT));
    IS(MBM_PENDING, bench_starts(b, UNIT, 1));
    IS(MBM_PENDING, bench_goes_on(b, 1, 2 * QUIET));
    began = s->now;
    IS(with ? MBM_OK : MBM_PENDING, mbm_node_readHoldingRegisters(&second, 5, 1));
    IS(MBM_CANCELLED, bench_polls(b));
    IS(MBM_CANCELLED, mbm_node_status(&s->node));
    while (mbm_node_poll(&second) == MBM_PENDING)
        sleep_until_a_byte(s, mbm_node_pollDelay(&second), UINT64_MAX);
    OK(mbm_node_status(&second));
    assert_int_equal(second_word, fault_value(5));
    assert_in_range(s->now - began, 0, EXCHANGE);
    /* It changed nothing for the node that gave way. */
    OK(bench_reads(b, UNIT, 2, NEVER));
    assert_in_range(s->frames[s->sent - 1].begin - sent, CLEAN, CLEAN + MS);
}

static unsigned refused;

static void try_the_second_node(sim *s)
{
    /* Once the quiet time has passed, only its unit keeps the request from being sent. */
    if (s->now < s->frames[0].begin + 2 * QUIET || s->sent > 1)
        return;
    IS(MBM_BUSY, mbm_node_readHoldingRegisters(&second, 5, 1));
    refused++;
}

BENCH_TEST(a_request_of_a_blocking_node_that_waits_does_not_give_way, NODE_READS, NODE_READS, 0)
{
    begin_second(s, OTHER);
    bench_add(b, OTHER, PROMPT);
    uint64_t sent = loses_one(b, bench_add(b, UNIT, PROMPT));
    OK(mbm_node_setBlocking(&s->node, 1));
    refused = 0;
    s->on_idle = try_the_second_node;
    OK(mbm_node_readHoldingRegisters(&s->node, 3, 1));
    s->on_idle = NULL;
    assert_true(refused > 0);
    assert_int_equal(s->response[0], fault_value(3));
    assert_int_equal(s->sent, 2);
    assert_in_range(s->frames[1].begin - sent, CLEAN, CLEAN + MS);
    OK(mbm_node_readHoldingRegisters(&second, 5, 1));
}

/* The late reply shows that the unit owes nothing any more. */
READERS_TEST(a_late_reply_lets_the_request_that_waits_be_sent_at_once, NODE_READS)
{
    uint64_t sent;

    device *d = bench_add(b, UNIT, PROMPT);
    reads_well(b, UNIT, 3);
    device_is_late(d, TIMEOUT + 200 * MS);
    IS(MBM_CANCELLED, bench_reads(b, UNIT, 1, 50 * MS));
    sent = s->frames[s->sent - 1].end;
    OK(bench_reads(b, UNIT, 2, NEVER));
    assert_in_range(s->frames[s->sent - 1].begin - sent, TIMEOUT + 200 * MS,
                    TIMEOUT + 200 * MS + EXCHANGE);
    reads_well(b, UNIT, 50);
}

/* It comes within the quiet time. */
READERS_TEST(a_reply_soon_after_its_request_was_cancelled_makes_no_later_one_wait, NODE_READS)
{
    device *d = bench_add(b, UNIT, PROMPT);
    device_is_late(d, 60 * MS);
    IS(MBM_CANCELLED, bench_reads(b, UNIT, 1, 40 * MS));
    OK(bench_reads(b, UNIT, 2, 2 * EXCHANGE));
    reads_well(b, UNIT, 50);
}

READERS_TEST(a_late_reply_that_comes_while_another_unit_is_asked_counts_as_well, NODE_READS)
{
    device *d = bench_add(b, UNIT, PROMPT);
    bench_add(b, OTHER, 400 * MS);
    device_is_late(d, 300 * MS);
    IS(MBM_CANCELLED, bench_reads(b, UNIT, 1, 50 * MS));
    OK(bench_reads(b, OTHER, 2, NEVER));
    assert_in_range(s->now, d->free, d->free + TIMEOUT);
    OK(bench_reads(b, UNIT, 3, EXCHANGE));
    reads_well(b, UNIT, 50);
}

/* Units with the same last five bits as unit 1 or 31. */
#define ALIKE_TEST(name) BENCH_TEST(name, NODE_READS, READERS - 1, 33, 65, 97, 129, 225, 255)

/* The reply of unit 1 comes 700 ms after its timeout, and the other unit is read in between. */
ALIKE_TEST(units_with_the_same_last_five_bits_share_no_memory)
{
    const uint8_t other = (uint8_t)with, unit = other == 255 ? 31 : 1;
    device *d = bench_add(b, unit, 100 * MS);

    bench_add(b, other, 5 * MS);
    for (uint16_t n = 0; n < 100; n++) {
        const uint8_t status = bench_reads(b, unit, n, NEVER);

        if (n == 1)
            device_is_late(d, 1200 * MS);
        if (n == 10)
            device_loses(d, 1);
        assert_true(status == MBM_OK || n == 2 || n == 3 || n == 11);
        OK(bench_reads(b, other, (uint16_t)(1000 + n), NEVER));
    }
}

ALIKE_TEST(a_unit_that_is_dead_delays_no_unit_with_the_same_last_five_bits)
{
    for (int is_cancelled = 0; is_cancelled < 2; is_cancelled++) {
        begin(b, s, (reader_kind)kind);
        bench_add(b, (uint8_t)with, 5 * MS);
        for (unsigned n = 0; n < 10; n++) {
            if (is_cancelled)
                IS(MBM_CANCELLED, bench_reads(b, 1, 0, 50 * MS));
            else
                IS(MBM_RESPONSE_TIMED_OUT, bench_reads(b, 1, 0, NEVER));
            OK(bench_reads(b, (uint8_t)with, 4, QUIET + EXCHANGE));
            reads_well(b, (uint8_t)with, 5);
        }
    }
}

/* Each of them must know which requests the other one has cancelled, or waited for in vain. */
NODE_TEST(two_nodes_of_one_unit_know_of_each_others_late_replies)
{
    begin_second(s, UNIT);
    device_is_late(bench_add(b, UNIT, PROMPT), TIMEOUT + 300 * MS);
    assert_int_not_equal(bench_reads(b, UNIT, 1, with), MBM_OK);
    for (unsigned n = 2; n < 50; n++) {
        OK(mbm_node_readHoldingRegisters(&second, (uint16_t)(500 + n), 1));
        assert_int_equal(second_word, fault_value(500 + n));
        OK(bench_reads(b, UNIT, (uint16_t)n, EXCHANGE));
    }
}

NODE_TEST(a_node_that_has_changed_its_unit_does_not_forget_the_late_reply)
{
    for (unsigned begins = 0; begins < 2; begins++) {
        begin(b, s, (reader_kind)kind);
        device_is_late(bench_add(b, UNIT, PROMPT), TIMEOUT + 300 * MS);
        bench_add(b, OTHER, PROMPT);
        assert_int_not_equal(bench_reads(b, UNIT, 1, with), MBM_OK);
        if (begins)
            sim_node(s, OTHER);
        /* Its new unit is clean. */
        OK(bench_reads(b, OTHER, 2, QUIET + EXCHANGE));
        if (begins)
            sim_node(s, UNIT);
        OK(bench_reads(b, UNIT, 3, NEVER));
        reads_well(b, UNIT, 50);
    }
}

/* Broadcasts 06, and returns after how long it left. */
static uint64_t broadcasts(bench *b)
{
    const uint64_t began = b->s->now;
    const uint16_t word = 7;

    if (b->kind == NODE_READS) {
        OK(mbm_node_setSlaveID(&b->s->node, 0));
        IS(MBM_PENDING, mbm_node_writeSingleRegister(&b->s->node, 1, word));
    } else {
        memset(&b->request, 0, sizeof b->request);
        IS(MBM_PENDING, mbm_client_writeSingleRegister(&b->client, &b->request, 1, word));
    }
    OK(bench_goes_on(b, 0, NEVER));
    assert_int_equal(b->s->frames[b->s->sent - 1].bytes[0], 0);
    return b->s->frames[b->s->sent - 1].begin - began;
}

static void broadcast(bench *b)
{
    const uint16_t before = b->word;

    /* `bench_goes_on` compares with the value of register 0. */
    b->word = b->s->response[0] = fault_value(0);
    assert_in_range(broadcasts(b), 0, QUIET + GAP + MS);
    b->word = before;
}

/* Even if more units owe replies than are remembered one by one. */
READERS_TEST(a_broadcast_does_not_wait_after_a_cancelled_request, NODE_READS)
{
    (void)loses_one(b, bench_add(b, UNIT, PROMPT));
    broadcast(b);
    for (uint8_t unit = ABSENT; unit < ABSENT + 20; unit++)
        (void)bench_reads(b, unit, 0, QUIET + 40 * MS);
    broadcast(b);
    /* And it lets no reply be late. */
    s->now += CLEAN;
    reads_well(b, UNIT, 1);
    broadcast(b);
    reads_well(b, UNIT, 5);
}

/* More units than are remembered one by one. */
READERS_TEST(a_healthy_unit_is_heard_again_after_requests_to_many_absent_ones, NODE_READS)
{
    bench_add(b, UNIT, PROMPT);
    reads_well(b, UNIT, 3);
    for (uint8_t unit = ABSENT; unit < ABSENT + 20; unit++)
        (void)bench_reads(b, unit, 0, QUIET + 40 * MS);
    uint64_t last = s->frames[s->sent - 1].begin;
    while (bench_reads(b, UNIT, 1, QUIET + EXCHANGE) != MBM_OK)
        assert_true(s->now < last + UINT64_C(5) * TIMEOUT);
    reads_well(b, UNIT, 50);
}

READERS_TEST(a_quiet_time_of_0_gives_it_all_up, NODE_READS)
{
    if (kind == NODE_READS)
        OK(mbm_line_setQuietTime(&s->line, 0));
    else
        OK(mbm_client_setQuietTime(&b->client, 0));
    device *d = bench_add(b, UNIT, PROMPT);
    (void)loses_one(b, d);
    reads_well(b, UNIT, 50);
    device_loses(d, 1);
    IS(MBM_RESPONSE_TIMED_OUT, bench_reads(b, UNIT, 1, NEVER));
    reads_well(b, UNIT, 50);
}

NODE_TEST(a_device_whose_replies_always_deviate_is_heard_again)
{
    static const int8_t by[] = {1, -1, 20};

    for (unsigned j = 0; j < COUNT(by); j++) {
        begin(b, s, (reader_kind)kind);
        OK(mbm_node_setLenient(&s->node, 1));
        device *d = bench_add(b, UNIT, PROMPT);
        d->deviates = by[j];
        for (unsigned n = 0; n < 20; n++) {
            const uint16_t address = (uint16_t)(40 * n);
            const uint64_t began = s->now;

            if (n == 5)
                device_loses(d, 1);
            IS(MBM_PENDING, mbm_node_readHoldingRegisters(&s->node, address, 2));
            if (n != 5) {
                OK(bench_goes_on(b, address, NEVER));
                assert_int_equal(mbm_node_available(&s->node), 2 + by[j]);
                assert_in_range(s->now - began, 0, 4 * TIMEOUT);
                continue;
            }
            assert_int_not_equal(bench_goes_on(b, address, with), MBM_OK);
            bench_cancels(b);
        }
    }
}

NODE_TEST(a_device_that_always_repeats_another_value_is_heard_again)
{
    OK(mbm_node_setLenient(&s->node, 1));
    device *d = bench_add(b, UNIT, PROMPT);
    d->repeats_wrong = 1;
    s->response[0] = fault_value(0);
    for (unsigned n = 0; n < 20; n++) {
        if (n == 5)
            device_loses(d, 1);
        IS(MBM_PENDING, mbm_node_writeSingleRegister(&s->node, 1, (uint16_t)n));
        if (n != 5) {
            OK(bench_goes_on(b, 0, NEVER));
            continue;
        }
        assert_int_not_equal(bench_goes_on(b, 0, with), MBM_OK);
        bench_cancels(b);
    }
}

/* A late reply to a read of more registers, to a lenient node that reads fewer, and the reverse.
 * All replies deviate. */
NODE_TEST(no_late_reply_that_deviates_is_taken_for_the_next_one)
{
    for (unsigned first = 0; first < 2; first++) {
        begin(b, s, (reader_kind)kind);
        OK(mbm_node_setLenient(&s->node, 1));
        device *d = bench_add(b, UNIT, PROMPT);
        d->deviates = 1;
        device_is_late(d, TIMEOUT + 300 * MS);
        for (unsigned n = 0; n < 20; n++) {
            const uint16_t address = (uint16_t)(40 * n), quantity = (n + first) % 2 ? 1 : 9;

            IS(MBM_PENDING, mbm_node_readHoldingRegisters(&s->node, address, quantity));
            /* `bench_goes_on` compares the first register. */
            if (bench_goes_on(b, address, n == 0 ? with : (uint32_t)NEVER) != MBM_OK) {
                assert_int_equal(n, 0);
                bench_cancels(b);
            }
        }
    }
}

static uint8_t connect_again(void *context)
{
    ((sim *)context)->read_dead = 0;
    return MBM_OK;
}

static void disconnect(void *context) {}

/* A new connection has no replies of the old one. A serial line that was opened again may. */
BENCH_TEST(a_new_connection_of_rtu_over_tcp_owes_nothing, CLIENT_READS, CLIENT_READS, 0, 1)
{
    const mbm_linkHooks hooks = {.context = s, .connect = connect_again, .disconnect = disconnect};
    mbm_link link = MBM_INIT;
    uint64_t sent;

    memset(&b->client, 0, sizeof b->client);
    if (with)
        OK(mbm_client_beginRtuOverTcp(&b->client, &s->port, b->frame, MBM_MAX_FRAME));
    else
        OK(mbm_client_beginRtu(&b->client, &s->port, b->frame, MBM_MAX_FRAME));
    OK(mbm_client_setResponseTimeout(&b->client, TIMEOUT / MS));
    OK(mbm_link_begin(&link, &b->client, &hooks));
    bench_add(b, UNIT, PROMPT);
    reads_well(b, UNIT, 3);
    sent = loses_one(b, &b->devices[0]);
    s->read_dead = 1;
    (void)mbm_client_poll(&b->client);
    OK(bench_reads(b, UNIT, 1, NEVER));
    assert_int_equal(s->read_dead, 0);
    sent = s->frames[s->sent - 1].begin - sent;
    if (with)
        assert_in_range(sent, 0, EXCHANGE);
    else
        assert_in_range(sent, CLEAN, CLEAN + EXCHANGE);
    OK(mbm_link_end(&link));
}
