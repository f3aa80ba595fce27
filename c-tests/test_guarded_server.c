/* The example guarded_server, with libmodbus's clients. */
#define _GNU_SOURCE
#include "await.h"
#include "program.h"
#include "test.h"

#include <errno.h>
#include <modbus.h>
#include <signal.h>

static char output[4096];

static modbus_t *client_of(int port)
{
    modbus_t *client = modbus_new_tcp("127.0.0.1", port);

    if (!client || modbus_set_slave(client, 1) || modbus_connect(client))
        fail_msg("no connection");
    modbus_set_response_timeout(client, PATIENCE_MS / 1000, 0);
    return client;
}

TEST(libmodbus_clients_are_told_apart)
{
    const char *const any[] = {"0", NULL};
    uint16_t words[2];
    program p;

    program_start(&p, "linux/guarded_server", any);
    program_line(&p, output, sizeof output);
    assert_int_equal(strncmp(output, "ready ", 6), 0);
    modbus_t *operator_of = client_of(atoi(output + 6));
    assert_int_equal(modbus_read_registers(operator_of, 0, 2, words), 2);
    assert_true(words[0] == 201 && words[1] == 1);
    modbus_t *guest = client_of(atoi(output + 6));
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
    program_rest(&p, output, sizeof output);
    assert_int_equal(program_end(&p), -1);
    assert_string_equal(output, "client 1 reads 2 from 0 on\n"
                                "client 2 reads 2 from 0 on\n"
                                "client 1 writes 1 from 9 on: success\n"
                                "client 2 writes 1 from 9 on: exception 01: illegal function\n"
                                "client 1 writes 1 from 1 on: exception 02: illegal data address\n"
                                "client 2 reads 1 from 9 on\n");
}

TEST(a_missing_port_prints_the_usage)
{
    const char *const none[] = {NULL};
    program p;

    program_start(&p, "linux/guarded_server", none);
    assert_int_equal(program_end(&p), 2);
}
