/* A plan over a port in memory: units that answer as a test wants, a clock of its own, and a
 * log of what was requested when. */
#ifndef PLAN_DEVICE_H
#define PLAN_DEVICE_H

#include "memory_port.h"

enum { PLAN_FIELDS = 16, PLAN_WORDS = 256, PLAN_REGISTERS = 400, PLAN_UNITS = 8, PLAN_LOG = 2000 };

/* How a unit answers. */
enum { ANSWERS, SILENT, HALF_A_REPLY, EXCEPTION, WRONG_CRC };

typedef struct plan_request {
    uint32_t ms; /* when it was sent */
    uint8_t unit, function;
    uint16_t address, quantity;
} plan_request;

typedef struct plan_update {
    uint32_t ms;
    uint16_t field;
    uint8_t status;
} plan_update;

typedef struct plan_device {
    memory_port memory;
    mbm_client client;
    mbm_plan plan;
    mbm_planSetup setup;
    mbm_planField fields[PLAN_FIELDS];
    mbm_planPosition positions[PLAN_FIELDS];
    mbm_planRead reads[PLAN_FIELDS];
    mbm_clientRequest requests[16];
    uint16_t data[PLAN_WORDS];
    uint8_t frame[MBM_MAX_TCP_FRAME], outgoing[16 * 12];
    uint8_t is_tcp;
    uint16_t registers[PLAN_REGISTERS]; /* of every unit; bit `n` of a table is its bit 0 */
    uint8_t answers[PLAN_UNITS];
    uint8_t silent_function;       /* a function that no unit answers */
    uint8_t lacks[PLAN_REGISTERS]; /* 1 for an address that no unit has */
    uint16_t longest;              /* how much one read may request; 0 for any */
    mbm_planSplitting splitting;   /* with `blocks` it is used */
    plan_request log[PLAN_LOG];
    unsigned requested;
    plan_update updates[PLAN_LOG];
    unsigned updated;
} plan_device;

/* A client of an RTU line or of Modbus TCP, begun, with a response timeout of 100 ms; the setup
 * has all storage, no fields, one request, and logs updates. */
void plan_device_begin(plan_device *d, int is_tcp);

/* Adds a field of one value, and returns it. */
mbm_planField *plan_device_add(plan_device *d, uint8_t unit, uint8_t table, uint8_t type,
                               uint16_t address, uint32_t intervalMs);

/* Begins the plan, or asserts that it can. */
uint8_t plan_device_try(plan_device *d, uint16_t *field);
void plan_device_start(plan_device *d);

/* Polls plan and client for so long, and lets the time pass as they say. */
void plan_device_run(plan_device *d, uint32_t ms);

/* How many requests were sent to a unit, and how many updates of a field there were. */
unsigned plan_device_requests(const plan_device *d, uint8_t unit);
unsigned plan_device_updates(const plan_device *d, uint16_t field);

/* A value as an integer; asserts that there is one. */
int64_t plan_device_integer(plan_device *d, uint16_t field, uint16_t index);

#endif
