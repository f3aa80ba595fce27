/* The keys of a device file that say what numbers mean, the conversions that they make, and the
 * types of fields that a plan does not know. */
#define _GNU_SOURCE
#include "conversion.h"
#include "decimal.h"
#include "device_text.h"

/* A file with one field that has these lines. */
#define FIELD(lines) "fields:\n  - name: level\n    table: holding\n    address: 7\n" lines
#define INT16(lines) FIELD("    type: int16\n    access: read-write\n" lines)
#define SCALED(scale, other) INT16("    scale: " scale "\n") "  - {name: sf, " other "}\n"

/* --- values of registers --- */

static void expect_text(const char *text, uint8_t status, uint16_t first, uint16_t second)
{
    const uint16_t words[4] = {first, second};
    char value[VALUE_TEXT_BYTES];
    mbm_registers registers;

    (void)mbm_registers_ofWords(&registers, words, 4, 7);
    assert_int_equal(
        conversion_print(&meter.fields->form, &registers, 7, meter.planned->count, 0, value),
        status);
    assert_string_equal(value, text);
    assert_int_equal(
        conversion_print(&meter.fields->form, &registers, 7, meter.planned->count, 1, value),
        status);
    if (status == MBM_NOT_AVAILABLE)
        assert_string_equal(value, "null");
}

static void expect_shown(const char *lines, const char *text, uint16_t first, uint16_t second)
{
    read_text(lines);
    expect_text(text, MBM_OK, first, second);
}

static void expect_none(const char *lines, uint16_t first, uint16_t second)
{
    read_text(lines);
    expect_text("", MBM_NOT_AVAILABLE, first, second);
}

TEST(an_offset_is_added_exactly_after_the_scale)
{
    expect_shown(INT16("    offset: -40\n"), "-28", 12, 0);
    expect_shown(INT16("    scale: 0.1\n    offset: -273.15\n"), "26.85", 3000, 0);
    expect_shown(INT16("    scale: -2.5\n    offset: 1e3\n"), "997.5", 1, 0);
    expect_shown(INT16("    scale: 0.1\n    offset: 0.2\n"), "0", (uint16_t)-2, 0);
    expect_shown(FIELD("    type: uint32\n    scale: 0.000000001\n    offset: 999999999\n"),
                 "1000000003.294967295", 0xFFFF, 0xFFFF);
    /* The shortest decimal number of the float, and not its binary fraction. */
    expect_shown(FIELD("    type: float\n    offset: 0.7\n"), "0.8", 0x3DCC, 0xCCCD);
    expect_shown(FIELD("    type: float\n    offset: 1\n"), "inf", 0x7F80, 0);
    /* 1e30, whose digits have no end in decimal. */
    expect_shown(FIELD("    type: float\n    scale: 1e30\n    offset: 1\n"), "1e+60", 0x7149,
                 0xF2CA);
}

TEST(a_precision_rounds_halves_away_from_zero)
{
    expect_shown(INT16("    scale: 0.01\n    precision: 1\n"), "0.3", 25, 0);
    expect_shown(INT16("    scale: 0.01\n    precision: 1\n"), "-0.3", (uint16_t)-25, 0);
    expect_shown(INT16("    scale: 0.01\n    precision: 1\n"), "0.2", 24, 0);
    expect_shown(INT16("    scale: 0.01\n    precision: 0\n"), "100", 9950, 0);
    expect_shown(INT16("    scale: 0.01\n    precision: 0\n"), "0", 49, 0);
    expect_shown(INT16("    scale: 0.01\n    precision: 0\n"), "0", (uint16_t)-49, 0);
    expect_shown(INT16("    precision: 3\n"), "7.000", 7, 0);
    expect_shown(FIELD("    type: float\n    precision: 2\n"), "230.10", 0x4366, 0x199A);
    /* It changes nothing of what is written. */
    read_text(INT16("    scale: 0.01\n    precision: 0\n    value: 1.25\n"));
    assert_int_equal(meter.fields->words[0], 125);
}

TEST(numbers_that_mean_not_available_are_no_value)
{
    expect_none(INT16("    not_available: 0x8000\n"), 0x8000, 0);
    expect_none(INT16("    not_available: -32768\n    scale: 0.1\n"), 0x8000, 0);
    expect_none(INT16("    not_available: [0x7FFF, 0x8000]\n"), 0x7FFF, 0);
    expect_shown(INT16("    not_available: [0x7FFF, 0x8000]\n"), "-1", 0xFFFF, 0);
    expect_none(INT16("    not_available: standard\n"), 0x8000, 0);
    expect_none(INT16("    not_available: [standard, 0]\n"), 0, 0);
    expect_none(INT16("    not_available: [standard, 0]\n"), 0x8000, 0);
    expect_none(INT16("    order: BADC\n    not_available: standard\n"), 0x0080, 0);
    expect_none(FIELD("    type: uint32\n    order: CDAB\n    not_available: 0x7FFFFFFF\n"), 0xFFFF,
                0x7FFF);
    expect_none(FIELD("    type: text\n    count: 4\n    not_available: standard\n"), 0, 0);
    expect_shown(FIELD("    type: text\n    count: 4\n    not_available: standard\n"), "x", 0x7800,
                 0);
    expect_shown(FIELD("    type: text\n    count: 4\n"), "", 0, 0);
    expect_none(FIELD("    type: float\n    not_available: -9999\n"), 0xC61C, 0x3C00);
}

TEST(of_a_number_of_24_bits_the_byte_above_does_not_count)
{
    expect_none(FIELD("    type: int24\n    not_available: -1\n"), 0x00FF, 0xFFFF);
    expect_none(FIELD("    type: int24\n    not_available: -1\n"), 0x12FF, 0xFFFF);
    expect_none(FIELD("    type: uint24\n    order: CDAB\n    not_available: 0xFFFFFF\n"), 0xFFFF,
                0x12FF);
    expect_shown(FIELD("    type: uint24\n    not_available: 0xFFFFFF\n"), "16777214", 0x12FF,
                 0xFFFE);
}

TEST(a_float_that_is_not_a_number_is_not_available_without_any_key)
{
    expect_none(FIELD("    type: float\n"), 0x7FC0, 0);
    expect_none(FIELD("    type: float\n    scale: 10\n    offset: 1\n"), 0xFFC0, 1);
    expect_none(FIELD("    type: double\n"), 0x7FF8, 0);
    expect_shown(FIELD("    type: float\n"), "-inf", 0xFF80, 0);
}

TEST(not_available_at_the_head_is_for_the_fields_that_it_fits)
{
    static const char *const file =
        "not_available: [0x8000, 0xFFFFFFFF, -1]\n"
        "fields:\n"
        "- {name: a, table: holding, address: 0, type: int16}\n"
        "- {name: b, table: holding, address: 1, type: uint32}\n"
        "- {name: c, table: holding, address: 3, type: uint16,\n"
        "   not_available: none}\n"
        "- {name: d, table: coils, address: 3}\n"
        "- {name: e, table: holding, address: 4, type: text, count: 2}\n"
        "- {name: f, table: holding, address: 5, type: int16,\n"
        "   not_available: 7}\n";
    read_text(file);
    /* 0x8000 and -1; 0xFFFFFFFF; none; none; none; its own. */
    assert_int_equal(meter.fields[0].conversion->number_count, 2);
    assert_int_equal(meter.fields[1].conversion->number_count, 1);
    assert_null(meter.fields[2].conversion);
    assert_null(meter.fields[3].conversion);
    assert_int_equal(meter.fields[4].conversion->number_count, 0);
    assert_int_equal(meter.fields[5].conversion->number_count, 1);
    read_text("not_available: standard\nfields:\n"
              "- {name: a, table: holding, address: 0, type: int16}\n"
              "- {name: b, table: holding, address: 0, type: bit, bit: 4, count: 2}\n");
    assert_int_equal(meter.fields[0].conversion->is_standard, 1);
}

/* --- a power of ten --- */

TEST(a_scale_may_be_the_name_of_the_field_with_the_power_of_ten)
{
    read_text("fields:\n"
              "- {name: set, table: holding, address: 9, type: int16, access: write, scale: sf}\n"
              "- {name: level, table: holding, address: 7, type: int16, scale: sf, value: 12.3}\n"
              "- {name: sf, table: holding, address: 8, type: int16, value: -1}\n");
    /* The field that cannot be read has become the last. */
    assert_int_equal(meter.fields[0].power_field, 1);
    assert_int_equal(meter.fields[1].power_field, -1);
    assert_int_equal(meter.fields[2].power_field, 1);
    assert_int_equal(meter.fields[0].words[0], 123);
    expect_text("12.3", MBM_OK, 123, 0);
    /* Without a value the power is 0. */
    read_text("fields:\n"
              "- {name: level, table: holding, address: 7, type: uint16, scale: sf, value: 12}\n"
              "- {name: sf, table: holding, address: 8, type: int16}\n");
    assert_int_equal(meter.fields[0].words[0], 12);
}

TEST(a_repeated_field_has_the_power_of_its_own_repetition)
{
    read_text("fields:\n"
              "- repeat: {count: 2, every: 10}\n"
              "  fields:\n"
              "  - {name: level, table: holding, address: 0, type: int16, scale: sf}\n"
              "  - {name: other, table: holding, address: 1, type: int16, scale: common}\n"
              "  - {name: sf, table: holding, address: 2, type: int16}\n"
              "- {name: common, table: holding, address: 100, type: int16}\n");
    assert_string_equal(meter.fields[meter.fields[0].power_field].name, "sf 1");
    assert_string_equal(meter.fields[meter.fields[3].power_field].name, "sf 2");
    assert_string_equal(meter.fields[meter.fields[4].power_field].name, "common");
}

TEST(a_field_that_cannot_have_a_power_of_ten_is_refused)
{
    expect_refused(INT16("    scale: nothing\n"),
                   "7: scale: \"nothing\" is neither a decimal number of up to 18 digits other "
                   "than 0 nor the name of a field");
    expect_refused(INT16("    scale: level\n"),
                   "7: scale: the field level in line 2 is the field itself");
    expect_refused(SCALED("sf", "table: holding, address: 8, type: float"),
                   "7: scale: the field sf in line 8 is no integer: a power of ten is one, mostly "
                   "an int16");
    expect_refused(SCALED("sf", "table: holding, address: 8, type: int16, unit: 2"),
                   "7: scale: the field sf in line 8 is of another unit");
    expect_refused(SCALED("sf", "table: holding, address: 8, type: int16, scale: 10"),
                   "7: scale: the field sf in line 8 has a scale or an offset itself");
    expect_refused(SCALED("sf", "table: holding, address: 8, type: int16, offset: 1"),
                   "7: scale: the field sf in line 8 has a scale or an offset itself");
    expect_refused(SCALED("sf", "table: holding, address: 8, type: int16, count: 2"),
                   "7: scale: the field sf in line 8 has several values");
    expect_refused(SCALED("sf", "table: holding, address: 8, type: int16, access: write"),
                   "7: scale: the field sf in line 8 cannot be read");
    expect_refused(SCALED("sf", "table: coils, address: 8"),
                   "7: scale: the field sf in line 8 is no integer: a power of ten is one, mostly "
                   "an int16");
    expect_refused(INT16("    scale: sf\n    value: 1.5\n") "  - {name: sf, table: holding, "
                                                            "address: 8, type: int16}\n",
                   "8: value: \"1.5\" is not a whole number");
}

/* --- refusals --- */

TEST(what_a_type_cannot_have_is_refused_with_its_line)
{
    static const struct {
        const char *file, *reason;
    } cases[] = {
        {FIELD("    type: text\n    count: 2\n    offset: 1\n"), "7: a text has no offset"},
        {FIELD("    type: text\n    count: 2\n    scale: sf\n"), "7: a text has no scale"},
        {FIELD("    type: text\n    count: 2\n    precision: 1\n"), "7: a text has no precision"},
        {FIELD("    type: bit\n    offset: 1\n"), "6: a bit has no offset"},
        {FIELD("    type: bit\n    not_available: 1\n"), "6: a bit has no not_available"},
        {FIELD("    type: bit\n    count: 3\n    not_available: 8\n"),
         "7: not_available: \"8\" is out of range of these bits"},
        {FIELD("    type: text\n    count: 2\n    not_available: 8\n"),
         "7: not_available of a text is \"standard\", all of its registers 0, or \"none\""},
        {INT16("    not_available: 0x18000\n"),
         "7: not_available: \"0x18000\" is out of range of int16"},
        {INT16("    not_available: 40000\n"),
         "7: not_available: \"40000\" is out of range of int16"},
        {INT16("    not_available: [0x8000,\n    never]\n"),
         "8: not_available: \"never\" is not a decimal number: it is a number such as 0x8000 or "
         "-1, \"standard\", a list of these, or \"none\""},
        {INT16("    offset: 1,5\n"),
         "7: offset: \"1,5\" is not a decimal number of up to 18 digits"},
        {INT16("    offset: 1e19\n"),
         "7: offset: \"1e19\" is not a decimal number of up to 18 digits"},
        {INT16("    precision: 19\n"),
         "7: precision: \"19\" is out of range: from 0 to 18 is allowed"},
        {INT16("    min_value: 5\n    max_value: 4.9\n"), "7: min_value is greater than max_value"},
        {INT16("    step: 0\n"), "7: step must be greater than 0"},
        {INT16("    step: -1\n"), "7: step must be greater than 0"},
        {INT16("    max_value: high\n"),
         "7: max_value: \"high\" is not a decimal number of up to 18 digits"},
        {FIELD("    type: int16\n    min_value: 5\n"),
         "6: min_value is for what is written, and the field cannot be written: a value that is "
         "read is shown as it is"},
        {FIELD("    type: text\n    count: 2\n    access: write\n    step: 1\n"),
         "8: a text has no step"},
        {INT16("    offset: 1\n    enumeration: {0: off}\n"),
         "8: a field with an offset has no enumeration"},
        {INT16("    precision: 1\n    enumeration: {0: off}\n"),
         "8: a field with a precision has no enumeration"},
        {INT16("    scale: 0.1\n    offset: -273.15\n    value: 20\n"),
         "9: value: \"20\" is not the offset and a multiple of the scale"},
        {INT16("    offset: -0.5\n    value: 20\n"),
         "8: value: \"20\" is not the offset and a whole number"},
        {"not_available: 0x800\n" INT16(""),
         "1: not_available: \"0x800\" at the head of the file must have 4, 8 or 16 digits after "
         "0x, and is for the fields of 16, 32 or 64 bits"},
        {"not_available: sometimes\n" INT16(""),
         "1: not_available: \"sometimes\" is not a number such as 0x8000 or -1, \"standard\", a "
         "list of these, or \"none\""},
    };

    for (unsigned i = 0; i < sizeof cases / sizeof cases[0]; i++)
        expect_refused(cases[i].file, cases[i].reason);
}

/* --- limits --- */

static void expect_limit(const char *text, const char *reason)
{
    const char *why = conversion_check(&meter.fields->form, text, strlen(text));

    if (reason)
        assert_string_equal(why, reason);
    else
        assert_null(why);
}

TEST(a_number_outside_its_limits_is_not_written)
{
    read_text(INT16("    scale: 0.1\n    min_value: 5\n    max_value: 30\n    step: 0.5\n"));
    expect_limit("5", NULL);
    expect_limit("30", NULL);
    expect_limit("5.5", NULL);
    expect_limit("3e1", NULL);
    expect_limit("4.9", "is less than min_value, which is 5");
    expect_limit("-1e99", "is less than min_value, which is 5");
    expect_limit("30.00000000000000000001", "is greater than max_value, which is 30");
    expect_limit("1e99", "is greater than max_value, which is 30");
    expect_limit("5.6", "is not min_value, 5, and a multiple of step, which is 0.5");
    read_text(INT16("    step: 25\n"));
    expect_limit("-50", NULL);
    expect_limit("0", NULL);
    expect_limit("1e6", NULL);
    expect_limit("26", "is not a multiple of step, which is 25");
    expect_limit("0.25", "is not a multiple of step, which is 25");
}

/* --- decimal numbers --- */

static void expect_sum(const char *one, const char *other, const char *sum)
{
    static decimal_number number;
    value_scale added;
    char text[DECIMAL_BYTES];

    assert_int_equal(decimal_read(one, strlen(one), &number), 1);
    assert_int_equal(decimal_read_short(other, &added), 1);
    assert_int_equal(decimal_add(&number, &added, 0), 1);
    decimal_print(&number, 0, text);
    assert_string_equal(text, sum);
    assert_int_equal(decimal_add(&number, &added, 1), 1);
    decimal_print(&number, 0, text);
    assert_string_equal(text, one);
}

TEST(decimal_numbers_are_added_exactly)
{
    expect_sum("0", "0", "0");
    expect_sum("1", "-1", "0");
    expect_sum("-0.1", "0.3", "0.2");
    expect_sum("999", "1", "1000");
    expect_sum("1000", "-0.001", "999.999");
    expect_sum("-5", "2", "-3");
    expect_sum("18446744073709551615", "0.000000000000000001",
               "18446744073709551615.000000000000000001");
}

TEST(decimal_numbers_are_rounded_with_their_carry)
{
    static const struct {
        const char *number;
        unsigned places;
        const char *rounded;
    } cases[] = {
        {"999.95", 1, "1000.0"}, {"-999.95", 1, "-1000.0"}, {"0.5", 0, "1"},
        {"0.49", 0, "0"},        {"0.05", 0, "0"},          {"12345", 2, "12345.00"},
        {"0.004", 2, "0.00"},    {"-0.004", 2, "0.00"},     {"1e20", 0, "100000000000000000000"},
        {"9.5", 0, "10"},        {"0.95", 1, "1.0"},
    };
    static decimal_number number;
    char text[DECIMAL_BYTES];

    for (unsigned i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        assert_int_equal(decimal_read(cases[i].number, strlen(cases[i].number), &number), 1);
        decimal_round(&number, cases[i].places);
        decimal_print(&number, cases[i].places, text);
        assert_string_equal(text, cases[i].rounded);
    }
}

/* --- types that a plan does not know: their values in registers, and
 * each refusal. */

#define FIELDS(fields) "fields:\n" fields
#define FIELD_WITH(keys) FIELDS("- {name: a, table: holding, address: 10, " keys "}\n")

/* Compares the words of the only field's value. */
#define HAS(keys, ...)                                                                             \
    do {                                                                                           \
        static const uint16_t wanted[] = {__VA_ARGS__};                                            \
                                                                                                   \
        read_text(FIELD_WITH(keys));                                                               \
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
    expect_refused("time_zone: noon\n" FIELD_WITH("type: unix32"),
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
