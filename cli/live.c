/* Draws the table, answers for the page, and waits for both and for the line. */
#include "live.h"

#include "clock.h"
#include "numbers.h"
#include "report.h"
#include "screen.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* The table is drawn so long after the last time: at the soonest, and if only ages have changed. */
enum { SOON_MS = 100, AGES_MS = 500 };

/* --- the page --- */

/* The page as it stands in its file, with a zero at its end. */
__asm__(".pushsection .rodata\n"
        ".global page_html\n"
        "page_html:\n"
        ".incbin \"cli/page.html\"\n"
        ".byte 0\n"
        ".popsection\n");
extern const char page_html[] __attribute__((visibility("hidden")));

/* What a browser may do with the page: nothing but run its own script, and ask this server. */
#define GUARDED                                                                                    \
    "Content-Security-Policy: default-src 'none'; script-src 'unsafe-inline'; style-src "          \
    "'unsafe-inline'; img-src data:; connect-src 'self'; base-uri 'none'; form-action 'none'; "    \
    "frame-ancestors 'none'\r\n"                                                                   \
    "X-Content-Type-Options: nosniff\r\n"                                                          \
    "Referrer-Policy: no-referrer\r\n"                                                             \
    "Cache-Control: no-store\r\n"

static cJSON *json_unit(const followed_unit *unit)
{
    cJSON *object = cJSON_CreateObject();

    cJSON_AddNumberToObject(object, "unit", unit->unit);
    cJSON_AddNumberToObject(object, "reads", unit->reads);
    cJSON_AddNumberToObject(object, "failures", followed_failures(unit));
    cJSON_AddNumberToObject(object, "no_reply", unit->no_reply);
    cJSON_AddNumberToObject(object, "exceptions", unit->exceptions);
    cJSON_AddNumberToObject(object, "damaged", unit->damaged);
    cJSON_AddNumberToObject(object, "no_link", unit->link);
    return object;
}

static cJSON *json_field(page *p, uint16_t field)
{
    const followed_field *one = &p->of->fields[field];
    cJSON *object = cJSON_CreateObject();

    polled_add_json(p->of->of, field, object);
    if (one->text)
        cJSON_AddStringToObject(object, "text", one->text);
    if (one->changed_at != 0)
        cJSON_AddNumberToObject(object, "changed_ms",
                                (double)(clock_milliseconds() - one->changed_at));
    if (one->has_number) {
        cJSON_AddNumberToObject(object, "direction", one->direction);
        cJSON_AddRawToObject(object, "min", one->least_text);
        cJSON_AddRawToObject(object, "max", one->most_text);
    }
    return object;
}

static char *render_values(void *context)
{
    page *p = (page *)context;
    const polled *of = p->of->of;
    cJSON *object = cJSON_CreateObject(), *list;
    char time[CLOCK_TEXT_BYTES], *text;
    uint16_t i;

    if (of->meter.name)
        cJSON_AddStringToObject(object, "device", of->meter.name);
    cJSON_AddStringToObject(object, "line", of->at.place.text);
    cJSON_AddStringToObject(object, "time", clock_now_text(time));
    cJSON_AddNumberToObject(object, "round", p->round);
    cJSON_AddNumberToObject(object, "interval_ms", p->intervalMs);
    list = cJSON_AddArrayToObject(object, "units");
    for (i = 0; i < p->of->unit_count; i++)
        cJSON_AddItemToArray(list, json_unit(&p->of->units[i]));
    list = cJSON_AddArrayToObject(object, "fields");
    for (i = 0; i < of->meter.readable; i++)
        cJSON_AddItemToArray(list, json_field(p, i));
    text = cJSON_PrintUnformatted(object);
    cJSON_Delete(object);
    return text;
}

/* Begins to listen at an address that http_check has checked. Returns the port, or -1 with errno
 * set. http_wait and the functions after it do the rest. */
static int page_listen(page *p, const char *address)
{
    static const http_page pages[] = {
        {.path = "/", .type = "text/html; charset=utf-8", .text = page_html, .header = GUARDED},
        {.path = "/values.json",
         .type = "application/json",
         .render = render_values,
         .header = GUARDED},
        {0}};

    p->http.pages = pages;
    p->http.context = p;
    p->http.checks_host = 1;
    return http_listen(&p->http, address);
}

/* --- table and page --- */

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
