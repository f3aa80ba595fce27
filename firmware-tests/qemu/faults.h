/* What a bad wire makes of the reply to a read of ten registers. */
#ifndef FAULTS_H
#define FAULTS_H

#include "device.h"

typedef struct fault {
    const char *name;
    device_fault spoil;
    uint8_t status;            /* of the request that meets it */
    uint8_t resynchronisation; /* whether the reply is found behind bytes of no frame */
    uint8_t foreign;           /* whether a frame of others comes before */
} fault;

extern const fault faults[];
extern const unsigned fault_count;

#endif
