/* The tables that both servers of the bench serve. */
#include "bench_server.h"

#include <stdio.h>
#include <stdlib.h>

enum { CELLS = 200 };

void fail(const char *what)
{
    perror(what);
    exit(1);
}

uint16_t pattern(unsigned address)
{
    return (uint16_t)(address * 40503u + 0x1234u);
}

mbm_unit unit;
static mbm_registerTable holding, inputs;
static mbm_bitTable coils, discrete;
static uint16_t words[CELLS], input_words[CELLS];
static uint8_t bits[CELLS / 8], input_bits[CELLS / 8];
modbus_mapping_t *mapping;

void prepare_tables(void)
{
    unsigned i;

    mapping = modbus_mapping_new(CELLS, CELLS, CELLS, CELLS);
    if (!mapping)
        fail("mapping");
    for (i = 0; i < CELLS; i++) {
        words[i] = mapping->tab_registers[i] = pattern(i);
        input_words[i] = mapping->tab_input_registers[i] = (uint16_t)~pattern(i);
        mapping->tab_bits[i] = mapping->tab_input_bits[i] = pattern(i) >> 7 & 1;
        bits[i / 8] |= (uint8_t)(mapping->tab_bits[i] << i % 8);
        input_bits[i / 8] = bits[i / 8];
    }
    unit.id = UNIT;
    holding.words = words;
    inputs.words = input_words;
    coils.bits = bits;
    discrete.bits = input_bits;
    holding.size = inputs.size = coils.size = discrete.size = CELLS;
    if (mbm_unit_serveCoils(&unit, &coils) || mbm_unit_serveDiscreteInputs(&unit, &discrete) ||
        mbm_unit_serveHoldingRegisters(&unit, &holding) ||
        mbm_registerTable_serveMaskAndReadWrite(&holding) ||
        mbm_unit_serveInputRegisters(&unit, &inputs))
        fail("unit");
}
