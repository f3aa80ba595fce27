/* The connection of `mbm bridge` to its MQTT broker, by libmosquitto. A thread of libmosquitto
 * connects, and connects again after the broker was lost, after 1 s, then 2 s, up to 30 s. It hands
 * what arrives to the program through a pipe, so the program needs no locks. */
#pragma once

#include "device.h"
#include "names.h"
#include "payload.h"

#include <stdatomic.h>

struct mosquitto;

/* The most bytes of the topic of a bridge. */
enum { BROKER_TOPIC_BYTES = 200 };

typedef struct broker_options {
    const char *host;
    int port;
    int keep_alive;      /* seconds; 0: 15 */
    const char *topic;   /* the beginning of all topics */
    const char *id;      /* the client identifier; NULL for a random one */
    const char *user;    /* NULL for none; the password is in the environment, MQTT_PASSWORD */
    const char *ca_file; /* the certificates that sign the broker's; NULL: no TLS */
    const char *cert_file, *key_file; /* of the bridge; or NULL */
} broker_options;

/* Bytes of the longest topic, with its end. */
enum { BROKER_LONGEST_TOPIC = 512 };

/* What the broker sends: that it is connected, or a write: a message to TOPIC/NAME/set. */
typedef struct broker_event {
    enum { BROKER_CONNECTED, BROKER_WRITE } kind;
    uint8_t is_retained, is_too_long; /* without its payload then */
    uint16_t name_bytes, length; /* of the bytes: first the name and its zero, then the payload */
    char bytes[BROKER_LONGEST_TOPIC + PAYLOAD_LONGEST];
} broker_event;

typedef struct broker {
    struct mosquitto *mosquitto;
    const char *topic, *address;     /* `address` is for log lines */
    int events[2];                   /* a pipe: poll events[0] for POLLIN */
    atomic_int is_connected, is_new; /* is_new: connected, and the program does not know it yet */
    atomic_ulong published, connects;
    atomic_ulong lost; /* writes that the pipe did not take */
} broker;

/* Begins to connect, and does not wait for it. Returns an exit code, after reporting the reason if
 * it is not CODE_DONE. */
int broker_begin(broker *of, const broker_options *options);

/* Subscribe to the writes of all names below a name that ends with /, or of all names if it is
 * empty; and end that. Topics have up to NAMES_LEVELS levels, so that writes to unknown fields are
 * answered. Call them after BROKER_CONNECTED. */
void broker_subscribe(broker *of, const char *below);
void broker_unsubscribe(broker *of, const char *below);

/* Takes the next event. Returns 0 if there is none. */
int broker_next(broker *of, broker_event *event);

/* Publishes a text below the broker's topic: TOPIC/NAME, or TOPIC/NAME/LAST if `last` is not NULL.
 * While there is no broker it does nothing: the program publishes everything after
 * BROKER_CONNECTED.
 */
void broker_publish(broker *of, const char *name, const char *last, const char *text,
                    int is_retained);

/* Publishes a retained text at any topic, or removes what is retained there, if `text` is empty. */
void broker_publish_at(broker *of, const char *topic, const char *text);

/* Publishes that the bridge is offline, and disconnects. */
void broker_end(broker *of);
