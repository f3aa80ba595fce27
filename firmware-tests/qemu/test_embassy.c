/* The firmware on embassy, examples/rust/embassy, on QEMU's board mps2-an500, against libmodbus. */
#include "machine.h"
#include "server.h"
#include "test.h"

#include <unistd.h>

enum { UNIT = 17, ROUNDS = 60 };

static server peer;
static run done;

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

int main(void)
{
    const struct CMUnitTest master[] = {
        cmocka_unit_test(the_firmware_ends_without_an_error),
        cmocka_unit_test(two_tasks_share_a_line),
        cmocka_unit_test(a_request_after_one_that_was_given_up_is_answered),
    };
    const struct CMUnitTest client[] = {
        cmocka_unit_test(the_firmware_ends_without_an_error),
        cmocka_unit_test(a_client_polls_futures_and_sleeps_in_between),
    };
    int failed;

    /* In case all other time limits fail: ends this program, and QEMU with it. */
    alarm(300);
    failed = cmocka_run_group_tests_name("a master on embassy", master, run_master, stop_server);
    failed += cmocka_run_group_tests_name("a client on embassy", client, run_client, stop_server);
    return failed;
}
