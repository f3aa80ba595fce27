/* Compares mbm's server with others for the same requests.
 *
 *     bench_server OTHER    requests per second of the server loops with 32 connections, and of the
 * program OTHER bench_server crowd PORT COUNT     makes requests with 32 connections bench_server
 * count    each request by itself, for callgrind bench_server loops    loops of whole programs, for
 * callgrind, which must start with collection off */
#define _GNU_SOURCE
#include "bench_server.h"
#include "crc.h"
#include "mbm_tcp.h"
#include "mbm_tty.h"

#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>
#include <valgrind/callgrind.h>

enum { COUNTED = 500 };

/* Requests: PDUs, without the unit and the framing. */
typedef struct asked {
    const char *name;
    uint16_t length;
    uint8_t pdu[40];
} asked;

static const asked requests[] = {
    {"01 Read Coils, 19", 5, {1, 0, 7, 0, 19}},
    {"02 Read Discrete Inputs, 19", 5, {2, 0, 7, 0, 19}},
    {"03 Read Holding Registers, 10", 5, {3, 0, 7, 0, 10}},
    {"03 Read Holding Registers, 125", 5, {3, 0, 7, 0, 125}},
    {"04 Read Input Registers, 10", 5, {4, 0, 7, 0, 10}},
    {"05 Write Single Coil", 5, {5, 0, 7, 0xFF, 0}},
    {"06 Write Single Register", 5, {6, 0, 7, 0x12, 0x34}},
    {"0F Write Multiple Coils, 19", 9, {15, 0, 7, 0, 19, 3, 0xA5, 0x5A, 0x02}},
    {"10 Write Multiple Registers, 10", 26, {16, 0, 7, 0, 10, 20, 1, 2, 3, 4, 5, 6, 7, 8, 9}},
    {"16 Mask Write Register", 7, {22, 0, 7, 0, 0xF2, 0, 0x25}},
    {"17 Read/Write Multiple Registers, 10", 30, {23, 0, 7, 0, 10, 0, 7, 0, 10, 20, 9, 8, 7, 6, 5}},
    {"03 Read Holding Registers, none there", 5, {3, 0x77, 0, 0, 1}},
};

enum { REQUESTS = sizeof requests / sizeof *requests };

static uint16_t frame_of(const asked *request, int is_rtu, uint8_t *frame)
{
    uint16_t length = request->length;

    if (is_rtu) {
        frame[0] = UNIT;
        memcpy(frame + 1, request->pdu, length);
        seal(frame, length + 1u);
        return (uint16_t)(length + 3);
    }
    memset(frame, 0, 7);
    frame[1] = 1;
    frame[5] = (uint8_t)(length + 1);
    frame[6] = UNIT;
    memcpy(frame + 7, request->pdu, length);
    return (uint16_t)(length + 7);
}

/* --- instructions --- */

static int ends[2];
static mbm_server server;
static uint8_t buffer[MBM_MAX_TCP_FRAME];
static mbm_tcp tcp;
static mbm_tty tty;
static modbus_t *peer;

static void serve_by_mbm(void)
{
    struct pollfd more = {ends[1], POLLIN, 0};

    do {
        if (mbm_server_poll(&server) != MBM_OK)
            fail("mbm");
    } while (poll(&more, 1, 0) == 0);
}

static void serve_by_libmodbus(void)
{
    uint8_t request[MOST];
    int length = modbus_receive(peer, request);

    if (length > 0)
        modbus_reply(peer, request, length, mapping);
}

static void begin(int is_rtu)
{
    mbm_port port;

    if (socketpair(AF_UNIX, SOCK_STREAM, 0, ends) != 0)
        fail("socketpair");
    memset(&server, 0, sizeof server);
    if (is_rtu) {
        /* A request ends when no more bytes are there: libmodbus does not wait for silence. */
        if (mbm_tty_attach(&tty, ends[0]) != 0)
            fail("tty");
        port = mbm_tty_port(&tty);
        if (mbm_server_beginRtu(&server, &port, &unit, 1, buffer, sizeof buffer) ||
            mbm_server_setSilence(&server, 0))
            fail("mbm");
        peer = modbus_new_rtu("/dev/null", 115200, 'N', 8, 1);
    } else {
        if (mbm_tcp_attach(&tcp, ends[0]) != 0)
            fail("tcp");
        port = mbm_tcp_port(&tcp);
        if (mbm_server_beginTcp(&server, &port, &unit, 1, buffer, sizeof buffer))
            fail("mbm");
        peer = modbus_new_tcp("127.0.0.1", 1502);
    }
    if (!peer || modbus_set_slave(peer, UNIT) || modbus_set_socket(peer, ends[0]))
        fail("libmodbus");
}

static void end(void)
{
    modbus_free(peer);
    mbm_tcp_close(&tcp);
    close(ends[0]);
    close(ends[1]);
}

/* Counts the instructions of both servers. Their responses must agree, byte for byte. */
static void count(int is_rtu)
{
    void (*const serves[])(void) = {serve_by_libmodbus, serve_by_mbm};
    const char *const names[] = {"libmodbus", "mbm"};
    uint8_t request[MOST], first[MOST], answer[MOST];
    ssize_t got, expected;
    unsigned r, s, i;
    char title[100];

    for (r = 0; r < REQUESTS; r++) {
        uint16_t length = frame_of(&requests[r], is_rtu, request);

        expected = 0;
        for (s = 0; s < 2; s++) {
            for (i = 0; i <= COUNTED; i++) {
                if (i == 1)
                    CALLGRIND_ZERO_STATS;
                if (write(ends[1], request, length) != length)
                    fail("write");
                serves[s]();
                got = read(ends[1], answer, sizeof answer);
                if (s == 0 && i == 0) {
                    memcpy(first, answer, sizeof first);
                    expected = got;
                }
                if (got <= 0 || got != expected || memcmp(answer, first, (size_t)got) != 0) {
                    fprintf(stderr, "bench: %s answers %s otherwise\n", names[s], requests[r].name);
                    exit(1);
                }
            }
            snprintf(title, sizeof title, "%s\t%s\t%s\t%d", is_rtu ? "RTU" : "TCP",
                     requests[r].name, names[s], COUNTED);
            CALLGRIND_DUMP_STATS_AT(title);
        }
    }
}

int main(int argc, char **argv)
{
    int is_rtu;

    (void)signal(SIGPIPE, SIG_IGN);
    prepare_tables();
    if (argc == 4 && strcmp(argv[1], "crowd") == 0) {
        make_requests(argv[2], argv[3]);
    } else if (argc == 2 && strcmp(argv[1], "count") == 0) {
        for (is_rtu = 0; is_rtu < 2; is_rtu++) {
            begin(is_rtu);
            count(is_rtu);
            end();
        }
    } else if (argc == 2 && strcmp(argv[1], "loops") == 0) {
        count_loops();
    } else if (argc == 2) {
        compare_loops(argv[1]);
    } else {
        fprintf(stderr, "usage: bench_server count | loops | crowd PORT COUNT | OTHER\n");
        return 2;
    }
    modbus_mapping_free(mapping);
    return 0;
}
