/* What a bad wire does to the first of five transactions, and what is to become
 * of them: run by the facade and by the client. */
#ifndef FAULTS_H
#define FAULTS_H

#include "mbm.h"
#include "responder.h"

enum { FAULT_UNIT = 1, FAULT_TRANSACTIONS = 5, FAULT_REGISTERS = 10 };

typedef struct fault {
    const char *name;
    void (*play)(responder *r, const uint8_t *request);
    uint8_t function;     /* of the five requests, 03 or 06 */
    uint8_t echo;         /* the master has its echo discard on */
    const char *expected; /* without a retry */
    uint8_t status;       /* of the first transaction */
    const char *retried;  /* with one retry */
} fault;

extern const fault faults[];
extern const unsigned fault_count;

/* Every register's value tells its address, so that stale data shows. */
uint16_t fault_value(unsigned address);

/* Writes the right reply to a request of function 03 or 06, with its CRC, and returns
 * how long it is. */
size_t fault_right_reply(uint8_t *frame, const uint8_t *request);

/* Starts a device that plays the fault at the first request. */
void fault_start(responder *device, const fault *f);

/* The master's port over a line to it: the device's clock, and the link may die. */
mbm_port fault_port(responder *device, const mbm_port *line);

/* True if no transaction fares worse than expected: '.' right, 'F' failed. */
int fault_as_good(const char *found, const char *expected);

#endif
