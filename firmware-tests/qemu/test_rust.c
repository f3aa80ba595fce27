/* The firmware in Rust, examples/rust, and that on embassy, examples/rust/embassy, on QEMU's board
 * mps2-an500, against libmodbus. */
#define _GNU_SOURCE
#include "machine.h"
#include "server.h"
#include "test.h"

#include <errno.h>
#include <modbus.h>
#include <unistd.h>

enum { UNIT = 17, ROUNDS = 60 };

static server peer;
static run done;

/* The server on embassy, and the client of libmodbus that reads it. */
static running serving;
static pty served;
static modbus_t *reader;

static const machine *board(void)
{
    const machine *m = machines;

    while (strcmp(m->name, "mps2-an500") != 0)
        m++;
    return m;
}

/* Runs a program that sends requests, beside a server of libmodbus. */
static void run_with_server(const char *image)
{
    running firmware;

    server_start(&peer, UNIT);
    firmware = machine_start(board(), image, peer.line.ours);
    done = machine_finish(&firmware, 1);
}

static int run_plain(void **state)
{
    run_with_server("rust");
    return 0;
}

static int run_master(void **state)
{
    run_with_server("embassy-master");
    return 0;
}

static int run_client(void **state)
{
    run_with_server("embassy-client");
    return 0;
}

static int stop_server(void **state)
{
    server_stop(&peer);
    return 0;
}

/* Asserts that the firmware has printed a line. */
static void printed(const char *line)
{
    if (!strstr(done.console, line))
        print_error("%sinstead of %s\n", done.console, line);
    assert_non_null(strstr(done.console, line));
}

static void the_firmware_ends_without_an_error(void **state)
{
    if (!done.ended || done.code != 0)
        print_error("%s", done.console);
    assert_true(done.ended);
    assert_int_equal(done.code, 0);
}

/* Asserts that the firmware has printed the two words with this name. */
static void printed_words(const char *name, unsigned first, unsigned second)
{
    char line[64];

    snprintf(line, sizeof line, "%s: %u %u\n", name, first, second);
    printed(line);
}

static void a_blocking_master_reads_two_registers(void **state)
{
    printed_words("blocking", server_pattern(20), server_pattern(21));
}

static void an_awaited_master_writes_a_register_and_reads_two(void **state)
{
    assert_int_equal(peer.mapping->tab_registers[22], 888);
    printed_words("awaited", 888, server_pattern(23));
}

static void two_tasks_share_a_line(void **state)
{
    printed("of 60: 60 read, 60 written\n");
    assert_int_equal(peer.mapping->tab_registers[30], ROUNDS - 1);
    assert_int_equal(peer.mapping->tab_registers[31], (uint16_t) ~(ROUNDS - 1));
}

static void a_request_after_one_that_was_given_up_is_answered(void **state)
{
    unsigned given_up = 0;
    const char *line = strstr(done.console, "given up: ");

    printed("right after it: 60 of 60\n");
    assert_non_null(line);
    assert_int_equal(sscanf(line, "given up: %u", &given_up), 1);
    /* That to the absent unit, and one that got no time at all. */
    assert_true(given_up >= 2);
}

static void a_client_polls_futures_and_sleeps_in_between(void **state)
{
    char line[64];

    snprintf(line, sizeof line, "polled: %u %u, answered: 100\n", server_pattern(20),
             server_pattern(21));
    printed(line);
    /* It writes every number from 0 on, with one request of two. */
    assert_int_equal(peer.mapping->tab_registers[35], 49);
}

static int start_server(void **state)
{
    pty_open(&served);
    serving = machine_start(board(), "embassy-server", served.ours);
    if (!machine_says(&serving, "serving"))
        return -1;
    reader = modbus_new_rtu(served.path, 115200, 'N', 8, 1);
    if (!reader || modbus_set_slave(reader, UNIT) || modbus_connect(reader) ||
        modbus_set_response_timeout(reader, 60, 0) || modbus_set_byte_timeout(reader, 60, 0))
        return -1;
    return 0;
}

static int stop_client(void **state)
{
    modbus_close(reader);
    modbus_free(reader);
    machine_finish(&serving, 0);
    pty_close(&served);
    return 0;
}

/* Returns the client after a pause. The standard requires t3.5 between a response and the next
 * request, but libmodbus sends at once, and on a pty characters take no time. */
static modbus_t *reader_after_pause(void)
{
    usleep(5000);
    return reader;
}

static void a_server_answers_though_its_future_is_dropped_each_millisecond(void **state)
{
    uint16_t first = 0, words[4], i;

    assert_int_equal(modbus_read_registers(reader_after_pause(), 107, 2, words), 2);
    assert_int_equal(words[0], 555);
    assert_int_equal(words[1], 100);
    assert_int_equal(modbus_read_input_registers(reader_after_pause(), 0, 1, &first), 1);
    for (i = 0; i < 200; i++) {
        assert_int_equal(modbus_write_register(reader_after_pause(), 109, i), 1);
        assert_int_equal(modbus_read_registers(reader_after_pause(), 107, 4, words), 4);
        assert_int_equal(words[0], 555);
        assert_int_equal(words[2], i);
    }
    /* The milliseconds in which the future was dropped. */
    assert_int_equal(modbus_read_input_registers(reader_after_pause(), 0, 1, words), 1);
    assert_int_not_equal(words[0], first);
}

static void a_server_refuses_registers_that_it_does_not_have(void **state)
{
    uint16_t words[2];

    assert_int_equal(modbus_read_registers(reader_after_pause(), 110, 2, words), -1);
    assert_int_equal(errno, EMBXILADD);
    assert_int_equal(modbus_read_registers(reader_after_pause(), 109, 2, words), 2);
}

int main(void)
{
    const struct CMUnitTest plain[] = {
        cmocka_unit_test(the_firmware_ends_without_an_error),
        cmocka_unit_test(a_blocking_master_reads_two_registers),
        cmocka_unit_test(an_awaited_master_writes_a_register_and_reads_two),
    };
    const struct CMUnitTest master[] = {
        cmocka_unit_test(the_firmware_ends_without_an_error),
        cmocka_unit_test(two_tasks_share_a_line),
        cmocka_unit_test(a_request_after_one_that_was_given_up_is_answered),
    };
    const struct CMUnitTest client[] = {
        cmocka_unit_test(the_firmware_ends_without_an_error),
        cmocka_unit_test(a_client_polls_futures_and_sleeps_in_between),
    };
    const struct CMUnitTest serves[] = {
        cmocka_unit_test(a_server_answers_though_its_future_is_dropped_each_millisecond),
        cmocka_unit_test(a_server_refuses_registers_that_it_does_not_have),
    };
    int failed;

    /* In case all other time limits fail: ends this program, and QEMU with it. */
    alarm(300);
    failed = cmocka_run_group_tests_name("firmware in Rust", plain, run_plain, stop_server);
    failed += cmocka_run_group_tests_name("a master on embassy", master, run_master, stop_server);
    failed += cmocka_run_group_tests_name("a client on embassy", client, run_client, stop_server);
    failed += cmocka_run_group_tests_name("a server on embassy", serves, start_server, stop_client);
    return failed;
}
