/* A master whose requests are answered at once: its dead time, its stack, its polls. */
#include "sketch.h"
#include "timing.h"

#include <stdio.h>
#include <string.h>

/* The dead time depends on where a reply comes in the loop that waits for it, and on when the timer
 * of the core's clock interrupts that loop. So the device delays each of REPLIES replies to a
 * request by another multiple of STEP cycles. The delays cover a period of the timer, which is
 * more than 25 turns of the loop of either library. The device takes them in steps of ORDER, so
 * that a few replies cover that period too. REPLIES is a prime: two requests in turn get every
 * delay. */
enum { REPLIES = 509, STEP = 37, ORDER = 315 };

typedef struct observer {
    board *on;
    wire *bus;
    uint64_t late; /* the last byte of a reply comes this many cycles late */
    span dead[2];  /* before a request of 8 bytes, and before a longer one */
    span back;     /* from the last byte of a reply to the end of the call */
    /* poll by poll */
    span without, with;
    uint64_t rose;
    unsigned bytes_before, bytes_due, bytes_polled;
    int waiting, painted;
} observer;

static void answer(wire *w, const uint8_t *frame, size_t length)
{
    observer *o = w->context;
    uint8_t reply[FRAME];
    size_t have = peer_right_reply(reply, frame);

    if (w->frames > SKIP)
        note(&o->dead[length > 8], w->first_started - w->received);
    o->bytes_due = (unsigned)have;
    w->bytes_received = 0;
    o->bytes_before = 0;
    o->waiting = 1;
    wire_play(w, MS + w->frames * ORDER % REPLIES * STEP, reply, have - 1);
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
        note(&o->back, cycle - w->received);
}

static void poll_begins_or_ends(void *context, int level, uint64_t cycle)
{
    observer *o = context;
    wire *w = o->bus;

    if (level) {
        o->rose = cycle;
        return;
    }
    /* After the request has been sent, the wire is silent for a millisecond, then bytes
     * arrive. */
    if (w->frames > SKIP && o->waiting) {
        unsigned fresh = w->bytes_received - o->bytes_before;

        if (w->bytes_received == 0)
            note(&o->without, cycle - o->rose);
        else if (w->bytes_received == o->bytes_due)
            o->waiting = 0;
        else if (fresh) {
            note(&o->with, cycle - o->rose);
            o->bytes_polled += fresh;
        }
    }
    o->bytes_before = w->bytes_received;
}

/* Observes `count` requests of a sketch, after the first ones. */
static observer observe(const char *folder, const char *name, unsigned count, uint64_t late,
                        pin_changed changed)
{
    static observer o;

    if (o.on)
        board_free(o.on);
    memset(&o, 0, sizeof o);
    o.late = late;
    o.on = timed_board(folder, name);
    o.bus = board_uart(o.on, '0', answer, &o);
    board_paint(o.on);
    if (changed)
        board_watch_pin(o.on, 'B', 0, changed, &o);
    while (o.bus->frames < SKIP + count)
        if (!board_run(o.on, MS))
            give_up("a sketch crashed");
    return o;
}

/* How much deeper the stack grows, from reset on, than in a sketch that only uses the
 * serial port. */
static unsigned long stack_added(const observer *o)
{
    board *plain = timed_board("uno", "SizeSerial");
    unsigned depth;

    board_paint(plain);
    if (!board_run(plain, MS))
        give_up("a sketch crashed");
    depth = board_stack_depth(plain);
    board_free(plain);
    return board_stack_depth(o->on) - depth;
}

/* The dead times of a library that keeps no gap, and how deep its stack grows. */
typedef struct dead_times {
    span read, basic[2]; /* those of Basic before FC03 and before FC10 */
    unsigned long stack;
} dead_times;

static dead_times without_gap(const char *folder)
{
    dead_times d;
    observer o = observe(folder, "TimeRead", REPLIES, 0, NULL);

    d.read = o.dead[0];
    d.stack = stack_added(&o);
    o = observe(folder, "TimeBasicNoGap", 2 * REPLIES, 0, NULL);
    memcpy(d.basic, o.dead, sizeof d.basic);
    return d;
}

static void print_dead_times(const dead_times *without)
{
    observer again = observe("uno", "TimeRead", REPLIES, 0, NULL), o;
    unsigned long gap = 32096; /* 3.5 characters of 11 bits at 19200 baud: 2006 us */

    if (memcmp(&without->read, &again.dead[0], sizeof without->read) != 0)
        give_up("two runs differ");
    row_mean("dead time, FC03 of 10 registers, 115200 baud, no gap", &without->read, 3463);
    row_mean("dead time, Basic, 19200 baud, no gap: before FC10", &without->basic[1], 3075);
    row_mean("dead time, Basic, 19200 baud, no gap: before FC03", &without->basic[0], 3075);
    o = observe("uno", "TimeBasicGap", 2 * REPLIES, 0, NULL);
    row_mean("dead time, Basic, 19200 baud, t3.5 = 32096 cycles: before FC10", &o.dead[1],
             gap + gap / 20);
    row_mean("dead time, Basic, 19200 baud, t3.5 = 32096 cycles: before FC03", &o.dead[0],
             gap + gap / 20);
}

static unsigned long ram_added(const char *folder)
{
    board *plain = timed_board("uno", "SizeSerial"), *reading = timed_board(folder, "SizeFC03");
    /* The sketch itself uses two bytes. */
    unsigned long ram = board_symbol(reading, "_end") - board_symbol(plain, "_end") - 2u;

    board_free(plain);
    board_free(reading);
    return ram;
}

static void returns(void)
{
    observer o = observe("uno", "TimeRead", REPLIES, 0, call_begins_or_ends);
    unsigned long ram = ram_added("uno"), stack = board_stack_depth(o.on);
    board *plain = timed_board("uno", "SizeSerial"), *reading = timed_board("uno", "SizeFC03");

    row_cycles("last byte of a reply to the end of the call", &o.back, 0);
    row("static RAM added, default buffers", "bytes", ram, ram, 0);
    row("stack of a transaction, interrupts included", "bytes", stack, stack, 0);
    row("static RAM and stack together", "bytes", ram + stack, ram + stack, 557);
    board_paint(reading);
    board_paint(plain);
    if (!board_run(plain, MS) || !board_run(reading, 100 * MS))
        give_up("a sketch crashed");
    stack = board_stack_depth(reading) - board_stack_depth(plain);
    row("stack from reset on, constructor and begin included, above a serial-only sketch", "bytes",
        stack, stack, 0);
    board_free(plain);
    board_free(reading);
    o = observe("uno", "TimeRead", COUNTED, 100 * MS, call_begins_or_ends);
    row_cycles("a last byte that comes 100 ms late, to the end of the call", &o.back, 0);
}

static void polls(void)
{
    observer o = observe("uno", "TimePoll", REPLIES, 0, poll_begins_or_ends);
    unsigned long per_byte;

    row_cycles("poll while nothing arrives", &o.without, 0);
    row_cycles("poll with new bytes, 115200 baud", &o.with, 0);
    /* The cycles of a received byte, with the core's interrupt, above those of waiting. */
    per_byte = (unsigned long)((o.with.sum - o.with.count * mean(&o.without)) / o.bytes_polled);
    row("a received byte in a sketch that polls, above waiting (one lasts 1388 at 115200 baud)",
        "cycles", per_byte, per_byte, 0);
}

/* A blocking sketch, which shows each look for bytes by a change of its pin. */
typedef struct waiting {
    wire *bus;
    uint64_t changed;  /* the last look */
    uint64_t before;   /* the last look before the first byte */
    unsigned received; /* bytes at the last look */
    unsigned due, looks;
    span empty; /* from one look to the next, while nothing arrives */
    span byte;  /* what a byte costs, one value for each reply */
} waiting;

static void answer_at_length(wire *w, const uint8_t *frame, size_t length)
{
    waiting *o = w->context;
    uint8_t reply[FRAME];

    o->due = (unsigned)peer_right_reply(reply, frame);
    o->received = w->bytes_received = 0;
    wire_play(w, MS, reply, o->due);
}

/* From the last look before the first byte to the last one before the last byte, the sketch has
 * taken all bytes but the last. What these looks have taken beyond empty ones are the bytes, with
 * the core's interrupt. */
static void looks(void *context, int level, uint64_t cycle)
{
    waiting *o = context;
    unsigned received = o->bus->bytes_received;

    if (o->due && received == 0) {
        if (o->before)
            note(&o->empty, cycle - o->before);
        o->before = cycle;
        o->looks = 0;
    } else if (o->before && received == o->due) {
        uint64_t took = o->changed - o->before, waited = o->looks * mean(&o->empty);

        if (o->bus->frames > SKIP)
            note(&o->byte, (took - waited) / (o->due - 1));
        o->due = 0;
        o->before = 0;
    } else {
        o->looks++;
    }
    o->changed = cycle;
}

static void waits(void)
{
    board *b = timed_board("uno", "TimeIdle");
    waiting o = {0};

    o.bus = board_uart(b, '0', answer_at_length, &o);
    board_watch_pin(b, 'B', 0, looks, &o);
    while (o.bus->frames < SKIP + COUNTED)
        if (!board_run(b, MS))
            give_up("a sketch crashed");
    row_cycles(
        "a received byte in a sketch that waits, above waiting (one lasts 1388 at 115200 baud)",
        &o.byte, 0);
    board_free(b);
}

/* The same sketches on the same board with the same replies, compiled with each of the two
 * libraries. */
static void compare_with(const char *peer, const dead_times *ours)
{
    dead_times measured = {0}, *theirs = NULL;
    unsigned long ram[2];
    span both[2];

    if (peer) {
        measured = without_gap(peer);
        theirs = &measured;
    }
    both[0] = joined(&ours->basic[0], &ours->basic[1]);
    both[1] = joined(&measured.basic[0], &measured.basic[1]);
    row_beside("dead time, FC03 of 10 registers, 115200 baud", &ours->read,
               theirs ? &theirs->read : NULL);
    row_beside("dead time, Basic, 19200 baud: before FC10", &ours->basic[1],
               theirs ? &theirs->basic[1] : NULL);
    row_beside("dead time, Basic, 19200 baud: before FC03", &ours->basic[0],
               theirs ? &theirs->basic[0] : NULL);
    row_beside("dead time, Basic, 19200 baud: before both", &both[0], theirs ? &both[1] : NULL);
    ram[0] = ram_added("uno");
    ram[1] = peer ? ram_added(peer) : 0;
    row_beside_bytes("static RAM", ram[0], peer ? &ram[1] : NULL);
    row_beside_bytes("stack, from reset on", ours->stack, theirs ? &theirs->stack : NULL);
}

void time_master(const char *peer)
{
    dead_times ours = without_gap("uno");

    print_dead_times(&ours);
    returns();
    polls();
    waits();
    compare_with(peer, &ours);
}

/* --- the gap while no baud rate is set: t3.5 of the rate of the UART --- */

/* The calls of the sketch, in order. */
enum { AFTER_BEGIN, OTHER_AFTER_PAUSE, OTHER_AT_ONCE, SAME_AFTER_PAUSE, CALLS };

/* 1750 us; the core's clock counts in steps of 4 us. */
enum { GAP = 1750 * MHZ, CLOCK_STEP = 4 * MHZ };

typedef struct turns {
    wire *bus;
    uint64_t called, silent_from;
    uint64_t waited[CALLS];  /* from the call to the first byte of its request */
    uint64_t silence[CALLS]; /* the silence on the line before it */
} turns;

static void is_called(void *context, int level, uint64_t cycle)
{
    turns *t = context;

    if (level)
        t->called = cycle;
}

static void is_asked(wire *w, const uint8_t *frame, size_t length)
{
    turns *t = w->context;
    unsigned call = w->frames - 1;

    if (call >= CALLS)
        give_up("TimeFirst sends more requests than it makes calls");
    t->waited[call] = w->first_started - t->called;
    t->silence[call] = w->first_started - w->received;
    peer_right(w, frame, length);
}

static void row_of(const char *what, uint64_t cycles, unsigned long limit)
{
    row(what, "cycles", (unsigned long)cycles, (unsigned long)cycles, limit);
}

void time_default_gap(void)
{
    turns t = {0};
    board *b = timed_board("uno", "TimeFirst");

    t.bus = board_uart(b, '0', is_asked, &t);
    board_watch_pin(b, 'B', 0, is_called, &t);
    if (!board_run(b, 300 * MS))
        give_up("a sketch crashed");
    if (t.bus->frames != CALLS)
        give_up("TimeFirst has not sent its requests");
    if (t.silence[OTHER_AT_ONCE] < GAP - CLOCK_STEP)
        give_up("another object's request does not keep the gap");
    row_of(
        "no baud rate set: the first request after begin on a line that was silent for 50 ms, from the call to its first byte",
        t.waited[AFTER_BEGIN], 3463);
    row_of(
        "no baud rate set: another object's request after 50 ms of silence, from the call to its "
        "first byte",
        t.waited[OTHER_AFTER_PAUSE], 3463);
    row_of(
        "no baud rate set: the same object's request after 50 ms of silence, from the call to its "
        "first byte",
        t.waited[SAME_AFTER_PAUSE], 3463);
    row_of(
        "no baud rate set: another object's request at once, dead time with the gap of 28000 cycles",
        t.silence[OTHER_AT_ONCE], GAP + GAP / 20);
    board_free(b);
}

/* --- sketches for the library ModbusMaster, unchanged: the time of a transaction, and the RAM ---
 */

/* A sketch, its far end, and how many transactions are counted: whole rounds of its loop. */
typedef struct unchanged {
    const char *name, *what;
    int unit; /* of the server; 0: the device of the other rows */
    unsigned transactions;
} unchanged;

static const unchanged sketches[] = {
    {"TimeUnchanged", "FC03 of 10 registers, 115200 baud", 0, 60},
    {"Basic", "Basic, 19200 baud", 2, 60},
    {"PhoenixContact", "PhoenixContact, 19200 baud", 1, 60},
    {"TimeLong", "FC03 of 60 registers, 115200 baud", 0, 60},
};

typedef struct measured {
    uint64_t time;     /* of all transactions, cycles */
    unsigned long ram; /* above a sketch that only uses the serial port */
} measured;

/* The most RAM that a board has used since its stack was painted, variables and stack. */
static unsigned long ram_used(board *b)
{
    return board_symbol(b, "_end") + board_stack_depth(b);
}

/* Runs a sketch until it has begun `frames` more requests. Returns the time of the last one. */
static uint64_t run_until_request(board *b, wire *bus, unsigned frames)
{
    frames += bus->frames;
    while (bus->frames < frames)
        if (!board_run(b, MS))
            give_up("a sketch crashed");
    return bus->first_started;
}

static measured measure(const char *folder, const unchanged *u)
{
    board *b = timed_board(folder, u->name), *plain = timed_board("uno", "SizeSerial");
    measured m;
    server s;
    wire *bus;
    uint64_t began;

    board_paint(b);
    board_paint(plain);
    if (u->unit) {
        server_start(&s, u->unit);
        /* As the device does that the sketch PhoenixContact is for. */
        s.mapping->nb_registers = 65;
        bus = board_uart(b, '0', peer_libmodbus, &s);
    } else {
        bus = board_uart(b, '0', peer_right, NULL);
    }
    began = run_until_request(b, bus, 1);
    m.time = run_until_request(b, bus, u->transactions) - began;
    if (!board_run(plain, MS))
        give_up("a sketch crashed");
    m.ram = ram_used(b) - ram_used(plain);
    if (u->unit)
        server_stop(&s);
    board_free(b);
    board_free(plain);
    return m;
}

void time_unchanged(const char *peer)
{
    enum { KINDS = sizeof sketches / sizeof sketches[0] };
    measured ours[KINDS], theirs[KINDS] = {{0}};
    char what[100];
    unsigned i;

    for (i = 0; i < KINDS; i++) {
        ours[i] = measure("uno", &sketches[i]);
        if (peer)
            theirs[i] = measure(peer, &sketches[i]);
    }
    for (i = 0; i < KINDS; i++) {
        snprintf(what, sizeof what, "a transaction of an unchanged sketch, %s", sketches[i].what);
        row_beside_time(what, ours[i].time / sketches[i].transactions,
                        peer ? theirs[i].time / sketches[i].transactions : 0);
    }
    for (i = 0; i < KINDS; i++) {
        snprintf(what, sizeof what, "RAM at most, stack included, %s", sketches[i].what);
        row_beside_bytes(what, ours[i].ram, peer ? &theirs[i].ram : NULL);
    }
}
