/* The types of fields in a device file that a plan does not know: their values in registers, and
 * each refusal. */
#define _GNU_SOURCE
#include "device_text.h"

#define FIELDS(fields) "fields:\n" fields
#define FIELD(keys) FIELDS("- {name: a, table: holding, address: 10, " keys "}\n")

/* Compares the words of the only field's value. */
#define HAS(keys, ...)                                                                             \
    do {                                                                                           \
        static const uint16_t wanted[] = {__VA_ARGS__};                                            \
                                                                                                   \
        read_text(FIELD(keys));                                                                    \
        assert_int_equal(device_size(&meter.planned[0]), COUNT(wanted));                           \
        assert_non_null(meter.fields[0].words);                                                    \
        assert_memory_equal(meter.fields[0].words, wanted, sizeof wanted);                         \
    } while (0)

TEST(a_value_of_each_type_is_these_registers)
{
    HAS("type: int24, value: -1", 0xFFFF, 0xFFFF);
    HAS("type: uint24, order: CDAB, value: 65537", 1, 1);
    HAS("type: uint48, value: 4294967298", 1, 0, 2);
    HAS("type: int48, order: CDAB, value: -2", 0xFFFE, 0xFFFF, 0xFFFF);
    HAS("type: sign_magnitude16, value: -5", 0x8005);
    HAS("type: sign_magnitude32, value: -5", 0x8000, 5);
    HAS("type: bcd16, value: 1234, scale: 1", 0x1234);
    HAS("type: bcd32, order: DCBA, value: 12345678", 0x7856, 0x3412);
    HAS("type: uint32_m10k, value: 12345678", 1234, 5678);
    HAS("type: int64_m10k, order: CDAB, value: -10000", 0, 0xFFFF, 0, 0);
    HAS("type: float16, value: 0.5", 0x3800);
    HAS("type: text_spaces, count: 4, value: ab", 0x6162, 0x2020);
    HAS("type: text_low, count: 3, value: ab", 'a', 'b', 0);
    HAS("type: text_high_spaces, count: 3, order: CDAB, value: ab", 0x6100, 0x6200, 0x2000);
    HAS("type: unix32, value: '1970-01-02T00:00:01Z'", 1, 20865);
    HAS("type: seconds_2000, value: '2000-01-01T01:00:05+01:00'", 0, 5);
    HAS("type: iec870_3, value: '2026-11-27T23:59:00Z'", 26, 0x0B1B, 0x173B);
    HAS("type: date, layout: y M D h m s, value: '2026-06-13T00:01:50Z'", 26, 6, 13, 0, 1, 50);
    HAS("type: date_bcd, layout: hm, value: '07:30'", 0x0730);
    HAS("type: uint64, order: EFGHABCD, value: 72623859790382856", 0x0506, 0x0708, 0x0102, 0x0304);
}

TEST(values_of_any_type_may_follow_each_other)
{
    HAS("type: uint48, count: 2, value: [1, 2]", 0, 0, 1, 0, 0, 2);
    HAS("type: float16, count: 3, value: [1, 2, 3]", 0x3C00, 0x4000, 0x4200);
    HAS("type: date, layout: hm, count: 2, value: ['07:30', '22:00']", 0x071E, 0x1600);
    HAS("type: int64, order: CDABGHEF, count: 2, value: [1, -1]", 0, 0, 1, 0, 0xFFFF, 0xFFFF,
        0xFFFF, 0xFFFF);
}

TEST(a_plan_reads_other_types_as_registers)
{
    mbm_planField field;

    read_text(FIELDS("- {name: a, table: holding, address: 10, type: uint48, count: 4}\n"
                     "- {name: b, table: input, address: 1, type: text_low, count: 9}\n"
                     "- {name: c, table: input, address: 1, type: uint64, order: FEHGBADC}\n"
                     "- {name: d, table: input, address: 1, type: uint32, order: CDAB}\n"));
    field = device_read_as(&meter.planned[0]);
    assert_int_equal(field.type, MBM_TYPE_REGISTERS);
    assert_int_equal(field.count, 12);
    field = device_read_as(&meter.planned[1]);
    assert_int_equal(field.count, 9);
    field = device_read_as(&meter.planned[2]);
    assert_int_equal(field.count, 4);
    assert_int_equal(field.order, MBM_ORDER_ABCD);
    field = device_read_as(&meter.planned[3]);
    assert_int_equal(field.type, MBM_TYPE_UINT32);
    assert_int_equal(field.order, MBM_ORDER_CDAB);
}

TEST(an_order_by_halves_is_that_of_its_half_for_two_registers)
{
    read_text("order: DCBAHGFE\n" FIELDS("- {name: a, table: holding, address: 1, type: uint32}\n"
                                         "- {name: b, table: holding, address: 1, type: uint64}\n"
                                         "- {name: c, table: holding, address: 1, type: text, "
                                         "count: 9}\n"));
    assert_int_equal(meter.planned[0].order, MBM_ORDER_DCBA);
    assert_int_equal(meter.planned[1].order, MBM_ORDER_DCBAHGFE);
    assert_int_equal(meter.planned[2].order, MBM_ORDER_DCBA);
}

/* --- bits --- */

/* Asserts that bits are a field of one register. */
static void expect_part(const char *keys, uint16_t address, uint8_t bit, uint16_t count)
{
    char text[200];

    snprintf(text, sizeof text, "fields:\n- {name: a, table: holding, address: 10, %s}\n", keys);
    read_text(text);
    assert_int_equal(meter.planned[0].type, MBM_TYPE_BIT);
    assert_int_equal(meter.planned[0].address, address);
    assert_int_equal(meter.planned[0].bit, bit);
    assert_int_equal(meter.planned[0].count, count);
}

TEST(bits_of_a_wide_field_in_one_register_are_bits_of_that_register)
{
    expect_part("type: uint16, bits: 4-11", 10, 4, 8);
    expect_part("type: uint16, bits: 15", 10, 15, 1);
    expect_part("type: uint32, bits: 4-11", 11, 4, 8);
    expect_part("type: uint32, bits: 16-31", 10, 0, 16);
    expect_part("type: uint32, order: CDAB, bits: 4-11", 10, 4, 8);
    expect_part("type: uint64, bits: 48-63", 10, 0, 16);
    expect_part("type: uint64, order: EFGHABCD, bits: 0", 11, 0, 1);
    expect_part("type: uint64, order: DCBAHGFE, bits: 0", 12, 0, 1);
}

TEST(bits_of_several_registers_are_one_number_beside_others)
{
    read_text(
        FIELDS("- {name: a, table: holding, address: 10, type: uint32, bits: 12-19, value: "
               "165, enumeration: {165: on}}\n"
               "- {name: b, table: holding, address: 10, type: uint32, bits: 0-11, value: 1}\n"
               "- {name: c, table: holding, address: 10, type: uint32, value: 675841}\n"
               "- {name: d, table: holding, address: 20, type: uint64, order: CDAB, bits: "
               "0-63, value: 18446744073709551615}\n"));
    assert_int_equal(meter.planned[0].type, VALUE_BITS32);
    assert_int_equal(device_size(&meter.planned[0]), 2);
    assert_int_equal(device_values_in(&meter.planned[0]), 1);
    assert_int_equal(device_mask(&meter.planned[0], 0), 0x000F);
    assert_int_equal(device_mask(&meter.planned[0], 1), 0xF000);
    assert_int_equal(meter.fields[0].words[0], 0x000A);
    assert_int_equal(meter.fields[0].words[1], 0x5000);
    assert_string_equal(device_label_of(&meter, 0, meter.fields[0].words), "on");
    assert_int_equal(device_mask(&meter.planned[3], 3), 0xFFFF);
}

/* --- refusals --- */

static const struct {
    const char *keys, *reason;
} REFUSED[] = {
    {"type: bcd16, value: 10000", "2: value: \"10000\" is out of range of bcd16"},
    {"type: bcd16, value: -1", "2: value: \"-1\" is out of range of bcd16"},
    {"type: uint32_m10k, value: 100000000",
     "2: value: \"100000000\" is out of range of uint32_m10k"},
    {"type: float, value: 16777217",
     "2: value: \"16777217\" is a whole number that the type cannot hold exactly"},
    {"type: double, value: 9007199254740993",
     "2: value: \"9007199254740993\" is a whole number that the type cannot hold exactly"},
    {"type: float16, value: 70000", "2: value: \"70000\" is out of range of float16"},
    {"type: unix32, value: '2026-02-30T00:00:00Z'",
     "2: value: \"2026-02-30T00:00:00Z\" is a date that does not exist"},
    {"type: unix32, value: '2026-02-28T00:00:00'",
     "2: value: \"2026-02-28T00:00:00\" has no time zone: Z, or such as +01:00"},
    {"type: date, layout: Y M D, value: '2026-02-28T00:00:00Z'",
     "2: value: \"2026-02-28T00:00:00Z\" is not a day such as 2026-11-27"},
    {"type: date",
     "2: a date needs a layout, which says what its registers hold, such as \"Y M D h "
     "m s\""},
    {"type: date, layout: YMD",
     "2: layout: \"YMD\" is no layout of a date, such as \"Y M D h m s\" "
     "for six registers, or \"yM Dh ms\" for three with two parts each"},
    {"type: date, layout: Y M D h m s - - -",
     "2: layout: \"Y M D h m s - - -\" has 9 registers: a date has at most 8"},
    {"type: uint16, layout: hm", "2: layout is for fields of the types date and date_bcd"},
    {"type: uint16, time_zone: Z", "2: time_zone is for dates: a uint16 has none"},
    {"type: unix32, time_zone: CET",
     "2: time_zone: \"CET\" is neither Z nor an offset from UTC such as +01:00 or -03:30"},
    {"type: unix32, time_zone: +15:00",
     "2: time_zone: \"+15:00\" is neither Z nor an offset from UTC such as +01:00 or -03:30"},
    {"type: unix32, scale: 2", "2: a unix32 has no scale"},
    {"type: unix32, enumeration: {1: a}",
     "2: a unix32 has no enumeration: only integers and bits have one"},
    {"type: text_low, scale: 2, count: 3", "2: a text_low has no scale"},
    {"type: text_low", "2: a text needs its number of characters as count"},
    {"type: text_spaces, count: 5, value: 'a '",
     "2: value: \"a \" ends with a space, which would be lost among those that fill the field"},
    {"type: text_low, count: 126",
     "2: count is 126: these are 126 registers, and one request reads at most 125"},
    {"type: uint48, count: 42",
     "2: count is 42: these are 126 registers, and one request reads at most 125"},
    {"type: uint48, order: EFGHABCD",
     "2: order is EFGHABCD: the type uint48 has no halves of two registers"},
    {"type: iec870, order: CDABGHEF",
     "2: order is CDABGHEF: the type iec870 has no halves of two registers"},
    {"type: uint16, bits: 4-16",
     "2: bits: \"4-16\" goes beyond a uint16, which has the bits 0 to 15"},
    {"type: uint32, bits: 11-4", "2: bits: \"11-4\" is not a range such as 4-11, lowest bit first"},
    {"type: uint32, bits: 4..11",
     "2: bits: \"4..11\" is not a range such as 4-11, lowest bit first"},
    {"type: float, bits: 4-11", "2: bits are for fields of the types uint16, uint32 and uint64"},
    {"type: uint32, bits: 4-11, count: 2", "2: a field with bits has no count"},
    {"type: uint32, bits: 12-19, access: read-write",
     "2: access is read-write: bits of several registers cannot be written at once"},
    {"type: uint32, bits: 12-19, value: 256", "2: value: \"256\" is out of range of bits of 32"},
    {"type: bcd16, enumeration: {10000: a}", "2: enumeration: \"10000\" is out of range of bcd16"},
};

TEST(what_does_not_go_with_a_type_is_refused_with_its_line)
{
    for (unsigned i = 0; i < COUNT(REFUSED); i++) {
        char text[300];

        snprintf(text, sizeof text, "fields:\n- {name: a, table: holding, address: 10, %s}\n",
                 REFUSED[i].keys);
        expect_refused(text, REFUSED[i].reason);
    }
    expect_refused("time_zone: noon\n" FIELD("type: unix32"),
                   "1: time_zone: \"noon\" is neither Z nor an offset from UTC such as +01:00 or "
                   "-03:30");
}

TEST(fields_that_share_bits_of_a_wide_field_must_agree)
{
    expect_refused(
        FIELDS("- {name: a, table: holding, address: 10, type: uint32, bits: 12-19, value: 165}\n"
               "- {name: b, table: holding, address: 10, type: uint32, value: 0}\n"),
        "3: b shares an address with a of line 2, and has another value");
}
