/* Draws the table, answers for the page, and waits for both and for the line.
 *
 * Licence: MIT OR Apache-2.0. */
#include "live.h"

#include "clock.h"
#include "numbers.h"
#include "report.h"
#include "screen.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

/* The table is drawn so long after the last time: at the soonest, and if only ages have changed. */
enum { SOON_MS = 100, AGES_MS = 500 };

int live_is_wanted(const live *l)
{
    return l->watches || l->http_place;
}

static int begin_page(live *l)
{
    const int port = page_listen(&l->page, l->http_place);
    const char *colon = strrchr(l->http_place, ':');

    if (port < 0)
        return report(CODE_LINE, "--http %s: %s", l->http_place, strerror(errno));
    snprintf(l->watch.page, sizeof l->watch.page, "http://%.*s:%d/",
             colon ? (int)(colon - l->http_place) : 9, colon ? l->http_place : "127.0.0.1", port);
    fprintf(stderr, "%s: the page is at %s%s.\n", report_name, l->watch.page,
            http_is_open(l->http_place) ? ", and other machines can see it" : "");
    return CODE_DONE;
}

int live_begin(live *l, polled *of, uint32_t intervalMs)
{
    int code = CODE_DONE;

    l->of = of;
    l->page.intervalMs = intervalMs;
    l->page.of = l->watch.of = &l->followed;
    if (followed_begin(&l->followed, of) != 0)
        return report(CODE_SYSTEM, REPORT_NO_MEMORY);
    if (l->http_place)
        code = begin_page(l);
    if (code == CODE_DONE && l->watches && screen_begin() != 0)
        code = report(CODE_SYSTEM, "--watch: %s", strerror(errno));
    if (code != CODE_DONE)
        live_end(l);
    l->is_new = 1;
    return code;
}

void live_end(live *l)
{
    screen_end();
    if (l->watches && l->watch.round > 0)
        watch_print(&l->watch);
    http_close(&l->page.http);
    followed_end(&l->followed);
}

void live_note(live *l, uint16_t field)
{
    followed_note(&l->followed, field);
    l->is_new = 1;
}

void live_note_round(live *l, uint32_t round)
{
    char time[CLOCK_TEXT_BYTES];

    l->watch.round = l->page.round = round;
    /* Hours, minutes, seconds, and the zone. */
    snprintf(l->watch.time, sizeof l->watch.time, "%.8s UTC", clock_now_text(time) + 11);
    l->is_new = 1;
}

static void draw_if_due(live *l)
{
    const int64_t now = clock_milliseconds();

    if (!l->watches || now - l->drawn_at < (l->is_new ? SOON_MS : AGES_MS))
        return;
    watch_draw(&l->watch);
    l->drawn_at = now;
    l->is_new = 0;
}

static uint32_t sooner(uint32_t one, uint32_t other)
{
    return one < other ? one : other;
}

/* How long to wait at most, in microseconds. */
static uint32_t time_left(live *l, uint32_t milliseconds)
{
    const int64_t draw = l->drawn_at + (l->is_new ? SOON_MS : AGES_MS) - clock_milliseconds();
    uint32_t micros = sooner(milliseconds, 1000) * 1000;

    micros = sooner(micros, line_delay(&l->of->at));
    micros = sooner(micros, http_delay(&l->page.http));
    if (l->watches)
        micros = sooner(micros, draw > 0 ? (uint32_t)draw * 1000 : 0);
    return micros;
}

void live_wait(live *l, uint32_t milliseconds)
{
    struct pollfd polls[2 + HTTP_WAITS];
    const struct timespec time = clock_timespec(time_left(l, milliseconds));
    nfds_t count = 0, before;

    if (l->watches)
        polls[count++] = (struct pollfd){STDIN_FILENO, POLLIN, 0};
    count += (nfds_t)line_polls(&l->of->at, &polls[count]);
    before = count;
    count += http_wait(&l->page.http, polls + count);
    if (ppoll(polls, count, &time, NULL) > 0) {
        http_polled(&l->page.http, polls + before, count - before);
        /* Nothing comes from a terminal that is gone. */
        l->is_over |= l->watches && (polls[0].revents & (POLLHUP | POLLERR | POLLNVAL)) != 0;
    }
    http_work(&l->page.http);
    if (l->watches) {
        const int keys = watch_keys(&l->watch);

        l->is_over |= keys < 0;
        if (keys != 0 || screen_is_new()) {
            l->is_new = 1;
            l->drawn_at = 0;
        }
    }
    draw_if_due(l);
}
