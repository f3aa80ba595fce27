/* The ports over other ports: what they pass on, hold back and read ahead. */
#include "port_over.h"

#include "clock.h"

#include <string.h>

/* --- what is passed on. The context begins with the port below --- */

static int16_t read_below(void *context, uint8_t *bytes, uint16_t capacity)
{
    const mbm_port *below = (const mbm_port *)context;

    return below->read(below->context, bytes, capacity);
}

static int16_t write_below(void *context, const uint8_t *bytes, uint16_t length)
{
    const mbm_port *below = (const mbm_port *)context;

    return below->write(below->context, bytes, length);
}

static uint32_t micros_below(void *context)
{
    const mbm_port *below = (const mbm_port *)context;

    return below->micros(below->context);
}

static uint8_t flush_below(void *context)
{
    const mbm_port *below = (const mbm_port *)context;

    return below->flush(below->context);
}

mbm_port port_over(mbm_port *below, const mbm_port *real)
{
    const mbm_port above = {.context = below,
                            .read = read_below,
                            .write = write_below,
                            .micros = micros_below,
                            .flush = real->flush ? flush_below : NULL};

    *below = *real;
    return above;
}

/* --- found_port --- */

static int is_empty(const found_port *port)
{
    return port->round && port->round->is_on && port->empty_in == port->round->number;
}

static int16_t read_found(void *context, uint8_t *bytes, uint16_t capacity)
{
    found_port *port = (found_port *)context;
    uint32_t now;
    int16_t count;

    if (is_empty(port))
        return 0;
    now = port->below.micros(port->below.context);
    count = port->below.read(port->below.context, bytes, capacity);
    if (port->round && count >= 0 && count < capacity) {
        port->empty_in = port->round->number;
        port->timeUs = now;
    }
    return count;
}

static int16_t write_found(void *context, const uint8_t *bytes, uint16_t length)
{
    found_port *port = (found_port *)context;

    port->empty_in = 0;
    return port->below.write(port->below.context, bytes, length);
}

static uint32_t found_micros(void *context)
{
    const found_port *port = (const found_port *)context;

    return is_empty(port) ? port->timeUs : port->below.micros(port->below.context);
}

mbm_port found_port_begin(found_port *port, const mbm_port *below)
{
    mbm_port above;

    memset(port, 0, sizeof *port);
    above = port_over(&port->below, below);
    above.read = read_found;
    above.write = write_found;
    above.micros = found_micros;
    return above;
}

void found_port_begin_round(found_round *round)
{
    round->beganUs = (uint32_t)clock_micros(CLOCK_MONOTONIC);
    round->number++;
    round->is_on = 1;
}

void found_port_note(found_port *port, const found_round *round, const struct pollfd *found)
{
    port->round = round;
    if (!(found->events & POLLIN) || found->revents)
        return;
    port->empty_in = round->number;
    port->timeUs = round->beganUs;
}

void found_port_end_round(found_round *round)
{
    round->is_on = 0;
}

/* --- ahead_port --- */

/* Reads what has come. Returns as a port's read. */
static int16_t fill(ahead_port *port)
{
    int16_t count;

    if (!port->is_ready)
        return 0;
    count = port->below.read(port->below.context, port->bytes, sizeof port->bytes);
    port->is_ready = count < 0 || (size_t)count == sizeof port->bytes;
    port->at = 0;
    port->end = (uint16_t)(count > 0 ? count : 0);
    return count;
}

static int16_t read_ahead(void *context, uint8_t *bytes, uint16_t capacity)
{
    ahead_port *port = (ahead_port *)context;
    uint16_t count;

    if (!ahead_port_has_bytes(port)) {
        const int16_t came = fill(port);

        if (came <= 0)
            return came;
    }
    count = (uint16_t)(port->end - port->at);
    if (count > capacity)
        count = capacity;
    memcpy(bytes, port->bytes + port->at, count);
    port->at = (uint16_t)(port->at + count);
    return (int16_t)count;
}

mbm_port ahead_port_begin(ahead_port *port, const mbm_port *below)
{
    mbm_port above = port_over(&port->below, below);

    above.read = read_ahead;
    port->is_ready = 0;
    port->at = port->end = 0;
    return above;
}

int ahead_port_has_bytes(const ahead_port *port)
{
    return port->at != port->end;
}
