/* A Modbus TCP server that refreshes registers when they are read, and that allows one client
 * what it refuses another.
 *
 *     guarded_server          a demonstration: two clients of its own, on the loopback
 *     guarded_server PORT     serves clients on PORT of every address until it is ended
 *
 * It serves ten holding registers as unit 1. Registers 0 and 1 are read-only: a measured value,
 * and how often it was measured. The server measures when a client reads them. The others may
 * be written by the operator, which is the client at the first place. Another client gets
 * exception 01 for a write, and anyone exception 02 for a write of a read-only register.
 *
 * Prints `ready PORT` once it listens, then what each client does.
 *
 * Licence: MIT OR Apache-2.0. */
#include "mbm_tcp.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

enum { CONNECTIONS = 4, REGISTERS = 10, READ_ONLY = 2, UNIT = 1, CLIENTS = 2 };

static uint16_t words[REGISTERS];
static mbm_registerTable holding = MBM_INIT;
static mbm_custom watch = MBM_INIT;
static mbm_unit unit = MBM_INIT;
static mbm_server servers[CONNECTIONS] = MBM_INIT;
static uint8_t frames[CONNECTIONS][MBM_MAX_TCP_FRAME];
static mbm_tcp_listener listener = MBM_INIT;

/* The server's connections, and after them the ends of the demonstration's clients, in one array
 * for mbm_tcp_wait. */
static mbm_tcp places[CONNECTIONS + CLIENTS] = MBM_INIT;

/* --- the hooks --- */

/* The port of a server has its mbm_tcp as context, so that is the connection of a request. */
static unsigned place_of(const void *connection)
{
    return (unsigned)((const mbm_tcp *)connection - places);
}

static uint8_t refused(const mbm_access *access, uint8_t exception)
{
    printf("  client %u: %s\n", place_of(access->connection) + 1, mbm_status_text(exception));
    return exception;
}

static uint8_t before_read(void *context, const mbm_access *access)
{
    (void)context;
    if (access->address < READ_ONLY) {
        words[1]++;
        words[0] = (uint16_t)(200 + words[1]); /* a sensor would be asked here */
    }
    printf("  client %u reads %u from %u on\n", place_of(access->connection) + 1, access->quantity,
           access->address);
    return 0;
}

static uint8_t before_write(void *context, const mbm_access *access)
{
    (void)context;
    if (place_of(access->connection) != 0)
        return refused(access, MBM_ILLEGAL_FUNCTION);
    if (access->address < READ_ONLY)
        return refused(access, MBM_ILLEGAL_DATA_ADDRESS);
    return 0;
}

static void after_write(void *context, const mbm_access *access)
{
    (void)context;
    printf("  client %u has written %u from %u on\n", place_of(access->connection) + 1,
           access->quantity, access->address);
}

static const mbm_accessHooks hooks = {
    .beforeRead = before_read, .beforeWrite = before_write, .afterWrite = after_write};

/* Sees every request before the table does, because it is registered first, and leaves it to the
 * table. */
static uint16_t see(void *context, const mbm_request *request, uint8_t *response, uint16_t capacity)
{
    (void)context;
    (void)response;
    (void)capacity;
    printf("  client %u: function %02X\n", place_of(request->connection) + 1, request->function);
    return MBM_REPLY_DECLINED;
}

/* --- the server --- */

static int begin(const char *host, const char *service)
{
    unit.id = UNIT;
    holding.words = words;
    holding.size = REGISTERS;
    watch.serve = see;
    watch.code = 0; /* every function */
    if (mbm_unit_serveCustom(&unit, &watch) != MBM_OK ||
        mbm_unit_serveHoldingRegisters(&unit, &holding) != MBM_OK ||
        mbm_registerTable_setHooks(&holding, &hooks) != MBM_OK ||
        mbm_tcp_listen(&listener, host, service) != 0)
        return -1;
    printf("ready %u\n", listener.port);
    return 0;
}

/* Accepts clients, and answers their requests. */
static void serve(void)
{
    int i;

    while ((i = mbm_tcp_accept(&listener, places, CONNECTIONS)) >= 0) {
        mbm_port port = mbm_tcp_port(&places[i]);

        mbm_server_beginTcp(&servers[i], &port, &unit, 1, frames[i], MBM_MAX_TCP_FRAME);
    }
    for (i = 0; i < CONNECTIONS; i++)
        if (mbm_tcp_isInUse(&places[i]) && mbm_server_poll(&servers[i]) != MBM_OK)
            mbm_tcp_close(&places[i]);
}

/* --- the demonstration --- */

static mbm_client clients[CLIENTS] = MBM_INIT;
static mbm_tcp_addresses addresses[CLIENTS];
static uint8_t incoming[CLIENTS][MBM_MAX_TCP_FRAME], outgoing[CLIENTS][MBM_MAX_TCP_FRAME];
static uint16_t values[2];

static int connect_client(unsigned i)
{
    mbm_tcp *end = &places[CONNECTIONS + i];
    char service[8];
    mbm_port port;

    snprintf(service, sizeof service, "%u", listener.port);
    if (mbm_tcp_open(end, &addresses[i], "127.0.0.1", service) != 0)
        return -1;
    port = mbm_tcp_port(end);
    if (mbm_client_beginTcp(&clients[i], &port, incoming[i], MBM_MAX_TCP_FRAME, outgoing[i],
                            MBM_MAX_TCP_FRAME) != MBM_OK)
        return -1;
    while (!mbm_tcp_isInUse(&places[i])) {
        mbm_tcp_wait(places, CONNECTIONS + CLIENTS, &listener, -1, MBM_TCP_FOREVER);
        serve();
    }
    return 0;
}

/* Serves until a request of a client has ended, and prints how. */
static void show(unsigned i, const char *what, mbm_clientRequest *request)
{
    while (mbm_client_poll(&clients[i]) == MBM_PENDING) {
        serve();
        mbm_tcp_wait(places, CONNECTIONS + CLIENTS, &listener, -1,
                     mbm_client_pollDelay(&clients[i]));
    }
    printf("%s: %s", what, mbm_status_text(request->status));
    if (request->status == MBM_OK)
        printf(", %u %u", values[0], values[1]);
    printf("\n");
}

static void read_registers(unsigned i, const char *what, uint16_t address)
{
    mbm_clientRequest request = {.unit = UNIT, .reply = values, .replyBytes = sizeof values};

    mbm_client_readHoldingRegisters(&clients[i], &request, address, 2);
    show(i, what, &request);
}

static void write_registers(unsigned i, const char *what, uint16_t address)
{
    mbm_clientRequest request = {.unit = UNIT, .data = values};

    values[0] = 11;
    values[1] = 22;
    mbm_client_writeMultipleRegisters(&clients[i], &request, address, 2);
    show(i, what, &request);
}

static int demonstrate(void)
{
    if (connect_client(0) != 0 || connect_client(1) != 0)
        return -1;
    read_registers(0, "client 1 reads the sensor", 0);
    read_registers(1, "client 2 reads the sensor", 0);
    write_registers(0, "client 1 writes", 4);
    write_registers(1, "client 2 writes", 4);
    write_registers(0, "client 1 writes the sensor", 0);
    read_registers(1, "client 2 reads what client 1 has written", 4);
    return 0;
}

int main(int argc, char **argv)
{
    const int is_demonstration = argc == 1;

    if (argc > 2 || (argc == 2 && argv[1][0] == '-')) {
        const int is_help = strcmp(argv[1], "--help") == 0 || strcmp(argv[1], "-h") == 0;

        fprintf(is_help ? stdout : stderr,
                "usage: guarded_server          a demonstration with two clients of its own\n"
                "       guarded_server PORT     serves clients on PORT\n");
        return is_help ? 0 : 2;
    }
    (void)setvbuf(stdout, NULL, _IOLBF, 0);
    if (begin(is_demonstration ? "127.0.0.1" : NULL, is_demonstration ? "0" : argv[1]) != 0 ||
        (is_demonstration && demonstrate() != 0)) {
        perror("guarded_server");
        return 2;
    }
    if (is_demonstration)
        return 0;
    for (;;) {
        mbm_tcp_wait(places, CONNECTIONS, &listener, -1, MBM_TCP_FOREVER);
        serve();
    }
}
