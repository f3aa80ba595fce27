/* mbm scan: finds the units that answer. Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "advice.h"
#include "commands.h"
#include "line.h"
#include "numbers.h"
#include "options.h"
#include "report.h"

#include <cjson/cJSON.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { RATES = 16, PARITIES = 3 };

static line at;
static place where;
static uint8_t units[OPTIONS_UNITS];
static unsigned unit_count;
static uint32_t rates[RATES];
static unsigned rate_count;
static char parities[PARITIES];
static unsigned parity_count;

static mbm_clientRequest requests[OPTIONS_UNITS];
static uint16_t values[OPTIONS_UNITS];
static unsigned answering, damaged, tried;
static char came[160]; /* in place of the first reply that did not come, if anything did */

/* --- the command line --- */

enum { UNITS_KEY = 1, RATES_KEY, PARITIES_KEY };

static void read_rate(const struct argp_state *state, char *item)
{
    if (rate_count == RATES)
        options_wrong(state, "--rates has more than %d rates", RATES);
    rates[rate_count++] = (uint32_t)options_number(state, "--rates", item, 50, 4000000);
}

static void read_parity(const struct argp_state *state, char *item)
{
    static const char *const words[] = {"none", "even", "odd", NULL};

    if (parity_count == PARITIES)
        options_wrong(state, "--parities has more than %d parities", PARITIES);
    parities[parity_count++] = "NEO"[options_word(state, "--parities", item, words)];
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

static void check_arguments(const struct argp_state *state)
{
    if (!where.text)
        options_wrong(state, "LINE is missing");
    if (!place_is_serial(&where) && rate_count + parity_count > 0)
        options_wrong(state, "--rates and --parities need a serial line");
    if (unit_count == 0)
        unit_count = options_units(state, "--units", "1-247", units);
    if (rate_count == 0)
        rates[rate_count++] = where.tty.baud;
    if (parity_count == 0)
        parities[parity_count++] = where.tty.parity;
    if (!options.has_timeout && place_is_serial(&where))
        options.timeoutMs = 200;
    /* That units are silent is what a scan expects. */
    if (!options.has_replace_after)
        options.replace_after = 0;
}

static error_t parse(int key, char *text, struct argp_state *state)
{
    switch (key) {
    case UNITS_KEY: unit_count = options_units(state, "--units", text, units); return 0;
    case RATES_KEY: read_list(state, text, read_rate); return 0;
    case PARITIES_KEY: read_list(state, text, read_parity); return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num > 0)
            options_too_many(state, text);
        options_place(state, &where, text, 0);
        return 0;
    case ARGP_KEY_SUCCESS: check_arguments(state); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option texts[] = {
    {"units", UNITS_KEY, "LIST", 0, "The units to try, such as 1-20,100 (1-247)", 1},
    {"rates", RATES_KEY, "LIST", 0, "Baud rates to try, such as 9600,19200 (that of LINE)", 1},
    {"parities", PARITIES_KEY, "LIST", 0, "Parities to try, of none,even,odd (that of LINE)", 1},
    {NULL, 0, NULL, 0, NULL, 0}};

static const struct argp_child children[] = {{&options_client, 0, NULL, 0}, {NULL, 0, NULL, 0}};

static const struct argp arguments = {
    texts,
    parse,
    "LINE",
    "Reads holding register 0 of each unit. A unit that answers with a value or an exception is "
    "there. --timeout is 200ms on a serial line if it is not given.\v"
    "Example: which units answer, and at which rate and parity?\n\n"
    "  mbm scan rtu:/dev/ttyUSB0 --units 1-20 --rates 9600,19200 --parities none,even\n\n" PLACE_HELP,
    children,
    NULL,
    NULL};

/* --- scanning --- */

static const char *parity_word(void)
{
    return at.place.tty.parity == 'N' ? "none" : at.place.tty.parity == 'E' ? "even" : "odd";
}

static void print_unit(const mbm_clientRequest *request, uint16_t value)
{
    char status[256];
    cJSON *all;

    if (!options.is_json) {
        if (rate_count * parity_count > 1)
            printf("%6u %-4s  ", (unsigned)at.place.tty.baud, parity_word());
        if (request->status == MBM_OK)
            printf("unit %3u: holding register 0 is %u\n", request->unit, value);
        else
            printf("unit %3u: %s%s\n", request->unit, line_status(&at, request, status),
                   request->exception ? ""
                   : place_is_serial(&at.place)
                       ? "; two units with one id, or another rate or parity?"
                       : "; --trace shows what came");
        report_flush();
        return;
    }
    all = cJSON_CreateObject();
    if (place_is_serial(&at.place)) {
        cJSON_AddNumberToObject(all, "baud", at.place.tty.baud);
        cJSON_AddStringToObject(all, "parity", parity_word());
    }
    cJSON_AddNumberToObject(all, "unit", request->unit);
    if (request->status == MBM_OK)
        cJSON_AddNumberToObject(all, "value", value);
    report_json(all, request->status, request->exception, line_status(&at, request, status));
}

static void take(const mbm_clientRequest *request, uint16_t value)
{
    switch (request->status) {
    case MBM_RESPONSE_TIMED_OUT:
    case MBM_INVALID_SLAVE_ID:
    case MBM_GATEWAY_PATH_UNAVAILABLE:
    case MBM_GATEWAY_TARGET_FAILED_TO_RESPOND: return;
    case MBM_OK: answering++; break;
    default: answering += request->exception != 0; damaged += request->exception == 0;
    }
    print_unit(request, value);
}

/* Keeps the queue full, and shows the results in the order of the units. Returns an exit code. */
static int scan(void)
{
    unsigned queued = 0, ended = 0;
    const char *why;

    while (!report_stopped && ended < unit_count) {
        for (; queued < unit_count && queued - ended < MBM_CLIENT_DEPTH; queued++) {
            memset(&requests[queued], 0, sizeof requests[queued]);
            requests[queued].unit = units[queued];
            requests[queued].reply = &values[queued];
            requests[queued].replyBytes = sizeof values[queued];
            (void)line_read(&at, &requests[queued], MBM_TABLE_HOLDING_REGISTERS, 0, 1);
        }
        line_poll(&at);
        for (; ended < queued && requests[ended].status != MBM_PENDING; ended++, tried++) {
            if (report_code_of(requests[ended].status, requests[ended].exception) == CODE_LINE)
                return line_failure(&at, &requests[ended], ADVICE_DEVICE);
            why = line_why(&at, requests[ended].status);
            if (!*came && requests[ended].exception == 0 && why)
                snprintf(came, sizeof came, "%s", why);
            take(&requests[ended], values[ended]);
            if (isatty(STDERR_FILENO) && !options.is_quiet)
                fprintf(stderr, "\r%u of %u \r", tried + 1, unit_count * rate_count * parity_count);
        }
        if (ended < unit_count)
            line_rest(&at, 1000);
    }
    return CODE_DONE;
}

/* Scans with one rate and parity. Returns an exit code. */
static int scan_line(uint32_t rate, char parity)
{
    place one = where;
    int code;

    one.tty.baud = rate;
    one.tty.parity = parity;
    code = line_open(&at, &one);
    if (code == CODE_DONE)
        code = line_connect(&at);
    if (code == CODE_DONE) {
        (void)mbm_client_setQuietTime(&at.client, 0);
        code = scan();
    }
    line_close(&at);
    return code;
}

int scan_command(int argc, char **argv)
{
    int code = CODE_DONE;
    unsigned i;

    argp_parse(&arguments, argc, argv, 0, NULL, NULL);
    for (i = 0; i < rate_count * parity_count && code == CODE_DONE && !report_stopped; i++)
        code = scan_line(rates[i / parity_count], parities[i % parity_count]);
    if (code == CODE_DONE && !options.is_quiet)
        fprintf(stderr, "%s: %u of %u requests were answered%s.\n", report_name, answering, tried,
                answering > 0 || damaged > 0 || report_stopped ? ""
                : *came
                    ? say(", although %s. %s; --trace shows what came", came, advice_silent(&where))
                    : say(". %s, and try a longer --timeout%s", advice_silent(&where),
                          report_in_flight()));
    if (answering == 0 && !report_stopped)
        (void)report_note(damaged > 0 ? CODE_DAMAGED : CODE_NO_REPLY);
    return report_code;
}
