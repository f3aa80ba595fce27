/* Watches a bus that others use, and tells what they say, one line an event.
 *
 *     sniff /dev/ttyUSB0 19200          a serial line, RTU; Ctrl-C ends
 *     sniff -a /dev/ttyUSB0 9600 E      ASCII, even parity
 *     sniff - <recording                a recording, -t for Modbus TCP
 *
 * A line of a recording is a time in milliseconds with a colon, which may be
 * missing (10 ms after the line before), and bytes in hex: "120: 11 03 00 6B".
 *
 * Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "mbm_tty.h"

#include <ctype.h>
#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { LINE_STEP = 10000, KINDS = MBM_EVENT_NOISE + 1, ALL_ENDED = 2000000 };

static mbm_sniffer sniffer;
static uint8_t buffer[MBM_MAX_ASCII_FRAME];
static unsigned long totals[KINDS];
static uint32_t first, slowest;
static volatile sig_atomic_t ended;

static void end(int signal_number)
{
    (void)signal_number;
    ended = 1;
}

static uint32_t micros(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)now.tv_sec * 1000000u + (uint32_t)now.tv_nsec / 1000u;
}

static void tell(const mbm_event *event)
{
    static char text[2400];
    uint32_t time = event->time - first;

    totals[event->kind]++;
    if (event->kind == MBM_EVENT_REPLY && event->responseTime > slowest)
        slowest = event->responseTime;
    mbm_event_text(event, text, sizeof text);
    printf("%6lu.%03lu  ", (unsigned long)(time / 1000000u),
           (unsigned long)(time / 1000u % 1000u));
    if (event->responseTime)
        printf("%6.1f ms  ", event->responseTime / 1000.0);
    else
        printf("%11s", "");
    printf("%s\n", text);
}

static void tell_all(uint32_t now)
{
    mbm_event event;

    while (mbm_sniffer_next(&sniffer, now, &event))
        tell(&event);
    fflush(stdout);
}

static void hear(const uint8_t *bytes, uint16_t length, uint32_t now)
{
    uint16_t fed = 0;

    while (fed < length) {
        fed = (uint16_t)(fed + mbm_sniffer_feed(&sniffer, MBM_TAP_BOTH, bytes + fed,
                                                (uint16_t)(length - fed), now));
        tell_all(now);
    }
}

static int watch(const char *path, uint32_t baud, char parity)
{
    mbm_tty tty;
    uint8_t bytes[256];
    ssize_t length;

    if (mbm_tty_open(&tty, path, baud, parity, 1) != 0) {
        perror(path);
        return 1;
    }
    first = micros();
    while (!ended) {
        struct pollfd line = {tty.fd, POLLIN, 0};

        poll(&line, 1, 5);
        length = read(tty.fd, bytes, sizeof bytes);
        if (length > 0)
            hear(bytes, (uint16_t)length, micros());
        else if (length == 0 || (errno != EAGAIN && errno != EINTR))
            break;
        tell_all(micros());
    }
    mbm_tty_close(&tty);
    tell_all(micros());
    return 0;
}

/* The bytes of hex digits; -1 if there is anything else. */
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

static int replay(void)
{
    char text[8192];
    uint8_t bytes[2700];
    uint32_t now = 0;
    unsigned number = 0;
    int length;

    while (!ended && fgets(text, sizeof text, stdin)) {
        char *hex = strchr(text, ':');

        number++;
        if (text[0] == '#')
            continue;
        now = hex ? (uint32_t)(strtod(text, NULL) * 1000.0) : now + LINE_STEP;
        tell_all(now);
        length = bytes_of(hex ? hex + 1 : text, bytes, sizeof bytes);
        if (length < 0) {
            fprintf(stderr, "line %u: not hex\n", number);
            return 1;
        }
        hear(bytes, (uint16_t)length, now);
    }
    tell_all(now + ALL_ENDED);
    return 0;
}

static int usage(int wrong)
{
    fprintf(wrong ? stderr : stdout,
            "usage: sniff [-a] path baud [N|E|O]   or   sniff [-a|-t] -\n"
            "  -a  ASCII frames, -t TCP frames; else RTU\n"
            "  -   a recording from stdin\n");
    return wrong ? 2 : 0;
}

int main(int argc, char **argv)
{
    struct sigaction action = {0};
    mbm_framing framing = {0};
    int option, failed;
    uint32_t baud = 0;

    if (argc > 1 && strcmp(argv[1], "--help") == 0)
        return usage(0);
    while ((option = getopt(argc, argv, "aht")) != -1) {
        if (option == '?' || option == 'h')
            return usage(option == '?');
        framing.kind = option == 'a' ? MBM_FRAMING_ASCII : MBM_FRAMING_TCP;
    }
    argc -= optind;
    argv += optind;
    if (argc < 1 || (argc < 2 && strcmp(argv[0], "-") != 0))
        return usage(1);
    if (argc > 1)
        baud = (uint32_t)strtoul(argv[1], NULL, 10);
    action.sa_handler = end;
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    mbm_sniffer_begin(&sniffer, &framing, buffer, sizeof buffer);
    mbm_sniffer_setBaudRate(&sniffer, baud);
    if (strcmp(argv[0], "-") == 0)
        failed = replay();
    else
        failed = watch(argv[0], baud, argc > 2 ? argv[2][0] : 'N');
    printf("%lu requests, %lu replies, %lu exceptions, %lu unpaired, %lu timeouts, %lu bad CRCs, "
           "noise %lu times; slowest reply %.1f ms\n",
           totals[MBM_EVENT_REQUEST], totals[MBM_EVENT_REPLY], totals[MBM_EVENT_EXCEPTION],
           totals[MBM_EVENT_UNPAIRED], totals[MBM_EVENT_TIMEOUT], totals[MBM_EVENT_BAD_CRC],
           totals[MBM_EVENT_NOISE], slowest / 1000.0);
    return failed;
}
