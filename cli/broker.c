#define _GNU_SOURCE
#include "broker.h"

#include "report.h"

#include <errno.h>
#include <fcntl.h>
#include <mosquitto.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Bytes of the longest topic. */
enum { LONGEST_TOPIC = 512 };

/* The ends of the topics of a write and of its result. */
static const char SET[] = "/set", RESULT[] = "/result";

static void join(char topic[LONGEST_TOPIC], const char *first, const char *name, const char *last)
{
    snprintf(topic, LONGEST_TOPIC, "%s/%s%s%s", first, name, last ? "/" : "", last ? last : "");
}

/* Called by libmosquitto's thread. A pipe takes less than PIPE_BUF bytes whole or not at all.
 * Returns 0 if it is full. */
static int send_event(broker *of, const broker_event *event)
{
    return write(of->events[1], event, sizeof *event) == (ssize_t)sizeof *event;
}

/* Subscribes to the topics of writes: for the answers to writes to unknown fields, to those of each
 * name with up to BROKER_LEVELS levels. */
static void subscribe(broker *of)
{
    char topic[LONGEST_TOPIC], levels[2 * BROKER_LEVELS + 1] = "";
    int count;

    for (count = 0; count < BROKER_LEVELS; count++) {
        strcat(levels, count > 0 ? "/+" : "+");
        join(topic, of->topic, levels, SET + 1);
        mosquitto_subscribe(of->mosquitto, NULL, topic, 1);
    }
}

static void on_connect(struct mosquitto *mosquitto, void *context, int refused)
{
    broker *of = (broker *)context;
    const broker_event event = {.kind = BROKER_CONNECTED};

    (void)mosquitto;
    if (refused) {
        fprintf(stderr, "%s: the broker refuses: %s.\n", report_name,
                mosquitto_connack_string(refused));
        return;
    }
    subscribe(of);
    broker_publish(of, "status", NULL, "online", 1);
    (void)send_event(of, &event);
}

/* Hands a write on to the program. Returns NULL, or why it is refused. */
static const char *take_write(broker *of, const char *name, const struct mosquitto_message *message)
{
    const int field = device_find(of->device, name);
    broker_event event = {.kind = BROKER_WRITE};

    if (field < 0)
        return "there is no such field";
    if (!(of->device->fields[field].access & DEVICE_WRITE))
        return "the field is not writable";
    if (message->retain)
        return "a retained write is not carried out: it would be repeated";
    if (message->payloadlen > PAYLOAD_BYTES)
        return "the payload is too long";
    event.field = (uint16_t)field;
    event.length = (uint16_t)message->payloadlen;
    memcpy(event.payload, message->payload, event.length);
    if (send_event(of, &event))
        return NULL;
    atomic_fetch_add(&of->lost, 1);
    return "too many writes wait";
}

static void on_message(struct mosquitto *mosquitto, void *context,
                       const struct mosquitto_message *message)
{
    broker *of = (broker *)context;
    const size_t first = strlen(of->topic) + 1, length = strlen(message->topic);
    const char *wrong;
    char name[LONGEST_TOPIC];

    (void)mosquitto;
    /* A publisher clears a retained message with an empty one. */
    if (message->payloadlen <= 0)
        return;
    /* A name whose result would have too long a topic is no field's. */
    if (length < first + sizeof SET - 1 || length + sizeof RESULT > sizeof name)
        return;
    snprintf(name, sizeof name, "%.*s", (int)(length - first - (sizeof SET - 1)),
             message->topic + first);
    wrong = take_write(of, name, message);
    if (wrong)
        broker_publish(of, name, RESULT + 1, wrong, 0);
}

const char *broker_check_name(const char *name)
{
    const char *last = strrchr(name, '/'), *at = name;
    int levels = 1;

    last = last ? last + 1 : name;
    if (strpbrk(name, "+# ") || name[0] == '/')
        return "a name in topics has no +, # or space, and does not begin with /";
    for (; *at; at++)
        levels += *at == '/';
    if (levels > BROKER_LEVELS)
        return "a name in topics has at most 8 levels";
    if (strcmp(last, "set") == 0 || strcmp(last, "result") == 0 || strcmp(name, "status") == 0 ||
        (levels == 3 && strncmp(name, "unit/", 5) == 0 && strcmp(last, "status") == 0))
        return "the name is that of a topic of the bridge: NAME/set, NAME/result, status or "
               "unit/N/status";
    return NULL;
}

/* Applies the options. Returns MOSQ_ERR_SUCCESS or the error of libmosquitto. */
static int set_options(struct mosquitto *mosquitto, const broker_options *options)
{
    int error = MOSQ_ERR_SUCCESS;

    if (options->user)
        error = mosquitto_username_pw_set(mosquitto, options->user, getenv("MQTT_PASSWORD"));
    if (!error && options->ca_file)
        error = mosquitto_tls_set(mosquitto, options->ca_file, NULL, options->cert_file,
                                  options->key_file, NULL);
    return error;
}

static const char *text_of(int error)
{
    return error == MOSQ_ERR_ERRNO ? strerror(errno) : mosquitto_strerror(error);
}

int broker_begin(broker *of, const broker_options *options, const device *with)
{
    char topic[LONGEST_TOPIC];
    int error;

    memset(of, 0, sizeof *of);
    of->device = with;
    of->topic = options->topic;
    if (pipe2(of->events, O_NONBLOCK | O_CLOEXEC) != 0)
        return report(CODE_SYSTEM, "a pipe: %s", strerror(errno));
    mosquitto_lib_init();
    of->mosquitto = mosquitto_new(options->id, 1, of);
    if (!of->mosquitto)
        return report(CODE_SYSTEM, "the MQTT client: %s", strerror(errno));
    mosquitto_connect_callback_set(of->mosquitto, on_connect);
    mosquitto_message_callback_set(of->mosquitto, on_message);
    mosquitto_reconnect_delay_set(of->mosquitto, 1, 30, 1);
    join(topic, options->topic, "status", NULL);
    error = mosquitto_will_set(of->mosquitto, topic, 7, "offline", 1, 1);
    if (error)
        return report(CODE_WRONG, "the topic %s: %s", options->topic, text_of(error));
    error = set_options(of->mosquitto, options);
    if (error)
        return report(CODE_WRONG, "TLS or the user of the broker: %s. Check --ca, --cert and --key",
                      text_of(error));
    error = mosquitto_loop_start(of->mosquitto);
    if (error)
        return report(CODE_SYSTEM, "the MQTT client: %s", text_of(error));
    /* A broker that cannot be reached now is tried again by the thread. */
    error = mosquitto_connect_async(of->mosquitto, options->host, options->port, 15);
    if (error == MOSQ_ERR_INVAL)
        return report(CODE_WRONG, "the broker %s: %s", options->host, text_of(error));
    if (error)
        fprintf(stderr, "%s: the broker %s: %s. The bridge tries again.\n", report_name,
                options->host, text_of(error));
    return CODE_DONE;
}

int broker_next(broker *of, broker_event *event)
{
    return read(of->events[0], event, sizeof *event) == (ssize_t)sizeof *event;
}

void broker_publish(broker *of, const char *name, const char *last, const char *text,
                    int is_retained)
{
    char topic[LONGEST_TOPIC];

    join(topic, of->topic, name, last);
    if (mosquitto_publish(of->mosquitto, NULL, topic, (int)strlen(text), text, 0, is_retained) ==
        MOSQ_ERR_SUCCESS)
        atomic_fetch_add(&of->published, 1);
}

void broker_end(broker *of)
{
    broker_publish(of, "status", NULL, "offline", 1);
    mosquitto_disconnect(of->mosquitto);
    mosquitto_loop_stop(of->mosquitto, 0);
    mosquitto_destroy(of->mosquitto);
    mosquitto_lib_cleanup();
    close(of->events[0]);
    close(of->events[1]);
}
