/* A plan of unit 1 on an RTU line that each test begins with, for the tests of its fields. Include
 * it in one file of a program. */
#ifndef PLAN_FIELDS_H
#define PLAN_FIELDS_H

#include "plan_device.h"
#include "test.h"

enum { HOLDING = MBM_TABLE_HOLDING_REGISTERS, COILS = MBM_TABLE_COILS };

static plan_device d;

static inline void rtu(void)
{
    plan_device_begin(&d, 0);
}

fixture each_test = {rtu, NULL};

/* Adds a field of one value, which is read each second. */
static inline mbm_planField *add(uint8_t type, uint16_t address)
{
    return plan_device_add(&d, 1, type == MBM_TYPE_BIT ? COILS : HOLDING, type, address, 1000);
}

static inline void read_all(void)
{
    plan_device_start(&d);
    plan_device_run(&d, 200);
}

#endif
