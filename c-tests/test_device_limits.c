/* The limits of a device, addresses as its manual prints them, and repeated fields: what is read
 * from a device file, and each refusal. */
#define _GNU_SOURCE
#include "device_text.h"

/* A file with this head and fields, which begin in the line after the head. */
#define FIELDS(head, fields) head "fields:\n" fields
#define FIELD(head, keys) FIELDS(head, "- {name: a, " keys "}\n")

/* --- limits --- */

TEST(a_device_without_limits_has_those_of_the_standard)
{
    read_text(FIELD("", "table: holding, address: 7, type: uint16, access: read-write"));
    assert_int_equal(meter.limits.read_registers, 0);
    assert_int_equal(meter.limits.read_bits, 0);
    assert_int_equal(meter.limits.register_gap, 0);
    assert_int_equal(meter.limits.bit_gap, 0);
    assert_int_equal(meter.limits.excluded_count, 0);
    assert_int_equal(meter.fields->write_function, DEVICE_BY_SIZE);
    assert_int_equal(device_most_written(&meter, MBM_TABLE_HOLDING_REGISTERS), 123);
    assert_int_equal(device_most_written(&meter, MBM_TABLE_COILS), 1968);
}

TEST(a_device_has_the_limits_of_its_file)
{
    read_text(FIELD("max_read_registers: 80\nmax_read_bits: 500\nmax_write_registers: 16\n"
                    "max_write_bits: 8\ngap: 10\nwrite_function: multiple\n",
                    "table: holding, address: 7, type: uint16, access: read-write"));
    assert_int_equal(meter.limits.read_registers, 80);
    assert_int_equal(meter.limits.read_bits, 500);
    assert_int_equal(meter.limits.register_gap, 10);
    assert_int_equal(meter.limits.bit_gap, 10);
    assert_int_equal(meter.fields->write_function, DEVICE_MULTIPLE);
    assert_int_equal(device_most_written(&meter, MBM_TABLE_HOLDING_REGISTERS), 16);
    assert_int_equal(device_most_written(&meter, MBM_TABLE_COILS), 8);
    read_text(FIELD("gap: {registers: 3, bits: 100}\n", "table: coils, address: 7"));
    assert_int_equal(meter.limits.register_gap, 3);
    assert_int_equal(meter.limits.bit_gap, 100);
    read_text(FIELD("gap: 2000\n", "table: coils, address: 7"));
    assert_int_equal(meter.limits.register_gap, 125);
    assert_int_equal(meter.limits.bit_gap, 2000);
}

TEST(a_field_is_written_by_its_own_function_or_that_of_the_head)
{
    read_text(
        FIELDS("write_function: single\n",
               "- {name: a, table: coils, address: 1, access: write}\n"
               "- {name: b, table: coils, address: 2, access: write, write_function: multiple}\n"
               "- {name: c, table: holding, address: 2, type: uint32}\n"));
    assert_int_equal(meter.fields[device_find(&meter, "a")].write_function, DEVICE_SINGLE);
    assert_int_equal(meter.fields[device_find(&meter, "b")].write_function, DEVICE_MULTIPLE);
}

static void expect_range(const char *head, uint8_t table, uint16_t first, uint16_t last,
                         uint16_t unit)
{
    char text[400];

    snprintf(text, sizeof text, "%sfields: [{name: a, table: coils, address: 7}]\n", head);
    read_text(text);
    assert_int_equal(meter.limits.excluded_count, 1);
    assert_int_equal(meter.limits.excluded->table, table);
    assert_int_equal(meter.limits.excluded->first, first);
    assert_int_equal(meter.limits.excluded->last, last);
    assert_int_equal(meter.limits.excluded->unit, unit);
}

TEST(excluded_addresses_have_a_long_and_a_short_form)
{
    expect_range("excluded: [{table: holding, address: 100, count: 20}]\n",
                 MBM_TABLE_HOLDING_REGISTERS, 100, 119, 0);
    expect_range("excluded: [{table: input, address: 65535, unit: 3}]\n", MBM_TABLE_INPUT_REGISTERS,
                 65535, 65535, 3);
    expect_range("excluded:\n- holding: 100-119\n", MBM_TABLE_HOLDING_REGISTERS, 100, 119, 0);
    expect_range("excluded: [discrete: 0]\n", MBM_TABLE_DISCRETE_INPUTS, 0, 0, 0);
}

TEST(a_field_that_can_only_be_written_may_lie_in_excluded_addresses)
{
    read_text(FIELDS("excluded: [holding: 5]\n",
                     "- {name: a, table: holding, address: 5, type: uint16, access: write}\n"
                     "- {name: b, table: input, address: 5, type: uint16}\n"));
}

TEST(a_wrong_limit_is_refused_with_its_line)
{
    static const struct {
        const char *text, *reason;
    } rows[] = {
        {FIELD("max_read_registers: 126\n", "table: coils, address: 1"),
         "1: max_read_registers: \"126\" is out of range: from 1 to 125 is allowed"},
        {FIELD("max_read_bits: 0\n", "table: coils, address: 1"),
         "1: max_read_bits: \"0\" is out of range: from 1 to 2000 is allowed"},
        {FIELD("max_write_registers: 124\n", "table: coils, address: 1"),
         "1: max_write_registers: \"124\" is out of range: from 1 to 123 is allowed"},
        {FIELD("max_write_bits: x\n", "table: coils, address: 1"),
         "1: max_write_bits: \"x\" is not a whole decimal number, here from 1 to 1968"},
        {FIELD("gap: 2001\n", "table: coils, address: 1"),
         "1: gap: \"2001\" is out of range: from 0 to 2000 is allowed"},
        {FIELD("gap: {registers: 126}\n", "table: coils, address: 1"),
         "1: registers: \"126\" is out of range: from 0 to 125 is allowed"},
        {FIELD("gap: {coils: 1}\n", "table: coils, address: 1"),
         "1: key: \"coils\" is not one of registers and bits"},
        {FIELD("write_function: both\n", "table: coils, address: 1"),
         "1: write_function: \"both\" is not one of single and multiple"},
        {FIELD("", "table: coils, address: 1, write_function: single"),
         "2: write_function is for fields that can be written: access is read"},
        {FIELD("mask_write: yes\n", "table: holding, address: 1, type: bit, access: read-write,\n"
                                    "  write_function: single"),
         "4: bits of a register are written by function 22: write_function says nothing about "
         "them"},
        {FIELD("write_function: single\n",
               "table: holding, address: 1, type: uint32, access: write"),
         "3: the field has 2 registers, and \"write_function: single\" writes one: only "
         "\"multiple\" can write it, if the device can"},
        {FIELD("max_read_registers: 3\n", "table: input, address: 1, type: double"),
         "3: the field has 4 registers, and max_read_registers is 3"},
        {FIELD("max_read_bits: 3\n", "table: coils, address: 1, count: 4"),
         "3: the field has 4 bits, and max_read_bits is 3"},
        {FIELD("max_write_registers: 3\n",
               "table: holding, address: 1, type: double, access: write"),
         "3: the field has 4 registers, and max_write_registers is 3"},
        {FIELD("max_write_bits: 3\n", "table: coils, address: 1, count: 4, access: read-write"),
         "3: the field has 4 coils, and max_write_bits is 3"},
        {FIELD("excluded: holding\n", "table: coils, address: 1"),
         "1: excluded must be a list: each item begins with \"-\""},
        {FIELD("excluded: [100-119]\n", "table: coils, address: 1"),
         "1: the excluded range has no table: write \"holding: 100-119\", or table, address and "
         "count"},
        {FIELD("excluded: [{holdings: 1}]\n", "table: coils, address: 1"),
         "1: table: \"holdings\" is not one of coils, discrete, holding and input"},
        {FIELD("excluded: [{address: 1, count: 2}]\n", "table: coils, address: 1"),
         "1: the excluded range has no key table"},
        {FIELD("excluded: [{table: holding, address: 65535, count: 2}]\n",
               "table: coils, address: 1"),
         "1: 2 addresses from 65535 on: addresses end at 65535"},
        {FIELD("excluded: [holding: 9-7]\n", "table: coils, address: 1"),
         "1: holding: \"9-7\" ends before it begins"},
        {FIELD("excluded: [holding: 5-6]\n", "table: holding, address: 4, type: uint32"),
         "3: the field has an address from 5 to 6, which excluded says must not be read"},
    };
    size_t i;

    for (i = 0; i < sizeof rows / sizeof rows[0]; i++)
        expect_refused(rows[i].text, rows[i].reason);
}

/* --- addresses --- */

static void expect_place(const char *head, const char *keys, uint8_t table, uint16_t address)
{
    char text[400];

    snprintf(text, sizeof text, "%sfields: [{name: a, %s%s}]\n", head, keys,
             table >= MBM_TABLE_HOLDING_REGISTERS ? ", type: uint16" : "");
    read_text(text);
    assert_int_equal(meter.planned->table, table);
    assert_int_equal(meter.planned->address, address);
}

TEST(an_address_of_modicon_says_its_table)
{
    static const struct {
        const char *text;
        uint8_t table;
        uint16_t address;
    } rows[] = {
        {"1", MBM_TABLE_COILS, 0},
        {"00001", MBM_TABLE_COILS, 0},
        {"9999", MBM_TABLE_COILS, 9998},
        {"010000", MBM_TABLE_COILS, 9999},
        {"065536", MBM_TABLE_COILS, 65535},
        {"10001", MBM_TABLE_DISCRETE_INPUTS, 0},
        {"100001", MBM_TABLE_DISCRETE_INPUTS, 0},
        {"30001", MBM_TABLE_INPUT_REGISTERS, 0},
        {"39999", MBM_TABLE_INPUT_REGISTERS, 9998},
        {"365536", MBM_TABLE_INPUT_REGISTERS, 65535},
        {"40101", MBM_TABLE_HOLDING_REGISTERS, 100},
        {"400101", MBM_TABLE_HOLDING_REGISTERS, 100},
        {"hr101", MBM_TABLE_HOLDING_REGISTERS, 100},
        {"HR65536", MBM_TABLE_HOLDING_REGISTERS, 65535},
        {"IR1", MBM_TABLE_INPUT_REGISTERS, 0},
        {"di7", MBM_TABLE_DISCRETE_INPUTS, 6},
        {"C7", MBM_TABLE_COILS, 6},
        {"co7", MBM_TABLE_COILS, 6},
    };
    char keys[80];
    size_t i;

    for (i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        snprintf(keys, sizeof keys, "address: %s", rows[i].text);
        expect_place("notation: modicon\n", keys, rows[i].table, rows[i].address);
        snprintf(keys, sizeof keys, "table: %s, address: %s", value_table_names[rows[i].table],
                 rows[i].text);
        expect_place("notation: modicon\n", keys, rows[i].table, rows[i].address);
    }
    expect_range("notation: modicon\nexcluded: [40101-40120]\n", MBM_TABLE_HOLDING_REGISTERS, 100,
                 119, 0);
    expect_range("notation: modicon\nexcluded: [{address: ir5, count: 2}]\n",
                 MBM_TABLE_INPUT_REGISTERS, 4, 5, 0);
}

TEST(the_addresses_of_a_file_may_count_from_1)
{
    expect_place("one_based: yes\n", "table: holding, address: 1", MBM_TABLE_HOLDING_REGISTERS, 0);
    expect_place("one_based: true\n", "table: holding, address: 65536", MBM_TABLE_HOLDING_REGISTERS,
                 65535);
    expect_place("one_based: no\n", "table: holding, address: 1", MBM_TABLE_HOLDING_REGISTERS, 1);
    expect_range("one_based: yes\nexcluded: [holding: 101-120]\n", MBM_TABLE_HOLDING_REGISTERS, 100,
                 119, 0);
}

static void expect_address_text(uint8_t notation, uint8_t table, uint16_t address, const char *text)
{
    const device of = {.notation = notation};

    assert_string_equal(device_address_text(&of, table, address), text);
}

TEST(an_address_is_printed_as_its_file_writes_it)
{
    expect_address_text(DEVICE_ON_WIRE, MBM_TABLE_HOLDING_REGISTERS, 100, "100");
    expect_address_text(DEVICE_ONE_BASED, MBM_TABLE_HOLDING_REGISTERS, 65535, "65536");
    expect_address_text(DEVICE_MODICON, MBM_TABLE_HOLDING_REGISTERS, 100, "40101");
    expect_address_text(DEVICE_MODICON, MBM_TABLE_INPUT_REGISTERS, 9998, "39999");
    expect_address_text(DEVICE_MODICON, MBM_TABLE_DISCRETE_INPUTS, 9999, "110000");
    expect_address_text(DEVICE_MODICON, MBM_TABLE_COILS, 0, "1");
    expect_address_text(DEVICE_MODICON, MBM_TABLE_COILS, 9999, "010000");
}

#define MODICON_HELP                                                                               \
    " is no address: in the notation modicon coils are 1 to 9999, discrete inputs 10001 to "       \
    "19999, input registers 30001 to 39999 and holding registers 40001 to 49999; with six digits " \
    "000001 to 065536, 100001 to 165536 and so on; also c1, di1, ir1 and hr1"

TEST(a_wrong_address_is_refused_with_what_its_notation_allows)
{
    static const char *const NONE[] = {"0",      "40000",   "20001", "50001",  "400000",
                                       "465537", "1234567", "hr0",   "hr",     "hr01",
                                       "xr1",    "4x101",   "-1",    "hr65537"};
    static const struct {
        const char *text, *reason;
    } rows[] = {
        {FIELD("notation: modicon\n", "table: input, address: 40101, type: uint16"),
         "3: address: \"40101\" is an address of the table holding, not of input"},
        {FIELD("notation: modbus\n", "table: coils, address: 1"),
         "1: notation: \"modbus\" is not one of wire and modicon"},
        {FIELD("one_based: 1\n", "table: coils, address: 1"),
         "1: one_based: \"1\" is not one of no, yes, false and true"},
        {FIELD("notation: modicon\none_based: yes\n", "table: coils, address: 1"),
         "2: one_based and \"notation: modicon\" exclude each other: 40001 counts from 1 already"},
        {FIELD("one_based: yes\n", "table: coils, address: 0"),
         "3: address: \"0\" is out of range: from 1 to 65536 is allowed"},
        {FIELD("one_based: yes\n", "table: holding, address: 65536, type: float"),
         "3: the field has 2 registers from address 65536 on: addresses end at 65536"},
        {FIELD("", "table: coils, address: 040101"),
         "2: address: \"040101\" begins with 0: write a decimal number"},
        {FIELD("", "table: holding, address: hr101"),
         "2: address: \"hr101\" is not a whole decimal number, here from 0 to 65535"},
        {FIELD("one_based: yes\n", "address: 5"), "3: the field has no key table"},
        {FIELD("notation: modicon\nexcluded: [holding: 30101]\n", "address: 1"),
         "2: holding: \"30101\" is an address of the table input, not of holding"},
        {FIELD("notation: modicon\nexcluded: [40101-30105]\n", "address: 1"),
         "2: excluded: \"30105\" is an address of the table input, not of holding"},
    };
    char text[100], reason[500];
    size_t i;

    for (i = 0; i < sizeof rows / sizeof rows[0]; i++)
        expect_refused(rows[i].text, rows[i].reason);
    for (i = 0; i < sizeof NONE / sizeof NONE[0]; i++) {
        snprintf(text, sizeof text, "notation: modicon\nfields: [{name: a, address: %s}]\n",
                 NONE[i]);
        snprintf(reason, sizeof reason, "2: address: \"%s\"" MODICON_HELP, NONE[i]);
        expect_refused(text, reason);
    }
}

/* --- repeated fields --- */

static void expect_field(uint16_t at, const char *name, uint16_t address)
{
    assert_string_equal(meter.fields[at].name, name);
    assert_int_equal(meter.planned[at].address, address);
}

TEST(a_field_is_repeated_with_a_number_in_its_name)
{
    read_text(FIELDS("", "- name: channel {n} voltage of {n}\n"
                         "  table: input\n  address: 5\n  type: float\n  value: 1.5\n"
                         "  description: Channel {n}\n"
                         "  repeat: {count: 3, every: 40}\n"
                         "- {name: temperature, table: input, address: 200, type: int16,\n"
                         "   repeat: {count: 2, every: 1, first: 0}}\n"));
    assert_int_equal(meter.count, 5);
    expect_field(0, "channel 1 voltage of 1", 5);
    expect_field(1, "channel 2 voltage of 2", 45);
    expect_field(2, "channel 3 voltage of 3", 85);
    expect_field(3, "temperature 0", 200);
    expect_field(4, "temperature 1", 201);
    assert_string_equal(meter.fields[2].description, "Channel 3");
    assert_int_equal(meter.fields[2].line, 2);
    assert_int_equal(meter.fields[2].words[0], 0x3FC0);
}

TEST(a_group_of_fields_is_repeated_together)
{
    read_text(FIELDS("notation: modicon\n",
                     "- name: serial\n  address: 40001\n  type: uint32\n"
                     "- repeat: {count: 2, every: 10}\n"
                     "  fields:\n"
                     "  - name: channel {n} voltage\n    address: 30101\n    type: uint16\n"
                     "  - {name: current, address: 30102, type: uint16}\n"));
    assert_int_equal(meter.count, 5);
    expect_field(0, "serial", 0);
    expect_field(1, "channel 1 voltage", 100);
    expect_field(2, "current 1", 101);
    expect_field(3, "channel 2 voltage", 110);
    expect_field(4, "current 2", 111);
}

TEST(a_name_outside_a_repetition_keeps_its_braces)
{
    read_text(FIELDS("", "- name: a {n}\n  table: coils\n  address: 1\n"));
    assert_string_equal(meter.fields->name, "a {n}");
}

TEST(a_device_may_have_as_many_repeated_fields_as_a_plan)
{
    read_text(FIELD("", "table: coils, address: 1, repeat: {count: 4000, every: 1}"));
    assert_int_equal(meter.count, 4000);
    expect_field(3999, "a 4000", 4000);
}

#define LONG_NAME                                                                                  \
    "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa"                                             \
    "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa" /* 98 */

TEST(a_wrong_repetition_is_refused_with_its_line)
{
    static const struct {
        const char *text, *reason;
    } rows[] = {
        {FIELD("", "table: coils, address: 1, repeat: 3"),
         "2: repeat must be a mapping of keys, such as \"count:\""},
        {FIELD("", "table: coils, address: 1, repeat: {count: 3}"), "2: repeat has no key every"},
        {FIELD("", "table: coils, address: 1, repeat: {every: 3}"), "2: repeat has no key count"},
        {FIELD("", "table: coils, address: 1, repeat: {count: 0, every: 3}"),
         "2: count: \"0\" is out of range: from 1 to 16383 is allowed"},
        {FIELD("", "table: coils, address: 1, repeat: {count: 2, every: 0}"),
         "2: every: \"0\" is out of range: from 1 to 65535 is allowed"},
        {FIELD("", "table: coils, address: 1, repeat: {count: 2, every: 1, first: -1}"),
         "2: first: \"-1\" is not a whole decimal number, here from 0 to 65535"},
        {FIELD("", "table: coils, address: 1, repeat: {count: 3, every: 40000}"),
         "2: repetition 3: the field is 80000 addresses after 1: addresses end at 65535"},
        {FIELD("", "table: holding, address: 1, type: uint32, repeat: {count: 3, every: 32767}"),
         "2: repetition 3: the field has 2 registers from address 65535 on: addresses end at "
         "65535"},
        {FIELDS("", "- {name: a 2, table: coils, address: 1}\n"
                    "- {name: a, table: coils, address: 5, repeat: {count: 3, every: 1}}\n"),
         "3: repetition 2: the field in line 2 has the name a 2 too"},
        {FIELDS("", "- {name: \"" LONG_NAME LONG_NAME "aa\", table: coils, address: 5,\n"
                    "  repeat: {count: 10, every: 1}}\n"),
         "2: repetition 10: name has more than 200 bytes with its number"},
        {FIELDS("", "- {name: \"{n}" LONG_NAME LONG_NAME "\", table: coils, address: 5,\n"
                    "  repeat: {count: 2, every: 1, first: 10000}}\n"),
         "2: repetition 10000: name has more than 200 bytes with its number"},
        {FIELDS("", "- fields: [{name: a, table: coils, address: 1}]\n"),
         "2: the group of fields has no key repeat"},
        {FIELDS("", "- repeat: {count: 2, every: 2}\n  fields: []\n"), "3: fields is empty"},
        {FIELDS("", "- repeat: {count: 2, every: 2}\n"), "2: the field has no key name"},
        {FIELDS("", "- {repeat: {count: 2, every: 2}, fields: [{name: a, table: coils,\n"
                    "   address: 1, repeat: {count: 2, every: 2}}]}\n"),
         "3: repetition 1: a field of a group that is repeated is not repeated itself"},
        {FIELDS("",
                "- {repeat: {count: 2, every: 2}, fields: [{name: a, table: coils, address: 1}],"
                " unit: 3}\n"),
         "2: key: \"unit\" is not one of repeat and fields"},
        {FIELD("excluded: [coils: 4]\n", "table: coils, address: 1, repeat: {count: 5, every: 1}"),
         "3: repetition 4: the field has an address from 4 to 4, which excluded says must not be "
         "read"},
        {FIELDS("", "- {name: a, table: coils, address: 1, repeat: {count: 16383, every: 1}}\n"
                    "- {name: b, table: coils, address: 1}\n"),
         "3: the file has more than 16383 fields"},
    };
    size_t i;

    for (i = 0; i < sizeof rows / sizeof rows[0]; i++)
        expect_refused(rows[i].text, rows[i].reason);
}
