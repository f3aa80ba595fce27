/* mbm read: reads values once, or again and again. */
#include "advice.h"
#include "clock.h"
#include "line.h"
#include "options.h"
#include "report.h"

#include <cjson/cJSON.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { ADDRESSES = 65536, PARTS = ADDRESSES / 124 + 1, BYTES_OF_BITS = MBM_MAX_READ_BITS / 8 };

/* A range of addresses, which one request reads. */
typedef struct part {
    mbm_clientRequest request;
    uint32_t first; /* index of its first word in `words` */
    uint16_t quantity;
} part;

/* What a unit had in the round before. */
typedef struct history {
    uint16_t words[ADDRESSES];
    uint8_t has_part[PARTS];
} history;

typedef struct reading {
    line at;
    place where;
    const char *address_text, *count_text;
    uint32_t intervalMs, rounds;
    int is_csv;
    const char *not_available;

    /* The units, which are read one after another; `turn` is the index of the one at work. */
    uint8_t units[OPTIONS_UNITS];
    unsigned unit_count, turn;
    history *before; /* of each unit */

    uint16_t address, each; /* `each`: registers or bits of a value */
    uint16_t characters;    /* of a text */
    uint32_t count, total;  /* values; registers or bits */
    part parts[PARTS];
    unsigned part_count;
    uint16_t words[ADDRESSES];
    uint8_t bits[(ADDRESSES / MBM_MAX_READ_BITS + 1) * BYTES_OF_BITS];
} reading;

/* --- the command line --- */

enum { EVERY = 1, TIMES, CSV, PRECISION, NOT_AVAILABLE };

/* Reads a list such as 0x8000,0xFFFF or "standard". */
static void read_not_available(const reading *r, const struct argp_state *state)
{
    static uint16_t numbers[CONVERSION_NUMBERS][VALUE_WORDS];
    conversion *of = &options.conversion;
    const char *text = r->not_available, *wrong;
    char one[VALUE_LONGEST + 1];

    if (options.form.type == MBM_TYPE_BIT)
        options_wrong(state, "--not-available needs a number or a text, not a bit");
    of->numbers = numbers;
    options.form.conversion = of;
    for (;;) {
        const size_t length = strcspn(text, ",");

        if (length > VALUE_LONGEST || of->number_count == CONVERSION_NUMBERS)
            options_wrong(state, "--not-available \"%s\" is too long", r->not_available);
        memcpy(one, text, length);
        one[length] = '\0';
        wrong = NULL;
        if (strcmp(one, "standard") == 0)
            of->is_standard = 1;
        else
            wrong = value_is_text(options.form.type)
                        ? "is not \"standard\", which is all that a text has"
                        : conversion_add(of, &options.form, one);
        if (wrong)
            options_wrong(state, "--not-available: \"%s\" %s", one, wrong);
        if (text[length] == '\0')
            return;
        text += length + 1;
    }
}

static void check_arguments(reading *r, const struct argp_state *state)
{
    const int is_text = value_is_text(options.form.type);
    const int is_bits = options.form.type == MBM_TYPE_BIT;
    uint16_t most;

    if (!r->address_text)
        options_wrong(state, "%s is missing", r->where.text ? "ADDRESS" : "LINE");
    r->address = options_address(state, r->address_text);
    if (r->count_text)
        r->count = (uint32_t)options_number(state, "COUNT", r->count_text, 1,
                                            is_text ? VALUE_LONGEST_TEXT : ADDRESSES);
    if (r->rounds > 0 && r->intervalMs == 0)
        options_wrong(state, "--times needs --every");
    if (r->is_csv && options.is_json)
        options_wrong(state, "--csv and --json exclude each other");
    if (options.conversion.has_precision && (is_text || is_bits || options.form.is_hex))
        options_wrong(state, "--precision needs a number, not a bit, a text or --hex");
    if (r->not_available)
        read_not_available(r, state);
    r->each = value_registers(options.form.type, is_text ? (uint16_t)r->count : 1);
    r->total = is_text ? r->each : r->count * r->each;
    if (r->address + r->total > ADDRESSES)
        options_wrong(state, "%u addresses from %u on end beyond the last address, 65535",
                      (unsigned)r->total, r->address);
    if (is_text) {
        r->characters = (uint16_t)r->count;
        r->count = 1;
    }
    most = is_bits ? MBM_MAX_READ_BITS : (uint16_t)(MBM_MAX_READ_REGISTERS / r->each * r->each);
    for (; r->part_count * (uint32_t)most < r->total; r->part_count++) {
        r->parts[r->part_count].first = r->part_count * (uint32_t)most;
        r->parts[r->part_count].quantity =
            (uint16_t)(r->total - r->parts[r->part_count].first < most
                           ? r->total - r->parts[r->part_count].first
                           : most);
    }
}

static error_t parse(int key, char *text, struct argp_state *state)
{
    reading *r = (reading *)state->input;

    switch (key) {
    case 'u': r->unit_count = options_units(state, "--unit", text, r->units); return 0;
    case EVERY: r->intervalMs = options_time(state, "--every", text, 1, 86400000); return 0;
    case TIMES:
        r->rounds = (uint32_t)options_number(state, "--times", text, 1, 1000000000);
        return 0;
    case CSV: r->is_csv = 1; return 0;
    case PRECISION:
        options.conversion.precision =
            (uint8_t)options_number(state, "--precision", text, 0, CONVERSION_PLACES);
        options.conversion.has_precision = 1;
        options.form.conversion = &options.conversion;
        return 0;
    case NOT_AVAILABLE: r->not_available = text; return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num == 0)
            options_place(state, &r->where, text, 0);
        else if (state->arg_num == 1)
            r->address_text = text;
        else if (state->arg_num == 2)
            r->count_text = text;
        else
            options_too_many(state, text);
        return 0;
    case ARGP_KEY_SUCCESS:
        check_arguments(r, state);
        options_check_units(state, &r->where, r->units);
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option texts[] = {
    {"unit", 'u', "LIST", 0,
     "The unit ids to read, 1 to 255, on Modbus TCP also 0, such as 17 or 1,17,30-39 (1)", 1},
    {"every", EVERY, "TIME", 0, "Read again and again, such as every 500ms or 2s, until Ctrl-C", 0},
    {"times", TIMES, "N", 0, "With --every: so many times", 0},
    {"precision", PRECISION, "N", 0, "Show N digits after the point, 0 to 18", 1},
    {"not-available", NOT_AVAILABLE, "LIST", 0,
     "Numbers of the registers that mean \"not available\", such as 0x8000,0xFFFF, or standard: those "
     "of SunSpec",
     1},
    {"csv", CSV, NULL, 0, "Print CSV, one line a round", 3},
    {0}};

static const struct argp_child children[] = {
    {.argp = &options_values}, {.argp = &options_client}, {0}};

static const struct argp arguments = {
    .options = texts,
    .parser = parse,
    .args_doc = "LINE ADDRESS [COUNT]",
    .doc =
        "Reads COUNT values (1) from ADDRESS on, 0 to 65535. Of a text COUNT is the number of its "
        "characters.\v"
        "Example: two floats of unit 17, every second\n\n"
        "  mbm read rtu:/dev/ttyUSB0 --unit 17 --type float --every 1s 100 2\n\n" PLACE_HELP,
    .children = children};

/* --- reading --- */

static void queue(reading *r, part *p)
{
    const int is_bits = options.form.type == MBM_TYPE_BIT;

    memset(&p->request, 0, sizeof p->request);
    p->request.unit = options.unit;
    p->request.reply = is_bits ? (void *)(r->bits + p->first / 8) : (void *)(r->words + p->first);
    p->request.replyBytes =
        (uint16_t)(is_bits ? BYTES_OF_BITS : p->quantity * (unsigned)sizeof r->words[0]);
    (void)line_read(&r->at, &p->request, options.table, (uint16_t)(r->address + p->first),
                    p->quantity);
}

/* Takes a request that has ended. Returns 0 if others would fail in the same way. */
static int take(reading *r, part *p)
{
    const int code = report_code_of(p->request.status, p->request.exception);
    uint32_t i;

    (void)report_note(code);
    if (code == CODE_DONE && options.form.type == MBM_TYPE_BIT)
        for (i = p->first; i < p->first + p->quantity; i++)
            r->words[i] = r->bits[i / 8] >> i % 8 & 1;
    return code != CODE_LINE && code != CODE_NO_REPLY;
}

/* Ends the parts from `ended` on with one status; those before `queued` are pending or ended. */
static void end_others(reading *r, unsigned ended, unsigned queued, uint8_t status)
{
    for (; ended < r->part_count; ended++) {
        if (ended < queued)
            (void)mbm_client_cancel(&r->at.client, &r->parts[ended].request);
        r->parts[ended].request.unit = options.unit;
        r->parts[ended].request.status = status;
        r->parts[ended].request.exception = 0;
    }
}

/* Reads all parts. If a part failed in a way that all others would, they get its status. Returns 0
 * after Ctrl-C; then the parts that were not read have the status MBM_CANCELLED. */
static int read_parts(reading *r)
{
    unsigned queued = 0, ended = 0;

    for (;;) {
        while (queued < r->part_count && queued - ended < MBM_CLIENT_DEPTH)
            queue(r, &r->parts[queued++]);
        line_poll(&r->at);
        for (; ended < queued && r->parts[ended].request.status != MBM_PENDING; ended++) {
            if (take(r, &r->parts[ended]))
                continue;
            end_others(r, ended + 1, queued, r->parts[ended].request.status);
            return 1;
        }
        if (ended == r->part_count)
            return 1;
        if (report_stopped) {
            end_others(r, ended, queued, MBM_CANCELLED);
            return 0;
        }
        line_rest(&r->at, 1000);
    }
}

/* The part that read a value. */
static part *part_of(reading *r, uint32_t value)
{
    return &r->parts[value * r->each / r->parts[0].quantity];
}

static int is_read(reading *r, uint32_t value)
{
    return part_of(r, value)->request.status == MBM_OK;
}

/* The first part that failed, or NULL. */
static part *first_failed(reading *r)
{
    unsigned i;

    for (i = 0; i < r->part_count; i++)
        if (r->parts[i].request.status != MBM_OK)
            return &r->parts[i];
    return NULL;
}

/* --- showing --- */

/* Returns MBM_OK; MBM_NOT_AVAILABLE or MBM_MALFORMED_VALUE with null in JSON, and else an empty
 * text. */
static uint8_t print_value(reading *r, uint32_t value, int is_json, char text[VALUE_TEXT_BYTES])
{
    const uint16_t first = (uint16_t)(r->address + value * r->each);
    mbm_registers registers;

    (void)mbm_registers_ofWords(&registers, r->words + value * r->each, r->each, first);
    return conversion_print(&options.form, &registers, first, r->characters, is_json, text);
}

/* Returns a status of print_value in words. Registers without a value of the type are a failure. */
static const char *value_status(uint8_t status)
{
    if (status == MBM_MALFORMED_VALUE)
        (void)report_note(report_code_of(status, 0));
    return mbm_status_text(status);
}

/* The status of all parts, in words. It is that of the first that failed; that of the first value
 * if all were read, and have no value. Returns `status`. */
static const char *status_of_all(reading *r, char status[256])
{
    const part *failed = first_failed(r);
    char text[VALUE_TEXT_BYTES];
    uint32_t value;

    for (value = 0; !failed && value < r->count; value++)
        if (print_value(r, value, 0, text) == MBM_OK)
            break;
    if (!failed && value == r->count)
        return value_status(print_value(r, 0, 0, text));
    return line_status(&r->at, failed ? &failed->request : &r->parts[0].request, status);
}

static unsigned shown_address(reading *r, uint32_t offset)
{
    return r->address + (unsigned)offset + options.is_one_based;
}

/* Prints a row for each value; if it is one table of several, also for a part that failed. */
static void print_rows(reading *r, int is_table)
{
    const history *old = &r->before[r->turn];
    char text[VALUE_TEXT_BYTES], status[256];
    uint32_t value;

    for (value = 0; value < r->count; value++) {
        const part *p = part_of(r, value);
        const uint32_t first = value * r->each;
        int is_changed;
        uint8_t held;

        if (!is_read(r, value)) {
            if (is_table && p->first == first)
                printf("  %5u  %s\n", shown_address(r, first),
                       line_status(&r->at, &p->request, status));
            continue;
        }
        is_changed = old->has_part[p - r->parts] && memcmp(r->words + first, old->words + first,
                                                           r->each * sizeof r->words[0]) != 0;
        held = print_value(r, value, 0, text);
        if (held != MBM_OK)
            snprintf(text, sizeof text, "%s", value_status(held));
        printf("%s%5u  %s\n",
               !is_table    ? ""
               : is_changed ? "* "
                            : "  ",
               shown_address(r, first), text);
    }
}

/* Prints a table of one unit, in a round or, if that is 0, in the only one. */
static void print_table(reading *r, uint32_t round)
{
    uint32_t value, right = 0;
    char which[32] = "";

    for (value = 0; value < r->count; value++)
        right += (uint32_t)is_read(r, value);
    if (round > 0)
        snprintf(which, sizeof which, ", round %u", (unsigned)round);
    if (round > 0 && r->turn == 0 && isatty(STDOUT_FILENO))
        printf("\033[H\033[J");
    printf("unit %u, %s%s: %u of %u values read\n", options.unit, value_table_names[options.table],
           which, (unsigned)right, (unsigned)r->count);
    print_rows(r, 1);
}

static void print_cell(const char *text)
{
    const char *c;

    putchar(',');
    if (!strpbrk(text, ",\"\n")) {
        fputs(text, stdout);
        return;
    }
    putchar('"');
    for (c = text; *c; c++)
        printf("%s%c", *c == '"' ? "\"" : "", *c);
    putchar('"');
}

static void print_csv_head(reading *r)
{
    uint32_t value;

    printf("time,unit,status");
    for (value = 0; value < r->count; value++)
        printf(",%u", shown_address(r, value * r->each));
    putchar('\n');
}

static void print_csv(reading *r, const char *time)
{
    char text[VALUE_TEXT_BYTES], status[256];
    uint32_t value;

    printf("%s,%u", time, options.unit);
    print_cell(status_of_all(r, status));
    for (value = 0; value < r->count; value++) {
        *text = '\0';
        if (is_read(r, value))
            (void)value_status(print_value(r, value, 0, text));
        print_cell(text);
    }
    putchar('\n');
}

static void print_json(reading *r, const char *time)
{
    char text[VALUE_TEXT_BYTES], status[256];
    const part *failed = first_failed(r);
    cJSON *all = cJSON_CreateObject(), *values;
    uint32_t value;

    cJSON_AddStringToObject(all, "time", time);
    cJSON_AddNumberToObject(all, "unit", options.unit);
    cJSON_AddStringToObject(all, "table", value_table_names[options.table]);
    cJSON_AddStringToObject(all, "type", value_type_name(options.form.type));
    cJSON_AddNumberToObject(
        all, "code",
        failed ? report_code_of(failed->request.status, failed->request.exception) : 0);
    cJSON_AddStringToObject(all, "status", status_of_all(r, status));
    values = cJSON_AddArrayToObject(all, "values");
    for (value = 0; value < r->count; value++) {
        const part *p = part_of(r, value);
        cJSON *one;

        if (!is_read(r, value) && p->first != value * r->each)
            continue;
        one = cJSON_CreateObject();
        cJSON_AddItemToArray(values, one);
        cJSON_AddNumberToObject(one, "address", shown_address(r, value * r->each));
        if (is_read(r, value)) {
            const uint8_t code = print_value(r, value, 1, text);

            cJSON_AddRawToObject(one, "value", text);
            if (code != MBM_OK)
                cJSON_AddStringToObject(one, "status", value_status(code));
        } else {
            cJSON_AddNumberToObject(one, "count", (double)p->quantity / r->each);
            cJSON_AddStringToObject(one, "status", line_status(&r->at, &p->request, status));
        }
    }
    report_print_json(all);
}

static void show(reading *r, uint32_t round)
{
    history *old = &r->before[r->turn];
    char time[CLOCK_TEXT_BYTES];
    unsigned i;

    (void)clock_now_text(time);
    if (options.is_json)
        print_json(r, time);
    else if (r->is_csv)
        print_csv(r, time);
    else if (r->intervalMs > 0 || r->unit_count > 1)
        print_table(r, round);
    else
        print_rows(r, 0);
    for (i = 0; i < r->part_count; i++) {
        if (r->parts[i].request.status != MBM_OK)
            continue;
        memcpy(old->words + r->parts[i].first, r->words + r->parts[i].first,
               r->parts[i].quantity * sizeof r->words[0]);
        old->has_part[i] = 1;
    }
    report_flush();
}

/* Says on stderr why parts of the only round failed: once for parts in a row with one reason, and
 * with their addresses if not all parts failed for it. */
static void report_parts(reading *r)
{
    unsigned i, next;
    char who[64];

    for (i = 0; i < r->part_count; i = next) {
        const mbm_clientRequest *failed = &r->parts[i].request;

        for (next = i + 1; next < r->part_count && r->parts[next].request.status == failed->status;
             next++)
            ;
        if (failed->status == MBM_OK)
            continue;
        snprintf(who, sizeof who, "unit %u", failed->unit);
        if (next - i < r->part_count)
            snprintf(who, sizeof who, "unit %u, addresses %u to %u", failed->unit,
                     shown_address(r, r->parts[i].first),
                     shown_address(r, r->parts[next - 1].first + r->parts[next - 1].quantity - 1));
        (void)line_failure_of(&r->at, who, failed, ADVICE_READ);
    }
}

/* Reads the units in a round, or in the only one, which is 0. Returns 0 after Ctrl-C; `right` is
 * then meaningless. */
static int read_units(reading *r, uint32_t round, int *right)
{
    for (*right = 1, r->turn = 0; r->turn < r->unit_count; r->turn++) {
        int is_read;

        options.unit = r->units[r->turn];
        is_read = read_parts(r);
        if (!is_read && round > 0)
            return 0;
        *right &= first_failed(r) == NULL;
        show(r, round);
        if (round == 0)
            report_parts(r);
        if (!is_read)
            return 0;
    }
    return 1;
}

static void read_rounds(reading *r)
{
    int right;
    uint32_t round = 0, failed = 0, due = line_milliseconds();

    while (!report_stopped && !ferror(stdout) && (r->rounds == 0 || round < r->rounds)) {
        if (!read_units(r, round + 1, &right))
            break;
        round++;
        failed += !right;
        /* If a round took longer than the interval, the next one follows at once. */
        due += r->intervalMs;
        if ((int32_t)(due - line_milliseconds()) < 0)
            due = line_milliseconds();
        while (!report_stopped && !ferror(stdout) && round != r->rounds &&
               (int32_t)(due - line_milliseconds()) > 0) {
            line_poll(&r->at);
            line_rest(&r->at, due - line_milliseconds());
        }
    }
    if (!options.is_quiet)
        fprintf(stderr, "%s: %u round%s, %u of them with failures.\n", report_name, (unsigned)round,
                round == 1 ? "" : "s", (unsigned)failed);
}

int read_command(int argc, char **argv)
{
    static reading data;
    reading *r = &data;
    int right;

    r->units[0] = 1;
    r->unit_count = r->count = 1;
    argp_parse(&arguments, argc, argv, 0, NULL, r);
    advice_keep(argc, argv, r->address_text);
    r->before = (history *)calloc(r->unit_count, sizeof *r->before);
    if (!r->before)
        return report(CODE_SYSTEM, REPORT_NO_MEMORY);
    if (line_open(&r->at, &r->where) != CODE_DONE)
        return report_code;
    if (r->intervalMs == 0 && line_connect(&r->at) != CODE_DONE) {
        line_close(&r->at);
        return report_code;
    }
    if (r->is_csv)
        print_csv_head(r);
    if (r->intervalMs > 0) {
        read_rounds(r);
    } else {
        (void)read_units(r, 0, &right);
    }
    line_close(&r->at);
    return report_code;
}
