#include "hooked_port.h"

#include "crc.h"
#include "test.h"

static hooked_port *call(void *context, int hook)
{
    hooked_port *p = (hooked_port *)context;

    p->called[hook]++;
    if (p->within != NULL)
        p->within(hook);
    return p;
}

static int16_t hooked_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    hooked_port *p = call(context, HOOK_READ);
    size_t count = p->last - p->first;

    assert_in_range(capacity, 1, INT16_MAX);
    if (p->lost)
        return -1;
    if (count > capacity)
        count = capacity;
    memcpy(bytes, p->arriving + p->first, count);
    p->first += count;
    return (int16_t)count;
}

static int16_t hooked_write(void *context, const uint8_t *bytes, uint16_t length)
{
    hooked_port *p = call(context, HOOK_WRITE);

    if (p->lost)
        return -1;
    if (p->piece && length > p->piece)
        length = (uint16_t)p->piece;
    if (p->length + length > sizeof p->sent)
        p->length = 0;
    p->draining = p->drains;
    memcpy(p->sent + p->length, bytes, length);
    p->length += length;
    return (int16_t)length;
}

static uint32_t hooked_micros(void *context)
{
    hooked_port *p = call(context, HOOK_MICROS);

    return p->now += p->step;
}

static uint8_t hooked_flush(void *context)
{
    hooked_port *p = call(context, HOOK_FLUSH);

    if (p->draining == 0)
        return 1;
    p->draining--;
    return 0;
}

static void hooked_pre(void *context)
{
    call(context, HOOK_PRE);
}

static void hooked_post(void *context)
{
    call(context, HOOK_POST);
}

static void hooked_idle(void *context, mbm_node *node)
{
    call(context, HOOK_IDLE);
}

mbm_port hooked_port_of(hooked_port *p)
{
    const mbm_port port = {.context = p,
                           .read = hooked_read,
                           .write = hooked_write,
                           .micros = hooked_micros,
                           .flush = hooked_flush,
                           .preTransmission = hooked_pre,
                           .postTransmission = hooked_post,
                           .idle = hooked_idle};

    return port;
}

mbm_port hooked_port_without(hooked_port *p, int hook)
{
    mbm_port port = hooked_port_of(p);

    if (hook == HOOK_READ)
        port.read = NULL;
    else if (hook == HOOK_WRITE)
        port.write = NULL;
    else
        port.micros = NULL;
    return port;
}

void hooked_port_arrive(hooked_port *p, const void *bytes, size_t length)
{
    memcpy(p->arriving, bytes, length);
    p->first = 0;
    p->last = length;
}

void hooked_port_arrive_rtu(hooked_port *p, uint8_t unit, const void *pdu, size_t length)
{
    p->arriving[0] = unit;
    memcpy(p->arriving + 1, pdu, length);
    p->first = 0;
    p->last = seal(p->arriving, length + 1);
}
