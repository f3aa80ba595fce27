/* Refuses writes beyond the limits of a field, as a device does.
 *
 * Licence: MIT OR Apache-2.0. */
#include "served_limits.h"

/* The form of a field, with the power of ten that its unit has now. */
static value_form form_of(const served_units *units, uint16_t field)
{
    const device *of = units->from;
    const int power = of->fields[field].power_field;
    value_form form = of->fields[field].form;
    const mbm_planField *planned;
    mbm_registers registers;

    if (power < 0)
        return form;
    planned = &of->planned[power];
    (void)mbm_registers_ofWords(&registers,
                                served_cells_of(units, planned)->values + planned->address,
                                (uint16_t)device_size(planned), planned->address);
    (void)device_scale(of, (uint16_t)power, &registers, &form.scale);
    return form;
}

/* Whether the values of a field are within its limits once the access is carried out. */
static int is_allowed(const served_cells *cells, uint16_t field, const mbm_access *access)
{
    const mbm_planField *planned = &cells->owner->from->planned[field];
    const uint16_t size = (uint16_t)device_size(planned);
    value_form form = form_of(cells->owner, field);
    uint16_t words[MBM_MAX_READ_REGISTERS], i, each;
    mbm_registers registers;

    for (i = 0; i < size; i++) {
        const uint32_t address = planned->address + (uint32_t)i;
        const uint32_t place = address - access->address;

        words[i] = address >= access->address && place < access->quantity
                       ? (uint16_t)(access->data[2 * place] << 8 | access->data[2 * place + 1])
                       : cells->values[address];
    }
    (void)mbm_registers_ofWords(&registers, words, size, 0);
    if (device_is_part(planned)) {
        (void)mbm_registers_getUint16(&registers, 0, planned->order, &words[0]);
        words[0] = (uint16_t)(words[0] >> planned->bit & ((1u << planned->count) - 1));
        form = device_bits_form(planned, &form);
    }
    each = value_registers(form.type, 1);
    for (i = 0; i < size; i = (uint16_t)(i + each))
        if (conversion_check_registers(&form, &registers, i))
            return 0;
    return 1;
}

uint8_t served_limits_check(const served_cells *cells, const mbm_access *access)
{
    const device *of = cells->owner->from;
    const uint32_t end = (uint32_t)access->address + access->quantity;
    uint16_t i;

    for (i = 0; cells->table == MBM_TABLE_HOLDING_REGISTERS && i < of->count; i++) {
        const mbm_planField *planned = &of->planned[i];

        if (planned->unit == cells->unit && planned->table == cells->table &&
            of->fields[i].conversion && planned->address < end &&
            planned->address + device_size(planned) > access->address &&
            !is_allowed(cells, i, access))
            return MBM_ILLEGAL_DATA_VALUE;
    }
    return 0;
}
