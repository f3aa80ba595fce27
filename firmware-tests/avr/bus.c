#define _GNU_SOURCE
#include "bus.h"

#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Bytes that the client writes at once arrive within this time, so that no silence gets
 * into a frame. */
enum { PAUSE_MS = 5 };

static void to_client(wire *w, const uint8_t *frame, size_t length)
{
    bus *l = w->context;

    memcpy(l->last, frame, length);
    l->length = length;
    if (l->watcher)
        l->watcher(l->context, w, length);
    if (write(l->ends.ours, frame, length) != (ssize_t)length)
        abort();
}

static void from_client(bus *l)
{
    struct pollfd wait = {l->ends.ours, POLLIN, 0};
    uint8_t bytes[FRAME];
    size_t have = 0;
    int patience = 0;

    while (have < sizeof bytes && poll(&wait, 1, patience) > 0) {
        ssize_t count = read(l->ends.ours, bytes + have, sizeof bytes - have);

        if (count <= 0)
            abort();
        have += (size_t)count;
        patience = PAUSE_MS;
    }
    wire_play(l->line, MS, bytes, have);
}

static void *run(void *argument)
{
    bus *l = argument;

    while (atomic_load(&l->going)) {
        if (!board_run(l->on, MS))
            abort();
        from_client(l);
    }
    return NULL;
}

void bus_open(bus *l, board *b, char uart, int unit)
{
    memset(l, 0, sizeof *l);
    l->on = b;
    l->line = board_uart(b, uart, to_client, l);
    pty_open(&l->ends);
    l->client = modbus_new_rtu(l->ends.path, 115200, 'N', 8, 1);
    if (!l->client || modbus_set_slave(l->client, unit) || modbus_connect(l->client) ||
        modbus_set_response_timeout(l->client, 20, 0)) {
        perror("libmodbus client");
        abort();
    }
}

void bus_close(bus *l)
{
    modbus_close(l->client);
    modbus_free(l->client);
    pty_close(&l->ends);
}

void bus_go(bus *l)
{
    atomic_store(&l->going, 1);
    if (pthread_create(&l->thread, NULL, run, l))
        abort();
}

void bus_halt(bus *l)
{
    atomic_store(&l->going, 0);
    pthread_join(l->thread, NULL);
}

void bus_settle(bus *l)
{
    from_client(l);
    if (!board_run(l->on, 100 * MS))
        abort();
}

int bus_send(bus *l, const uint8_t *frame, size_t length)
{
    unsigned before = l->line->frames;

    wire_play(l->line, MS, frame, length);
    if (!board_run(l->on, 100 * MS))
        abort();
    return l->line->frames != before;
}
