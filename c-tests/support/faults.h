/* The faults of a bad wire. The first of five transactions meets the fault. Each row says
 * how the five transactions may end. The tests of the master and of the client run the same
 * rows. */
#ifndef FAULTS_H
#define FAULTS_H

#include "mbm.h"
#include "responder.h"

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
