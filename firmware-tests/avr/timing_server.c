/* The response time of a server. */
#include "crc.h"
#include "sketch.h"
#include "timing.h"

#include <stdio.h>
#include <string.h>

typedef struct asker {
    board *on;
    wire *bus;
    span gap[3]; /* from the last byte of a request to the first byte of its response */
    unsigned wrong;
} asker;

/* Reads ten registers, writes ten and reads 64 in turn, each time at another moment of the
 * sketch's loop. */
static void send_next(asker *a)
{
    static const uint8_t requests[3][7] = {
        {1, 3, 0, 0, 0, 10}, {1, 16, 0, 0, 0, 10, 20}, {1, 3, 0, 0, 0, 64}};
    uint8_t frame[FRAME] = {0};
    unsigned n = a->bus->frames;

    memcpy(frame, requests[n % 3], sizeof requests[0]);
    wire_play(a->bus, 10 * MS + n * 977, frame, seal(frame, n % 3 == 1 ? 27 : 6));
}

static void answered(wire *w, const uint8_t *frame, size_t length)
{
    asker *a = w->context;

    static const size_t lengths[3] = {25, 8, 133};
    unsigned which = (w->frames - 1) % 3; /* the first frame is number 1 */

    a->wrong += length != lengths[which] || crc16(frame, length) != 0;
    if (w->frames > SKIP)
        note(&a->gap[which], w->first_started - w->received);
    send_next(a);
}

static asker serve(const char *name)
{
    static asker a;

    memset(&a, 0, sizeof a);
    a.on = timed_board("uno", name);
    a.bus = board_uart(a.on, '0', answered, &a);
    if (!board_run(a.on, 10 * MS))
        give_up("a sketch crashed");
    send_next(&a);
    while (a.bus->frames < SKIP + 3 * COUNTED)
        if (!board_run(a.on, MS))
            give_up("a sketch crashed");
    board_free(a.on);
    if (a.wrong)
        give_up("a server answers wrongly");
    return a;
}

static void responses(const char *name, unsigned baud, unsigned long gap)
{
    asker a = serve(name), again = serve(name);
    static const char *const requests[3] = {"FC03 of 10 registers", "FC10 of 10", "FC03 of 64"};
    char what[120];
    unsigned i;

    if (memcmp(a.gap, again.gap, sizeof a.gap) != 0)
        give_up("two runs differ");
    for (i = 0; i < 3; i++) {
        snprintf(what, sizeof what, "a server's response, %u baud, t3.5 = %lu cycles: to %s", baud,
                 gap, requests[i]);
        row_cycles(what, &a.gap[i], gap + gap / 20);
    }
}

void time_server(void)
{
    responses("TimeServe", 19200, 32096);
    responses("TimeServeFast", 115200, 28000);
}

/* --- noise that arrives without silence --- */

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
static uint8_t noise(unsigned which, unsigned i)
{
    static const uint8_t request[8] = {1, 3, 0, 0, 0, 10, 0xC5, 0xCD};
    /* The start of a request that fills the buffer. */
    static const uint8_t beginning[7] = {1, 16, 0, 0, 0, 64, 128};
    static uint32_t random = 1;

    random = random * 1664525 + 1013904223;
    switch (which) {
    case 0: return (uint8_t)(random >> 24);
    case 1: return 0;
    case 2: return request[i % 8]; /* requests without silence between them */
    default: return beginning[i % 7];
    }
}

void time_server_flood(void)
{
    span byte = {0}, deaf = {0};
    unsigned which, i;

    for (which = 0; which < KINDS; which++) {
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
            bytes[i] = noise(which, i);
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
                    which, board_word(f.on, taken), f.answers);
        board_free(f.on);
    }
    row_cycles("a server: a byte of noise without silence (one lasts 1388 at 115200 baud)", &byte,
               1388);
    row_cycles("a server: from the last byte of noise, half t3.5 included, to the end of the poll "
               "that drops it",
               &deaf, 28000);
}
