/* Reads a line's table, publishes its values and units, and carries out writes. */
#include "bridge_line.h"

#include "clock.h"
#include "device.h"
#include "device_plan.h"
#include "discovery.h"
#include "numbers.h"
#include "report.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* --- the table of a line --- */

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
    const uint32_t size = device_size(planned);

    if (!(field->access & DEVICE_WRITE))
        return NULL;
    if (field->write_function == DEVICE_SINGLE && size > 1)
        return "write_function single writes one coil or register, and the field has more";
    if (planned->table == MBM_TABLE_COILS && size > MBM_MAX_WRITE_BITS)
        return "one request writes at most 1968 coils";
    if (planned->table != MBM_TABLE_COILS && size > MBM_MAX_WRITE_REGISTERS)
        return "one request writes at most 123 registers";
    return NULL;
}

/* Gives the fields their function and checks them. Returns an exit code; with the reason in `wrong`
 * if it is not CODE_DONE. */
static int check_fields(device *of, const char *path, uint8_t function,
                        char wrong[YAML_FILE_WRONG_BYTES])
{
    uint16_t field;

    for (field = 0; field < of->count; field++) {
        const char *why;

        if (of->fields[field].write_function == DEVICE_BY_SIZE)
            of->fields[field].write_function = function;
        why = check_field(&of->fields[field], &of->planned[field]);

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
static int make_storage(bridge_table *table, int register_gap)
{
    const size_t count = table->fields.readable;
    size_t field;

    table->last = (published *)calloc(count, sizeof *table->last);
    for (field = 0; field < count; field++)
        table->units[table->fields.planned[field].unit].fields++;
    if (!device_plan_make(&table->setup, &table->fields, register_gap, BRIDGE_REQUESTS) ||
        !device_plan_split(&table->splitting, &table->setup))
        return 0;
    table->setup.bitGap = table->fields.limits.bit_gap;
    return table->last != NULL;
}

/* Tries the plan. Returns an exit code. */
static int try_plan(const bridge_table *table, const char *path, char wrong[YAML_FILE_WRONG_BYTES])
{
    static mbm_plan plan = MBM_INIT;
    uint16_t field;
    const uint8_t status = device_plan_try(&plan, &table->setup, &field);

    (void)mbm_plan_end(&plan);
    if (status == MBM_OK)
        return CODE_DONE;
    snprintf(wrong, YAML_FILE_WRONG_BYTES, "%s",
             device_plan_wrong(&table->fields, path, status, field));
    return CODE_WRONG;
}

bridge_table *bridge_table_read(const char *path, int register_gap, uint8_t function, int *code,
                                char wrong[YAML_FILE_WRONG_BYTES])
{
    bridge_table *table = (bridge_table *)calloc(1, sizeof *table);

    if (!table) {
        snprintf(wrong, YAML_FILE_WRONG_BYTES, "%s: " REPORT_NO_MEMORY, path);
        *code = CODE_SYSTEM;
        return NULL;
    }
    table->digest = digest_of(path);
    *code = device_file_read(&table->fields, path, wrong);
    if (*code == CODE_DONE)
        *code = check_fields(&table->fields, path, function, wrong);
    if (*code == CODE_DONE && !make_storage(table, register_gap)) {
        *code = CODE_SYSTEM;
        snprintf(wrong, YAML_FILE_WRONG_BYTES, "%s: " REPORT_NO_MEMORY, path);
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
    device_plan_free(&table->setup);
    free(table->splitting.blocks);
    device_free(&table->fields);
    free(table);
}

/* --- publishing --- */

static void publish(const bridge_line *l, const char *name, const char *last, const char *text,
                    int is_retained)
{
    char full[BRIDGE_TOPIC_BYTES + BROKER_LONGEST_TOPIC];

    snprintf(full, sizeof full, "%s%s", l->below, name);
    broker_publish(&l->bridge->mqtt, full, last, text, is_retained);
}

/* Whether a status came from the unit itself, and not from a line or gateway that lacks it. */
static int is_answer(uint8_t status)
{
    return status < 0x80 && status != MBM_GATEWAY_PATH_UNAVAILABLE &&
           status != MBM_GATEWAY_TARGET_FAILED_TO_RESPOND;
}

static void publish_unit(const bridge_line *l, unsigned unit, const char *text)
{
    char name[16];

    snprintf(name, sizeof name, "unit/%u", unit);
    publish(l, name, "status", text, 1);
}

static const char *unit_text(const unit_state *unit)
{
    return unit->state == UNIT_ONLINE ? "online" : "offline";
}

/* A unit is online while it answers one of its reads. */
static void update_unit(bridge_line *l, uint16_t field, uint8_t status)
{
    const uint16_t number = l->table->fields.planned[field].unit;
    unit_state *unit = &l->table->units[number];
    published *was = &l->table->last[field];
    const uint8_t answered = (uint8_t)is_answer(status);
    const char *why;

    line_note(&l->at, status);
    why = line_why(&l->at, status);
    unit->ended = (uint16_t)(unit->ended + !was->has_ended);
    was->has_ended = 1;
    unit->answered = (uint16_t)(unit->answered + answered - was->is_answered);
    was->is_answered = answered;
    if (unit->answered > 0 ? unit->state == UNIT_ONLINE
                           : unit->ended < unit->fields || unit->state == UNIT_OFFLINE)
        return;
    unit->state = unit->answered > 0 ? UNIT_ONLINE : UNIT_OFFLINE;
    publish_unit(l, number, unit_text(unit));
    if (unit->state == UNIT_ONLINE)
        report_log(REPORT_INFO, "%s: unit %u answers", l->text, number);
    else
        report_log(REPORT_WARNING, "%s: unit %u does not answer: %s%s%s", l->text, number,
                   mbm_status_text(status), why ? ": " : "", why ? why : "");
}

/* Publishes the last value of a field, with its status and the time at which it was read. */
static void publish_value(bridge_line *l, uint16_t field)
{
    static char json[DEVICE_TEXT_LONGEST + 128];
    const published *what = &l->table->last[field];
    const char *value = what->value ? what->value : "null";
    const char *name = l->table->fields.fields[field].topic;
    uint32_t age = 0;
    char when[CLOCK_TEXT_BYTES];

    if (l->bridge->is_plain) {
        /* Plain text has no place for a status: what failed is not published. */
        if (what->value && device_plan_is_read(what->status))
            publish(l, name, NULL, value, 1);
        return;
    }
    (void)mbm_plan_getStatus(&l->plan, field, &age);
    if (!what->value)
        age = 0;
    (void)clock_text(clock_micros(CLOCK_REALTIME) - age * (uint64_t)1000, 3, when);
    snprintf(json, sizeof json, "{\"value\":%s,\"status\":\"%s\",\"time\":\"%s\"}", value,
             mbm_status_text(what->status), when);
    publish(l, name, NULL, json, 1);
}

/* Takes the value and the status that a field has now. Returns whether they are new. */
static int take_value(bridge_line *l, uint16_t field)
{
    static char text[DEVICE_TEXT_LONGEST];
    const device *of = &l->table->fields;
    published *was = &l->table->last[field];
    const uint8_t status = device_plan_status(&l->plan, of, field, NULL);
    int is_new = status != was->status || !was->has_ended;

    /* "None" is unknown to Home Assistant. */
    if (device_plan_is_read(status) &&
        device_plan_text(&l->plan, of, field, !l->bridge->is_plain, "None", text) &&
        (!was->value || strcmp(text, was->value) != 0)) {
        free(was->value);
        was->value = strdup(text);
        is_new = 1;
    }
    was->status = status;
    return is_new;
}

/* Publishes the fields whose power of ten has changed. */
static void update_scaled(bridge_line *l, uint16_t power)
{
    uint16_t field;

    for (field = 0; field < l->table->fields.readable; field++)
        if (l->table->fields.fields[field].power_field == power &&
            l->table->last[field].has_ended && take_value(l, field))
            publish_value(l, field);
}

/* Logs that the device does not have a field, and that it has it again. */
static void log_refused(bridge_line *l, uint16_t field, uint8_t status)
{
    published *was = &l->table->last[field];
    const char *name = l->table->fields.fields[field].name;
    const unsigned unit = l->table->fields.planned[field].unit;

    if (device_plan_is_refused(status) && !was->is_refused) {
        was->is_refused = 1;
        report_log(REPORT_WARNING,
                   "%s: unit %u refuses %s: %s. It is tried again after ten minutes", l->text, unit,
                   name, mbm_status_text(status));
    } else if (status == MBM_OK && was->is_refused) {
        was->is_refused = 0;
        report_log(REPORT_INFO, "%s: unit %u has %s again", l->text, unit, name);
    }
}

/* Called by the plan for each field whose read has ended. */
static void on_update(void *context, mbm_plan *ended, uint16_t field)
{
    bridge_line *l = (bridge_line *)context;
    const int is_new = take_value(l, field) || l->bridge->is_every;
    const uint8_t status = mbm_plan_getStatus(ended, field, NULL);

    update_unit(l, field, status);
    log_refused(l, field, status);
    if (is_new)
        publish_value(l, field);
    if (l->table->fields.fields[field].is_power)
        update_scaled(l, field);
}

static const discovery_line *discovery_of(const bridge_line *l)
{
    static discovery_line as;

    as.prefix = l->bridge->discovery_prefix ? l->bridge->discovery_prefix : "homeassistant";
    as.topic = l->bridge->mqtt.topic;
    as.below = l->below;
    as.is_plain = l->bridge->is_plain;
    return &as;
}

/* Publishes how Home Assistant finds the fields. */
static void discover(bridge_line *l)
{
    uint16_t field;

    for (field = 0; field < l->table->fields.count; field++) {
        char topic[DISCOVERY_TOPIC_BYTES];
        char *text = discovery_config(discovery_of(l), &l->table->fields, field, topic);

        if (text)
            broker_publish_at(&l->bridge->mqtt, topic, text);
        free(text);
    }
}

void bridge_line_connected(bridge_line *l)
{
    unsigned number;
    uint16_t field;

    broker_subscribe(&l->bridge->mqtt, l->below);
    if (l->bridge->has_discovery)
        discover(l);
    for (number = 0; number < 256; number++)
        if (l->table->units[number].state != UNIT_UNKNOWN)
            publish_unit(l, number, unit_text(&l->table->units[number]));
    for (field = 0; field < l->table->fields.readable; field++)
        if (l->table->last[field].has_ended)
            publish_value(l, field);
}

/* --- what is left of fields that are gone --- */

/* Whether the next table has this field with this topic of discovery. */
static int is_discovered(const bridge_line *l, const device *next, const char *name,
                         const char *topic)
{
    const int field = next ? device_find(next, name) : -1;
    char other[DISCOVERY_TOPIC_BYTES];

    if (field < 0)
        return 0;
    discovery_topic(discovery_of(l), next, (uint16_t)field, other);
    return strcmp(topic, other) == 0;
}

/* Removes the retained messages of the table, except those that `next` has too. */
static void remove_retained(bridge_line *l, const bridge_table *next)
{
    const device *fields = &l->table->fields, *others = next ? &next->fields : NULL;
    char topic[DISCOVERY_TOPIC_BYTES];
    unsigned number;
    uint16_t field;

    for (field = 0; field < fields->count; field++) {
        const char *name = fields->fields[field].topic;
        const int other = others ? device_find(others, name) : -1;

        if (field < fields->readable && (other < 0 || other >= others->readable))
            publish(l, name, NULL, "", 1);
        if (!l->bridge->has_discovery)
            continue;
        discovery_topic(discovery_of(l), fields, field, topic);
        if (!is_discovered(l, others, name, topic))
            broker_publish_at(&l->bridge->mqtt, topic, "");
    }
    for (number = 0; number < 256; number++)
        if (l->table->units[number].fields > 0 && (!next || next->units[number].fields == 0))
            publish_unit(l, number, "");
}

/* --- writes --- */

static void publish_result(const bridge_line *l, const char *name, const char *result)
{
    l->bridge->refused += strcmp(result, "success") != 0;
    l->bridge->written += strcmp(result, "success") == 0;
    publish(l, name, "result", result, 0);
}

static void on_written(void *context, mbm_clientRequest *request)
{
    bridge_write *write = (bridge_write *)context;
    bridge_line *l = write->line;
    const int field = device_find(&l->table->fields, write->name);
    char text[256];

    publish_result(l, write->name, line_status(&l->at, request, text));
    if (field >= 0 && field < l->table->fields.readable)
        (void)mbm_plan_refresh(&l->plan, (uint16_t)field);
    write->is_used = 0;
}

/* Writes bits of a register, by function 22: the device changes no other bit. */
static uint8_t write_part(bridge_line *l, bridge_write *write, const value_form *as,
                          const mbm_planField *planned, const broker_event *event,
                          const char **wrong)
{
    const value_form form = device_bits_form(planned, as);
    uint16_t bits[VALUE_WORDS] = {0};

    if (payload_parse(&form, event->bytes + event->name_bytes, event->length, bits, wrong) == 0)
        return MBM_INVALID_ARGUMENT;
    if (bits[0] >> planned->count) {
        *wrong = "the number is out of range";
        return MBM_INVALID_ARGUMENT;
    }
    return mbm_client_maskWriteRegister(&l->at.client, &write->request, planned->address,
                                        (uint16_t)~device_mask(planned, 0),
                                        device_part(planned, bits[0]));
}

/* Packs coils, one word each, eight to a byte. */
static void pack_coils(const uint16_t *bits, uint16_t count, void *bytes)
{
    uint8_t *to = (uint8_t *)bytes;
    uint16_t at;

    memset(to, 0, (size_t)(count + 7) / 8);
    for (at = 0; at < count; at++)
        to[at / 8] = (uint8_t)(to[at / 8] | (bits[at] & 1) << at % 8);
}

static uint8_t write_all(bridge_line *l, bridge_write *write, const device_field *field,
                         const value_form *form, const mbm_planField *planned,
                         const broker_event *event, const char **wrong)
{
    static uint16_t words[PAYLOAD_WORDS];
    const uint16_t count = payload_parse_all(form, planned->count, event->bytes + event->name_bytes,
                                             event->length, words, wrong);
    const int is_single = count == 1 && field->write_function != DEVICE_MULTIPLE;

    if (count == 0)
        return MBM_INVALID_ARGUMENT;
    if (planned->table == MBM_TABLE_COILS && is_single)
        return mbm_client_writeSingleCoil(&l->at.client, &write->request, planned->address,
                                          (uint8_t)words[0]);
    if (planned->table == MBM_TABLE_COILS) {
        pack_coils(words, count, write->words);
        return mbm_client_writeMultipleCoils(&l->at.client, &write->request, planned->address,
                                             count);
    }
    if (is_single)
        return mbm_client_writeSingleRegister(&l->at.client, &write->request, planned->address,
                                              words[0]);
    memcpy(write->words, words, count * sizeof *words);
    return mbm_client_writeMultipleRegisters(&l->at.client, &write->request, planned->address,
                                             count);
}

/* Returns NULL, or why a field is not written. */
static const char *check_write(const bridge_line *l, int field, const broker_event *event)
{
    if (field < 0)
        return "there is no such field";
    if (!(l->table->fields.fields[field].access & DEVICE_WRITE))
        return device_is_part(&l->table->fields.planned[field])
                   ? "the field is not writable: bits of a register need \"mask_write: yes\" and an "
                     "access with write in the device file"
                   : "the field is not writable";
    if (event->is_retained)
        return "a retained write is not carried out: it would be repeated";
    return event->is_too_long ? "the payload is too long" : NULL;
}

/* Begins a write. Returns NULL, or why it is refused. */
static const char *begin_write(bridge_line *l, const char *name, const broker_event *event)
{
    const int field = device_find(&l->table->fields, name);
    const char *wrong = check_write(l, field, event);
    bridge_write *write = l->writes;
    const mbm_planField *planned;
    value_form form;
    uint8_t status;
    int power;

    if (wrong)
        return wrong;
    power = l->table->fields.fields[field].power_field;
    if (device_plan_form(&l->plan, &l->table->fields, (uint16_t)field, &form) != MBM_OK ||
        (power >= 0 && mbm_plan_getStatus(&l->plan, (uint16_t)power, NULL) != MBM_OK))
        return say("the power of ten of the field, %s, is not available",
                   l->table->fields.fields[field].power_name);
    while (write < l->writes + BRIDGE_WRITES && write->is_used)
        write++;
    if (write == l->writes + BRIDGE_WRITES)
        return "too many writes wait";
    planned = &l->table->fields.planned[field];
    memset(write, 0, sizeof *write);
    snprintf(write->name, sizeof write->name, "%s", name);
    write->line = l;
    write->request.unit = planned->unit;
    write->request.data = write->words;
    write->request.done = on_written;
    write->request.context = write;
    status = device_is_part(planned) ? write_part(l, write, &form, planned, event, &wrong)
                                     : write_all(l, write, &l->table->fields.fields[field], &form,
                                                 planned, event, &wrong);
    if (wrong)
        return wrong;
    if (status != MBM_OK && status != MBM_PENDING)
        return mbm_status_text(status);
    write->is_used = 1;
    return NULL;
}

void bridge_line_write(bridge_line *l, const char *name, const broker_event *event)
{
    const char *wrong = begin_write(l, name, event);

    if (wrong)
        publish_result(l, name, wrong);
}

/* --- a line --- */

bridge_line *bridge_line_make(bridge_settings *bridge, const char *text, const char *path,
                              const char *topic, const place *where)
{
    bridge_line *l = (bridge_line *)calloc(1, sizeof *l);

    if (!l)
        return NULL;
    l->bridge = bridge;
    l->text = strdup(text);
    l->path = strdup(path);
    l->topic = strdup(topic);
    if (!l->text || !l->path || !l->topic) {
        bridge_line_end(l);
        return NULL;
    }
    snprintf(l->below, sizeof l->below, "%s%s", topic, *topic ? "/" : "");
    l->where = *where;
    l->where.text = l->text;
    return l;
}

/* The table was tried: its plan begins. */
static void begin_plan(bridge_line *l, bridge_table *table)
{
    l->table = table;
    table->setup.update = on_update;
    table->setup.context = l;
    (void)mbm_plan_begin(&l->plan, &l->at.client, &table->setup, NULL);
}

int bridge_line_begin(bridge_line *l, bridge_table *table, int is_patient)
{
    const int code = is_patient ? line_open_later(&l->at, &l->where) : line_open(&l->at, &l->where);

    if (code != CODE_DONE)
        return code;
    l->at.is_logged = 1;
    begin_plan(l, table);
    return CODE_DONE;
}

void bridge_line_replace(bridge_line *l, bridge_table *next)
{
    bridge_table *before = l->table;

    remove_retained(l, next);
    (void)mbm_plan_end(&l->plan);
    begin_plan(l, next);
    bridge_table_free(before);
    if (l->bridge->has_discovery)
        discover(l);
}

unsigned bridge_line_not_available(const bridge_line *l)
{
    unsigned count = 0;
    uint16_t field;

    for (field = 0; field < l->table->fields.readable; field++)
        count += l->table->last[field].status == MBM_NOT_AVAILABLE ||
                 l->table->last[field].status == MBM_MALFORMED_VALUE;
    return count;
}

void bridge_line_reach(bridge_line *l, const reach *what)
{
    l->where.reach = *what;
    line_reach(&l->at, what);
}

void bridge_line_clear(bridge_line *l)
{
    int i;

    for (i = 0; i < BRIDGE_WRITES; i++)
        if (l->writes[i].is_used)
            publish_result(l, l->writes[i].name, "the line was removed from the bridge");
    remove_retained(l, NULL);
    broker_unsubscribe(&l->bridge->mqtt, l->below);
}

void bridge_line_end(bridge_line *l)
{
    if (l->table) {
        (void)mbm_plan_end(&l->plan);
        line_close(&l->at);
    }
    bridge_table_free(l->table);
    free(l->text);
    free(l->path);
    free(l->topic);
    free(l);
}

void bridge_line_poll(bridge_line *l)
{
    (void)mbm_plan_pollSplitting(&l->plan, &l->table->splitting);
    line_poll(&l->at);
}

uint32_t bridge_line_delay(bridge_line *l)
{
    const uint32_t plan = mbm_plan_pollDelay(&l->plan), own = line_delay(&l->at);

    return plan < own ? plan : own;
}
