/* Publishes the values of a Modbus line to an MQTT broker, and writes what the broker sends.
 *
 *     mqtt_bridge -b broker.local -t hall1/meters tcp:192.168.0.7 meters.txt
 *
 * mqtt_fields.h says what is in the file of fields. Each value is published below the topic of -t,
 * retained, when it changes. docs/mqtt.md has the topics and the options.
 *
 * Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "line.h"
#include "mqtt_broker.h"
#include "mqtt_value.h"
#include "trace.h"

#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum {
    REQUESTS = 4,         /* reads in the client's queue at once */
    WRITES = 8,           /* writes that wait or are under way */
    LONGEST_VALUE = 16384 /* bytes of the longest value as text */
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
    uint16_t words[MQTT_WRITE_WORDS];
    uint16_t field;
    uint8_t is_used;
} write_request;

static line at;
static mbm_plan plan = MBM_INIT;
static mbm_planSetup setup;
static mqtt_fields fields;
static mqtt_broker broker;
static published *last;
static unit_state units[256];
static write_request writes[WRITES];
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
    mqtt_broker_publish(&broker, name, "status", units[unit].state == ONLINE ? "online" : "offline",
                        1);
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
    static char json[LONGEST_VALUE + 128];
    const published *what = &last[field];
    const char *value = what->value ? what->value : "null";
    struct timespec now;
    struct tm utc;
    uint32_t age = 0;
    char when[32];

    if (is_plain) {
        /* Plain text has no place for a status: what failed is not published. */
        if (what->value && what->status == MBM_OK)
            mqtt_broker_publish(&broker, fields.fields[field].name, NULL, value, 1);
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
    mqtt_broker_publish(&broker, fields.fields[field].name, NULL, json, 1);
}

/* Called by the plan for each field whose read has ended. */
static void on_update(void *context, mbm_plan *ended, uint16_t field)
{
    static char text[LONGEST_VALUE];
    published *was = &last[field];
    const uint8_t status = mbm_plan_getStatus(ended, field, NULL);
    int is_new = is_every || status != was->status || !was->has_ended;

    (void)context;
    if (status == MBM_OK && mqtt_value_text(ended, &fields, field, !is_plain, text, sizeof text) &&
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
    for (field = 0; field < fields.count; field++)
        if (last[field].has_ended)
            publish_value(field);
}

static void publish_result(uint16_t field, const char *result)
{
    mqtt_broker_publish(&broker, fields.fields[field].name, "result", result, 0);
}

static void on_written(void *context, mbm_clientRequest *request)
{
    write_request *write = (write_request *)context;

    publish_result(write->field, line_status(&at, request));
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
    count =
        mqtt_payload_parse(&fields.fields[field], planned, payload, length, write->words, &wrong);
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
    mqtt_event event;

    while (mqtt_broker_next(&broker, &event)) {
        const char *wrong;

        if (event.kind == MQTT_CONNECTED) {
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
    uint32_t micros = client < planned ? client : planned;
    struct pollfd waits[2] = {{.fd = broker.events[0], .events = POLLIN}, {.fd = -1}};
    struct timespec time;

    /* At most a second, since a signal just before the sleep does not end it. */
    if (micros > 1000000)
        micros = 1000000;
    if (at.is_tcp) {
        (void)mbm_tcp_wait(&at.tcp, 1, NULL, broker.events[0], micros);
        return;
    }
    if (mbm_client_pending(&at.client) > 0 && at.tty.isOpen) {
        waits[1].fd = at.tty.fd;
        waits[1].events = POLLIN;
    }
    time.tv_sec = micros / 1000000;
    time.tv_nsec = (long)(micros % 1000000) * 1000;
    (void)ppoll(waits, 2, &time, NULL);
}

/* Gives the plan its storage. Returns 0, or -1 after printing the reason. */
static int begin_plan(const char *path)
{
    const size_t count = fields.count;
    uint8_t status;
    uint16_t wrong;
    size_t field;

    last = (published *)calloc(count, sizeof *last);
    setup.fields = fields.planned;
    setup.fieldCount = setup.readCount = fields.count;
    setup.positions = (mbm_planPosition *)calloc(count, sizeof *setup.positions);
    setup.reads = (mbm_planRead *)calloc(count, sizeof *setup.reads);
    setup.data = (uint16_t *)calloc(65535, sizeof *setup.data);
    setup.requests = (mbm_clientRequest *)calloc(REQUESTS, sizeof *setup.requests);
    if (!last || !setup.positions || !setup.reads || !setup.data || !setup.requests) {
        fprintf(stderr, "%s: not enough memory\n", path);
        return -1;
    }
    setup.dataWords = 65535;
    setup.requestCount = REQUESTS;
    setup.update = on_update;
    for (field = 0; field < count; field++)
        units[fields.planned[field].unit].fields++;
    status = mbm_plan_begin(&plan, &at.client, &setup, &wrong);
    if (status == MBM_OK)
        return 0;
    if (wrong < fields.count)
        fprintf(stderr, "%s:%d: %s\n", path, fields.lines[wrong], mbm_status_text(status));
    else
        fprintf(stderr, "%s: %s\n", path, mbm_status_text(status));
    return -1;
}

static void free_all(void)
{
    uint16_t field;

    for (field = 0; last && field < fields.count; field++)
        free(last[field].value);
    free(last);
    free(setup.positions);
    free(setup.reads);
    free(setup.data);
    free(setup.requests);
    mqtt_fields_free(&fields);
}

static const char USAGE[] =
    "mqtt_bridge [options] PLACE FIELDS\n"
    "  FIELDS            the file of fields, see docs/mqtt.md\n"
    "  -b HOST[,PORT]    the broker, localhost and 1883 (with -C 8883) if left out\n"
    "  -t TOPIC          the beginning of all topics, modbus if left out\n"
    "  -i ID             the MQTT client identifier, random if left out\n"
    "  -u USER           the password is in the environment variable MQTT_PASSWORD\n"
    "  -C FILE           connect with TLS; the certificates that sign the broker's\n"
    "  -K CERT,KEY       files of the bridge's certificate and key\n"
    "  -p                publish plain text instead of JSON\n"
    "  -e                publish every reading, not only changes\n"
    "  -g GAP            registers between two fields that one request may read too, 0 if left out\n"
    "  -d MILLISECONDS   response timeout, 1000 if left out\n";

/* Reads the options. Returns 0 if they are wrong. */
static int read_options(int argc, char **argv, mqtt_options *options, uint16_t *timeout)
{
    static char host[256];
    char *port = NULL;
    int option;

    while ((option = getopt(argc, argv, "b:t:i:u:C:K:peg:d:")) != -1) {
        switch (option) {
        case 'b':
            snprintf(host, sizeof host, "%s", optarg);
            port = strchr(host, ',');
            options->host = host;
            break;
        case 't': options->topic = optarg; break;
        case 'i': options->id = optarg; break;
        case 'u': options->user = optarg; break;
        case 'C': options->ca_file = optarg; break;
        case 'K': options->identity = optarg; break;
        case 'p': is_plain = 1; break;
        case 'e': is_every = 1; break;
        case 'g': setup.registerGap = (uint8_t)line_number(optarg, 0, 123); break;
        case 'd': *timeout = (uint16_t)line_number(optarg, 1, 65535); break;
        default: return 0;
        }
    }
    options->port = options->ca_file ? 8883 : 1883;
    if (port) {
        *port = '\0';
        options->port = (int)line_number(port + 1, 1, 65535);
    }
    return argc - optind == 2;
}

int main(int argc, char **argv)
{
    mqtt_options options = {.host = "localhost", .topic = "modbus"};
    uint16_t timeout = 1000;
    int failed = 1;

    trace_options(&argc, argv);
    if (line_wants_help(argc, argv))
        return line_usage(0, USAGE);
    if (!read_options(argc, argv, &options, &timeout))
        return line_usage(1, USAGE);
    if (mqtt_fields_read(&fields, argv[optind + 1]) == 0 && line_open(&at, argv[optind]) == 0) {
        (void)mbm_client_setResponseTimeout(&at.client, timeout);
        if (begin_plan(argv[optind + 1]) == 0 && mqtt_broker_begin(&broker, &options, &fields) == 0)
            failed = 0;
    }
    while (!failed && !line_ended) {
        take_events();
        (void)mbm_plan_poll(&plan);
        line_poll(&at);
        if (!line_ended)
            rest();
    }
    if (!failed) {
        (void)mbm_plan_end(&plan);
        fprintf(stderr, "%lu messages published, %lu writes lost\n", atomic_load(&broker.published),
                atomic_load(&broker.lost));
        mqtt_broker_end(&broker);
        line_close(&at);
    }
    free_all();
    return failed;
}
