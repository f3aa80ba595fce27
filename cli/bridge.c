/* Publishes the values of a device file to an MQTT broker, and writes what the broker sends: `mbm
 * bridge`. docs/mqtt.md has the topics and the options.
 *
 * Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "broker.h"
#include "commands.h"
#include "line.h"
#include "options.h"
#include "report.h"
#include "value_text.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum {
    REQUESTS = 4, /* reads in the client's queue at once */
    WRITES = 8    /* writes that wait or are under way */
};

/* What was published of a field. */
typedef struct published {
    char *value; /* NULL: nothing */
    uint8_t status;
    uint8_t is_answered; /* the unit answered the last read */
    uint8_t has_ended;   /* the first read has ended */
} published;

/* A unit: how many of its fields have which state. */
typedef struct unit_state {
    uint16_t fields, answered, ended;
    enum { UNKNOWN, OFFLINE, ONLINE } state;
} unit_state;

typedef struct write_request {
    mbm_clientRequest request;
    uint16_t words[VALUE_WORDS];
    uint16_t field;
    uint8_t is_used;
} write_request;

static line at;
static mbm_plan plan = MBM_INIT;
static mbm_planSetup setup;
static device fields;
static broker mqtt;
static published *last;
static unit_state units[256];
static write_request writes[WRITES];

/* What the command line says. */
static broker_options to = {.host = "localhost", .topic = "modbus"};
static place where;
static const char *path;
static int is_plain, is_every;

/* Whether a status came from the unit itself, and not from a line or gateway that lacks it. */
static int is_answer(uint8_t status)
{
    return status < 0x80 && status != MBM_GATEWAY_PATH_UNAVAILABLE &&
           status != MBM_GATEWAY_TARGET_FAILED_TO_RESPOND;
}

static void publish_unit(unsigned unit)
{
    char name[16];

    snprintf(name, sizeof name, "unit/%u", unit);
    broker_publish(&mqtt, name, "status", units[unit].state == ONLINE ? "online" : "offline", 1);
}

/* A unit is online while it answers one of its reads. */
static void update_unit(uint16_t field, uint8_t status)
{
    const uint16_t number = fields.planned[field].unit;
    unit_state *unit = &units[number];
    published *was = &last[field];
    const uint8_t answered = (uint8_t)is_answer(status);

    unit->ended = (uint16_t)(unit->ended + !was->has_ended);
    was->has_ended = 1;
    unit->answered = (uint16_t)(unit->answered + answered - was->is_answered);
    was->is_answered = answered;
    if (unit->answered > 0 ? unit->state != ONLINE
                           : unit->ended == unit->fields && unit->state != OFFLINE) {
        unit->state = unit->answered > 0 ? ONLINE : OFFLINE;
        publish_unit(number);
    }
}

/* Publishes the last value of a field, with its status and the time at which it was read. */
static void publish_value(uint16_t field)
{
    static char json[VALUE_TEXT_LONGEST + 128];
    const published *what = &last[field];
    const char *value = what->value ? what->value : "null";
    struct timespec now;
    struct tm utc;
    uint32_t age = 0;
    char when[32];

    if (is_plain) {
        /* Plain text has no place for a status: what failed is not published. */
        if (what->value && what->status == MBM_OK)
            broker_publish(&mqtt, fields.fields[field].name, NULL, value, 1);
        return;
    }
    (void)mbm_plan_getStatus(&plan, field, &age);
    clock_gettime(CLOCK_REALTIME, &now);
    if (what->value) {
        now.tv_sec -= age / 1000;
        now.tv_nsec -= (long)(age % 1000) * 1000000;
        if (now.tv_nsec < 0) {
            now.tv_nsec += 1000000000;
            now.tv_sec--;
        }
    }
    gmtime_r(&now.tv_sec, &utc);
    (void)strftime(when, sizeof when, "%Y-%m-%dT%H:%M:%S", &utc);
    snprintf(json, sizeof json, "{\"value\":%s,\"status\":\"%s\",\"time\":\"%s.%03ldZ\"}", value,
             mbm_status_text(what->status), when, now.tv_nsec / 1000000);
    broker_publish(&mqtt, fields.fields[field].name, NULL, json, 1);
}

/* Called by the plan for each field whose read has ended. */
static void on_update(void *context, mbm_plan *ended, uint16_t field)
{
    static char text[VALUE_TEXT_LONGEST];
    published *was = &last[field];
    const uint8_t status = mbm_plan_getStatus(ended, field, NULL);
    int is_new = is_every || status != was->status || !was->has_ended;

    (void)context;
    if (status == MBM_OK && value_text(ended, &fields, field, !is_plain, text) &&
        (!was->value || strcmp(text, was->value) != 0)) {
        free(was->value);
        was->value = strdup(text);
        is_new = 1;
    }
    was->status = status;
    update_unit(field, status);
    if (is_new)
        publish_value(field);
}

/* What a new connection has to publish: everything that has been read. */
static void publish_all(void)
{
    unsigned number;
    uint16_t field;

    for (number = 1; number < 256; number++)
        if (units[number].state != UNKNOWN)
            publish_unit(number);
    for (field = 0; field < fields.readable; field++)
        if (last[field].has_ended)
            publish_value(field);
}

static void publish_result(uint16_t field, const char *result)
{
    broker_publish(&mqtt, fields.fields[field].name, "result", result, 0);
}

static void on_written(void *context, mbm_clientRequest *request)
{
    write_request *write = (write_request *)context;
    char text[256];

    publish_result(write->field, line_status(&at, request, text));
    if (write->field < fields.readable)
        (void)mbm_plan_refresh(&plan, write->field);
    write->is_used = 0;
}

/* Begins the write of a payload. Returns NULL, or why it is refused. */
static const char *begin_write(uint16_t field, const char *payload, size_t length)
{
    const mbm_planField *planned = &fields.planned[field];
    write_request *write = writes;
    const char *wrong;
    uint16_t count;
    uint8_t status;

    while (write < writes + WRITES && write->is_used)
        write++;
    if (write == writes + WRITES)
        return "too many writes wait";
    memset(write, 0, sizeof *write);
    count = payload_parse(&fields.fields[field].form, payload, length, write->words, &wrong);
    if (count == 0)
        return wrong;
    write->field = field;
    write->request.unit = planned->unit;
    write->request.data = write->words;
    write->request.done = on_written;
    write->request.context = write;
    if (planned->table == MBM_TABLE_COILS)
        status = mbm_client_writeSingleCoil(&at.client, &write->request, planned->address,
                                            (uint8_t)write->words[0]);
    else if (count == 1)
        status = mbm_client_writeSingleRegister(&at.client, &write->request, planned->address,
                                                write->words[0]);
    else
        status =
            mbm_client_writeMultipleRegisters(&at.client, &write->request, planned->address, count);
    if (status != MBM_OK && status != MBM_PENDING)
        return mbm_status_text(status);
    write->is_used = 1;
    return NULL;
}

static void take_events(void)
{
    broker_event event;

    while (broker_next(&mqtt, &event)) {
        const char *wrong;

        if (event.kind == BROKER_CONNECTED) {
            publish_all();
            continue;
        }
        wrong = begin_write(event.field, event.payload, event.length);
        if (wrong)
            publish_result(event.field, wrong);
    }
}

/* Sleeps until bytes or an event arrive, or until the client or the plan has something to do. */
static void rest(void)
{
    const uint32_t client = mbm_client_pollDelay(&at.client), planned = mbm_plan_pollDelay(&plan);

    line_wait(&at, mqtt.events[0], client < planned ? client : planned);
}

/* Whether the bridge can publish and write all fields. */
static int check_fields(void)
{
    uint16_t field;

    for (field = 0; field < fields.count; field++) {
        const device_field *one = &fields.fields[field];
        const mbm_planField *planned = &fields.planned[field];
        const char *wrong = broker_check_name(one->name);

        if (!wrong && (one->access & DEVICE_WRITE) &&
            (planned->count > 1 || planned->type == MBM_TYPE_TEXT))
            wrong = "the bridge writes only single numbers and bits";
        if (wrong)
            return report(CODE_WRONG, "%s:%d: %s: %s", path, one->line, one->name, wrong);
    }
    if (fields.readable == 0)
        return report(CODE_WRONG, "%s: no field can be read", path);
    return CODE_DONE;
}

/* Gives the plan its storage. Returns an exit code. */
static int begin_plan(void)
{
    const size_t count = fields.readable;
    uint8_t status;
    uint16_t wrong;
    size_t field;

    last = (published *)calloc(count, sizeof *last);
    setup.fields = fields.planned;
    setup.fieldCount = setup.readCount = fields.readable;
    setup.positions = (mbm_planPosition *)calloc(count, sizeof *setup.positions);
    setup.reads = (mbm_planRead *)calloc(count, sizeof *setup.reads);
    setup.data = (uint16_t *)calloc(65535, sizeof *setup.data);
    setup.requests = (mbm_clientRequest *)calloc(REQUESTS, sizeof *setup.requests);
    if (!last || !setup.positions || !setup.reads || !setup.data || !setup.requests)
        return report(CODE_SYSTEM, "%s: not enough memory", path);
    setup.dataWords = 65535;
    setup.requestCount = REQUESTS;
    setup.update = on_update;
    for (field = 0; field < count; field++)
        units[fields.planned[field].unit].fields++;
    status = mbm_plan_begin(&plan, &at.client, &setup, &wrong);
    if (status == MBM_OK)
        return CODE_DONE;
    if (wrong < fields.readable)
        return report(CODE_WRONG, "%s:%d: %s", path, fields.fields[wrong].line,
                      mbm_status_text(status));
    return report(CODE_WRONG, "%s: %s", path, mbm_status_text(status));
}

static void free_all(void)
{
    uint16_t field;

    for (field = 0; last && field < fields.readable; field++)
        free(last[field].value);
    free(last);
    free(setup.positions);
    free(setup.reads);
    free(setup.data);
    free(setup.requests);
    device_free(&fields);
}

/* --- the command line --- */

enum { ALL = 0x100, CA, CERT, GAP, ID, KEY, PLAIN, USER };

/* Reads HOST[:PORT], or [IPV6][:PORT]. */
static void read_broker(const struct argp_state *state, char *text)
{
    char *end = *text == '[' ? strchr(text, ']') : NULL;
    char *port = strchr(end ? end : text, ':');

    if (strpbrk(text, ", /@") || (port && (strchr(port + 1, ':') || (end && port != end + 1))))
        options_wrong(state,
                      "--broker \"%s\" is not HOST or HOST:PORT; an IPv6 address needs "
                      "brackets, such as [::1]:1883",
                      text);
    if (port)
        to.port = (int)options_number(state, "the port of --broker", port + 1, 1, 65535);
    if (port)
        *port = '\0';
    if (end)
        *end = '\0';
    to.host = text + (end != NULL);
    if (!*to.host)
        options_wrong(state, "--broker has no host");
}

static void check_options(const struct argp_state *state)
{
    if (state->arg_num != 2)
        options_wrong(state, "a bridge needs LINE and FILE");
    if (!to.ca_file && (to.cert_file || to.key_file))
        options_wrong(state, "--cert and --key need --ca");
    if (!to.cert_file != !to.key_file)
        options_wrong(state, "--cert and --key need each other");
    if (to.port == 0)
        to.port = to.ca_file ? 8883 : 1883;
}

static error_t parse(int key, char *text, struct argp_state *state)
{
    switch (key) {
    case 'b': read_broker(state, text); return 0;
    case 't':
        if (strlen(text) > BROKER_TOPIC_BYTES || !*text || strpbrk(text, "+#"))
            options_wrong(state, "--topic \"%s\" is not 1 to %d bytes without + and #", text,
                          BROKER_TOPIC_BYTES);
        to.topic = text;
        return 0;
    case ID: to.id = text; return 0;
    case USER: to.user = text; return 0;
    case CA: to.ca_file = text; return 0;
    case CERT: to.cert_file = text; return 0;
    case KEY: to.key_file = text; return 0;
    case PLAIN: is_plain = 1; return 0;
    case ALL: is_every = 1; return 0;
    case GAP: setup.registerGap = (uint8_t)options_number(state, "--gap", text, 0, 123); return 0;
    case 'q': options.is_quiet = 1; return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num == 0)
            options_place(state, &where, text, 0);
        else if (state->arg_num == 1)
            path = text;
        else
            options_wrong(state, "\"%s\" is one word too many: a bridge has LINE and FILE", text);
        return 0;
    case ARGP_KEY_END: check_options(state); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option texts[] = {
    {"broker", 'b', "HOST[:PORT]", 0, "The broker (localhost; port 1883, with --ca 8883)", 1},
    {"topic", 't', "TOPIC", 0, "The beginning of all topics (modbus)", 1},
    {"id", ID, "ID", 0, "The MQTT client identifier (random)", 1},
    {"user", USER, "USER", 0, "The user; the password is in the environment variable MQTT_PASSWORD",
     1},
    {"ca", CA, "FILE", 0, "Connect with TLS; the certificates that sign the broker's", 1},
    {"cert", CERT, "FILE", 0, "The bridge's certificate", 1},
    {"key", KEY, "FILE", 0, "The bridge's key", 1},
    {"plain", PLAIN, NULL, 0, "Publish plain text instead of JSON", 2},
    {"all", ALL, NULL, 0, "Publish every reading, not only changes", 2},
    {"gap", GAP, "N", 0, "Registers between two fields that one request may read too, 0 to 123 (0)",
     3},
    {"quiet", 'q', NULL, 0, "Print no summary to stderr", 4},
    {NULL, 0, NULL, 0, NULL, 0}};

static const struct argp_child children[] = {
    {&options_request, 0, NULL, 3}, {&options_trace, 0, NULL, 4}, {NULL, 0, NULL, 0}};
static const struct argp parser = {
    texts,
    parse,
    "LINE FILE",
    "Publishes the values of a device to an MQTT broker, and writes what the broker sends.\v"
    "FILE is a device file; its fields with access write or read-write can be written. "
    "docs/mqtt.md describes the topics.\n\n"
    "Example:\n\n"
    "  mbm bridge --broker broker.local tcp://192.168.0.7 meter.yaml\n\n" PLACE_HELP,
    children,
    NULL,
    NULL};

int bridge_command(int argc, char **argv)
{
    int code;

    argp_parse(&parser, argc, argv, 0, NULL, NULL);
    code = device_read(&fields, path);
    if (code != CODE_DONE)
        return report(code, "%s", fields.wrong);
    code = check_fields();
    if (code == CODE_DONE)
        code = line_open(&at, &where);
    if (code == CODE_DONE)
        code = begin_plan();
    if (code == CODE_DONE)
        code = broker_begin(&mqtt, &to, &fields);
    while (code == CODE_DONE && !report_stopped) {
        take_events();
        (void)mbm_plan_poll(&plan);
        line_poll(&at);
        if (!report_stopped)
            rest();
    }
    if (code == CODE_DONE) {
        (void)mbm_plan_end(&plan);
        broker_end(&mqtt);
        if (!options.is_quiet)
            fprintf(stderr, "%s: messages published: %lu, writes lost: %lu.\n", report_name,
                    atomic_load(&mqtt.published), atomic_load(&mqtt.lost));
    }
    line_close(&at);
    free_all();
    return code;
}
