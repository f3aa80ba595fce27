/* The ports of the tool that read only what a wait has found: of lines, and of a gateway's
 * clients. */
#include "port_over.h"
#include "test.h"

/* The port below: its bytes, its clock, and how often it was read. */
static uint8_t bytes[600];
static uint16_t at, end;
static uint32_t now;
static unsigned reads, writes;

static int16_t read_below(void *context, uint8_t *to, uint16_t capacity)
{
    const uint16_t left = (uint16_t)(end - at), count = left < capacity ? left : capacity;

    reads++;
    memcpy(to, bytes + at, count);
    at = (uint16_t)(at + count);
    return (int16_t)count;
}

static int16_t write_below(void *context, const uint8_t *from, uint16_t length)
{
    writes++;
    return (int16_t)length;
}

static uint32_t micros_below(void *context)
{
    return now;
}

static const mbm_port below = {.read = read_below, .write = write_below, .micros = micros_below};
static const struct pollfd NOTHING = {0, POLLIN, 0}, FOUND = {0, POLLIN, POLLIN},
                           NOT_ASKED = {0, 0, 0};
static found_round the_round;
static found_port found;
static mbm_port line;
static uint8_t got[600];

static void begin(void)
{
    for (unsigned i = 0; i < sizeof bytes; i++)
        bytes[i] = (uint8_t)i;
    at = end = 0;
    now = 1000;
    reads = writes = 0;
    found_port_end_round(&the_round);
    line = found_port_begin(&found, &below);
}

fixture each_test = {begin, NULL};

static int16_t take(const mbm_port *from, uint16_t capacity)
{
    return from->read(from->context, got, capacity);
}

static uint32_t time_of(const mbm_port *from)
{
    return from->micros(from->context);
}

TEST(without_a_round_every_call_passes)
{
    found_port_note(&found, &the_round, &NOTHING);
    assert_int_equal(take(&line, 8), 0);
    assert_int_equal(take(&line, 8), 0);
    assert_int_equal(reads, 2);
    assert_int_equal(time_of(&line), 1000);
    now = 1001;
    assert_int_equal(time_of(&line), 1001);
}

TEST(a_line_without_bytes_is_not_read_and_its_time_stands_still)
{
    found_port_begin_round(&the_round);
    found_port_note(&found, &the_round, &NOTHING);
    uint32_t waited = time_of(&line);
    /* They come after the wait: they must not be late for what ends meanwhile. */
    end = 5;
    now = 900000;
    assert_int_equal(take(&line, 8), 0);
    assert_int_equal(reads, 0);
    assert_int_equal(time_of(&line), waited);
    found_port_end_round(&the_round);
    assert_int_equal(time_of(&line), 900000);
    found_port_begin_round(&the_round);
    found_port_note(&found, &the_round, &FOUND);
    assert_int_equal(take(&line, 8), 5);
    assert_memory_equal(got, bytes, 5);
}

TEST(a_write_lets_the_time_go_on_and_the_line_be_read)
{
    found_port_begin_round(&the_round);
    found_port_note(&found, &the_round, &NOTHING);
    now = 2000;
    assert_int_equal(line.write(line.context, bytes, 3), 3);
    assert_int_equal(writes, 1);
    assert_int_equal(time_of(&line), 2000);
    end = 2;
    assert_int_equal(take(&line, 8), 2);
}

TEST(a_read_that_takes_all_bytes_is_the_last_one)
{
    found_port_begin_round(&the_round);
    found_port_note(&found, &the_round, &FOUND);
    end = 12;
    assert_int_equal(take(&line, 8), 8);
    assert_int_equal(time_of(&line), 1000);
    now = 1500;
    assert_int_equal(take(&line, 8), 4);
    now = 9000;
    assert_int_equal(take(&line, 8), 0);
    assert_int_equal(reads, 2);
    assert_int_equal(time_of(&line), 1500);
    found_port_begin_round(&the_round);
    found_port_note(&found, &the_round, &FOUND);
    assert_int_equal(time_of(&line), 9000);
    assert_int_equal(take(&line, 8), 0);
    assert_int_equal(reads, 3);
}

TEST(a_line_that_the_wait_was_not_for_is_read)
{
    found_port_begin_round(&the_round);
    found_port_note(&found, &the_round, &NOT_ASKED);
    end = 3;
    assert_int_equal(take(&line, 8), 3);
}

TEST(a_clients_bytes_are_read_at_once_and_given_in_parts)
{
    static ahead_port ahead;
    const mbm_port client = ahead_port_begin(&ahead, &below);

    end = sizeof ahead.bytes + 40;
    assert_int_equal(take(&client, 8), 0);
    assert_int_equal(reads, 0);
    ahead.is_ready = 1;
    assert_int_equal(take(&client, 8), 8);
    assert_int_equal(ahead_port_has_bytes(&ahead), 1);
    assert_int_equal(take(&client, sizeof got), sizeof ahead.bytes - 8);
    assert_memory_equal(got, bytes + 8, sizeof ahead.bytes - 8);
    assert_int_equal(reads, 1);
    /* It was full, so there may be more. */
    assert_int_equal(take(&client, sizeof got), 40);
    assert_memory_equal(got, bytes + sizeof ahead.bytes, 40);
    assert_int_equal(ahead_port_has_bytes(&ahead), 0);
    assert_int_equal(take(&client, sizeof got), 0);
    assert_int_equal(reads, 2);
}
