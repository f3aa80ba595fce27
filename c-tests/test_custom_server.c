/* The examples custom_server and custom_client, and frames that only a faulty client sends. */
#define _GNU_SOURCE
#include "program.h"
#include "test.h"

#include <arpa/inet.h>
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
