#define _GNU_SOURCE
#include "found_port.h"

#include "clock.h"

#include <string.h>

static uint64_t rounds;    /* the number of the last round */
static uint32_t waited_at; /* when it began */
static int is_in_round;

static int is_empty(const found_port *port)
{
    return is_in_round && port->empty_in == rounds;
}

/* --- the port --- */

static int16_t read_bytes(void *context, uint8_t *bytes, uint16_t capacity)
{
    found_port *port = (found_port *)context;
    uint32_t now;
    int16_t count;

    if (is_empty(port))
        return 0;
    now = port->below.micros(port->below.context);
    count = port->below.read(port->below.context, bytes, capacity);
    if (count >= 0 && count < capacity) {
        port->empty_in = rounds;
        port->time = now;
    }
    return count;
}

static int16_t write_bytes(void *context, const uint8_t *bytes, uint16_t length)
{
    found_port *port = (found_port *)context;

    port->empty_in = 0;
    return port->below.write(port->below.context, bytes, length);
}

static uint32_t micros(void *context)
{
    const found_port *port = (const found_port *)context;

    return is_empty(port) ? port->time : port->below.micros(port->below.context);
}

static uint8_t flush(void *context)
{
    const found_port *port = (const found_port *)context;

    return port->below.flush(port->below.context);
}

mbm_port found_port_begin(found_port *port, const mbm_port *below)
{
    const mbm_port above = {.context = port,
                            .read = read_bytes,
                            .write = write_bytes,
                            .micros = micros,
                            .flush = below->flush ? flush : NULL};

    memset(port, 0, sizeof *port);
    port->below = *below;
    return above;
}

/* --- rounds --- */

void found_port_begin_round(void)
{
    waited_at = (uint32_t)clock_micros(CLOCK_MONOTONIC);
    rounds++;
    is_in_round = 1;
}

void found_port_note(found_port *port, const struct pollfd *found)
{
    if (!(found->events & POLLIN) || found->revents)
        return;
    port->empty_in = rounds;
    port->time = waited_at;
}

void found_port_end_round(void)
{
    is_in_round = 0;
}
