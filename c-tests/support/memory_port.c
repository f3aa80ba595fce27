#include "memory_port.h"
#include "crc.h"
#include "test.h"

static int16_t read_bytes(void *context, uint8_t *bytes, uint16_t capacity)
{
    memory_port *m = (memory_port *)context;
    size_t count = m->arriving_count < capacity ? m->arriving_count : capacity;

    if (m->is_lost)
        return -1;
    memcpy(bytes, m->arriving, count);
    m->arriving_count -= count;
    memmove(m->arriving, m->arriving + count, m->arriving_count);
    return (int16_t)count;
}

static int16_t send_bytes(void *context, const uint8_t *bytes, uint16_t length)
{
    memory_port *m = (memory_port *)context;

    if (m->is_lost)
        return -1;
    assert_true(m->sent_count + length <= sizeof m->sent);
    memcpy(m->sent + m->sent_count, bytes, length);
    m->sent_count += length;
    return (int16_t)length;
}

static uint32_t clock_of(void *context)
{
    return ((memory_port *)context)->now;
}

mbm_port memory_port_of(memory_port *m)
{
    mbm_port port = {.context = m, .read = read_bytes, .write = send_bytes, .micros = clock_of};

    return port;
}

void memory_port_bytes(memory_port *m, const uint8_t *bytes, size_t count)
{
    assert_true(m->arriving_count + count <= sizeof m->arriving);
    memcpy(m->arriving + m->arriving_count, bytes, count);
    m->arriving_count += count;
}

void memory_port_rtu(memory_port *m, const uint8_t *bytes, size_t count)
{
    uint8_t frame[MBM_MAX_FRAME];

    assert_true(count + 2 <= sizeof frame);
    memcpy(frame, bytes, count);
    memory_port_bytes(m, frame, seal(frame, count));
}

/* Lets time pass until the client has something to do. */
static void pass(memory_port *m, mbm_client *client)
{
    uint32_t delay = mbm_client_pollDelay(client);

    if (delay != UINT32_MAX)
        m->now += delay > 0 ? delay : 1;
}

void memory_port_send(memory_port *m, mbm_client *client)
{
    for (;;) {
        (void)mbm_client_poll(client);
        if (m->sent_count > 0)
            return;
        pass(m, client);
    }
}

uint8_t memory_port_run(memory_port *m, mbm_client *client, const mbm_clientRequest *request,
                        unsigned steps)
{
    while (steps-- > 0 && request->status == MBM_PENDING) {
        (void)mbm_client_poll(client);
        if (request->status == MBM_PENDING)
            pass(m, client);
    }
    return request->status;
}
