/* The lines of the gateway: their settings, and reports on devices that do not answer.
 *
 * Licence: MIT OR Apache-2.0. */
#include "gateway_line.h"

#include "advice.h"
#include "clock.h"
#include "report.h"

#include <stdlib.h>
#include <string.h>

/* The gateway reports a line after SILENT_AFTER requests in a row without a right reply. */
enum { SILENT_AFTER = 5 };

void gateway_line_set(gateway_line *l, const gateway_pace *pace, const reach *what)
{
    line_set(&l->at, (uint8_t)pace->in_flight, (uint8_t)pace->replace_after);
    l->in_flight = l->at.place.framing == MBM_FRAMING_TCP ? pace->in_flight : 1;
    (void)mbm_client_setQuietTime(&l->at.client, pace->quietMs);
    line_reach(&l->at, what);
    (void)mbm_link_setConnectTimeout(&l->at.kept, reach_timeout(&l->at.place.reach));
}

int gateway_line_begin(gateway_line *l, const place *where, const gateway_pace *pace)
{
    char *text = strdup(where->text);
    place copy = *where;

    if (!text)
        return 0;
    copy.text = text;
    memset(l, 0, sizeof *l);
    if (line_begin(&l->at, &copy) != CODE_DONE) {
        free(text);
        return 0;
    }
    l->text = text;
    l->at.is_logged = l->is_used = 1;
    gateway_line_set(l, pace, &where->reach);
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
    return (uint32_t)clock_micros(CLOCK_MONOTONIC);
}

void gateway_line_leave(gateway_line *l)
{
    const mbm_port nowhere = {.read = no_read, .write = no_write, .micros = no_micros};

    (void)mbm_client_beginRtuOverTcp(&l->at.client, &nowhere, l->at.incoming,
                                     sizeof l->at.incoming);
}

void gateway_line_watch(gateway_line *l)
{
    const char *why;
    const mbm_counters *now = &l->at.counters;
    const uint32_t damaged = now->badCrc - l->known.badCrc,
                   failed = damaged + now->timeouts - l->known.timeouts;

    if (now->replies != l->known.replies) {
        if (l->is_silent)
            report_log(REPORT_INFO, "%s: a device answers again", l->at.place.text);
        l->is_silent = 0;
        l->known = *now;
    } else if (!l->is_silent && failed >= SILENT_AFTER) {
        l->is_silent = 1;
        why = received_text(&l->at.received);
        report_set_in_flight(l->in_flight);
        if (damaged > 0)
            report_log(REPORT_WARNING,
                       "%s: the last %u requests got no right reply, %u of them damaged ones. %s",
                       l->at.place.text, failed, damaged, advice_damaged(&l->at.place));
        else
            report_log(REPORT_WARNING, "%s: the last %u requests got no reply%s%s. %s%s",
                       l->at.place.text, failed, why ? ": " : "", why ? why : "",
                       advice_silent(&l->at.place), report_in_flight());
    }
}

uint8_t gateway_line_isReady(void *context)
{
    gateway_line *l = (gateway_line *)context;

    return (uint8_t)(l->is_used && line_prepare(&l->at));
}

void gateway_line_close(gateway_line *l)
{
    l->is_used = 0;
    line_close(&l->at);
    free(l->text);
    l->text = NULL;
    gateway_line_leave(l);
}
