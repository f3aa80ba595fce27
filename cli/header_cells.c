#include "header_cells.h"

#include <string.h>

/* From this size on, in registers or bits, a hole takes more memory than a second table. */
enum { HOLE = 32, BIT_HOLE = 512 };

static const char *const NAMES[] = {"", "coils", "discrete", "holding", "input"};

int header_is_bits(uint8_t table)
{
    return table <= MBM_TABLE_DISCRETE_INPUTS;
}

const char *header_table_name(uint8_t table)
{
    return NAMES[table];
}

void header_write_name(const header *h, const header_cells *of, int part)
{
    fprintf(h->out, "%s_", h->lower);
    if (h->unit == 0)
        fprintf(h->out, "unit%u_", of->unit);
    fprintf(h->out, "%s", NAMES[of->table]);
    if (part > 0)
        fprintf(h->out, "_%u", (unsigned)of->first[part]);
}

/* Adds a part; the two that are nearest become one if there are too many. */
static void add_part(header_cells *of, uint32_t first, uint32_t last)
{
    uint32_t firsts[HEADER_TABLES + 1], lasts[HEADER_TABLES + 1];
    int i, nearest = 0, count = of->parts + 1;

    memcpy(firsts, of->first, sizeof of->first);
    memcpy(lasts, of->last, sizeof of->last);
    firsts[count - 1] = first;
    lasts[count - 1] = last;
    if (count > HEADER_TABLES) {
        for (i = 1; i + 1 < count; i++)
            if (firsts[i + 1] - lasts[i] < firsts[nearest + 1] - lasts[nearest])
                nearest = i;
        lasts[nearest] = lasts[nearest + 1];
        for (i = nearest + 1; i + 1 < count; i++) {
            firsts[i] = firsts[i + 1];
            lasts[i] = lasts[i + 1];
        }
        count--;
    }
    memcpy(of->first, firsts, sizeof of->first);
    memcpy(of->last, lasts, sizeof of->last);
    of->parts = count;
}

void header_find_cells(const header *h, uint16_t unit, uint8_t table, header_cells *into)
{
    const uint32_t hole = header_is_bits(table) ? BIT_HOLE : HOLE;
    uint32_t at;
    uint16_t i;

    into->parts = 0;
    for (i = 0;
         i < h->of->count && (h->of->planned[i].unit != unit || h->of->planned[i].table != table);)
        i++;
    if (i == h->of->count)
        return;
    memset(into, 0, sizeof *into);
    into->unit = unit;
    into->table = table;
    for (i = 0; i < h->of->count; i++) {
        const mbm_planField *planned = &h->of->planned[i];
        const device_field *field = &h->of->fields[i];
        const uint16_t mask = device_mask(planned);

        if (planned->unit != unit || planned->table != table)
            continue;
        for (at = 0; at < device_size(planned); at++) {
            const uint32_t address = planned->address + at;

            into->has[address] = (uint8_t)(into->has[address] | HAS_CELL |
                                           (field->access & DEVICE_READ ? HAS_READ : 0) |
                                           (field->access & DEVICE_WRITE ? HAS_WRITE : 0));
            if (field->words)
                into->words[address] =
                    (uint16_t)((into->words[address] & ~mask) | field->words[at]);
        }
    }
    for (at = 0; at < HEADER_CELLS; at++) {
        if (!into->has[at])
            continue;
        if (into->parts > 0 && at - into->last[into->parts - 1] <= hole)
            into->last[into->parts - 1] = at;
        else
            add_part(into, at, at);
    }
}

int header_part_of(const header_cells *of, uint16_t address)
{
    int part = 0;

    while (address > of->last[part])
        part++;
    return part;
}
