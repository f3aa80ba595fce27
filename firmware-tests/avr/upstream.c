/* The examples of ModbusMaster 2.0.1 and those of its manual for 0.9, as they are, on simulated
 * boards against a real libmodbus server. They are not part of this repository:
 * `make test-firmware-upstream` compiles them from a folder. */
#include "sketch.h"
#include "test.h"
#include "upstream_device.h"

static const kind *const boards[] = {&uno, &mega, &atmega1284p};
enum { BOARDS = COUNT(boards) };

static void basic(const kind *k, const char *sketch)
{
    board *b = kind_start(k, sketch);
    upstream_device d;
    unsigned rounds;

    upstream_device_start(&d, 2);
    board_uart(b, '0', upstream_hear, &d);
    assert_true(board_run(b, 700 * MS));
    rounds = d.count / 2;
    /* Any round that failed would have taken two seconds. */
    assert_true(rounds > 10);
    for (unsigned i = 0; i < 10; i++)
        assert_int_equal(d.functions[i], i % 2 ? 3 : 16);
    assert_in_range(d.peer.mapping->tab_registers[0], rounds, rounds + 1);
    assert_int_equal(d.peer.mapping->tab_registers[1], 0);
    server_stop(&d.peer);
    board_free(b);
}

static void phoenix_contact(const kind *k, const char *sketch)
{
    static const uint8_t functions[UPSTREAM_ROUND] = {0x17, 6, 6, 16, 1, 3, 3, 3, 3, 3, 3, 3, 4};
    static const uint8_t quantities[UPSTREAM_ROUND] = {4, 1,  0,  2,  17, 66, 64,
                                                       8, 64, 64, 64, 64, 8};
    board *b = kind_start(k, sketch);
    upstream_device d;

    upstream_device_start(&d, 1);
    board_uart(b, '0', upstream_hear, &d);
    while (d.count < UPSTREAM_ROUND)
        assert_true(board_run(b, MS));
    for (unsigned i = 0; i < UPSTREAM_ROUND; i++) {
        assert_int_equal(d.functions[i], functions[i]);
        assert_int_equal(d.quantities[i], quantities[i]);
    }
    /* The shift register and the counter, then the first word of that again. */
    assert_int_equal(d.peer.mapping->tab_registers[2], 1);
    assert_int_equal(d.peer.mapping->tab_registers[3], 0);
    assert_int_equal(d.peer.mapping->tab_registers[4], 1);
    assert_int_equal(d.peer.mapping->tab_registers[6], 1);
    assert_int_equal(d.peer.mapping->tab_registers[8], server_pattern(0));
    assert_int_equal(d.peer.mapping->tab_registers[9], server_pattern(1));
    server_stop(&d.peer);
    board_free(b);
}

static void driver_switched(void *context, int level, uint64_t cycle)
{
    upstream_device *d = context;

    d->driver = level;
}

static void half_duplex(const kind *k, const char *sketch)
{
    board *b = kind_start(k, sketch);
    upstream_device d;

    upstream_device_start(&d, 1);
    board_watch_pin(b, k->pin2.port, k->pin2.bit, driver_switched, &d);
    board_uart(b, '0', upstream_hear, &d);
    assert_true(board_run(b, 500 * MS));
    assert_int_equal(d.count, 2);
    assert_int_equal(d.peer.mapping->tab_bits[2], 1);
    assert_non_null(strstr(d.text, "Vbatt: 13.45\r\n"));
    /* Word 0xC0 is past the end of the buffer. */
    assert_non_null(strstr(d.text, "Vload: 655.35\r\n"));
    assert_true(board_run(b, 1000 * MS));
    assert_int_equal(d.count, 4);
    assert_int_equal(d.peer.mapping->tab_bits[2], 0);
    /* After each request the driver was off. */
    assert_int_equal(d.driven, 4);
    server_stop(&d.peer);
    board_free(b);
}

TEST(basic_of_2_0_1_counts_in_the_server)
{
    for (unsigned i = 0; i < BOARDS; i++)
        basic(boards[i], "upstream-basic-2");
}

TEST(basic_of_0_9_counts_in_the_server)
{
    for (unsigned i = 0; i < BOARDS; i++)
        basic(boards[i], "upstream-basic-09");
}

TEST(phoenix_contact_of_2_0_1_makes_its_calls)
{
    for (unsigned i = 0; i < BOARDS; i++)
        phoenix_contact(boards[i], "upstream-phoenix-2");
}

TEST(phoenix_contact_of_0_9_makes_its_calls)
{
    for (unsigned i = 0; i < BOARDS; i++)
        phoenix_contact(boards[i], "upstream-phoenix-09");
}

TEST(half_duplex_of_2_0_1_switches_its_driver)
{
    for (unsigned i = 0; i < BOARDS; i++)
        half_duplex(boards[i], "upstream-halfduplex-2");
}
