#include "ahead_port.h"

#include <string.h>

/* Reads what has come. Returns as a port's read. */
static int16_t read_ahead(ahead_port *port)
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

static int16_t read_bytes(void *context, uint8_t *bytes, uint16_t capacity)
{
    ahead_port *port = (ahead_port *)context;
    uint16_t count;

    if (!ahead_port_has_bytes(port)) {
        const int16_t came = read_ahead(port);

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

static int16_t write_bytes(void *context, const uint8_t *bytes, uint16_t length)
{
    const ahead_port *port = (const ahead_port *)context;

    return port->below.write(port->below.context, bytes, length);
}

static uint32_t micros(void *context)
{
    const ahead_port *port = (const ahead_port *)context;

    return port->below.micros(port->below.context);
}

mbm_port ahead_port_begin(ahead_port *port, const mbm_port *below)
{
    const mbm_port above = {
        .context = port, .read = read_bytes, .write = write_bytes, .micros = micros};

    port->below = *below;
    port->is_ready = 0;
    port->at = port->end = 0;
    return above;
}

int ahead_port_has_bytes(const ahead_port *port)
{
    return port->at != port->end;
}
