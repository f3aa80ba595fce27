/* User-defined functions in a client and in a server. Both are in this program, with Modbus
 * TCP on the loopback between them. Function 41 reads and function 42 writes the server's
 * ten holding registers.
 *
 *     custom_command              prompts for commands
 *     custom_command <script      runs a script, one command a line
 *
 *     read A N        N registers from A on, by function 41
 *     write A V...    writes values from A on, by function 42
 *     raw F B...      any function with any data, all in hexadecimal
 *
 * The exit code is 0 if every command succeeded.
 *
 * Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "mbm_tcp.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { CUSTOM_READ = 0x41, CUSTOM_WRITE = 0x42, REGISTERS = 10, UNIT = 1, DATA = 252 };

/* All storage is the program's own; mbm allocates nothing. */
static uint16_t holding[REGISTERS];

static uint16_t word_at(const uint8_t *bytes)
{
    return (uint16_t)(bytes[0] << 8 | bytes[1]);
}

static void put_word(uint8_t *bytes, unsigned word)
{
    bytes[0] = (uint8_t)(word >> 8);
    bytes[1] = (uint8_t)word;
}

/* --- the server --- */

/* Request: address, quantity. Response: address, byte count, values. */
static uint16_t serve_read(void *context, const mbm_request *request, uint8_t *response,
                           uint16_t capacity)
{
    unsigned address, quantity, i;

    (void)context;
    if (request->length != 4)
        return MBM_REPLY_EXCEPTION | MBM_ILLEGAL_DATA_VALUE;
    address = word_at(request->data);
    quantity = word_at(request->data + 2);
    if (quantity == 0)
        return MBM_REPLY_EXCEPTION | MBM_ILLEGAL_DATA_VALUE;
    if (address + quantity > REGISTERS)
        return MBM_REPLY_EXCEPTION | MBM_ILLEGAL_DATA_ADDRESS;
    if (3 + 2 * quantity > capacity)
        return MBM_REPLY_EXCEPTION | MBM_SLAVE_DEVICE_FAILURE;
    put_word(response, address);
    response[2] = (uint8_t)(2 * quantity);
    for (i = 0; i < quantity; i++)
        put_word(response + 3 + 2 * i, holding[address + i]);
    return (uint16_t)(3 + 2 * quantity);
}

/* Request: address, quantity, byte count, values. Response: address, quantity. */
static uint16_t serve_write(void *context, const mbm_request *request, uint8_t *response,
                            uint16_t capacity)
{
    const uint8_t *data = request->data;
    unsigned address, quantity, i;

    (void)context;
    if (request->length < 5 || data[4] % 2 != 0 || request->length != 5 + data[4])
        return MBM_REPLY_EXCEPTION | MBM_ILLEGAL_DATA_VALUE;
    address = word_at(data);
    quantity = word_at(data + 2);
    if (quantity == 0 || data[4] != 2 * quantity)
        return MBM_REPLY_EXCEPTION | MBM_ILLEGAL_DATA_VALUE;
    if (address + quantity > REGISTERS || capacity < 4)
        return MBM_REPLY_EXCEPTION | MBM_SLAVE_DEVICE_FAILURE;
    for (i = 0; i < quantity; i++)
        holding[address + i] = word_at(data + 5 + 2 * i);
    put_word(response, address);
    put_word(response + 2, quantity);
    return 4;
}

static mbm_unit unit = MBM_INIT;
static mbm_custom services[2] = MBM_INIT;
static mbm_server server = MBM_INIT;
static mbm_tcp_listener listener = MBM_INIT;

/* --- the client --- */

static mbm_client client = MBM_INIT;
static mbm_clientRequest request = MBM_INIT;
static uint8_t data[DATA], reply[DATA];

/* Both ends of the connection, in one array for mbm_tcp_wait. */
static mbm_tcp ends[2] = MBM_INIT;
static mbm_tcp_addresses addresses;
static mbm_tcp *const client_end = &ends[0], *const server_end = &ends[1];

static uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME], frame[MBM_MAX_TCP_FRAME];

static int begin(void)
{
    char service[8];
    mbm_port port;

    unit.id = UNIT;
    services[0].code = CUSTOM_READ;
    services[0].serve = serve_read;
    services[1].code = CUSTOM_WRITE;
    services[1].serve = serve_write;
    if (mbm_unit_serveCustom(&unit, &services[0]) != MBM_OK ||
        mbm_unit_serveCustom(&unit, &services[1]) != MBM_OK)
        return -1;
    if (mbm_tcp_listen(&listener, "127.0.0.1", "0") != 0)
        return -1;
    snprintf(service, sizeof service, "%u", listener.port);
    if (mbm_tcp_open(client_end, &addresses, "127.0.0.1", service) != 0)
        return -1;
    port = mbm_tcp_port(client_end);
    if (mbm_client_beginTcp(&client, &port, incoming, sizeof incoming, outgoing, sizeof outgoing) !=
        MBM_OK)
        return -1;
    while (mbm_tcp_accept(&listener, server_end, 1) < 0)
        if (errno != EAGAIN || mbm_tcp_wait(NULL, 0, &listener, -1, MBM_TCP_FOREVER) < 0)
            return -1;
    port = mbm_tcp_port(server_end);
    return mbm_server_beginTcp(&server, &port, &unit, 1, frame, sizeof frame) == MBM_OK ? 0 : -1;
}

/* Sends a function with `bytes` bytes of data. Returns the request's status. */
static uint8_t call_function(uint8_t function, uint16_t bytes)
{
    /* A TCP frame has a length field, so this rule allows any length. */
    const mbm_rule any = {0};

    memset(&request, 0, sizeof request);
    request.unit = UNIT;
    request.data = data;
    request.reply = reply;
    request.replyBytes = sizeof reply;
    if (mbm_client_custom(&client, &request, function, bytes, &any) != MBM_PENDING)
        return MBM_INVALID_ARGUMENT;
    while (mbm_client_poll(&client) == MBM_PENDING) {
        uint32_t delay, own;

        if (mbm_server_poll(&server) != MBM_OK)
            return MBM_LINK_LOST;
        delay = mbm_client_pollDelay(&client);
        own = mbm_server_pollDelay(&server);
        mbm_tcp_wait(ends, 2, NULL, -1, own < delay ? own : delay);
    }
    return request.status;
}

static int failed(const char *what, uint8_t status)
{
    if (status == MBM_OK)
        return 0;
    printf("%s: %s\n", what, mbm_status_text(status));
    return 1;
}

/* --- commands --- */

/* Reads the numbers after a command. Returns how many, or -1 if one is not a number, is
 * larger than `most`, or exceeds the capacity of `values`. */
static int numbers(char *words, int base, unsigned long most, uint16_t *values, int capacity)
{
    int count = 0;
    char *end, *word, *rest = NULL;

    for (word = strtok_r(words, " \t\n", &rest); word; word = strtok_r(NULL, " \t\n", &rest)) {
        unsigned long value = strtoul(word, &end, base);

        if (*end || word[0] == '-' || value > most || count == capacity)
            return -1;
        values[count++] = (uint16_t)value;
    }
    return count;
}

static int read_registers(const uint16_t *values, int count)
{
    unsigned i;

    if (count != 2)
        return -1;
    put_word(data, values[0]);
    put_word(data + 2, values[1]);
    if (failed("read", call_function(CUSTOM_READ, 4)))
        return 1;
    if (request.length < 3 || reply[2] % 2 != 0 || request.length != 3 + reply[2] ||
        word_at(reply) != values[0])
        return failed("read", MBM_MALFORMED_REPLY);
    for (i = 0; i < reply[2] / 2u; i++)
        printf("register %u: %u\n", values[0] + i, word_at(reply + 3 + 2 * i));
    return 0;
}

static int write_registers(const uint16_t *values, int count)
{
    unsigned quantity = (unsigned)count - 1, i;

    if (count < 2 || 5 + 2 * quantity > DATA)
        return -1;
    put_word(data, values[0]);
    put_word(data + 2, quantity);
    data[4] = (uint8_t)(2 * quantity);
    for (i = 0; i < quantity; i++)
        put_word(data + 5 + 2 * i, values[1 + i]);
    if (failed("write", call_function(CUSTOM_WRITE, (uint16_t)(5 + 2 * quantity))))
        return 1;
    if (request.length != 4 || word_at(reply) != values[0] || word_at(reply + 2) < 1 ||
        word_at(reply + 2) > REGISTERS)
        return failed("write", MBM_MALFORMED_REPLY);
    printf("wrote %u from register %u on\n", word_at(reply + 2), word_at(reply));
    return 0;
}

static int call_raw(const uint16_t *values, int count)
{
    int i;

    if (count < 1 || values[0] == 0 || values[0] > 127)
        return -1;
    for (i = 1; i < count; i++)
        data[i - 1] = (uint8_t)values[i];
    if (failed("raw", call_function((uint8_t)values[0], (uint16_t)(count - 1))))
        return 1;
    printf("response:");
    for (i = 0; i < request.length; i++)
        printf(" %02X", reply[i]);
    printf("\n");
    return 0;
}

/* Returns 0 if the command succeeded, 1 if it was refused, -1 if it was not understood. */
static int run_command(const char *command, char *rest)
{
    uint16_t values[1 + DATA];

    if (strcmp(command, "read") == 0)
        return read_registers(values, numbers(rest, 0, 0xFFFF, values, 2));
    if (strcmp(command, "write") == 0)
        return write_registers(values, numbers(rest, 0, 0xFFFF, values, 1 + DATA));
    if (strcmp(command, "raw") == 0)
        return call_raw(values, numbers(rest, 16, 0xFF, values, 1 + DATA));
    return -1;
}

/* Prints the usage: to stdout for --help, to stderr after bad arguments. */
static int usage(const char *asked)
{
    const int is_help = strcmp(asked, "--help") == 0 || strcmp(asked, "-h") == 0;

    fprintf(is_help ? stdout : stderr,
            "usage: custom_command [<SCRIPT]\n"
            "a prompt, or a script with one command a line:\n"
            "  read A N        N registers from A on, by function 41; there are ten\n"
            "  write A V...    writes values from A on, by function 42\n"
            "  raw F B...      any function with any data, all in hexadecimal\n");
    return is_help ? 0 : 2;
}

int main(int argc, char **argv)
{
    const int is_asked = isatty(STDIN_FILENO);
    int result = 0;
    char line[2048];

    if (argc > 1)
        return usage(argv[1]);
    (void)setvbuf(stdout, NULL, _IOLBF, 0);
    if (begin() != 0) {
        perror("custom_command");
        return 2;
    }
    for (;;) {
        char *command, *rest;
        int outcome;

        if (is_asked) {
            printf("read A N, write A V..., raw F B... > ");
            fflush(stdout);
        }
        if (!fgets(line, sizeof line, stdin))
            break;
        command = line + strspn(line, " \t");
        rest = command + strcspn(command, " \t\n");
        if (*rest)
            *rest++ = 0;
        if (!*command || *command == '#')
            continue;
        outcome = run_command(command, rest);
        if (outcome < 0)
            printf("%s: not understood\n", command);
        result |= outcome != 0;
    }
    mbm_tcp_close(client_end);
    mbm_tcp_close(server_end);
    mbm_tcp_closeListener(&listener);
    return result;
}
