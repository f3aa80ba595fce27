/* Five reads by a sketch on a simulated Uno. The first meets a fault: a bad wire, an absent
 * device, or a device that answers with exceptions. */
#include "crc.h"
#include "sketch.h"
#include "test.h"

#include "mbm.h"

enum { UNIT = 1, READS = 5, REGISTERS = 10 };

typedef struct fault {
    const char *name;
    void (*play)(wire *w, const uint8_t *request);
    const char *expected; /* '.' right data, 'F' a failed call */
    uint8_t status;       /* of the first read */
} fault;

/* Sends bytes and, right after them, the right reply. */
static void reply_after(wire *w, const uint8_t *request, const void *bytes, size_t length)
{
    uint8_t reply[FRAME];

    wire_play(w, MS, bytes, length);
    wire_play(w, length ? 0 : MS, reply, peer_right_reply(reply, request));
}

static void right(wire *w, const uint8_t *request)
{
    reply_after(w, request, "", 0);
}

static void leading_zero(wire *w, const uint8_t *request)
{
    reply_after(w, request, "\0", 1);
}

static void five_bytes_of_noise(wire *w, const uint8_t *request)
{
    reply_after(w, request, "\xFF\x00\x55\x01\x99", 5);
}

static void noise_like_our_header(wire *w, const uint8_t *request)
{
    reply_after(w, request, "\x01\x03\x14", 3);
}

/* Sends the right reply to another request, then the right reply to ours. */
static void reply_after_reply_to(wire *w, const uint8_t *request, uint8_t unit, uint8_t function,
                                 uint8_t quantity)
{
    const uint8_t other[] = {unit, function, 3, 0x21, 0, quantity};
    uint8_t reply[FRAME];

    reply_after(w, request, reply, peer_right_reply(reply, other));
}

static void foreign_reply(wire *w, const uint8_t *request)
{
    reply_after_reply_to(w, request, UNIT + 1, 3, REGISTERS);
}

static void reply_of_another_function(wire *w, const uint8_t *request)
{
    reply_after_reply_to(w, request, UNIT, 4, REGISTERS);
}

static void late_reply_of_another_length(wire *w, const uint8_t *request)
{
    reply_after_reply_to(w, request, UNIT, 3, REGISTERS - 1);
}

static void a_pause_inside(wire *w, const uint8_t *request)
{
    uint8_t reply[FRAME];
    size_t length = peer_right_reply(reply, request);

    wire_play(w, MS, reply, 9);
    wire_play(w, 30 * MS, reply + 9, length - 9);
}

/* More than the board's receive buffer of 64 bytes. */
static void noise_of_100_bytes(wire *w, const uint8_t *request)
{
    uint8_t noise[100];
    unsigned i, state = 12345;

    for (i = 0; i < sizeof noise; i++) {
        state = state * 1103515245u + 12345u;
        noise[i] = (uint8_t)(state >> 16);
    }
    reply_after(w, request, noise, sizeof noise);
}

static void bad_crc(wire *w, const uint8_t *request)
{
    uint8_t reply[FRAME];
    size_t length = peer_right_reply(reply, request);

    reply[length - 1] ^= 0x40;
    wire_play(w, MS, reply, length);
}

static void truncated(wire *w, const uint8_t *request)
{
    uint8_t reply[FRAME];

    wire_play(w, MS, reply, peer_right_reply(reply, request) - 7);
}

static void one_byte_lost(wire *w, const uint8_t *request)
{
    uint8_t reply[FRAME];
    size_t length = peer_right_reply(reply, request);

    memmove(reply + 8, reply + 9, length - 9);
    wire_play(w, MS, reply, length - 1);
}

static void no_reply(wire *w, const uint8_t *request) {}

static void exception(wire *w, const uint8_t *request, uint8_t code, uint8_t damage)
{
    uint8_t reply[5] = {UNIT, (uint8_t)(request[1] | 0x80), code};
    size_t length = seal(reply, 3);

    reply[4] ^= damage;
    wire_play(w, MS, reply, length);
}

static void exception_06(wire *w, const uint8_t *request)
{
    exception(w, request, 6, 0);
}

static void exception_with_bad_crc(wire *w, const uint8_t *request)
{
    exception(w, request, 2, 0x10);
}

static const fault faults[] = {
    {"no fault", right, ".....", MBM_OK},
    {"leading 0x00", leading_zero, ".....", MBM_OK},
    {"5 bytes of noise before the reply", five_bytes_of_noise, ".....", MBM_OK},
    {"100 bytes of noise before the reply", noise_of_100_bytes, ".....", MBM_OK},
    {"noise that looks like our header", noise_like_our_header, ".....", MBM_OK},
    {"a foreign unit's reply, then ours", foreign_reply, ".....", MBM_OK},
    {"a reply of another function, then ours", reply_of_another_function, ".....", MBM_OK},
    {"late reply of another length, then ours", late_reply_of_another_length, ".....", MBM_OK},
    {"cut in two by a pause of 30 ms", a_pause_inside, ".....", MBM_OK},
    {"exception 06", exception_06, "F....", MBM_SERVER_DEVICE_BUSY},
    {"no reply", no_reply, "F....", MBM_RESPONSE_TIMED_OUT},
    {"bad CRC", bad_crc, "F....", MBM_INVALID_CRC},
    {"truncated", truncated, "F....", MBM_RESPONSE_TIMED_OUT},
    {"one byte lost", one_byte_lost, "F....", MBM_RESPONSE_TIMED_OUT},
    {"exception with bad CRC", exception_with_bad_crc, "F....", MBM_INVALID_CRC},
};

static void play_first(wire *w, const uint8_t *frame, size_t length)
{
    const fault *f = w->context;

    assert_int_equal(length, 8);
    assert_int_equal(crc16(frame, 8), 0);
    if (w->frames == 1)
        f->play(w, frame);
    else
        right(w, frame);
}

/* The report in the sketch's RAM. */
typedef struct report {
    uint8_t status[READS];
    uint16_t words[READS][REGISTERS];
} report;

/* The folder of the sketches: plain, or with shortened calls. */
static const char *place = "uno";

static board *start(const char *sketch)
{
    const char *folder = getenv("MBM_SKETCHES");
    char path[200];

    snprintf(path, sizeof path, "%s/%s/%s.elf", folder ? folder : "build/avr", place, sketch);
    return board_new(path, "atmega328p");
}

static report run(wire_device device, void *context)
{
    board *b = start("Probe");
    uint16_t at = board_symbol(b, "report");
    report r;
    unsigned n, i;

    board_uart(b, '0', device, context);
    assert_true(board_run_until(b, at, 1, 5000 * (uint64_t)MS));
    at++;
    for (n = 0; n < READS; n++)
        r.status[n] = board_byte(b, at++);
    for (n = 0; n < READS; n++)
        for (i = 0; i < REGISTERS; i++, at = (uint16_t)(at + 2))
            r.words[n][i] = board_word(b, at);
    board_free(b);
    return r;
}

/* Returns '.' for right data, 'F' for a failed call, 'W' for success with wrong data. */
static char outcome(const report *r, unsigned n, uint16_t (*value)(unsigned address))
{
    unsigned i;

    if (r->status[n] != MBM_OK)
        return 'F';
    for (i = 0; i < REGISTERS; i++)
        if (r->words[n][i] != value(100 * (n + 1) + i))
            return 'W';
    return '.';
}

TEST(no_fault_costs_more_reads_than_expected)
{
    unsigned i, n, worse = 0;

    for (i = 0; i < COUNT(faults); i++) {
        fault f = faults[i];
        report r = run(play_first, &f);
        char found[READS + 1] = "";

        for (n = 0; n < READS; n++)
            found[n] = outcome(&r, n, peer_value);
        printf("%-42s %s  0x%02X\n", f.name, found, r.status[0]);
        if (strcmp(found, f.expected) != 0 || r.status[0] != f.status) {
            printf("    expected %s, 0x%02X\n", f.expected, f.status);
            worse++;
        }
    }
    assert_int_equal(worse, 0);
}

TEST(a_sketch_linked_with_mrelax_passes_every_fault_too)
{
    place = "uno-relax";
    no_fault_costs_more_reads_than_expected();
    place = "uno";
}

TEST(an_absent_server_is_a_timeout)
{
    report r = run(NULL, NULL);
    unsigned n;

    for (n = 0; n < READS; n++)
        assert_int_equal(r.status[n], MBM_RESPONSE_TIMED_OUT);
}

static uint16_t held(unsigned address)
{
    return server_pattern(address);
}

TEST(a_servers_exceptions_are_returned)
{
    report r;
    server s;
    unsigned n;

    server_start(&s, UNIT);
    s.mapping->nb_registers = 310; /* the last two reads are beyond the end */
    r = run(peer_libmodbus, &s);
    for (n = 0; n < 3; n++)
        assert_int_equal(outcome(&r, n, held), '.');
    for (n = 3; n < READS; n++) {
        assert_int_equal(r.status[n], MBM_ILLEGAL_DATA_ADDRESS);
        /* A failed read keeps the values of the reads before. */
        assert_int_equal(r.words[n][0], server_pattern(300));
    }
    server_stop(&s);
}

/* The library must read bytes as fast as the line delivers them. */
TEST(a_reply_of_64_registers_at_115200_baud_arrives_whole)
{
    board *b = start("FullSpeed");
    uint16_t at = board_symbol(b, "report");
    unsigned n;

    board_uart(b, '0', peer_right, NULL);
    assert_true(board_run_until(b, at, 1, 2000 * MS));
    for (n = 0; n < 3; n++)
        assert_int_equal(board_byte(b, (uint16_t)(at + 1 + n)), MBM_OK);
    assert_int_equal(board_byte(b, (uint16_t)(at + 4)), 0);
    board_free(b);
}
