/* Finds, measures and frees the fields of a device. */
#include "device.h"

#include "numbers.h"

#include <stdlib.h>
#include <string.h>

const char *const device_functions[] = {"single", "multiple", NULL};

int device_is_of_bits(uint8_t table)
{
    return table <= MBM_TABLE_DISCRETE_INPUTS;
}

int device_is_part(const mbm_planField *planned)
{
    return planned->type == MBM_TYPE_BIT && !device_is_of_bits(planned->table);
}

int device_is_wide_part(const mbm_planField *planned)
{
    return value_is_wide_bits(planned->type);
}

uint16_t device_values_in(const mbm_planField *planned)
{
    const int is_one = value_is_text(planned->type) || device_is_part(planned) ||
                       device_is_wide_part(planned) || planned->count == 0;

    return is_one ? 1 : planned->count;
}

uint32_t device_size(const mbm_planField *planned)
{
    const uint16_t count = planned->count ? planned->count : 1;

    return (uint32_t)value_registers(planned->type, count) * device_values_in(planned);
}

mbm_planField device_read_as(const mbm_planField *planned)
{
    mbm_planField field = *planned;

    if (value_is_of_plan(planned->type, planned->order))
        return field;
    field.type = MBM_TYPE_REGISTERS;
    field.count = (uint16_t)device_size(planned);
    field.order = MBM_ORDER_ABCD;
    field.bit = 0;
    return field;
}

uint16_t device_part(const mbm_planField *planned, uint16_t bits)
{
    mbm_registers registers;
    uint16_t word = 0;

    (void)mbm_registers_intoWords(&registers, &word, 1, 0);
    (void)mbm_registers_setUint16(&registers, 0, planned->order, (uint16_t)(bits << planned->bit));
    return word;
}

uint16_t device_mask(const mbm_planField *planned, uint32_t nth)
{
    if (device_is_part(planned))
        return device_part(planned, (uint16_t)((1u << planned->count) - 1));
    return value_mask(planned->type, planned->order, planned->bit, (uint8_t)planned->count, nth);
}

int device_scale(const device *of, uint16_t power, const mbm_registers *registers,
                 value_scale *scale)
{
    char text[VALUE_TEXT_BYTES];
    long number;

    if (conversion_print(&of->fields[power].form, registers, of->planned[power].address, 1, 0,
                         text) != MBM_OK)
        return 0;
    number = strtol(text, NULL, 10);
    if (number < -DEVICE_POWER || number > DEVICE_POWER)
        return 0;
    *scale = conversion_power((int)number);
    return 1;
}

const char *device_label_of(const device *from, uint16_t field, const uint16_t *words)
{
    const device_field *of = &from->fields[field];
    const size_t size = value_registers(from->planned[field].type, 1) * sizeof *words;
    uint16_t i;

    for (i = 0; i < of->label_count; i++)
        if (memcmp(of->labels[i].words, words, size) == 0)
            return of->labels[i].name;
    return NULL;
}

void device_free(device *into)
{
    while (into->count > 0) {
        device_field *field = &into->fields[--into->count];

        while (field->label_count > 0) {
            free(field->labels[--field->label_count].name);
            free(field->labels[field->label_count].number);
        }
        free(field->labels);
        free(field->name);
        free(field->topic);
        free(field->identifier);
        free(field->unit_of_measurement);
        free(field->description);
        free(field->layout);
        free(field->words);
        free(field->press);
        free(field->power_name);
        free(field->power_plain);
        if (field->conversion)
            free(field->conversion->numbers);
        free(field->conversion);
    }
    free(into->fields);
    free(into->planned);
    free(into->name);
    free(into->limits.excluded);
    memset(&into->limits, 0, sizeof into->limits);
    into->fields = NULL;
    into->planned = NULL;
    into->name = NULL;
    into->readable = 0;
}

int device_find(const device *from, const char *topic)
{
    int at;

    for (at = 0; at < from->count; at++)
        if (strcmp(from->fields[at].topic, topic) == 0)
            return at;
    return -1;
}

value_form device_bits_form(const mbm_planField *planned, const value_form *own)
{
    const int is_number = planned->count > 1 && device_is_part(planned);

    return (value_form){.type = is_number ? MBM_TYPE_UINT16 : MBM_TYPE_BIT,
                        .order = MBM_ORDER_ABCD,
                        .conversion = own->conversion};
}

const char *device_address_text(const device *of, uint8_t table, uint32_t address)
{
    static const unsigned DIGITS[] = {0, 0, 1, 4, 3}; /* of each table */

    switch (of->notation) {
    case DEVICE_ONE_BASED: return say("%u", (unsigned)address + 1);
    case DEVICE_MODICON:
        if (table == MBM_TABLE_COILS && address < 9999)
            return say("%u", (unsigned)address + 1);
        return say(address < 9999 ? "%u%04u" : "%u%05u", DIGITS[table], (unsigned)address + 1);
    default: return say("%u", (unsigned)address);
    }
}

uint16_t device_most_written(const device *of, uint8_t table)
{
    const int is_bits = device_is_of_bits(table);
    const uint16_t own = is_bits ? of->limits.write_bits : of->limits.write_registers;

    return own ? own : is_bits ? MBM_MAX_WRITE_BITS : MBM_MAX_WRITE_REGISTERS;
}
