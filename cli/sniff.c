/* mbm sniff: watches a bus, prints one line for each event, and sends nothing. It also reads the
 * recording of a bus as text. */
#include "clock.h"
#include "line.h"
#include "options.h"
#include "report.h"
#include "trace.h"

#include <cjson/cJSON.h>
#include <ctype.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Microseconds, except the first and the last three. A recording is looked at in short steps while
 * requests may time out, and then in long ones. A line without a time is RECORDING_STEP after the
 * one before. */
enum {
    KINDS = MBM_EVENT_NOISE + 1,
    LIVE_STEP = 5000,
    LOOK_STEP = 100000,
    ALL_ENDED = 2000000,
    SELDOM_STEP = 600000000,
    RECORDING_STEP = 10000,
    MILLION = 1000000,
    RECORDING_BYTES = 2700,
    TEXT_BYTES = 2400
};

/* Thirty years in microseconds. */
#define LAST_TIME 9.5e14

typedef struct sniff {
    /* What the command line says. A recording has no place but its name. */
    place where;
    uint32_t timeoutMs, frameMs; /* 0: the default of the sniffer */
    int is_recording, has_recording_options;

    mbm_sniffer sniffer;
    uint8_t buffer[MBM_MAX_ASCII_FRAME];
    unsigned long totals[KINDS];
    uint64_t firstUs, nowUs; /* they do not wrap, unlike the sniffer's */
    uint64_t epochUs;        /* the time of `firstUs`, since 1970; for a recording 0 */
    uint32_t slowest;
} sniff;

/* --- events --- */

static const char *const KIND_NAMES[] = {
    [MBM_EVENT_REQUEST] = "request",     [MBM_EVENT_REPLY] = "reply",
    [MBM_EVENT_EXCEPTION] = "exception", [MBM_EVENT_UNPAIRED] = "unpaired",
    [MBM_EVENT_TIMEOUT] = "timeout",     [MBM_EVENT_BAD_CRC] = "bad CRC",
    [MBM_EVENT_NOISE] = "noise",
};

/* Adds a number of seconds or milliseconds without rounding it to a double. */
static void add_decimal(cJSON *object, const char *name, int64_t value, uint64_t unit)
{
    const uint64_t amount = (uint64_t)(value < 0 ? -value : value);
    char text[48];

    snprintf(text, sizeof text, "%s%llu.%0*llu", value < 0 ? "-" : "",
             (unsigned long long)(amount / unit), unit == MILLION ? 6 : 3,
             (unsigned long long)(amount % unit));
    cJSON_AddRawToObject(object, name, text);
}

/* Adds the registers or bits that a frame carries. */
static void add_values(cJSON *object, const mbm_event *event)
{
    const mbm_packet *packet = &event->packet;
    const int is_request = packet->kind == MBM_PACKET_REQUEST;
    int are_bits = 0, are_words = 0;
    cJSON *values;
    uint16_t at;

    switch (event->function) {
    case 1:
    case 2: are_bits = !is_request; break;
    case 3:
    case 4: are_words = !is_request; break;
    case 15: are_bits = is_request; break;
    case 16: are_words = is_request; break;
    case 23: are_words = 1; break;
    case 5:
    case 6: cJSON_AddNumberToObject(object, "value", packet->value); return;
    case 22:
        cJSON_AddNumberToObject(object, "and_mask", packet->andMask);
        cJSON_AddNumberToObject(object, "or_mask", packet->orMask);
        return;
    default: return;
    }
    if (!are_bits && !are_words)
        return;
    values = cJSON_AddArrayToObject(object, "values");
    for (at = 0; are_words && at + 1 < packet->dataLength; at = (uint16_t)(at + 2))
        cJSON_AddItemToArray(values,
                             cJSON_CreateNumber(packet->data[at] << 8 | packet->data[at + 1]));
    /* Without its request, the bits that fill the last byte of a reply are not known. */
    for (at = 0;
         are_bits && at < 8 * packet->dataLength && (event->quantity == 0 || at < event->quantity);
         at++)
        cJSON_AddItemToArray(values, cJSON_CreateNumber(packet->data[at / 8] >> at % 8 & 1));
}

static void add_frame(cJSON *object, const mbm_event *event)
{
    static char text[2 * UINT16_MAX + 1];
    uint16_t at;

    text[0] = '\0';
    for (at = 0; at < event->frameLength; at++)
        sprintf(text + 2 * at, "%02x", event->frame[at]);
    cJSON_AddStringToObject(object, "bytes", text);
}

/* Prints an event as one line with one JSON object. `micros` is the time of the event since the
 * sniffer began, and negative if it was before, `since_1970` that time, or 0 if it is not known. */
static void print_json(const mbm_event *event, int64_t micros, uint64_t since_1970)
{
    const int has_unit = event->kind != MBM_EVENT_NOISE && event->kind != MBM_EVENT_BAD_CRC;
    const int is_malformed = event->status == MBM_MALFORMED_REPLY;
    cJSON *object = cJSON_CreateObject();
    char text[TEXT_BYTES], time[CLOCK_TEXT_BYTES];

    mbm_event_text(event, text, sizeof text);
    add_decimal(object, "seconds", micros, MILLION);
    if (since_1970)
        cJSON_AddStringToObject(object, "time", clock_text(since_1970, 6, time));
    cJSON_AddStringToObject(object, "event", KIND_NAMES[event->kind]);
    if (has_unit) {
        cJSON_AddNumberToObject(object, "unit", event->unit);
        cJSON_AddNumberToObject(object, "function", event->function);
        if (event->quantity > 0) {
            cJSON_AddNumberToObject(object, "address", event->address);
            cJSON_AddNumberToObject(object, "quantity", event->quantity);
        }
        if (event->packet.kind == MBM_PACKET_EXCEPTION)
            cJSON_AddNumberToObject(object, "exception", event->packet.exceptionCode);
        else if (event->kind != MBM_EVENT_TIMEOUT && !is_malformed)
            add_values(object, event);
    }
    if (event->responseTimeUs)
        add_decimal(object, "response_ms", event->responseTimeUs, 1000);
    cJSON_AddStringToObject(object, "text", text);
    if (event->frameLength > 0)
        add_frame(object, event);
    report_print_json(object);
}

static void print_text(const mbm_event *event, int64_t time)
{
    static char text[2400];
    const unsigned long long ms = (unsigned long long)(time < 0 ? -time : time) / 1000;
    char seconds[32];

    mbm_event_text(event, text, sizeof text);
    snprintf(seconds, sizeof seconds, "%s%llu.%03llu", time < 0 && ms > 0 ? "-" : "", ms / 1000,
             ms % 1000);
    printf("%10s  ", seconds);
    if (event->responseTimeUs)
        printf("%6.1f ms  ", event->responseTimeUs / 1000.0);
    else
        printf("%11s", "");
    printf("%s\n", text);
}

static void print_event(sniff *s, const mbm_event *event)
{
    /* If several frames arrive in the first piece, the first ones ended before `first`. A recording
     * has no time before 1970. */
    const int64_t time = (int64_t)(s->nowUs - s->firstUs) -
                         (int64_t)((uint32_t)s->nowUs - event->timeUs),
                  since_1970 = (int64_t)s->epochUs + time;

    trace_event(event, s->where.framing, s->where.text, since_1970 > 0 ? (uint64_t)since_1970 : 0);
    s->totals[event->kind]++;
    if (event->kind == MBM_EVENT_REPLY && event->responseTimeUs > s->slowest)
        s->slowest = event->responseTimeUs;
    if (options.is_json)
        print_json(event, time, s->epochUs ? (uint64_t)since_1970 : 0);
    else
        print_text(event, time);
}

/* Prints the events that have happened by `time`. */
static void print_events(sniff *s, uint64_t time)
{
    mbm_event event;

    s->nowUs = time;
    while (mbm_sniffer_next(&s->sniffer, (uint32_t)s->nowUs, &event))
        print_event(s, &event);
}

static void feed(sniff *s, const uint8_t *bytes, uint16_t length)
{
    uint16_t fed = 0;

    while (fed < length) {
        fed = (uint16_t)(fed + mbm_sniffer_feed(&s->sniffer, MBM_DIRECTION_BOTH, bytes + fed,
                                                (uint16_t)(length - fed), (uint32_t)s->nowUs));
        print_events(s, s->nowUs);
    }
}

/* --- a line --- */

/* Watches a line until Ctrl-C, or until the reader of the output has gone. Returns an exit code. */
static int watch(sniff *s)
{
    static line at;
    uint8_t bytes[256];
    mbm_port port;
    int code = line_open(&at, &s->where);

    if (code == CODE_DONE && place_is_tcp(&s->where))
        code = line_connect(&at);
    port = place_is_tcp(&s->where) ? mbm_tcp_port(&at.tcp) : mbm_tty_port(&at.tty);
    s->firstUs = clock_micros(CLOCK_MONOTONIC);
    if (code == CODE_DONE)
        s->epochUs = clock_micros(CLOCK_REALTIME);
    while (code == CODE_DONE && !report_stopped && !ferror(stdout)) {
        int length;

        line_wait(&at, -1, LIVE_STEP);
        length = port.read(port.context, bytes, sizeof bytes);
        s->nowUs = clock_micros(CLOCK_MONOTONIC);
        if (length > 0)
            feed(s, bytes, (uint16_t)length);
        else if (length < 0)
            code = report(CODE_LINE, "%s: the line was lost: %s", s->where.text,
                          report_error_text(place_is_tcp(&s->where) ? at.tcp.error : at.tty.error));
        print_events(s, s->nowUs);
        report_flush();
    }
    line_close(&at);
    print_events(s, clock_micros(CLOCK_MONOTONIC));
    return code;
}

/* --- a recording --- */

/* A recording of a bus as text. A line is a time in milliseconds, a colon and bytes in hexadecimal:
 *
 *     120: 11 03 00 6B
 *
 * The time and the colon may be left out. `#` at the beginning of a line makes it a comment. */
typedef struct recording {
    FILE *file;
    unsigned line;   /* the number of the last line, from 1 */
    uint64_t timeUs; /* of the last line */
    uint16_t length;
    uint8_t bytes[RECORDING_BYTES];
} recording;

/* Converts hexadecimal digits to bytes. Returns NULL, or what is wrong with them. */
static const char *read_bytes(const char *text, recording *into)
{
    into->length = 0;
    for (; *text; text++) {
        char pair[3] = {text[0], text[1], 0};

        if (isspace((unsigned char)*text))
            continue;
        if (!isxdigit((unsigned char)pair[0]) || !isxdigit((unsigned char)pair[1]))
            return "bytes are pairs of hexadecimal digits, such as 11 03 00 6B";
        if (into->length == RECORDING_BYTES)
            return "a line has at most 2700 bytes";
        into->bytes[into->length++] = (uint8_t)strtoul(pair, NULL, 16);
        text++;
    }
    return NULL;
}

/* Reads a line. Returns NULL, or what is wrong with it. */
static const char *read_line(char *text, recording *into)
{
    char *hex = strchr(text, ':'), *tail = hex;
    const double time =
        hex ? strtod(text, &tail) * 1000.0 : (double)(into->timeUs + RECORDING_STEP);

    if (tail != hex)
        return "before the colon stands a time in milliseconds";
    if (!(time >= (double)into->timeUs && time < LAST_TIME))
        return "the time is not between that of the line before and 30 years";
    into->timeUs = (uint64_t)time;
    return read_bytes(hex ? hex + 1 : text, into);
}

/* Reads the next line that is no comment. Returns 1, or 0 at the end of the file, or -1 with the
 * reason in `wrong`. */
static int read_record(recording *from, const char **wrong)
{
    char text[3 * RECORDING_BYTES + 64];

    do {
        if (!fgets(text, sizeof text, from->file))
            return 0;
        from->line++;
    } while (text[0] == '#');
    *wrong = read_line(text, from);
    return *wrong ? -1 : 1;
}

/* Lets time pass and prints events, as on a line. */
static void pass_time(sniff *s, uint64_t until)
{
    const uint64_t silent = s->nowUs;

    while (s->nowUs < until) {
        const uint64_t step = s->nowUs - silent < ALL_ENDED ? LOOK_STEP : SELDOM_STEP;

        print_events(s, until - s->nowUs < step ? until : s->nowUs + step);
    }
}

static int replay(sniff *s)
{
    static recording from;
    const char *wrong;
    int found = 0;

    from.file = stdin;
    while (!report_stopped && (found = read_record(&from, &wrong)) > 0) {
        pass_time(s, from.timeUs);
        feed(s, from.bytes, from.length);
    }
    if (ferror(stdin))
        return report(CODE_SYSTEM, "the recording: %s", strerror(errno));
    if (found < 0)
        return report(CODE_WRONG, "line %u of the recording: %s", from.line, wrong);
    pass_time(s, s->nowUs + ALL_ENDED);
    return CODE_DONE;
}

/* --- the command line --- */

enum { BAUD = 0x100, FRAMING, TIMEOUT, FRAME_TIMEOUT };

static void read_place(sniff *s, const struct argp_state *state, const char *text)
{
    s->is_recording = strcmp(text, "-") == 0;
    if (s->is_recording)
        return;
    options_place(state, &s->where, text, 0);
    if (s->where.kind == PLACE_TCP || s->where.kind == PLACE_UDP || s->where.kind == PLACE_TLS)
        options_wrong(state,
                      "%s: a sniffer listens to rtu:, ascii: or rtu+tcp://. Watch connections of "
                      "Modbus TCP with tcpdump or Wireshark on a machine that they pass",
                      text);
}

static error_t parse(int key, char *text, struct argp_state *state)
{
    sniff *s = (sniff *)state->input;
    static const char *const framings[] = {"rtu", "ascii", "tcp", NULL};
    static const uint8_t kinds[] = {MBM_FRAMING_RTU, MBM_FRAMING_ASCII, MBM_FRAMING_TCP};

    switch (key) {
    case BAUD:
        s->where.tty.baud = (uint32_t)options_number(state, "--baud", text, 50, 4000000);
        s->has_recording_options = 1;
        return 0;
    case FRAMING:
        s->where.framing = kinds[options_word(state, "--framing", text, framings)];
        s->has_recording_options = 1;
        return 0;
    case TIMEOUT: s->timeoutMs = options_time(state, "--timeout", text, 1, UINT16_MAX); return 0;
    case FRAME_TIMEOUT:
        s->frameMs = options_time(state, "--frame-timeout", text, 1, UINT16_MAX);
        return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num > 0)
            options_wrong(state, "\"%s\" is one word too many: a sniffer has one LINE", text);
        read_place(s, state, text);
        return 0;
    case ARGP_KEY_END:
        if (state->arg_num == 0)
            options_wrong(state, "LINE is missing: the line to watch, or - for a recording");
        if (!s->is_recording && s->has_recording_options)
            options_wrong(state,
                          "--baud and --framing are for a recording; of a line, its name has "
                          "them, such as rtu:/dev/ttyUSB0?baud=9600");
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option texts[] = {
    {"baud", BAUD, "RATE", 0, "The rate of the recorded line in bits per second (unknown)", 1},
    {"framing", FRAMING, "FRAMING", 0, "The framing of the recording: rtu, ascii or tcp (rtu)", 1},
    {"timeout", TIMEOUT, "TIME", 0, "How long a request may stay unanswered, up to 65s (1s)", 1},
    {"frame-timeout", FRAME_TIMEOUT, "TIME", 0,
     "How long the rest of a frame may take, up to 65s: longer than an adapter holds bytes back",
     1},
    {0}};

static const struct argp_child children[] = {
    {.argp = &options_output}, {.argp = &options_trace}, {0}};
static const struct argp parser = {
    .options = texts,
    .parser = parse,
    .args_doc = "LINE\n-",
    .doc =
        "Decodes what others send on a line, until Ctrl-C. It sends nothing itself.\v"
        "- is a recording on standard input. Each of its lines is a time in milliseconds, a colon and "
        "bytes in hexadecimal, such as \"120: 11 03 00 6B\".\n\n"
        "Example:\n\n"
        "  mbm sniff 'rtu:/dev/ttyUSB0?baud=9600&parity=none'\n\n"
        "A sniffer listens to rtu:, ascii: and rtu+tcp://.\n\n" PLACE_HELP,
    .children = children};

/* --- the command --- */

static void begin(sniff *s)
{
    mbm_sniffer_begin(&s->sniffer, s->where.framing, s->buffer, sizeof s->buffer);
    mbm_sniffer_setBaudRate(&s->sniffer, s->where.tty.baud);
    mbm_sniffer_setResponseTimeout(&s->sniffer, (uint16_t)s->timeoutMs);
    if (s->frameMs > 0)
        mbm_sniffer_setFrameTimeout(&s->sniffer, s->frameMs);
}

int sniff_command(int argc, char **argv)
{
    static sniff data = {.where = {.text = "-", .framing = MBM_FRAMING_RTU}, .timeoutMs = 1000};
    sniff *s = &data;
    int code;

    argp_parse(&parser, argc, argv, 0, NULL, s);
    begin(s);
    code = s->is_recording ? replay(s) : watch(s);
    /* A line that could not be opened has nothing to sum up. */
    if (!options.is_quiet && (code == CODE_DONE || s->epochUs))
        fprintf(stderr,
                "%s: requests: %lu, replies: %lu, exceptions: %lu, unpaired: %lu, timeouts: %lu, "
                "bad CRCs: %lu, noise: %lu times, slowest reply: %.1f ms.\n",
                report_name, s->totals[MBM_EVENT_REQUEST], s->totals[MBM_EVENT_REPLY],
                s->totals[MBM_EVENT_EXCEPTION], s->totals[MBM_EVENT_UNPAIRED],
                s->totals[MBM_EVENT_TIMEOUT], s->totals[MBM_EVENT_BAD_CRC],
                s->totals[MBM_EVENT_NOISE], s->slowest / 1000.0);
    return code == CODE_DONE ? report_code : code;
}
