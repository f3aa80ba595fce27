#define _GNU_SOURCE
#include "peer.h"
#include "crc.h"

#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* The server answers a request to its own unit within a few milliseconds, on a loaded host
 * later. A request to another unit must have reached it before the next request. */
enum { ANSWERED_WITHIN_MS = 60000, HEARD_WITHIN_MS = 1000 };

static int is_whole(const uint8_t *reply, size_t length)
{
    return length >= 5 && crc16(reply, length) == 0;
}

void peer_libmodbus(wire *w, const uint8_t *frame, size_t length)
{
    server *s = w->context;
    struct pollfd wait = {s->line.ours, POLLIN, 0};
    uint8_t reply[FRAME];
    size_t have = 0;
    int patience = frame[0] == modbus_get_slave(s->peer) ? ANSWERED_WITHIN_MS : HEARD_WITHIN_MS;

    if (write(s->line.ours, frame, length) != (ssize_t)length)
        abort();
    while (have < sizeof reply && !is_whole(reply, have) && poll(&wait, 1, patience) > 0) {
        ssize_t count = read(s->line.ours, reply + have, sizeof reply - have);

        if (count <= 0)
            abort();
        have += (size_t)count;
    }
    wire_play(w, MS, reply, have);
}

uint16_t peer_value(unsigned address)
{
    return (uint16_t)(address * 7919u + 1u);
}

size_t peer_right_reply(uint8_t *reply, const uint8_t *request)
{
    unsigned address = (unsigned)request[2] << 8 | request[3];
    unsigned quantity = (unsigned)request[4] << 8 | request[5];
    unsigned i;

    memcpy(reply, request, 6);
    if (request[1] == 6 || request[1] == 16)
        return seal(reply, 6);
    reply[2] = (uint8_t)(2 * quantity);
    for (i = 0; i < quantity; i++) {
        reply[3 + 2 * i] = (uint8_t)(peer_value(address + i) >> 8);
        reply[4 + 2 * i] = (uint8_t)peer_value(address + i);
    }
    return seal(reply, 3 + 2 * quantity);
}

void peer_right(wire *w, const uint8_t *frame, size_t length)
{
    uint8_t reply[FRAME];

    wire_play(w, MS, reply, peer_right_reply(reply, frame));
}
