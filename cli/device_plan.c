/* Makes and tries the plan of a device, and writes what it has read.
 *
 * Licence: MIT OR Apache-2.0. */
#include "device_plan.h"

#include "numbers.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int device_plan_make(mbm_planSetup *setup, const device *of, int gap, uint8_t requests)
{
    const device_limits *limits = &of->limits;
    const uint16_t count = of->readable;

    setup->fields = of->planned;
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
    setup->positions = (mbm_planPosition *)calloc(count, sizeof *setup->positions);
    setup->reads = (mbm_planRead *)calloc(count, sizeof *setup->reads);
    setup->data = (uint16_t *)calloc(setup->dataWords, sizeof *setup->data);
    setup->requests = (mbm_clientRequest *)calloc(requests, sizeof *setup->requests);
    return setup->positions && setup->reads && setup->data && setup->requests;
}

void device_plan_free(mbm_planSetup *setup)
{
    free(setup->positions);
    free(setup->reads);
    free(setup->data);
    free(setup->requests);
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
    static uint8_t frame[MBM_MAX_FRAME];

    (void)mbm_client_beginRtuOverTcp(&client, &nowhere, frame, sizeof frame);
    return mbm_plan_begin(plan, &client, setup, wrong);
}

/* --- values --- */

/* Writes one value of a field. Returns 0 if none has arrived yet. */
static int print_one(const mbm_plan *plan, const device *of, uint16_t field, uint16_t index,
                     int is_json, char text[VALUE_TEXT_BYTES])
{
    const mbm_planField *planned = &of->planned[field];
    mbm_registers registers;
    uint16_t bit, size;
    int64_t integer;

    if (planned->type == MBM_TYPE_BIT) {
        if (mbm_plan_getInteger(plan, field, index, &integer) != MBM_OK)
            return 0;
        if (planned->count > 1 && device_is_part(planned)) {
            snprintf(text, VALUE_TEXT_BYTES, "%d", (int)integer);
            return 1;
        }
        bit = (uint16_t)integer;
        (void)mbm_registers_ofWords(&registers, &bit, 1, 0);
        value_print(&of->fields[field].form, &registers, 0, 1, is_json, text);
        return 1;
    }
    if (mbm_plan_getRegisters(plan, field, &registers) != MBM_OK)
        return 0;
    size = value_registers(planned->type, planned->count);
    value_print(&of->fields[field].form, &registers, (uint16_t)(planned->address + index * size),
                planned->count, is_json, text);
    return 1;
}

uint16_t device_plan_count(const mbm_planField *planned)
{
    return planned->type == MBM_TYPE_TEXT || device_is_part(planned) ? 1 : planned->count;
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
        for (i = 0; i < size; i++)
            (void)mbm_registers_getUint16(&registers,
                                          (uint16_t)(planned->address + index * size + i),
                                          MBM_ORDER_ABCD, &words[i]);
    }
    return device_label_of(of, field, words);
}

int device_plan_text(const mbm_plan *plan, const device *of, uint16_t field, int is_json,
                     char text[DEVICE_TEXT_LONGEST])
{
    const uint16_t count = device_plan_count(&of->planned[field]);
    const int is_array = is_json && count > 1;
    size_t length = 0;
    uint16_t index;

    for (index = 0; index < count; index++) {
        const char *before = index > 0 ? "," : is_array ? "[" : "";
        char one[VALUE_TEXT_BYTES];

        if (!print_one(plan, of, field, index, is_json, one))
            return 0;
        length +=
            (size_t)snprintf(text + length, DEVICE_TEXT_LONGEST - length, "%s%s", before, one);
    }
    if (is_array)
        strcpy(text + length, "]");
    return 1;
}
