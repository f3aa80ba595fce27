/* The wire of tests of refused calls: one hooked_port, and their setup. */
#ifndef REFUSED_WIRE_H
#define REFUSED_WIRE_H

#include "hooked_port.h"

#include <string.h>

static hooked_port wire;
static mbm_port port;

static void reset(void)
{
    memset(&wire, 0, sizeof wire);
    wire.step = 100;
    port = hooked_port_of(&wire);
}

#endif
