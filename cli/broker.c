/* Connects to the broker with libmosquitto, and hands what arrives to the program through a pipe.
 */
#include "broker.h"

#include "report.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <mosquitto.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { LONGEST_TOPIC = BROKER_LONGEST_TOPIC };

/* A write to a pipe is whole only up to PIPE_BUF. */
_Static_assert(sizeof(broker_event) <= PIPE_BUF, "an event is longer than a pipe takes at once");

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
    const size_t size =
        offsetof(broker_event, bytes) + (size_t)event->name_bytes + (size_t)event->length;

    return write(of->events[1], event, size) == (ssize_t)size;
}

/* Calls a function with each of the topics of writes below a name. */
static void for_levels(broker *of, const char *below, void (*each)(broker *of, const char *topic))
{
    char topic[LONGEST_TOPIC], levels[BROKER_TOPIC_BYTES + 2 * NAMES_LEVELS + 1];
    int count;

    snprintf(levels, sizeof levels, "%s", below);
    for (count = 0; count < NAMES_LEVELS; count++) {
        strcat(levels, count > 0 ? "/+" : "+");
        join(topic, of->topic, levels, SET + 1);
        each(of, topic);
    }
}

static void subscribe_topic(broker *of, const char *topic)
{
    mosquitto_subscribe(of->mosquitto, NULL, topic, 1);
}

static void unsubscribe_topic(broker *of, const char *topic)
{
    mosquitto_unsubscribe(of->mosquitto, NULL, topic);
}

void broker_subscribe(broker *of, const char *below)
{
    for_levels(of, below, subscribe_topic);
}

void broker_unsubscribe(broker *of, const char *below)
{
    for_levels(of, below, unsubscribe_topic);
}

/* An error in words, without the full stop of some of libmosquitto's. Each thread has its own. */
static const char *text_of(int error)
{
    static _Thread_local char text[200];
    size_t length;

    snprintf(text, sizeof text, "%s",
             error == MOSQ_ERR_ERRNO ? strerror(errno) : mosquitto_strerror(error));
    length = strlen(text);
    if (length > 0 && text[length - 1] == '.')
        text[length - 1] = '\0';
    return text;
}

static void on_connect(struct mosquitto *mosquitto, void *context, int refused)
{
    broker *of = (broker *)context;
    const broker_event event = {.kind = BROKER_CONNECTED};

    (void)mosquitto;
    if (refused) {
        report_log(REPORT_ERROR, "the broker %s refuses: %s", of->address,
                   mosquitto_connack_string(refused));
        return;
    }
    report_log(REPORT_INFO, "the broker %s is connected", of->address);
    atomic_store(&of->is_connected, 1);
    atomic_fetch_add(&of->connects, 1);
    atomic_store(&of->is_new, 1);
    /* It wakes the program. If the pipe is full, the program is awake. */
    (void)send_event(of, &event);
}

static void on_disconnect(struct mosquitto *mosquitto, void *context, int reason)
{
    broker *of = (broker *)context;

    (void)mosquitto;
    if (atomic_exchange(&of->is_connected, 0) && reason != MOSQ_ERR_SUCCESS)
        report_log(REPORT_WARNING, "the broker %s is lost: %s. The bridge connects again",
                   of->address, text_of(reason));
}

static void on_message(struct mosquitto *mosquitto, void *context,
                       const struct mosquitto_message *message)
{
    broker *of = (broker *)context;
    const size_t first = strlen(of->topic) + 1, length = strlen(message->topic);
    broker_event event = {.kind = BROKER_WRITE, .is_retained = message->retain};
    size_t name;

    (void)mosquitto;
    /* A publisher clears a retained message with an empty one. */
    if (message->payloadlen <= 0)
        return;
    /* A name whose result would have too long a topic is no field's. */
    if (length < first + sizeof SET - 1 || length + sizeof RESULT > LONGEST_TOPIC)
        return;
    name = length - first - (sizeof SET - 1);
    memcpy(event.bytes, message->topic + first, name);
    event.bytes[name] = '\0';
    event.name_bytes = (uint16_t)(name + 1);
    event.is_too_long = message->payloadlen > PAYLOAD_LONGEST;
    if (!event.is_too_long) {
        event.length = (uint16_t)message->payloadlen;
        memcpy(event.bytes + event.name_bytes, message->payload, event.length);
    }
    if (send_event(of, &event))
        return;
    atomic_fetch_add(&of->lost, 1);
    broker_publish(of, event.bytes, RESULT + 1, "too many writes wait", 0);
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

int broker_begin(broker *of, const broker_options *options)
{
    static char address[300];
    char topic[LONGEST_TOPIC];
    int error;

    memset(of, 0, sizeof *of);
    of->topic = options->topic;
    snprintf(address, sizeof address, strchr(options->host, ':') ? "[%s]:%d" : "%s:%d",
             options->host, options->port);
    of->address = address;
    if (pipe2(of->events, O_NONBLOCK | O_CLOEXEC) != 0)
        return report(CODE_SYSTEM, "a pipe: %s", strerror(errno));
    mosquitto_lib_init();
    of->mosquitto = mosquitto_new(options->id, 1, of);
    if (!of->mosquitto)
        return report(CODE_SYSTEM, "the MQTT client: %s", strerror(errno));
    mosquitto_connect_callback_set(of->mosquitto, on_connect);
    mosquitto_disconnect_callback_set(of->mosquitto, on_disconnect);
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
    error = mosquitto_connect_async(of->mosquitto, options->host, options->port,
                                    options->keep_alive ? options->keep_alive : 15);
    if (error == MOSQ_ERR_INVAL)
        return report(CODE_WRONG, "the broker %s: %s", options->host, text_of(error));
    if (error)
        report_log(REPORT_WARNING, "the broker %s: %s. The bridge tries again", of->address,
                   text_of(error));
    return CODE_DONE;
}

int broker_next(broker *of, broker_event *event)
{
    const size_t head = offsetof(broker_event, bytes);
    size_t rest;

    do {
        if (atomic_exchange(&of->is_new, 0)) {
            event->kind = BROKER_CONNECTED;
            return 1;
        }
        if (read(of->events[0], event, head) != (ssize_t)head)
            return 0;
    } while (event->kind == BROKER_CONNECTED);
    /* The pipe has the whole event. */
    rest = (size_t)event->name_bytes + event->length;
    return read(of->events[0], event->bytes, rest) == (ssize_t)rest;
}

static void publish(broker *of, const char *topic, const char *text, int is_retained)
{
    if (mosquitto_publish(of->mosquitto, NULL, topic, (int)strlen(text), text, 0, is_retained) ==
        MOSQ_ERR_SUCCESS)
        atomic_fetch_add(&of->published, 1);
}

void broker_publish(broker *of, const char *name, const char *last, const char *text,
                    int is_retained)
{
    char topic[LONGEST_TOPIC];

    join(topic, of->topic, name, last);
    publish(of, topic, text, is_retained);
}

void broker_publish_at(broker *of, const char *topic, const char *text)
{
    publish(of, topic, text, 1);
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
