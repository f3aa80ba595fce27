/* The examples custom_server and custom_client with frames that only a faulty client sends, and the
 * example guarded_server with libmodbus's clients. */
#define _GNU_SOURCE
#include "await.h"
#include "program.h"
#include "test.h"

#include <arpa/inet.h>
#include <modbus.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

static program server;
static char service[16], output[4096];

static void start_server(void)
{
    const char *const any[] = {"0", NULL};

    program_start(&server, "linux/custom_server", any);
    program_line(&server, output, sizeof output);
    assert_int_equal(sscanf(output, "ready %15s", service), 1);
}

static void stop_server(void)
{
    kill(server.pid, SIGTERM);
    (void)program_end(&server);
}

fixture each_test = {start_server, stop_server};

/* Runs the client. Keeps what it prints, and returns its exit code. */
static int run(const char *address, const char *second, const char *third)
{
    const char *const arguments[] = {"127.0.0.1", service, address, second, third, NULL};
    program client;

    program_start(&client, "linux/custom_client", arguments);
    program_rest(&client, output, sizeof output);
    return program_end(&client);
}

/* Sends a PDU, given in hexadecimal, and returns the PDU of the response in the same form. */
static const char *exchange(const char *request)
{
    static char response[64];
    struct sockaddr_in address = {.sin_family = AF_INET,
                                  .sin_port = htons((uint16_t)atoi(service)),
                                  .sin_addr = {.s_addr = htonl(INADDR_LOOPBACK)}};
    uint8_t frame[64] = {0, 1, 0, 0, 0, 0, 1};
    const int fd = socket(AF_INET, SOCK_STREAM, 0);
    size_t length = 7, i;
    ssize_t received;

    for (; *request; request += request[2] ? 3 : 2)
        frame[length++] = (uint8_t)strtoul((const char[]){request[0], request[1], 0}, NULL, 16);
    frame[5] = (uint8_t)(length - 6);
    assert_int_equal(connect(fd, (struct sockaddr *)&address, sizeof address), 0);
    assert_int_equal(send(fd, frame, length, 0), length);
    received = recv(fd, frame, sizeof frame, 0);
    close(fd);
    assert_true(received > 7);
    for (i = 7; i < (size_t)received; i++)
        sprintf(response + 3 * (i - 7), "%02X ", frame[i]);
    response[3 * (i - 7) - 1] = 0;
    return response;
}

TEST(a_written_register_is_read_back)
{
    assert_int_equal(run("2", "=", "4660"), 0);
    assert_string_equal(output, "written\n");
    assert_int_equal(run("1", "3", NULL), 0);
    assert_string_equal(output, "0\n4660\n0\n");
}

TEST(the_tenth_register_is_the_last)
{
    assert_int_equal(run("9", "1", NULL), 0);
    assert_int_equal(run("9", "2", NULL), 1);
    assert_int_equal(run("65535", "2", NULL), 1);
    assert_int_equal(run("10", "=", "1"), 1);
    assert_string_equal(exchange("41 00 09 00 02"), "C1 02");
}

TEST(a_write_past_the_end_answers_04_and_changes_nothing)
{
    assert_string_equal(exchange("42 00 09 00 02 04 00 01 00 02"), "C2 04");
    assert_string_equal(exchange("42 FF FF 00 01 02 00 01"), "C2 04");
    assert_int_equal(run("10", "=", "1"), 1);
    assert_string_equal(exchange("41 00 09 00 01"), "41 00 09 02 00 00");
}

TEST(all_ten_registers_are_written_at_once)
{
    const char *const write[] = {"127.0.0.1", service, "0", "=", "1", "2",  "3", "4",
                                 "5",         "6",     "7", "8", "9", "10", NULL};
    program client;

    program_start(&client, "linux/custom_client", write);
    program_rest(&client, output, sizeof output);
    assert_int_equal(program_end(&client), 0);
    assert_int_equal(run("0", "10", NULL), 0);
    assert_string_equal(output, "1\n2\n3\n4\n5\n6\n7\n8\n9\n10\n");
}

TEST(wrong_lengths_return_03_and_change_nothing)
{
    static const char *const wrong[] = {"42 00 00 00 01 03 00 01 02", "42 00 00 00 02 02 00 01",
                                        "42 00 00 00 01 02 00", "42 00 00 00 00 00"};

    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++)
        assert_string_equal(exchange(wrong[i]), "C2 03");
    assert_string_equal(exchange("41 00 00 00"), "C1 03");
    assert_string_equal(exchange("41"), "C1 03");
    assert_string_equal(exchange("41 00 00 00 00"), "C1 03");
    assert_string_equal(exchange("41 00 00 00 02"), "41 00 00 04 00 00 00 00");
}

TEST(the_frames_are_those_of_the_two_functions)
{
    assert_string_equal(exchange("42 00 03 00 02 04 12 34 AB CD"), "42 00 03 00 02");
    assert_string_equal(exchange("41 00 03 00 02"), "41 00 03 04 12 34 AB CD");
    assert_string_equal(exchange("43 01"), "C3 01");
    assert_string_equal(exchange("03 00 00 00 01"), "83 01");
}

TEST(arguments_that_are_missing_print_the_usage)
{
    assert_int_equal(run(NULL, NULL, NULL), 2);
    assert_int_equal(run("1", NULL, NULL), 2);
    assert_int_equal(run("1", "2", "3"), 2);
}

/* --- guarded_server --- */

static modbus_t *client_of(int port)
{
    modbus_t *client = modbus_new_tcp("127.0.0.1", port);

    if (!client || modbus_set_slave(client, 1) || modbus_connect(client))
        fail_msg("no connection");
    modbus_set_response_timeout(client, PATIENCE_MS / 1000, 0);
    return client;
}

TEST_WITH(libmodbus_clients_are_told_apart, NULL, NULL)
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

TEST_WITH(a_missing_port_prints_the_usage, NULL, NULL)
{
    const char *const none[] = {NULL};
    program p;

    program_start(&p, "linux/guarded_server", none);
    assert_int_equal(program_end(&p), 2);
}
