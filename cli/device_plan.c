/* Makes and tries the plan of a device, and writes what it has read. */
#include "device_plan.h"

#include "numbers.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int device_plan_make(mbm_planSetup *setup, const device *of, int gap, uint8_t requests)
{
    const device_limits *limits = &of->limits;
    const uint16_t count = of->readable;
    mbm_planField *fields;
    uint16_t i;

    setup->fieldCount = setup->readCount = count;
    setup->dataWords = UINT16_MAX;
    setup->bitGap = limits->bit_gap;
    setup->registerGap = limits->register_gap;
    if (gap != DEVICE_PLAN_OWN_GAP) {
        setup->bitGap = (uint16_t)gap;
        setup->registerGap = gap < MBM_MAX_READ_REGISTERS ? (uint16_t)gap : MBM_MAX_READ_REGISTERS;
    }
    setup->registersPerRead = limits->read_registers;
    setup->bitsPerRead = limits->read_bits;
    setup->excluded = limits->excluded;
    setup->excludedCount = limits->excluded_count;
    setup->requestCount = requests;
    fields = (mbm_planField *)calloc(count, sizeof *fields);
    for (i = 0; fields && i < count; i++)
        fields[i] = device_read_as(&of->planned[i]);
    setup->fields = fields;
    setup->positions = (mbm_planPosition *)calloc(count, sizeof *setup->positions);
    setup->reads = (mbm_planRead *)calloc(count, sizeof *setup->reads);
    setup->data = (uint16_t *)calloc(setup->dataWords, sizeof *setup->data);
    setup->requests = (mbm_clientRequest *)calloc(requests, sizeof *setup->requests);
    return fields && setup->positions && setup->reads && setup->data && setup->requests;
}

int device_plan_split(mbm_planSplitting *splitting, const mbm_planSetup *setup)
{
    memset(splitting, 0, sizeof *splitting);
    splitting->blocks = (uint16_t *)calloc(setup->fieldCount, sizeof *splitting->blocks);
    return splitting->blocks != NULL;
}

int device_plan_is_refused(uint8_t status)
{
    return status == MBM_ILLEGAL_DATA_ADDRESS || status == MBM_ILLEGAL_DATA_VALUE;
}

int device_plan_covers(const mbm_planReadInfo *read, const mbm_planField *planned)
{
    return read->unit == planned->unit && read->table == planned->table &&
           read->intervalMs == planned->intervalMs && read->address <= planned->address &&
           (uint32_t)read->address + read->quantity >= planned->address + device_size(planned);
}

void device_plan_free(mbm_planSetup *setup)
{
    free((void *)(uintptr_t)setup->fields);
    free(setup->positions);
    free(setup->reads);
    free(setup->data);
    free(setup->requests);
}

const char *device_plan_check(const device *of, const char *path, uint8_t framing)
{
    uint16_t i;

    for (i = 0; i < of->readable && framing != MBM_FRAMING_TCP; i++)
        if (of->planned[i].unit == 0)
            return say(
                "%s:%d: unit 0 of %s is read in frames of Modbus TCP only: on a serial line it "
                "is a broadcast, which no device answers",
                path, of->fields[i].line, of->fields[i].name);
    return NULL;
}

const char *device_plan_wrong(const device *of, const char *path, uint8_t status, uint16_t wrong)
{
    const char *text = status == MBM_BUFFER_TOO_SMALL
                           ? "the fields up to here take more than 65535 words of data"
                           : mbm_status_text(status);

    if (wrong < of->readable)
        return say("%s:%d: %s", path, of->fields[wrong].line, text);
    return say("%s: %s", path, mbm_status_text(status));
}

/* --- a trial --- */

static int16_t read_nothing(void *context, uint8_t *bytes, uint16_t capacity)
{
    (void)context;
    (void)bytes;
    (void)capacity;
    return 0;
}

static int16_t write_nothing(void *context, const uint8_t *bytes, uint16_t length)
{
    (void)context;
    (void)bytes;
    (void)length;
    return 0;
}

static uint32_t no_time(void *context)
{
    (void)context;
    return 0;
}

uint8_t device_plan_try(mbm_plan *plan, const mbm_planSetup *setup, uint16_t *wrong)
{
    static const mbm_port nowhere = {
        .read = read_nothing, .write = write_nothing, .micros = no_time};
    static mbm_client client = MBM_INIT;
    static uint8_t frame[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];

    (void)mbm_client_beginTcp(&client, &nowhere, frame, sizeof frame, outgoing, sizeof outgoing);
    return mbm_plan_begin(plan, &client, setup, wrong);
}

/* --- values --- */

uint8_t device_plan_form(mbm_plan *plan, const device *of, uint16_t field, value_form *form)
{
    const int power = of->fields[field].power_field;
    mbm_registers registers;

    *form = of->fields[field].form;
    if (power < 0)
        return MBM_OK;
    /* A power that failed to arrive lately is not used for a number that did arrive: if one request
     * reads both, they have one status. */
    if (mbm_plan_getRegisters(plan, (uint16_t)power, &registers) != MBM_OK ||
        (mbm_plan_getStatus(plan, (uint16_t)power, NULL) != MBM_OK &&
         mbm_plan_getStatus(plan, field, NULL) == MBM_OK) ||
        !device_scale(of, (uint16_t)power, &registers, &form->scale))
        return MBM_NOT_AVAILABLE;
    return MBM_OK;
}

/* Writes bits as one number. Returns as print_one. */
static uint8_t print_bits(const mbm_planField *planned, const value_form *form, int64_t integer,
                          int is_json, char text[VALUE_TEXT_BYTES])
{
    const value_form as = device_bits_form(planned, form);
    uint16_t bits = (uint16_t)integer;
    mbm_registers registers;

    (void)mbm_registers_ofWords(&registers, &bits, 1, 0);
    return conversion_print(&as, &registers, 0, 1, is_json, text);
}

/* Writes one value of a field. Returns MBM_OK; MBM_NOT_AVAILABLE or MBM_MALFORMED_VALUE with null
 * in JSON, and else an empty text; MBM_PENDING if no value has arrived yet. */
static uint8_t print_one(mbm_plan *plan, const device *of, uint16_t field, uint16_t index,
                         int is_json, char text[VALUE_TEXT_BYTES])
{
    const mbm_planField *planned = &of->planned[field];
    mbm_registers registers;
    value_form form;
    uint16_t size;
    int64_t integer;

    if (planned->type == MBM_TYPE_BIT) {
        if (mbm_plan_getInteger(plan, field, index, &integer) != MBM_OK)
            return MBM_PENDING;
        return print_bits(planned, &of->fields[field].form, integer, is_json, text);
    }
    if (mbm_plan_getRegisters(plan, field, &registers) != MBM_OK)
        return MBM_PENDING;
    if (device_plan_form(plan, of, field, &form) != MBM_OK) {
        strcpy(text, is_json ? "null" : "");
        return MBM_NOT_AVAILABLE;
    }
    size = value_registers(planned->type, planned->count);
    return conversion_print(&form, &registers, (uint16_t)(planned->address + index * size),
                            planned->count, is_json, text);
}

uint8_t device_plan_status(mbm_plan *plan, const device *of, uint16_t field, uint32_t *ageMs)
{
    const uint8_t status = mbm_plan_getStatus(plan, field, ageMs);
    const uint16_t count = device_values_in(&of->planned[field]);
    char text[VALUE_TEXT_BYTES];
    uint16_t index;
    uint8_t one = status;

    /* One value of several suffices. */
    for (index = 0; status == MBM_OK && index < count; index++) {
        one = print_one(plan, of, field, index, 0, text);
        if (one == MBM_OK || one == MBM_PENDING)
            return status;
    }
    return one;
}

int device_plan_is_read(uint8_t status)
{
    return status == MBM_OK || status == MBM_NOT_AVAILABLE || status == MBM_MALFORMED_VALUE;
}

const char *device_plan_name(const mbm_plan *plan, const device *of, uint16_t field, uint16_t index)
{
    const mbm_planField *planned = &of->planned[field];
    const uint16_t size = value_registers(planned->type, 1);
    uint16_t words[VALUE_WORDS] = {0}, i;
    mbm_registers registers;
    int64_t integer;

    if (of->fields[field].label_count == 0)
        return NULL;
    if (planned->type == MBM_TYPE_BIT) {
        if (mbm_plan_getInteger(plan, field, index, &integer) != MBM_OK)
            return NULL;
        words[0] = (uint16_t)integer;
    } else {
        if (mbm_plan_getRegisters(plan, field, &registers) != MBM_OK)
            return NULL;
        for (i = 0; i < size; i++) {
            (void)mbm_registers_getUint16(&registers,
                                          (uint16_t)(planned->address + index * size + i),
                                          MBM_ORDER_ABCD, &words[i]);
            words[i] &= device_mask(planned, i);
        }
    }
    return device_label_of(of, field, words);
}

int device_plan_text(mbm_plan *plan, const device *of, uint16_t field, int is_json,
                     const char *none, char text[DEVICE_TEXT_LONGEST])
{
    const uint16_t count = device_values_in(&of->planned[field]);
    const int is_array = is_json && count > 1;
    size_t length = 0;
    uint16_t index;

    for (index = 0; index < count; index++) {
        const char *before = index > 0 ? "," : is_array ? "[" : "";
        char one[VALUE_TEXT_BYTES];
        const uint8_t status = print_one(plan, of, field, index, is_json, one);

        if (status == MBM_PENDING)
            return 0;
        length += (size_t)snprintf(text + length, DEVICE_TEXT_LONGEST - length, "%s%s", before,
                                   status != MBM_OK && !is_json ? none : one);
    }
    if (is_array)
        strcpy(text + length, "]");
    return 1;
}
