/* The connection of mqtt_bridge to its broker, by libmosquitto. A thread of libmosquitto connects,
 * and connects again after the broker was lost, after 1 s, then 2 s, up to 30 s. What arrives is
 * handed to the program through a pipe, so the program needs no locks.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef MQTT_BROKER_H
#define MQTT_BROKER_H

#include "mqtt_payload.h"

#include <stdatomic.h>

struct mosquitto;

typedef struct mqtt_options {
    const char *host;
    int port;
    const char *topic;    /* the beginning of all topics */
    const char *id;       /* the client identifier; NULL for a random one */
    const char *user;     /* NULL for none; the password is in the environment, MQTT_PASSWORD */
    const char *ca_file;  /* the certificates that sign the broker's; NULL: no TLS */
    const char *identity; /* files of the client's certificate and key, CERTIFICATE,KEY; or NULL */
} mqtt_options;

/* What the broker sends: that it is connected, or a write to a field that may be written. */
typedef struct mqtt_event {
    enum { MQTT_CONNECTED, MQTT_WRITE } kind;
    uint16_t field;  /* MQTT_WRITE: the index of the field */
    uint16_t length; /* MQTT_WRITE: bytes of the payload */
    char payload[MQTT_LONGEST_WRITE];
} mqtt_event;

typedef struct mqtt_broker {
    struct mosquitto *mosquitto;
    const mqtt_fields *fields;
    const char *topic;
    int events[2]; /* a pipe: poll events[0] for POLLIN */
    atomic_ulong published;
    atomic_ulong lost; /* writes that the pipe did not take */
} mqtt_broker;

/* Begins to connect, and does not wait for it. Returns 0, or -1 after printing the reason. */
int mqtt_broker_begin(mqtt_broker *broker, const mqtt_options *options, const mqtt_fields *fields);

/* Takes the next event. Returns 0 if there is none. */
int mqtt_broker_next(mqtt_broker *broker, mqtt_event *event);

/* Publishes a text below the broker's topic: TOPIC/NAME, or TOPIC/NAME/LAST if `last` is not NULL.
 * While there is no broker it does nothing: the program publishes everything after MQTT_CONNECTED.
 */
void mqtt_broker_publish(mqtt_broker *broker, const char *name, const char *last, const char *text,
                         int is_retained);

/* Publishes that the bridge is offline, and disconnects. */
void mqtt_broker_end(mqtt_broker *broker);

#endif
