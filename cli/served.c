/* Makes the units that mbm serve serves, and gets and sets their cells. */
#include "served.h"

#include <stdlib.h>
#include <string.h>

enum { CELLS = 65536, BITMAP = CELLS / 8, STEP = 5, FLIPS = 8 };

static int has(const uint8_t *bitmap, uint16_t address)
{
    return bitmap[address / 8] >> address % 8 & 1;
}

static void add(uint8_t *bitmap, uint16_t address)
{
    bitmap[address / 8] |= (uint8_t)(1u << address % 8);
}

/* --- random values --- */

static uint32_t next_random(served_cells *cells)
{
    cells->random ^= cells->random << 13;
    cells->random ^= cells->random >> 17;
    cells->random ^= cells->random << 5;
    return cells->random;
}

/* The value that a random register has at first. */
static uint16_t first_value(const served_cells *cells, uint16_t address)
{
    return (uint16_t)((cells->seed + address) * 2654435761u >> 16);
}

/* A random register moves by up to STEP at each read, a bit flips at one read of FLIPS. `values`
 * has what a cell has moved by. */
static uint16_t vary(served_cells *cells, uint16_t address, int is_bit)
{
    if (is_bit)
        cells->values[address] ^= next_random(cells) % FLIPS == 0;
    else
        cells->values[address] =
            (uint16_t)(cells->values[address] + next_random(cells) % (2 * STEP + 1) - STEP);
    return (uint16_t)(cells->values[address] + first_value(cells, address));
}

/* --- limits of what clients may write --- */

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

/* Whether a write to cells of a device leaves each of its fields within min_value, max_value and
 * step. Returns 0, or the exception with which a device refuses it, 03. */
static uint8_t check_limits(const served_cells *cells, const mbm_access *access)
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

/* --- the cells of a table --- */

/* The cells that a request is for: unit 0 gets the requests to every unit. */
static served_cells *asked(void *context)
{
    served_cells *cells = (served_cells *)context;
    const served_units *units = cells->owner;

    return cells->unit > 0 ? cells : &units->cells[units->asked][cells->table - 1];
}

static uint16_t get(void *context, uint16_t address)
{
    return asked(context)->values[address];
}

static uint16_t get_random_register(void *context, uint16_t address)
{
    served_cells *cells = asked(context);

    return has(cells->written, address) ? cells->values[address] : vary(cells, address, 0);
}

static uint16_t get_random_bit(void *context, uint16_t address)
{
    served_cells *cells = asked(context);

    return has(cells->written, address) ? cells->values[address] : vary(cells, address, 1) & 1;
}

static void set(void *context, uint16_t address, uint16_t value)
{
    served_cells *cells = asked(context);

    cells->values[address] = value;
    if (cells->written)
        add(cells->written, address);
}

static uint8_t exists(void *context, uint16_t address)
{
    const served_cells *cells = asked(context);

    return (uint8_t)(has(cells->readable, address) || has(cells->writable, address));
}

/* Refuses a request unless the bitmap has all its cells. */
static uint8_t check(const uint8_t *bitmap, const mbm_access *access)
{
    uint32_t i;

    for (i = 0; i < access->quantity; i++)
        if (!has(bitmap, (uint16_t)(access->address + i)))
            return MBM_ILLEGAL_DATA_ADDRESS;
    return 0;
}

static uint8_t before_read(void *context, const mbm_access *access)
{
    const served_cells *cells = asked(context);

    if (cells->most_read > 0 && access->quantity > cells->most_read)
        return MBM_ILLEGAL_DATA_VALUE;
    return check(cells->readable, access);
}

/* Whether the device has the function that writes its cells. */
static int has_function(const served_cells *cells, const mbm_access *access)
{
    const int is_single = access->function == MBM_FC_WRITE_SINGLE_COIL ||
                          access->function == MBM_FC_WRITE_SINGLE_REGISTER;
    uint32_t i;

    if (access->function == MBM_FC_MASK_WRITE_REGISTER)
        return 1;
    for (i = 0; i < access->quantity; i++)
        if (cells->functions[(uint16_t)(access->address + i)] ==
            (is_single ? DEVICE_MULTIPLE : DEVICE_SINGLE))
            return 0;
    return 1;
}

static uint8_t before_write(void *context, const mbm_access *access)
{
    const served_cells *cells = asked(context);
    uint8_t exception;

    if (!has_function(cells, access))
        return MBM_ILLEGAL_FUNCTION;
    if (cells->most_written > 0 && access->quantity > cells->most_written)
        return MBM_ILLEGAL_DATA_VALUE;
    exception = check(cells->writable, access);
    return exception ? exception : check_limits(cells, access);
}

/* Makes the cells of a table. Returns 0, or -1 without memory. */
static int make_cells(served_units *units, uint8_t unit, uint8_t table, enum served_kind kind)
{
    const int is_bit = device_is_of_bits(table);
    served_cells *cells = &units->cells[unit][table - 1];

    cells->kind = kind;
    cells->owner = units;
    cells->unit = (uint8_t)units->units[unit].id;
    cells->table = table;
    cells->seed = (uint32_t)(units->units[unit].id * 4 + table) * 40503u;
    cells->random = cells->seed | 1;
    cells->callbacks.context = cells->hooks.context = cells;
    cells->callbacks.get = kind != SERVED_RANDOM ? get
                           : is_bit              ? get_random_bit
                                                 : get_random_register;
    if (table == MBM_TABLE_COILS || table == MBM_TABLE_HOLDING_REGISTERS)
        cells->callbacks.set = set;
    cells->values = (uint16_t *)calloc(CELLS, sizeof *cells->values);
    if (kind == SERVED_RANDOM)
        cells->written = (uint8_t *)calloc(1, BITMAP);
    if (kind == SERVED_DEVICE) {
        cells->readable = (uint8_t *)calloc(1, BITMAP);
        cells->writable = (uint8_t *)calloc(1, BITMAP);
        cells->functions = (uint8_t *)calloc(1, CELLS);
        cells->callbacks.isValid = exists;
        cells->hooks.beforeRead = before_read;
        cells->hooks.beforeWrite = before_write;
        (void)mbm_dataCallbacks_setHooks(&cells->callbacks, &cells->hooks);
    }
    if (!cells->values || (kind == SERVED_RANDOM && !cells->written) ||
        (kind == SERVED_DEVICE && !(cells->readable && cells->writable && cells->functions)))
        return -1;
    (void)mbm_unit_serveCallbacks(&units->units[unit], &cells->callbacks, table);
    return 0;
}

/* --- units --- */

static uint16_t see_request(void *context, const mbm_request *request, uint8_t *response,
                            uint16_t capacity)
{
    served_units *units = (served_units *)context;
    const uint8_t exception = units->hook->before(units->hook->context, request);
    uint8_t i;

    units->asked = 0;
    for (i = 1; i < units->count; i++)
        if (units->units[i].id == request->unit)
            units->asked = i;
    (void)response;
    (void)capacity;
    return exception ? MBM_REPLY_EXCEPTION | exception : MBM_REPLY_DECLINED;
}

static void identify(served_units *units, uint8_t id, const char *text)
{
    units->objects[id].id = id;
    units->objects[id].data = (const uint8_t *)text;
    units->objects[id].length = (uint8_t)strlen(text);
}

/* Makes units with all tables. The order of the records matters: the first one sees each request.
 * Returns 0, or -1 without memory. */
static int begin(served_units *units, enum served_kind kind, const uint8_t *ids, uint8_t count,
                 const char *name, served_hook *hook)
{
    uint8_t i, table;

    memset(units, 0, sizeof *units);
    units->units = (mbm_unit *)calloc(count, sizeof *units->units);
    units->cells = (served_cells(*)[4])calloc(count, sizeof *units->cells);
    units->count = count;
    if (!units->units || !units->cells)
        return -1;
    units->every_request.serve = see_request;
    units->every_request.context = units;
    units->hook = hook;
    identify(units, 0, "mbm");
    identify(units, 1, name ? name : "mbm serve");
    identify(units, 2, mbm_version());
    units->identification.objects = units->objects;
    units->identification.count = 3;
    for (i = 0; i < count; i++) {
        units->units[i].id = ids[i];
        (void)mbm_unit_serveCustom(&units->units[i], &units->every_request);
        (void)mbm_unit_serveIdentification(&units->units[i], &units->identification);
        for (table = MBM_TABLE_COILS; table <= MBM_TABLE_INPUT_REGISTERS; table++)
            if (make_cells(units, i, table, kind) != 0)
                return -1;
    }
    return 0;
}

int served_make_units(served_units *units, enum served_kind kind, const uint8_t *ids, uint8_t count,
                      served_hook *hook)
{
    return begin(units, kind, ids, count, NULL, hook);
}

served_cells *served_cells_of(const served_units *units, const mbm_planField *planned)
{
    uint8_t unit = 0;

    while (units->units[unit].id != planned->unit)
        unit++;
    return &units->cells[unit][planned->table - 1];
}

/* Adds a field to its unit. */
static void add_field(served_units *units, const device_field *field, const mbm_planField *planned)
{
    served_cells *cells = served_cells_of(units, planned);
    const uint32_t size = device_size(planned);
    uint32_t i;

    for (i = 0; i < size; i++) {
        const uint16_t address = (uint16_t)(planned->address + i);
        const uint16_t mask = device_mask(planned, i);

        if (field->words)
            cells->values[address] = (uint16_t)((cells->values[address] & ~mask) | field->words[i]);
        if (field->access & DEVICE_READ)
            add(cells->readable, address);
        if (field->access & DEVICE_WRITE) {
            add(cells->writable, address);
            cells->functions[address] = field->write_function;
        }
    }
}

unsigned served_ids(const device *from, uint8_t ids[SERVED_IDS])
{
    uint8_t is_known[SERVED_IDS] = {0};
    unsigned count = 0, id;
    uint16_t i;

    for (i = 0; i < from->count; i++)
        is_known[from->planned[i].unit] = 1;
    for (id = 0; id < SERVED_IDS; id++)
        if (is_known[id])
            ids[count++] = (uint8_t)id;
    return count;
}

int served_make_device(served_units *units, const device *from, const uint8_t *ids, uint8_t count,
                       served_hook *hook)
{
    uint8_t table;
    uint16_t i;

    if (begin(units, SERVED_DEVICE, ids, count, from->name, hook) != 0)
        return -1;
    units->from = from;
    for (i = 0; i < count; i++)
        for (table = MBM_TABLE_COILS; table <= MBM_TABLE_INPUT_REGISTERS; table++) {
            const int is_bits = device_is_of_bits(table);
            served_cells *cells = &units->cells[i][table - 1];

            cells->most_read = is_bits ? from->limits.read_bits : from->limits.read_registers;
            cells->most_written = is_bits ? from->limits.write_bits : from->limits.write_registers;
        }
    for (i = 0; i < from->count; i++)
        add_field(units, &from->fields[i], &from->planned[i]);
    return 0;
}

void served_free(served_units *units)
{
    uint8_t i, table;

    for (i = 0; units->cells && i < units->count; i++)
        for (table = 0; table < 4; table++) {
            free(units->cells[i][table].values);
            free(units->cells[i][table].readable);
            free(units->cells[i][table].writable);
            free(units->cells[i][table].functions);
            free(units->cells[i][table].written);
        }
    free(units->cells);
    free(units->units);
}
