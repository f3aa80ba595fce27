/* mbm poll: reads the fields of a device file again and again. Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "advice.h"
#include "commands.h"
#include "device_file.h"
#include "line.h"
#include "numbers.h"
#include "options.h"
#include "report.h"
#include "value_text.h"

#include <cjson/cJSON.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { MOST_WORDS = 65535, LONGEST_NAME = 40 };

static struct {
    const char *file;
    uint32_t rounds, forMs;
    uint16_t gap;
    uint8_t shows_plan;
} wanted;

static place where;
static line at;
static device meter;
static mbm_plan plan;
static mbm_planSetup setup;
static mbm_clientRequest requests[MBM_CLIENT_DEPTH];

/* The first failure, which is reported at the end. */
static struct {
    uint8_t status, exception;
    uint16_t field;
    char why[160];
} first_failure;

/* --- the command line --- */

enum { ROUNDS = 0x2000, FOR, ONCE, GAP, SHOW_PLAN };

static error_t parse(int key, char *text, struct argp_state *state)
{
    switch (key) {
    case ROUNDS:
        wanted.rounds = (uint32_t)options_number(state, "--rounds", text, 1, 1000000000);
        return 0;
    case FOR: wanted.forMs = options_time(state, "--for", text, 1, 86400000); return 0;
    case ONCE: wanted.rounds = 1; return 0;
    case GAP: wanted.gap = (uint16_t)options_number(state, "--gap", text, 0, 2000); return 0;
    case SHOW_PLAN: wanted.shows_plan = 1; return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num > 1)
            options_too_many(state, text);
        if (state->arg_num == 0)
            options_place(state, &where, text, 0);
        else
            wanted.file = text;
        return 0;
    case ARGP_KEY_END:
        if (!wanted.file)
            options_wrong(state, "%s is missing", where.text ? "FILE" : "LINE");
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option texts[] = {
    {"rounds", ROUNDS, "N", 0, "End after N rounds", 1},
    {"once", ONCE, NULL, 0, "The same as --rounds 1", 1},
    {"for", FOR, "TIME", 0, "End after a time, such as 10s", 1},
    {"gap", GAP, "N", 0,
     "One request may read up to N addresses between two fields too, if the device has them (0)",
     1},
    {"show-plan", SHOW_PLAN, NULL, 0, "First print the requests of the plan to stderr", 3},
    {NULL, 0, NULL, 0, NULL, 0}};

static const struct argp_child children[] = {{&options_client, 0, NULL, 0}, {NULL, 0, NULL, 0}};

static const struct argp arguments = {
    texts,
    parse,
    "LINE FILE",
    "Reads the fields of a device file, each at its interval, in the fewest requests. A round is "
    "the shortest interval; at its end the values are printed with their age and status.\v"
    "docs/serve.md describes the device file.\n\n"
    "  mbm poll rtu:/dev/ttyUSB0 meter.yaml --rounds 10\n\n" PLACE_HELP,
    children,
    NULL,
    NULL};

/* --- the plan --- */

static uint8_t exception_of(uint8_t status)
{
    return status < MBM_INVALID_SLAVE_ID ? status : 0;
}

/* Notes how a read of a field has ended. */
static void take_field(void *context, mbm_plan *of, uint16_t field)
{
    const uint8_t status = mbm_plan_getStatus(of, field, NULL);
    const char *why;

    line_note(&at, status);
    why = line_why(&at, status);
    (void)context;
    if (status == MBM_OK || status == MBM_CANCELLED || report_stopped)
        return;
    if (first_failure.status == MBM_OK) {
        first_failure.status = status;
        first_failure.exception = exception_of(status);
        first_failure.field = field;
        snprintf(first_failure.why, sizeof first_failure.why, "%s", why ? why : "");
    }
    (void)report_note(report_code_of(status, exception_of(status)));
}

/* How many words a plan may need, its gaps included. */
static uint16_t words_needed(void)
{
    uint32_t words = 0;
    uint16_t i;

    for (i = 0; i < meter.readable && words < MOST_WORDS; i++)
        words += device_size(&meter.planned[i]) + wanted.gap;
    return (uint16_t)(words < MOST_WORDS ? words : MOST_WORDS);
}

/* Returns CODE_DONE, or another exit code after reporting the reason. */
static int begin_plan(void)
{
    const uint16_t count = meter.readable;
    uint16_t wrong = 0xFFFF;
    uint8_t status;

    if (count == 0)
        return report(CODE_WRONG, "%s has no field that can be read", wanted.file);
    setup.fields = meter.planned;
    setup.positions = (mbm_planPosition *)calloc(count, sizeof *setup.positions);
    setup.reads = (mbm_planRead *)calloc(count, sizeof *setup.reads);
    setup.dataWords = words_needed();
    setup.data = (uint16_t *)calloc(setup.dataWords, sizeof *setup.data);
    if (!setup.positions || !setup.reads || !setup.data)
        return report(CODE_SYSTEM, "there is no memory for %u fields", count);
    setup.requests = requests;
    setup.update = take_field;
    setup.fieldCount = setup.readCount = count;
    setup.bitGap = wanted.gap;
    setup.registerGap = wanted.gap < MBM_MAX_READ_REGISTERS ? wanted.gap : MBM_MAX_READ_REGISTERS;
    /* Only on Modbus TCP several requests may be in flight. */
    setup.requestCount = where.framing == MBM_FRAMING_TCP ? options.in_flight : 1;
    status = mbm_plan_begin(&plan, &at.client, &setup, &wrong);
    if (status != MBM_OK && wrong < count)
        return report(CODE_WRONG, "%s:%d: %s", wanted.file, meter.fields[wrong].line,
                      mbm_status_text(status));
    return status == MBM_OK ? CODE_DONE
                            : report(CODE_WRONG, "%s: %s", wanted.file, mbm_status_text(status));
}

static void free_plan(void)
{
    (void)mbm_plan_end(&plan);
    free(setup.positions);
    free(setup.reads);
    free(setup.data);
}

static void show_plan(void)
{
    mbm_planReadInfo read;
    char time[32];
    uint16_t i;

    for (i = 0; mbm_plan_getRead(&plan, i, &read) == MBM_OK; i++)
        fprintf(stderr, "request %u: unit %u, %s, %u from %u on, every %s\n", i + 1u, read.unit,
                value_table_names[read.table], read.quantity, read.address,
                number_time_text(read.intervalMs, time));
}

/* --- showing --- */

/* The status of a field in words; of a lost link with the reason. */
static const char *print_status(uint8_t status, char text[256])
{
    const char *reason = status == MBM_LINK_LOST ? line_reason(&at) : NULL;

    snprintf(text, 256, "%s%s%s", report_words(status, exception_of(status)), reason ? ": " : "",
             reason ? reason : "");
    return text;
}

/* How wide a text is on a terminal: its characters, if it is UTF-8. */
static int width_of(const char *text)
{
    int width = 0;

    for (; *text; text++)
        width += ((unsigned char)*text & 0xC0) != 0x80;
    return width;
}

static int longest_name(void)
{
    int longest = 0;
    uint16_t i;

    for (i = 0; i < meter.readable; i++)
        if (width_of(meter.fields[i].name) > longest)
            longest = width_of(meter.fields[i].name);
    return longest < LONGEST_NAME ? longest : LONGEST_NAME;
}

/* Prints a text in a column. */
static void print_column(const char *text, int width)
{
    printf("  %s%*s", text, width > width_of(text) ? width - width_of(text) : 0, "");
}

/* Appends the names of an enumeration, as far as they fit: " (off)", of several values " (off,on)",
 * with "-" for a value without a name. Nothing if no value has one. */
static void add_names(uint16_t field, char *text, size_t capacity)
{
    const uint16_t count = value_count(&meter.planned[field]);
    size_t length = strlen(text);
    uint16_t i, named = 0;

    for (i = 0; i < count; i++)
        named = (uint16_t)(named + (value_name(&plan, &meter, field, i) != NULL));
    for (i = 0; named > 0 && i < count && length < capacity; i++) {
        const char *name = value_name(&plan, &meter, field, i);

        length += (size_t)snprintf(text + length, capacity - length, "%s%s%s", i == 0 ? " (" : ",",
                                   name ? name : "-", i + 1 == count ? ")" : "");
    }
}

static void print_row(uint16_t field, int name_width)
{
    static char value[VALUE_TEXT_LONGEST + 3 * DEVICE_NAME_BYTES];
    const char *measure = meter.fields[field].unit_of_measurement;
    char status[256], age[32] = "";
    uint32_t ageMs;

    const uint8_t code = mbm_plan_getStatus(&plan, field, &ageMs);

    if (!value_text(&plan, &meter, field, 0, value))
        strcpy(value, "-");
    else if (measure)
        snprintf(value + strlen(value), DEVICE_NAME_BYTES + 2, " %s", measure);
    add_names(field, value, sizeof value);
    if (ageMs != UINT32_MAX)
        snprintf(age, sizeof age, "%ums", (unsigned)ageMs);
    print_column(meter.fields[field].name, name_width);
    print_column(value, 16);
    print_column(age, 7);
    printf("  %s\n", print_status(code, status));
}

static void print_rows(uint32_t round, const char *time)
{
    const int name_width = longest_name();
    uint16_t i, right = 0;

    for (i = 0; i < meter.readable; i++)
        right = (uint16_t)(right + (mbm_plan_getStatus(&plan, i, NULL) == MBM_OK));
    if (isatty(STDOUT_FILENO))
        printf("\033[H\033[J");
    printf("round %u, %s: %u of %u fields read\n", (unsigned)round, time, right, meter.readable);
    for (i = 0; i < meter.readable; i++)
        print_row(i, name_width);
}

/* The names of an enumeration for JSON: a text or null, of several values an array of them. */
static cJSON *json_names(uint16_t field)
{
    const uint16_t count = value_count(&meter.planned[field]);
    cJSON *array = count > 1 ? cJSON_CreateArray() : NULL, *one = NULL;
    uint16_t i;

    for (i = 0; i < count; i++) {
        const char *name = value_name(&plan, &meter, field, i);

        one = name ? cJSON_CreateString(name) : cJSON_CreateNull();
        if (array)
            cJSON_AddItemToArray(array, one);
    }
    return array ? array : one;
}

static void print_json(uint16_t field, uint32_t round, const char *time)
{
    static char value[VALUE_TEXT_LONGEST];
    const device_field *of = &meter.fields[field];
    cJSON *object = cJSON_CreateObject();
    char status[256];
    uint32_t ageMs;

    const uint8_t code = mbm_plan_getStatus(&plan, field, &ageMs);

    cJSON_AddStringToObject(object, "time", time);
    cJSON_AddNumberToObject(object, "round", round);
    cJSON_AddNumberToObject(object, "unit", meter.planned[field].unit);
    cJSON_AddStringToObject(object, "name", of->name);
    if (value_text(&plan, &meter, field, 1, value))
        cJSON_AddRawToObject(object, "value", value);
    else
        cJSON_AddNullToObject(object, "value");
    if (of->label_count > 0)
        cJSON_AddItemToObject(object, "value_name", json_names(field));
    if (of->unit_of_measurement)
        cJSON_AddStringToObject(object, "unit_of_measurement", of->unit_of_measurement);
    if (ageMs != UINT32_MAX)
        cJSON_AddNumberToObject(object, "age_ms", ageMs);
    report_json(object, code, exception_of(code), print_status(code, status));
}

static void show_round(uint32_t round)
{
    struct timespec now;
    char time[40];
    uint16_t i;

    clock_gettime(CLOCK_REALTIME, &now);
    report_time(&now, time);
    if (!options.is_json)
        print_rows(round, time);
    for (i = 0; options.is_json && i < meter.readable; i++)
        print_json(i, round, time);
    report_flush();
}

/* Says how the first failure came about, and what to look at. An exception is about a field, other
 * failures are about its unit. */
static void report_first_failure(void)
{
    const uint8_t status = first_failure.status, exception = first_failure.exception;
    const char *why = *first_failure.why ? first_failure.why : NULL;
    const mbm_planField *planned = &meter.planned[first_failure.field];
    const device_field *field = &meter.fields[first_failure.field];
    const char *advice = advice_on(&at.place, ADVICE_FILE, status, exception, why);
    char who[200];
    uint16_t address;
    uint8_t table;

    snprintf(who, sizeof who, "unit %u", planned->unit);
    if (exception != 0)
        snprintf(who, sizeof who, "unit %u, field %.100s in line %d of the file", planned->unit,
                 field->name, field->line);
    table = advice_manual(planned->table, planned->address, &address);
    if (exception == MBM_ILLEGAL_DATA_ADDRESS && table != 0)
        advice = say("In a manual, %u is address %u: write \"table: %s\" and \"address: %u\"",
                     planned->address, address, value_table_names[table], address);
    else if (exception == MBM_ILLEGAL_DATA_ADDRESS && wanted.gap > 0)
        advice = say("%s. Try without --gap", advice);
    (void)report_failure(who, status, exception, options.timeoutMs, why, advice);
}

/* Says how it went, and what to look at after the first failure. */
static void show_end(uint32_t round)
{
    const mbm_counters *counters = &at.counters;

    if (first_failure.status != MBM_OK)
        report_first_failure();
    if (!options.is_quiet)
        fprintf(stderr, "%s: rounds: %u, requests: %u, replies: %u, exceptions: %u.\n", report_name,
                (unsigned)round, (unsigned)counters->requests, (unsigned)counters->replies,
                (unsigned)counters->exceptions);
}

/* --- rounds --- */

static int is_every_field_read(void)
{
    uint16_t i;

    for (i = 0; i < meter.readable; i++)
        if (mbm_plan_getStatus(&plan, i, NULL) == MBM_PENDING)
            return 0;
    return 1;
}

static uint32_t shortest_interval(void)
{
    uint32_t shortest = MBM_PLAN_LONGEST_INTERVAL;
    uint16_t i;

    for (i = 0; i < meter.readable; i++)
        if (meter.planned[i].intervalMs < shortest)
            shortest = meter.planned[i].intervalMs;
    return shortest;
}

/* Sleeps until plan or client have something to do, at most `milliseconds`. */
static void rest(uint32_t milliseconds)
{
    const uint32_t delay = mbm_plan_pollDelay(&plan) / 1000;

    line_rest(&at, delay < milliseconds ? delay : milliseconds);
}

/* The first round ends when every field was read or failed, each other one an interval later. */
static void poll_rounds(void)
{
    const uint32_t interval = shortest_interval(), start = line_milliseconds();
    uint32_t round = 0, due = start;

    while (!report_stopped && !ferror(stdout) && (wanted.rounds == 0 || round < wanted.rounds)) {
        const uint32_t now = line_milliseconds();
        uint32_t left = 1000;

        if (wanted.forMs && now - start >= wanted.forMs)
            break;
        (void)mbm_plan_poll(&plan);
        line_poll(&at);
        if (round == 0 ? is_every_field_read() : (int32_t)(now - due) >= 0) {
            show_round(++round);
            due =
                round == 1 || (int32_t)(now - due - interval) > 0 ? now + interval : due + interval;
            continue;
        }
        if (round > 0 && due - now < left)
            left = due - now;
        if (wanted.forMs && wanted.forMs - (now - start) < left)
            left = wanted.forMs - (now - start);
        rest(left);
    }
    show_end(round);
}

int poll_command(int argc, char **argv)
{
    char wrong[YAML_FILE_WRONG_BYTES];
    int code;

    argp_parse(&arguments, argc, argv, 0, NULL, NULL);
    code = device_file_read(&meter, wanted.file, wrong);
    if (code != CODE_DONE)
        return report(code, "%s", wrong);
    code = line_open(&at, &where);
    if (code == CODE_DONE) {
        if (wanted.rounds == 1)
            code = line_connect(&at);
        if (code == CODE_DONE)
            code = begin_plan();
        if (code == CODE_DONE && wanted.shows_plan)
            show_plan();
        if (code == CODE_DONE)
            poll_rounds();
        free_plan();
        line_close(&at);
    }
    device_free(&meter);
    return code != CODE_DONE ? code : report_code;
}
