/* Parses the options that several commands share. */
#include "options.h"

#include "decimal.h"
#include "advice.h"
#include "mbm.h"
#include "numbers.h"
#include "place.h"
#include "report.h"
#include "trace.h"
#include "value.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    TRACE = 0x1000,
    PCAP,
    IN_FLIGHT,
    REPLACE_AFTER,
    JSON,
    SCALE,
    OFFSET,
    HEX,
    ONE_BASED,
    LAYOUT,
    TIME_ZONE
};

client_options options = {.in_flight = 1,
                          .replace_after = 2,
                          .unit = 1,
                          .table = MBM_TABLE_HOLDING_REGISTERS,
                          .form = {.type = MBM_TYPE_UINT16, .order = MBM_ORDER_ABCD}};

/* --- texts of the command line --- */

void options_wrong(const struct argp_state *state, const char *format, ...)
{
    char text[1024];
    va_list arguments;

    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    argp_error(state, "%s%s", text, strchr(text, '\n') ? "" : ".");
    exit(CODE_WRONG);
}

int64_t options_number(const struct argp_state *state, const char *what, const char *text,
                       int64_t least, int64_t most)
{
    int64_t number = 0;
    const char *wrong = number_read(text, least, most, &number);

    if (wrong)
        options_wrong(state, "%s %s", what, wrong);
    return number;
}

uint32_t options_time(const struct argp_state *state, const char *what, const char *text,
                      uint32_t least, uint32_t most)
{
    uint32_t milliseconds = 0;
    const char *wrong = number_time(text, least, most, &milliseconds);

    if (wrong)
        options_wrong(state, "%s %s", what, wrong);
    return milliseconds;
}

int options_word(const struct argp_state *state, const char *what, const char *text,
                 const char *const *words)
{
    int index = 0;
    const char *wrong = number_word(text, words, &index);

    if (wrong)
        options_wrong(state, "%s %s", what, wrong);
    return index;
}

unsigned options_units(const struct argp_state *state, const char *what, const char *text,
                       uint8_t units[OPTIONS_UNITS])
{
    uint8_t is_given[OPTIONS_UNITS] = {0};
    unsigned count = 0, unit;
    size_t length;

    for (;; text += length + 1) {
        char item[64], *dash;
        int64_t first, last;

        length = strcspn(text, ",");
        if (length >= sizeof item)
            options_wrong(state, "%s \"%.60s\" is not a unit", what, text);
        snprintf(item, sizeof item, "%.*s", (int)length, text);
        dash = length > 0 ? strchr(item + 1, '-') : NULL;
        if (dash)
            *dash++ = '\0';
        first = last = options_number(state, what, item, 0, OPTIONS_UNITS - 1);
        if (dash)
            last = options_number(state, what, dash, first, OPTIONS_UNITS - 1);
        for (; first <= last; first++)
            if (is_given[first]++)
                options_wrong(state, "%s: unit %u is there twice", what, (unsigned)first);
        if (!text[length])
            break;
    }
    for (unit = 0; unit < OPTIONS_UNITS; unit++)
        if (is_given[unit])
            units[count++] = (uint8_t)unit;
    return count;
}

uint16_t options_address(const struct argp_state *state, const char *text)
{
    const int first = options.is_one_based;
    int64_t number = 0;

    advice_keep(state->argc, state->argv, text);
    if (number_read(text, first, 65535 + first, &number) &&
        !number_read(text, 65536 + first, UINT32_MAX, &number) &&
        *advice_on_number((uint32_t)number))
        options_wrong(state, "ADDRESS \"%s\" is above 65535. %s", text,
                      advice_on_number((uint32_t)number));
    return (uint16_t)(options_number(state, "ADDRESS", text, first, 65535 + first) - first);
}

void options_place(const struct argp_state *state, struct place *where, const char *text,
                   int is_server)
{
    const char *wrong = place_read(where, text, is_server);

    if (wrong)
        options_wrong(state, "%s", wrong);
}

void options_too_many(const struct argp_state *state, const char *text)
{
    options_wrong(state, "\"%s\" is one word too many", text);
}

static int has_unit_0(const place *where)
{
    return where->framing == MBM_FRAMING_TCP;
}

void options_check_unit(const struct argp_state *state, const place *where, int is_write)
{
    const int may_be_0 = has_unit_0(where) || (place_is_serial(where) && is_write);

    if (options.unit == 0 && !may_be_0)
        options_wrong(state,
                      "--unit 0 means all units, for writes on a serial line only; here 1 to 255 "
                      "is allowed");
}

void options_check_units(const struct argp_state *state, const place *where, const uint8_t *units)
{
    /* They are in ascending order. */
    if (units[0] == 0 && !has_unit_0(where))
        options_wrong(state,
                      "unit 0 is read in frames of Modbus TCP only: on a serial line it is a "
                      "broadcast, which no device answers");
}

/* --- tracing --- */

static error_t parse_trace(int key, char *text, struct argp_state *state)
{
    (void)state;
    if (key == TRACE)
        trace_print();
    else if (key != PCAP)
        return ARGP_ERR_UNKNOWN;
    else if (trace_write(text) != 0)
        exit(report(CODE_SYSTEM, "%s: %s", text, strerror(errno)));
    return 0;
}

static const struct argp_option trace_texts[] = {
    {"trace", TRACE, NULL, 0, "Print each frame in words and hexadecimal to stderr, times in UTC",
     9},
    {"pcap", PCAP, "FILE", 0, "Write each frame to a pcapng file, for Wireshark", 9},
    {0}};

const struct argp options_trace = {.options = trace_texts, .parser = parse_trace};

/* --- requests and output --- */

static error_t parse_request(int key, char *text, struct argp_state *state)
{
    switch (key) {
    case IN_FLIGHT:
        options.in_flight =
            (uint8_t)options_number(state, "--in-flight", text, 1, MBM_CLIENT_DEPTH);
        return 0;
    case REPLACE_AFTER:
        options.replace_after = (uint8_t)options_number(state, "--replace-after", text, 0, 100);
        options.has_replace_after = 1;
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option request_texts[] = {
    {"in-flight", IN_FLIGHT, "N", 0,
     "Requests in flight at once on Modbus TCP, 1 to 16 (1). More are faster, but many devices take "
     "one at a time",
     2},
    {"replace-after", REPLACE_AFTER, "N", 0,
     "Requests in a row without any byte after which a connection is made anew, 0 to 100 (2); 0 for "
     "never",
     2},
    {0}};

/* --- what the device needs --- */

/* The key of an option is REACH and the number of the key. */
enum { REACH = 0x3000 };

static error_t parse_reach(int key, char *text, struct argp_state *state)
{
    const int which = key - REACH;
    char option[32], *at = option;
    const char *wrong;

    if (which < 0 || which >= REACH_KEYS)
        return ARGP_ERR_UNKNOWN;
    wrong = reach_read(&options.reach, which, text ? text : "yes");
    snprintf(option, sizeof option, "%s", reach_names[which]);
    while ((at = strchr(at, '_')) != NULL)
        *at = '-';
    if (wrong)
        options_wrong(state, "--%s %s", option, wrong);
    return 0;
}

static const struct argp_option reach_texts[] = {
    {"timeout", REACH + REACH_TIMEOUT, "TIME", 0,
     "How long a reply may take, such as 500ms or 2s, up to 1000s (1s)", 2},
    {"accept", REACH + REACH_ACCEPT, "WHAT", 0,
     "On Modbus TCP, take replies with another unit or transaction number: unit, transaction, or "
     "unit,transaction",
     2},
    {"lenient", REACH + REACH_LENIENT, NULL, 0,
     "Take replies with more data than requested, and to writes that repeat something else", 2},
    {"delay", REACH + REACH_DELAY, "TIME", 0,
     "Send nothing for this time after connecting, up to 65s (0s)", 2},
    {"message-wait", REACH + REACH_MESSAGE_WAIT, "TIME", 0,
     "The least time from the end of a request to the next one, up to 65s (0s)", 2},
    {"close", REACH + REACH_CLOSE, "WHEN", 0,
     "Close the connection never, after each round or after an error: never, round, error, or "
     "round,error (never; error with --accept transaction)",
     2},
    {"retries", REACH + REACH_RETRIES, "N", 0,
     "How often a request without a right reply is repeated, 0 to 254 (0)", 2},
    {"busy-retries", REACH + REACH_BUSY_RETRIES, "N", 0,
     "How often a request is repeated that the device refuses as busy: with exception 06, and a read "
     "also with 05, 0 to 254 (0)",
     2},
    {"busy-wait", REACH + REACH_BUSY_WAIT, "TIME", 0,
     "The time before each of these, up to 65s (100ms)", 2},
    {0}};

const struct argp options_reach = {.options = reach_texts, .parser = parse_reach};

static const struct argp_child request_children[] = {{.argp = &options_reach}, {0}};
const struct argp options_request = {
    .options = request_texts, .parser = parse_request, .children = request_children};

static error_t parse_output(int key, char *text, struct argp_state *state)
{
    (void)text;
    (void)state;
    if (key == JSON)
        options.is_json = 1;
    else if (key == 'q')
        options.is_quiet = 1;
    else
        return ARGP_ERR_UNKNOWN;
    return 0;
}

static const struct argp_option output_texts[] = {
    {"json", JSON, NULL, 0, "Print JSON, one object a line", 3},
    {"quiet", 'q', NULL, 0, "Print no summary and no notes to stderr", 3},
    {0}};

const struct argp options_output = {.options = output_texts, .parser = parse_output};

static const struct argp_child client_children[] = {
    {.argp = &options_request}, {.argp = &options_output}, {.argp = &options_trace}, {0}};
const struct argp options_client = {.children = client_children};

/* --- the unit --- */

static error_t parse_unit(int key, char *text, struct argp_state *state)
{
    if (key != 'u')
        return ARGP_ERR_UNKNOWN;
    options.unit = (uint8_t)options_number(state, "--unit", text, 0, 255);
    return 0;
}

static const struct argp_option unit_texts[] = {
    {"unit", 'u', "N", 0,
     "The unit id of the device, 1 to 255; on Modbus TCP also 0, on a serial line 0 writes to all (1)",
     1},
    {0}};

const struct argp options_unit = {.options = unit_texts, .parser = parse_unit};

/* --- values --- */

/* Whether layout and time zone go with the type, and the order with the registers of a value. */
static void fit_date(const struct argp_state *state)
{
    const int is_bcd = options.form.type == VALUE_DATE_BCD;
    const int has_layout = is_bcd || options.form.type == VALUE_DATE;
    const char *wrong;
    uint8_t registers = 1;

    if (options.form.zone != 0 && !value_is_date(options.form.type))
        options_wrong(state, "--time-zone is for dates");
    if (has_layout != (options.form.layout != NULL))
        options_wrong(state,
                      has_layout ? "the type %s needs --layout, such as \"Y M D h m s\""
                                 : "--layout is for the types date and date_bcd, not for %s",
                      value_type_name(options.form.type));
    if (has_layout) {
        wrong = value_layout_check(options.form.layout, &registers);
        if (wrong)
            options_wrong(state, "--layout %s", wrong);
        options.form.type =
            (uint8_t)((is_bcd ? VALUE_DATE_BCD_OF_1 : VALUE_DATE_OF_1) + registers - 1);
    }
    if (options.form.order > MBM_ORDER_DCBA &&
        (value_is_text(options.form.type) || has_layout || options.form.type == VALUE_IEC870 ||
         value_registers(options.form.type, 1) != 4))
        options_wrong(state, "--order %s is for values of four registers",
                      value_order_names[options.form.order]);
}

static void fit_type(const struct argp_state *state)
{
    const int is_bits =
        options.table == MBM_TABLE_COILS || options.table == MBM_TABLE_DISCRETE_INPUTS;
    int is_no_number;

    if (is_bits && !options.has_type)
        options.form.type = MBM_TYPE_BIT;
    if (is_bits != (options.form.type == MBM_TYPE_BIT))
        options_wrong(state, "the table %s has no values of type %s",
                      value_table_names[options.table], value_type_name(options.form.type));
    fit_date(state);
    is_no_number = value_is_text(options.form.type) || value_is_date(options.form.type) ||
                   options.form.type == MBM_TYPE_BIT || options.form.is_hex;
    if (options.form.scale.digits != 0 && is_no_number)
        options_wrong(state, "--scale needs a number, not a bit, a text, a date or --hex");
    if (options.conversion.offset.digits != 0 && is_no_number)
        options_wrong(state, "--offset needs a number, not a bit, a text, a date or --hex");
    if (options.form.is_hex && options.form.type >= MBM_TYPE_FLOAT)
        options_wrong(state, "--hex needs an integer type");
}

static error_t parse_values(int key, char *text, struct argp_state *state)
{
    switch (key) {
    case 't':
        options.table = (uint8_t)(1 + options_word(state, "--table", text, value_table_names + 1));
        return 0;
    case 'T':
        options.form.type =
            (uint8_t)(1 + options_word(state, "--type", text, value_type_names + 1));
        options.has_type = 1;
        return 0;
    case 'o':
        options.form.order =
            (uint8_t)(1 + options_word(state, "--order", text, value_order_names + 1));
        return 0;
    case SCALE:
        if (!value_scale_read(text, &options.form.scale))
            options_wrong(state, "--scale \"%s\" is not a decimal number other than 0, such as 0.1",
                          text);
        return 0;
    case OFFSET:
        if (!decimal_read_short(text, &options.conversion.offset))
            options_wrong(state, "--offset \"%s\" is not a decimal number of up to 18 digits",
                          text);
        options.form.conversion = &options.conversion;
        return 0;
    case HEX: options.form.is_hex = 1; return 0;
    case LAYOUT: options.form.layout = text; return 0;
    case TIME_ZONE:
        if (!value_zone_read(text, &options.form.zone))
            options_wrong(state, "--time-zone \"%s\" is neither Z nor an offset such as +01:00",
                          text);
        return 0;
    case ONE_BASED: options.is_one_based = 1; return 0;
    case ARGP_KEY_END: fit_type(state); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option value_texts[] = {
    {"table", 't', "TABLE", 0, "coils, discrete, input or holding (holding)", 1},
    {"type", 'T', "TYPE", 0,
     "bit, uint16, int16, uint32, int32, uint64, int64, float, double or text (uint16, of coils and "
     "discrete inputs bit). docs/device-file.md has more: int24 and int48, float16, sign_magnitude16, "
     "bcd16, uint32_m10k, text_low, unix32, iec870, date and others",
     1},
    {"order", 'o', "ORDER", 0,
     "Order of the bytes of a value: ABCD, CDAB, BADC or DCBA; A is the most significant one. Of four "
     "registers also EFGHABCD, CDABGHEF, FEHGBADC or DCBAHGFE (ABCD)",
     1},
    {"scale", SCALE, "NUMBER", 0, "The value is the device's number times this, such as 0.1", 1},
    {"offset", OFFSET, "NUMBER", 0, "This is added to it, after the scale, such as -273.15", 1},
    {"hex", HEX, NULL, 0, "Values of integer types are hexadecimal", 1},
    {"layout", LAYOUT, "TEXT", 0, "What the registers of a date hold, such as \"Y M D h m s\"", 1},
    {"time-zone", TIME_ZONE, "OFFSET", 0, "The time zone of the device's clock, such as +01:00 (Z)",
     1},
    {"one-based", ONE_BASED, NULL, 0, "ADDRESS counts from 1, as in many manuals", 1},
    {0}};

const struct argp options_values = {.options = value_texts, .parser = parse_values};
