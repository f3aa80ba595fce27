#define _GNU_SOURCE
#include "sketch.h"
#include "crc.h"

#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

const kind uno = {"uno", "atmega328p", '0', {'B', 5}, {'D', 2}, {'D', 4}};
const kind relaxed = {"uno-relax", "atmega328p", '0', {'B', 5}, {'D', 2}, {'D', 4}};
const kind relaxed_mega = {"mega-relax", "atmega2560", '1', {'B', 7}, {'E', 4}, {'G', 5}};
const kind mega = {"mega", "atmega2560", '1', {'B', 7}, {'E', 4}, {'G', 5}};
/* Not `mega1280`, which is a name in the simulator. */
const kind older_mega = {"mega1280", "atmega1280", '1', {'B', 7}, {'E', 4}, {'G', 5}};
const kind atmega644p = {"atmega644p", "atmega644p", '1', {'B', 5}, {'D', 2}, {'D', 4}};
const kind atmega1284p = {"atmega1284p", "atmega1284p", '1', {'B', 5}, {'D', 2}, {'D', 4}};
const kind atmega328 = {"atmega328", "atmega328", '0', {'B', 5}, {'D', 2}, {'D', 4}};
const kind atmega644 = {"atmega644", "atmega644", '0', {'B', 5}, {'D', 2}, {'D', 4}};

const kind uno_peer = {"uno-peer", "atmega328p", '0', {'B', 5}, {'D', 2}, {'D', 4}};
const kind mega_peer = {"mega-peer", "atmega2560", '1', {'B', 7}, {'E', 4}, {'G', 5}};

board *kind_start(const kind *k, const char *sketch)
{
    char path[200];
    const char *folder = getenv("MBM_SKETCHES");

    snprintf(path, sizeof path, "%s/%s/%s.elf", folder ? folder : "build/avr", k->name, sketch);
    return board_new(path, k->mcu);
}

int is_high(board *b, pin p)
{
    return board_pin(b, p.port, p.bit);
}

void collect_text(wire *w, const uint8_t *bytes, size_t length)
{
    printed_text *p = w->context;
    size_t have = strlen(p->text);

    if (have + length < sizeof p->text)
        memcpy(p->text + have, bytes, length);
}

void measure_rhythm(void *context, int level, uint64_t cycle)
{
    pin_rhythm *r = context;

    if (r->switches++ && cycle - r->last > r->longest)
        r->longest = cycle - r->last;
    r->last = cycle;
}

void set_input_float(server *s, unsigned address, float value)
{
    uint32_t bits;

    memcpy(&bits, &value, sizeof bits);
    s->mapping->tab_input_registers[address] = (uint16_t)(bits >> 16);
    s->mapping->tab_input_registers[address + 1] = (uint16_t)bits;
}

/* --- the devices that a sketch sends requests to --- */

/* The server answers a request to its own unit within a few milliseconds, on a loaded host
 * later. A request to another unit must have reached it before the next request. */
enum { ANSWERED_WITHIN_MS = 60000, HEARD_WITHIN_MS = 1000 };

static int is_whole(const uint8_t *reply, size_t length)
{
    return length >= 5 && crc16(reply, length) == 0;
}

void peer_libmodbus(wire *w, const uint8_t *frame, size_t length)
{
    server *s = w->context;
    struct pollfd wait = {s->line.ours, POLLIN, 0};
    uint8_t reply[FRAME];
    size_t have = 0;
    int patience = frame[0] == modbus_get_slave(s->peer) ? ANSWERED_WITHIN_MS : HEARD_WITHIN_MS;

    if (write(s->line.ours, frame, length) != (ssize_t)length)
        abort();
    while (have < sizeof reply && !is_whole(reply, have) && poll(&wait, 1, patience) > 0) {
        ssize_t count = read(s->line.ours, reply + have, sizeof reply - have);

        if (count <= 0)
            abort();
        have += (size_t)count;
    }
    wire_play(w, MS, reply, have);
}

uint16_t peer_value(unsigned address)
{
    return (uint16_t)(address * 7919u + 1u);
}

size_t peer_right_reply(uint8_t *reply, const uint8_t *request)
{
    unsigned address = (unsigned)request[2] << 8 | request[3];
    unsigned quantity = (unsigned)request[4] << 8 | request[5];
    unsigned i;

    memcpy(reply, request, 6);
    if (request[1] == 6 || request[1] == 16)
        return seal(reply, 6);
    reply[2] = (uint8_t)(2 * quantity);
    for (i = 0; i < quantity; i++) {
        reply[3 + 2 * i] = (uint8_t)(peer_value(address + i) >> 8);
        reply[4 + 2 * i] = (uint8_t)peer_value(address + i);
    }
    return seal(reply, 3 + 2 * quantity);
}

void peer_right(wire *w, const uint8_t *frame, size_t length)
{
    uint8_t reply[FRAME];

    wire_play(w, MS, reply, peer_right_reply(reply, frame));
}
