/* A server whose UART hands received bytes over in blocks: FC10 requests of every length, without a
 * pause on the wire. Prints the table of docs/server.md. On a simulated clock. */
#define _GNU_SOURCE
#include "crc.h"
#include "mbm_tty.h"
#include "pty.h"
#include "test.h"

#include <modbus/modbus.h>
#include <poll.h>
#include <pthread.h>
#include <time.h>
#include <unistd.h>

enum { UNIT = 17, MOST = MBM_MAX_WRITE_REGISTERS, BITS = 11 };

/* The server, and the bytes that its UART will hand over. */
static struct {
    uint64_t now; /* microseconds */
    uint8_t bytes[300];
    uint64_t at[300]; /* when read returns the byte */
    unsigned count, taken, answers, other;
    mbm_ring ring; /* used if it has begun */
} line;

static uint16_t words[MOST];
static mbm_registerTable holding;
static mbm_unit unit;
static mbm_server server;
static uint8_t frame[MBM_MAX_FRAME];

static int16_t receive(void *context, uint8_t *bytes, uint16_t capacity)
{
    int16_t count = 0;

    while (count < (int16_t)capacity && line.taken < line.count && line.at[line.taken] <= line.now)
        bytes[count++] = line.bytes[line.taken++];
    return count;
}

static int16_t transmit(void *context, const uint8_t *bytes, uint16_t length)
{
    if (length == 8 && bytes[0] == UNIT && bytes[1] == 0x10 && crc16(bytes, 8) == 0)
        line.answers++;
    else
        line.other++;
    return (int16_t)length;
}

static uint32_t micros(void *context)
{
    return (uint32_t)line.now;
}

static void begin(uint32_t baud)
{
    const mbm_port port = {.read = receive, .write = transmit, .micros = micros};

    memset(&server, 0, sizeof server);
    unit = (mbm_unit){.id = UNIT};
    holding = (mbm_registerTable){.words = words, .size = MOST};
    OK(mbm_unit_serveHoldingRegisters(&unit, &holding));
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    OK(mbm_server_setBaudRate(&server, baud));
}

/* How a UART hands bytes over. */
typedef struct uart {
    const char *name;
    unsigned block;    /* bytes; 0: whatever has arrived when a period ends */
    uint32_t periodUs; /* of the period */
    unsigned late;     /* characters after which the last bytes follow */
    const char *delay; /* for the table */
} uart;

static const uart uarts[] = {
    {"1 byte", 1, 0, 0, "none"},
    {"16 bytes", 16, 0, 4, "4 characters"},
    {"22 bytes", 22, 0, 2, "2 characters"},
    {"64 bytes", 64, 0, 1, "1 character"},
    {"120 bytes", 120, 0, 10, "10 characters"},
    {"a period of 10 ms", 0, 10000, 0, "up to 10 ms"},
    {"a period of 16 ms", 0, 16000, 0, "up to 16 ms"},
    {"a period of 40 ms", 0, 40000, 0, "up to 40 ms"},
};

static const uint32_t rates[] = {1200, 9600, 19200, 115200};

/* Sends a write of `quantity` registers. Returns whether it was answered, once, and carried out. */
static int is_answered(const uart *from, uint32_t baud, unsigned quantity)
{
    const uint32_t character = BITS * 1000000u / baud + 1;
    const uint8_t head[7] = {UNIT, 0x10, 0, 0, 0, (uint8_t)quantity, (uint8_t)(2 * quantity)};

    begin(baud);
    memset(&line, 0, sizeof line);
    line.now = 1000000;
    memset(words, 0, sizeof words);
    memcpy(line.bytes, head, sizeof head);
    for (unsigned i = 0; i < 2 * quantity; i++)
        line.bytes[sizeof head + i] = (uint8_t)(i * 7 + quantity);
    line.count = (unsigned)seal(line.bytes, sizeof head + 2 * quantity);
    for (unsigned i = 0; i < line.count; i++) {
        const uint64_t start = line.now;

        if (from->block) {
            const unsigned whole = (i / from->block + 1) * from->block;
            const unsigned last = whole <= line.count ? whole : line.count + from->late;

            line.at[i] = start + (uint64_t)last * character;
        } else {
            const uint64_t arrived = (uint64_t)(i + 1) * character;

            line.at[i] = start + (arrived + from->periodUs - 1) / from->periodUs * from->periodUs;
        }
    }
    uint64_t end = line.at[line.count - 1] + 200000;
    for (; line.now < end; line.now += 50)
        OK(mbm_server_poll(&server));
    for (unsigned i = 0; i < quantity && line.answers == 1; i++)
        assert_int_equal(words[i], (uint16_t)((i * 14 + quantity) << 8 & 0xFF00) |
                                       (uint8_t)((2 * i + 1) * 7 + quantity));
    return line.answers == 1 && line.other == 0;
}

TEST(requests_of_every_length_in_blocks_are_answered)
{
    const char *path = getenv("MBM_FAULT_TABLE");
    FILE *table = path ? fopen(path, "w") : NULL;

    if (table)
        fprintf(table, "| the UART hands over | delay | 1200 baud | 9600 | 19200 | 115200 |\n"
                       "|---|---|---|---|---|---|\n");
    for (unsigned i = 0; i < sizeof uarts / sizeof uarts[0]; i++) {
        if (table)
            fprintf(table, "| %s | %s |", uarts[i].name, uarts[i].delay);
        for (unsigned r = 0; r < sizeof rates / sizeof rates[0]; r++) {
            unsigned answered = 0;

            for (unsigned quantity = 1; quantity <= MOST; quantity++)
                answered += (unsigned)is_answered(&uarts[i], rates[r], quantity);
            assert_int_equal(answered, MOST);
            if (table)
                fprintf(table, " %u |", answered);
        }
        if (table)
            fprintf(table, "\n");
    }
    if (table)
        (void)fclose(table);
}

/* --- a ring that a DMA callback fills, as docs/port.md recommends */

static uint8_t ring_storage[MBM_MAX_FRAME + 1];

static int16_t receive_from_ring(void *context, uint8_t *bytes, uint16_t capacity)
{
    return (int16_t)mbm_ring_read(&line.ring, bytes, capacity);
}

/* The callback comes when half of the DMA's buffer is full, and when the line is idle. */
TEST(a_ring_that_a_dma_callback_fills_gives_every_request)
{
    const mbm_port port = {.read = receive_from_ring, .write = transmit, .micros = micros};
    const uint32_t baud = 9600, character = BITS * 1000000u / baud;

    for (unsigned half = 8; half <= 128; half *= 2)
        for (unsigned quantity = 1; quantity <= MOST; quantity++) {
            uint8_t request[300] = {
                UNIT, 0x10, 0, 0, 0, (uint8_t)quantity, (uint8_t)(2 * quantity)};
            const size_t length = seal(request, 7 + 2 * quantity);
            uint64_t until;
            size_t put = 0;

            begin(baud);
            memset(&line, 0, sizeof line);
            OK(mbm_ring_begin(&line.ring, ring_storage, sizeof ring_storage));
            OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
            OK(mbm_server_setBaudRate(&server, baud));
            until = (uint64_t)(length + 1) * character + 200000;
            for (; line.now < until; line.now += 100) {
                const size_t arrived = line.now / character;

                if (put + half <= length && arrived >= put + half) {
                    assert_int_equal(mbm_ring_write(&line.ring, request + put, (uint16_t)half),
                                     half);
                    put += half;
                }
                if (put < length && arrived > length) {
                    (void)mbm_ring_write(&line.ring, request + put, (uint16_t)(length - put));
                    put = length;
                }
                OK(mbm_server_poll(&server));
            }
            assert_int_equal(line.answers, 1);
        }
}

/* --- the same bytes for libmodbus's server, over a terminal */

static modbus_t *theirs;
static modbus_mapping_t *cells;

static void *serve_one(void *unused)
{
    uint8_t request[MODBUS_RTU_MAX_ADU_LENGTH];
    const int length = modbus_receive(theirs, request);

    if (length > 0)
        (void)modbus_reply(theirs, request, length, cells);
    return unused;
}

/* Writes a request as an adapter with a latency timer hands it over. `poll_ours` is called between
 * the blocks; it may be NULL. Returns whether the answer has come. */
static int answers_through_adapter(int fd, void (*poll_ours)(void))
{
    const struct timespec period = {0, 16000000};
    uint8_t request[300] = {UNIT, 0x10, 0, 0, 0, 20, 40}, answer[8];
    const size_t length = seal(request, 47), block = 14;
    size_t sent, got = 0;

    for (sent = 0; sent < length; sent += block) {
        const size_t count = length - sent < block ? length - sent : block;

        assert_int_equal(write(fd, request + sent, count), count);
        (void)nanosleep(&period, NULL);
        if (poll_ours)
            poll_ours();
    }
    for (unsigned tries = 0; tries < 1000 && got < sizeof answer; tries++) {
        struct pollfd readable = {fd, POLLIN, 0};

        if (poll_ours)
            poll_ours();
        if (poll(&readable, 1, 10) == 1)
            got += (size_t)read(fd, answer + got, sizeof answer - got);
    }
    return got == sizeof answer && crc16(answer, sizeof answer) == 0 && answer[1] == 0x10;
}

static void poll_server(void)
{
    for (unsigned i = 0; i < 5; i++)
        OK(mbm_server_poll(&server));
}

TEST(libmodbus_and_mbm_answer_a_request_through_an_adapter)
{
    pthread_t thread;
    mbm_tty tty;
    pty ours;

    pty_open(&ours);
    theirs = modbus_new_rtu(ours.path, 9600, 'N', 8, 1);
    cells = modbus_mapping_new(0, 0, MOST, 0);
    assert_int_equal(modbus_set_slave(theirs, UNIT), 0);
    assert_int_equal(modbus_connect(theirs), 0);
    assert_int_equal(modbus_set_byte_timeout(theirs, 9, 0), 0);
    assert_int_equal(pthread_create(&thread, NULL, serve_one, NULL), 0);
    assert_true(answers_through_adapter(ours.ours, NULL));
    assert_int_equal(pthread_join(thread, NULL), 0);
    modbus_mapping_free(cells);
    modbus_close(theirs);
    modbus_free(theirs);
    pty_close(&ours);

    begin(9600);
    memset(&tty, 0, sizeof tty);
    pty_open(&ours);
    assert_int_equal(mbm_tty_open(&tty, ours.path, 9600, 'N', 1), 0);
    mbm_port port = mbm_tty_port(&tty);
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    OK(mbm_server_setBaudRate(&server, 9600));
    OK(mbm_server_setReceiveLatency(&server, 9000)); /* the machine may be busy */
    assert_true(answers_through_adapter(ours.ours, poll_server));
    mbm_tty_close(&tty);
    pty_close(&ours);
}

TEST(a_server_that_waits_tells_a_program_how_long)
{
    const uint32_t silence = 38500000 / 9600 + 1;
    const uint32_t missing = (247 + 10) * (BITS * 1000000u / 9600 + 1);
    static const int32_t latencies[] = {-1, 0, 20, 65535}; /* in ms; -1 is the default */

    for (size_t i = 0; i < sizeof latencies / sizeof *latencies; i++) {
        const uint32_t latency = 1000 * (uint32_t)(latencies[i] < 0 ? 50 : latencies[i]);
        const uint32_t wait = silence + missing + latency;

        begin(9600);
        if (latencies[i] >= 0)
            OK(mbm_server_setReceiveLatency(&server, (uint16_t)latencies[i]));
        memset(&line, 0, sizeof line);
        memcpy(line.bytes, "\x11\x10\0\0\0\x7B\xF6\0", 8);
        line.count = 8;
        OK(mbm_server_poll(&server));
        line.now += 5000;
        OK(mbm_server_poll(&server));
        assert_int_equal(mbm_server_pollDelay(&server), wait - 5000);
        line.now += wait - 5001;
        OK(mbm_server_poll(&server));
        assert_int_equal(mbm_server_pollDelay(&server), 1);
        line.now++;
        OK(mbm_server_poll(&server));
        assert_int_equal(mbm_server_pollDelay(&server), 0xFFFFFFFF);
    }
}
