#define _GNU_SOURCE
#include "client.h"
#include "await.h"
#include "test.h"

#include <poll.h>

static void begin_tty(asker *a, int fd)
{
    memset(a, 0, sizeof *a);
    assert_int_equal(mbm_tty_attach(&a->tty, fd), 0);
    a->port = mbm_tty_port(&a->tty);
}

static uint8_t connect_anew(void *context)
{
    asker *a = (asker *)context;

    if (a->clock)
        held_clock_forget(a->clock);
    return mbm_tcp_connect(&a->tcp);
}

static void disconnect(void *context)
{
    mbm_tcp_disconnect(&((asker *)context)->tcp);
}

static void begin_tcp(asker *a, uint16_t port)
{
    memset(a, 0, sizeof *a);
    snprintf(a->service, sizeof a->service, "%u", port);
    assert_int_equal(mbm_tcp_open(&a->tcp, &a->addresses, "127.0.0.1", a->service), 0);
    a->port = mbm_tcp_port(&a->tcp);
    a->link.context = a;
    a->link.connect = connect_anew;
    a->link.disconnect = disconnect;
}

void asker_begin_rtu(asker *a, int fd)
{
    begin_tty(a, fd);
    OK(mbm_client_beginRtu(&a->client, &a->port, a->incoming, sizeof a->incoming));
    OK(mbm_client_setBaudRate(&a->client, 115200));
    OK(mbm_client_setResponseTimeout(&a->client, PATIENCE_MS));
    OK(mbm_client_setCounters(&a->client, &a->counters));
}

void asker_begin_ascii(asker *a, int fd)
{
    begin_tty(a, fd);
    OK(mbm_client_beginAscii(&a->client, &a->port, a->incoming, sizeof a->incoming));
    OK(mbm_client_setResponseTimeout(&a->client, PATIENCE_MS));
    OK(mbm_client_setCounters(&a->client, &a->counters));
}

void asker_begin_tcp(asker *a, uint16_t port)
{
    asker_begin_tcp_by(a, port, NULL);
}

void asker_begin_tcp_by(asker *a, uint16_t port, held_clock *clock)
{
    begin_tcp(a, port);
    a->clock = clock;
    if (clock) {
        a->port = held_clock_port(clock, &a->port);
        held_clock_sleep(clock, 0);
    }
    OK(mbm_client_beginTcp(&a->client, &a->port, a->incoming, sizeof a->incoming, a->outgoing,
                           sizeof a->outgoing));
    OK(mbm_client_setResponseTimeout(&a->client, PATIENCE_MS));
    OK(mbm_client_setCounters(&a->client, &a->counters));
}

void asker_begin_rtu_over_tcp(asker *a, uint16_t port)
{
    begin_tcp(a, port);
    OK(mbm_client_beginRtuOverTcp(&a->client, &a->port, a->incoming, sizeof a->incoming));
    OK(mbm_client_setResponseTimeout(&a->client, PATIENCE_MS));
    OK(mbm_client_setCounters(&a->client, &a->counters));
}

mbm_clientRequest asker_request(uint8_t unit, void *reply, uint16_t bytes, const void *data)
{
    mbm_clientRequest request = {.unit = unit, .reply = reply, .replyBytes = bytes, .data = data};

    return request;
}

void asker_rest(asker *a)
{
    uint32_t delay = mbm_client_pollDelay(&a->client);
    struct timespec time = {(time_t)(delay / 1000000u), (long)(delay % 1000000u) * 1000};
    struct pollfd line = {a->service[0] ? a->tcp.fd : a->tty.fd, POLLIN, 0};

    if (a->clock)
        held_clock_sleep(a->clock, delay);
    if (a->service[0] && mbm_tcp_isConnected(&a->tcp) == 0)
        line.events |= POLLOUT;
    ppoll(&line, 1, &time, NULL);
}

uint8_t asker_wait(asker *a, const mbm_clientRequest *request)
{
    while (request->status == MBM_PENDING) {
        (void)mbm_client_poll(&a->client);
        if (request->status == MBM_PENDING)
            asker_rest(a);
    }
    return request->status;
}

void asker_wait_all(asker *a)
{
    while (mbm_client_poll(&a->client) == MBM_PENDING)
        asker_rest(a);
}

void node_begin(node *n, int fd, uint8_t slave)
{
    memset(n, 0, sizeof *n);
    assert_int_equal(mbm_tty_attach(&n->tty, fd), 0);
    n->port = mbm_tty_port(&n->tty);
    assert_int_equal(mbm_line_beginRtu(&n->line, &n->port, n->frame, MBM_MAX_FRAME), MBM_OK);
    assert_int_equal(mbm_node_begin(&n->node, &n->line, slave, n->response, MBM_MAX_READ_REGISTERS,
                                    n->transmit, MBM_MAX_WRITE_REGISTERS),
                     MBM_OK);
    assert_int_equal(mbm_line_setCounters(&n->line, &n->counters), MBM_OK);
    assert_int_equal(mbm_line_setBaudRate(&n->line, 115200), MBM_OK);
    assert_int_equal(mbm_node_setResponseTimeout(&n->node, PATIENCE_MS), MBM_OK);
}

int node_bit(const node *n, unsigned index)
{
    return n->response[index / 16] >> index % 16 & 1;
}

void node_set_bit(node *n, unsigned index, int on)
{
    uint16_t mask = (uint16_t)(1u << index % 16);

    if (on)
        n->transmit[index / 16] |= mask;
    else
        n->transmit[index / 16] &= (uint16_t)~mask;
}
