/* Reads the enumeration of a field: numbers and their names.
 *
 * Licence: MIT OR Apache-2.0. */
#include "device_labels.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

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
