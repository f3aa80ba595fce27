#define _GNU_SOURCE
#include "mqtt_broker.h"

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
static int send_event(mqtt_broker *broker, const mqtt_event *event)
{
    return write(broker->events[1], event, sizeof *event) == (ssize_t)sizeof *event;
}

/* Subscribes to the topics of writes: for the answers to writes to unknown fields, to those of each
 * name with up to MQTT_LEVELS levels. */
static void subscribe(mqtt_broker *broker)
{
    char topic[LONGEST_TOPIC], levels[2 * MQTT_LEVELS + 1] = "";
    int count;

    for (count = 0; count < MQTT_LEVELS; count++) {
        strcat(levels, count > 0 ? "/+" : "+");
        join(topic, broker->topic, levels, SET + 1);
        mosquitto_subscribe(broker->mosquitto, NULL, topic, 1);
    }
}

static void on_connect(struct mosquitto *mosquitto, void *context, int refused)
{
    mqtt_broker *broker = (mqtt_broker *)context;
    const mqtt_event event = {.kind = MQTT_CONNECTED};

    (void)mosquitto;
    if (refused) {
        fprintf(stderr, "the broker refuses: %s\n", mosquitto_connack_string(refused));
        return;
    }
    subscribe(broker);
    mqtt_broker_publish(broker, "status", NULL, "online", 1);
    (void)send_event(broker, &event);
}

/* Hands a write on to the program. Returns NULL, or why it is refused. */
static const char *take_write(mqtt_broker *broker, const char *name,
                              const struct mosquitto_message *message)
{
    const int field = mqtt_fields_find(broker->fields, name);
    mqtt_event event = {.kind = MQTT_WRITE};

    if (field < 0)
        return "there is no such field";
    if (!broker->fields->fields[field].is_writable)
        return "the field is not writable";
    if (message->retain)
        return "a retained write is not carried out: it would be repeated";
    if (message->payloadlen > MQTT_LONGEST_WRITE)
        return "the payload is too long";
    event.field = (uint16_t)field;
    event.length = (uint16_t)message->payloadlen;
    memcpy(event.payload, message->payload, event.length);
    if (send_event(broker, &event))
        return NULL;
    atomic_fetch_add(&broker->lost, 1);
    return "too many writes wait";
}

static void on_message(struct mosquitto *mosquitto, void *context,
                       const struct mosquitto_message *message)
{
    mqtt_broker *broker = (mqtt_broker *)context;
    const size_t first = strlen(broker->topic) + 1, length = strlen(message->topic);
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
    wrong = take_write(broker, name, message);
    if (wrong)
        mqtt_broker_publish(broker, name, RESULT + 1, wrong, 0);
}

/* Applies the options. Returns MOSQ_ERR_SUCCESS or the error of libmosquitto. */
static int set_options(struct mosquitto *mosquitto, const mqtt_options *options)
{
    char identity[2 * LONGEST_TOPIC] = "", *key;
    int error = MOSQ_ERR_SUCCESS;

    if (options->user)
        error = mosquitto_username_pw_set(mosquitto, options->user, getenv("MQTT_PASSWORD"));
    if (error || !options->ca_file)
        return error;
    snprintf(identity, sizeof identity, "%s", options->identity ? options->identity : "");
    key = strchr(identity, ',');
    if (key)
        *key++ = '\0';
    return mosquitto_tls_set(mosquitto, options->ca_file, NULL, key ? identity : NULL, key, NULL);
}

int mqtt_broker_begin(mqtt_broker *broker, const mqtt_options *options, const mqtt_fields *fields)
{
    char topic[LONGEST_TOPIC];
    int error;

    memset(broker, 0, sizeof *broker);
    broker->fields = fields;
    broker->topic = options->topic;
    if (pipe2(broker->events, O_NONBLOCK | O_CLOEXEC) != 0) {
        perror("pipe");
        return -1;
    }
    if (strlen(options->topic) > MQTT_LONGEST_NAME) {
        fprintf(stderr, "%s: a topic has at most %d bytes\n", options->topic, MQTT_LONGEST_NAME);
        return -1;
    }
    mosquitto_lib_init();
    broker->mosquitto = mosquitto_new(options->id, 1, broker);
    if (!broker->mosquitto) {
        fprintf(stderr, "mosquitto_new: %s\n", strerror(errno));
        return -1;
    }
    mosquitto_connect_callback_set(broker->mosquitto, on_connect);
    mosquitto_message_callback_set(broker->mosquitto, on_message);
    mosquitto_reconnect_delay_set(broker->mosquitto, 1, 30, 1);
    join(topic, options->topic, "status", NULL);
    error = mosquitto_will_set(broker->mosquitto, topic, 7, "offline", 1, 1);
    if (!error)
        error = set_options(broker->mosquitto, options);
    if (!error)
        error = mosquitto_loop_start(broker->mosquitto);
    if (error) {
        fprintf(stderr, "%s: %s\n", options->topic, mosquitto_strerror(error));
        return -1;
    }
    /* A broker that cannot be reached now is tried again by the thread. */
    error = mosquitto_connect_async(broker->mosquitto, options->host, options->port, 15);
    if (error == MOSQ_ERR_INVAL) {
        fprintf(stderr, "%s: %s\n", options->host, mosquitto_strerror(error));
        return -1;
    }
    if (error)
        fprintf(stderr, "%s: %s; the bridge tries again\n", options->host,
                error == MOSQ_ERR_ERRNO ? strerror(errno) : mosquitto_strerror(error));
    return 0;
}

int mqtt_broker_next(mqtt_broker *broker, mqtt_event *event)
{
    return read(broker->events[0], event, sizeof *event) == (ssize_t)sizeof *event;
}

void mqtt_broker_publish(mqtt_broker *broker, const char *name, const char *last, const char *text,
                         int is_retained)
{
    char topic[LONGEST_TOPIC];

    join(topic, broker->topic, name, last);
    if (mosquitto_publish(broker->mosquitto, NULL, topic, (int)strlen(text), text, 0,
                          is_retained) == MOSQ_ERR_SUCCESS)
        atomic_fetch_add(&broker->published, 1);
}

void mqtt_broker_end(mqtt_broker *broker)
{
    mqtt_broker_publish(broker, "status", NULL, "offline", 1);
    mosquitto_disconnect(broker->mosquitto);
    mosquitto_loop_stop(broker->mosquitto, 0);
    mosquitto_destroy(broker->mosquitto);
    mosquitto_lib_cleanup();
    close(broker->events[0]);
    close(broker->events[1]);
}
