/* The examples of ModbusMaster 2.0.1 and those of its manual for 0.9, as they are, on simulated
 * boards against a real libmodbus server. They are not part of this repository:
 * `make firmware-test-upstream` compiles them from a folder. */
#include "crc.h"
#include "kind.h"
#include "peer.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

static const kind *const boards[] = {&uno, &mega, &atmega1284p};
enum { BOARDS = COUNT(boards), ROUND = 13, EVERYTHING = 30000 };

/* A server that has every address which the examples use, and what the board sent. */
typedef struct device {
    server peer;
    uint8_t functions[ROUND], quantities[ROUND];
    unsigned count; /* requests so far */
    char text[500]; /* sent bytes that are no frame */
    int driver;     /* the pin that switches the line's driver */
    unsigned driven;
} device;

static void device_start(device *d, int unit)
{
    memset(d, 0, sizeof *d);
    server_start(&d->peer, unit);
    /* The server's thread looks at it with the first request. */
    modbus_mapping_free(d->peer.mapping);
    d->peer.mapping = modbus_mapping_new(EVERYTHING, EVERYTHING, EVERYTHING, EVERYTHING);
    assert_non_null(d->peer.mapping);
    for (unsigned i = 0; i < EVERYTHING; i++)
        d->peer.mapping->tab_registers[i] = server_pattern(i);
}

/* Refuses 66 registers, as the controller does that the example is for. */
static void refuse(wire *w, const uint8_t *frame)
{
    uint8_t reply[5] = {frame[0], (uint8_t)(frame[1] | 0x80), 2};

    wire_play(w, MS, reply, seal(reply, 3));
}

static void hear(wire *w, const uint8_t *frame, size_t length)
{
    device *d = w->context;
    size_t have = strlen(d->text);

    if (length < 4 || crc16(frame, length) != 0) {
        if (have + length < sizeof d->text)
            memcpy(d->text + have, frame, length);
        return;
    }
    if (d->count < ROUND) {
        d->functions[d->count] = frame[1];
        d->quantities[d->count] = frame[5];
    }
    d->count++;
    d->driven += !d->driver;
    if (frame[1] == 3 && frame[5] == 66) {
        refuse(w, frame);
        return;
    }
    w->context = &d->peer;
    peer_libmodbus(w, frame, length);
    w->context = d;
}

static void basic(const kind *k, const char *sketch)
{
    board *b = kind_start(k, sketch);
    device d;
    unsigned rounds;

    device_start(&d, 2);
    board_uart(b, '0', hear, &d);
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
    static const uint8_t functions[ROUND] = {0x17, 6, 6, 16, 1, 3, 3, 3, 3, 3, 3, 3, 4};
    static const uint8_t quantities[ROUND] = {4, 1, 0, 2, 17, 66, 64, 8, 64, 64, 64, 64, 8};
    board *b = kind_start(k, sketch);
    device d;

    device_start(&d, 1);
    board_uart(b, '0', hear, &d);
    while (d.count < ROUND)
        assert_true(board_run(b, MS));
    for (unsigned i = 0; i < ROUND; i++) {
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
    device *d = context;

    (void)cycle;
    d->driver = level;
}

static void half_duplex(const kind *k, const char *sketch)
{
    board *b = kind_start(k, sketch);
    device d;

    device_start(&d, 1);
    d.peer.mapping->tab_input_registers[0x3104] = 1345;
    board_watch_pin(b, k->pin2.port, k->pin2.bit, driver_switched, &d);
    board_uart(b, '0', hear, &d);
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

static void basic_of_2_0_1_counts_in_the_server(void **state)
{
    (void)state;
    for (unsigned i = 0; i < BOARDS; i++)
        basic(boards[i], "upstream-basic-2");
}

static void basic_of_0_9_counts_in_the_server(void **state)
{
    (void)state;
    for (unsigned i = 0; i < BOARDS; i++)
        basic(boards[i], "upstream-basic-09");
}

static void phoenix_contact_of_2_0_1_makes_its_calls(void **state)
{
    (void)state;
    for (unsigned i = 0; i < BOARDS; i++)
        phoenix_contact(boards[i], "upstream-phoenix-2");
}

static void phoenix_contact_of_0_9_makes_its_calls(void **state)
{
    (void)state;
    for (unsigned i = 0; i < BOARDS; i++)
        phoenix_contact(boards[i], "upstream-phoenix-09");
}

static void half_duplex_of_2_0_1_switches_its_driver(void **state)
{
    (void)state;
    for (unsigned i = 0; i < BOARDS; i++)
        half_duplex(boards[i], "upstream-halfduplex-2");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(basic_of_2_0_1_counts_in_the_server),
        cmocka_unit_test(phoenix_contact_of_2_0_1_makes_its_calls),
        cmocka_unit_test(half_duplex_of_2_0_1_switches_its_driver),
        cmocka_unit_test(basic_of_0_9_counts_in_the_server),
        cmocka_unit_test(phoenix_contact_of_0_9_makes_its_calls),
    };

    return cmocka_run_group_tests_name("examples of ModbusMaster", tests, NULL, NULL);
}
