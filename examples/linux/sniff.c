/* Watches a bus, prints one line for each event, and sends nothing.
 *
 *     sniff /dev/ttyUSB0 19200          a serial line, RTU; Ctrl-C ends
 *     sniff -a /dev/ttyUSB0 9600 E      ASCII, seven bits, even parity
 *     sniff - <recording                a recording, -t for Modbus TCP
 *
 * A line of a recording is a time in milliseconds, a colon and bytes in hex, for example
 * "120: 11 03 00 6B". Without time and colon it is 10 ms after the line before.
 *
 * Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "mbm_tty.h"
#include "trace.h"

#include <ctype.h>
#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

/* Microseconds, except the first. */
enum {
    KINDS = MBM_EVENT_NOISE + 1,
    LINE_STEP = 10000,
    LOOK_STEP = 100000,
    ALL_ENDED = 2000000,
    SELDOM_STEP = 600000000
};

static mbm_sniffer sniffer = MBM_INIT;
static uint8_t buffer[MBM_MAX_ASCII_FRAME];
static unsigned long totals[KINDS];
static uint64_t first, now; /* microseconds that do not wrap, unlike the sniffer's */
static uint64_t epoch;      /* the time of `first`, since 1970; of a recording 0 */
static const char *bus;
static uint8_t framing = MBM_FRAMING_RTU;
static uint32_t slowest;
static volatile sig_atomic_t ended;

static void end(int signal_number)
{
    (void)signal_number;
    ended = 1;
}

static uint64_t micros(clockid_t clock)
{
    struct timespec time;

    clock_gettime(clock, &time);
    return (uint64_t)time.tv_sec * 1000000u + (uint64_t)time.tv_nsec / 1000u;
}

static void print_event(const mbm_event *event)
{
    static char text[2400];
    uint64_t time = now - ((uint32_t)now - event->timeUs) - first;

    trace_event(event, framing, bus, epoch + time);
    totals[event->kind]++;
    if (event->kind == MBM_EVENT_REPLY && event->responseTimeUs > slowest)
        slowest = event->responseTimeUs;
    mbm_event_text(event, text, sizeof text);
    printf("%6llu.%03llu  ", (unsigned long long)(time / 1000000u),
           (unsigned long long)(time / 1000u % 1000u));
    if (event->responseTimeUs)
        printf("%6.1f ms  ", event->responseTimeUs / 1000.0);
    else
        printf("%11s", "");
    printf("%s\n", text);
}

/* Prints the events that have happened by `time`. */
static void print_events(uint64_t time)
{
    mbm_event event;

    now = time;
    while (mbm_sniffer_next(&sniffer, (uint32_t)now, &event))
        print_event(&event);
    fflush(stdout);
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

/* Returns 0 after Ctrl-C, 1 if the line was lost, -1 if it could not be opened. */
static int watch(const char *path, const mbm_tty_options *options)
{
    mbm_tty tty = MBM_INIT;
    uint8_t bytes[256];
    ssize_t length;
    int failed = 0;

    if (mbm_tty_openWith(&tty, path, options) != 0) {
        perror(path);
        return -1;
    }
    first = micros(CLOCK_MONOTONIC);
    epoch = micros(CLOCK_REALTIME);
    while (!ended) {
        struct pollfd line = {tty.fd, POLLIN, 0};

        poll(&line, 1, 5);
        length = read(tty.fd, bytes, sizeof bytes);
        now = micros(CLOCK_MONOTONIC);
        if (length > 0) {
            feed(bytes, (uint16_t)length);
        } else if (length == 0 || (errno != EAGAIN && errno != EINTR)) {
            fprintf(stderr, "%s: %s\n", path, length == 0 ? "the line hung up" : strerror(errno));
            failed = 1;
            break;
        }
        print_events(now);
    }
    mbm_tty_close(&tty);
    print_events(micros(CLOCK_MONOTONIC));
    return failed;
}

/* Converts hex digits to bytes. Returns how many, or -1 if there are other characters. */
static int bytes_of(const char *text, uint8_t *bytes, int capacity)
{
    int count = 0;

    for (; *text; text++) {
        char pair[3] = {text[0], text[1], 0};

        if (isspace((unsigned char)*text))
            continue;
        if (!isxdigit((unsigned char)pair[0]) || !isxdigit((unsigned char)pair[1]) ||
            count == capacity)
            return -1;
        bytes[count++] = (uint8_t)strtoul(pair, NULL, 16);
        text++;
    }
    return count;
}

/* Lets time pass and prints events, as on a line: in short steps while requests may time out. */
static void pass_time(uint64_t until)
{
    uint64_t silent = now;

    while (now < until) {
        uint64_t step = now - silent < ALL_ENDED ? LOOK_STEP : SELDOM_STEP;

        print_events(until - now < step ? until : now + step);
    }
}

static int replay(void)
{
    char text[8192];
    uint8_t bytes[2700];
    unsigned number = 0;
    int length;

    while (!ended && fgets(text, sizeof text, stdin)) {
        char *hex = strchr(text, ':'), *tail = hex;
        double line_time = hex ? strtod(text, &tail) * 1000.0 : (double)(now + LINE_STEP);

        number++;
        if (text[0] == '#')
            continue;
        if (tail != hex || !(line_time >= (double)now && line_time < 1e15)) {
            fprintf(stderr, "line %u: no time, or a time before that of the line before\n", number);
            return 1;
        }
        pass_time((uint64_t)line_time);
        length = bytes_of(hex ? hex + 1 : text, bytes, sizeof bytes);
        if (length < 0) {
            fprintf(stderr, "line %u: not hex\n", number);
            return 1;
        }
        feed(bytes, (uint16_t)length);
    }
    pass_time(now + ALL_ENDED);
    return 0;
}

static int usage(int wrong)
{
    fprintf(wrong ? stderr : stdout,
            "usage: sniff [-a] path baud [N|E|O]   or   sniff [-a|-t] - [baud]\n"
            "  -a  ASCII frames, -t TCP frames; else RTU\n"
            "  -   a recording from stdin\n" TRACE_HELP);
    return wrong ? 2 : 0;
}

/* Returns a baud rate, or 0 for text that is no number and for a number that is too large. */
static uint32_t rate_of(const char *text)
{
    char *rest;
    unsigned long baud = strtoul(text, &rest, 10);

    return isdigit((unsigned char)text[0]) && !*rest && baud <= UINT32_MAX ? (uint32_t)baud : 0;
}

/* Reads PATH BAUD [PARITY], or - [BAUD] for a recording. Returns whether a line can be set so. */
static int read_line(int argc, char **argv, mbm_tty_options *options)
{
    struct termios unused = {0};

    options->baud = argc > 1 ? rate_of(argv[1]) : 0;
    if (argc == 1 || options->baud == 0)
        return argc == 1 && strcmp(argv[0], "-") == 0;
    if (argc > 2)
        options->parity = argv[2][0] && !argv[2][1] ? argv[2][0] : '?';
    if (strcmp(argv[0], "-") == 0)
        return argc == 2;
    return argc <= 3 && mbm_tty_settings(&unused, options) == 0;
}

int main(int argc, char **argv)
{
    mbm_tty_options options = {.parity = 'N', .stop = 1};
    struct sigaction action = {0};
    int option, failed;

    trace_options(&argc, argv);
    if (argc > 1 && strcmp(argv[1], "--help") == 0)
        return usage(0);
    while ((option = getopt(argc, argv, "aht")) != -1) {
        if (option == '?' || option == 'h')
            return usage(option == '?');
        framing = option == 'a' ? MBM_FRAMING_ASCII : MBM_FRAMING_TCP;
    }
    argc -= optind;
    argv += optind;
    options.data = framing == MBM_FRAMING_ASCII ? 7 : 8;
    if (argc < 1 || !read_line(argc, argv, &options))
        return usage(1);
    bus = argv[0];
    action.sa_handler = end;
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    if (framing == MBM_FRAMING_TCP)
        mbm_sniffer_beginTcp(&sniffer, buffer, sizeof buffer);
    else if (framing == MBM_FRAMING_ASCII)
        mbm_sniffer_beginAscii(&sniffer, buffer, sizeof buffer);
    else
        mbm_sniffer_beginRtu(&sniffer, buffer, sizeof buffer);
    mbm_sniffer_setBaudRate(&sniffer, options.baud);
    if (strcmp(argv[0], "-") == 0)
        failed = replay();
    else
        failed = watch(argv[0], &options);
    if (failed < 0)
        return 1;
    printf("%lu requests, %lu replies, %lu exceptions, %lu unpaired, %lu timeouts, %lu bad CRCs, "
           "noise %lu times; slowest reply %.1f ms\n",
           totals[MBM_EVENT_REQUEST], totals[MBM_EVENT_REPLY], totals[MBM_EVENT_EXCEPTION],
           totals[MBM_EVENT_UNPAIRED], totals[MBM_EVENT_TIMEOUT], totals[MBM_EVENT_BAD_CRC],
           totals[MBM_EVENT_NOISE], slowest / 1000.0);
    return failed;
}
