/* A port in memory: bytes that arrive, bytes that were sent, a clock, and a function of the
 * test that every hook calls first. */
#ifndef HOOKED_PORT_H
#define HOOKED_PORT_H

#include "mbm.h"

#include <stddef.h>

enum { HOOK_READ, HOOK_WRITE, HOOK_MICROS, HOOK_FLUSH, HOOK_PRE, HOOK_POST, HOOK_IDLE, HOOKS };

typedef struct hooked_port {
    uint8_t arriving[600], sent[600];
    size_t first, last, length;
    uint32_t now, step; /* each read of the clock takes `step` microseconds */
    uint8_t lost;       /* 1: the link is lost */
    /* The most bytes that a write accepts, 0 for all; how often flush must be called. */
    unsigned piece, drains, draining;
    void (*within)(int hook);
    unsigned called[HOOKS];
} hooked_port;

/* A port over `p` with all hooks. `p` must stay where it is. */
mbm_port hooked_port_of(hooked_port *p);

/* The same without a hook that mbm needs: HOOK_READ, HOOK_WRITE or HOOK_MICROS. */
mbm_port hooked_port_without(hooked_port *p, int hook);

/* Replaces the bytes that are still to arrive. */
void hooked_port_arrive(hooked_port *p, const void *bytes, size_t length);

/* As hooked_port_arrive, but adds unit and CRC to a PDU. */
void hooked_port_arrive_rtu(hooked_port *p, uint8_t unit, const void *pdu, size_t length);

#endif
