#define _GNU_SOURCE
#include "device.h"
#include "report.h"

#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { MOST = 256 };

static uint64_t now(void)
{
    struct timespec time;

    clock_gettime(CLOCK_MONOTONIC, &time);
    return (uint64_t)time.tv_sec * 1000000u + (uint64_t)time.tv_nsec / 1000u;
}

static void answer(device *d, const uint8_t *frame, size_t length)
{
    uint8_t reply[MOST], wire[2 * MOST];
    request asked;
    size_t size;

    d->number++;
    if (d->number < sizeof d->at / sizeof d->at[0])
        d->at[d->number] = now();
    if (!request_parse(&asked, frame, length)) {
        d->malformed++;
        return;
    }
    if (asked.unit != UNIT && asked.unit != 0)
        return;
    if (asked.unit == 0) {
        asked.unit = UNIT;
        model_answer(&d->memory, &asked, reply);
        return;
    }
    size = model_answer(&d->memory, &asked, reply);
    if (d->fault && d->number == d->faulty)
        size = d->fault(wire, reply, size);
    else
        memcpy(wire, reply, size);
    if (write(d->line.theirs, wire, size) != (ssize_t)size)
        abort();
}

static void *serve(void *argument)
{
    device *d = (device *)argument;
    uint8_t frame[MOST];
    size_t have = 0;

    for (;;) {
        struct pollfd waits[2] = {{d->line.theirs, POLLIN, 0}, {d->stop[0], POLLIN, 0}};
        ssize_t count;
        int size;

        poll(waits, 2, -1);
        if (waits[1].revents)
            return NULL;
        count = read(d->line.theirs, frame + have, sizeof frame - have);
        if (count < 0)
            abort();
        have += (size_t)count;
        size = request_size(frame, have);
        if (size < 0 || have == sizeof frame) {
            d->malformed++;
            have = 0;
        } else if (size > 0 && have >= (size_t)size) {
            answer(d, frame, have);
            have = 0;
        }
    }
}

void device_start(device *d, unsigned faulty, device_fault fault)
{
    memset(d, 0, sizeof *d);
    d->faulty = faulty;
    d->fault = fault;
    pty_open(&d->line);
    model_start(&d->memory);
    if (pipe(d->stop) || pthread_create(&d->thread, NULL, serve, d)) {
        perror("device");
        abort();
    }
}

void device_stop(device *d)
{
    if (write(d->stop[1], "", 1) != 1)
        abort();
    pthread_join(d->thread, NULL);
    close(d->stop[0]);
    close(d->stop[1]);
    pty_close(&d->line);
}
