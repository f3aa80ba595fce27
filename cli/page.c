/* Makes the JSON of the page of mbm poll, and holds the page.
 *
 * Licence: MIT OR Apache-2.0. */
#include "page.h"

#include "clock.h"

#include <cjson/cJSON.h>
#include <stdlib.h>
#include <string.h>

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

int page_listen(page *p, const char *address)
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
