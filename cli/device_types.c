/* Reads what completes the type of a field, and refuses what does not go with it. */
#include "device_keys.h"

#include "numbers.h"
#include "value.h"

#include <string.h>

int device_types_read_zone(yaml_file *file, const yaml_node_t *node, int16_t *minutes)
{
    const char *text;

    if (!node)
        return 1;
    text = yaml_file_text(file, "time_zone", node, VALUE_LONGEST);
    if (!text)
        return 0;
    return value_zone_read(text, minutes) ||
           yaml_file_refuse(file, node,
                            "time_zone: \"%s\" is neither Z nor an offset from UTC such as +01:00 "
                            "or -03:30",
                            text);
}

/* Whether the type of a field is a date with a layout. */
static int has_layout(uint8_t type)
{
    return type == VALUE_DATE || type == VALUE_DATE_BCD;
}

int device_types_read_layout(yaml_file *file, const yaml_node_t *field,
                             const device_type_keys *keys, mbm_planField *planned,
                             device_field *into)
{
    const int is_bcd = planned->type == VALUE_DATE_BCD;
    const char *wrong;
    uint8_t registers = 1;

    if (keys->layout && !has_layout(planned->type))
        return yaml_file_refuse(file, keys->layout,
                                "layout is for fields of the types date and date_bcd");
    if (!has_layout(planned->type))
        return 1;
    if (!keys->layout)
        return yaml_file_refuse(file, field,
                                "a %s needs a layout, which says what its registers hold, such as "
                                "\"Y M D h m s\"",
                                value_type_name(planned->type));
    if (!yaml_file_copy(file, "layout", keys->layout, VALUE_LAYOUT_BYTES, &into->layout))
        return 0;
    wrong = value_layout_check(into->layout, &registers);
    if (wrong)
        return yaml_file_refuse(file, keys->layout, "layout: %s", wrong);
    planned->type = (uint8_t)((is_bcd ? VALUE_DATE_BCD_OF_1 : VALUE_DATE_OF_1) + registers - 1);
    return 1;
}

/* --- bits --- */

/* Reads "4-11" or "4". Returns 0 if the text is anything else. */
static int read_range(const char *text, unsigned *first, unsigned *last)
{
    const cursor all = {text, text + strlen(text)};
    cursor in = all;
    unsigned *number = first;

    *first = *last = 0;
    for (;;) {
        const char *start = in.at;

        for (; cursor_is_digit(&in) && in.at - start < 3; in.at++)
            *number = *number * 10 + (unsigned)(*in.at - '0');
        if (in.at == start)
            return 0;
        if (number == last || !cursor_skip_char(&in, '-'))
            break;
        number = last;
    }
    if (number == first)
        *last = *first;
    return in.at == in.end && *first <= *last;
}

/* Makes a field bits of itself. If one register has them all, it is a field of that register. */
static int read_bits(yaml_file *file, const device_type_keys *keys, mbm_planField *planned)
{
    const uint16_t registers = value_registers(planned->type, 1);
    const uint8_t wide = registers == 2 ? VALUE_BITS32 : VALUE_BITS64;
    uint16_t nth = 0;
    unsigned first, last;
    const char *text;

    if (!keys->bits)
        return 1;
    if (planned->type < MBM_TYPE_UINT16 || planned->type > MBM_TYPE_INT64)
        return yaml_file_refuse(file, keys->bits,
                                "bits are for fields of the types uint16, uint32 and uint64");
    if (keys->count)
        return yaml_file_refuse(file, keys->count, "a field with bits has no count");
    text = yaml_file_text(file, "bits", keys->bits, VALUE_LONGEST);
    if (!text)
        return 0;
    if (!read_range(text, &first, &last))
        return yaml_file_refuse(file, keys->bits,
                                "bits: \"%s\" is not a range such as 4-11, lowest bit first", text);
    if (last >= 16u * registers)
        return yaml_file_refuse(file, keys->bits,
                                "bits: \"%s\" goes beyond a %s, which has the bits 0 to %u", text,
                                value_type_name(planned->type), 16u * registers - 1);
    planned->count = (uint16_t)(last - first + 1);
    planned->bit = (uint8_t)first;
    if (first / 16 != last / 16) {
        planned->type = wide;
        return 1;
    }
    while (registers > 1 && value_mask(wide, planned->order, (uint8_t)first, 1, nth) == 0)
        nth++;
    planned->address = (uint16_t)(planned->address + nth);
    planned->bit = (uint8_t)(first % 16);
    planned->type = MBM_TYPE_BIT;
    if (planned->order > MBM_ORDER_DCBA)
        planned->order = (uint8_t)(planned->order - MBM_ORDER_DCBA);
    return 1;
}

/* --- order --- */

/* An order by halves is for four registers: two registers have that of a half, and three none. */
static int fit_order(yaml_file *file, const device_type_keys *keys, mbm_planField *planned)
{
    const uint16_t registers = value_is_text(planned->type) ? 1 : value_registers(planned->type, 1);
    const int has_words = planned->type < VALUE_DATE_OF_1;

    if (planned->order <= MBM_ORDER_DCBA)
        return 1;
    if ((registers == 3 && has_words) || planned->type == VALUE_IEC870)
        return yaml_file_refuse(file, keys->order ? keys->order : keys->type,
                                "order is %s: the type %s has no halves of two registers",
                                value_order_names[planned->order], value_type_name(planned->type));
    if (registers < 4 || !has_words)
        planned->order = (uint8_t)(planned->order - MBM_ORDER_DCBA);
    return 1;
}

int device_types_complete(yaml_file *file, const device_type_keys *keys, int16_t zone,
                          mbm_planField *planned, device_field *into)
{
    const int is_date = value_is_date(planned->type);

    if (keys->time_zone && !is_date)
        return yaml_file_refuse(file, keys->time_zone, "time_zone is for dates: a %s has none",
                                value_type_name(planned->type));
    if (!fit_order(file, keys, planned) || !device_types_read_zone(file, keys->time_zone, &zone) ||
        !read_bits(file, keys, planned))
        return 0;
    into->form.type = planned->type;
    into->form.order = planned->order;
    into->form.layout = into->layout;
    into->form.zone = is_date ? zone : 0;
    if (value_is_wide_bits(planned->type)) {
        into->form.first = planned->bit;
        into->form.bits = (uint8_t)planned->count;
    }
    return 1;
}
