/* The example guarded_server: its demonstration, and libmodbus's clients. */
#define _GNU_SOURCE
#include "await.h"
#include "program.h"
#include "test.h"

#include <errno.h>
#include <modbus.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static char output[4096];

static void the_demonstration_shows_a_refresh_and_each_refusal(void **state)
{
    const char *const none[] = {NULL};
    program p;
    char *rest;

    (void)state;
    program_start(&p, "linux/guarded_server", none);
    program_rest(&p, output, sizeof output);
    assert_int_equal(program_end(&p), 0);
    rest = strchr(output, '\n');
    assert_true(rest != NULL && strncmp(output, "ready ", 6) == 0);
    assert_string_equal(rest, "\n"
                              "  client 1: function 03\n"
                              "  client 1 reads 2 from 0 on\n"
                              "client 1 reads the sensor: success, 201 1\n"
                              "  client 2: function 03\n"
                              "  client 2 reads 2 from 0 on\n"
                              "client 2 reads the sensor: success, 202 2\n"
                              "  client 1: function 10\n"
                              "  client 1 has written 2 from 4 on\n"
                              "client 1 writes: success, 11 22\n"
                              "  client 2: function 10\n"
                              "  client 2: exception 01: illegal function\n"
                              "client 2 writes: exception 01: illegal function\n"
                              "  client 1: function 10\n"
                              "  client 1: exception 02: illegal data address\n"
                              "client 1 writes the sensor: exception 02: illegal data address\n"
                              "  client 2: function 03\n"
                              "  client 2 reads 2 from 4 on\n"
                              "client 2 reads what client 1 has written: success, 11 22\n");
}

static modbus_t *client_of(int port)
{
    modbus_t *client = modbus_new_tcp("127.0.0.1", port);

    if (!client || modbus_set_slave(client, 1) || modbus_connect(client))
        fail_msg("no connection");
    modbus_set_response_timeout(client, PATIENCE_MS / 1000, 0);
    return client;
}

static void libmodbus_clients_are_told_apart(void **state)
{
    const char *const any[] = {"0", NULL};
    modbus_t *operator_of, *guest;
    uint16_t words[2];
    program p;

    (void)state;
    program_start(&p, "linux/guarded_server", any);
    program_line(&p, output, sizeof output);
    assert_int_equal(strncmp(output, "ready ", 6), 0);
    operator_of = client_of(atoi(output + 6));
    assert_int_equal(modbus_read_registers(operator_of, 0, 2, words), 2);
    assert_true(words[0] == 201 && words[1] == 1);
    guest = client_of(atoi(output + 6));
    assert_int_equal(modbus_read_registers(guest, 0, 2, words), 2);
    assert_true(words[0] == 202 && words[1] == 2);
    assert_int_equal(modbus_write_register(operator_of, 9, 5), 1);
    assert_int_equal(modbus_write_register(guest, 9, 6), -1);
    assert_int_equal(errno, EMBXILFUN);
    assert_int_equal(modbus_write_register(operator_of, 1, 5), -1);
    assert_int_equal(errno, EMBXILADD);
    assert_int_equal(modbus_read_registers(guest, 9, 1, words), 1);
    assert_int_equal(words[0], 5);
    modbus_close(guest);
    modbus_close(operator_of);
    modbus_free(guest);
    modbus_free(operator_of);
    kill(p.pid, SIGTERM);
    assert_int_equal(program_end(&p), -1);
}

static void wrong_arguments_print_the_usage(void **state)
{
    const char *const wrong[] = {"-x", NULL}, *const help[] = {"--help", NULL};
    program p;

    (void)state;
    program_start(&p, "linux/guarded_server", wrong);
    assert_int_equal(program_end(&p), 2);
    program_start(&p, "linux/guarded_server", help);
    program_rest(&p, output, sizeof output);
    assert_int_equal(program_end(&p), 0);
    assert_non_null(strstr(output, "usage: guarded_server"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_demonstration_shows_a_refresh_and_each_refusal),
        cmocka_unit_test(libmodbus_clients_are_told_apart),
        cmocka_unit_test(wrong_arguments_print_the_usage),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
