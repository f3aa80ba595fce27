/* mbm scan: finds the units that answer. Licence: MIT OR Apache-2.0. */
#include "advice.h"
#include "line.h"
#include "numbers.h"
#include "options.h"
#include "report.h"
#include "sunspec.h"

#include <cjson/cJSON.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { RATES = 16, PARITIES = 3 };

typedef struct scanning {
    line at;
    place where;
    uint8_t units[OPTIONS_UNITS];
    unsigned unit_count;
    uint32_t rates[RATES];
    unsigned rate_count;
    char parities[PARITIES];
    unsigned parity_count;
    mbm_clientRequest requests[OPTIONS_UNITS];
    uint16_t values[OPTIONS_UNITS];
    unsigned answering, damaged, tried;
    int is_sunspec;
    char came[160]; /* in place of the first reply that did not come, if anything did */
} scanning;

/* --- the command line --- */

enum { UNITS_KEY = 1, RATES_KEY, PARITIES_KEY, SUNSPEC };

static void read_rate(const struct argp_state *state, char *item)
{
    scanning *s = (scanning *)state->input;

    if (s->rate_count == RATES)
        options_wrong(state, "--rates has more than %d rates", RATES);
    s->rates[s->rate_count++] = (uint32_t)options_number(state, "--rates", item, 50, 4000000);
}

static void read_parity(const struct argp_state *state, char *item)
{
    scanning *s = (scanning *)state->input;
    static const char *const words[] = {"none", "even", "odd", NULL};

    if (s->parity_count == PARITIES)
        options_wrong(state, "--parities has more than %d parities", PARITIES);
    s->parities[s->parity_count++] = "NEO"[options_word(state, "--parities", item, words)];
}

/* Reads a list with commas. An empty item is read too, and refused. */
static void read_list(const struct argp_state *state, char *text,
                      void (*read_item)(const struct argp_state *state, char *item))
{
    char *comma = strchr(text, ',');

    if (comma)
        *comma = '\0';
    read_item(state, text);
    if (comma)
        read_list(state, comma + 1, read_item);
}

static void check_arguments(scanning *s, const struct argp_state *state)
{
    if (!s->where.text)
        options_wrong(state, "LINE is missing");
    if (!place_is_serial(&s->where) && s->rate_count + s->parity_count > 0)
        options_wrong(state, "--rates and --parities need a serial line");
    if (s->is_sunspec && s->rate_count + s->parity_count > 0)
        options_wrong(state,
                      "--sunspec reads at the rate and parity of LINE: leave out --rates and "
                      "--parities");
    if (s->unit_count == 0)
        s->unit_count = options_units(state, "--units", s->is_sunspec ? "1" : "1-247", s->units);
    options_check_units(state, &s->where, s->units);
    if (s->rate_count == 0)
        s->rates[s->rate_count++] = s->where.tty.baud;
    if (s->parity_count == 0)
        s->parities[s->parity_count++] = s->where.tty.parity;
    if (!reach_has(&options.reach, REACH_TIMEOUT) && place_is_serial(&s->where) && !s->is_sunspec)
        (void)reach_read(&options.reach, REACH_TIMEOUT, "200ms");
    /* A scan expects that units are silent. */
    if (!options.has_replace_after)
        options.replace_after = 0;
}

static error_t parse(int key, char *text, struct argp_state *state)
{
    scanning *s = (scanning *)state->input;

    switch (key) {
    case UNITS_KEY: s->unit_count = options_units(state, "--units", text, s->units); return 0;
    case RATES_KEY: read_list(state, text, read_rate); return 0;
    case SUNSPEC: s->is_sunspec = 1; return 0;
    case PARITIES_KEY: read_list(state, text, read_parity); return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num > 0)
            options_too_many(state, text);
        options_place(state, &s->where, text, 0);
        return 0;
    case ARGP_KEY_SUCCESS: check_arguments(s, state); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option texts[] = {
    {"units", UNITS_KEY, "LIST", 0,
     "The units to try, such as 1-20,100; on Modbus TCP also 0 (1-247)", 1},
    {"rates", RATES_KEY, "LIST", 0, "Baud rates to try, such as 9600,19200 (that of LINE)", 1},
    {"parities", PARITIES_KEY, "LIST", 0, "Parities to try, of none,even,odd (that of LINE)", 1},
    {"sunspec", SUNSPEC, NULL, 0, "List the SunSpec models of the units (--units 1)", 1},
    {0}};

static const struct argp_child children[] = {{.argp = &options_client}, {0}};

static const struct argp arguments = {
    .options = texts,
    .parser = parse,
    .args_doc = "LINE",
    .doc =
        "Reads holding register 0 of each unit. A unit that answers with a value or an exception is "
        "there. --timeout is 200ms on a serial line if it is not given.\v"
        "Example: which units answer, and at which rate and parity?\n\n"
        "  mbm scan rtu:/dev/ttyUSB0 --units 1-20 --rates 9600,19200 --parities none,even\n\n" PLACE_HELP,
    .children = children};

/* --- scanning --- */

static const char *parity_word(scanning *s)
{
    return s->at.place.tty.parity == 'N' ? "none" : s->at.place.tty.parity == 'E' ? "even" : "odd";
}

static void print_unit(scanning *s, const mbm_clientRequest *request, uint16_t value)
{
    char status[256];
    cJSON *all;

    if (!options.is_json) {
        if (s->rate_count * s->parity_count > 1)
            printf("%6u %-4s  ", (unsigned)s->at.place.tty.baud, parity_word(s));
        if (request->status == MBM_OK)
            printf("unit %3u: holding register 0 is %u\n", request->unit, value);
        else
            printf("unit %3u: %s%s\n", request->unit, line_status(&s->at, request, status),
                   request->exception ? ""
                   : place_is_serial(&s->at.place)
                       ? "; two units with one id, or another rate or parity?"
                       : "; --trace shows what came");
        report_flush();
        return;
    }
    all = cJSON_CreateObject();
    if (place_is_serial(&s->at.place)) {
        cJSON_AddNumberToObject(all, "baud", s->at.place.tty.baud);
        cJSON_AddStringToObject(all, "parity", parity_word(s));
    }
    cJSON_AddNumberToObject(all, "unit", request->unit);
    if (request->status == MBM_OK)
        cJSON_AddNumberToObject(all, "value", value);
    report_json(all, request->status, request->exception, line_status(&s->at, request, status));
}

static void take(scanning *s, const mbm_clientRequest *request, uint16_t value)
{
    switch (request->status) {
    case MBM_RESPONSE_TIMED_OUT:
    case MBM_INVALID_SLAVE_ID:
    case MBM_GATEWAY_PATH_UNAVAILABLE:
    case MBM_GATEWAY_TARGET_FAILED_TO_RESPOND: return;
    case MBM_OK: s->answering++; break;
    default: s->answering += request->exception != 0; s->damaged += request->exception == 0;
    }
    print_unit(s, request, value);
}

/* Keeps the queue full, and shows the results in the order of the units. Returns an exit code. */
static int scan(scanning *s)
{
    unsigned queued = 0, ended = 0;
    const char *why;

    while (!report_stopped && ended < s->unit_count) {
        for (; queued < s->unit_count && queued - ended < MBM_CLIENT_DEPTH; queued++) {
            memset(&s->requests[queued], 0, sizeof s->requests[queued]);
            s->requests[queued].unit = s->units[queued];
            s->requests[queued].reply = &s->values[queued];
            s->requests[queued].replyBytes = sizeof s->values[queued];
            (void)line_read(&s->at, &s->requests[queued], MBM_TABLE_HOLDING_REGISTERS, 0, 1);
        }
        line_poll(&s->at);
        for (; ended < queued && s->requests[ended].status != MBM_PENDING; ended++, s->tried++) {
            if (report_code_of(s->requests[ended].status, s->requests[ended].exception) ==
                CODE_LINE)
                return line_failure(&s->at, &s->requests[ended], ADVICE_DEVICE);
            why = line_why(&s->at, s->requests[ended].status);
            if (!*s->came && s->requests[ended].exception == 0 && why)
                snprintf(s->came, sizeof s->came, "%s", why);
            take(s, &s->requests[ended], s->values[ended]);
            if (isatty(STDERR_FILENO) && !options.is_quiet)
                fprintf(stderr, "\r%u of %u \r", s->tried + 1,
                        s->unit_count * s->rate_count * s->parity_count);
        }
        if (ended < s->unit_count)
            line_rest(&s->at, 1000);
    }
    return CODE_DONE;
}

/* Lists the SunSpec models of each unit. Returns an exit code. */
static int scan_models(scanning *s)
{
    int code = line_open(&s->at, &s->where);
    unsigned i;

    if (code == CODE_DONE)
        code = line_connect(&s->at);
    for (i = 0; i < s->unit_count && code == CODE_DONE && !report_stopped; i++)
        (void)sunspec_scan(&s->at, s->units[i]);
    line_close(&s->at);
    return report_code;
}

/* Scans with one rate and parity. Returns an exit code. */
static int scan_line(scanning *s, uint32_t rate, char parity)
{
    place one = s->where;
    int code;

    one.tty.baud = rate;
    one.tty.parity = parity;
    code = line_open(&s->at, &one);
    if (code == CODE_DONE)
        code = line_connect(&s->at);
    if (code == CODE_DONE) {
        (void)mbm_client_setQuietTime(&s->at.client, 0);
        code = scan(s);
    }
    line_close(&s->at);
    return code;
}

int scan_command(int argc, char **argv)
{
    static scanning data;
    scanning *s = &data;
    int code = CODE_DONE;
    unsigned i;

    argp_parse(&arguments, argc, argv, 0, NULL, s);
    if (s->is_sunspec)
        return scan_models(s);
    for (i = 0; i < s->rate_count * s->parity_count && code == CODE_DONE && !report_stopped; i++)
        code = scan_line(s, s->rates[i / s->parity_count], s->parities[i % s->parity_count]);
    if (code == CODE_DONE && !options.is_quiet)
        fprintf(stderr, "%s: %u of %u requests were answered%s.\n", report_name, s->answering,
                s->tried,
                s->answering > 0 || s->damaged > 0 || report_stopped ? ""
                : *s->came ? say(", although %s. %s; --trace shows what came", s->came,
                                 advice_silent(&s->where))
                           : say(". %s, and try a longer --timeout%s", advice_silent(&s->where),
                                 report_in_flight()));
    if (s->answering == 0 && !report_stopped)
        (void)report_note(s->damaged > 0 ? CODE_DAMAGED : CODE_NO_REPLY);
    return report_code;
}
