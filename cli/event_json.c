#define _GNU_SOURCE
#include "event_json.h"

#include <cjson/cJSON.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { LONGEST_TEXT = 2400, MILLION = 1000000 };

static const char *const KINDS[] = {
    [MBM_EVENT_REQUEST] = "request",     [MBM_EVENT_REPLY] = "reply",
    [MBM_EVENT_EXCEPTION] = "exception", [MBM_EVENT_UNPAIRED] = "unpaired",
    [MBM_EVENT_TIMEOUT] = "timeout",     [MBM_EVENT_BAD_CRC] = "bad CRC",
    [MBM_EVENT_NOISE] = "noise",
};

/* Adds a number of seconds or milliseconds without rounding it to a double. */
static void add_decimal(cJSON *object, const char *name, int64_t value, uint64_t unit)
{
    const uint64_t amount = (uint64_t)(value < 0 ? -value : value);
    char text[48];

    snprintf(text, sizeof text, "%s%llu.%0*llu", value < 0 ? "-" : "",
             (unsigned long long)(amount / unit), unit == MILLION ? 6 : 3,
             (unsigned long long)(amount % unit));
    cJSON_AddRawToObject(object, name, text);
}

static void add_time(cJSON *object, uint64_t epoch)
{
    const time_t seconds = (time_t)(epoch / MILLION);
    char date[32], text[48];
    struct tm utc;

    gmtime_r(&seconds, &utc);
    (void)strftime(date, sizeof date, "%Y-%m-%dT%H:%M:%S", &utc);
    snprintf(text, sizeof text, "%s.%06uZ", date, (unsigned)(epoch % MILLION));
    cJSON_AddStringToObject(object, "time", text);
}

/* Adds the registers or bits that a frame carries. */
static void add_values(cJSON *object, const mbm_event *event)
{
    const mbm_packet *packet = &event->packet;
    const int is_request = packet->kind == MBM_PACKET_REQUEST;
    int are_bits = 0, are_words = 0;
    cJSON *values;
    uint16_t at;

    switch (event->function) {
    case 1:
    case 2: are_bits = !is_request; break;
    case 3:
    case 4: are_words = !is_request; break;
    case 15: are_bits = is_request; break;
    case 16: are_words = is_request; break;
    case 23: are_words = 1; break;
    case 5:
    case 6: cJSON_AddNumberToObject(object, "value", packet->value); return;
    case 22:
        cJSON_AddNumberToObject(object, "and_mask", packet->andMask);
        cJSON_AddNumberToObject(object, "or_mask", packet->orMask);
        return;
    default: return;
    }
    if (!are_bits && !are_words)
        return;
    values = cJSON_AddArrayToObject(object, "values");
    for (at = 0; are_words && at + 1 < packet->dataLength; at = (uint16_t)(at + 2))
        cJSON_AddItemToArray(values,
                             cJSON_CreateNumber(packet->data[at] << 8 | packet->data[at + 1]));
    /* Without its request, the bits that fill the last byte of a reply are not known. */
    for (at = 0;
         are_bits && at < 8 * packet->dataLength && (event->quantity == 0 || at < event->quantity);
         at++)
        cJSON_AddItemToArray(values, cJSON_CreateNumber(packet->data[at / 8] >> at % 8 & 1));
}

static void add_frame(cJSON *object, const mbm_event *event)
{
    static char text[2 * UINT16_MAX + 1];
    uint16_t at;

    text[0] = '\0';
    for (at = 0; at < event->frameLength; at++)
        sprintf(text + 2 * at, "%02x", event->frame[at]);
    cJSON_AddStringToObject(object, "bytes", text);
}

void event_json_print(const mbm_event *event, int64_t micros, uint64_t epoch)
{
    const int has_unit = event->kind != MBM_EVENT_NOISE && event->kind != MBM_EVENT_BAD_CRC;
    const int is_malformed = event->status == MBM_MALFORMED_REPLY;
    cJSON *object = cJSON_CreateObject();
    char text[LONGEST_TEXT], *line;

    mbm_event_text(event, text, sizeof text);
    add_decimal(object, "seconds", micros, MILLION);
    if (epoch)
        add_time(object, epoch);
    cJSON_AddStringToObject(object, "event", KINDS[event->kind]);
    if (has_unit) {
        cJSON_AddNumberToObject(object, "unit", event->unit);
        cJSON_AddNumberToObject(object, "function", event->function);
        if (event->quantity > 0) {
            cJSON_AddNumberToObject(object, "address", event->address);
            cJSON_AddNumberToObject(object, "quantity", event->quantity);
        }
        if (event->packet.kind == MBM_PACKET_EXCEPTION)
            cJSON_AddNumberToObject(object, "exception", event->packet.exceptionCode);
        else if (event->kind != MBM_EVENT_TIMEOUT && !is_malformed)
            add_values(object, event);
    }
    if (event->responseTimeUs)
        add_decimal(object, "response_ms", event->responseTimeUs, 1000);
    cJSON_AddStringToObject(object, "text", text);
    if (event->frameLength > 0)
        add_frame(object, event);
    line = cJSON_PrintUnformatted(object);
    puts(line);
    free(line);
    cJSON_Delete(object);
}
