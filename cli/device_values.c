/* Reads what the numbers of a field mean, its value at first and its enumeration, and refuses what
 * its type cannot have. */
#include "device_keys.h"

#include "conversion.h"
#include "decimal.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char STANDARD[] = "standard", NONE[] = "none";

/* What not_available may be, for refusals. */
#define NUMBERS_OR_WORDS "a number such as 0x8000 or -1, \"standard\", a list of these, or \"none\""

/* Gives a field a conversion unless it has one. Returns 0 without memory. */
static int make_conversion(yaml_file *file, device_field *field)
{
    if (!field->conversion)
        field->conversion = (conversion *)calloc(1, sizeof *field->conversion);
    field->form.conversion = field->conversion;
    return field->conversion != NULL || yaml_file_fail(file, ENOMEM);
}

/* --- scale and offset --- */

static int is_bit(const mbm_planField *planned)
{
    return planned->type == MBM_TYPE_BIT;
}

/* A text or bits have none of the keys that calculate. */
static int check_number(yaml_file *file, const char *key, const yaml_node_t *node,
                        const mbm_planField *planned)
{
    return (!is_bit(planned) && !value_is_text(planned->type) && !value_is_date(planned->type)) ||
           yaml_file_refuse(file, node, "a %s has no %s", value_type_name(planned->type), key);
}

/* Whether a text is meant to be a number. */
static int looks_like_number(const char *text)
{
    return text[strspn(text, "0123456789+-.,eE")] == '\0' || text[0] == '-' || text[0] == '.' ||
           strncmp(text, "0x", 2) == 0;
}

static int read_scale(yaml_file *file, const yaml_node_t *node, const mbm_planField *planned,
                      device_field *field)
{
    const char *text;

    if (!node)
        return 1;
    field->scale_line = (int)yaml_file_line(node);
    text = yaml_file_text(file, "scale", node, DEVICE_NAME_BYTES);
    if (!text || !check_number(file, "scale", node, planned))
        return 0;
    if (strlen(text) <= VALUE_LONGEST && value_scale_read(text, &field->form.scale))
        return 1;
    if (looks_like_number(text))
        return yaml_file_refuse(
            file, node, "scale: \"%s\" is not a decimal number of up to 18 digits other than 0",
            text);
    return device_repeat_name(file, node, DEVICE_NAME_BYTES, &field->power_name) &&
           yaml_file_copy(file, "scale", node, DEVICE_NAME_BYTES, &field->power_plain);
}

static int read_offset(yaml_file *file, const yaml_node_t *node, const mbm_planField *planned,
                       device_field *field)
{
    const char *text;

    if (!node)
        return 1;
    text = yaml_file_text(file, "offset", node, VALUE_LONGEST);
    if (!text || !check_number(file, "offset", node, planned) || !make_conversion(file, field))
        return 0;
    return decimal_read_short(text, &field->conversion->offset) ||
           yaml_file_refuse(file, node, "offset: \"%s\" is not a decimal number of up to 18 digits",
                            text);
}

static int read_precision(yaml_file *file, const yaml_node_t *node, const mbm_planField *planned,
                          device_field *field)
{
    uint32_t places = 0;

    if (!node)
        return 1;
    if (!check_number(file, "precision", node, planned) || !make_conversion(file, field) ||
        !yaml_file_number(file, "precision", node, 0, CONVERSION_PLACES, &places))
        return 0;
    field->conversion->has_precision = 1;
    field->conversion->precision = (uint8_t)places;
    return 1;
}

/* --- limits --- */

static int read_limit(yaml_file *file, const char *key, const yaml_node_t *node,
                      const mbm_planField *planned, device_field *field, value_scale *limit)
{
    const char *text;

    if (value_is_text(planned->type) || value_is_date(planned->type) ||
        (is_bit(planned) && planned->count == 1) || device_is_of_bits(planned->table))
        return yaml_file_refuse(file, node, "a %s has no %s", value_type_name(planned->type), key);
    if (!(field->access & DEVICE_WRITE))
        return yaml_file_refuse(file, node,
                                "%s is for what is written, and the field cannot be written: a "
                                "value that is read is shown as it is",
                                key);
    text = yaml_file_text(file, key, node, VALUE_LONGEST);
    if (!text)
        return 0;
    return decimal_read_short(text, limit) ||
           yaml_file_refuse(file, node, "%s: \"%s\" is not a decimal number of up to 18 digits",
                            key, text);
}

static int read_limits(yaml_file *file, const device_values *values, const mbm_planField *planned,
                       device_field *field)
{
    static decimal_number least;
    conversion *of;

    if (!values->least && !values->most && !values->step)
        return 1;
    if (!make_conversion(file, field))
        return 0;
    of = field->conversion;
    of->has_least = values->least != NULL;
    of->has_most = values->most != NULL;
    of->has_step = values->step != NULL;
    if ((of->has_least &&
         !read_limit(file, "min_value", values->least, planned, field, &of->least)) ||
        (of->has_most && !read_limit(file, "max_value", values->most, planned, field, &of->most)) ||
        (of->has_step && !read_limit(file, "step", values->step, planned, field, &of->step)))
        return 0;
    decimal_of_scale(&of->least, &least);
    if (of->has_least && of->has_most && decimal_compare(&least, &of->most) > 0)
        return yaml_file_refuse(file, values->least, "min_value is greater than max_value");
    if (of->has_step && (of->step.digits == 0 || of->step.is_negative))
        return yaml_file_refuse(file, values->step, "step must be greater than 0");
    return 1;
}

/* --- not available --- */

/* How many digits a hexadecimal number of a type has. */
static size_t hex_digits(const mbm_planField *planned, const device_field *field)
{
    return (size_t)4 * value_registers(is_bit(planned) ? MBM_TYPE_UINT16 : field->form.type, 1);
}

/* Adds a number. One of the head of the file counts for the types that it fits: one in hexadecimal
 * for those that have as many digits, and another one for those whose range it is in. */
static int add_number(yaml_file *file, const yaml_node_t *node, int is_shared,
                      const mbm_planField *planned, device_field *field)
{
    const char *text = yaml_file_text(file, "not_available", node, VALUE_LONGEST);
    const value_form form = is_bit(planned) ? device_bits_form(planned, &field->form) : field->form;
    conversion *of = field->conversion;
    const char *wrong;
    int is_hex;

    if (!text)
        return 0;
    if (strcmp(text, STANDARD) == 0) {
        of->is_standard = 1;
        return 1;
    }
    is_hex = text[0] == '0' && (text[1] == 'x' || text[1] == 'X');
    if (value_is_text(planned->type) ||
        (is_shared && is_hex && strlen(text) - 2 != hex_digits(planned, field)))
        return is_shared ||
               yaml_file_refuse(file, node,
                                "not_available of a text is \"standard\", all of its registers 0, "
                                "or \"none\"");
    wrong = conversion_add(of, &form, text);
    if (!wrong && is_bit(planned) && of->numbers[of->number_count - 1][0] >> planned->count) {
        of->number_count--;
        wrong = "is out of range";
    }
    return !wrong || is_shared ||
           yaml_file_refuse(file, node, "not_available: \"%s\" %s%s%s", text, wrong,
                            strstr(wrong, "range") ? " of " : "",
                            strstr(wrong, "range")
                                ? is_bit(planned) ? "these bits" : value_type_name(form.type)
                                : ": it is " NUMBERS_OR_WORDS);
}

static int is_none(const yaml_node_t *node)
{
    return node->type == YAML_SCALAR_NODE &&
           strcmp((const char *)node->data.scalar.value, NONE) == 0;
}

static int read_not_available(yaml_file *file, const yaml_node_t *node, int is_shared,
                              const mbm_planField *planned, device_field *field)
{
    const int is_list = node && node->type == YAML_SEQUENCE_NODE;
    size_t count = 1, at;

    if (!node || is_none(node))
        return 1;
    if (device_is_of_bits(planned->table) || (is_bit(planned) && planned->count == 1))
        return is_shared || yaml_file_refuse(file, node, "a bit has no not_available");
    if (is_list)
        count = yaml_file_items(file, "not_available", node, CONVERSION_NUMBERS);
    if (count == 0 || !make_conversion(file, field))
        return 0;
    field->conversion->numbers =
        (uint16_t(*)[VALUE_WORDS])calloc(count, sizeof *field->conversion->numbers);
    if (!field->conversion->numbers)
        return yaml_file_fail(file, ENOMEM);
    for (at = 0; at < count; at++)
        if (!add_number(file, is_list ? yaml_file_item(file, node, at) : node, is_shared, planned,
                        field))
            return 0;
    return 1;
}

int device_values_check_shared(yaml_file *file, const yaml_node_t *shared)
{
    const int is_list = shared && shared->type == YAML_SEQUENCE_NODE;
    size_t count = 1, at;

    if (!shared || is_none(shared))
        return 1;
    if (is_list)
        count = yaml_file_items(file, "not_available", shared, CONVERSION_NUMBERS);
    if (count == 0)
        return 0;
    for (at = 0; at < count; at++) {
        const yaml_node_t *node = is_list ? yaml_file_item(file, shared, at) : shared;
        const char *text = yaml_file_text(file, "not_available", node, VALUE_LONGEST);
        static decimal_number number;
        size_t digits;

        if (!text)
            return 0;
        digits = strlen(text) < 2 ? 0 : strlen(text) - 2;
        if (text[0] == '0' && (text[1] == 'x' || text[1] == 'X')) {
            if (strspn(text + 2, "0123456789abcdefABCDEF") != digits ||
                (digits != 4 && digits != 8 && digits != 16))
                return yaml_file_refuse(file, node,
                                        "not_available: \"%s\" at the head of the file must have "
                                        "4, 8 or 16 digits after 0x, and is for the fields of 16, "
                                        "32 or 64 bits",
                                        text);
        } else if (strcmp(text, STANDARD) != 0 && !decimal_read(text, strlen(text), &number)) {
            return yaml_file_refuse(file, node, "not_available: \"%s\" is not " NUMBERS_OR_WORDS,
                                    text);
        }
    }
    return 1;
}

int device_values_read(yaml_file *file, const device_values *values, const yaml_node_t *shared,
                       const mbm_planField *planned, device_field *field)
{
    const int has_own = values->not_available != NULL;

    return read_scale(file, values->scale, planned, field) &&
           read_offset(file, values->offset, planned, field) &&
           read_precision(file, values->precision, planned, field) &&
           read_limits(file, values, planned, field) &&
           read_not_available(file, has_own ? values->not_available : shared, !has_own, planned,
                              field);
}

/* --- a power of ten --- */

/* Why a field cannot have the power of ten of another one; NULL if it can. */
static const char *check_power(const device *of, uint16_t field, uint16_t power)
{
    const mbm_planField *planned = &of->planned[power];
    const device_field *one = &of->fields[power];

    if (field == power)
        return "is the field itself";
    if (planned->type < MBM_TYPE_UINT16 || planned->type > MBM_TYPE_INT64)
        return "is no integer: a power of ten is one, mostly an int16";
    if (planned->count > 1)
        return "has several values";
    if (planned->unit != of->planned[field].unit)
        return "is of another unit";
    if (one->power_name || one->form.scale.digits != 0 || conversion_has_offset(one->conversion))
        return "has a scale or an offset itself";
    if (!(one->access & DEVICE_READ))
        return "cannot be read";
    return NULL;
}

/* The scale that a field has in the file for others: 1 if it has none. */
static value_scale scale_in_file(const device *of, uint16_t power)
{
    const mbm_planField *planned = &of->planned[power];
    value_scale scale = conversion_power(0);
    mbm_registers registers;

    if (!of->fields[power].words)
        return scale;
    (void)mbm_registers_ofWords(&registers, of->fields[power].words, (uint16_t)device_size(planned),
                                planned->address);
    (void)device_scale(of, power, &registers, &scale);
    return scale;
}

/* Returns the index of the field with a name, or -1. */
static int find_name(const device *of, const char *name)
{
    int at;

    for (at = 0; at < of->count; at++)
        if (strcmp(of->fields[at].name, name) == 0)
            return at;
    return -1;
}

int device_values_find_power(yaml_file *file, device *of, uint16_t field)
{
    device_field *one = &of->fields[field];
    int power = find_name(of, one->power_name);
    const char *wrong;

    /* A field outside of the repetition. */
    if (power < 0)
        power = find_name(of, one->power_plain);
    if (power < 0)
        return yaml_file_refuse_line(file, one->scale_line,
                                     "scale: \"%s\" is neither a decimal number of up to 18 digits "
                                     "other than 0 nor the name of a field",
                                     one->power_plain);
    wrong = check_power(of, field, (uint16_t)power);
    if (wrong)
        return yaml_file_refuse_line(file, one->scale_line, "scale: the field %s in line %d %s",
                                     of->fields[power].name, of->fields[power].line, wrong);
    one->power_field = power;
    of->fields[power].is_power = 1;
    one->form.scale = scale_in_file(of, (uint16_t)power);
    return 1;
}

/* --- the value at first --- */

/* The words for a bit: that at an odd place is 1. */
static const char *const BITS[] = {"0", "1", "false", "true", "off", "on", NULL};

/* Writes a text of UTF-8 as Latin-1, as far as it fits. Returns its length, or -1 if a character is
 * not in Latin-1. The parser has checked that it is UTF-8. */
static long to_latin(const char *text, char *latin, size_t capacity)
{
    size_t length = 0;

    for (; *text; text++) {
        unsigned char one = (unsigned char)*text;

        if (one > 0xC3)
            return -1;
        if (one >= 0xC2)
            one = (unsigned char)(one << 6 | (*++text & 0x3F));
        if (length < capacity)
            latin[length] = (char)one;
        length++;
    }
    return (long)length;
}

static int read_text(yaml_file *file, const char *key, const yaml_node_t *node,
                     const value_form *form, const mbm_planField *planned, uint16_t *words)
{
    const char *text = yaml_file_text(file, key, node, 2 * VALUE_LONGEST_TEXT);
    char latin[VALUE_LONGEST_TEXT + 1] = "";
    mbm_registers registers;
    const char *wrong;
    long length;

    if (!text)
        return 0;
    length = to_latin(text, latin, sizeof latin - 1);
    if (length < 0)
        return yaml_file_refuse(file, node, "%s has a character that is not in Latin-1", key);
    if (length > planned->count)
        return yaml_file_refuse(file, node, "%s has %ld characters, and count is %u", key, length,
                                planned->count);
    (void)mbm_registers_intoWords(&registers, words, (uint16_t)device_size(planned), 0);
    wrong = value_set_text(form, &registers, 0, planned->count, latin);
    return wrong ? yaml_file_refuse(file, node, "%s: \"%s\" %s", key, text, wrong) : 1;
}

/* Reads one bit as a word, or several as the number that they are. Returns 0 after a refusal. */
static int read_bits(yaml_file *file, const char *key, const yaml_node_t *node, uint16_t count,
                     uint16_t *bits)
{
    uint32_t number = 0;
    int index = 0;

    if (count == 1 ? !yaml_file_word(file, key, node, BITS, &index)
                   : !yaml_file_number(file, key, node, 0, (1u << count) - 1, &number))
        return 0;
    *bits = (uint16_t)(count == 1 ? index & 1 : number);
    return 1;
}

/* Reads one number, or bits. Returns how many words it has, 0 after a refusal. */
static uint16_t read_one(yaml_file *file, const char *key, const yaml_node_t *node,
                         const value_form *form, const mbm_planField *planned, uint16_t *words)
{
    uint16_t number[VALUE_WORDS], count;
    const char *text, *wrong;

    if (device_is_part(planned)) {
        if (!read_bits(file, key, node, planned->count, number))
            return 0;
        *words = device_part(planned, *number);
        return 1;
    }
    if (planned->type == MBM_TYPE_BIT)
        return (uint16_t)read_bits(file, key, node, 1, words);
    text = yaml_file_text(file, key, node, VALUE_LONGEST);
    if (!text)
        return 0;
    count = conversion_read(form, text, strlen(text), number, &wrong);
    if (count == 0)
        (void)yaml_file_refuse(file, node, "%s: \"%s\" %s%s%s", key, text, wrong,
                               strstr(wrong, "range") ? " of " : "",
                               strstr(wrong, "range") ? value_type_name(planned->type) : "");
    memcpy(words, number, count * sizeof *words);
    return count;
}

int device_initial_read(yaml_file *file, const yaml_node_t *node, const mbm_planField *planned,
                        device_field *field)
{
    uint16_t *words, i;

    if (!node)
        return 1;
    words = (uint16_t *)calloc(device_size(planned), sizeof *words);
    if (!words)
        return yaml_file_fail(file, ENOMEM);
    field->words = words;
    if (value_is_text(planned->type))
        return read_text(file, "value", node, &field->form, planned, words);
    if (device_values_in(planned) == 1)
        return read_one(file, "value", node, &field->form, planned, words) > 0;
    if (node->type != YAML_SEQUENCE_NODE || yaml_file_size(node) != planned->count)
        return yaml_file_refuse(file, node, "value must be a list of %u values, as count says",
                                planned->count);
    for (i = 0; i < planned->count; i++) {
        const uint16_t count =
            read_one(file, "value", yaml_file_item(file, node, i), &field->form, planned, words);

        if (count == 0)
            return 0;
        words += count;
    }
    return 1;
}

int device_initial_check(yaml_file *file, const char *key, const yaml_node_t *node,
                         const mbm_planField *planned, const device_field *field)
{
    uint16_t words[MBM_MAX_READ_REGISTERS] = {0};

    return value_is_text(planned->type)
               ? read_text(file, key, node, &field->form, planned, words)
               : read_one(file, key, node, &field->form, planned, words) > 0;
}

/* --- the enumeration --- */

enum { MOST_LABELS = 1000 };

/* Reads the number of bits, or a number as value_read reads it without a scale. Returns 0 after a
 * refusal. */
static int read_number(yaml_file *file, const yaml_node_t *node, const mbm_planField *planned,
                       const value_form *own, device_label *label)
{
    const uint32_t most = device_is_part(planned) ? (1u << planned->count) - 1 : 1;
    const char *text, *digits, *wrong;
    value_form form = *own;
    uint32_t bits = 0;

    if (planned->type == MBM_TYPE_BIT) {
        if (!yaml_file_number(file, "enumeration", node, 0, most, &bits))
            return 0;
        label->words[0] = (uint16_t)bits;
        return 1;
    }
    text = yaml_file_decimal(file, "enumeration", node);
    if (!text)
        return 0;
    digits = text + (text[0] == '-');
    if (digits[0] == '\0' || digits[strspn(digits, "0123456789")] != '\0')
        return yaml_file_refuse(file, node, "enumeration: \"%s\" is not a whole decimal number",
                                text);
    memset(&form.scale, 0, sizeof form.scale);
    if (value_read(&form, text, strlen(text), label->words, &wrong) == 0)
        return yaml_file_refuse(file, node, "enumeration: \"%s\" is out of range of %s", text,
                                value_type_name(planned->type));
    return 1;
}

/* Reads a number and its name, which must not be there yet. Returns 0 after a refusal. */
static int read_label(yaml_file *file, yaml_file_pair pair, const mbm_planField *planned,
                      device_field *field)
{
    device_label *label = &field->labels[field->label_count++];
    const size_t size = value_registers(planned->type, 1) * sizeof *label->words;
    const device_label *other;

    label->line = (int)yaml_file_line(pair.key);
    if (!read_number(file, pair.key, planned, &field->form, label) ||
        !yaml_file_copy(file, "enumeration", pair.key, VALUE_LONGEST, &label->number) ||
        !yaml_file_copy(file, "enumeration", pair.value, DEVICE_NAME_BYTES, &label->name))
        return 0;
    for (other = field->labels; other < label; other++) {
        if (memcmp(other->words, label->words, size) == 0)
            return yaml_file_refuse(file, pair.key,
                                    "enumeration has the number %s twice, first in line %d",
                                    label->number, other->line);
        if (other->name && label->name && strcmp(other->name, label->name) == 0)
            return yaml_file_refuse(file, pair.value,
                                    "enumeration has the name %s twice, first in line %d",
                                    label->name, other->line);
    }
    return 1;
}

int device_labels_read(yaml_file *file, const yaml_node_t *node, const mbm_planField *planned,
                       device_field *field)
{
    size_t count, at;

    if (!node)
        return 1;
    if (!value_is_integer(planned->type))
        return yaml_file_refuse(file, node,
                                "a %s has no enumeration: only integers and bits have one",
                                value_type_name(planned->type));
    if (field->form.scale.digits != 0 || field->power_name)
        return yaml_file_refuse(file, node, "a field with a scale has no enumeration");
    if (conversion_has_offset(field->conversion))
        return yaml_file_refuse(file, node, "a field with an offset has no enumeration");
    if (field->conversion && field->conversion->has_precision)
        return yaml_file_refuse(file, node, "a field with a precision has no enumeration");
    count = yaml_file_pairs(file, "enumeration", node, MOST_LABELS,
                            "numbers to names, such as {0: stopped, 1: running}");
    if (count == 0)
        return 0;
    field->labels = (device_label *)calloc(count, sizeof *field->labels);
    if (!field->labels)
        return yaml_file_fail(file, ENOMEM);
    for (at = 0; at < count; at++)
        if (!read_label(file, yaml_file_pair_at(file, node, at), planned, field))
            return 0;
    return 1;
}
