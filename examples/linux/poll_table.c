/* Polls a device and shows its values as a table, which a terminal shows in place.
 *
 *     poll_table rtu:/dev/ttyUSB0,19200 -u 17 100 10 200 4
 *     poll_table tcp:192.168.0.7 -f 4 -i 250 0 20
 *
 * The first reads 10 registers from address 100 on and 4 from 200 on, every second. -u is the
 * unit (1), -f the function, 1 to 4 (3), -i the interval in milliseconds (1000), -n the number
 * of rounds (until Ctrl-C), -p the number of requests under way at once over TCP (16; some
 * servers accept only one). Values that have changed since the round before are marked.
 *
 * Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "line.h"
#include "trace.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { MOST = 125 };

/* A range of addresses, which one request reads. All requests of a round are queued at once. */
typedef struct range {
    mbm_clientRequest request;
    uint16_t address, quantity;
    uint16_t reply[MOST], before[MOST];
    uint8_t has_before;
} range;

static line at;
static range ranges[MBM_CLIENT_DEPTH];
static unsigned count;
static long unit = 1, function = 3, interval = 1000, rounds, at_once;

static void show_range(range *r)
{
    unsigned i;

    if (r->request.status != MBM_OK) {
        printf("  %7u    %s\n", r->address, line_status(&at, &r->request));
        return;
    }
    for (i = 0; i < r->quantity; i++) {
        uint16_t value = line_value(&r->request, function, i);
        char mark = r->has_before && value != r->before[i] ? '*' : ' ';

        if (function > 2)
            printf("%c %7u  %6u  %04X  %6d\n", mark, r->address + i, value, value, (int16_t)value);
        else
            printf("%c %7u  %6u\n", mark, r->address + i, value);
        r->before[i] = value;
    }
    r->has_before = 1;
}

static void show(long round)
{
    unsigned i, answered = 0;

    for (i = 0; i < count; i++)
        answered += ranges[i].request.status == MBM_OK;
    if (isatty(1))
        printf("\033[H\033[J");
    printf("unit %ld, %s, round %ld: %u of %u requests answered\n", unit, line_tables(function),
           round, answered, count);
    for (i = 0; i < count; i++)
        show_range(&ranges[i]);
    fflush(stdout);
}

static void queue_range(range *r)
{
    memset(&r->request, 0, sizeof r->request);
    r->request.unit = (uint8_t)unit;
    r->request.reply = r->reply;
    r->request.replyBytes = sizeof r->reply;
    (void)line_read(&at, &r->request, function, r->address, r->quantity);
}

static const char USAGE[] =
    "poll_table PLACE [options] ADDRESS QUANTITY...\n"
    "  -u UNIT          1 to 255, 1 if left out\n"
    "  -f FUNCTION      1 coils, 2 discrete inputs, 3 holding registers (if left out), 4 input registers\n"
    "  -i MILLISECONDS  from one round to the next, 1000 if left out\n"
    "  -n ROUNDS        until Ctrl-C if left out\n"
    "  -p REQUESTS      at once over TCP, 16 if left out";

int main(int argc, char **argv)
{
    uint32_t due;
    unsigned i;
    int option;
    long round;

    trace_options(&argc, argv);
    if (line_wants_help(argc, argv))
        return line_usage(0, USAGE);
    while ((option = getopt(argc, argv, "u:f:i:n:p:")) != -1) {
        switch (option) {
        case 'u': unit = line_number(optarg, 1, 255); break;
        case 'f': function = line_number(optarg, 1, 4); break;
        case 'i': interval = line_number(optarg, 1, 3600000); break;
        case 'n': rounds = line_number(optarg, 1, 1000000000); break;
        case 'p': at_once = line_number(optarg, 1, MBM_CLIENT_DEPTH); break;
        default: return line_usage(1, USAGE);
        }
    }
    if (argc - optind < 3 || (argc - optind) % 2 == 0 || argc - optind > 1 + 2 * MBM_CLIENT_DEPTH)
        return line_usage(1, USAGE);
    for (i = (unsigned)optind + 1; i < (unsigned)argc; i += 2, count++) {
        ranges[count].address = (uint16_t)line_number(argv[i], 0, 65535);
        ranges[count].quantity = (uint16_t)line_number(argv[i + 1], 1, MOST);
        if (!line_addresses(ranges[count].address, ranges[count].quantity))
            return line_usage(1, USAGE);
    }
    if (line_open(&at, argv[optind]) != 0)
        return 1;
    if (at_once)
        (void)mbm_client_setInFlight(&at.client, (uint8_t)at_once);

    due = line_milliseconds();
    for (round = 1; !line_ended && (rounds == 0 || round <= rounds); round++) {
        for (i = 0; i < count; i++)
            queue_range(&ranges[i]);
        while (!line_ended && mbm_client_pending(&at.client) > 0) {
            line_poll(&at);
            if (mbm_client_pending(&at.client) > 0)
                line_rest(&at, 1000);
        }
        if (line_ended)
            break;
        show(round);
        due += (uint32_t)interval;
        while (!line_ended && round != rounds && (int32_t)(due - line_milliseconds()) > 0) {
            line_poll(&at);
            line_rest(&at, due - line_milliseconds());
        }
    }
    line_close(&at);
    return 0;
}
