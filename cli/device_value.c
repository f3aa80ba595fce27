#include "device_value.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_LABELS = 1000 };

/* The words for a bit: that at an odd place is 1. */
static const char *const BITS[] = {"0", "1", "false", "true", "off", "on", NULL};

/* --- a value --- */

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

static int read_text(yaml_file *file, const yaml_node_t *node, const mbm_planField *planned,
                     uint16_t *words)
{
    const char *text = yaml_file_text(file, "value", node, 2 * VALUE_LONGEST_TEXT);
    char latin[VALUE_LONGEST_TEXT + 1] = "";
    mbm_registers registers;
    long length;

    if (!text)
        return 0;
    length = to_latin(text, latin, sizeof latin - 1);
    if (length < 0)
        return yaml_file_refuse(file, node, "value has a character that is not in Latin-1");
    if (length > planned->count)
        return yaml_file_refuse(file, node, "value has %ld characters, and count is %u", length,
                                planned->count);
    (void)mbm_registers_intoWords(&registers, words, (uint16_t)device_size(planned), 0);
    (void)mbm_registers_setString(&registers, 0, planned->count, planned->order, latin);
    return 1;
}

/* Reads one bit as a word, or several as the number that they are. Returns 0 after a refusal. */
static int read_bits(yaml_file *file, const yaml_node_t *node, uint16_t count, uint16_t *bits)
{
    uint32_t number = 0;
    int index = 0;

    if (count == 1 ? !yaml_file_word(file, "value", node, BITS, &index)
                   : !yaml_file_number(file, "value", node, 0, (1u << count) - 1, &number))
        return 0;
    *bits = (uint16_t)(count == 1 ? index & 1 : number);
    return 1;
}

/* Reads one number, or bits. Returns how many words it has, 0 after a refusal. */
static uint16_t read_one(yaml_file *file, const yaml_node_t *node, const value_form *form,
                         const mbm_planField *planned, uint16_t *words)
{
    uint16_t number[VALUE_WORDS], count;
    const char *text, *wrong;

    if (device_is_part(planned)) {
        if (!read_bits(file, node, planned->count, number))
            return 0;
        *words = device_part(planned, *number);
        return 1;
    }
    if (planned->type == MBM_TYPE_BIT)
        return (uint16_t)read_bits(file, node, 1, words);
    text = yaml_file_text(file, "value", node, VALUE_LONGEST);
    if (!text)
        return 0;
    count = value_read(form, text, strlen(text), number, &wrong);
    if (count == 0)
        (void)yaml_file_refuse(file, node, "value: \"%s\" %s%s%s", text, wrong,
                               strstr(wrong, "range") ? " of " : "",
                               strstr(wrong, "range") ? value_type_names[planned->type] : "");
    memcpy(words, number, count * sizeof *words);
    return count;
}

int device_value_read(yaml_file *file, const yaml_node_t *node, const mbm_planField *planned,
                      device_field *field)
{
    uint16_t *words, i;

    if (!node)
        return 1;
    words = (uint16_t *)calloc(device_size(planned), sizeof *words);
    if (!words)
        return yaml_file_fail(file, ENOMEM);
    field->words = words;
    if (planned->type == MBM_TYPE_TEXT)
        return read_text(file, node, planned, words);
    if (planned->count == 1 || device_is_part(planned))
        return read_one(file, node, &field->form, planned, words) > 0;
    if (node->type != YAML_SEQUENCE_NODE || yaml_file_size(node) != planned->count)
        return yaml_file_refuse(file, node, "value must be a list of %u values, as count says",
                                planned->count);
    for (i = 0; i < planned->count; i++) {
        const uint16_t count =
            read_one(file, yaml_file_item(file, node, i), &field->form, planned, words);

        if (count == 0)
            return 0;
        words += count;
    }
    return 1;
}

/* --- an enumeration --- */

/* Reads the number of bits, or a number as value_read reads it without a scale. Returns 0 after a
 * refusal. */
static int read_number(yaml_file *file, const yaml_node_t *node, const mbm_planField *planned,
                       device_label *label)
{
    const uint32_t most = device_is_part(planned) ? (1u << planned->count) - 1 : 1;
    const value_form form = {.type = planned->type, .order = planned->order};
    const char *text, *digits, *wrong;
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
    if (value_read(&form, text, strlen(text), label->words, &wrong) == 0)
        return yaml_file_refuse(file, node, "enumeration: \"%s\" is out of range of %s", text,
                                value_type_names[planned->type]);
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
    if (!read_number(file, pair.key, planned, label) ||
        !yaml_file_copy(file, "enumeration", pair.key, VALUE_LONGEST, &label->number) ||
        !yaml_file_copy(file, "enumeration", pair.value, DEVICE_NAME_BYTES, &label->name))
        return 0;
    for (other = field->labels; other < label; other++) {
        if (memcmp(other->words, label->words, size) == 0)
            return yaml_file_refuse(file, pair.key,
                                    "enumeration has the number %s twice, first in line %d",
                                    label->number, other->line);
        if (strcmp(other->name, label->name) == 0)
            return yaml_file_refuse(file, pair.value,
                                    "enumeration has the name %s twice, first in line %d",
                                    label->name, other->line);
    }
    return 1;
}

int device_enumeration_read(yaml_file *file, const yaml_node_t *node, const mbm_planField *planned,
                            device_field *field)
{
    size_t count, at;

    if (!node)
        return 1;
    if (planned->type >= MBM_TYPE_FLOAT)
        return yaml_file_refuse(file, node,
                                "a %s has no enumeration: only integers and bits have one",
                                value_type_names[planned->type]);
    if (field->form.scale.digits != 0)
        return yaml_file_refuse(file, node, "a field with a scale has no enumeration");
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
