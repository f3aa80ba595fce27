/* Sketches that were written for the library ModbusMaster and were not changed: the time of a
 * transaction, and the RAM. */
#include "peer.h"
#include "rows.h"
#include "timing.h"

#include <stdio.h>

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
