/* mbm poll: reads the fields of a device file again and again. */
#include "advice.h"
#include "clock.h"
#include "device.h"
#include "live.h"
#include "numbers.h"
#include "options.h"
#include "report.h"
#include "screen.h"
#include "trace.h"

#include <cjson/cJSON.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef struct polling {
    /* What the command line says. */
    place where;
    const char *file;
    uint32_t rounds, forMs;
    int value_width; /* columns of the table */
    int gap;         /* DEVICE_PLAN_OWN_GAP: that of the file */
    uint8_t shows_plan;

    polled read;
    live live;
    struct {
        uint8_t status, exception;
        uint16_t field;
        char why[160];
    } first_failure; /* which is reported at the end */
} polling;

/* --- the command line --- */

enum { WIDEST_VALUE = 48 };
enum { ROUNDS = 0x2000, FOR, ONCE, GAP, SHOW_PLAN, WATCH, HTTP };

/* Refuses a table where there can be none. */
static void check_watch(const struct argp_state *state)
{
    const char *wrong = screen_wrong();

    if (options.is_json)
        options_wrong(state, "--watch and --json exclude each other");
    if (wrong)
        options_wrong(state, "--watch: %s. Leave it out to print each round", wrong);
    if (trace_is_printed() && isatty(STDERR_FILENO))
        options_wrong(state, "--watch and --trace write to the same terminal. Send stderr to a "
                             "file: 2>trace.txt");
}

static error_t parse(int key, char *text, struct argp_state *state)
{
    polling *p = (polling *)state->input;

    switch (key) {
    case ROUNDS:
        p->rounds = (uint32_t)options_number(state, "--rounds", text, 1, 1000000000);
        return 0;
    case FOR: p->forMs = options_time(state, "--for", text, 1, 86400000); return 0;
    case ONCE: p->rounds = 1; return 0;
    case GAP: p->gap = (int)options_number(state, "--gap", text, 0, 2000); return 0;
    case SHOW_PLAN: p->shows_plan = 1; return 0;
    case WATCH: p->live.watches = 1; return 0;
    case HTTP:
        p->live.http_place = text;
        if (http_check(text, 1))
            options_wrong(state, "--http \"%s\" %s", text, http_check(text, 1));
        return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num > 1)
            options_too_many(state, text);
        if (state->arg_num == 0)
            options_place(state, &p->where, text, 0);
        else
            p->file = text;
        return 0;
    case ARGP_KEY_END:
        if (!p->file)
            options_wrong(state, "%s is missing", p->where.text ? "FILE" : "LINE");
        if (p->live.watches)
            check_watch(state);
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option texts[] = {
    {"rounds", ROUNDS, "N", 0, "End after N rounds", 1},
    {"once", ONCE, NULL, 0, "The same as --rounds 1", 1},
    {"for", FOR, "TIME", 0, "End after a time, such as 10s", 1},
    {"gap", GAP, "N", 0,
     "One request may read up to N addresses between two fields too, if the device has them (gap "
     "of FILE, or 0)",
     1},
    {"watch", WATCH, NULL, 0,
     "Show a table that stays in its place, with changes, minimum and maximum; q ends it", 3},
    {"http", HTTP, "[ADDRESS:]PORT", 0,
     "Show values, changes and a chart on a page at 127.0.0.1, or at another address of this "
     "machine",
     3},
    {"show-plan", SHOW_PLAN, NULL, 0, "First print the requests of the plan to stderr", 3},
    {0}};

static const struct argp_child children[] = {{.argp = &options_client}, {0}};

static const struct argp arguments = {
    .options = texts,
    .parser = parse,
    .args_doc = "LINE FILE",
    .doc =
        "Reads the fields of a device file, each at its interval, in the fewest requests. A round is "
        "the shortest interval; at its end the values are printed with their age and status.\v"
        "docs/device-file.md describes the device file.\n\n"
        "  mbm poll rtu:/dev/ttyUSB0 meter.yaml --rounds 10\n"
        "  mbm poll tcp://192.168.0.7 pump.yaml --watch --http 8080\n\n" PLACE_HELP,
    .children = children};

/* --- the plan --- */

/* Notes how a read of a field has ended. */
static void take_field(void *context, mbm_plan *of, uint16_t field)
{
    polling *p = (polling *)context;
    const uint8_t status = mbm_plan_getStatus(of, field, NULL);
    const char *why;

    if (live_is_wanted(&p->live))
        live_note(&p->live, field);
    line_note(&p->read.at, status);
    why = line_why(&p->read.at, status);
    if (status == MBM_OK || status == MBM_CANCELLED || report_stopped)
        return;
    if (p->first_failure.status == MBM_OK) {
        p->first_failure.status = status;
        p->first_failure.exception = polled_exception(status);
        p->first_failure.field = field;
        snprintf(p->first_failure.why, sizeof p->first_failure.why, "%s", why ? why : "");
    }
    (void)report_note(report_code_of(status, polled_exception(status)));
}

/* Returns CODE_DONE, or another exit code after reporting the reason. */
static int begin_plan(polling *p)
{
    /* Only on Modbus TCP several requests may be in flight. */
    const uint8_t requests = p->where.framing == MBM_FRAMING_TCP ? options.in_flight : 1;
    uint16_t wrong = UINT16_MAX;
    uint8_t status;

    if (p->read.meter.readable == 0)
        return report(CODE_WRONG, "%s has no field that can be read", p->file);
    if (!device_plan_make(&p->read.setup, &p->read.meter, p->gap, requests) ||
        !device_plan_split(&p->read.splitting, &p->read.setup))
        return report(CODE_SYSTEM, REPORT_NO_MEMORY);
    p->read.setup.update = take_field;
    p->read.setup.context = p;
    status = mbm_plan_begin(&p->read.plan, &p->read.at.client, &p->read.setup, &wrong);
    return status == MBM_OK ? CODE_DONE
                            : report(CODE_WRONG, "%s",
                                     device_plan_wrong(&p->read.meter, p->file, status, wrong));
}

static void show_plan(polling *p)
{
    mbm_planReadInfo read;
    char time[32];
    uint16_t i;

    for (i = 0; mbm_plan_getRead(&p->read.plan, i, &read) == MBM_OK; i++)
        fprintf(stderr, "request %u: unit %u, %s, %u from %s on, every %s\n", i + 1u, read.unit,
                value_table_names[read.table], read.quantity,
                device_address_text(&p->read.meter, read.table, read.address),
                number_time_text(read.intervalMs, time));
}

/* --- showing --- */

/* Prints a text in a column. */
static void print_column(const char *text, int width)
{
    const int taken = screen_width(text);

    printf("  %s%*s", text, width > taken ? width - taken : 0, "");
}

/* Makes the column of values as wide as the widest so far. A text that is longer than most takes
 * more columns in its own row. */
static void widen(polling *p)
{
    static char value[POLLED_VALUE_BYTES];
    uint16_t i;

    for (i = 0; i < p->read.meter.readable; i++) {
        int width;

        (void)polled_value(&p->read, i, value);
        width = screen_width(value);
        if (width > p->value_width && width <= WIDEST_VALUE)
            p->value_width = width;
    }
}

static void print_row(polling *p, uint16_t field, int name_width)
{
    static char value[POLLED_VALUE_BYTES];
    char status[256], age[32] = "";
    uint32_t ageMs;

    const uint8_t code = device_plan_status(&p->read.plan, &p->read.meter, field, &ageMs);

    (void)polled_value(&p->read, field, value);
    if (ageMs != UINT32_MAX)
        snprintf(age, sizeof age, "%ums", (unsigned)ageMs);
    print_column(p->read.meter.fields[field].name, name_width);
    print_column(value, p->value_width);
    print_column(age, 7);
    printf("  %s\n", polled_status(&p->read, code, status));
}

static void print_rows(polling *p, uint32_t round, const char *time)
{
    const int name_width = polled_name_width(&p->read);
    uint16_t i;

    if (isatty(STDOUT_FILENO))
        printf("\033[H\033[J");
    printf("round %u, %s: %u of %u fields read\n", (unsigned)round, time,
           polled_read_count(&p->read), p->read.meter.readable);
    widen(p);
    for (i = 0; i < p->read.meter.readable; i++)
        print_row(p, i, name_width);
}

static void print_json(polling *p, uint16_t field, uint32_t round, const char *time)
{
    cJSON *object = cJSON_CreateObject();

    cJSON_AddStringToObject(object, "time", time);
    cJSON_AddNumberToObject(object, "round", round);
    polled_add_json(&p->read, field, object);
    report_print_json(object);
}

static void show_round(polling *p, uint32_t round)
{
    char time[CLOCK_TEXT_BYTES];
    uint16_t i;

    (void)clock_now_text(time);
    if (live_is_wanted(&p->live))
        live_note_round(&p->live, round);
    else if (!options.is_json)
        print_rows(p, round, time);
    for (i = 0; options.is_json && i < p->read.meter.readable; i++)
        print_json(p, i, round, time);
    report_flush();
}

/* Whether a unit has answered a request, if only with an exception. */
static int answers_others(polling *p, uint16_t unit)
{
    uint16_t i;

    for (i = 0; i < p->read.meter.readable; i++) {
        const uint8_t status = mbm_plan_getStatus(&p->read.plan, i, NULL);

        if (p->read.meter.planned[i].unit == unit &&
            (status == MBM_OK || polled_exception(status) != 0))
            return 1;
    }
    return 0;
}

/* Finds the request of a field. Returns 0 if there is none. */
static int find_read(const polling *p, const mbm_planField *planned, mbm_planReadInfo *read)
{
    uint16_t i;

    for (i = 0; mbm_plan_getRead(&p->read.plan, i, read) == MBM_OK; i++)
        if (device_plan_covers(read, planned))
            return 1;
    return 0;
}

/* What to look at if a field has no reply: its request may be too long. */
static const char *advise_on_silence(polling *p, const mbm_planField *planned,
                                     const char *otherwise)
{
    mbm_planReadInfo read;
    int is_bits;

    if (!answers_others(p, planned->unit) || !find_read(p, planned, &read) || read.quantity <= 16)
        return otherwise;
    is_bits = device_is_of_bits(read.table);
    return say("It answers other requests. Some devices do not answer a read of more %s than they "
               "can send, here %u: try %s in the file",
               is_bits ? "bits" : "registers", read.quantity,
               is_bits ? "max_read_bits" : "max_read_registers");
}

/* What to look at if the device does not have the address of a field. */
static const char *advise_on_address(const polling *p, const mbm_planField *planned,
                                     const char *otherwise)
{
    const int is_on_wire = p->read.meter.notation == DEVICE_ON_WIRE;
    const char *advice =
        is_on_wire ? otherwise
                   : "Check table, address and type in the file against the device's manual";
    uint16_t address;
    const uint8_t table =
        is_on_wire ? advice_manual(planned->table, planned->address, &address) : 0;

    if (table != 0)
        return say("In a manual, %u is address %u: write \"table: %s\" and \"address: %u\", or "
                   "\"notation: modicon\" if the whole file has such addresses",
                   planned->address, address, value_table_names[table], address);
    return p->read.setup.registerGap | p->read.setup.bitGap
               ? say("%s. Try without %s", advice, p->gap > 0 ? "--gap" : "gap in the file")
               : advice;
}

/* Says how the first failure came about, and what to look at. An exception is about a field, other
 * failures are about its unit. */
static void report_first_failure(polling *p)
{
    const uint8_t status = p->first_failure.status, exception = p->first_failure.exception;
    const char *why = *p->first_failure.why ? p->first_failure.why : NULL;
    const mbm_planField *planned = &p->read.meter.planned[p->first_failure.field];
    const device_field *field = &p->read.meter.fields[p->first_failure.field];
    const char *advice = advice_on(&p->read.at.place, ADVICE_FILE, status, exception, why);
    char who[200];

    snprintf(who, sizeof who, "unit %u", planned->unit);
    if (exception != 0)
        snprintf(who, sizeof who, "unit %u, field %.100s in line %d of the file", planned->unit,
                 field->name, field->line);
    if (status == MBM_RESPONSE_TIMED_OUT && !why)
        advice = advise_on_silence(p, planned, advice);
    if (exception == MBM_ILLEGAL_DATA_ADDRESS)
        advice = advise_on_address(p, planned, advice);
    (void)report_failure(who, status, exception, reach_timeout(&p->read.at.place.reach), why,
                         advice);
}

/* Names the fields that the device refuses, if the failure of the first does not name them all. */
static void report_refused(polling *p)
{
    enum { NAMED = 20 };
    char names[NAMED * (DEVICE_NAME_BYTES + 2)] = "";
    unsigned refused = 0;
    size_t length = 0;
    uint16_t i;

    for (i = 0; i < p->read.meter.readable; i++)
        if (device_plan_is_refused(mbm_plan_getStatus(&p->read.plan, i, NULL)) &&
            ++refused <= NAMED)
            length += (size_t)snprintf(names + length, sizeof names - length, "%s%s",
                                       refused > 1 ? ", " : "", p->read.meter.fields[i].name);
    if (refused > 1)
        fprintf(stderr,
                "%s: the device refuses %u of %u fields: %s%s. The others are read without them.\n",
                report_name, refused, p->read.meter.readable, names,
                refused > NAMED ? " and others" : "");
}

/* Says how it went, and what to look at after the first failure. */
static void show_end(polling *p, uint32_t round)
{
    const mbm_counters *counters = &p->read.at.counters;

    if (p->first_failure.status != MBM_OK)
        report_first_failure(p);
    report_refused(p);
    if (!options.is_quiet)
        fprintf(stderr, "%s: rounds: %u, requests: %u, replies: %u, exceptions: %u.\n", report_name,
                (unsigned)round, (unsigned)counters->requests, (unsigned)counters->replies,
                (unsigned)counters->exceptions);
}

/* --- rounds --- */

static int is_every_field_read(polling *p)
{
    uint16_t i;

    for (i = 0; i < p->read.meter.readable; i++)
        if (mbm_plan_getStatus(&p->read.plan, i, NULL) == MBM_PENDING)
            return 0;
    return 1;
}

static uint32_t shortest_interval(polling *p)
{
    uint32_t shortest = MBM_PLAN_LONGEST_INTERVAL;
    uint16_t i;

    for (i = 0; i < p->read.meter.readable; i++)
        if (p->read.meter.planned[i].intervalMs < shortest)
            shortest = p->read.meter.planned[i].intervalMs;
    return shortest;
}

/* Sleeps until plan or client have something to do, at most `milliseconds`. */
static void rest(polling *p, uint32_t milliseconds)
{
    const uint32_t delay = mbm_plan_pollDelay(&p->read.plan) / 1000;

    if (delay < milliseconds)
        milliseconds = delay;
    if (live_is_wanted(&p->live))
        live_wait(&p->live, milliseconds);
    else
        line_rest(&p->read.at, milliseconds);
}

/* The first round ends when every field was read or failed, each other one an interval later. */
static void poll_rounds(polling *p)
{
    const uint32_t interval = shortest_interval(p), start = line_milliseconds();
    uint32_t round = 0, due = start;

    while (!report_stopped && !ferror(stdout) && !p->live.is_over &&
           (p->rounds == 0 || round < p->rounds)) {
        const uint32_t now = line_milliseconds();
        uint32_t left = 1000;

        if (p->forMs && now - start >= p->forMs)
            break;
        (void)mbm_plan_pollSplitting(&p->read.plan, &p->read.splitting);
        line_poll(&p->read.at);
        if (round == 0 ? is_every_field_read(p) : (int32_t)(now - due) >= 0) {
            show_round(p, ++round);
            due =
                round == 1 || (int32_t)(now - due - interval) > 0 ? now + interval : due + interval;
            continue;
        }
        if (round > 0 && due - now < left)
            left = due - now;
        if (p->forMs && p->forMs - (now - start) < left)
            left = p->forMs - (now - start);
        rest(p, left);
    }
    if (live_is_wanted(&p->live))
        live_end(&p->live);
    show_end(p, round);
}

int poll_command(int argc, char **argv)
{
    static polling data = {.gap = DEVICE_PLAN_OWN_GAP, .value_width = 16};
    polling *p = &data;
    char wrong[YAML_FILE_WRONG_BYTES];
    const char *why, *lost;
    int code;

    argp_parse(&arguments, argc, argv, 0, NULL, p);
    code = device_file_read(&p->read.meter, p->file, wrong);
    if (code != CODE_DONE)
        return report(code, "%s", wrong);
    why = line_add_reach(&p->where, &p->read.meter.reach, options.in_flight, &lost);
    if (why)
        return report(CODE_WRONG, "%s: %s", p->file, why);
    if (lost && !options.is_quiet)
        fprintf(stderr, "%s: %s: %s.\n", report_name, p->file, lost);
    why = device_plan_check(&p->read.meter, p->file, p->where.framing);
    if (why)
        return report(CODE_WRONG, "%s", why);
    code = line_open(&p->read.at, &p->where);
    if (code == CODE_DONE) {
        if (p->rounds == 1)
            code = line_connect(&p->read.at);
        if (code == CODE_DONE)
            code = begin_plan(p);
        if (code == CODE_DONE && p->shows_plan)
            show_plan(p);
        if (code == CODE_DONE && live_is_wanted(&p->live))
            code = live_begin(&p->live, &p->read, shortest_interval(p));
        if (code == CODE_DONE)
            poll_rounds(p);
        (void)mbm_plan_end(&p->read.plan);
        device_plan_free(&p->read.setup);
        free(p->read.splitting.blocks);
        line_close(&p->read.at);
    }
    device_free(&p->read.meter);
    return code != CODE_DONE ? code : report_code;
}
