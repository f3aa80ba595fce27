/* Watches a bus, prints one line for each event, and sends nothing: `mbm sniff`.
 *
 * Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "clock.h"
#include "commands.h"
#include "event_json.h"
#include "line.h"
#include "options.h"
#include "recording.h"
#include "report.h"
#include "trace.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

/* Microseconds, except the first. A recording is looked at in short steps while requests may time
 * out, and then in long ones. */
enum {
    KINDS = MBM_EVENT_NOISE + 1,
    LIVE_STEP = 5000,
    LOOK_STEP = 100000,
    ALL_ENDED = 2000000,
    SELDOM_STEP = 600000000
};

static mbm_sniffer sniffer = MBM_INIT;
static uint8_t buffer[MBM_MAX_ASCII_FRAME];
static unsigned long totals[KINDS];
static uint64_t first, now; /* microseconds that do not wrap, unlike the sniffer's */
static uint64_t epoch;      /* the time of `first`, since 1970; of a recording 0 */
static uint32_t slowest;

/* What the command line says. A recording has no place but its name. */
static place where = {.text = "-", .framing = MBM_FRAMING_RTU};
static uint32_t timeoutMs = 1000, frameMs; /* 0: the default of the sniffer */
static int is_recording, has_recording_options;

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

static void print_event(const mbm_event *event)
{
    /* Of several frames that arrive in the first piece, the first ones ended before it began to be
     * counted. A recording has no time before 1970. */
    const int64_t time = (int64_t)(now - first) - (int64_t)((uint32_t)now - event->timeUs),
                  since_1970 = (int64_t)epoch + time;

    trace_event(event, where.framing, where.text, since_1970 > 0 ? (uint64_t)since_1970 : 0);
    totals[event->kind]++;
    if (event->kind == MBM_EVENT_REPLY && event->responseTimeUs > slowest)
        slowest = event->responseTimeUs;
    if (options.is_json)
        event_json_print(event, time, epoch ? (uint64_t)since_1970 : 0);
    else
        print_text(event, time);
}

/* Prints the events that have happened by `time`. */
static void print_events(uint64_t time)
{
    mbm_event event;

    now = time;
    while (mbm_sniffer_next(&sniffer, (uint32_t)now, &event))
        print_event(&event);
}

static void feed(const uint8_t *bytes, uint16_t length)
{
    uint16_t fed = 0;

    while (fed < length) {
        fed = (uint16_t)(fed + mbm_sniffer_feed(&sniffer, MBM_DIRECTION_BOTH, bytes + fed,
                                                (uint16_t)(length - fed), (uint32_t)now));
        print_events(now);
    }
}

/* Watches a line until Ctrl-C, or until the reader of the output has gone. Returns an exit code. */
static int watch(void)
{
    static line at;
    uint8_t bytes[256];
    mbm_port port;
    int code = line_open(&at, &where);

    if (code == CODE_DONE && place_is_tcp(&where))
        code = line_connect(&at);
    port = place_is_tcp(&where) ? mbm_tcp_port(&at.tcp) : mbm_tty_port(&at.tty);
    first = clock_micros(CLOCK_MONOTONIC);
    if (code == CODE_DONE)
        epoch = clock_micros(CLOCK_REALTIME);
    while (code == CODE_DONE && !report_stopped && !ferror(stdout)) {
        int length;

        line_wait(&at, -1, LIVE_STEP);
        length = port.read(port.context, bytes, sizeof bytes);
        now = clock_micros(CLOCK_MONOTONIC);
        if (length > 0)
            feed(bytes, (uint16_t)length);
        else if (length < 0)
            code = report(CODE_LINE, "%s: the line was lost: %s", where.text,
                          report_error_text(place_is_tcp(&where) ? at.tcp.error : at.tty.error));
        print_events(now);
        report_flush();
    }
    line_close(&at);
    print_events(clock_micros(CLOCK_MONOTONIC));
    return code;
}

/* Lets time pass and prints events, as on a line. */
static void pass_time(uint64_t until)
{
    const uint64_t silent = now;

    while (now < until) {
        const uint64_t step = now - silent < ALL_ENDED ? LOOK_STEP : SELDOM_STEP;

        print_events(until - now < step ? until : now + step);
    }
}

static int replay(void)
{
    static recording from;
    const char *wrong;
    int found = 0;

    from.file = stdin;
    while (!report_stopped && (found = recording_next(&from, &wrong)) > 0) {
        pass_time(from.time);
        feed(from.bytes, from.length);
    }
    if (ferror(stdin))
        return report(CODE_SYSTEM, "the recording: %s", strerror(errno));
    if (found < 0)
        return report(CODE_WRONG, "line %u of the recording: %s", from.line, wrong);
    pass_time(now + ALL_ENDED);
    return CODE_DONE;
}

static void begin(void)
{
    mbm_sniffer_begin(&sniffer, where.framing, buffer, sizeof buffer);
    mbm_sniffer_setBaudRate(&sniffer, where.tty.baud);
    mbm_sniffer_setResponseTimeout(&sniffer, (uint16_t)timeoutMs);
    if (frameMs > 0)
        mbm_sniffer_setFrameTimeout(&sniffer, frameMs);
}

/* --- the command line --- */

enum { BAUD = 0x100, FRAMING, TIMEOUT, FRAME_TIMEOUT };

static void read_place(const struct argp_state *state, const char *text)
{
    is_recording = strcmp(text, "-") == 0;
    if (is_recording)
        return;
    options_place(state, &where, text, 0);
    if (where.kind == PLACE_TCP || where.kind == PLACE_UDP || where.kind == PLACE_TLS)
        options_wrong(state,
                      "%s: a sniffer listens to rtu:, ascii: or rtu+tcp://. Watch connections of "
                      "Modbus TCP with tcpdump or Wireshark on a machine that they pass",
                      text);
}

static error_t parse(int key, char *text, struct argp_state *state)
{
    static const char *const framings[] = {"rtu", "ascii", "tcp", NULL};
    static const uint8_t kinds[] = {MBM_FRAMING_RTU, MBM_FRAMING_ASCII, MBM_FRAMING_TCP};

    switch (key) {
    case BAUD:
        where.tty.baud = (uint32_t)options_number(state, "--baud", text, 50, 4000000);
        has_recording_options = 1;
        return 0;
    case FRAMING:
        where.framing = kinds[options_word(state, "--framing", text, framings)];
        has_recording_options = 1;
        return 0;
    case TIMEOUT: timeoutMs = options_time(state, "--timeout", text, 1, UINT16_MAX); return 0;
    case FRAME_TIMEOUT:
        frameMs = options_time(state, "--frame-timeout", text, 1, UINT16_MAX);
        return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num > 0)
            options_wrong(state, "\"%s\" is one word too many: a sniffer has one LINE", text);
        read_place(state, text);
        return 0;
    case ARGP_KEY_END:
        if (state->arg_num == 0)
            options_wrong(state, "LINE is missing: the line to watch, or - for a recording");
        if (!is_recording && has_recording_options)
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
    {NULL, 0, NULL, 0, NULL, 0}};

static const struct argp_child children[] = {
    {&options_output, 0, NULL, 0}, {&options_trace, 0, NULL, 0}, {NULL, 0, NULL, 0}};
static const struct argp parser = {
    texts,
    parse,
    "LINE\n-",
    "Decodes what others send on a line, until Ctrl-C. It sends nothing itself.\v"
    "- is a recording on standard input. Each of its lines is a time in milliseconds, a colon and "
    "bytes in hexadecimal, such as \"120: 11 03 00 6B\".\n\n"
    "Example:\n\n"
    "  mbm sniff 'rtu:/dev/ttyUSB0?baud=9600&parity=none'\n\n"
    "A sniffer listens to rtu:, ascii: and rtu+tcp://.\n\n" PLACE_HELP,
    children,
    NULL,
    NULL};

int sniff_command(int argc, char **argv)
{
    int code;

    argp_parse(&parser, argc, argv, 0, NULL, NULL);
    begin();
    code = is_recording ? replay() : watch();
    /* A line that could not be opened has nothing to sum up. */
    if (!options.is_quiet && (code == CODE_DONE || epoch))
        fprintf(stderr,
                "%s: requests: %lu, replies: %lu, exceptions: %lu, unpaired: %lu, timeouts: %lu, "
                "bad CRCs: %lu, noise: %lu times, slowest reply: %.1f ms.\n",
                report_name, totals[MBM_EVENT_REQUEST], totals[MBM_EVENT_REPLY],
                totals[MBM_EVENT_EXCEPTION], totals[MBM_EVENT_UNPAIRED], totals[MBM_EVENT_TIMEOUT],
                totals[MBM_EVENT_BAD_CRC], totals[MBM_EVENT_NOISE], slowest / 1000.0);
    return code == CODE_DONE ? report_code : code;
}
