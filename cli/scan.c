/* mbm scan: finds the units that answer, or their SunSpec models. */
#include "advice.h"
#include "line.h"
#include "numbers.h"
#include "options.h"
#include "report.h"

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

/* --- SunSpec models --- */

/* Registers of the parts of a chain. */
enum { HEAD = 2, TEXT = 16, COMMON = 1, END = 0xFFFF, MOST_MODELS = 500 };

/* "SunS", with which a chain begins. */
enum { FIRST_MARK = 0x5375, SECOND_MARK = 0x6E53 };

static const uint16_t BASES[] = {40000, 0, 50000};

typedef struct walk {
    line *at;
    uint8_t unit;
    uint16_t base;
    mbm_clientRequest request; /* the last one */
} walk;

/* The names of models in the words of the specification; vendors have the numbers from 64001 on. */
static const char *name_of(uint16_t id)
{
    static const struct {
        uint16_t id;
        const char *name;
    } NAMES[] = {{1, "common"},
                 {2, "basic aggregator"},
                 {11, "Ethernet link layer"},
                 {12, "IPv4"},
                 {13, "IPv6"},
                 {16, "simple IP network"},
                 {17, "serial interface"},
                 {101, "inverter, single phase"},
                 {102, "inverter, split phase"},
                 {103, "inverter, three phase"},
                 {111, "inverter, single phase, float"},
                 {112, "inverter, split phase, float"},
                 {113, "inverter, three phase, float"},
                 {120, "nameplate"},
                 {121, "basic settings"},
                 {122, "measurements and status"},
                 {123, "immediate controls"},
                 {124, "storage"},
                 {125, "pricing"},
                 {126, "static volt-VAR"},
                 {127, "frequency-watt parameters"},
                 {128, "dynamic reactive current"},
                 {131, "watt-power factor"},
                 {132, "volt-watt"},
                 {134, "frequency-watt curve"},
                 {145, "extended settings"},
                 {160, "multiple MPPT"},
                 {201, "meter, single phase"},
                 {202, "meter, split phase"},
                 {203, "meter, wye-connected three phase"},
                 {204, "meter, delta-connected three phase"},
                 {211, "meter, single phase, float"},
                 {212, "meter, split phase, float"},
                 {213, "meter, wye-connected three phase, float"},
                 {214, "meter, delta-connected three phase, float"},
                 {302, "irradiance"},
                 {303, "back of module temperature"},
                 {304, "inclinometer"},
                 {305, "location"},
                 {306, "reference point"},
                 {307, "base meteorology"},
                 {308, "mini meteorology"},
                 {401, "string combiner"},
                 {403, "string combiner"},
                 {501, "solar module, float"},
                 {502, "solar module"},
                 {601, "tracker controller"},
                 {701, "DER AC measurement"},
                 {702, "DER capacity"},
                 {703, "DER enter service"},
                 {704, "DER AC controls"},
                 {705, "DER volt-VAR"},
                 {706, "DER volt-watt"},
                 {707, "DER trip, low voltage"},
                 {708, "DER trip, high voltage"},
                 {709, "DER trip, low frequency"},
                 {710, "DER trip, high frequency"},
                 {711, "DER frequency droop"},
                 {712, "DER watt-VAR"},
                 {713, "DER storage capacity"},
                 {714, "DER DC measurement"},
                 {802, "battery base"},
                 {803, "lithium-ion battery bank"},
                 {804, "lithium-ion battery string"},
                 {805, "lithium-ion battery module"},
                 {806, "flow battery"}};
    size_t i;

    for (i = 0; i < sizeof NAMES / sizeof NAMES[0]; i++)
        if (NAMES[i].id == id)
            return NAMES[i].name;
    return id >= 64001 && id < END ? "vendor's" : NULL;
}

/* Reads registers; what the device refuses is read in halves. Returns the status. */
static uint8_t read_registers(walk *w, uint32_t address, uint16_t count, uint16_t *words)
{
    uint8_t status;

    memset(&w->request, 0, sizeof w->request);
    w->request.unit = w->unit;
    w->request.reply = words;
    w->request.replyBytes = (uint16_t)(count * sizeof *words);
    status = line_call(
        w->at, &w->request,
        line_read(w->at, &w->request, MBM_TABLE_HOLDING_REGISTERS, (uint16_t)address, count));
    w->request.status = status;
    if (w->request.exception == 0 || count == 1)
        return status;
    status = read_registers(w, address, count / 2, words);
    return status != MBM_OK ? status
                            : read_registers(w, address + count / 2, (uint16_t)(count - count / 2),
                                             words + count / 2);
}

/* Reads a text of the common model, without what pads it; the text is empty if there is none. */
static void read_text(walk *w, uint32_t address, char text[2 * TEXT + 1])
{
    uint16_t words[TEXT] = {0};
    size_t i, length = 0;

    text[0] = '\0';
    if (read_registers(w, address, TEXT, words) != MBM_OK)
        return;
    for (i = 0; i < 2 * TEXT; i++) {
        const char one = (char)(words[i / 2] >> (i % 2 ? 0 : 8));

        if (one == '\0')
            break;
        text[i] = one > ' ' && one < 0x7F ? one : ' ';
        length = text[i] == ' ' ? length : i + 1;
    }
    text[length] = '\0';
}

/* Finds where the chain begins. Returns an exit code. */
static int find_base(walk *w)
{
    uint16_t words[HEAD] = {0};
    size_t i;

    for (i = 0; i < sizeof BASES / sizeof BASES[0]; i++) {
        const uint8_t status = read_registers(w, BASES[i], HEAD, words);

        if (status == MBM_OK && words[0] == FIRST_MARK && words[1] == SECOND_MARK) {
            w->base = BASES[i];
            return CODE_DONE;
        }
        if (status != MBM_OK && w->request.exception == 0)
            return line_failure(w->at, &w->request, ADVICE_DEVICE);
    }
    return report(
        CODE_EXCEPTION,
        "unit %u has no SunSpec models: none of the holding registers 40000, 0 and 50000 "
        "begins with \"SunS\". Check the unit's number; some devices have SunSpec switched "
        "off",
        w->unit);
}

static void print_base(walk *w, const char *maker, const char *type)
{
    if (!options.is_json)
        printf("unit %u: SunSpec at holding register %u%s%s%s%s\n", w->unit, w->base,
               *maker ? ": " : "", maker, *type ? " " : "", type);
}

static void print_model(walk *w, uint32_t address, uint16_t id, uint16_t length, const char *maker,
                        const char *type)
{
    const char *name = name_of(id);
    cJSON *all;

    if (!options.is_json) {
        printf("%5u  model %5u  %3u registers  %s\n", (unsigned)address, id, length,
               name ? name : "");
        report_flush();
        return;
    }
    all = cJSON_CreateObject();
    cJSON_AddNumberToObject(all, "unit", w->unit);
    cJSON_AddNumberToObject(all, "base", w->base);
    cJSON_AddNumberToObject(all, "address", address);
    cJSON_AddNumberToObject(all, "model", id);
    if (name)
        cJSON_AddStringToObject(all, "name", name);
    cJSON_AddNumberToObject(all, "length", length);
    if (id == COMMON) {
        cJSON_AddStringToObject(all, "manufacturer", maker);
        cJSON_AddStringToObject(all, "device", type);
    }
    report_json(all, MBM_OK, 0, report_words(MBM_OK, 0));
}

/* Finds the base address of a unit, and lists its chain of models. Returns an exit code, after
 * reporting the reason if it is not CODE_DONE. */
static int scan_unit(line *l, uint8_t unit)
{
    walk data = {.at = l, .unit = unit}, *w = &data;
    char maker[2 * TEXT + 1] = "", type[2 * TEXT + 1] = "";
    uint16_t head[HEAD] = {0};
    uint32_t address;
    unsigned models;
    int code = find_base(w);

    if (code != CODE_DONE)
        return code;
    address = w->base + HEAD;
    for (models = 0; !report_stopped; models++) {
        if (address + HEAD > 65536)
            return report(CODE_DAMAGED,
                          "unit %u: the chain of SunSpec models leads to address %u, beyond the "
                          "last one, 65535: the length of a model before is wrong",
                          unit, (unsigned)address);
        if (read_registers(w, address, HEAD, head) != MBM_OK) {
            char status[256];

            if (w->request.exception == 0)
                return line_failure(l, &w->request, ADVICE_DEVICE);
            return report(CODE_DAMAGED,
                          "unit %u: the chain of SunSpec models leads to address %u, which the "
                          "device refuses: %s. The length of a model before is wrong, or the "
                          "chain has no end",
                          unit, (unsigned)address, line_status(l, &w->request, status));
        }
        if (models == 0 && head[0] == COMMON) {
            read_text(w, address + HEAD, maker);
            read_text(w, address + HEAD + TEXT, type);
        }
        if (models == 0)
            print_base(w, maker, type);
        if (head[0] == END)
            return CODE_DONE;
        if (head[0] == 0 || models == MOST_MODELS)
            return report(CODE_DAMAGED,
                          "unit %u: the chain of SunSpec models has no end: at address %u stands "
                          "model %u. The length of a model before is wrong",
                          unit, (unsigned)address, head[0]);
        print_model(w, address, head[0], head[1], maker, type);
        address += HEAD + (uint32_t)head[1];
    }
    return report_note(CODE_NO_REPLY);
}

/* Lists the SunSpec models of each unit. Returns an exit code. */
static int scan_models(scanning *s)
{
    int code = line_open(&s->at, &s->where);
    unsigned i;

    if (code == CODE_DONE)
        code = line_connect(&s->at);
    for (i = 0; i < s->unit_count && code == CODE_DONE && !report_stopped; i++)
        (void)scan_unit(&s->at, s->units[i]);
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
