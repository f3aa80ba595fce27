/* The faults of a bad wire. The first of five transactions meets the fault. Each row says
 * how the five transactions may end. The tests of the master and of the client run the same
 * rows. */
#ifndef FAULTS_H
#define FAULTS_H

#include "mbm.h"
#include "held_clock.h"
#include "pty.h"
#include <pthread.h>
#include <stddef.h>
#include <stdint.h>

/* A scripted device at the far end of a pty. A script decides what it answers to each
 * request of eight bytes. */
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

enum { FAULT_UNIT = 1, FAULT_TRANSACTIONS = 5, FAULT_REGISTERS = 10 };

typedef struct fault {
    const char *name;
    void (*play)(responder *r, const uint8_t *request);
    uint8_t function;     /* of the five requests: 03 or 06 */
    uint8_t echo;         /* 1: echo discard is on */
    const char *expected; /* the outcomes without a retry */
    uint8_t status;       /* the status of the first transaction */
    const char *retried;  /* the outcomes with one retry */
} fault;

extern const fault faults[];
extern const unsigned fault_count;

/* The value of each register contains its address, so that stale data are noticed. */
uint16_t fault_value(unsigned address);

/* Writes the right reply to a request of function 03 or 06, with its CRC. Returns its length. */
size_t fault_right_reply(uint8_t *frame, const uint8_t *request);

/* Starts a device that plays the fault at the first request. */
void fault_start(responder *device, const fault *f);

/* The master's port over `line`, with the device's clock. A fault may end the link. */
mbm_port fault_port(responder *device, const mbm_port *line);

/* Returns 1 if no transaction ended worse than expected: '.' right data, 'F' a failed call. */
int fault_as_good(const char *found, const char *expected);

/* Prints how the transactions of a fault ended, without and with a retry, and the status of
 * the first. Returns 1 if anything is worse than expected. */
int fault_report(const fault *f, const char *plain, const char *retried, uint8_t status);

#endif
