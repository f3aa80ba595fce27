/* The examples and a few more sketches, compiled as the IDE does, on simulated boards with
 * a libmodbus server. */
#include "sketch.h"
#include "test.h"

#include <stdio.h>

/* --- the examples, each on both boards */

static void first_read(const kind *k)
{
    board *b = kind_start(k, "FirstRead");
    printed_text printed = {""};
    char expected[100];
    server s;

    server_start(&s, 1);
    board_uart(b, k->bus, peer_libmodbus, &s);
    if (k->bus != '0')
        board_uart(b, '0', collect_text, &printed);
    assert_true(board_run(b, 400 * MS));
    assert_true(is_high(b, k->led));
    if (k->bus != '0') {
        snprintf(expected, sizeof expected, "%u %u %u %u %u %u \r\n", server_pattern(2),
                 server_pattern(3), server_pattern(4), server_pattern(5), server_pattern(6),
                 server_pattern(7));
        assert_string_equal(printed.text, expected);
    }
    server_stop(&s);
    board_free(b);
}

TEST(first_read_reads_what_the_server_holds)
{
    first_read(&uno);
    first_read(&mega);
}

TEST(first_read_prints_that_there_is_no_answer)
{
    board *b = kind_start(&mega, "FirstRead");
    printed_text printed = {""};
    wire *bus;

    bus = board_uart(b, mega.bus, NULL, NULL);
    board_uart(b, '0', collect_text, &printed);
    assert_true(board_run(b, 2500 * MS));
    assert_int_equal(bus->frames, 1);
    assert_false(is_high(b, mega.led));
    assert_string_equal(printed.text, "no complete reply in time\r\n");
    board_free(b);
}

static void write_and_read_back(const kind *k)
{
    board *b = kind_start(k, "WriteAndReadBack");
    server s;

    server_start(&s, 1);
    board_uart(b, k->bus, peer_libmodbus, &s);
    assert_true(board_run(b, 700 * MS));
    assert_true(is_high(b, k->led));
    assert_int_equal(s.mapping->tab_registers[9], server_pattern(9));
    assert_int_equal(s.mapping->tab_registers[10], 1010); /* written in the second round */
    assert_int_equal(s.mapping->tab_registers[12], 1012);
    assert_int_equal(s.mapping->tab_registers[13], server_pattern(13));
    assert_int_equal(s.mapping->tab_bits[19], server_bit_pattern(19));
    for (unsigned i = 0; i < 11; i++)
        assert_int_equal(s.mapping->tab_bits[20 + i], 1010 >> i & 1);
    assert_int_equal(s.mapping->tab_bits[31], 1);
    server_stop(&s);
    board_free(b);
}

TEST(write_and_read_back_writes_to_the_server)
{
    write_and_read_back(&uno);
    write_and_read_back(&mega);
}

TEST(the_largest_chips_with_the_unos_instructions_read_and_write)
{
    static const kind *const chips[] = {&older_mega, &atmega644p, &atmega1284p};

    for (unsigned i = 0; i < sizeof chips / sizeof chips[0]; i++) {
        first_read(chips[i]);
        write_and_read_back(chips[i]);
    }
}

TEST(chips_with_one_uart_have_the_bus_on_it)
{
    first_read(&atmega328);
    first_read(&atmega644);
}

/* The driver-enable pin, and the server after it. */
typedef struct driver {
    server peer;
    uint64_t rose, fell;
    unsigned requests;
    int level;
} driver;

static void driver_switched(void *context, int level, uint64_t cycle)
{
    driver *d = context;

    *(level ? &d->rose : &d->fell) = cycle;
    d->level = level;
}

static void request_after_driver(wire *w, const uint8_t *frame, size_t length)
{
    driver *d = w->context;
    uint64_t last_bit = w->last_started + 10 * w->bit;
    uint64_t wire_time = w->first_started + length * 10 * w->bit;

    assert_int_equal(d->level, 0);
    assert_true(d->rose < w->first_started);
    assert_true(d->fell >= last_bit && d->fell >= wire_time);
    /* Off again well within the 3.5 characters for which a slave stays silent. */
    assert_true(d->fell - last_bit < 10 * w->bit);
    d->requests++;
    w->context = &d->peer;
    peer_libmodbus(w, frame, length);
    w->context = d;
}

static void half_duplex(const kind *k)
{
    board *b = kind_start(k, "HalfDuplex");
    driver d = {.rose = 0};

    server_start(&d.peer, 1);
    board_watch_pin(b, k->pin2.port, k->pin2.bit, driver_switched, &d);
    board_uart(b, k->bus, request_after_driver, &d);
    assert_true(board_run(b, 500 * MS));
    assert_true(is_high(b, k->led));
    assert_true(d.requests >= 4);
    assert_int_equal(d.peer.mapping->tab_registers[30], (uint16_t)~server_pattern(0));
    server_stop(&d.peer);
    board_free(b);
}

TEST(the_driver_is_on_from_the_first_to_the_last_bit)
{
    half_duplex(&uno);
    half_duplex(&mega);
}

/* Three servers share a wire. Each receives the requests to its own unit. */
static void shared(wire *w, const uint8_t *frame, size_t length)
{
    server *all = w->context;

    if (frame[0] < 1 || frame[0] > 3)
        return;
    w->context = &all[frame[0] - 1];
    peer_libmodbus(w, frame, length);
    w->context = all;
}

static void several_slaves(const kind *k)
{
    board *b = kind_start(k, "SeveralSlaves");
    server all[3];
    uint16_t i;

    for (i = 0; i < 3; i++) {
        server_start(&all[i], i + 1);
        all[i].mapping->tab_registers[5] = (uint16_t)(0x1111 * (i + 1));
    }
    board_uart(b, k->bus, shared, all);
    assert_true(board_run(b, 300 * MS));
    assert_true(is_high(b, k->led));
    for (i = 0; i < 3; i++)
        assert_int_equal(all[i].mapping->tab_registers[6], 0x1111 * (i + 1));
    for (i = 0; i < 3; i++)
        server_stop(&all[i]);
    board_free(b);
}

TEST(several_slaves_answer_by_their_units)
{
    several_slaves(&uno);
    several_slaves(&mega);
}

static void non_blocking(const kind *k, int answers)
{
    board *b = kind_start(k, "NonBlocking");
    pin_rhythm r = {0, 0, 0};
    server s;
    wire *bus;

    server_start(&s, 1);
    board_watch_pin(b, k->led.port, k->led.bit, measure_rhythm, &r);
    bus = board_uart(b, k->bus, answers ? peer_libmodbus : NULL, &s);
    assert_true(board_run(b, 1500 * MS));
    assert_true(r.switches >= 28);
    /* 50 ms, and the time of a request of 13 bytes at 19200 baud, since the core's flush,
     * which the class calls, waits for the last bit. */
    assert_true(r.longest < 58 * MS);
    if (answers) {
        assert_true(bus->frames > 20);
        assert_int_equal(s.mapping->tab_registers[40], server_pattern(3));
        assert_true(s.mapping->tab_registers[41] > 10);
    } else {
        assert_in_range(bus->frames, 2, 4);
    }
    server_stop(&s);
    board_free(b);
}

TEST(without_waiting_the_led_blinks_on)
{
    non_blocking(&uno, 1);
    non_blocking(&uno, 0);
    non_blocking(&mega, 1);
}

/* A meter that is plugged in or not. */
typedef struct meter {
    server s;
    int unplugged;
} meter;

static void answer_if_plugged_in(wire *w, const uint8_t *frame, size_t length)
{
    meter *m = w->context;

    w->context = &m->s;
    if (!m->unplugged)
        peer_libmodbus(w, frame, length);
    w->context = m;
}

static void energy_meter(const kind *k)
{
    board *b = kind_start(k, "EnergyMeter");
    printed_text printed = {""};
    meter m = {0};

    server_start(&m.s, 1);
    set_input_float(&m.s, 0, 230.5f);
    set_input_float(&m.s, 6, 2.25f);
    set_input_float(&m.s, 12, 518.6f);
    if (k->bus == '0') /* Pins 10 and 11 are port B, bits 2 and 3. */
        board_pins(b, 'B', 2, 3, 9600, answer_if_plugged_in, &m);
    else
        board_uart(b, k->bus, answer_if_plugged_in, &m);
    board_uart(b, '0', collect_text, &printed);
    assert_true(board_run(b, 1500 * MS));
    assert_string_equal(printed.text, "unit 1: 230.50 V 2.25 A 518.60 W\r\n");
    memset(printed.text, 0, sizeof printed.text);
    m.unplugged = 1;
    assert_true(board_run(b, 1400 * MS));
    assert_string_equal(printed.text, "unit 1: no complete reply in time\r\n");
    server_stop(&m.s);
    board_free(b);
}

TEST(an_energy_meters_values_or_the_reason_why_not_are_printed)
{
    energy_meter(&uno);
    energy_meter(&mega);
}

TEST(values_pass_between_sketch_and_archive)
{
    board *b = kind_start(&uno, "Values");
    printed_text printed = {""};

    board_uart(b, '0', collect_text, &printed);
    assert_true(board_run(b, 100 * MS));
    assert_string_equal(printed.text, "none\r\n");
    board_free(b);
}

static void basic(const kind *k)
{
    board *b = kind_start(k, "Basic");
    server s;
    wire *bus;
    unsigned rounds;

    server_start(&s, 2);
    bus = board_uart(b, '0', peer_libmodbus, &s);
    assert_true(board_run(b, 700 * MS));
    rounds = bus->frames / 2;
    assert_true(rounds > 10);
    /* Each failed round would have taken two seconds. */
    assert_in_range(s.mapping->tab_registers[0], rounds, rounds + 1);
    assert_int_equal(s.mapping->tab_registers[1], 0);
    server_stop(&s);
    board_free(b);
}

TEST(basic_counts_in_the_server)
{
    basic(&uno);
    basic(&relaxed);
    basic(&mega);
    basic(&relaxed_mega);
}

/* The requests of a round: function and quantity, in order. */
typedef struct coupler {
    server peer;
    uint8_t functions[30], quantities[30], statuses[30];
    unsigned count;
} coupler;

static void couple(wire *w, const uint8_t *frame, size_t length)
{
    coupler *c = w->context;
    size_t from = w->head;

    w->context = &c->peer;
    peer_libmodbus(w, frame, length);
    w->context = c;
    if (c->count == 30)
        return;
    c->functions[c->count] = frame[1];
    c->quantities[c->count] = frame[5];
    c->statuses[c->count++] =
        w->queue[(from + 1) % QUEUE] & 0x80 ? w->queue[(from + 2) % QUEUE] : 0;
}

static void phoenix_contact(const kind *k)
{
    static const uint8_t functions[11] = {0x17, 6, 6, 3, 16, 1, 3, 3, 3, 3, 3};
    static const uint8_t quantities[11] = {2, 0, 1, 2, 2, 17, 66, 64, 8, 64, 8};
    board *b = kind_start(k, "PhoenixContact");
    coupler c = {.count = 0};
    unsigned i;

    server_start(&c.peer, 1);
    /* Like the device that refuses 66 registers and accepts 64. */
    c.peer.mapping->nb_registers = 65;
    board_uart(b, '0', couple, &c);
    /* Not to the next round, which writes the same registers. */
    for (i = 0; i < 700 && c.count < 11; i++)
        assert_true(board_run(b, MS));
    assert_int_equal(c.count, 11);
    for (i = 0; i < 11; i++) {
        assert_int_equal(c.functions[i], functions[i]);
        assert_int_equal(c.quantities[i], quantities[i]);
    }
    assert_int_equal(c.statuses[0], 0);
    assert_int_equal(c.statuses[1], 2); /* register 2006 does not exist */
    assert_int_equal(c.statuses[5], 0);
    assert_int_equal(c.statuses[6], 2); /* the read of 66 */
    assert_int_equal(c.statuses[7], 0); /* the read of 64 */
    assert_int_equal(c.statuses[9], 2); /* the read of 8 to 71 */
    assert_int_equal(c.peer.mapping->tab_registers[4], server_pattern(8));
    assert_int_equal(c.peer.mapping->tab_registers[5], server_pattern(9));
    server_stop(&c.peer);
    board_free(b);
}

TEST(phoenix_contact_makes_its_requests)
{
    phoenix_contact(&uno);
    phoenix_contact(&relaxed);
    phoenix_contact(&mega);
    phoenix_contact(&relaxed_mega);
}

/* --- sketches that are no examples */

/* The silences on a wire before the requests of a sketch, and t3.5 at its rate then. */
typedef struct silences {
    uint64_t kept[32], wanted[32]; /* cycles */
    unsigned count;
} silences;

/* The program notices the last byte and the end of a silence this many cycles later at most. */
enum { LATER = 250 * MHZ };

/* 3.5 characters of 11 bits, at least 1750 us. */
static uint64_t silence_of_rate(const wire *w)
{
    const uint64_t silence = w->bit * 77 / 2, least = 1750 * MHZ;

    return silence > least ? silence : least;
}

static void note_silence(wire *w, const uint8_t *frame, size_t length)
{
    silences *s = w->context;

    assert_in_range(s->count, 0, COUNT(s->kept) - 1);
    s->wanted[s->count] = silence_of_rate(w);
    s->kept[s->count++] = w->first_started - w->received;
    peer_right(w, frame, length);
}

static void run_to_its_end(board *b)
{
    assert_true(board_run_until(b, board_symbol(b, "done"), 1, 8000 * MS));
    assert_int_equal(board_byte(b, board_symbol(b, "failed")), 0);
}

static void rates(const kind *k)
{
    board *b = kind_start(k, "Rates");
    silences s = {.count = 0};

    board_uart(b, k->bus, note_silence, &s);
    run_to_its_end(b);
    assert_int_equal(s.count, 28);
    /* Nothing was received before the first request. */
    for (unsigned i = 1; i < s.count; i++)
        assert_in_range(s.kept[i], s.wanted[i], s.wanted[i] * 26 / 25 + LATER);
    board_free(b);
}

TEST(a_uart_of_an_avr_keeps_t3_5_of_its_rate_without_being_told)
{
    rates(&uno);
    rates(&mega);
}

static void assert_silences(const silences *s, const unsigned *microseconds, unsigned count)
{
    assert_int_equal(s->count, count);
    for (unsigned i = 1; i < count; i++)
        if (microseconds[i] > 0)
            assert_in_range(s->kept[i], microseconds[i] * MHZ, microseconds[i] * MHZ + LATER);
}

static void silences_of(const kind *k, const unsigned *uart, unsigned count)
{
    static const unsigned pins[] = {0, 4000};
    board *b = kind_start(k, "Silences");
    silences on_uart = {.count = 0}, on_pins = {.count = 0};

    board_uart(b, '0', note_silence, &on_uart);
    /* Pins 10 and 11 are port B, bits 2 and 3 of an Uno, bits 4 and 5 of a Mega. */
    board_pins(b, 'B', k == &uno ? 2 : 4, k == &uno ? 3 : 5, 19200, note_silence, &on_pins);
    run_to_its_end(b);
    assert_silences(&on_uart, uart, count);
    assert_silences(&on_pins, pins, COUNT(pins));
    board_free(b);
}

TEST(the_silence_is_that_of_the_port_unless_the_sketch_has_set_it)
{
    /* The third request comes after those over the pins. On an Uno the objects share a line, so
     * setGap of one object holds for all. */
    static const unsigned on_uno[] = {0, 1750, 0, 1750, 1750, 4000, 1750, 9000, 9000, 9000, 4010};
    static const unsigned on_mega[] = {0, 1750, 0, 1750, 1750, 4000, 1750, 9000, 9000, 1750, 4010};

    silences_of(&uno, on_uno, COUNT(on_uno));
    silences_of(&mega, on_mega, COUNT(on_mega));
}

TEST(a_bus_on_two_pins_works)
{
    board *b = kind_start(&uno, "Soft");
    uint16_t report = board_symbol(b, "report");
    unsigned i;
    server s;

    server_start(&s, 1);
    /* Pins 10 and 11 are port B, bits 2 and 3. */
    board_pins(b, 'B', 2, 3, 9600, peer_libmodbus, &s);
    assert_true(board_run_until(b, report, 1, 1000 * MS));
    for (i = 0; i < 3; i++)
        assert_int_equal(board_byte(b, (uint16_t)(report + 1 + i)), 0);
    for (i = 0; i < 6; i++) {
        assert_int_equal(board_word(b, (uint16_t)(report + 4 + 2 * i)), server_pattern(2 + i));
        assert_int_equal(s.mapping->tab_registers[20 + i], (uint16_t)~server_pattern(2 + i));
    }
    assert_int_equal(s.mapping->tab_bits[3], 1);
    server_stop(&s);
    board_free(b);
}

TEST(two_ports_are_polled_at_once)
{
    board *b = kind_start(&mega, "TwoPorts");
    uint16_t report = board_symbol(b, "report");
    server left, right;

    server_start(&left, 1);
    server_start(&right, 2);
    board_uart(b, '1', peer_libmodbus, &left);
    board_uart(b, '2', peer_libmodbus, &right);
    assert_true(board_run_until(b, report, 1, 2000 * MS));
    assert_int_equal(board_byte(b, (uint16_t)(report + 3)), 0);
    assert_int_equal(board_byte(b, (uint16_t)(report + 4)), 0);
    assert_int_equal(board_word(b, (uint16_t)(report + 5)), server_pattern(7));
    assert_int_equal(board_word(b, (uint16_t)(report + 7)), server_pattern(8));
    /* Ten requests of 10 ms each, with more than one poll in a millisecond. */
    assert_true(board_word(b, (uint16_t)(report + 9)) > 50);
    server_stop(&left);
    server_stop(&right);
    board_free(b);
}

/* The request takes 8 characters of 0.52 ms; the timeout begins with its last bit. */
TEST(a_call_without_reply_takes_the_timeout_and_what_is_left_of_the_quiet_time)
{
    static const unsigned left[] = {0, 0, 50, 100};
    board *b = kind_start(&uno, "NoReply");
    uint16_t report = board_symbol(b, "report");
    wire *bus = board_uart(b, '0', NULL, NULL);
    unsigned i;

    assert_true(board_run_until(b, report, 1, 2000 * MS));
    assert_int_equal(bus->frames, 4);
    for (i = 0; i < 4; i++) {
        unsigned took = board_word(b, (uint16_t)(report + 5 + 2 * i));
        assert_int_equal(board_byte(b, (uint16_t)(report + 1 + i)), 0xE2);
        assert_in_range(took, left[i] + 200 + 4, left[i] + 200 + 6);
    }
    board_free(b);
}

TEST(calls_of_version_0_9_work_on_a_second_port)
{
    board *b = kind_start(&mega, "OlderCalls");
    uint16_t report = board_symbol(b, "report");
    unsigned i;
    server s;

    server_start(&s, 2);
    board_uart(b, '1', peer_libmodbus, &s);
    assert_true(board_run_until(b, report, 1, 2000 * MS));
    assert_int_equal(board_byte(b, (uint16_t)(report + 1)), 0);
    assert_int_equal(board_byte(b, (uint16_t)(report + 2)), 0);
    assert_int_equal(board_byte(b, (uint16_t)(report + 3)), 3);
    for (i = 0; i < 3; i++)
        assert_int_equal(board_word(b, (uint16_t)(report + 4 + 2 * i)), server_pattern(40 + i));
    assert_int_equal(s.mapping->tab_registers[30], 0x1234);
    assert_int_equal(s.mapping->tab_registers[31], 0xBEEF); /* the low word first */
    assert_int_equal(s.mapping->tab_registers[32], 0xDEAD);
    for (i = 0; i < 5; i++)
        assert_int_equal(s.mapping->tab_bits[50 + i], i % 2 == 0);
    server_stop(&s);
    board_free(b);
}

/* --- the ports of the classes in the test kit for ports, on a Mega whose TX1 is wired to its RX1:
 * the bytes take their time, and the driver's pin is read back --- */

enum { LONGEST = 60000 /* ms */ };

TEST(the_ports_of_the_classes_pass)
{
    static printed_text printed;
    board *b = kind_start(&mega, "TestPorts");
    uint16_t ended = board_symbol(b, "ended");

    board_uart(b, '0', collect_text, &printed);
    board_loop(b, '1');
    for (unsigned ms = 0; ms < LONGEST && board_byte(b, ended) == 0; ms += 500)
        assert_true(board_run(b, 500ull * MS));
    /* print_message cuts a text of more than 1024 characters, and its last line with it. */
    puts(printed.text);
    assert_int_equal(board_byte(b, ended), 1);
    board_free(b);
}
