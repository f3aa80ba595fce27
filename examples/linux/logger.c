/* Logs registers or bits of a device as CSV, one line a sample, and shows the progress.
 *
 *     logger tcp:192.168.0.7 -u 1 -i 500 -n 1000 -o log.csv 100 4
 *
 * reads 4 registers from address 100 on, twice a second, a thousand times. -u is the unit
 * (1), -f the function, 1 to 4 (3), -i the interval in milliseconds (1000), -n the number of
 * samples (until Ctrl-C), -o the file (stdout), -r the number of retries of a sample (2). The
 * line of a failed sample has its status and no values. The progress goes to stderr.
 *
 * Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "line.h"
#include "trace.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { MOST = 125 };

static line at;
static FILE *csv;
static mbm_clientRequest request = MBM_INIT;
static uint16_t reply[MOST];
static long unit = 1, function = 3, interval = 1000, samples;
static uint16_t address, quantity;
static unsigned long taken, failed;
static int unwritten; /* errno of a write to the file that failed */

static void end_line(void)
{
    fputc('\n', csv);
    if (fflush(csv) != 0)
        unwritten = errno;
}

static void write_head(void)
{
    unsigned i;

    fprintf(csv, "time,unit,status");
    for (i = 0; i < quantity; i++)
        fprintf(csv, ",%u", address + i);
    end_line();
}

static void write_sample(const struct timespec *when)
{
    char text[32];
    struct tm utc;
    unsigned i;

    gmtime_r(&when->tv_sec, &utc);
    (void)strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%S", &utc);
    fprintf(csv, "%s.%03ldZ,%ld,%s", text, when->tv_nsec / 1000000, unit,
            line_status(&at, &request));
    for (i = 0; i < quantity; i++) {
        fputc(',', csv);
        if (request.status == MBM_OK)
            fprintf(csv, "%u", line_value(&request, function, i));
    }
    end_line();
}

static void show_progress(void)
{
    char of[32] = "";

    if (samples > 0)
        snprintf(of, sizeof of, " of %ld", samples);
    fprintf(stderr, "%s%lu%s samples, %lu failed%s", isatty(2) ? "\r" : "", taken, of, failed,
            isatty(2) ? "" : "\n");
}

static void take_sample(void)
{
    struct timespec when;

    clock_gettime(CLOCK_REALTIME, &when);
    memset(&request, 0, sizeof request);
    request.unit = (uint8_t)unit;
    request.reply = reply;
    request.replyBytes = sizeof reply;
    (void)line_read(&at, &request, function, address, quantity);
    while (!line_ended && request.status == MBM_PENDING) {
        line_poll(&at);
        if (request.status == MBM_PENDING)
            line_rest(&at, 1000);
    }
    if (request.status == MBM_PENDING)
        return;
    taken++;
    failed += request.status != MBM_OK;
    write_sample(&when);
    show_progress();
}

static const char USAGE[] =
    "logger PLACE [options] ADDRESS QUANTITY\n"
    "  -u UNIT          1 to 255, 1 if left out\n"
    "  -f FUNCTION      1 coils, 2 discrete inputs, 3 holding registers (if left out), 4 input registers\n"
    "  -i MILLISECONDS  from one sample to the next, 1000 if left out\n"
    "  -n SAMPLES       until Ctrl-C if left out\n"
    "  -o FILE          CSV, stdout if left out\n"
    "  -r RETRIES       how often a failed sample is read again, 2 if left out";

int main(int argc, char **argv)
{
    const char *path = NULL;
    long retries = 2;
    uint32_t due;
    int option;

    trace_options(&argc, argv);
    if (line_wants_help(argc, argv))
        return line_usage(0, USAGE);
    while ((option = getopt(argc, argv, "u:f:i:n:o:r:")) != -1) {
        switch (option) {
        case 'u': unit = line_number(optarg, 1, 255); break;
        case 'f': function = line_number(optarg, 1, 4); break;
        case 'i': interval = line_number(optarg, 1, 3600000); break;
        case 'n': samples = line_number(optarg, 1, 1000000000); break;
        case 'o': path = optarg; break;
        case 'r': retries = line_number(optarg, 0, 255); break;
        default: return line_usage(1, USAGE);
        }
    }
    if (argc - optind != 3)
        return line_usage(1, USAGE);
    address = (uint16_t)line_number(argv[optind + 1], 0, 65535);
    quantity = (uint16_t)line_number(argv[optind + 2], 1, MOST);
    if (!line_addresses(address, quantity))
        return line_usage(1, USAGE);
    if (line_open(&at, argv[optind]) != 0)
        return 1;
    csv = path ? fopen(path, "w") : stdout;
    if (!csv) {
        fprintf(stderr, "%s: %s\n", path, strerror(errno));
        return 1;
    }
    mbm_client_setRetries(&at.client, (uint8_t)retries);
    mbm_client_setBackoff(&at.client, MBM_BACKOFF_EXPONENTIAL, 50, 1000);
    write_head();
    due = line_milliseconds();
    while (!line_ended && !unwritten && (samples == 0 || taken < (unsigned long)samples)) {
        take_sample();
        /* If a sample took longer than the interval, the next one follows at once. */
        due += (uint32_t)interval;
        if ((int32_t)(due - line_milliseconds()) < 0)
            due = line_milliseconds();
        while (!line_ended && !unwritten && taken != (unsigned long)samples &&
               (int32_t)(due - line_milliseconds()) > 0) {
            line_poll(&at);
            line_rest(&at, due - line_milliseconds());
        }
    }
    if (isatty(2))
        fputc('\n', stderr);
    line_close(&at);
    if (path && fclose(csv) != 0 && !unwritten)
        unwritten = errno;
    if (unwritten)
        fprintf(stderr, "%s: %s\n", path ? path : "stdout", strerror(unwritten));
    return unwritten ? 1 : 0;
}
