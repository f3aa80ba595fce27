/* What the tests of when a plan reads share: one plan over a line, and short names. */
#ifndef PLAN_FIXTURE_H
#define PLAN_FIXTURE_H

#include "plan_device.h"

enum { HOLDING = MBM_TABLE_HOLDING_REGISTERS, SECOND = 1000 };

static plan_device d;

static inline void rtu(void)
{
    plan_device_begin(&d, 0);
}

static inline void add(uint8_t unit, uint16_t address, uint32_t intervalMs)
{
    (void)plan_device_add(&d, unit, HOLDING, MBM_TYPE_UINT16, address, intervalMs);
}

static inline uint8_t status(uint16_t field)
{
    return mbm_plan_getStatus(&d.plan, field, NULL);
}

static inline uint32_t age(uint16_t field)
{
    uint32_t ms = 1;

    (void)mbm_plan_getStatus(&d.plan, field, &ms);
    return ms;
}

#endif
