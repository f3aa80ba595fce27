/* Scans a bus for units: reads holding register 0 of each. A unit that answers with a value
 * or an exception is present.
 *
 *     scan rtu:/dev/ttyUSB0,19200
 *     scan tcp:192.168.0.7 -t 2000 1 20
 *
 * scans the units 1 to 247, or those that are given. -t is the response timeout in
 * milliseconds: 100 on a serial line, 1000 over TCP, where a gateway may be in between. -p is
 * the number of requests under way at once over TCP (16). The progress goes to stderr.
 *
 * Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "line.h"
#include "trace.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { UNITS = 256 };

static line at;
static mbm_clientRequest requests[UNITS] = MBM_INIT;
static uint16_t words[UNITS];
static unsigned first = 1, last = 247, asked, reported, answering;

static void print_result(const mbm_clientRequest *request)
{
    unsigned unit = request->unit;

    switch (request->status) {
    case MBM_OK: printf("unit %3u: holding register 0 is %u\n", unit, words[unit]); break;
    case MBM_RESPONSE_TIMED_OUT:
    case MBM_GATEWAY_PATH_UNAVAILABLE:
    case MBM_GATEWAY_TARGET_FAILED_TO_RESPOND: return;
    case MBM_INVALID_CRC:
    case MBM_MALFORMED_REPLY:
        printf("unit %3u: %s; two with one address?\n", unit, mbm_status_text(request->status));
        break;
    default:
        printf("unit %3u: %s\n", unit, mbm_status_textOf(request->status, request->exception));
        answering += request->exception != 0;
        fflush(stdout);
        return;
    }
    answering++;
    fflush(stdout);
}

static const char USAGE[] =
    "scan PLACE [options] [FIRST [LAST]]\n"
    "  -t MILLISECONDS  for each unit; 100 on a serial line, 1000 over TCP if left out\n"
    "  -p REQUESTS      at once over TCP, 16 if left out\n"
    "FIRST to LAST are units, 1 to 247 if left out";

/* Keeps the queue full, and prints the results in the order of the units. */
static int scan(void)
{
    while (!line_ended && reported <= last) {
        while (asked <= last) {
            mbm_clientRequest *request = &requests[asked];

            request->unit = (uint8_t)asked;
            request->reply = &words[asked];
            request->replyBytes = sizeof words[asked];
            if (mbm_client_readHoldingRegisters(&at.client, request, 0, 1) != MBM_PENDING)
                break;
            asked++;
        }
        line_poll(&at);
        while (reported < asked && requests[reported].status != MBM_PENDING) {
            if (isatty(2))
                fprintf(stderr, "\r%u of %u \r", reported - first + 1, last - first + 1);
            if (requests[reported].status == MBM_LINK_LOST ||
                requests[reported].status == MBM_CONNECT_TIMED_OUT) {
                fprintf(stderr, "unit %u: the link was lost: %s\n", reported, line_reason(&at));
                return -1;
            }
            print_result(&requests[reported++]);
        }
        if (reported <= last)
            line_rest(&at, 1000);
    }
    return 0;
}

int main(int argc, char **argv)
{
    long timeout = 0, at_once = 0;
    int option, lost;

    trace_options(&argc, argv);
    if (line_wants_help(argc, argv))
        return line_usage(0, USAGE);
    while ((option = getopt(argc, argv, "t:p:")) != -1) {
        if (option == '?')
            return line_usage(1, USAGE);
        if (option == 'p')
            at_once = line_number(optarg, 1, MBM_CLIENT_DEPTH);
        else
            timeout = line_number(optarg, 1, 65535);
    }
    argc -= optind;
    argv += optind;
    if (argc < 1 || argc > 3)
        return line_usage(1, USAGE);
    if (argc > 1)
        first = last = (unsigned)line_number(argv[1], 1, 255);
    if (argc > 2)
        last = (unsigned)line_number(argv[2], (long)first, 255);
    if (line_open(&at, argv[0]) != 0)
        return 1;
    if (line_connect(&at) != 0)
        return 1;
    if (at_once)
        (void)mbm_client_setInFlight(&at.client, (uint8_t)at_once);
    asked = reported = first;
    if (timeout == 0)
        timeout = at.is_tcp ? 1000 : 100;
    mbm_client_setResponseTimeout(&at.client, (uint16_t)timeout);
    mbm_client_setQuietTime(&at.client, 0);
    lost = scan();
    printf("%u of %u units answer\n", answering, reported - first);
    line_close(&at);
    return lost ? 1 : 0;
}
