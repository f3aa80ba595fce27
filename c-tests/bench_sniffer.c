/* Runs a sniffer on the bytes of a line, fed byte by byte and frame by frame, for
 * callgrind, which scripts/bench/speed starts. Each case checks the number of events, so
 * that a sniffer that finds less is not taken for a faster one. */
#include "crc.h"
#include "mbm.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <valgrind/callgrind.h>

enum { UNIT = 17, EXCHANGES = 100, MICROS = 87, SILENCE = 1750, MOST = 600 };

/* The bytes of a line and the time at which each of them arrives. */
typedef struct line {
    uint8_t bytes[EXCHANGES * MOST];
    uint32_t times[EXCHANGES * MOST];
    size_t length;
    uint32_t now;
    uint32_t each, between; /* microseconds that a byte takes, and of silence after a frame */
} line;

typedef struct events {
    unsigned of_kind[7];
    size_t reported; /* bytes of all events */
} events;

static line bus;
static mbm_sniffer sniffer;
static uint8_t buffer[2 * MBM_MAX_ASCII_FRAME];

static void put(const uint8_t *bytes, size_t length)
{
    size_t i;

    for (i = 0; i < length; i++) {
        bus.now += bus.each;
        bus.bytes[bus.length] = bytes[i];
        bus.times[bus.length++] = bus.now;
    }
    bus.now += bus.between;
}

static void put_rtu(const uint8_t *pdu, size_t length, unsigned damage)
{
    uint8_t frame[MOST];

    frame[0] = UNIT;
    memcpy(frame + 1, pdu, length);
    length = seal(frame, length + 1);
    frame[length / 2] ^= (uint8_t)damage;
    put(frame, length);
}

static void put_tcp(const uint8_t *pdu, size_t length)
{
    uint8_t frame[MOST] = {0, 1, 0, 0, 0, (uint8_t)(length + 1), UNIT};

    memcpy(frame + 7, pdu, length);
    put(frame, length + 7);
}

static void put_ascii(const uint8_t *pdu, size_t length)
{
    char text[MOST] = ":";
    uint8_t sum = UNIT;
    size_t i, at = 1;

    at += (size_t)snprintf(text + at, sizeof text - at, "%02X", UNIT);
    for (i = 0; i < length; i++) {
        sum = (uint8_t)(sum + pdu[i]);
        at += (size_t)snprintf(text + at, sizeof text - at, "%02X", pdu[i]);
    }
    at += (size_t)snprintf(text + at, sizeof text - at, "%02X\r\n", (uint8_t)-sum);
    put((const uint8_t *)text, at);
}

/* Appends a request of function 03 for `registers` registers, and its reply. */
static void exchange(char framing, unsigned registers, unsigned damage)
{
    uint8_t request[5] = {3, 0, 7, 0, (uint8_t)registers}, reply[2 + 250] = {3};
    size_t length = 2 + 2 * registers, i;

    reply[1] = (uint8_t)(2 * registers);
    for (i = 2; i < length; i++)
        reply[i] = (uint8_t)(i * 37 + bus.length);
    if (framing == 'T') {
        put_tcp(request, sizeof request);
        put_tcp(reply, length);
    } else if (framing == 'A') {
        put_ascii(request, sizeof request);
        put_ascii(reply, length);
    } else {
        put_rtu(request, sizeof request, 0);
        put_rtu(reply, length, damage);
    }
}

static void noise(size_t count)
{
    uint32_t state = 1;
    uint8_t byte;

    for (; count > 0; count--) {
        state = state * 1664525u + 1013904223u;
        byte = (uint8_t)(state >> 24);
        put(&byte, 1);
    }
}

static void collect_events(events *seen, uint32_t now)
{
    mbm_event event;

    while (mbm_sniffer_next(&sniffer, now, &event)) {
        seen->of_kind[event.kind]++;
        seen->reported += event.length;
    }
}

/* Feeds the line in pieces of `piece` bytes. 0 means frame by frame. */
static events feed(uint8_t framing, size_t piece)
{
    events seen = {{0}, 0};
    size_t at = 0, count;

    if (mbm_sniffer_begin(&sniffer, framing, buffer, sizeof buffer) != MBM_OK ||
        mbm_sniffer_setBaudRate(&sniffer, 115200) != MBM_OK)
        exit(1);
    CALLGRIND_TOGGLE_COLLECT;
    while (at < bus.length) {
        for (count = 1; count != piece && at + count < bus.length; count++)
            if (!piece && bus.times[at + count] - bus.times[at + count - 1] > bus.each)
                break;
        at += mbm_sniffer_feed(&sniffer, MBM_DIRECTION_BOTH, bus.bytes + at, (uint16_t)count,
                               bus.times[at + count - 1]);
        collect_events(&seen, bus.times[at - 1]);
    }
    CALLGRIND_TOGGLE_COLLECT;
    collect_events(&seen, bus.now + 500000);
    return seen;
}

static void clear(uint32_t each, uint32_t between)
{
    bus.length = 0;
    bus.now = 0;
    bus.each = each;
    bus.between = between;
}

/* Counts the instructions of one case. The sniffer must report all bytes. Unless `wanted`
 * is 0, it must report that number of requests and of replies, `damaged` of them with a bad
 * CRC. */
static void count(const char *name, const char *how, uint8_t kind, size_t piece, unsigned wanted,
                  unsigned damaged)
{
    char title[200];
    events seen;

    CALLGRIND_ZERO_STATS;
    seen = feed(kind, piece);
    snprintf(title, sizeof title, "%s\t%s\t%zu", name, how, bus.length);
    CALLGRIND_DUMP_STATS_AT(title);
    if (seen.reported != bus.length ||
        (wanted && (seen.of_kind[MBM_EVENT_REQUEST] != wanted ||
                    seen.of_kind[MBM_EVENT_REPLY] + seen.of_kind[MBM_EVENT_BAD_CRC] != wanted ||
                    seen.of_kind[MBM_EVENT_BAD_CRC] != damaged))) {
        fprintf(stderr,
                "bench_sniffer: %s: %u requests, %u replies, %u damaged, %zu of %zu bytes\n", title,
                seen.of_kind[MBM_EVENT_REQUEST], seen.of_kind[MBM_EVENT_REPLY],
                seen.of_kind[MBM_EVENT_BAD_CRC], seen.reported, bus.length);
        exit(1);
    }
}

static void exchanges(char framing, unsigned registers, unsigned damage)
{
    unsigned i;

    clear(MICROS, SILENCE);
    for (i = 0; i < EXCHANGES; i++)
        exchange(framing, registers, damage);
}

int main(void)
{
    exchanges('R', 10, 0);
    count("RTU, 03 of ten registers", "byte by byte", MBM_FRAMING_RTU, 1, EXCHANGES, 0);
    count("RTU, 03 of ten registers", "frame by frame", MBM_FRAMING_RTU, 0, EXCHANGES, 0);
    exchanges('R', 125, 0);
    count("RTU, 03 of 125 registers", "byte by byte", MBM_FRAMING_RTU, 1, EXCHANGES, 0);
    exchanges('R', 10, 0x40);
    count("RTU, 03 of ten registers, each reply damaged", "byte by byte", MBM_FRAMING_RTU, 1,
          EXCHANGES, EXCHANGES);
    clear(MICROS, 0);
    noise(10000);
    count("RTU, noise that never pauses", "byte by byte", MBM_FRAMING_RTU, 1, 0, 0);
    exchanges('T', 10, 0);
    count("TCP, 03 of ten registers", "byte by byte", MBM_FRAMING_TCP, 1, EXCHANGES, 0);
    exchanges('A', 10, 0);
    count("ASCII, 03 of ten registers", "byte by byte", MBM_FRAMING_ASCII, 1, EXCHANGES, 0);
    exchanges('A', 125, 0);
    count("ASCII, 03 of 125 registers", "byte by byte", MBM_FRAMING_ASCII, 1, EXCHANGES, 0);
    return 0;
}
