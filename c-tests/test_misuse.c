/* Sequences of calls for which fuzz/fuzz_targets/c_api.rs found a fault. */
#include "mbm.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

static uint32_t clock_now;
static uint32_t reads;
static uint8_t flood;

static uint32_t port_micros(void *context)
{
    (void)context;
    return clock_now;
}

static int16_t port_write(void *context, const uint8_t *bytes, uint16_t length)
{
    (void)context;
    (void)bytes;
    return (int16_t)length;
}

/* A peer that never stops sending the same byte. */
static int16_t flooded_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    (void)context;
    assert_true(++reads < 10000);
    memset(bytes, flood, capacity);
    return (int16_t)capacity;
}

static const mbm_port flooded = {NULL, flooded_read, port_write, port_micros,
                                 NULL, NULL,         NULL,       NULL};

TEST(a_poll_of_an_ascii_server_ends_while_a_peer_floods)
{
    static mbm_server server;
    static mbm_unit unit;
    static uint8_t frame[MBM_MAX_ASCII_FRAME];
    static const uint8_t floods[] = {'x', ':', '0', '\r', '\n'};

    OK(mbm_server_beginAscii(&server, &flooded, &unit, 1, frame, sizeof frame));
    for (size_t i = 0; i < sizeof floods; i++) {
        flood = floods[i];
        reads = 0;
        OK(mbm_server_poll(&server));
    }
}

/* Sends a request of `length` bytes in a buffer of `capacity` bytes, into which the
 * response must fit. */
static void answers_with_exception_04(uint8_t framing, mbm_unit *unit, const char *request,
                                      uint16_t length, uint16_t capacity)
{
    uint8_t *frame = malloc(capacity);
    uint16_t response = 0xFFFF;
    const uint16_t pdu = framing == MBM_FRAMING_TCP ? 7 : 1;

    assert_non_null(frame);
    memcpy(frame, request, length);
    OK(mbm_unit_respond(unit, 1, NULL, FRAMING(framing), frame, length, capacity, &response));
    assert_true(response <= capacity);
    assert_int_equal(response, framing == MBM_FRAMING_TCP ? 9 : 5);
    assert_int_equal(frame[pdu], (uint8_t)request[pdu] | 0x80);
    assert_int_equal(frame[pdu + 1], MBM_SERVER_DEVICE_FAILURE);
    free(frame);
}

TEST(a_response_longer_than_its_buffer_is_exception_04)
{
    static mbm_unit unit;
    static mbm_serverIdentification identification;
    static mbm_diagnostics diagnostics;

    OK(mbm_unit_serveIdentification(&unit, &identification));
    OK(mbm_unit_serveDiagnostics(&unit, &diagnostics));
    answers_with_exception_04(MBM_FRAMING_TCP, &unit, "\0\1\0\0\0\5\x11\x2B\x0E\1\0", 11, 12);
    answers_with_exception_04(MBM_FRAMING_TCP, &unit, "\0\1\0\0\0\2\x11\x0B", 8, 11);
    answers_with_exception_04(MBM_FRAMING_RTU, &unit, "\x11\x0B\x4C\x27", 4, 6);
}
