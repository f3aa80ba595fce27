#define _GNU_SOURCE
#include "device.h"
#include "crc.h"
#include "mbm.h"
#include "report.h"

#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { MOST = 256 };

static uint64_t now(void)
{
    struct timespec time;

    clock_gettime(CLOCK_MONOTONIC, &time);
    return (uint64_t)time.tv_sec * 1000000u + (uint64_t)time.tv_nsec / 1000u;
}

static void answer(device *d, const uint8_t *frame, size_t length)
{
    uint8_t reply[MOST], wire[2 * MOST];
    request asked;
    size_t size;

    d->number++;
    if (d->number < sizeof d->at / sizeof d->at[0])
        d->at[d->number] = now();
    if (!request_parse(&asked, frame, length)) {
        d->malformed++;
        return;
    }
    if (asked.unit != UNIT && asked.unit != 0)
        return;
    if (asked.unit == 0) {
        asked.unit = UNIT;
        model_answer(&d->memory, &asked, reply);
        return;
    }
    size = model_answer(&d->memory, &asked, reply);
    if (d->fault && d->number == d->faulty)
        size = d->fault(wire, reply, size);
    else
        memcpy(wire, reply, size);
    if (write(d->line.theirs, wire, size) != (ssize_t)size)
        abort();
}

static void *serve(void *argument)
{
    device *d = (device *)argument;
    uint8_t frame[MOST];
    size_t have = 0;

    for (;;) {
        struct pollfd waits[2] = {{d->line.theirs, POLLIN, 0}, {d->stop[0], POLLIN, 0}};
        ssize_t count;
        int size;

        poll(waits, 2, -1);
        if (waits[1].revents)
            return NULL;
        count = read(d->line.theirs, frame + have, sizeof frame - have);
        if (count < 0)
            abort();
        have += (size_t)count;
        size = request_size(frame, have);
        if (size < 0 || have == sizeof frame) {
            d->malformed++;
            have = 0;
        } else if (size > 0 && have >= (size_t)size) {
            answer(d, frame, have);
            have = 0;
        }
    }
}

void device_start(device *d, unsigned faulty, device_fault spoil)
{
    memset(d, 0, sizeof *d);
    d->faulty = faulty;
    d->fault = spoil;
    pty_open(&d->line);
    model_start(&d->memory);
    if (pipe(d->stop) || pthread_create(&d->thread, NULL, serve, d)) {
        perror("device");
        abort();
    }
}

void device_stop(device *d)
{
    if (write(d->stop[1], "", 1) != 1)
        abort();
    pthread_join(d->thread, NULL);
    close(d->stop[0]);
    close(d->stop[1]);
    pty_close(&d->line);
}

/* --- what a bad wire makes of a reply --- */

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
