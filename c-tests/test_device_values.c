/* The keys of a device file that say what numbers mean, and the conversions that they make. */
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
