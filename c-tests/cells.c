/* Gets and sets every field of cells.yaml by the functions that mbm header writes.
 * tests/tool/test_header.py compiles and runs it. Licence: MIT OR Apache-2.0. */
#define CELLS_SERVER
#include "cells.h"

#include <stdio.h>

static int wrong;

#define EXPECT(what)                                                                               \
    do {                                                                                           \
        if (!(what)) {                                                                             \
            wrong++;                                                                               \
            printf("cells.c:%d: not %s\n", __LINE__, #what);                                       \
        }                                                                                          \
    } while (0)

/* Sets a value, and expects that the words of the field are those of the functions of values.h. */
#define SET(call, words, first, size, address, setter, value, order)                               \
    do {                                                                                           \
        uint16_t expected[4];                                                                      \
        mbm_registers registers;                                                                   \
                                                                                                   \
        (void)mbm_registers_intoWords(&registers, expected, size, address);                        \
        (void)setter(&registers, address, order, value);                                           \
        call;                                                                                      \
        EXPECT(memcmp(expected, &(words)[(address) - (first)], 2 * (size)) == 0);                  \
    } while (0)

static void get_the_values_of_the_file(void)
{
    char text[8] = "";

    cells_initialise();
    EXPECT(cells_get_level() * CELLS_LEVEL_MULTIPLIER == 21 && CELLS_LEVEL_DIVISOR == 4);
    EXPECT(cells_get_offset() == -2);
    EXPECT(cells_get_state_1() == CELLS_STATE_1_ALL_ON && CELLS_STATE_1_OFF == 0);
    EXPECT(cells_get_alarm() == 0);
    EXPECT((int)(cells_get_limit() * 10) == 15);
    EXPECT(cells_get_key() == 0);
    EXPECT(cells_get_model(text, sizeof text) == MBM_OK && strcmp(text, "Ger\xE4t 1") == 0);
    EXPECT(cells_get_model(text, 2) == MBM_BUFFER_TOO_SMALL);
    EXPECT(cells_get_pair(0) == 70000 && cells_get_pair(1) == 5 && CELLS_PAIR_COUNT == 2);
    EXPECT((int)(cells_get_real() * 10) == 25);
    EXPECT((int)(cells_get_reals(0) * 10) == -25 && (int)cells_get_reals(1) == 1000);
    EXPECT(cells_get_small() == 258);
    EXPECT(cells_get_bits() == 300);
    EXPECT(cells_get_far() == CELLS_FAR_LOW && CELLS_FAR_HIGH == 70001);
    EXPECT(cells_get_end() == 3);
    EXPECT(cells_get_last() == CELLS_LAST_NOTHING && CELLS_LAST_NOTHING == UINT64_MAX);
    EXPECT(cells_get_long() == CELLS_LONG_LEAST && CELLS_LONG_LEAST == INT64_MIN);
    EXPECT(cells_get_relays(0) == 1 && cells_get_relays(1) == 0 && cells_get_relays(2) == 1);
    EXPECT(cells_get_lamp() == CELLS_RELAYS_CLOSED);
    EXPECT(cells_get_inputs(0) == 1 && cells_get_inputs(1) == 0 && cells_get_inputs(9) == 1);
    EXPECT(CELLS_UNIT == 7 && CELLS_LIMIT_ADDRESS == 20 && CELLS_LIMIT_SIZE == 2);
    EXPECT(CELLS_BITS_BIT == 4 && CELLS_BITS_BITS == 9);
}

static void set_registers(void)
{
    const uint64_t four = UINT64_C(0xFEDCBA9876543210);
    const float single = -3.25f;
    const double real = 1234.5;
    char text[8] = "";

    SET(cells_set_level(-300), cells_holding, 7, 1, 7, mbm_registers_setUint16, (uint16_t)-300,
        MBM_ORDER_ABCD);
    SET(cells_set_limit(single), cells_holding, 7, 2, 20, mbm_registers_setFloat, &single,
        MBM_ORDER_CDAB);
    SET(cells_set_pair(1, 0x12345678), cells_holding_400, 400, 2, 402, mbm_registers_setUint32,
        0x12345678, MBM_ORDER_DCBA);
    SET(cells_set_real(real), cells_holding_400, 400, 4, 404, mbm_registers_setDouble, &real,
        MBM_ORDER_ABCD);
    SET(cells_set_reals(1, real), cells_holding_400, 400, 4, 412, mbm_registers_setDouble, &real,
        MBM_ORDER_CDAB);
    SET(cells_set_small(0x1234), cells_holding_400, 400, 1, 416, mbm_registers_setUint16, 0x1234,
        MBM_ORDER_BADC);
    SET(cells_set_far(-5), cells_holding_65533, 65533, 2, 65533, mbm_registers_setUint32,
        (uint32_t)-5, MBM_ORDER_BADC);
    SET(cells_set_last(four), cells_input, 65528, 4, 65532, mbm_registers_setUint64, &four,
        MBM_ORDER_ABCD);
    SET(cells_set_long((int64_t)four), cells_input, 65528, 4, 65528, mbm_registers_setUint64, &four,
        MBM_ORDER_DCBA);
    EXPECT(cells_get_level() == -300 && cells_get_pair(1) == 0x12345678 && cells_get_far() == -5);
    EXPECT(cells_get_last() == four && cells_get_long() == (int64_t)four);
    EXPECT(cells_get_small() == 0x1234 && cells_get_pair(0) == 70000);
    EXPECT((int)cells_get_limit() == -3 && (int)cells_get_real() == 1234);
    EXPECT(cells_set_model("pump") == MBM_OK && cells_get_model(text, 8) == MBM_OK &&
           strcmp(text, "pump") == 0);
    EXPECT(cells_set_model("much too long") == MBM_BUFFER_TOO_SMALL);
}

static void set_bits(void)
{
    uint16_t i;

    cells_set_offset(0);
    cells_set_state_1(5);
    EXPECT(cells_get_offset() == 10 && cells_get_state_1() == 5);
    cells_set_alarm(1);
    cells_set_state_1(0xFA);
    EXPECT(cells_get_offset() == 5 && cells_get_alarm() == 1);
    cells_holding_400[17] = 0xFFFF;
    cells_set_bits(0);
    EXPECT(cells_holding_400[17] == 0x0FE0 && cells_get_bits() == 0);
    cells_set_bits(0x1FF);
    EXPECT(cells_holding_400[17] == 0xFFFF && cells_get_bits() == 0x1FF);
    for (i = 0; i < 3; i++)
        cells_set_relays(i, i == 1);
    EXPECT(cells_get_relays(0) == 0 && cells_get_relays(1) == 1 && cells_get_relays(2) == 0);
    EXPECT(cells_get_lamp() == 1);
    cells_set_lamp(0);
    EXPECT(cells_coils[0] == 0x10);
    for (i = 0; i < 10; i++)
        cells_set_inputs(i, 1);
    cells_set_inputs(8, 0);
    EXPECT(cells_discrete[0] == 0xFF && cells_discrete[1] == 0x02);
}

int main(void)
{
    mbm_unit unit = MBM_INIT;

    EXPECT(cells_serve(&unit) == MBM_OK);
    get_the_values_of_the_file();
    set_registers();
    set_bits();
    return wrong != 0;
}
