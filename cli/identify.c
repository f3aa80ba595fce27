/* mbm identify: shows what a device says about itself. */
#include "advice.h"
#include "line.h"
#include "options.h"
#include "report.h"

#include <cjson/cJSON.h>
#include <ctype.h>
#include <stdio.h>
#include <string.h>

typedef struct identity {
    line at;
    place where;
    int category;
    uint8_t reply[250], pdu[MBM_MAX_PDU];
    mbm_identification identification;
    mbm_clientRequest request;
    cJSON *json, *objects, *refused; /* NULL without --json */
    mbm_clientRequest failed;        /* the first that failed */
    unsigned found;
} identity;

static error_t parse(int key, char *text, struct argp_state *state)
{
    identity *d = (identity *)state->input;
    static const char *const categories[] = {"basic", "regular", "extended", NULL};

    switch (key) {
    case 'c': d->category = 1 + options_word(state, "--category", text, categories); return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num > 0)
            options_too_many(state, text);
        options_place(state, &d->where, text, 0);
        return 0;
    case ARGP_KEY_SUCCESS:
        if (!d->where.text)
            options_wrong(state, "LINE is missing");
        options_check_unit(state, &d->where, 0);
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option texts[] = {
    {"category", 'c', "WORD", 0, "Objects to read: basic, regular or extended, all (extended)", 1},
    {0}};

static const struct argp_child children[] = {
    {.argp = &options_unit}, {.argp = &options_client}, {0}};

static const struct argp arguments = {
    .options = texts,
    .parser = parse,
    .args_doc = "LINE",
    .doc =
        "Shows all objects of the device identification (function 2B/0E), the server id (11) and the "
        "event counter (0B). What the device does not have is left out, with the reason on stderr.\v"
        "Example:\n\n"
        "  mbm identify tcp://192.168.0.7 --unit 17\n\n" PLACE_HELP,
    .children = children};

/* Shows bytes as text, and those that are none as \x and two digits. */
static void show_text(identity *d, cJSON *into, const char *name, const uint8_t *bytes,
                      uint16_t length)
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
    d->found++;
}

static void show_object(void *context, const mbm_object *object)
{
    identity *d = (identity *)context;
    static const char *const names[] = {"vendor name",  "product code", "revision",   "vendor URL",
                                        "product name", "model name",   "application"};
    char name[16];

    snprintf(name, sizeof name, "object %02X", object->id);
    show_text(d, d->objects, object->id < sizeof names / sizeof names[0] ? names[object->id] : name,
              object->data, object->length);
}

/* Waits for a request. Says why it failed, and keeps its exit code. */
static int succeeds(identity *d, const char *what, mbm_clientRequest *one, uint8_t queued)
{
    char status[256];

    one->status = line_call(&d->at, one, queued);
    if (one->status == MBM_OK)
        return 1;
    if (d->failed.status == MBM_OK)
        d->failed = *one;
    (void)line_status(&d->at, one, status);
    if (d->refused && !report_stopped)
        cJSON_AddStringToObject(d->refused, what, status);
    if (!options.is_quiet && !report_stopped) {
        report_flush(); /* what was found first is printed first */
        fprintf(stderr, "%s: %s: %s.\n", report_name, what, status);
    }
    return 0;
}

static int replied(identity *d, const char *what, uint8_t queued, mbm_packet *packet)
{
    return succeeds(d, what, &d->request, queued) &&
           mbm_client_reply(&d->request, d->pdu, sizeof d->pdu, packet) == MBM_OK;
}

static void identify(identity *d)
{
    mbm_packet packet;

    (void)succeeds(
        d, "identification", &d->identification.request,
        mbm_identification_read(&d->identification, &d->at.client, (uint8_t)d->category, 0));
    if (!report_stopped &&
        replied(d, "server id", mbm_client_reportServerId(&d->at.client, &d->request), &packet))
        show_text(d, d->json, "server id", packet.data, packet.dataLength);
    if (report_stopped ||
        !replied(d, "event counter", mbm_client_getCommEventCounter(&d->at.client, &d->request),
                 &packet))
        return;
    d->found++;
    if (!d->json) {
        printf("events: %u%s\n", packet.eventCount, packet.commStatus ? ", busy" : "");
        return;
    }
    cJSON_AddNumberToObject(d->json, "events", packet.eventCount);
    cJSON_AddBoolToObject(d->json, "busy", packet.commStatus != 0);
}

int identify_command(int argc, char **argv)
{
    static identity data;
    identity *d = &data;
    d->category = MBM_DEVICE_ID_EXTENDED;
    argp_parse(&arguments, argc, argv, 0, NULL, d);
    d->identification.object = show_object;
    d->identification.context = d;
    d->identification.request.reply = d->request.reply = d->reply;
    d->identification.request.replyBytes = d->request.replyBytes = sizeof d->reply;
    d->identification.request.unit = d->request.unit = options.unit;
    if (options.is_json) {
        d->json = cJSON_CreateObject();
        cJSON_AddNumberToObject(d->json, "unit", options.unit);
        d->objects = cJSON_AddObjectToObject(d->json, "objects");
        d->refused = cJSON_AddObjectToObject(d->json, "refused");
    }
    if (line_open(&d->at, &d->where) == CODE_DONE && line_connect(&d->at) == CODE_DONE) {
        identify(d);
        if (d->found == 0 && d->failed.status != MBM_OK)
            (void)line_failure(&d->at, &d->failed, ADVICE_DEVICE);
        if (d->json)
            report_print_json(d->json);
    }
    line_close(&d->at);
    return report_code;
}
