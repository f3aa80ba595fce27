/* The examples of the client's and the sniffer's classes, compiled as the IDE would, on
 * simulated boards against real libmodbus servers. */
#include "sketch.h"
#include "test.h"

/* Two meters on one wire. A meter that is not `there` sends no reply. */
typedef struct meters {
    server all[2];
    int there[2];
} meters;

static void shared(wire *w, const uint8_t *frame, size_t length)
{
    meters *m = w->context;

    if (frame[0] < 1 || frame[0] > 2 || !m->there[frame[0] - 1])
        return;
    w->context = &m->all[frame[0] - 1];
    peer_libmodbus(w, frame, length);
    w->context = m;
}

static void energy_meter_client(const kind *k)
{
    board *b = kind_start(k, "EnergyMeterClient");
    printed_text printed = {""};
    pin_rhythm r = {0, 0, 0};
    meters m = {.there = {1, 1}};

    for (int i = 0; i < 2; i++) {
        server_start(&m.all[i], i + 1);
        set_input_float(&m.all[i], 0, 230.5f);
        set_input_float(&m.all[i], 6, 2.25f);
        set_input_float(&m.all[i], 12, 400.0f + 100.0f * (float)i);
    }
    board_watch_pin(b, k->led.port, k->led.bit, measure_rhythm, &r);
    board_uart(b, k->bus, shared, &m);
    if (k->bus != '0')
        board_uart(b, '0', collect_text, &printed);
    assert_true(board_run(b, 900 * MS));
    assert_true(is_high(b, k->pin4)); /* 900 W */
    if (k->bus != '0')
        assert_string_equal(printed.text,
                            "1: 230.50 V 2.25 A 400.00 W\r\n2: 230.50 V 2.25 A 500.00 W\r\n");
    set_input_float(&m.all[1], 12, 600.1f);
    assert_true(board_run(b, 600 * MS));
    assert_false(is_high(b, k->pin4));
    /* A silent meter delays neither the other meter nor the LED. */
    m.there[0] = 0;
    set_input_float(&m.all[1], 12, 100.0f);
    assert_true(board_run(b, 2500 * MS));
    assert_true(is_high(b, k->pin4));
    assert_true(r.switches > 70);
    /* 50 ms, the 8 bytes of a request at 9600 baud, which the core's flush waits for, and
     * a line of text that is longer than the core's buffer. */
    assert_true(r.longest < (k->bus == '0' ? 62u : 85u) * MS);
    server_stop(&m.all[0]);
    server_stop(&m.all[1]);
    board_free(b);
}

TEST(two_meters_are_read_without_waiting)
{
    energy_meter_client(&uno);
    energy_meter_client(&mega);
}

static void data_logger(const kind *k)
{
    board *b = kind_start(k, "DataLogger");
    uint16_t entries = board_symbol(b, "entries");
    printed_text printed = {""};
    server s;
    wire *bus;

    server_start(&s, 1);
    s.mapping->tab_input_registers[2] = 1000;
    bus = board_uart(b, k->bus, peer_libmodbus, &s);
    if (k->bus != '0')
        board_uart(b, '0', collect_text, &printed);
    assert_true(board_run(b, 1050 * MS));
    assert_in_range(bus->frames, 9, 10);
    assert_int_equal(board_word(b, entries), 1); /* second */
    assert_int_equal(board_word(b, (uint16_t)(entries + 4)), 1000);
    assert_in_range(board_byte(b, (uint16_t)(entries + 6)), 9, 10);
    assert_false(is_high(b, k->led));
    s.mapping->tab_input_registers[2] = 2000;
    assert_true(board_run(b, 1000 * MS));
    assert_true(is_high(b, k->led)); /* above the mean of both */
    assert_int_equal(board_word(b, (uint16_t)(entries + 7)), 2);
    assert_in_range(board_word(b, (uint16_t)(entries + 11)), 1900, 2000);
    if (k->bus != '0')
        assert_int_equal(strncmp(printed.text, "1,1000,", 7), 0);
    server_stop(&s);
    board_free(b);
}

TEST(a_logger_stores_a_mean_each_second)
{
    data_logger(&uno);
    data_logger(&mega);
}

TEST(a_logger_counts_what_failed_and_keeps_its_time)
{
    board *b = kind_start(&mega, "DataLogger");
    printed_text printed = {""};

    board_uart(b, mega.bus, NULL, NULL);
    board_uart(b, '0', collect_text, &printed);
    assert_true(board_run(b, 3050 * MS));
    /* Of 80 ms and the quiet time after it: every other request. */
    assert_non_null(strstr(printed.text, "1,0,0,"));
    assert_non_null(strstr(printed.text, "\n2,0,0,"));
    assert_non_null(strstr(printed.text, "\n3,0,0,"));
    assert_null(strstr(printed.text, ",0\r\n"));
    board_free(b);
}

/* A reply that the sniffer is to receive, some time after its request. */
TEST(sniffer_prints_a_request_and_its_reply)
{
    static const uint8_t request[] = {17, 3, 0, 107, 0, 3, 0x76, 0x87};
    static const uint8_t reply[] = {17, 3, 6, 2, 43, 0, 0, 0, 100, 0xC8, 0xBA};
    board *b = kind_start(&mega, "Sniffer");
    printed_text printed = {""};
    unsigned time, took;
    wire *bus;
    char *line;

    bus = board_uart(b, mega.bus, NULL, NULL);
    board_uart(b, '0', collect_text, &printed);
    assert_true(board_run(b, 50 * MS));
    wire_play(bus, 0, request, sizeof request);
    wire_play(bus, 8 * MS, reply, sizeof reply);
    assert_true(board_run(b, 60 * MS));
    assert_int_equal(
        sscanf(printed.text, "%u ms unit 17 request 03 read holding registers 107..109", &time), 1);
    line = strchr(printed.text, '\n');
    assert_non_null(line);
    assert_int_equal(sscanf(line + 1,
                            "%u ms unit 17 reply 03 read holding registers 107..109: 555 0 100 "
                            "(%u ms)",
                            &time, &took),
                     2);
    /* 8 ms, and 11 bytes of 9600 baud. */
    assert_in_range(took, 17, 22);
    assert_false(is_high(b, mega.led));
    /* No device replies: the sketch switches the LED on. */
    wire_play(bus, 0, request, sizeof request);
    assert_true(board_run(b, 1100 * MS));
    assert_non_null(strstr(printed.text, " unit 17 no reply 03 read holding registers 107..109"));
    assert_true(is_high(b, mega.led));
    assert_int_equal(bus->frames, 0); /* nothing was sent */
    board_free(b);
}
