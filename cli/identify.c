/* mbm identify: shows what a device says about itself. Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "advice.h"
#include "commands.h"
#include "line.h"
#include "options.h"
#include "report.h"

#include <cjson/cJSON.h>
#include <ctype.h>
#include <stdio.h>
#include <string.h>

static line at;
static place where;
static int category = MBM_DEVICE_ID_EXTENDED;
static uint8_t reply[250], pdu[MBM_MAX_PDU];
static mbm_identification identification = {
    .request = {.reply = reply, .replyBytes = sizeof reply}};
static mbm_clientRequest request = {.reply = reply, .replyBytes = sizeof reply};
static cJSON *json, *objects, *refused;
static mbm_clientRequest failed; /* the first that failed */
static unsigned found;

static error_t parse(int key, char *text, struct argp_state *state)
{
    static const char *const categories[] = {"basic", "regular", "extended", NULL};

    switch (key) {
    case 'c': category = 1 + options_word(state, "--category", text, categories); return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num > 0)
            options_too_many(state, text);
        options_place(state, &where, text, 0);
        return 0;
    case ARGP_KEY_SUCCESS:
        if (!where.text)
            options_wrong(state, "LINE is missing");
        options_check_unit(state, &where, 0);
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option texts[] = {
    {"category", 'c', "WORD", 0, "Objects to read: basic, regular or extended, all (extended)", 1},
    {NULL, 0, NULL, 0, NULL, 0}};

static const struct argp_child children[] = {
    {&options_unit, 0, NULL, 0}, {&options_client, 0, NULL, 0}, {NULL, 0, NULL, 0}};

static const struct argp arguments = {
    texts,
    parse,
    "LINE",
    "Shows all objects of the device identification (function 2B/0E), the server id (11) and the "
    "event counter (0B). What the device does not have is left out, with the reason on stderr.\v"
    "Example:\n\n"
    "  mbm identify tcp://192.168.0.7 --unit 17\n\n" PLACE_HELP,
    children,
    NULL,
    NULL};

/* Shows bytes as text, and those that are none as \x and two digits. */
static void show_text(cJSON *into, const char *name, const uint8_t *bytes, uint16_t length)
{
    char text[4 * 256 + 1] = "";
    size_t to = 0;
    uint16_t i;

    for (i = 0; i < length; i++)
        to += (size_t)snprintf(text + to, sizeof text - to,
                               isprint(bytes[i]) && bytes[i] != '\\' ? "%c" : "\\x%02X", bytes[i]);
    if (into)
        cJSON_AddStringToObject(into, name, text);
    else
        printf("%s: %s\n", name, text);
    found++;
}

static void show_object(void *context, const mbm_object *object)
{
    static const char *const names[] = {"vendor name",  "product code", "revision",   "vendor URL",
                                        "product name", "model name",   "application"};
    char name[16];

    (void)context;
    snprintf(name, sizeof name, "object %02X", object->id);
    show_text(objects, object->id < sizeof names / sizeof names[0] ? names[object->id] : name,
              object->data, object->length);
}

/* Waits for a request. Says why it failed, and keeps its exit code. */
static int succeeds(const char *what, mbm_clientRequest *one, uint8_t queued)
{
    char status[256];

    one->status = line_call(&at, one, queued);
    if (one->status == MBM_OK)
        return 1;
    if (failed.status == MBM_OK)
        failed = *one;
    (void)line_status(&at, one, status);
    if (refused && !report_stopped)
        cJSON_AddStringToObject(refused, what, status);
    if (!options.is_quiet && !report_stopped) {
        report_flush(); /* what was found first is printed first */
        fprintf(stderr, "%s: %s: %s.\n", report_name, what, status);
    }
    return 0;
}

static int replied(const char *what, uint8_t queued, mbm_packet *packet)
{
    return succeeds(what, &request, queued) &&
           mbm_client_reply(&request, pdu, sizeof pdu, packet) == MBM_OK;
}

static void identify(void)
{
    mbm_packet packet;

    identification.object = show_object;
    (void)succeeds("identification", &identification.request,
                   mbm_identification_read(&identification, &at.client, (uint8_t)category, 0));
    if (!report_stopped &&
        replied("server id", mbm_client_reportServerId(&at.client, &request), &packet))
        show_text(json, "server id", packet.data, packet.dataLength);
    if (report_stopped ||
        !replied("event counter", mbm_client_getCommEventCounter(&at.client, &request), &packet))
        return;
    found++;
    if (!json) {
        printf("events: %u%s\n", packet.eventCount, packet.commStatus ? ", busy" : "");
        return;
    }
    cJSON_AddNumberToObject(json, "events", packet.eventCount);
    cJSON_AddBoolToObject(json, "busy", packet.commStatus != 0);
}

int identify_command(int argc, char **argv)
{
    argp_parse(&arguments, argc, argv, 0, NULL, NULL);
    identification.request.unit = request.unit = options.unit;
    if (options.is_json) {
        json = cJSON_CreateObject();
        cJSON_AddNumberToObject(json, "unit", options.unit);
        objects = cJSON_AddObjectToObject(json, "objects");
        refused = cJSON_AddObjectToObject(json, "refused");
    }
    if (line_open(&at, &where) == CODE_DONE && line_connect(&at) == CODE_DONE) {
        identify();
        if (found == 0 && failed.status != MBM_OK)
            (void)line_failure(&at, &failed, ADVICE_DEVICE);
        if (json)
            report_print_json(json);
    }
    line_close(&at);
    return report_code;
}
