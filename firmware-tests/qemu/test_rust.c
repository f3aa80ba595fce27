/* The firmware in Rust, examples/rust, on QEMU's board mps2-an500, against a libmodbus server whose
 * memory is checked. */
#include "machine.h"
#include "server.h"
#include "test.h"

#include <unistd.h>

enum { UNIT = 17 };

static server peer;
static run done;

static int run_with_libmodbus(void **state)
{
    const machine *m = machines;
    running firmware;

    while (strcmp(m->name, "mps2-an500") != 0)
        m++;
    server_start(&peer, UNIT);
    firmware = machine_start(m, "rust", peer.line.ours);
    done = machine_finish(&firmware, 1);
    return 0;
}

static int stop(void **state)
{
    server_stop(&peer);
    return 0;
}

/* Asserts that the firmware has printed the two words with this name. */
static void printed(const char *name, unsigned first, unsigned second)
{
    char line[64];

    snprintf(line, sizeof line, "%s: %u %u\n", name, first, second);
    if (!strstr(done.console, line))
        print_error("%sinstead of %s", done.console, line);
    assert_non_null(strstr(done.console, line));
}

static void the_firmware_ends_without_an_error(void **state)
{
    if (!done.ended || done.code != 0)
        print_error("%s", done.console);
    assert_true(done.ended);
    assert_int_equal(done.code, 0);
}

static void a_blocking_master_reads_two_registers(void **state)
{
    printed("blocking", server_pattern(20), server_pattern(21));
}

static void an_awaited_master_writes_a_register_and_reads_two(void **state)
{
    assert_int_equal(peer.mapping->tab_registers[22], 888);
    printed("awaited", 888, server_pattern(23));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_firmware_ends_without_an_error),
        cmocka_unit_test(a_blocking_master_reads_two_registers),
        cmocka_unit_test(an_awaited_master_writes_a_register_and_reads_two),
    };

    /* In case all other time limits fail: ends this program, and QEMU with it. */
    alarm(300);
    return cmocka_run_group_tests_name("firmware in Rust", tests, run_with_libmodbus, stop);
}
