/* Shows every function of mbm against a libmodbus server at the far end of a pty: the call,
 * the frames in hex and in words, and the result. Written values are looked up in the
 * server's own memory.
 *
 * Licence: MIT OR Apache-2.0. */
#include "mbm_tty.h"
#include "server.h"
#include "trace.h"

#include <stdio.h>
#include <string.h>

enum { UNIT = 17, ABSENT_UNIT = 99, WORDS = 8, SHORT_FRAME = 8 };

/* The bytes of one direction, since the last call. */
typedef struct recording {
    uint8_t bytes[MBM_MAX_FRAME];
    size_t length;
} recording;

static server device;
static mbm_trace wire = MBM_INIT;
static uint8_t incomplete[2 * MBM_MAX_FRAME];
static recording sent, received;
static const mbm_framing rtu = {.kind = MBM_FRAMING_RTU};
static mbm_line line = MBM_INIT;
static mbm_node node = MBM_INIT;
static mbm_counters counters = MBM_INIT;
static uint16_t response[WORDS];
static uint16_t transmit[WORDS];
static uint8_t frame[MBM_FRAME_BYTES(WORDS)];
static unsigned requests, unexpected;

static void expect(int as_expected, const char *what)
{
    if (!as_expected) {
        unexpected++;
        printf("  NOT AS EXPECTED: %s\n", what);
    }
}

/* The hook of the trace. */
static void keep(void *context, const mbm_traceRecord *record)
{
    recording *const kept = record->direction == MBM_TRACE_SENT ? &sent : &received;
    uint16_t i;

    (void)context;
    for (i = 0; i < record->length && kept->length < sizeof kept->bytes; i++)
        kept->bytes[kept->length++] = record->bytes[i];
}

static void forget_frames(void)
{
    sent.length = received.length = 0;
}

/* Prints hex and words on one line, or below each other if the hex is long. */
static void print_frame(uint8_t direction, const recording *kept)
{
    char words[160];
    size_t i;

    printf("  %-9s", direction == MBM_PACKET_REQUEST ? "sent" : "received");
    if (kept->length == 0) {
        printf("nothing\n");
        return;
    }
    for (i = 0; i < kept->length; i++)
        printf("%s%02X", i == 0 ? "" : " ", kept->bytes[i]);
    if (kept->length > SHORT_FRAME)
        printf("\n  %-9s", "");
    else
        printf("%*s", (int)(3 * (SHORT_FRAME - kept->length) + 2), "");
    mbm_frame_text(&rtu, direction, kept->bytes, (uint16_t)kept->length, words, sizeof words);
    printf("%s\n", words);
}

/* Returns whether the last request was a read. The response to a write has no words. */
static int was_read(void)
{
    uint8_t function = sent.bytes[1];

    return function <= 0x04 || function == 0x17;
}

/* Prints the frames of the request that has just ended, and its result: the status and the
 * words of a read. */
static void show(uint8_t status, uint8_t expected_status)
{
    uint8_t words = was_read() ? mbm_node_available(&node) : 0;
    uint8_t i;

    requests++;
    mbm_trace_flush(&wire);
    print_frame(MBM_PACKET_REQUEST, &sent);
    print_frame(MBM_PACKET_RESPONSE, &received);
    printf("  result   %s", mbm_status_text(status));
    for (i = 0; i < words; i++)
        printf("%s0x%04X", i == 0 ? ": " : " ", response[i]);
    printf("\n");
    expect(status == expected_status, mbm_status_text(expected_status));
}

/* Prints a call as a user would write it, then makes it. */
#define REQUEST(call, expected_status)                                                             \
    do {                                                                                           \
        forget_frames();                                                                           \
        printf("%s\n", #call);                                                                     \
        show(call, expected_status);                                                               \
    } while (0)

/* Returns whether the words of the response are those in the server's memory. */
static int read_words(const uint16_t *there, size_t count)
{
    return mbm_node_available(&node) == count && memcmp(response, there, 2 * count) == 0;
}

/* Returns whether the bits of the response are those in the server's memory, one byte each. */
static int read_bits(const uint8_t *there, unsigned count)
{
    unsigned i;

    for (i = 0; i < count; i++) {
        if ((response[i / 16] >> i % 16 & 1) != there[i])
            return 0;
    }
    return 1;
}

static void begin(void)
{
    static mbm_tty tty = MBM_INIT;
    mbm_port port;

    server_start(&device, UNIT);
    expect(mbm_tty_attach(&tty, device.line.ours) == 0, "a terminal");
    port = trace_client(mbm_tty_port(&tty), MBM_FRAMING_RTU, device.line.path);
    expect(mbm_trace_beginClient(&wire, &port, &rtu, incomplete, sizeof incomplete, keep, NULL) ==
               MBM_OK,
           "a trace");
    expect(mbm_line_beginRtu(&line, mbm_trace_port(&wire), frame, sizeof frame) == MBM_OK,
           "beginRtu");
    expect(mbm_line_setBaudRate(&line, 115200) == MBM_OK, "setBaudRate");
    expect(mbm_line_setCounters(&line, &counters) == MBM_OK, "setCounters");
    expect(mbm_node_begin(&node, &line, UNIT, response, WORDS, transmit, WORDS) == MBM_OK, "begin");
    printf("mbm %s as master, a libmodbus server as unit %d, RTU between them over %s\n\n",
           MBM_VERSION, UNIT, device.line.path);
}

/* One round of ModbusMaster's Basic sketch. */
static void basic_sketch(void)
{
    static uint32_t counter = 0x00010000;
    const uint16_t *registers = device.mapping->tab_registers;

    counter++;
    printf("counter 0x%08X: transmit[0] = its low word, transmit[1] = its high word\n",
           (unsigned)counter);
    transmit[0] = (uint16_t)counter;
    transmit[1] = (uint16_t)(counter >> 16);
    REQUEST(mbm_node_writeMultipleRegisters(&node, 0, 2), MBM_OK);
    expect(registers[0] == 1 && registers[1] == 1, "the counter in registers 0 and 1");
    REQUEST(mbm_node_readHoldingRegisters(&node, 2, 6), MBM_OK);
    expect(read_words(registers + 2, 6), "registers 2 to 7");
}

static void other_registers(void)
{
    uint16_t *registers = device.mapping->tab_registers;

    REQUEST(mbm_node_writeSingleRegister(&node, 40, 0xBEEF), MBM_OK);
    expect(registers[40] == 0xBEEF, "0xBEEF in register 40");
    REQUEST(mbm_node_readInputRegisters(&node, 8, 1), MBM_OK);
    expect(read_words(device.mapping->tab_input_registers + 8, 1), "input register 8");
    REQUEST(mbm_node_maskWriteRegister(&node, 40, 0xFF00, 0x0012), MBM_OK);
    expect(registers[40] == 0xBE12, "0xBE12 in register 40");
    transmit[0] = 0x0A0B;
    REQUEST(mbm_node_readWriteMultipleRegisters(&node, 40, 2, 41, 1), MBM_OK);
    expect(registers[41] == 0x0A0B && read_words(registers + 40, 2), "registers 40 and 41");
}

static void bits(void)
{
    uint8_t *coils = device.mapping->tab_bits;

    REQUEST(mbm_node_writeSingleCoil(&node, 20, 1), MBM_OK);
    expect(coils[20] == 1, "coil 20 on");
    transmit[0] = 0x0155;
    REQUEST(mbm_node_writeMultipleCoils(&node, 21, 9), MBM_OK);
    expect(coils[21] == 1 && coils[22] == 0 && coils[28] == 0 && coils[29] == 1, "coils 21 to 29");
    REQUEST(mbm_node_readCoils(&node, 20, 10), MBM_OK);
    expect(read_bits(coils + 20, 10), "coils 20 to 29");
    REQUEST(mbm_node_readDiscreteInputs(&node, 30, 8), MBM_OK);
    expect(read_bits(device.mapping->tab_input_bits + 30, 8), "inputs 30 to 37");
}

/* The program's own loop goes on while a request is under way. */
static void without_waiting(void)
{
    unsigned rounds = 0;
    uint8_t status;

    mbm_node_setBlocking(&node, 0);
    forget_frames();
    printf("mbm_node_setBlocking(&node, 0), then mbm_node_readHoldingRegisters(&node, 0, 2)\n");
    status = mbm_node_readHoldingRegisters(&node, 0, 2);
    expect(status == MBM_PENDING, "pending at once");
    printf("  at once  %s\n", mbm_status_text(status));
    while ((status = mbm_node_poll(&node)) == MBM_PENDING)
        rounds++;
    printf("  while mbm_node_poll(&node) said so, the program went round its loop %u times\n",
           rounds);
    show(status, MBM_OK);
    expect(rounds > 0 && read_words(device.mapping->tab_registers, 2), "registers 0 and 1");
    mbm_node_setBlocking(&node, 1);
}

static void failing_requests(void)
{
    REQUEST(mbm_node_readHoldingRegisters(&node, SERVER_REGISTERS, 1), MBM_ILLEGAL_DATA_ADDRESS);
    printf("mbm_node_setSlaveID(&node, %d), mbm_node_setResponseTimeout(&node, 200), then\n",
           ABSENT_UNIT);
    mbm_node_setSlaveID(&node, ABSENT_UNIT);
    mbm_node_setResponseTimeout(&node, 200);
    REQUEST(mbm_node_readHoldingRegisters(&node, 0, 1), MBM_RESPONSE_TIMED_OUT);
}

static void show_counters(void)
{
    printf("\ncounters: requests %u, replies %u, exceptions %u, timeouts %u, bad CRCs %u, "
           "bytes sent %u, received %u\n",
           (unsigned)counters.requests, (unsigned)counters.replies, (unsigned)counters.exceptions,
           (unsigned)counters.timeouts, (unsigned)counters.badCrc, (unsigned)counters.bytesSent,
           (unsigned)counters.bytesReceived);
    expect(counters.requests == requests && counters.replies == requests - 1 &&
               counters.exceptions == 1 && counters.timeouts == 1 && counters.badCrc == 0,
           "all answered but one");
}

int main(int argc, char **argv)
{
    trace_options(&argc, argv);
    begin();
    basic_sketch();
    other_registers();
    bits();
    without_waiting();
    failing_requests();
    show_counters();
    server_stop(&device);
    if (unexpected) {
        printf("demo: %u of the results were not as expected\n", unexpected);
        return 1;
    }
    printf("demo: %u requests to a libmodbus server, every result as expected\n", requests);
    return 0;
}
