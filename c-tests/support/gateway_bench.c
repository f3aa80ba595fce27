#include "gateway_bench.h"
#include "crc.h"
#include "test.h"

enum { STEPS = 2000 };

void gateway_bench_open(gateway_bench *b, unsigned connection)
{
    memory_port *socket = &b->sockets[connection];
    const mbm_port port = memory_port_of(socket);

    socket->sent_count = socket->arriving_count = 0;
    socket->is_lost = 0;
    OK(mbm_gateway_open(&b->gateway, (uint8_t)connection, &port));
}

void gateway_bench_start(gateway_bench *b, const mbm_gatewayRoute *routes, unsigned count)
{
    memset(b, 0, sizeof *b);
    for (unsigned i = 0; i < BENCH_LINES; i++) {
        const mbm_port port = memory_port_of(&b->wires[i]);

        OK(mbm_client_beginRtu(&b->clients[i], &port, b->frames[i], MBM_MAX_FRAME));
        OK(mbm_client_setResponseTimeout(&b->clients[i], 100));
        b->lines[i].client = &b->clients[i];
    }
    b->config = (mbm_gatewayConfig){.routes = routes,
                                    .routeCount = (uint8_t)count,
                                    .lines = b->lines,
                                    .lineCount = BENCH_LINES,
                                    .connections = b->connections,
                                    .connectionCount = BENCH_CONNECTIONS,
                                    .requests = b->requests,
                                    .requestCount = BENCH_REQUESTS};
    OK(mbm_gateway_begin(&b->gateway, &b->config));
    for (unsigned i = 0; i < BENCH_CONNECTIONS; i++)
        gateway_bench_open(b, i);
}

int gateway_bench_step(gateway_bench *b)
{
    uint32_t delay = mbm_gateway_pollDelay(&b->gateway);

    /* Bytes that have arrived end the sleep. */
    for (unsigned i = 0; i < BENCH_LINES; i++)
        if (b->wires[i].arriving_count > 0 && mbm_client_pending(&b->clients[i]) > 0)
            delay = 0;
    for (unsigned i = 0; i < BENCH_CONNECTIONS; i++)
        if (b->sockets[i].arriving_count > 0 && mbm_gateway_isReading(&b->gateway, (uint8_t)i))
            delay = 0;
    /* Each poll takes a microsecond. */
    delay = delay == 0 || delay == UINT32_MAX ? 1 : delay;
    for (unsigned i = 0; i < BENCH_LINES; i++)
        b->wires[i].now += delay;
    for (unsigned i = 0; i < BENCH_CONNECTIONS; i++)
        b->sockets[i].now += delay;
    OK(mbm_gateway_poll(&b->gateway));
    return mbm_gateway_pollDelay(&b->gateway) != UINT32_MAX;
}

void gateway_bench_settle(gateway_bench *b)
{
    for (unsigned steps = 0; gateway_bench_step(b); steps++)
        assert_true(steps < STEPS);
}

void gateway_bench_ask(gateway_bench *b, unsigned connection, unsigned transaction, uint8_t unit,
                       const char *pdu, size_t length)
{
    const uint8_t header[] = {
        (uint8_t)(transaction >> 8), (uint8_t)transaction, 0, 0, 0, (uint8_t)(length + 1), unit};

    memory_port_bytes(&b->sockets[connection], header, sizeof header);
    memory_port_bytes(&b->sockets[connection], (const uint8_t *)pdu, length);
}

/* Polls until a port has sent a frame, which must be the expected one, and removes it. */
static void expect(gateway_bench *b, memory_port *m, const uint8_t *frame, size_t length)
{
    for (unsigned steps = 0; m->sent_count < length && steps < STEPS; steps++)
        gateway_bench_step(b);
    assert_true(m->sent_count >= length);
    assert_memory_equal(m->sent, frame, length);
    m->sent_count -= length;
    memmove(m->sent, m->sent + length, m->sent_count);
}

void gateway_bench_expect(gateway_bench *b, unsigned connection, unsigned transaction, uint8_t unit,
                          const char *pdu, size_t length)
{
    uint8_t frame[MBM_MAX_TCP_FRAME] = {
        (uint8_t)(transaction >> 8), (uint8_t)transaction, 0, 0, 0, (uint8_t)(length + 1), unit};

    memcpy(frame + 7, pdu, length);
    expect(b, &b->sockets[connection], frame, length + 7);
}

void gateway_bench_on_line(gateway_bench *b, unsigned line, uint8_t unit, const char *pdu,
                           size_t length)
{
    uint8_t frame[MBM_MAX_FRAME] = {unit};

    memcpy(frame + 1, pdu, length);
    expect(b, &b->wires[line], frame, seal(frame, length + 1));
    assert_int_equal(b->wires[line].sent_count, 0);
}

void gateway_bench_reply(gateway_bench *b, unsigned line, uint8_t unit, const char *pdu,
                         size_t length)
{
    uint8_t bytes[MBM_MAX_FRAME] = {unit};

    memcpy(bytes + 1, pdu, length);
    memory_port_rtu(&b->wires[line], bytes, length + 1);
}
