/* A peer that never stops sending: a port that has bytes for every read, and takes what is sent. */
#ifndef TALKER_H
#define TALKER_H

#include "mbm.h"

#include <stddef.h>
#include <stdint.h>
#include <string.h>

typedef struct talk {
    const char *what;
    const uint8_t *bytes;
    size_t count;
} talk;

typedef struct talker {
    const talk *says; /* again and again */
    size_t at;
    size_t piece;        /* how many bytes a read returns at most */
    size_t each;         /* bytes of a connection until it is lost; 0: no limit */
    size_t left;         /* how many of them are left */
    unsigned reads;      /* since the last poll began */
    unsigned most_reads; /* the most reads of one poll */
    uint32_t *clock;
    uint32_t step; /* microseconds that each look at the clock takes */
    size_t sent;
    int is_lost, is_stuck; /* it takes nothing that is sent */
} talker;

#define BYTES(text) (const uint8_t *)(text), sizeof(text) - 1

__attribute__((unused)) static const talk TALKS[] = {
    {"zeros", BYTES("\0")},
    {"a text", BYTES("Port already in use\r\n")},
    {"beginnings of ASCII frames", BYTES(":")},
    {"an ASCII reply", BYTES(":0703021234AE\r\n")},
    {"half an ASCII reply", BYTES(":0703021234\r\n")},
    {"an RTU reply", BYTES("\x07\x03\x02\x12\x34\x3D\x33")},
    {"another unit's RTU reply", BYTES("\x05\x03\x02\x12\x34\x44\xF3")},
    {"half an RTU reply", BYTES("\x07\x03\x02\x12")},
    {"a damaged RTU reply", BYTES("\x07\x03\x02\x12\x34\xFF\xFF")},
    {"the number of another request", BYTES("\x7F\xFF\0\0\0\5\7\3\2\x12\x34")},
    {"another unit with the right number", BYTES("\0\0\0\0\0\5\5\3\2\x12\x34")},
    {"half a frame of TCP", BYTES("\0\0\0\0\0\xFE\7")},
    {"headers that announce more than a frame", BYTES("\0\0\0\0\xFF\xFF\7")},
    {"frames of TCP without a PDU", BYTES("\0\0\0\0\0\1\7")},
};

static inline int16_t talker_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    talker *t = (talker *)context;
    size_t count = t->piece < capacity ? t->piece : capacity, i;

    t->reads++;
    if (t->each > 0 && t->left == 0)
        t->is_lost = 1;
    if (t->is_lost)
        return -1;
    if (t->each > 0) {
        count = count < t->left ? count : t->left;
        t->left -= count;
    }
    for (i = 0; i < count; i++, t->at++)
        bytes[i] = t->says->bytes[t->at % t->says->count];
    return (int16_t)count;
}

static inline int16_t talker_write(void *context, const uint8_t *bytes, uint16_t length)
{
    talker *t = (talker *)context;

    (void)bytes;
    if (t->is_lost)
        return -1;
    if (t->is_stuck)
        return 0;
    t->sent += length;
    return (int16_t)length;
}

static inline uint32_t talker_micros(void *context)
{
    const talker *t = (const talker *)context;

    return *t->clock += t->step;
}

/* The port of a talker that says this, with a clock of the test. */
static inline mbm_port talker_begin(talker *t, const talk *says, size_t piece, uint32_t *clock)
{
    const mbm_port port = {
        .context = t, .read = talker_read, .write = talker_write, .micros = talker_micros};

    memset(t, 0, sizeof *t);
    t->says = says;
    t->piece = piece;
    t->clock = clock;
    return port;
}

/* Notes that a poll begins, and that it has ended. */
static inline void talker_poll_begins(talker *t)
{
    t->reads = 0;
}

static inline void talker_poll_ends(talker *t)
{
    if (t->reads > t->most_reads)
        t->most_reads = t->reads;
}

#endif
