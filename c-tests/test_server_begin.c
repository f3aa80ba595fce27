/* A server that is begun again, baud rates that it takes, and how it handles noise. */
#include "crc.h"
#include "hooked_port.h"
#include "mbm.h"
#include "test.h"

#include <string.h>

typedef uint8_t (*begin)(mbm_server *, const mbm_port *, mbm_unit *, uint8_t, uint8_t *, uint16_t);

static mbm_server server;
static mbm_unit unit;
static mbm_registerTable table;
static uint16_t words[10];
static uint8_t frame[MBM_MAX_ASCII_FRAME];
static hooked_port wire;
static mbm_port port;

static void reset(void)
{
    memset(&server, 0, sizeof server);
    memset(&unit, 0, sizeof unit);
    memset(&table, 0, sizeof table);
    memset(&wire, 0, sizeof wire);
    memset(words, 0, sizeof words);
    wire.step = 100;
    port = hooked_port_of(&wire);
    unit.id = 17;
    table.words = words;
    table.size = 10;
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
}

fixture each_test = {reset, NULL};

/* Polls until a request that has arrived is answered. Returns the length of what was sent. */
static size_t answer(void)
{
    wire.length = 0;
    for (unsigned i = 0; i < 100; i++)
        OK(mbm_server_poll(&server));
    return wire.length;
}

static uint8_t never_drained(void *context)
{
    (void)context;
    return 0;
}

static void calls_within_the_driver_hook(int hook)
{
    if (hook == HOOK_POST) {
        IS(MBM_BUSY, mbm_server_poll(&server));
        IS(MBM_BUSY, mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    }
}

TEST(a_begin_while_a_response_is_sent_switches_the_driver_off)
{
    static const begin begins[] = {mbm_server_beginRtu, mbm_server_beginAscii, mbm_server_beginTcp,
                                   mbm_server_beginRtuOverTcp};
    mbm_port stuck = port, other = port;

    stuck.flush = never_drained;
    other.postTransmission = NULL;
    wire.within = calls_within_the_driver_hook;
    for (unsigned i = 0; i < COUNT(begins); i++) {
        memset(wire.called, 0, sizeof wire.called);
        OK(mbm_server_beginRtu(&server, &stuck, &unit, 1, frame, sizeof frame));
        hooked_port_arrive_rtu(&wire, 17, "\x03\0\0\0\1", 5);
        assert_int_equal(answer(), 7);
        assert_int_equal(wire.called[HOOK_PRE], 1);
        /* A begin that is refused changes nothing. */
        IS(MBM_INVALID_ARGUMENT, begins[i](&server, &port, &unit, 1, frame, 1));
        assert_int_equal(wire.called[HOOK_POST], 0);
        OK(begins[i](&server, &other, &unit, 1, frame, sizeof frame));
        assert_int_equal(wire.called[HOOK_POST], 1);
        OK(begins[i](&server, &port, &unit, 1, frame, sizeof frame));
        assert_int_equal(wire.called[HOOK_POST], 1);
    }
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    hooked_port_arrive_rtu(&wire, 17, "\x03\0\0\0\1", 5);
    assert_int_equal(answer(), 7);
}

TEST(a_baud_rate_is_refused_except_on_an_rtu_line)
{
    static const char request[] = ":110300000001EB\r\n", response[] = ":1103020000EA\r\n";

    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    OK(mbm_server_setBaudRate(&server, 115200));
    OK(mbm_server_setEchoDiscard(&server, 1));
    OK(mbm_server_setBaudRate(&server, 9600));
    OK(mbm_server_beginTcp(&server, &port, &unit, 1, frame, sizeof frame));
    IS(MBM_INVALID_ARGUMENT, mbm_server_setBaudRate(&server, 9600));
    OK(mbm_server_beginRtuOverTcp(&server, &port, &unit, 1, frame, sizeof frame));
    IS(MBM_INVALID_ARGUMENT, mbm_server_setBaudRate(&server, 9600));
    OK(mbm_server_beginAscii(&server, &port, &unit, 1, frame, sizeof frame));
    IS(MBM_INVALID_ARGUMENT, mbm_server_setBaudRate(&server, 115200));
    /* A pause of half a second between two characters does not end an ASCII frame. */
    for (unsigned i = 0; request[i] != '\0'; i++) {
        hooked_port_arrive(&wire, request + i, 1);
        OK(mbm_server_poll(&server));
        wire.now += 500000;
    }
    OK(mbm_server_poll(&server));
    assert_int_equal(wire.length, sizeof response - 1);
    assert_memory_equal(wire.sent, response, sizeof response - 1);
}

/* Noise without an end: 20000 bytes of it. */
static int16_t noisy_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    hooked_port *p = context;

    if (p->first > 20000)
        return 0;
    memset(bytes, 0x41, capacity);
    p->first += capacity;
    return (int16_t)capacity;
}

TEST(a_poll_reads_at_most_1200_bytes_of_noise)
{
    static const begin begins[] = {mbm_server_beginRtu, mbm_server_beginAscii,
                                   mbm_server_beginRtuOverTcp};
    mbm_port noisy = port;

    noisy.read = noisy_read;
    for (unsigned i = 0; i < COUNT(begins); i++) {
        OK(begins[i](&server, &noisy, &unit, 1, frame, 64));
        for (unsigned polls = 0; polls < 10; polls++) {
            wire.first = 0;
            OK(mbm_server_poll(&server));
            assert_in_range(wire.first, 1, 1200);
        }
    }
}

TEST(a_frame_that_fills_the_buffer_after_noise_is_answered)
{
    uint8_t bytes[120] = {0};

    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, 16));
    for (unsigned noise = 0; noise < 100; noise++) {
        memset(bytes, 0x5A, noise);
        memcpy(bytes + noise, "\x11\x10\0\0\0\2\4\1\2\3\4", 11);
        hooked_port_arrive(&wire, bytes, noise + seal(bytes + noise, 11));
        words[1] = 0;
        assert_int_equal(answer(), 8);
        assert_int_equal(words[1], 0x0304);
    }
}
