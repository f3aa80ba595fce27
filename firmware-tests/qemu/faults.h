/* What a bad wire makes of the reply to a read of ten registers. */
#ifndef FAULTS_H
#define FAULTS_H

#include "device.h"

typedef struct fault {
    const char *name;
    device_fault spoil;
    uint8_t status;            /* of the request that meets the fault */
    uint8_t resynchronisation; /* 1: the reply is found after bytes that are no frame */
    uint8_t foreign;           /* 1: a frame of another unit or function comes first */
} fault;

extern const fault faults[];
extern const unsigned fault_count;

#endif
