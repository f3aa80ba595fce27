/* The example custom_command, driven by scripts. */
#include "program.h"
#include "test.h"

#include <string.h>
#include <unistd.h>

static char output[8192];

/* Runs a script. Keeps what the example prints, and returns its exit code. */
static int run(const char *script)
{
    const char *const none[] = {NULL};
    program p;

    program_start(&p, "linux/custom_command", none);
    assert_int_equal(write(p.input, script, strlen(script)), strlen(script));
    close(p.input);
    p.input = -1;
    program_rest(&p, output, sizeof output);
    return program_end(&p);
}

static void written_registers_are_read_back(void **state)
{
    (void)state;
    assert_int_equal(run("# three of ten\n"
                         "write 2 1 65535 0x1234\n"
                         "\n"
                         "  read 1 5\n"),
                     0);
    assert_string_equal(output, "wrote 3 from register 2 on\n"
                                "register 1: 0\nregister 2: 1\nregister 3: 65535\n"
                                "register 4: 4660\nregister 5: 0\n");
}

static void all_ten_registers_exist(void **state)
{
    (void)state;
    assert_int_equal(run("write 0 10 11 12 13 14 15 16 17 18 19\nread 9 1\nread 0 10\n"), 0);
    assert_non_null(
        strstr(output, "wrote 10 from register 0 on\nregister 9: 19\nregister 0: 10\n"));
}

static void out_of_range_a_read_returns_02_and_a_write_04(void **state)
{
    (void)state;
    assert_int_equal(run("read 9 2\n"), 1);
    assert_string_equal(output, "read: exception 02: illegal data address\n");
    assert_int_equal(run("write 9 1 2\n"), 1);
    assert_string_equal(output, "write: exception 04: slave device failure\n");
    assert_int_equal(run("read 65535 2\nread 0 0\nread 9 1\n"), 1);
    assert_string_equal(output, "read: exception 02: illegal data address\n"
                                "read: exception 03: illegal data value\n"
                                "register 9: 0\n");
}

static void wrong_byte_counts_return_03_and_change_nothing(void **state)
{
    (void)state;
    assert_int_equal(run("raw 42 00 00 00 01 03 00 01 02\n"
                         "raw 42 00 00 00 02 02 00 01\n"
                         "raw 42 00 00 00 01 02 00\n"
                         "raw 42 00 00 00 00 00\n"
                         "raw 41 00 00 00\n"
                         "raw 41\n"
                         "read 0 2\n"),
                     1);
    assert_string_equal(output, "raw: exception 03: illegal data value\n"
                                "raw: exception 03: illegal data value\n"
                                "raw: exception 03: illegal data value\n"
                                "raw: exception 03: illegal data value\n"
                                "raw: exception 03: illegal data value\n"
                                "raw: exception 03: illegal data value\n"
                                "register 0: 0\nregister 1: 0\n");
}

static void the_frames_are_those_of_the_two_functions(void **state)
{
    (void)state;
    assert_int_equal(run("raw 42 00 03 00 02 04 12 34 AB CD\nraw 41 00 03 00 02\n"), 0);
    assert_string_equal(output, "response: 00 03 00 02\nresponse: 00 03 04 12 34 AB CD\n");
    assert_int_equal(run("raw 43 01\nraw 3 0 0 0 1\n"), 1);
    assert_string_equal(output, "raw: exception 01: illegal function\n"
                                "raw: exception 01: illegal function\n");
}

static void unknown_commands_are_reported_and_skipped(void **state)
{
    (void)state;
    assert_int_equal(run("dance\nread 1\nread 1 2 3\nwrite 1\nwrite 1 65536\nread -1 1\nraw\n"
                         "raw 80\nraw 41 100\nread x 1\nread 0 1"),
                     1);
    assert_string_equal(output, "dance: not understood\nread: not understood\n"
                                "read: not understood\nwrite: not understood\n"
                                "write: not understood\nread: not understood\n"
                                "raw: not understood\nraw: not understood\n"
                                "raw: not understood\nread: not understood\n"
                                "register 0: 0\n");
    assert_int_equal(run(""), 0);
    assert_string_equal(output, "");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(written_registers_are_read_back),
        cmocka_unit_test(all_ten_registers_exist),
        cmocka_unit_test(out_of_range_a_read_returns_02_and_a_write_04),
        cmocka_unit_test(wrong_byte_counts_return_03_and_change_nothing),
        cmocka_unit_test(the_frames_are_those_of_the_two_functions),
        cmocka_unit_test(unknown_commands_are_reported_and_skipped),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
