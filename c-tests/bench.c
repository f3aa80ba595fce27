/* Compares the speed of mbm and of libmodbus as a client: both read ten registers by FC03
 * from the same libmodbus server over the same pty. The server is a process of its own, so
 * that a profiler sees only the client. */
#define _GNU_SOURCE
#include "mbm_tty.h"
#include "pty.h"
#include "server.h"

#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

enum { UNIT = 17, ADDRESS = 7, QUANTITY = 10, ROUNDS = 11, PER_ROUND = 2000, WARM_UP = 200 };

/* Makes one transaction. Returns 0 if it did not bring the right data. */
typedef int (*transact)(void);

static mbm_line line;
static mbm_node node;
static mbm_tty tty;
static uint16_t response[QUANTITY];
static uint16_t transmit[1];
static uint8_t frame[MBM_FRAME_BYTES(QUANTITY)];
static modbus_t *peer;
static uint16_t expected[QUANTITY];

static void fail(const char *what)
{
    perror(what);
    exit(1);
}

static int by_mbm(void)
{
    return mbm_node_readHoldingRegisters(&node, ADDRESS, QUANTITY) == MBM_OK &&
           memcmp(response, expected, sizeof expected) == 0;
}

static int by_libmodbus(void)
{
    uint16_t words[QUANTITY];

    return modbus_read_registers(peer, ADDRESS, QUANTITY, words) == QUANTITY &&
           memcmp(words, expected, sizeof expected) == 0;
}

static void begin_clients(int fd)
{
    static mbm_port port;
    unsigned i;

    for (i = 0; i < QUANTITY; i++)
        expected[i] = server_pattern(ADDRESS + i);
    if (mbm_tty_attach(&tty, fd) != 0)
        fail("tty");
    port = mbm_tty_port(&tty);
    /* libmodbus keeps no gap before a request, so mbm keeps none here either. */
    if (mbm_line_beginRtu(&line, &port, frame, sizeof frame) != MBM_OK ||
        mbm_node_begin(&node, &line, UNIT, response, QUANTITY, transmit, 1) != MBM_OK ||
        mbm_line_setGap(&line, 0) != MBM_OK)
        fail("mbm");
    /* Both use the same descriptor, which is non-blocking as libmodbus's own would be.
     * libmodbus needs the name only to make its object. */
    peer = modbus_new_rtu("/dev/null", 115200, 'N', 8, 1);
    if (!peer || modbus_set_slave(peer, UNIT) != 0 || modbus_set_socket(peer, fd) != 0)
        fail("libmodbus client");
}

/* Serves until the line hangs up. */
static int serve(const char *path)
{
    modbus_t *host = modbus_new_rtu(path, 115200, 'N', 8, 1);
    modbus_mapping_t *mapping = modbus_mapping_new(0, 0, SERVER_REGISTERS, 0);
    uint8_t request[MODBUS_RTU_MAX_ADU_LENGTH];
    unsigned i;

    if (!host || !mapping || modbus_set_slave(host, UNIT) != 0 || modbus_connect(host) != 0)
        fail("libmodbus server");
    for (i = 0; i < SERVER_REGISTERS; i++)
        mapping->tab_registers[i] = server_pattern(i);
    for (;;) {
        int length = modbus_receive(host, request);

        if (length < 0)
            break;
        if (length > 0)
            modbus_reply(host, request, length, mapping);
    }
    modbus_close(host);
    modbus_free(host);
    modbus_mapping_free(mapping);
    return 0;
}

/* Starts this program again as the server at the far end of the pty. */
static pid_t start_server(const char *program, const pty *terminal)
{
    pid_t child = fork();

    if (child < 0)
        fail("fork");
    if (child == 0) {
        close(terminal->ours);
        close(terminal->theirs);
        execl(program, program, "serve", terminal->path, (char *)NULL);
        _exit(127);
    }
    return child;
}

static void run(transact one, const char *name, unsigned long count)
{
    unsigned long i;

    for (i = 0; i < count; i++) {
        if (!one()) {
            fprintf(stderr, "bench: %s: transaction %lu returned wrong data\n", name, i + 1);
            exit(1);
        }
    }
}

static double per_second(transact one, const char *name)
{
    struct timespec from, to;

    clock_gettime(CLOCK_MONOTONIC, &from);
    run(one, name, PER_ROUND);
    clock_gettime(CLOCK_MONOTONIC, &to);
    return PER_ROUND /
           ((double)(to.tv_sec - from.tv_sec) + (double)(to.tv_nsec - from.tv_nsec) * 1e-9);
}

static int by_size(const void *left, const void *right)
{
    double a = *(const double *)left, b = *(const double *)right;

    return (a > b) - (a < b);
}

static double median(double *values)
{
    qsort(values, ROUNDS, sizeof *values, by_size);
    return values[ROUNDS / 2];
}

/* Measures both in alternate rounds, so that the load of the machine affects both alike.
 * Prints one line: the name and the median of the transactions per second. */
static void compare(void)
{
    double mbm[ROUNDS], libmodbus[ROUNDS];
    unsigned round;

    run(by_mbm, "mbm", WARM_UP);
    run(by_libmodbus, "libmodbus", WARM_UP);
    for (round = 0; round < ROUNDS; round++) {
        mbm[round] = per_second(by_mbm, "mbm");
        libmodbus[round] = per_second(by_libmodbus, "libmodbus");
    }
    printf("rate\t%.0f\t%.0f\n", median(mbm), median(libmodbus));
    fflush(stdout);
}

/* On several CPUs the result depends most on which CPUs the scheduler gives to the two
 * processes. On one CPU it depends on the work alone. */
static void compare_on_one_cpu(pid_t server_process)
{
    cpu_set_t all, one;
    size_t cpu = 0;

    if (sched_getaffinity(0, sizeof all, &all) != 0)
        fail("sched_getaffinity");
    while (!CPU_ISSET(cpu, &all))
        cpu++;
    CPU_ZERO(&one);
    CPU_SET(cpu, &one);
    if (sched_setaffinity(0, sizeof one, &one) != 0 ||
        sched_setaffinity(server_process, sizeof one, &one) != 0)
        fail("sched_setaffinity");
    compare();
}

int main(int argc, char **argv)
{
    pty terminal;
    pid_t child;

    if (argc == 3 && strcmp(argv[1], "serve") == 0)
        return serve(argv[2]);
    pty_open(&terminal);
    child = start_server(argv[0], &terminal);
    begin_clients(terminal.ours);
    if (argc == 1) {
        compare_on_one_cpu(child);
    } else if (argc == 3 && strcmp(argv[1], "mbm") == 0) {
        run(by_mbm, argv[1], strtoul(argv[2], NULL, 10));
    } else if (argc == 3 && strcmp(argv[1], "libmodbus") == 0) {
        run(by_libmodbus, argv[1], strtoul(argv[2], NULL, 10));
    } else {
        fprintf(stderr, "usage: bench [mbm N | libmodbus N | serve PATH]\n");
    }
    modbus_free(peer);
    kill(child, SIGKILL);
    waitpid(child, NULL, 0);
    pty_close(&terminal);
    return 0;
}
