/* A master that waits for a reply while other bytes arrive without silence. */
#include "crc.h"
#include "mbm.h"
#include "timing.h"

#include <string.h>

/* FULL bytes fill the frame buffer. COUNTED_BYTES are averaged. IN_CORE bytes fit into the
 * core's receive buffer of CORE bytes. */
enum { FULL = 255, COUNTED_BYTES = 1000, IN_CORE = 60, CORE = 64 };

typedef struct flood {
    board *on;
    wire *bus;
    uint8_t (*byte)(unsigned i);
    unsigned played, taken, finished; /* finished: taken by polls that have ended */
    uint16_t tail, status;            /* their addresses in the sketch */
    uint8_t at;                       /* where the core's next byte to read was last */
    uint64_t began, longest;
    int takes;
    /* the cycles of polls with bytes to read, and of all others */
    uint64_t busy;
    span idle;
} flood;

/* Counts the bytes that the sketch has taken from the core since the last count. One poll may
 * take more than the core holds. */
static void count_taken(flood *f)
{
    uint8_t now = board_byte(f->on, f->tail);

    f->taken += (unsigned)(now + CORE - f->at) % CORE;
    f->at = now;
}

static void poll_takes_bytes(void *context, int level, uint64_t cycle)
{
    flood *f = context;

    if (level)
        f->takes = 1;
}

static void poll_begins_or_ends(void *context, int level, uint64_t cycle)
{
    flood *f = context;
    uint64_t lasted = cycle - f->began;

    if (level) {
        f->began = cycle;
        return;
    }
    count_taken(f);
    f->finished = f->taken;
    if (f->began == 0) /* the poll began before the measurement */
        return;
    if (lasted > f->longest)
        f->longest = lasted;
    if (f->takes)
        f->busy += lasted;
    else
        note(&f->idle, lasted);
    f->takes = 0;
}

/* Runs the sketch of a folder until it has sent its request. */
static flood *begin(const char *folder, uint8_t (*byte)(unsigned i))
{
    static flood f;

    memset(&f, 0, sizeof f);
    f.byte = byte;
    f.on = timed_board(folder, "TimeWait");
    f.bus = board_uart(f.on, '0', NULL, NULL);
    f.status = board_symbol(f.on, "status");
    while (f.bus->frames == 0)
        if (!board_run(f.on, 100) || board_cycle(f.on) > 100 * MS)
            give_up("TimeWait sends no request");
    f.tail = board_word(f.on, board_symbol(f.on, "tail"));
    f.at = board_byte(f.on, f.tail);
    board_watch_pin(f.on, 'B', 0, poll_begins_or_ends, &f);
    board_watch_pin(f.on, 'B', 1, poll_takes_bytes, &f);
    return &f;
}

static void play(flood *f, unsigned count)
{
    uint8_t bytes[FRAME];
    unsigned i;

    for (i = 0; i < count; i++)
        bytes[i] = f->byte(f->played + i);
    wire_play(f->bus, 0, bytes, count);
    f->played += count;
}

/* Runs the sketch for less than a byte takes. */
static int run(flood *f)
{
    int runs = board_run(f->on, 100);

    count_taken(f);
    return runs;
}

/* Plays bytes until polls have taken `target` bytes and the last of them has ended. The line
 * pauses before the core's buffer would overflow, so a master that is too slow loses no byte
 * here. */
static void feed(flood *f, unsigned target)
{
    uint64_t end_at = board_cycle(f->on) + 1500 * MS;

    while (f->finished != target) {
        unsigned waiting = f->played - f->taken;

        if (f->bus->bytes_received == f->played && f->played < target && waiting < IN_CORE) {
            unsigned count = IN_CORE - waiting;

            play(f, count < target - f->played ? count : target - f->played);
        }
        if (!run(f) || board_cycle(f->on) > end_at)
            give_up("a master does not take the bytes of a flood");
    }
    if (board_byte(f->on, f->status) != MBM_PENDING)
        give_up("a request ends during a flood, before its deadline");
}

/* Returns the cycles of a byte. A poll without bytes counts too if it is longer than the
 * shortest: it does work that was put off. */
static uint64_t per_byte(const char *folder, uint8_t (*byte)(unsigned i))
{
    flood *f = begin(folder, byte);
    uint64_t busy;

    feed(f, FULL);
    f->busy = 0;
    f->idle = (span){0};
    feed(f, FULL + COUNTED_BYTES);
    busy = f->busy + f->idle.sum - f->idle.least * f->idle.count;
    board_free(f->on);
    return busy / COUNTED_BYTES;
}

/* Returns the longest poll until the request has ended, with bytes as fast as the line
 * allows. The core loses bytes if the master is too slow, and the rest may be a right reply
 * by chance. Then the flood begins again with another byte. */
static uint64_t longest(const char *folder, uint8_t (*byte)(unsigned i))
{
    unsigned first;

    for (first = 0; first < 3; first++) {
        flood *f = begin(folder, byte);
        uint8_t ended;

        f->played = first;
        while (board_byte(f->on, f->status) == MBM_PENDING) {
            if (f->played - f->bus->bytes_received < FRAME)
                play(f, FRAME);
            if (!board_run(f->on, MS) || board_cycle(f->on) > 4000 * MS)
                give_up("a request does not end during a flood");
        }
        ended = board_byte(f->on, f->status);
        board_free(f->on);
        if (ended == MBM_RESPONSE_TIMED_OUT || ended == MBM_INVALID_CRC)
            return f->longest;
        if (ended != MBM_OK)
            break;
    }
    give_up("a flood is no reply, but the request ends with another status than a timeout");
}

/* --- the bytes that arrive */

/* The first bytes of replies of 125 registers: each of them may be the start of a reply. */
static uint8_t begins_125(unsigned i)
{
    static const uint8_t bytes[3] = {0x11, 0x03, 0xFA};

    return bytes[i % 3];
}

static uint8_t begins_64(unsigned i)
{
    static const uint8_t bytes[3] = {0x11, 0x03, 0x80};

    return bytes[i % 3];
}

static uint8_t random_byte(unsigned i)
{
    uint32_t mixed = (i + 1) * 2654435761u;

    mixed ^= mixed >> 15;
    mixed *= 2246822519u;
    return (uint8_t)(mixed >> 24);
}

static uint8_t zero(unsigned i)
{
    return 0;
}

/* Replies of another unit, one after the other. */
static uint8_t foreign_reply(unsigned i)
{
    uint8_t frame[FRAME] = {2, 3, 20};
    size_t length = seal(frame, 23);

    return frame[i % length];
}

static void row_of(const char *what, uint64_t cycles, unsigned long limit)
{
    row(what, "cycles", (unsigned long)cycles, (unsigned long)cycles, limit);
}

void time_master_flood(void)
{
    static uint8_t (*const noise[])(unsigned) = {random_byte, zero, foreign_reply};
    span byte = {0};
    unsigned i;

    row_of("a master that waits for 125 registers, buffers of 125: a byte of `11 03 FA` repeated "
           "(one lasts 1388 at 115200 baud)",
           per_byte("uno-125", begins_125), 1388);
    row_of("a master that waits for 64 registers, default buffers: a byte of `11 03 80` repeated",
           per_byte("uno", begins_64), 1388);
    for (i = 0; i < sizeof noise / sizeof *noise; i++)
        note(&byte, per_byte("uno", noise[i]));
    row_cycles("a master that waits for 64 registers, default buffers: a byte of noise", &byte,
               1388);
    row_of("a master that waits for 125 registers: the longest poll up to its deadline, `11 03 FA` "
           "repeated at 115200 baud",
           longest("uno-125", begins_125), 30 * MS);
    row_of("a master that waits for 64 registers: the longest poll up to its deadline, `11 03 80` "
           "repeated at 115200 baud",
           longest("uno", begins_64), 30 * MS);
}
