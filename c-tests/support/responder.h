/* A scripted device at the far end of a pty. A script decides what it answers to each
 * request of eight bytes. */
#ifndef RESPONDER_H
#define RESPONDER_H

#include "held_clock.h"
#include "pty.h"

#include <pthread.h>
#include <stddef.h>
#include <stdint.h>

typedef struct responder responder;

/* Plays the answer to request number `number`. The first request is number 1. */
typedef void (*responder_script)(responder *r, const uint8_t *request, unsigned number);

struct responder {
    pty line;
    held_clock clock; /* for the master */
    responder_script script;
    int stop[2];
    pthread_t thread;
};

void responder_start(responder *r, responder_script script);
void responder_stop(responder *r);

/* For scripts: sends bytes, and makes pauses. */
void responder_send(responder *r, const uint8_t *bytes, size_t length);
void responder_pause(responder *r, unsigned milliseconds);

/* For scripts: lets time pass until the master has sent another request. */
void responder_pause_until_request(responder *r);

#endif
