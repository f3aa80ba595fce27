#include "faults.h"
#include "crc.h"
#include "mbm.h"
#include "report.h"

#include <string.h>

static size_t after_bytes(uint8_t *wire, const void *bytes, size_t count, const uint8_t *reply,
                          size_t length)
{
    memcpy(wire, bytes, count);
    memcpy(wire + count, reply, length);
    return count + length;
}

static size_t leading_zero(uint8_t *wire, const uint8_t *reply, size_t length)
{
    return after_bytes(wire, "\0", 1, reply, length);
}

static size_t five_bytes_of_noise(uint8_t *wire, const uint8_t *reply, size_t length)
{
    return after_bytes(wire, "\xFF\x00\x55\x11\x99", 5, reply, length);
}

/* Unit, function and byte count as in the reply. */
static size_t noise_like_our_header(uint8_t *wire, const uint8_t *reply, size_t length)
{
    return after_bytes(wire, reply, 3, reply, length);
}

/* A good frame with other words, then the reply. */
static size_t after_frame(uint8_t *wire, uint8_t unit, uint8_t function, uint8_t registers,
                          const uint8_t *reply, size_t length)
{
    uint8_t frame[64];
    unsigned i;

    frame[0] = unit;
    frame[1] = function;
    frame[2] = (uint8_t)(2 * registers);
    for (i = 0; i < frame[2]; i++)
        frame[3 + i] = (uint8_t)(0xE0 + i);
    return after_bytes(wire, frame, seal(frame, 3u + frame[2]), reply, length);
}

static size_t foreign_reply(uint8_t *wire, const uint8_t *reply, size_t length)
{
    return after_frame(wire, UNIT + 1, 3, 10, reply, length);
}

static size_t reply_of_another_function(uint8_t *wire, const uint8_t *reply, size_t length)
{
    return after_frame(wire, UNIT, 4, 10, reply, length);
}

static size_t late_reply_of_another_length(uint8_t *wire, const uint8_t *reply, size_t length)
{
    return after_frame(wire, UNIT, 3, 9, reply, length);
}

static size_t bad_crc(uint8_t *wire, const uint8_t *reply, size_t length)
{
    memcpy(wire, reply, length);
    wire[length / 2] ^= 0x40;
    return length;
}

static size_t truncated(uint8_t *wire, const uint8_t *reply, size_t length)
{
    memcpy(wire, reply, length);
    return length - 7;
}

const fault faults[] = {
    {"a leading 0x00 is skipped", leading_zero, MBM_OK, 1, 0},
    {"5 bytes of noise are skipped", five_bytes_of_noise, MBM_OK, 1, 0},
    {"noise that looks like our header is skipped", noise_like_our_header, MBM_OK, 1, 0},
    {"a foreign unit's reply is skipped", foreign_reply, MBM_OK, 0, 1},
    {"a reply of another function is skipped", reply_of_another_function, MBM_OK, 0, 1},
    {"a late reply of another length is skipped", late_reply_of_another_length, MBM_OK, 0, 1},
    {"after a bad CRC the next request is right", bad_crc, MBM_INVALID_CRC, 0, 0},
    {"after a truncated reply the next request is right", truncated, MBM_RESPONSE_TIMED_OUT, 0, 0},
};
const unsigned fault_count = sizeof faults / sizeof faults[0];
