/* A server while noise arrives without silence. */
#include "crc.h"
#include "peer.h"
#include "rows.h"
#include "timing.h"

#include <stdio.h>
#include <string.h>

enum {
    FULL = 141,
    NOISE = 1000,
    KINDS = 4
}; /* the size of its buffer, the bytes after it is full, and the kinds of noise */

typedef struct flood {
    board *on;
    wire *bus;
    uint64_t rose, busy;            /* of polls with bytes to read */
    uint64_t began, longest, ready; /* of all polls */
    unsigned answers;
} flood;

static void takes_bytes(void *context, int level, uint64_t cycle)
{
    flood *f = context;

    if (!level)
        f->busy += cycle - f->rose;
    f->rose = cycle;
}

static void polls_once(void *context, int level, uint64_t cycle)
{
    flood *f = context;

    if (!level && f->began && cycle - f->began > f->longest) {
        f->longest = cycle - f->began;
        f->ready = cycle;
    }
    f->began = cycle;
}

static void is_answered(wire *w, const uint8_t *frame, size_t length)
{
    flood *f = w->context;

    f->answers += length == 25 && crc16(frame, length) == 0;
}

/* Byte `i` of a kind of noise. */
static uint8_t noise(unsigned kind, unsigned i)
{
    static const uint8_t request[8] = {1, 3, 0, 0, 0, 10, 0xC5, 0xCD};
    /* The start of a request that fills the buffer. */
    static const uint8_t beginning[7] = {1, 16, 0, 0, 0, 64, 128};
    static uint32_t random = 1;

    random = random * 1664525 + 1013904223;
    switch (kind) {
    case 0: return (uint8_t)(random >> 24);
    case 1: return 0;
    case 2: return request[i % 8]; /* requests without silence between them */
    default: return beginning[i % 7];
    }
}

void time_server_flood(void)
{
    span byte = {0}, deaf = {0};
    unsigned kind, i;

    for (kind = 0; kind < KINDS; kind++) {
        static flood f;
        uint8_t bytes[FULL + NOISE], request[FRAME] = {1, 3, 0, 0, 0, 10};
        uint16_t taken, before;

        memset(&f, 0, sizeof f);
        f.on = timed_board("uno", "TimeServeFlood");
        f.bus = board_uart(f.on, '0', is_answered, &f);
        board_watch_pin(f.on, 'B', 1, takes_bytes, &f);
        taken = board_symbol(f.on, "taken");
        if (!board_run(f.on, 10 * MS))
            give_up("a sketch crashed");
        for (i = 0; i < sizeof bytes; i++)
            bytes[i] = noise(kind, i);
        wire_play(f.bus, MS, bytes, sizeof bytes);
        while (f.bus->bytes_received < FULL)
            if (!board_run(f.on, 100))
                give_up("a sketch crashed");
        f.busy = 0;
        before = board_word(f.on, taken);
        while (f.bus->bytes_received < sizeof bytes)
            if (!board_run(f.on, 100))
                give_up("a sketch crashed");
        note(&byte, f.busy / (board_word(f.on, taken) - before));
        /* The server reads the rest, and the line is silent. */
        f.longest = 0;
        board_watch_pin(f.on, 'B', 0, polls_once, &f);
        wire_play(f.bus, 10 * MS, request, seal(request, 6));
        if (!board_run(f.on, 9 * MS))
            give_up("a sketch crashed");
        note(&deaf, f.ready - f.bus->received);
        if (!board_run(f.on, 30 * MS))
            give_up("a sketch crashed");
        if (board_word(f.on, taken) != sizeof bytes + 8 || f.answers != 1)
            fprintf(stderr, "timing: after noise %u, %u bytes were taken, %u requests answered\n",
                    kind, board_word(f.on, taken), f.answers);
        board_free(f.on);
    }
    row_cycles("a server: a byte of noise without silence (one lasts 1388 at 115200 baud)", &byte,
               1388);
    row_cycles("a server: from the last byte of noise, half t3.5 included, to the end of the poll "
               "that drops it",
               &deaf, 28000);
}
