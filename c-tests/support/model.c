#include "model.h"
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

void model_start(model *m)
{
    for (unsigned unit = 0; unit < MODEL_UNITS; unit++)
        for (unsigned i = 0; i < MODEL_CELLS; i++) {
            uint32_t mixed = (unit * 7919u + i + 1u) * 2654435761u;

            m->holding[unit][i] = (uint16_t)(mixed >> 16);
            m->readings[unit][i] = (uint16_t)(mixed >> 8);
            m->coils[unit][i] = mixed >> 30 & 1;
            m->inputs[unit][i] = mixed >> 29 & 1;
        }
}

static size_t pack(uint8_t *reply, const uint8_t *cells, unsigned quantity)
{
    unsigned i, bytes = (quantity + 7) / 8;

    reply[2] = (uint8_t)bytes;
    memset(reply + 3, 0, bytes);
    for (i = 0; i < quantity; i++)
        reply[3 + i / 8] |= (uint8_t)(cells[i] << i % 8);
    return 3 + bytes;
}

static size_t copy(uint8_t *reply, const uint16_t *cells, unsigned quantity)
{
    reply[2] = (uint8_t)(2 * quantity);
    for (unsigned i = 0; i < quantity; i++) {
        reply[3 + 2 * i] = (uint8_t)(cells[i] >> 8);
        reply[4 + 2 * i] = (uint8_t)cells[i];
    }
    return 3 + 2 * quantity;
}

static void store(uint16_t *cells, const uint8_t *data, unsigned quantity)
{
    for (unsigned i = 0; i < quantity; i++)
        cells[i] = be16(data + 2 * i);
}

/* The response of a write repeats the request's address and its value or quantity. */
static size_t repeat(uint8_t *reply, const request *r)
{
    reply[2] = (uint8_t)(r->address >> 8);
    reply[3] = (uint8_t)r->address;
    reply[4] = (uint8_t)(r->quantity >> 8);
    reply[5] = (uint8_t)r->quantity;
    return 6;
}

size_t model_answer(model *m, const request *r, uint8_t *reply)
{
    unsigned unit = (unsigned)(r->unit - MODEL_FIRST_UNIT) % MODEL_UNITS;
    unsigned i, at = r->address, to = r->write_address;
    int reads = r->function <= 4 || r->function == 0x17;
    size_t length = 0;

    reply[0] = r->unit;
    reply[1] = r->function;
    if ((reads && at + r->quantity > MODEL_CELLS) || to + r->written > MODEL_CELLS) {
        reply[1] |= 0x80;
        reply[2] = 2;
        return seal(reply, 3);
    }
    uint16_t *cell = &m->holding[unit][to];
    switch (r->function) {
    case 0x01: length = pack(reply, &m->coils[unit][at], r->quantity); break;
    case 0x02: length = pack(reply, &m->inputs[unit][at], r->quantity); break;
    case 0x03: length = copy(reply, &m->holding[unit][at], r->quantity); break;
    case 0x04: length = copy(reply, &m->readings[unit][at], r->quantity); break;
    case 0x05:
        m->coils[unit][to] = r->value != 0;
        length = repeat(reply, r);
        break;
    case 0x06:
        *cell = r->value;
        length = repeat(reply, r);
        break;
    case 0x0F:
        for (i = 0; i < r->written; i++)
            m->coils[unit][to + i] = r->data[i / 8] >> i % 8 & 1;
        length = repeat(reply, r);
        break;
    case 0x10:
        store(cell, r->data, r->written);
        length = repeat(reply, r);
        break;
    case 0x16:
        *cell = (uint16_t)((*cell & r->value) | (r->or_mask & ~r->value));
        length = repeat(reply, r);
        reply[length++] = (uint8_t)(r->or_mask >> 8);
        reply[length++] = (uint8_t)r->or_mask;
        break;
    case 0x17:
        store(cell, r->data, r->written);
        length = copy(reply, &m->holding[unit][at], r->quantity);
        break;
    default: break;
    }
    return seal(reply, length);
}
