#include "request.h"
#include "crc.h"

#include <string.h>

int request_size(const uint8_t *frame, size_t have)
{
    size_t count_at;

    if (have < 2)
        return 0;
    switch (frame[1]) {
    case 0x01:
    case 0x02:
    case 0x03:
    case 0x04:
    case 0x05:
    case 0x06:
    case 0x08: return 8;
    case 0x16: return 10;
    case 0x0F:
    case 0x10: count_at = 6; break;
    case 0x17: count_at = 10; break;
    default: return -1;
    }
    return have > count_at ? (int)(count_at + 1 + frame[count_at] + 2) : 0;
}

static int range(uint16_t address, uint16_t quantity, uint16_t most)
{
    return quantity >= 1 && quantity <= most && (uint32_t)address + quantity <= 0x10000u;
}

/* The unused bits of the last byte must be zero. */
static int padded(const request *r)
{
    unsigned used = r->written % 8u;

    return used == 0 || r->data[(r->written - 1) / 8] >> used == 0;
}

int request_parse(request *r, const uint8_t *frame, size_t length)
{
    memset(r, 0, sizeof *r);
    if (request_size(frame, length) != (int)length || length < 8 || crc16(frame, length) != 0)
        return 0;
    r->unit = frame[0];
    r->function = frame[1];
    r->address = r->write_address = be16(frame + 2);
    r->quantity = r->value = be16(frame + 4);
    r->data = frame + 7;
    switch (r->function) {
    case 0x01:
    case 0x02: return range(r->address, r->quantity, 2000);
    case 0x03:
    case 0x04: return range(r->address, r->quantity, 125);
    case 0x05: r->written = 1; return r->value == 0 || r->value == 0xFF00;
    case 0x06: r->written = 1; return 1;
    case 0x08: return r->address == 0; /* Return Query Data, with one word */
    case 0x0F:
        r->written = r->quantity;
        return range(r->address, r->quantity, 1968) && frame[6] == (r->quantity + 7) / 8 &&
               padded(r);
    case 0x10:
        r->written = r->quantity;
        return range(r->address, r->quantity, 123) && frame[6] == 2 * r->quantity;
    case 0x16:
        r->written = 1;
        r->or_mask = be16(frame + 6);
        return 1;
    default: /* 0x17, since request_size accepts no other function */
        r->write_address = be16(frame + 6);
        r->written = be16(frame + 8);
        r->data = frame + 11;
        return range(r->address, r->quantity, 125) && range(r->write_address, r->written, 121) &&
               frame[10] == 2 * r->written;
    }
}
