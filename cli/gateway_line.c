#define _GNU_SOURCE
#include "gateway_line.h"

#include "advice.h"
#include "clock.h"
#include "numbers.h"
#include "report.h"
#include "terminal.h"
#include "trace.h"

#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* A lookup of a host may block the gateway, so there is a longer pause between two of them. */
enum { REOPEN_MS = 1000, LOOKUP_MS = 10000 };

/* The gateway reports a line after this number of requests in a row without a right reply. */
enum { SILENT_AFTER = 5 };

static uint32_t micros(void)
{
    return (uint32_t)clock_micros(CLOCK_MONOTONIC);
}

/* --- the link --- */

/* Keeps a descriptor for a line that is not open. Without it, a new connection could take the
 * line's descriptor, and the line could not be opened again. */
static void keep_reserve(gateway_line *line)
{
    int fd = line->reserve ? 0 : open("/dev/null", O_RDONLY | O_CLOEXEC);

    if (fd > 0)
        line->reserve = fd;
}

static void free_reserve(gateway_line *line)
{
    if (line->reserve)
        close(line->reserve);
    line->reserve = 0;
}

static void close_line(void *context)
{
    gateway_line *line = (gateway_line *)context;

    if (place_is_tcp(&line->place))
        mbm_tcp_disconnect(&line->tcp);
    else
        mbm_tty_close(&line->tty);
    keep_reserve(line);
}

static uint8_t link_status(void *context)
{
    gateway_line *line = (gateway_line *)context;

    if (place_is_tcp(&line->place))
        return mbm_tcp_status(&line->tcp);
    return line->tty.isOpen ? MBM_OK : MBM_LINK_LOST;
}

/* Looks a host up, and begins to connect. */
static uint8_t open_tcp(gateway_line *line)
{
    mbm_tcp *tcp = &line->tcp;

    if (mbm_tcp_isInUse(tcp))
        return mbm_tcp_connect(tcp);
    if (tcp->lookupError && micros() - line->looked_up < LOOKUP_MS * 1000u)
        return MBM_LINK_LOST;
    if (mbm_tcp_open(tcp, &line->addresses, line->place.host, line->place.service) == 0)
        return mbm_tcp_status(tcp);
    tcp->error = errno;
    line->looked_up = micros();
    return MBM_LINK_LOST;
}

static uint8_t open_line(void *context)
{
    gateway_line *line = (gateway_line *)context;

    line->tried = micros();
    free_reserve(line);
    if (place_is_tcp(&line->place))
        return open_tcp(line);
    if (terminal_open(&line->tty, &line->place) == 0)
        return MBM_OK;
    line->tty.error = errno;
    return MBM_LINK_LOST;
}

/* Whether a loss harms nobody, unless the line cannot be opened again: a device has closed a
 * connection over which it has answered, or which was idle. */
static int is_harmless(const gateway_line *line, uint8_t event)
{
    return event == MBM_LINK_EVENT_LOST && place_is_tcp(&line->place) &&
           (line->counters.replies != line->opened.replies ||
            line->counters.requests == line->opened.requests);
}

/* A device is connected to anew, since no byte came. That is reported if it has answered over this
 * connection: of one that never answered, gateway_line_watch reports that. */
static void take_silence(gateway_line *line)
{
    if (line->counters.replies == line->opened.replies)
        return;
    if (!line->is_replaced)
        report_log(REPORT_WARNING,
                   "%s: no byte came after %u requests in a row. The connection is made anew, now "
                   "and each time that this happens",
                   line->place.text, line->replace_after);
    line->is_replaced = 1;
}

/* Prints why a line was lost or not opened, once for each reason. */
static void on_link(void *context, uint8_t event, uint8_t status)
{
    gateway_line *line = (gateway_line *)context;
    const int error = place_is_tcp(&line->place) ? line->tcp.error : line->tty.error;
    const char *reason = line->tcp.lookupError ? gai_strerror(line->tcp.lookupError)
                         : status == MBM_RESPONSE_TIMED_OUT || error == 0 ? mbm_status_text(status)
                         : place_is_tcp(&line->place)                     ? strerror(error)
                                                      : terminal_error_text(&line->place, error);

    /* The next request may open a line that was open until now. */
    if (event == MBM_LINK_EVENT_LOST)
        line->tried = micros() - REOPEN_MS * 1000u;
    if (event == MBM_LINK_EVENT_LOST && status == MBM_RESPONSE_TIMED_OUT) {
        take_silence(line);
        return;
    }
    if (is_harmless(line, event))
        return;
    if (event == MBM_LINK_EVENT_CONNECTED) {
        line->opened = line->counters;
        if (line->reason[0])
            report_log(REPORT_INFO, "%s: the line is open again", line->place.text);
        line->reason[0] = '\0';
        return;
    }
    if (strncmp(reason, line->reason, sizeof line->reason - 1) != 0)
        report_log(REPORT_WARNING, "%s: %s. The line is opened again each second", line->place.text,
                   reason);
    snprintf(line->reason, sizeof line->reason, "%s", reason);
}

static void begin_client(gateway_line *line)
{
    const place *where = &line->place;
    const mbm_port own = place_is_tcp(where) ? mbm_tcp_port(&line->tcp) : mbm_tty_port(&line->tty);
    const mbm_port below = found_port_begin(&line->found, &own);
    const mbm_port port = trace_client(received_begin(&line->received, &below, where->framing),
                                       where->framing, where->text);
    mbm_client *client = &line->client;

    switch (where->framing) {
    case MBM_FRAMING_TCP:
        (void)mbm_client_beginTcp(client, &port, line->frame, MBM_MAX_TCP_FRAME, line->outgoing,
                                  sizeof line->outgoing);
        return;
    case MBM_FRAMING_RTU_OVER_TCP:
        (void)mbm_client_beginRtuOverTcp(client, &port, line->frame, sizeof line->frame);
        return;
    case MBM_FRAMING_ASCII:
        (void)mbm_client_beginAscii(client, &port, line->frame, sizeof line->frame);
        break;
    default: (void)mbm_client_beginRtu(client, &port, line->frame, sizeof line->frame);
    }
    (void)mbm_client_setBaudRate(client, where->tty.baud);
    (void)mbm_client_setEchoDiscard(client, where->discards_echo);
    if (where->has_gap)
        (void)mbm_client_setGap(client, where->gapMs * 1000);
}

void gateway_line_set(gateway_line *line, const gateway_pace *pace)
{
    if (line->place.framing == MBM_FRAMING_TCP)
        (void)mbm_client_setInFlight(&line->client, (uint8_t)pace->in_flight);
    line->in_flight = line->place.framing == MBM_FRAMING_TCP ? pace->in_flight : 1;
    (void)mbm_client_setResponseTimeout(&line->client, pace->timeoutMs);
    (void)mbm_client_setQuietTime(&line->client, pace->quietMs);
    (void)mbm_link_setConnectTimeout(&line->link, pace->timeoutMs);
    line->replace_after = pace->replace_after;
    if (place_is_tcp(&line->place))
        (void)mbm_link_setReplaceAfter(&line->link, (uint8_t)pace->replace_after);
}

int gateway_line_begin(gateway_line *line, const place *where, const gateway_pace *pace)
{
    const mbm_linkHooks hooks = {line, close_line, open_line, link_status};

    memset(&line->counters, 0, sizeof line->counters);
    memset(&line->known, 0, sizeof line->known);
    memset(&line->losses, 0, sizeof line->losses);
    memset(&line->opened, 0, sizeof line->opened);
    line->is_replaced = 0;
    line->is_silent = 0;
    line->reason[0] = '\0';
    line->text = strdup(where->text);
    if (!line->text)
        return 0;
    line->place = *where;
    line->place.text = line->text;
    line->is_used = 1;
    line->tried = micros() - REOPEN_MS * 1000u;
    keep_reserve(line);
    begin_client(line);
    (void)mbm_client_setCounters(&line->client, &line->counters);
    (void)mbm_link_begin(&line->link, &line->client, &hooks);
    (void)mbm_link_setBackoff(&line->link, MBM_BACKOFF_FIXED, REOPEN_MS, REOPEN_MS);
    (void)mbm_link_setCallback(&line->link, on_link, line);
    (void)mbm_link_setCounters(&line->link, &line->losses);
    gateway_line_set(line, pace);
    return 1;
}

/* --- a place without a line --- */

static int16_t no_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    (void)context;
    (void)bytes;
    (void)capacity;
    return -1;
}

static int16_t no_write(void *context, const uint8_t *bytes, uint16_t length)
{
    (void)context;
    (void)bytes;
    (void)length;
    return -1;
}

static uint32_t no_micros(void *context)
{
    (void)context;
    return micros();
}

void gateway_line_leave(gateway_line *line)
{
    const mbm_port nowhere = {.read = no_read, .write = no_write, .micros = no_micros};

    (void)mbm_client_beginRtuOverTcp(&line->client, &nowhere, line->frame, sizeof line->frame);
}

/* --- at work --- */

void gateway_line_watch(gateway_line *line)
{
    const char *why;
    const mbm_counters *now = &line->counters;
    const uint32_t damaged = now->badCrc - line->known.badCrc,
                   failed = damaged + now->timeouts - line->known.timeouts;

    if (now->replies != line->known.replies) {
        if (line->is_silent)
            report_log(REPORT_INFO, "%s: a device answers again", line->place.text);
        line->is_silent = 0;
        line->known = *now;
    } else if (!line->is_silent && failed >= SILENT_AFTER) {
        line->is_silent = 1;
        why = received_text(&line->received);
        report_set_in_flight(line->in_flight);
        if (damaged > 0)
            report_log(REPORT_WARNING,
                       "%s: the last %u requests got no right reply, %u of them damaged ones. %s",
                       line->place.text, failed, damaged, advice_damaged(&line->place));
        else
            report_log(REPORT_WARNING, "%s: the last %u requests got no reply%s%s. %s%s",
                       line->place.text, failed, why ? ": " : "", why ? why : "",
                       advice_silent(&line->place), report_in_flight());
    }
}

uint8_t gateway_line_isReady(void *context)
{
    gateway_line *line = (gateway_line *)context;
    const uint8_t state = line->is_used ? mbm_link_state(&line->link) : MBM_LINK_IS_DOWN;

    if (!line->is_used)
        return 0;
    if (state == MBM_LINK_IS_DOWN && micros() - line->tried >= REOPEN_MS * 1000u) {
        /* The request waits for this attempt, and ends if it fails. */
        (void)mbm_link_reconnect(&line->link);
        return 1;
    }
    return state != MBM_LINK_IS_DOWN;
}

int gateway_line_wait(const gateway_line *line, struct pollfd *wait)
{
    const int is_open = !line->is_used               ? 0
                        : place_is_tcp(&line->place) ? line->tcp.events != 0
                                                     : line->tty.isOpen;

    *wait = (struct pollfd){place_is_tcp(&line->place) ? line->tcp.fd : line->tty.fd,
                            place_is_tcp(&line->place) ? line->tcp.events : POLLIN, 0};
    return is_open;
}

void gateway_line_close(gateway_line *line)
{
    line->is_used = 0;
    if (place_is_tcp(&line->place))
        mbm_tcp_close(&line->tcp);
    else
        mbm_tty_close(&line->tty);
    free_reserve(line);
    free(line->text);
    line->text = NULL;
    gateway_line_leave(line);
}
