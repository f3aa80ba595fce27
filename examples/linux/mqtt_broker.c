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

/* The mark of a subscription: every field's topic to write. */
static const char WRITES[] = "/set";

static void join(char topic[LONGEST_TOPIC], const char *first, const char *name, const char *last)
{
    snprintf(topic, LONGEST_TOPIC, "%s/%s%s%s", first, name, last ? "/" : "", last ? last : "");
}

/* Called by libmosquitto's thread. A pipe takes less than PIPE_BUF bytes whole or not at all. */
static void send_event(mqtt_broker *broker, const mqtt_event *event)
{
    if (write(broker->events[1], event, sizeof *event) != (ssize_t)sizeof *event)
        atomic_fetch_add(&broker->lost, 1);
}

static void on_connect(struct mosquitto *mosquitto, void *context, int refused)
{
    mqtt_broker *broker = (mqtt_broker *)context;
    const mqtt_event event = {.kind = MQTT_CONNECTED};
    int field;

    if (refused) {
        fprintf(stderr, "the broker refuses: %s\n", mosquitto_connack_string(refused));
        return;
    }
    for (field = 0; field < broker->fields->count; field++) {
        char topic[LONGEST_TOPIC];

        if (!broker->fields->fields[field].is_writable)
            continue;
        join(topic, broker->topic, broker->fields->fields[field].name, WRITES + 1);
        mosquitto_subscribe(mosquitto, NULL, topic, 1);
    }
    mqtt_broker_publish(broker, "status", NULL, "online", 1);
    send_event(broker, &event);
}

static void on_message(struct mosquitto *mosquitto, void *context,
                       const struct mosquitto_message *message)
{
    mqtt_broker *broker = (mqtt_broker *)context;
    mqtt_event event = {.kind = MQTT_WRITE};
    const size_t first = strlen(broker->topic) + 1;
    char name[LONGEST_TOPIC];
    size_t length = strlen(message->topic);

    (void)mosquitto;
    if (length < first + sizeof WRITES - 1 || length - first >= sizeof name)
        return;
    length -= first + sizeof WRITES - 1;
    memcpy(name, message->topic + first, length);
    name[length] = '\0';
    event.field = mqtt_fields_find(broker->fields, name);
    if (event.field < 0)
        return;
    if (message->retain) {
        event.kind = MQTT_REFUSED;
        event.reason = "a retained write is not carried out: it would be repeated";
    } else if (message->payloadlen > MQTT_LONGEST_WRITE) {
        event.kind = MQTT_REFUSED;
        event.reason = "the payload is too long";
    } else if (message->payloadlen > 0) {
        memcpy(event.payload, message->payload, (size_t)message->payloadlen);
    }
    send_event(broker, &event);
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
