#include "sketch.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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
