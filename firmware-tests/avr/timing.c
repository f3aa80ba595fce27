/* How fast a sketch on an Uno is, and how much RAM it takes, in cycles and
 * bytes that repeat exactly: the far end is part of the simulation. Prints the
 * rows of docs/timing.md. */
#include "crc.h"
#include "peer.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SKIP = 2, COUNTED = 20 };

/* What is said of one quantity; limit 0 where there is none. */
static unsigned rows_above;

static void row(const char *what, const char *unit, unsigned long least, unsigned long most,
                unsigned long limit)
{
    char range[40], bound[40] = "";

    if (least == most)
        snprintf(range, sizeof range, "%lu", most);
    else
        snprintf(range, sizeof range, "%lu to %lu", least, most);
    if (limit) {
        snprintf(bound, sizeof bound, "%lu", limit);
        rows_above += most > limit;
    }
    printf("| %s | %s | %s | %s | %s |\n", what, unit, range, bound,
           !limit ? "" : most > limit ? "**no**" : "yes");
}

/* The smallest and the largest of what was seen. */
typedef struct span {
    uint64_t least, most, sum;
    unsigned count;
} span;

static void note(span *s, uint64_t value)
{
    if (s->count++ == 0 || value < s->least)
        s->least = value;
    if (value > s->most)
        s->most = value;
    s->sum += value;
}

typedef struct observer {
    board *on;
    wire *bus;
    uint64_t late;      /* the last byte of a reply comes so much later */
    span dead[2];       /* before a request of 8 bytes, and of more */
    span back;          /* from the last byte of a reply to the end of the call */
    /* poll by poll */
    span without, with;
    uint64_t rose;
    unsigned bytes_before, bytes_due, bytes_polled;
    int waiting, painted;
} observer;

static board *sketch(const char *name)
{
    char path[200];

    snprintf(path, sizeof path, "build/avr/uno/%s.elf", name);
    return board_new(path, "atmega328p");
}

static void answer(wire *w, const uint8_t *frame, size_t length)
{
    observer *o = w->context;
    uint8_t reply[FRAME];
    size_t have = peer_right_reply(reply, frame);

    if (w->frames > SKIP)
        note(&o->dead[length > 8], w->first_started - w->heard);
    o->bytes_due = (unsigned)have;
    w->bytes_heard = 0;
    o->bytes_before = 0;
    o->waiting = 1;
    wire_play(w, MS, reply, have - 1);
    wire_play(w, o->late, reply + have - 1, 1);
}

static void call_begins_or_ends(void *context, int level, uint64_t cycle)
{
    observer *o = context;
    wire *w = o->bus;

    if (level && !o->painted) {
        o->painted = 1;
        board_paint(o->on);
    }
    if (!level && w->frames > SKIP)
        note(&o->back, cycle - w->heard);
}

static void poll_begins_or_ends(void *context, int level, uint64_t cycle)
{
    observer *o = context;
    wire *w = o->bus;

    if (level) {
        o->rose = cycle;
        return;
    }
    /* After the request has left: first a wait of a millisecond, then bytes. */
    if (w->frames > SKIP && o->waiting) {
        unsigned fresh = w->bytes_heard - o->bytes_before;

        if (w->bytes_heard == 0)
            note(&o->without, cycle - o->rose);
        else if (w->bytes_heard == o->bytes_due)
            o->waiting = 0;
        else if (fresh) {
            note(&o->with, cycle - o->rose);
            o->bytes_polled += fresh;
        }
    }
    o->bytes_before = w->bytes_heard;
}

static observer observe(const char *name, uint64_t late, pin_changed changed)
{
    static observer o;

    if (o.on)
        board_free(o.on);
    memset(&o, 0, sizeof o);
    o.late = late;
    o.on = sketch(name);
    o.bus = board_uart(o.on, '0', answer, &o);
    if (changed)
        board_watch_pin(o.on, 'B', 0, changed, &o);
    while (o.bus->frames < SKIP + COUNTED)
        if (!board_run(o.on, MS))
            exit(1);
    return o;
}

static unsigned long mean(const span *s)
{
    return s->count ? (unsigned long)(s->sum / s->count) : 0;
}

static void dead_times(void)
{
    observer o = observe("TimeRead", 0, NULL), again = observe("TimeRead", 0, NULL);
    unsigned long gap = 32096; /* 3.5 characters of 11 bits at 19200 baud: 2006 us */

    if (memcmp(&o.dead, &again.dead, sizeof o.dead) != 0) {
        fprintf(stderr, "timing: two runs differ\n");
        exit(1);
    }
    row("dead time, FC03 of 10 registers, 115200 baud, no gap", "cycles", o.dead[0].least,
        o.dead[0].most, 3463);
    o = observe("TimeBasicNoGap", 0, NULL);
    row("dead time, Basic, 19200 baud, no gap: before FC10", "cycles", o.dead[1].least,
        o.dead[1].most, 3075);
    row("dead time, Basic, 19200 baud, no gap: before FC03", "cycles", o.dead[0].least,
        o.dead[0].most, 3075);
    o = observe("TimeBasicGap", 0, NULL);
    row("dead time, Basic, 19200 baud, t3.5 = 32096 cycles: before FC10", "cycles",
        o.dead[1].least, o.dead[1].most, gap + gap / 20);
    row("dead time, Basic, 19200 baud, t3.5 = 32096 cycles: before FC03", "cycles",
        o.dead[0].least, o.dead[0].most, gap + gap / 20);
}

static void returns(void)
{
    observer o = observe("TimeRead", 0, call_begins_or_ends);
    unsigned long ram;
    board *plain = sketch("SizeSerial"), *reading = sketch("SizeFC03");

    row("last byte of a reply to the end of the call", "cycles", o.back.least, o.back.most, 0);
    ram = board_symbol(reading, "_end") - board_symbol(plain, "_end") - 2u;
    row("static RAM added, default buffers", "bytes", ram, ram, 0);
    row("stack of a transaction, interrupts included", "bytes", board_stack_depth(o.on),
        board_stack_depth(o.on), 0);
    row("static RAM and stack together", "bytes", ram + board_stack_depth(o.on),
        ram + board_stack_depth(o.on), 557);
    board_paint(reading);
    board_paint(plain);
    if (!board_run(plain, MS) || !board_run(reading, 100 * MS))
        exit(1);
    ram = board_stack_depth(reading) - board_stack_depth(plain);
    row("stack from reset on, constructor and begin included, above a serial-only sketch", "bytes",
        ram, ram, 0);
    board_free(plain);
    board_free(reading);
    o = observe("TimeRead", 100 * MS, call_begins_or_ends);
    row("a last byte that comes 100 ms late, to the end of the call", "cycles", o.back.least,
        o.back.most, 0);
}

static void polls(void)
{
    observer o = observe("TimePoll", 0, poll_begins_or_ends);
    unsigned long per_byte;

    row("poll while nothing arrives", "cycles", o.without.least, o.without.most, 0);
    row("poll with new bytes, 115200 baud", "cycles", o.with.least, o.with.most, 0);
    /* All that a byte costs, the core's interrupt included, above waiting. */
    per_byte = (unsigned long)((o.with.sum - o.with.count * mean(&o.without)) / o.bytes_polled);
    row("a received byte, above waiting (one lasts 1388 at 115200 baud)", "cycles", per_byte,
        per_byte, 0);
}

/* --- a server */

typedef struct asker {
    board *on;
    wire *bus;
    span gap[3]; /* from the last byte of a request to the first of its response */
    unsigned wrong;
} asker;

/* In turn reads ten registers, writes them and reads 64, at ever new moments. */
static void ask(asker *a)
{
    static const uint8_t requests[3][7] = {{1, 3, 0, 0, 0, 10}, {1, 16, 0, 0, 0, 10, 20}, {1, 3, 0, 0, 0, 64}};
    uint8_t frame[FRAME] = {0};
    unsigned n = a->bus->frames;

    memcpy(frame, requests[n % 3], sizeof requests[0]);
    wire_play(a->bus, 10 * MS + n * 977, frame, seal(frame, n % 3 == 1 ? 27 : 6));
}

static void answered(wire *w, const uint8_t *frame, size_t length)
{
    asker *a = w->context;

    static const size_t lengths[3] = {25, 8, 133};
    unsigned which = (w->frames - 1) % 3; /* the first is frame 1 */

    a->wrong += length != lengths[which] || crc16(frame, length) != 0;
    if (w->frames > SKIP)
        note(&a->gap[which], w->first_started - w->heard);
    ask(a);
}

static asker serve(const char *name)
{
    static asker a;

    memset(&a, 0, sizeof a);
    a.on = sketch(name);
    a.bus = board_uart(a.on, '0', answered, &a);
    if (!board_run(a.on, 10 * MS))
        exit(1);
    ask(&a);
    while (a.bus->frames < SKIP + 3 * COUNTED)
        if (!board_run(a.on, MS))
            exit(1);
    board_free(a.on);
    if (a.wrong) {
        fprintf(stderr, "timing: %s answers wrongly\n", name);
        exit(1);
    }
    return a;
}

static void responses(const char *name, unsigned baud, unsigned long gap)
{
    asker a = serve(name), again = serve(name);
    static const char *const requests[3] = {"FC03 of 10 registers", "FC10 of 10", "FC03 of 64"};
    char what[120];
    unsigned i;

    if (memcmp(a.gap, again.gap, sizeof a.gap) != 0) {
        fprintf(stderr, "timing: two runs differ\n");
        exit(1);
    }
    for (i = 0; i < 3; i++) {
        snprintf(what, sizeof what, "a server's response, %u baud, t3.5 = %lu cycles: to %s", baud,
                 gap, requests[i]);
        row(what, "cycles", a.gap[i].least, a.gap[i].most, gap + gap / 20);
    }
}

/* --- a server and noise */

enum { FULL = 141, NOISE = 1000 }; /* its buffer, and what comes once that is full */

typedef struct flood {
    board *on;
    wire *bus;
    uint64_t rose, busy;           /* of polls with bytes to take */
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

/* The bytes of one kind of noise. */
static uint8_t noise(unsigned kind, unsigned i)
{
    static const uint8_t request[8] = {1, 3, 0, 0, 0, 10, 0xC5, 0xCD};
    static uint32_t random = 1;

    random = random * 1664525 + 1013904223;
    switch (kind) {
    case 0:
        return (uint8_t)(random >> 24);
    case 1:
        return 0;
    default:
        return request[i % 8]; /* requests without silence between them */
    }
}

static void noises(void)
{
    span byte = {0}, deaf = {0};
    unsigned kind, i;

    for (kind = 0; kind < 3; kind++) {
        static flood f;
        uint8_t bytes[FULL + NOISE], request[FRAME] = {1, 3, 0, 0, 0, 10};
        uint16_t taken, before;

        memset(&f, 0, sizeof f);
        f.on = sketch("TimeServeFlood");
        f.bus = board_uart(f.on, '0', is_answered, &f);
        board_watch_pin(f.on, 'B', 1, takes_bytes, &f);
        taken = board_symbol(f.on, "taken");
        if (!board_run(f.on, 10 * MS))
            exit(1);
        for (i = 0; i < sizeof bytes; i++)
            bytes[i] = noise(kind, i);
        wire_play(f.bus, MS, bytes, sizeof bytes);
        while (f.bus->bytes_heard < FULL)
            if (!board_run(f.on, 100))
                exit(1);
        f.busy = 0;
        before = board_word(f.on, taken);
        while (f.bus->bytes_heard < sizeof bytes)
            if (!board_run(f.on, 100))
                exit(1);
        note(&byte, f.busy / (board_word(f.on, taken) - before));
        /* What is left is taken, and the line is silent. */
        f.longest = 0;
        board_watch_pin(f.on, 'B', 0, polls_once, &f);
        wire_play(f.bus, 10 * MS, request, seal(request, 6));
        if (!board_run(f.on, 9 * MS))
            exit(1);
        note(&deaf, f.ready - f.bus->heard);
        if (!board_run(f.on, 30 * MS))
            exit(1);
        if (board_word(f.on, taken) != sizeof bytes + 8 || f.answers != 1)
            fprintf(stderr, "timing: after noise %u, %u bytes were taken, %u requests answered\n", kind,
                    board_word(f.on, taken), f.answers);
        board_free(f.on);
    }
    row("a server: a byte of noise without silence (one lasts 1388 at 115200 baud)", "cycles",
        byte.least, byte.most, 1388);
    row("a server: from the last byte of noise, half t3.5 included, to the end of the poll that "
        "drops it",
        "cycles", deaf.least, deaf.most, 28000);
}

int main(void)
{
    dead_times();
    returns();
    polls();
    responses("TimeServe", 19200, 32096);
    responses("TimeServeFast", 115200, 28000);
    noises();
    fprintf(stderr, "timing: %u rows above their limits\n", rows_above);
    return 0;
}
