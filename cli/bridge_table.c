#define _GNU_SOURCE
#include "bridge_table.h"

#include "broker.h"
#include "device_file.h"
#include "report.h"
#include "trial.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { DATA_WORDS = 65535 };

/* Tells two contents of a file apart (FNV-1a, 64 bits). Returns 0 if it cannot be read. */
static uint64_t digest_of(const char *path)
{
    uint64_t digest = 0xCBF29CE484222325u;
    FILE *file = fopen(path, "rb");
    int one;

    if (!file)
        return 0;
    while ((one = getc(file)) != EOF)
        digest = (digest ^ (uint64_t)one) * 0x100000001B3u;
    (void)fclose(file);
    return digest;
}

/* Returns NULL, or why the bridge cannot publish or write a field. */
static const char *check_field(const device_field *field, const mbm_planField *planned)
{
    const char *wrong = broker_check_name(field->name);
    const uint32_t size = device_size(planned);

    if (wrong || !(field->access & DEVICE_WRITE))
        return wrong;
    if (planned->table == MBM_TABLE_COILS && size > MBM_MAX_WRITE_BITS)
        return "one request writes at most 1968 coils";
    if (planned->table != MBM_TABLE_COILS && size > MBM_MAX_WRITE_REGISTERS)
        return "one request writes at most 123 registers";
    return NULL;
}

/* Returns an exit code; with the reason in `wrong` if it is not CODE_DONE. */
static int check_fields(const device *of, const char *path, char wrong[YAML_FILE_WRONG_BYTES])
{
    uint16_t field;

    for (field = 0; field < of->count; field++) {
        const char *why = check_field(&of->fields[field], &of->planned[field]);

        if (!why)
            continue;
        snprintf(wrong, YAML_FILE_WRONG_BYTES, "%s:%d: %s: %s", path, of->fields[field].line,
                 of->fields[field].name, why);
        return CODE_WRONG;
    }
    if (of->readable > 0)
        return CODE_DONE;
    snprintf(wrong, YAML_FILE_WRONG_BYTES, "%s: no field can be read", path);
    return CODE_WRONG;
}

/* Gives the plan its storage. Returns 0 without memory. */
static int make_storage(bridge_table *table, uint8_t register_gap)
{
    const size_t count = table->fields.readable;
    mbm_planSetup *setup = &table->setup;
    size_t field;

    table->last = (published *)calloc(count, sizeof *table->last);
    setup->fields = table->fields.planned;
    setup->fieldCount = setup->readCount = table->fields.readable;
    setup->registerGap = register_gap;
    setup->positions = (mbm_planPosition *)calloc(count, sizeof *setup->positions);
    setup->reads = (mbm_planRead *)calloc(count, sizeof *setup->reads);
    setup->data = (uint16_t *)calloc(DATA_WORDS, sizeof *setup->data);
    setup->requests = (mbm_clientRequest *)calloc(BRIDGE_REQUESTS, sizeof *setup->requests);
    setup->dataWords = DATA_WORDS;
    setup->requestCount = BRIDGE_REQUESTS;
    for (field = 0; field < count; field++)
        table->units[table->fields.planned[field].unit].fields++;
    return table->last && setup->positions && setup->reads && setup->data && setup->requests;
}

/* Tries the plan. Returns an exit code. */
static int try_plan(const bridge_table *table, const char *path, char wrong[YAML_FILE_WRONG_BYTES])
{
    static mbm_plan plan = MBM_INIT;
    uint16_t field;
    const uint8_t status = trial_begin(&plan, &table->setup, &field);

    (void)mbm_plan_end(&plan);
    if (status == MBM_OK)
        return CODE_DONE;
    if (field < table->fields.readable)
        snprintf(wrong, YAML_FILE_WRONG_BYTES, "%s:%d: %s", path, table->fields.fields[field].line,
                 mbm_status_text(status));
    else
        snprintf(wrong, YAML_FILE_WRONG_BYTES, "%s: %s", path, mbm_status_text(status));
    return CODE_WRONG;
}

bridge_table *bridge_table_read(const char *path, uint8_t register_gap, int *code,
                                char wrong[YAML_FILE_WRONG_BYTES])
{
    bridge_table *table = (bridge_table *)calloc(1, sizeof *table);

    if (!table) {
        snprintf(wrong, YAML_FILE_WRONG_BYTES, "%s: not enough memory", path);
        *code = CODE_SYSTEM;
        return NULL;
    }
    table->digest = digest_of(path);
    *code = device_file_read(&table->fields, path, wrong);
    if (*code == CODE_DONE)
        *code = check_fields(&table->fields, path, wrong);
    if (*code == CODE_DONE && !make_storage(table, register_gap)) {
        *code = CODE_SYSTEM;
        snprintf(wrong, YAML_FILE_WRONG_BYTES, "%s: not enough memory", path);
    }
    if (*code == CODE_DONE)
        *code = try_plan(table, path, wrong);
    if (*code == CODE_DONE)
        return table;
    bridge_table_free(table);
    return NULL;
}

void bridge_table_free(bridge_table *table)
{
    uint16_t field;

    if (!table)
        return;
    for (field = 0; table->last && field < table->fields.readable; field++)
        free(table->last[field].value);
    free(table->last);
    free(table->setup.positions);
    free(table->setup.reads);
    free(table->setup.data);
    free(table->setup.requests);
    device_free(&table->fields);
    free(table);
}
