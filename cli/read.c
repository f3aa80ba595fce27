/* mbm read: reads values once, or again and again. Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "advice.h"
#include "commands.h"
#include "line.h"
#include "options.h"
#include "report.h"

#include <cjson/cJSON.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
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

static line at;
static place where;
static const char *address_text, *count_text;
static uint32_t interval, rounds;
static int is_csv;

/* The units, which are read one after another; `turn` is the index of the one at work. */
static uint8_t units[OPTIONS_UNITS] = {1};
static unsigned unit_count = 1, turn;
static history *before; /* of each unit */

static uint16_t address;
static uint32_t count = 1, total; /* values; registers or bits */
static uint16_t each;             /* registers or bits of a value */
static part parts[PARTS];
static unsigned part_count;
static uint16_t words[ADDRESSES];
static uint8_t bits[(ADDRESSES / MBM_MAX_READ_BITS + 1) * BYTES_OF_BITS];

/* --- the command line --- */

enum { EVERY = 1, TIMES, CSV };

static void check_arguments(const struct argp_state *state)
{
    const int is_text = options.form.type == MBM_TYPE_TEXT;
    const int is_bits = options.form.type == MBM_TYPE_BIT;
    uint16_t most;

    if (!address_text)
        options_wrong(state, "%s is missing", where.text ? "ADDRESS" : "LINE");
    address = options_address(state, address_text);
    if (count_text)
        count = (uint32_t)options_number(state, "COUNT", count_text, 1,
                                         is_text ? VALUE_LONGEST_TEXT : ADDRESSES);
    if (rounds > 0 && interval == 0)
        options_wrong(state, "--times needs --every");
    if (is_csv && options.is_json)
        options_wrong(state, "--csv and --json exclude each other");
    each = value_registers(options.form.type, is_text ? (uint16_t)count : 1);
    total = is_text ? each : count * each;
    if (address + total > ADDRESSES)
        options_wrong(state, "%u addresses from %u on end beyond the last address, 65535",
                      (unsigned)total, address);
    if (is_text)
        count = 1;
    most = is_bits ? MBM_MAX_READ_BITS : (uint16_t)(MBM_MAX_READ_REGISTERS / each * each);
    for (; part_count * (uint32_t)most < total; part_count++) {
        parts[part_count].first = part_count * (uint32_t)most;
        parts[part_count].quantity =
            (uint16_t)(total - parts[part_count].first < most ? total - parts[part_count].first
                                                              : most);
    }
}

static error_t parse(int key, char *text, struct argp_state *state)
{
    switch (key) {
    case 'u': unit_count = options_units(state, "--unit", text, units); return 0;
    case EVERY: interval = options_time(state, "--every", text, 1, 86400000); return 0;
    case TIMES: rounds = (uint32_t)options_number(state, "--times", text, 1, 1000000000); return 0;
    case CSV: is_csv = 1; return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num == 0)
            options_place(state, &where, text, 0);
        else if (state->arg_num == 1)
            address_text = text;
        else if (state->arg_num == 2)
            count_text = text;
        else
            options_too_many(state, text);
        return 0;
    case ARGP_KEY_SUCCESS: check_arguments(state); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option texts[] = {
    {"unit", 'u', "LIST", 0, "The unit ids to read, 1 to 255, such as 17 or 1,17,30-39 (1)", 1},
    {"every", EVERY, "TIME", 0, "Read again and again, such as every 500ms or 2s, until Ctrl-C", 0},
    {"times", TIMES, "N", 0, "With --every: so many times", 0},
    {"csv", CSV, NULL, 0, "Print CSV, one line a round", 3},
    {NULL, 0, NULL, 0, NULL, 0}};

static const struct argp_child children[] = {
    {&options_values, 0, NULL, 0}, {&options_client, 0, NULL, 0}, {NULL, 0, NULL, 0}};

static const struct argp arguments = {
    texts,
    parse,
    "LINE ADDRESS [COUNT]",
    "Reads COUNT values (1) from ADDRESS on, 0 to 65535. Of a text COUNT is the number of its "
    "characters.\v"
    "Example: two floats of unit 17, every second\n\n"
    "  mbm read rtu:/dev/ttyUSB0 --unit 17 --type float --every 1s 100 2\n\n" PLACE_HELP,
    children,
    NULL,
    NULL};

/* --- reading --- */

static void queue(part *p)
{
    const int is_bits = options.form.type == MBM_TYPE_BIT;

    memset(&p->request, 0, sizeof p->request);
    p->request.unit = options.unit;
    p->request.reply = is_bits ? (void *)(bits + p->first / 8) : (void *)(words + p->first);
    p->request.replyBytes =
        (uint16_t)(is_bits ? BYTES_OF_BITS : p->quantity * (unsigned)sizeof words[0]);
    (void)line_read(&at, &p->request, options.table, (uint16_t)(address + p->first), p->quantity);
}

/* Takes a request that has ended. Returns 0 if others would fail in the same way. */
static int take(part *p)
{
    const int code = report_code_of(p->request.status, p->request.exception);
    uint32_t i;

    (void)report_note(code);
    if (code == CODE_DONE && options.form.type == MBM_TYPE_BIT)
        for (i = p->first; i < p->first + p->quantity; i++)
            words[i] = bits[i / 8] >> i % 8 & 1;
    return code != CODE_LINE && code != CODE_NO_REPLY;
}

/* Ends the parts from `ended` on, of which `queued` are pending or ended, with one status. */
static void end_others(unsigned ended, unsigned queued, uint8_t status)
{
    for (; ended < part_count; ended++) {
        if (ended < queued)
            (void)mbm_client_cancel(&at.client, &parts[ended].request);
        parts[ended].request.unit = options.unit;
        parts[ended].request.status = status;
        parts[ended].request.exception = 0;
    }
}

/* Reads all parts. The parts after one that failed as all others would get its status. Returns 0
 * after Ctrl-C; then the parts that were not read have the status MBM_CANCELLED. */
static int read_parts(void)
{
    unsigned queued = 0, ended = 0;

    for (;;) {
        while (queued < part_count && queued - ended < MBM_CLIENT_DEPTH)
            queue(&parts[queued++]);
        line_poll(&at);
        for (; ended < queued && parts[ended].request.status != MBM_PENDING; ended++) {
            if (take(&parts[ended]))
                continue;
            end_others(ended + 1, queued, parts[ended].request.status);
            return 1;
        }
        if (ended == part_count)
            return 1;
        if (report_stopped) {
            end_others(ended, queued, MBM_CANCELLED);
            return 0;
        }
        line_rest(&at, 1000);
    }
}

/* The part that read a value. */
static part *part_of(uint32_t value)
{
    return &parts[value * each / parts[0].quantity];
}

static int is_read(uint32_t value)
{
    return part_of(value)->request.status == MBM_OK;
}

/* The first part that failed, or NULL. */
static part *first_failed(void)
{
    unsigned i;

    for (i = 0; i < part_count; i++)
        if (parts[i].request.status != MBM_OK)
            return &parts[i];
    return NULL;
}

/* --- showing --- */

static void print_value(uint32_t value, int is_json, char text[VALUE_TEXT_BYTES])
{
    const uint16_t first = (uint16_t)(address + value * each);
    mbm_registers registers;

    (void)mbm_registers_ofWords(&registers, words + value * each, each, first);
    value_print(&options.form, &registers, first, (uint16_t)(each * 2), is_json, text);
}

static unsigned shown_address(uint32_t offset)
{
    return address + (unsigned)offset + options.is_one_based;
}

/* Prints a row for each value; if it is one table of several, also for a part that failed. */
static void print_rows(int is_table)
{
    const history *old = &before[turn];
    char text[VALUE_TEXT_BYTES], status[256];
    uint32_t value;

    for (value = 0; value < count; value++) {
        const part *p = part_of(value);
        const uint32_t first = value * each;
        int is_changed;

        if (!is_read(value)) {
            if (is_table && p->first == first)
                printf("  %5u  %s\n", shown_address(first), line_status(&at, &p->request, status));
            continue;
        }
        is_changed = old->has_part[p - parts] &&
                     memcmp(words + first, old->words + first, each * sizeof words[0]) != 0;
        print_value(value, 0, text);
        printf("%s%5u  %s\n",
               !is_table    ? ""
               : is_changed ? "* "
                            : "  ",
               shown_address(first), text);
    }
}

/* Prints a table of one unit, in a round or, if that is 0, in the only one. */
static void print_table(uint32_t round)
{
    uint32_t value, right = 0;
    char which[32] = "";

    for (value = 0; value < count; value++)
        right += (uint32_t)is_read(value);
    if (round > 0)
        snprintf(which, sizeof which, ", round %u", (unsigned)round);
    if (round > 0 && turn == 0 && isatty(STDOUT_FILENO))
        printf("\033[H\033[J");
    printf("unit %u, %s%s: %u of %u values read\n", options.unit, value_table_names[options.table],
           which, (unsigned)right, (unsigned)count);
    print_rows(1);
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

static void print_csv_head(void)
{
    uint32_t value;

    printf("time,unit,status");
    for (value = 0; value < count; value++)
        printf(",%u", shown_address(value * each));
    putchar('\n');
}

static void print_csv(const char *time)
{
    char text[VALUE_TEXT_BYTES], status[256];
    const part *failed = first_failed();
    uint32_t value;

    printf("%s,%u", time, options.unit);
    print_cell(line_status(&at, failed ? &failed->request : &parts[0].request, status));
    for (value = 0; value < count; value++) {
        *text = '\0';
        if (is_read(value))
            print_value(value, 0, text);
        print_cell(text);
    }
    putchar('\n');
}

static void print_json(const char *time)
{
    char text[VALUE_TEXT_BYTES], status[256];
    const part *failed = first_failed();
    cJSON *all = cJSON_CreateObject(), *values;
    uint32_t value;

    cJSON_AddStringToObject(all, "time", time);
    cJSON_AddNumberToObject(all, "unit", options.unit);
    cJSON_AddStringToObject(all, "table", value_table_names[options.table]);
    cJSON_AddStringToObject(all, "type", value_type_names[options.form.type]);
    cJSON_AddNumberToObject(
        all, "code",
        failed ? report_code_of(failed->request.status, failed->request.exception) : 0);
    cJSON_AddStringToObject(
        all, "status", line_status(&at, failed ? &failed->request : &parts[0].request, status));
    values = cJSON_AddArrayToObject(all, "values");
    for (value = 0; value < count; value++) {
        const part *p = part_of(value);
        cJSON *one;

        if (!is_read(value) && p->first != value * each)
            continue;
        one = cJSON_CreateObject();
        cJSON_AddItemToArray(values, one);
        cJSON_AddNumberToObject(one, "address", shown_address(value * each));
        if (is_read(value)) {
            print_value(value, 1, text);
            cJSON_AddRawToObject(one, "value", text);
        } else {
            cJSON_AddNumberToObject(one, "count", (double)p->quantity / each);
            cJSON_AddStringToObject(one, "status", line_status(&at, &p->request, status));
        }
    }
    report_print_json(all);
}

static void show(uint32_t round)
{
    history *old = &before[turn];
    struct timespec now;
    char time[40];
    unsigned i;

    clock_gettime(CLOCK_REALTIME, &now);
    report_time(&now, time);
    if (options.is_json)
        print_json(time);
    else if (is_csv)
        print_csv(time);
    else if (interval > 0 || unit_count > 1)
        print_table(round);
    else
        print_rows(0);
    for (i = 0; i < part_count; i++) {
        if (parts[i].request.status != MBM_OK)
            continue;
        memcpy(old->words + parts[i].first, words + parts[i].first,
               parts[i].quantity * sizeof words[0]);
        old->has_part[i] = 1;
    }
    report_flush();
}

/* Says on stderr why parts of the only round failed: once for parts in a row with one reason, and
 * with their addresses if not all parts failed for it. */
static void report_parts(void)
{
    unsigned i, next;
    char who[64];

    for (i = 0; i < part_count; i = next) {
        const mbm_clientRequest *failed = &parts[i].request;

        for (next = i + 1; next < part_count && parts[next].request.status == failed->status;
             next++)
            ;
        if (failed->status == MBM_OK)
            continue;
        snprintf(who, sizeof who, "unit %u", failed->unit);
        if (next - i < part_count)
            snprintf(who, sizeof who, "unit %u, addresses %u to %u", failed->unit,
                     shown_address(parts[i].first),
                     shown_address(parts[next - 1].first + parts[next - 1].quantity - 1));
        (void)line_failure_of(&at, who, failed, ADVICE_READ);
    }
}

/* Reads the units in a round, or in the only one, which is 0. Returns 0 after Ctrl-C; `right` is
 * then meaningless. */
static int read_units(uint32_t round, int *right)
{
    for (*right = 1, turn = 0; turn < unit_count; turn++) {
        int is_read;

        options.unit = units[turn];
        is_read = read_parts();
        if (!is_read && round > 0)
            return 0;
        *right &= first_failed() == NULL;
        show(round);
        if (round == 0)
            report_parts();
        if (!is_read)
            return 0;
    }
    return 1;
}

static void read_rounds(void)
{
    int right;
    uint32_t round = 0, failed = 0, due = line_milliseconds();

    while (!report_stopped && !ferror(stdout) && (rounds == 0 || round < rounds)) {
        if (!read_units(round + 1, &right))
            break;
        round++;
        failed += !right;
        /* If a round took longer than the interval, the next one follows at once. */
        due += interval;
        if ((int32_t)(due - line_milliseconds()) < 0)
            due = line_milliseconds();
        while (!report_stopped && !ferror(stdout) && round != rounds &&
               (int32_t)(due - line_milliseconds()) > 0) {
            line_poll(&at);
            line_rest(&at, due - line_milliseconds());
        }
    }
    if (!options.is_quiet)
        fprintf(stderr, "%s: %u round%s, %u of them with failures.\n", report_name, (unsigned)round,
                round == 1 ? "" : "s", (unsigned)failed);
}

int read_command(int argc, char **argv)
{
    int right;

    argp_parse(&arguments, argc, argv, 0, NULL, NULL);
    advice_keep(argc, argv, address_text);
    before = (history *)calloc(unit_count, sizeof *before);
    if (!before)
        return report(CODE_SYSTEM, "there is no memory for %u units", unit_count);
    if (line_open(&at, &where) != CODE_DONE)
        return report_code;
    if (interval == 0 && line_connect(&at) != CODE_DONE) {
        line_close(&at);
        return report_code;
    }
    if (is_csv)
        print_csv_head();
    if (interval > 0) {
        read_rounds();
    } else {
        (void)read_units(0, &right);
    }
    line_close(&at);
    return report_code;
}
