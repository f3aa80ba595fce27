/* A port that records the bytes that go through it. Licence: MIT OR Apache-2.0. */
#include "recorder.h"

static void keep(recording *kept, const uint8_t *bytes, int16_t count)
{
    int16_t i;

    for (i = 0; i < count && kept->length < sizeof kept->bytes; i++)
        kept->bytes[kept->length++] = bytes[i];
}

static int16_t record_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    recorder *wire = (recorder *)context;
    int16_t count = wire->line.read(wire->line.context, bytes, capacity);

    keep(&wire->received, bytes, count);
    return count;
}

static int16_t record_write(void *context, const uint8_t *bytes, uint16_t length)
{
    recorder *wire = (recorder *)context;
    int16_t count = wire->line.write(wire->line.context, bytes, length);

    keep(&wire->sent, bytes, count);
    return count;
}

static uint32_t pass_micros(void *context)
{
    recorder *wire = (recorder *)context;

    return wire->line.micros(wire->line.context);
}

static uint8_t pass_flush(void *context)
{
    recorder *wire = (recorder *)context;

    return wire->line.flush(wire->line.context);
}

static void pass_idle(void *context, mbm_master *master)
{
    recorder *wire = (recorder *)context;

    wire->line.idle(wire->line.context, master);
}

void recorder_clear(recorder *wire)
{
    wire->sent.length = 0;
    wire->received.length = 0;
}

mbm_port recorder_port(recorder *wire, const mbm_port *line)
{
    mbm_port port = {0};

    wire->line = *line;
    recorder_clear(wire);
    port.context = wire;
    port.read = record_read;
    port.write = record_write;
    port.micros = pass_micros;
    port.flush = line->flush ? pass_flush : NULL;
    port.idle = line->idle ? pass_idle : NULL;
    return port;
}
