/* The device that the examples of ModbusMaster ask. */
#include "upstream_device.h"

#include "crc.h"
#include "sketch.h"
#include "test.h"

enum { EVERYTHING = 30000 };

void upstream_device_start(upstream_device *d, int unit)
{
    memset(d, 0, sizeof *d);
    server_start(&d->peer, unit);
    /* The server's thread looks at it with the first request. */
    modbus_mapping_free(d->peer.mapping);
    d->peer.mapping = modbus_mapping_new(EVERYTHING, EVERYTHING, EVERYTHING, EVERYTHING);
    assert_non_null(d->peer.mapping);
    for (unsigned i = 0; i < EVERYTHING; i++)
        d->peer.mapping->tab_registers[i] = server_pattern(i);
    d->peer.mapping->tab_input_registers[0x3104] = 1345; /* the half-duplex example's battery */
}

/* Refuses 66 registers, as the controller does that the example is for. */
static void refuse(wire *w, const uint8_t *frame)
{
    uint8_t reply[5] = {frame[0], (uint8_t)(frame[1] | 0x80), 2};

    wire_play(w, MS, reply, seal(reply, 3));
}

void upstream_hear(wire *w, const uint8_t *frame, size_t length)
{
    upstream_device *d = w->context;
    size_t have = strlen(d->text);

    if (d->heard)
        d->heard(d, w, frame, length);
    if (length < 4 || crc16(frame, length) != 0) {
        if (have + length < sizeof d->text)
            memcpy(d->text + have, frame, length);
        return;
    }
    if (d->count < UPSTREAM_ROUND) {
        d->functions[d->count] = frame[1];
        d->quantities[d->count] = frame[5];
    }
    d->count++;
    d->driven += !d->driver;
    if (frame[1] == 3 && frame[5] == 66) {
        refuse(w, frame);
        return;
    }
    w->context = &d->peer;
    peer_libmodbus(w, frame, length);
    w->context = d;
}
