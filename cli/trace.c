/* Takes the frames of traced ports and sniffers, prints them, and writes them to a file. */
#include "trace.h"

#include "clock.h"
#include "pcap_file.h"
#include "report.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LINKS = 32 };

typedef struct traced {
    char name[64];
    mbm_framing framing;
    mbm_trace trace;
    pcap_link pcap;
    uint8_t buffer[2 * MBM_MAX_ASCII_FRAME];
} traced;

static traced links[LINKS];
static uint32_t link_count;
static int is_printed;
static FILE *pcap;
static const char *pcap_path;

/* Stops writing after an error, and reports it once. A command of a client then ends with
 * CODE_SYSTEM; a service goes on, and ends as if nothing was wrong. */
static void checked(int result)
{
    if (result == 0)
        return;
    (void)report_note(CODE_SYSTEM);
    report_log(REPORT_ERROR, "%s: %s. No more frames are written to it", pcap_path,
               strerror(errno));
    (void)fclose(pcap);
    pcap = NULL;
}

static void print_record(const traced *link, const mbm_traceRecord *record, const char *words,
                         uint64_t time)
{
    char clock[CLOCK_TEXT_BYTES];
    uint16_t i;

    /* Without the date, which has 11 characters, and without the zone. */
    fprintf(stderr, "%.15s  %s  %-8s  %s [", clock_text(time, 6, clock) + 11, link->name,
            record->direction == MBM_TRACE_SENT ? "sent" : "received", words);
    for (i = 0; i < record->length; i++)
        fprintf(stderr, i == 0 ? "%02X" : " %02X", record->bytes[i]);
    fprintf(stderr, "]\n");
}

/* Prints and writes a record. `event` is the sniffer's event that it comes from, or NULL. */
static void take(traced *link, const mbm_traceRecord *record, const mbm_event *event, uint64_t time)
{
    const int decoded = event && link->framing.kind == MBM_FRAMING_ASCII;
    char words[2400];

    if (event)
        mbm_event_text(event, words, sizeof words);
    else if (record->status == MBM_OK)
        mbm_frame_text(&link->framing, record->kind, record->bytes, record->length, words,
                       sizeof words);
    else
        snprintf(words, sizeof words, "%s, %u bytes", pcap_fault(record->status), record->length);
    if (is_printed)
        print_record(link, record, words, time);
    if (pcap)
        checked(pcap_write(pcap, &link->pcap, record, time, decoded));
}

/* The clock of the ports is the monotonic one. */
static void take_frame(void *context, const mbm_traceRecord *record)
{
    const uint32_t age = (uint32_t)clock_micros(CLOCK_MONOTONIC) - record->timeUs;

    take((traced *)context, record, NULL, clock_micros(CLOCK_REALTIME) - age);
}

static void end(void)
{
    uint32_t i;

    for (i = 0; i < link_count; i++)
        (void)mbm_trace_flush(&links[i].trace);
    if (pcap && fclose(pcap) != 0)
        fprintf(stderr, "%s: %s\n", pcap_path, strerror(errno));
    pcap = NULL;
}

void trace_print(void)
{
    if (!is_printed && !pcap)
        atexit(end);
    is_printed = 1;
}

int trace_is_printed(void)
{
    return is_printed;
}

int trace_write(const char *path)
{
    if (!is_printed && !pcap)
        atexit(end);
    pcap_path = path;
    pcap = fopen(path, "wb");
    if (pcap && pcap_start(pcap) == 0)
        return 0;
    if (pcap)
        (void)fclose(pcap);
    pcap = NULL;
    return -1;
}

/* The link of this name, which is added if there is none. NULL if there are too many. */
static traced *link_of(uint8_t framing, const char *name)
{
    traced *link;
    uint32_t i;

    for (i = 0; i < link_count; i++)
        if (strncmp(links[i].name, name, sizeof links[i].name - 1) == 0)
            return &links[i];
    if (link_count == LINKS) {
        fprintf(stderr, "%s is not traced: there are %d links already\n", name, LINKS);
        return NULL;
    }
    link = &links[link_count];
    snprintf(link->name, sizeof link->name, "%s", name);
    link->framing.kind = framing;
    if (pcap)
        checked(pcap_add(pcap, &link->pcap, link_count, framing, link->name));
    link_count++;
    return link;
}

static mbm_port trace(mbm_port port, uint8_t framing, const char *name, int is_server)
{
    traced *const link = pcap || is_printed ? link_of(framing, name) : NULL;
    uint8_t status;

    if (!link)
        return port;
    if (mbm_trace_flush(&link->trace) == MBM_OK)
        pcap_reconnect(&link->pcap);
    status =
        mbm_trace_begin(&link->trace, is_server ? MBM_PACKET_RESPONSE : MBM_PACKET_REQUEST, &port,
                        &link->framing, link->buffer, sizeof link->buffer, take_frame, link);
    return status == MBM_OK ? *mbm_trace_port(&link->trace) : port;
}

mbm_port trace_client(mbm_port port, uint8_t framing, const char *name)
{
    return trace(port, framing, name, 0);
}

mbm_port trace_server(mbm_port port, uint8_t framing, const char *name)
{
    return trace(port, framing, name, 1);
}

void trace_event(const mbm_event *event, uint8_t framing, const char *name, uint64_t time)
{
    traced *const link = pcap || is_printed ? link_of(framing, name) : NULL;
    mbm_traceRecord record;

    if (link && mbm_trace_ofEvent(event, &record) == MBM_OK)
        take(link, &record, event, time);
}
