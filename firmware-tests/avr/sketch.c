#include "sketch.h"

#include <string.h>

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
