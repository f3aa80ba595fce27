/* The device file: what is read from it, and each refusal with the line and the reason. */
#define _GNU_SOURCE
#include "place.h"
#include "report.h"
#include "device_text.h"

/* A file with one field that has these lines. */
#define FIELD(lines) "fields:\n  - name: level\n    table: holding\n    address: 7\n" lines
#define UINT16(lines) FIELD("    type: uint16\n" lines)

/* --- what is read --- */

TEST(a_field_has_what_its_file_says)
{
    const mbm_planField *planned;

    read_text("device: SDM120\nunit: 3\ninterval: 2s\norder: CDAB\n"
              "fields:\n"
              "  - name: voltage\n"
              "    table: input\n"
              "    address: 65534\n"
              "    type: float\n"
              "    scale: 0.1\n"
              "    unit_of_measurement: V\n"
              "    description: Phase 1, voltage\n"
              "    value: 23.5\n"
              "  - {name: model, table: holding, address: 0, type: text, count: 5, interval: 1m,\n"
              "     unit: 255, order: ABCD, access: read-write}\n");
    assert_string_equal(meter.name, "SDM120");
    assert_int_equal(meter.count, 2);
    assert_int_equal(meter.readable, 2);
    const device_field *field = meter.fields;
    planned = meter.planned;
    assert_string_equal(field->name, "voltage");
    assert_string_equal(field->unit_of_measurement, "V");
    assert_string_equal(field->description, "Phase 1, voltage");
    assert_int_equal(field->line, 6);
    assert_int_equal(field->access, DEVICE_READ);
    assert_int_equal(field->form.scale.digits, 1);
    assert_int_equal(field->form.scale.exponent, -1);
    assert_int_equal(planned->unit, 3);
    assert_int_equal(planned->table, MBM_TABLE_INPUT_REGISTERS);
    assert_int_equal(planned->address, 65534);
    assert_int_equal(planned->type, MBM_TYPE_FLOAT);
    assert_int_equal(planned->order, MBM_ORDER_CDAB);
    assert_int_equal(planned->intervalMs, 2000);
    assert_int_equal(device_size(planned), 2);
    /* 235 is 0x436B0000, and the low word comes first. */
    assert_int_equal(field->words[0], 0x0000);
    assert_int_equal(field->words[1], 0x436B);
    field++;
    planned++;
    assert_int_equal(field->access, DEVICE_READ | DEVICE_WRITE);
    assert_null(field->words);
    assert_null(field->unit_of_measurement);
    assert_int_equal(field->line, 14);
    assert_int_equal(planned->unit, 255);
    assert_int_equal(planned->count, 5);
    assert_int_equal(planned->order, MBM_ORDER_ABCD);
    assert_int_equal(planned->intervalMs, 60000);
    assert_int_equal(device_size(planned), 3);
    assert_int_equal(device_find(&meter, "model"), 1);
    assert_int_equal(device_find(&meter, "mode"), -1);
}

TEST(what_a_file_leaves_out_has_the_documented_value)
{
    read_text(UINT16(""));
    assert_null(meter.name);
    assert_int_equal(meter.planned->unit, 1);
    assert_int_equal(meter.planned->intervalMs, 1000);
    assert_int_equal(meter.planned->order, MBM_ORDER_ABCD);
    assert_int_equal(meter.planned->count, 1);
    assert_int_equal(meter.fields->access, DEVICE_READ);
    assert_int_equal(meter.fields->form.scale.digits, 0);
    read_text("fields: [{name: a, table: coils, address: 65535}]\n");
    assert_int_equal(meter.planned->type, MBM_TYPE_BIT);
}

TEST(fields_that_can_only_be_written_come_last)
{
    static const char *const names[] = {"b", "d", "a", "c"};

    read_text("fields:\n"
              "- {name: a, table: holding, address: 0, type: uint16, access: write}\n"
              "- {name: b, table: holding, address: 1, type: uint16}\n"
              "- {name: c, table: holding, address: 2, type: uint16, access: write}\n"
              "- {name: d, table: holding, address: 3, type: uint16, access: read-write}\n");
    assert_int_equal(meter.count, 4);
    assert_int_equal(meter.readable, 2);
    for (unsigned i = 0; i < 4; i++) {
        assert_string_equal(meter.fields[i].name, names[i]);
        assert_int_equal(meter.planned[i].address, names[i][0] - 'a');
    }
}

static void expect_words(const char *text, unsigned count, const uint16_t *words)
{
    read_text(text);
    assert_non_null(meter.fields->words);
    assert_int_equal(device_size(meter.planned), count);
    for (unsigned i = 0; i < count; i++)
        assert_int_equal(meter.fields->words[i], words[i]);
}

#define WORDS(text, ...)                                                                           \
    expect_words(text, sizeof((const uint16_t[]){__VA_ARGS__}) / 2, (const uint16_t[]){__VA_ARGS__})

TEST(bits_of_a_register_are_written_if_the_device_writes_masks)
{
    read_text("mask_write: true\n" FIELD("    type: bit\n    access: write\n"));
    device_free(&meter);
    read_text("mask_write: yes\nfields:\n"
              "  - {name: pump, table: holding, address: 7, type: bit, bit: 3, access: write}\n"
              "  - {name: mode, table: holding, address: 7, type: bit, bit: 4, count: 3,\n"
              "     order: BADC, access: read-write}\n");
    assert_int_equal(meter.writes_masks, 1);
    /* The field that can be read comes first. Its order swaps the bytes of the register. */
    assert_int_equal(device_mask(&meter.planned[0], 0), 0x7000);
    assert_int_equal(device_part(&meter.planned[0], 5), 0x5000);
    assert_int_equal(device_mask(&meter.planned[1], 0), 0x0008);
    assert_int_equal(device_part(&meter.planned[1], 1), 0x0008);
    read_text("mask_write: no\n" UINT16(""));
    assert_int_equal(meter.writes_masks, 0);
}

TEST(a_value_becomes_registers_exactly)
{
    WORDS(UINT16("    value: 65535\n"), 65535);
    WORDS(UINT16("    scale: 0.1\n    value: 230.1\n"), 2301);
    WORDS(UINT16("    scale: 0.1\n    order: BADC\n    value: 230.1\n"), 0xFD08);
    WORDS(UINT16("    count: 3\n    value: [1, 2, 3]\n"), 1, 2, 3);
    WORDS(FIELD("    type: int16\n    value: -2\n"), 0xFFFE);
    WORDS(FIELD("    type: uint32\n    order: DCBA\n    value: 2923517522\n"), 0x5256, 0x41AE);
    WORDS(FIELD("    type: int64\n    value: -9223372036854775808\n"), 0x8000, 0, 0, 0);
    WORDS(FIELD("    type: int32\n    count: 2\n    value:\n    - -1\n    - 1\n"), 0xFFFF, 0xFFFF,
          0, 1);
    WORDS(FIELD("    type: float\n    value: 230.1\n"), 0x4366, 0x199A);
    WORDS(FIELD("    type: double\n    value: -1e3\n"), 0xC08F, 0x4000, 0, 0);
    WORDS(FIELD("    type: text\n    count: 5\n    value: abc\n"), 0x6162, 0x6300, 0);
    WORDS(FIELD("    type: text\n    count: 4\n    value: \"21 \xC2\xB0\"\n"), 0x3231, 0x20B0);
    WORDS(FIELD("    type: bit\n    bit: 15\n    value: on\n"), 0x8000);
    WORDS(FIELD("    type: bit\n    bit: 4\n    count: 3\n    value: 5\n"), 0x0050);
    WORDS(FIELD("    type: bit\n    count: 16\n    value: 65535\n"), 0xFFFF);
    WORDS(FIELD("    type: bit\n    bit: 4\n    order: BADC\n    value: on\n"), 0x1000);
    WORDS("fields: [{name: a, table: coils, address: 0, value: on}]", 1);
    WORDS("fields: [{name: a, table: coils, address: 0, count: 4, value: [1, 0, true, off]}]", 1, 0,
          1, 0);
}

/* --- what is refused --- */

TEST(a_wrong_word_is_refused_with_its_line)
{
    static const struct {
        const char *text, *reason;
    } rows[] = {
        {FIELD("    type: real\n"),
         "5: type: \"real\" is not one of the 38 words in docs/device-file.md: among them are bit, "
         "uint16, int16, uint32, int32, uint64, int64, float, double and text"},
        {FIELD("    type: FLOAT\n"), "5: type: \"FLOAT\" is not one of the 38 words in "
                                     "docs/device-file.md: the nearest are float and float16"},
        {FIELD("    type: bcd\n"), "5: type: \"bcd\" is not one of the 38 words in "
                                   "docs/device-file.md: the nearest are bcd16 and bcd32"},
        {FIELD("    type: uint8\n"),
         "5: type: \"uint8\" is not one of the 38 words in "
         "docs/device-file.md: the nearest are uint48, uint16, uint32 and uint64"},
        {FIELD("    type: secondss_2000\n"),
         "5: type: \"secondss_2000\" is not one of the 38 words in docs/device-file.md: the nearest "
         "is seconds_2000"},
        {"fields:\n- name: a\n  table: holdings\n  address: 0\n  type: uint16\n",
         "3: table: \"holdings\" is not one of coils, discrete, holding and input"},
        {UINT16("    order: abcd\n"),
         "6: order: \"abcd\" is not one of ABCD, CDAB, BADC, DCBA, EFGHABCD, "
         "CDABGHEF, FEHGBADC and DCBAHGFE"},
        {"order: 1234\n" UINT16(""),
         "1: order: \"1234\" is not one of ABCD, CDAB, BADC, DCBA, EFGHABCD, "
         "CDABGHEF, FEHGBADC and DCBAHGFE"},
        {UINT16("    access: rw\n"), "6: access: \"rw\" is not one of read, write and read-write"},
        {"fields: [{name: a, table: coils, address: 0, value: yes}]",
         "1: value: \"yes\" is not one of 0, 1, false, true, off and on"},
        {UINT16("    unit: 300\n"), "6: unit: \"300\" is out of range: from 0 to 255 is allowed"},
        {"unit: 256\n" UINT16(""), "1: unit: \"256\" is out of range: from 0 to 255 is allowed"},
        {UINT16("    unit: one\n"),
         "6: unit: \"one\" is not a whole decimal number, here from 0 to 255"},
        {UINT16("    unit: 0x10\n"), "6: unit: \"0x10\" begins with 0: write a decimal number"},
        {UINT16("    unit: 017\n"), "6: unit: \"017\" begins with 0: write a decimal number"},
        {UINT16("    unit: +5\n"),
         "6: unit: \"+5\" is not a whole decimal number, here from 0 to 255"},
        {"fields:\n- name: a\n  table: input\n  address: 65536\n  type: uint16\n",
         "4: address: \"65536\" is out of range: from 0 to 65535 is allowed"},
        {UINT16("    interval: 500\n"), "6: interval: \"500\" is not a time: write a whole number "
                                        "and its unit, such as 500ms, 2s or 1m"},
        {UINT16("    interval: 0ms\n"),
         "6: interval: \"0ms\" is out of range: from 1ms to 24h is allowed"},
        {"interval: 25h\n" UINT16(""),
         "1: interval: \"25h\" is out of range: from 1ms to 24h is allowed"},
        {UINT16("    count: 0\n"), "6: count: \"0\" is out of range: from 1 to 2000 is allowed"},
        {UINT16("    scale: 0\n"),
         "6: scale: \"0\" is not a decimal number of up to 18 digits other than 0"},
        {UINT16("    scale: 0,1\n"),
         "6: scale: \"0,1\" is not a decimal number of up to 18 digits other than 0"},
    };

    for (unsigned i = 0; i < COUNT(rows); i++)
        expect_refused(rows[i].text, rows[i].reason);
}

TEST(a_key_that_does_not_exist_is_refused_with_those_that_do)
{
    expect_refused_like("maker: a\n" UINT16(""),
                        "1: key: \"maker\" is not one of device, unit, interval, order, ");
    expect_refused_like(UINT16("    addr: 5\n"),
                        "6: key: \"addr\" is not one of name, table, address, type, bit, ");
}

TEST(a_wrong_key_is_refused_with_its_line)
{
    static const struct {
        const char *text, *reason;
    } rows[] = {
        {UINT16("    address: 7\n"), "6: address is there twice, first in line 4"},
        {UINT16("    name: b\n"), "6: name is there twice, first in line 2"},
        {UINT16("unit: 1\nunit: 2\n"), "7: unit is there twice, first in line 6"},
        {UINT16("    [a]: 1\n"), "6: key is a list: it must be one word"},
        {UINT16("    \"\": 1\n"), "6: key is empty"},
        {"fields:\n- table: holding\n  address: 0\n  type: uint16\n",
         "2: the field has no key name"},
        {"fields:\n- name: a\n  address: 0\n  type: uint16\n", "2: the field has no key table"},
        {"fields:\n- name: a\n  table: input\n  type: uint16\n", "2: the field has no key address"},
        {"fields:\n- name: a\n  table: input\n  address: 0\n", "2: the field has no key type"},
        {FIELD("    type: text\n"), "2: a text needs its number of characters as count"},
        {"unit: 1\n", "1: the file has no key fields"},
        {"- a\n", "1: the file must be a mapping of keys, such as \"device:\""},
        {"meter\n", "1: the file must be a mapping of keys, such as \"device:\""},
        {"", " the file is empty"},
        {"# nothing\n", " the file is empty"},
        {"fields: []\n", "1: fields is empty"},
        {"fields:\n", "1: fields must be a list: each item begins with \"-\""},
        {"fields:\n  name: a\n", "2: fields must be a list: each item begins with \"-\""},
        {"fields:\n  - a\n", "2: the field must be a mapping of keys, such as \"name:\""},
        {"fields:\n  - [a]\n", "2: the field must be a mapping of keys, such as \"name:\""},
        {UINT16("    unit: [1, 2]\n"), "6: unit is a list: it must be one word"},
        {UINT16("    unit: {a: b}\n"), "6: unit is a mapping: it must be one word"},
        {UINT16("    unit:\n"), "6: unit is empty"},
        {UINT16("    description: \"a\\0b\"\n"), "6: description has a control character"},
        {UINT16("    description: \"a\\nb\"\n"), "6: description has a control character"},
        {UINT16("    description: \"a\\x9Bb\"\n"), "6: description has a control character"},
        {"device: \"\"\n" UINT16(""), "1: device is empty"},
        {UINT16("---\n") UINT16(""), "7: a second document begins: the file has one"},
    };

    for (unsigned i = 0; i < COUNT(rows); i++)
        expect_refused(rows[i].text, rows[i].reason);
}

TEST(keys_that_do_not_go_together_are_refused)
{
    static const struct {
        const char *text, *reason;
    } rows[] = {
        {UINT16("    bit: 3\n"),
         "6: bit is for fields of the type bit in the tables holding and input"},
        {"fields: [{name: a, table: coils, address: 0,\n bit: 3}]",
         "2: bit is for fields of the type bit in the tables holding and input"},
        {FIELD("    type: bit\n    bit: 16\n"),
         "6: bit: \"16\" is out of range: from 0 to 15 is allowed"},
        {FIELD("    type: bit\n    bit: 13\n    count: 4\n"),
         "7: the field has 4 bits from bit 13 on: a register has the bits 0 to 15"},
        {FIELD("    type: bit\n    access: read-write\n"),
         "6: access is read-write: bits of a register cannot be written, unless the device has "
         "function 22 and the file says \"mask_write: yes\""},
        {"mask_write: no\n" FIELD("    type: bit\n    access: write\n"),
         "7: access is write: bits of a register cannot be written, unless the device has function "
         "22 and the file says \"mask_write: yes\""},
        {"mask_write: 1\n" UINT16(""),
         "1: mask_write: \"1\" is not one of no, yes, false and true"},
        {"mask_write: false\n" FIELD("    type: bit\n    access: write\n"),
         "7: access is write: bits of a register cannot be written, unless the device has function "
         "22 and the file says \"mask_write: yes\""},
        {FIELD("    type: bit\n    bit: 1\n    scale: 2\n"), "7: a bit has no scale"},
        {"fields: [{name: a, table: coils, address: 0,\n type: uint16}]",
         "2: type is uint16: the type of coils and discrete inputs is bit"},
        {"fields: [{name: a, table: discrete, address: 0,\n access: write}]",
         "2: access is write: only coils and holding registers can be written"},
        {"fields: [{name: a, table: input, address: 0, type: float,\n access: read-write}]",
         "2: access is read-write: only coils and holding registers can be written"},
        {"fields: [{name: a, table: coils, address: 0,\n scale: 2}]", "2: a bit has no scale"},
        {FIELD("    type: text\n    count: 2\n    scale: 2\n"), "7: a text has no scale"},
        {UINT16("    count: 126\n"),
         "6: count is 126: these are 126 registers, and one request reads at most 125"},
        {FIELD("    type: double\n    count: 32\n"),
         "6: count is 32: these are 128 registers, and one request reads at most 125"},
        {FIELD("    type: text\n    count: 251\n"),
         "6: count is 251: these are 126 registers, and one request reads at most 125"},
        {"fields:\n- name: a\n  table: input\n  type: double\n  address: 65533\n",
         "5: the field has 4 registers from address 65533 on: addresses end at 65535"},
        {"fields:\n- name: a\n  table: coils\n  count: 9\n  address: 65530\n",
         "5: the field has 9 bits from address 65530 on: addresses end at 65535"},
        {UINT16("") "  - {name: level, table: input, address: 7, type: uint16}\n",
         "6: the field in line 2 has the name level too"},
        {UINT16(
             "    count: 2\n    value: [1, 2]\n") "  - {name: b, table: holding, address: 8, type: uint16, value: 3}\n",
         "8: b shares an address with level of line 2, and has another value"},
        {UINT16(
             "    value: 12\n") "  - {name: b, table: holding, address: 7, type: bit, bit: 2, value: off}\n",
         "7: b shares an address with level of line 2, and has another value"},
    };

    for (unsigned i = 0; i < COUNT(rows); i++)
        expect_refused(rows[i].text, rows[i].reason);
    read_text(UINT16(
        "    value: 12\n") "  - {name: b, table: holding, address: 7, type: bit, bit: 2, count: 2, value: 3}\n"
                           "  - {name: c, table: input, address: 7, type: uint16, value: 1}\n"
                           "  - {name: d, table: holding, address: 7, type: uint16, unit: 2, value: 2}\n"
                           "  - {name: e, table: holding, address: 4, type: uint64}\n");
}

TEST(a_value_that_the_registers_cannot_hold_is_refused)
{
    static const struct {
        const char *text, *reason;
    } rows[] = {
        {UINT16("    value: 65536\n"), "6: value: \"65536\" is out of range of uint16"},
        {UINT16("    value: -1\n"), "6: value: \"-1\" is out of range of uint16"},
        {UINT16("    value: 1.5\n"), "6: value: \"1.5\" is not a whole number"},
        {UINT16("    value: high\n"), "6: value: \"high\" is not a decimal number"},
        {UINT16("    value: 21,5\n"), "6: value: \"21,5\" is not a decimal number"},
        {UINT16("    value: 0x10\n"), "6: value: \"0x10\" is not a decimal number"},
        {UINT16("    scale: 0.1\n    value: 230.15\n"),
         "7: value: \"230.15\" is not a multiple of the scale"},
        {FIELD("    type: bit\n    count: 3\n    value: 8\n"),
         "7: value: \"8\" is out of range: from 0 to 7 is allowed"},
        {UINT16("    value: [1]\n"), "6: value is a list: it must be one word"},
        {UINT16("    count: 2\n    value: 1\n"),
         "7: value must be a list of 2 values, as count says"},
        {UINT16("    count: 2\n    value: [1]\n"),
         "7: value must be a list of 2 values, as count says"},
        {UINT16("    count: 2\n    value:\n    - 1\n    - 2\n    - 3\n"),
         "8: value must be a list of 2 values, as count says"},
        {UINT16("    count: 2\n    value:\n    - 1\n    - x\n"),
         "9: value: \"x\" is not a decimal number"},
        {FIELD("    type: float\n    value: 1e39\n"),
         "6: value: \"1e39\" is out of range of float"},
        {FIELD("    type: text\n    count: 2\n    value: abc\n"),
         "7: value has 3 characters, and count is 2"},
        {FIELD("    type: text\n    count: 9\n    value: \"\xE2\x82\xAC\"\n"),
         "7: value has a character that is not in Latin-1"},
        {FIELD("    type: text\n    count: 9\n    value: [a]\n"),
         "7: value is a list: it must be one word"},
    };

    for (unsigned i = 0; i < COUNT(rows); i++)
        expect_refused(rows[i].text, rows[i].reason);
}

TEST(an_enumeration_names_the_numbers_of_its_field)
{
    static const uint16_t off[] = {0, 1}, on[] = {0xFFFF, 0xFFFF}, other[] = {1, 0};
    static const uint16_t swapped[] = {0x0400}, bits[] = {5}, none[] = {4};

    read_text(FIELD("    type: int32\n    enumeration:\n      1: off\n      -1: \"on\"\n"));
    assert_int_equal(meter.fields->label_count, 2);
    assert_string_equal(meter.fields->labels[1].number, "-1");
    assert_int_equal(meter.fields->labels[1].line, 8);
    assert_string_equal(device_label_of(&meter, 0, off), "off");
    assert_string_equal(device_label_of(&meter, 0, on), "on");
    assert_null(device_label_of(&meter, 0, other));
    read_text(UINT16("    order: BADC\n    enumeration: {4: running}\n"));
    assert_string_equal(device_label_of(&meter, 0, swapped), "running");
    assert_null(device_label_of(&meter, 0, none));
    read_text(
        FIELD("    type: bit\n    bit: 4\n    count: 3\n    enumeration: {5: keypad, 7: bus}\n"));
    assert_string_equal(device_label_of(&meter, 0, bits), "keypad");
    read_text(UINT16(""));
    assert_null(device_label_of(&meter, 0, off));
}

TEST(a_wrong_enumeration_is_refused_with_its_line)
{
    static const struct {
        const char *text, *reason;
    } rows[] = {
        {UINT16("    enumeration:\n      1: off\n      2: on\n      1: ready\n"),
         "9: enumeration has the number 1 twice, first in line 7"},
        {UINT16("    enumeration:\n      1: off\n      2: off\n"),
         "8: enumeration has the name off twice, first in line 7"},
        {UINT16("    enumeration:\n      1: off\n      65536: on\n"),
         "8: enumeration: \"65536\" is out of range of uint16"},
        {UINT16("    enumeration: {-1: off}\n"),
         "6: enumeration: \"-1\" is out of range of uint16"},
        {FIELD("    type: int64\n    enumeration: {9223372036854775808: off}\n"),
         "6: enumeration: \"9223372036854775808\" is out of range of int64"},
        {"fields: [{name: a, table: coils, address: 0,\n enumeration: {2: on}}]",
         "2: enumeration: \"2\" is out of range: from 0 to 1 is allowed"},
        {FIELD("    type: bit\n    bit: 4\n    count: 3\n    enumeration: {8: on}\n"),
         "8: enumeration: \"8\" is out of range: from 0 to 7 is allowed"},
        {UINT16("    enumeration: {0x10: off}\n"),
         "6: enumeration: \"0x10\" begins with 0: write a decimal number"},
        {UINT16("    enumeration: {-0: off}\n"),
         "6: enumeration: \"-0\" begins with 0: write a decimal number"},
        {UINT16("    enumeration: {1.5: off}\n"),
         "6: enumeration: \"1.5\" is not a whole decimal number"},
        {UINT16("    enumeration: {off: 1}\n"),
         "6: enumeration: \"off\" is not a whole decimal number"},
        {UINT16("    enumeration: {010: off}\n"),
         "6: enumeration: \"010\" begins with 0: write a decimal number"},
        {UINT16("    enumeration: {1: }\n"), "6: enumeration is empty"},
        {UINT16("    enumeration: {1: [a]}\n"), "6: enumeration is a list: it must be one word"},
        {UINT16("    enumeration: {}\n"), "6: enumeration is empty"},
        {UINT16("    enumeration: off\n"), "6: enumeration must be a mapping of numbers to names, "
                                           "such as {0: stopped, 1: running}"},
        {FIELD("    type: float\n    enumeration: {1: off}\n"),
         "6: a float has no enumeration: only integers and bits have one"},
        {FIELD("    type: text\n    count: 2\n    enumeration: {1: off}\n"),
         "7: a text has no enumeration: only integers and bits have one"},
        {UINT16("    scale: 0.1\n    enumeration: {1: off}\n"),
         "7: a field with a scale has no enumeration"},
        {UINT16("    enumeration: {1: off}\n    enumeration: {2: on}\n"),
         "7: enumeration is there twice, first in line 6"},
    };

    for (unsigned i = 0; i < COUNT(rows); i++)
        expect_refused(rows[i].text, rows[i].reason);
}

TEST(what_is_not_yaml_is_refused)
{
    expect_refused("fields:\n  - name: a\n table: b\n",
                   "3: this is not YAML: while parsing a block mapping, did not find expected "
                   "key");
    expect_refused("fields: [\n\n", "3: this is not YAML: while parsing a flow node, did not find "
                                    "expected node content");
    expect_refused("\tfields: 1\n", "1: this is not YAML: while scanning for the next token, found "
                                    "character that cannot start any token");
    expect_refused("fields: *a\n", "1: this is not YAML: found undefined alias");
    expect_refused("fields: \xFF\n", " this is not YAML: invalid leading UTF-8 octet, at byte 8");
    expect_reason("fields: \0\n", 10,
                  " this is not YAML: control characters are not allowed, at "
                  "byte 8");
}

TEST(an_anchor_that_holds_itself_is_refused)
{
    expect_refused("fields: &a [*a]\n",
                   "1: the field must be a mapping of keys, such as \"name:\"");
    expect_refused("&a {fields: *a}\n", "1: fields must be a list: each item begins with \"-\"");
}

TEST(a_file_that_cannot_be_read_is_a_failure_of_the_system)
{
    assert_int_equal(device_file_read(&meter, "/nowhere/meter.yaml", wrong), CODE_SYSTEM);
    assert_string_equal(wrong, "/nowhere/meter.yaml: No such file or directory");
    assert_int_equal(device_file_read(&meter, "/tmp", wrong), CODE_SYSTEM);
    assert_string_equal(wrong, "/tmp: Is a directory");
}

TEST(a_file_has_at_most_as_many_fields_as_a_plan)
{
    const size_t size = 80 * ((size_t)MBM_PLAN_MAX_FIELDS + 1);
    char *text = malloc(size), reason[100];

    assert_non_null(text);
    size_t length = (size_t)snprintf(text, size, "fields:\n");
    for (int i = 0; i <= MBM_PLAN_MAX_FIELDS; i++)
        length += (size_t)snprintf(text + length, size - length,
                                   "- {name: n%d, table: coils, address: %d}\n", i, i);
    snprintf(reason, sizeof reason, "2: fields has %d items: %d are allowed",
             MBM_PLAN_MAX_FIELDS + 1, MBM_PLAN_MAX_FIELDS);
    expect_reason(text, length, reason);
    free(text);
}

/* --- damaged files --- */

static uint32_t next_random(uint32_t *state)
{
    *state ^= *state << 13;
    *state ^= *state >> 17;
    *state ^= *state << 5;
    return *state;
}

/* The sanitizers find a read or a free too many, and memory that is not freed. */
TEST(any_damaged_file_is_read_or_refused)
{
    static const char whole[] =
        "device: SDM120\nunit: 3\ninterval: 2s\norder: CDAB\nfields:\n"
        "  - name: voltage\n    table: input\n    address: 0\n    type: float\n    scale: 0.1\n"
        "    unit_of_measurement: V\n    value: 23.5\n"
        "  - {name: model, table: holding, address: 0, type: text, count: 5, value: abc}\n"
        "  - {name: three, table: holding, address: 9, type: int16, count: 3, value: [1, -2, 3],\n"
        "     access: read-write, enumeration: {1: one, -2: minus two}}\n"
        "  - {name: on, table: coils, address: 1, count: 2, value: [on, off], access: write}\n";
    static const char pieces[][8] = {"- ", ": ", "\n", "[", "]",  "{",    "}",      "&a ",
                                     "*a", "0",  "-",  "'", "\"", "\xC3", "text\n", "\n  - "};
    char bytes[2 * sizeof whole];
    unsigned round, right = 0;
    uint32_t random = 1;

    for (round = 0; round < 20000; round++) {
        size_t length = sizeof whole - 1;
        unsigned change;

        memcpy(bytes, whole, length);
        for (change = 0; change <= round % 4; change++) {
            const size_t at = next_random(&random) % length;
            const char *piece = pieces[next_random(&random) % COUNT(pieces)];
            const size_t count = next_random(&random) % 9;

            switch (next_random(&random) % 4) {
            case 0: bytes[at] = (char)next_random(&random); break;
            case 1:
                memmove(bytes + at + strlen(piece), bytes + at, length - at);
                memcpy(bytes + at, piece, strlen(piece));
                length += strlen(piece);
                break;
            case 2:
                if (at + count < length) {
                    memmove(bytes + at, bytes + at + count, length - at - count);
                    length -= count;
                }
                break;
            default: length = round % 50 == 0 ? at + 1 : length; break;
            }
        }
        if (read_bytes(bytes, length) == CODE_DONE)
            right++;
        else
            assert_int_equal(memcmp(wrong, path, strlen(path)), 0);
    }
    assert_in_range(right, 100, 19900);
}

/* --- The names of lines on the command line: the settings that a name leaves out --- */

static place read_place(const char *text, int is_server)
{
    place p;

    assert_null(place_read(&p, text, is_server));
    return p;
}

/* Serial line guide V1.02, 2.5.1, 2.5.2 and 3.2. */
TEST(a_serial_line_has_the_settings_of_the_standard)
{
    const place rtu = read_place("rtu:/dev/ttyUSB0", 0),
                ascii = read_place("ascii:/dev/ttyUSB0", 0);

    assert_int_equal(rtu.tty.baud, 19200);
    assert_int_equal(rtu.tty.parity, 'E');
    assert_int_equal(rtu.tty.stop, 1);
    assert_int_equal(rtu.tty.data, 8);
    assert_int_equal(ascii.tty.baud, 19200);
    assert_int_equal(ascii.tty.parity, 'E');
    assert_int_equal(ascii.tty.stop, 1);
    assert_int_equal(ascii.tty.data, 7);
}

/* TCP guide V1.0b, 4.1 and 4.2.1.2. */
TEST(a_host_has_port_502_unless_another_is_named)
{
    assert_string_equal(read_place("tcp://192.168.0.7", 0).service, "502");
    assert_string_equal(read_place("tcp://192.168.0.7:1502", 0).service, "1502");
    assert_string_equal(read_place("tcp://192.168.0.7", 1).service, "502");
    assert_string_equal(read_place("tcp://:1502", 1).service, "1502");
    assert_string_equal(MBM_TCP_SERVICE, "502");
}
