/* Reads the value that a field has in the file into the words of its registers or bits.
 *
 * Licence: MIT OR Apache-2.0. */
#include "device_initial.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

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
