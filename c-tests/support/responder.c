#define _GNU_SOURCE
#include "responder.h"

#include <poll.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <unistd.h>

void responder_send(responder *r, const uint8_t *bytes, size_t length)
{
    while (length > 0) {
        ssize_t sent = write(r->line.theirs, bytes, length);

        if (sent < 0)
            abort();
        bytes += sent;
        length -= (size_t)sent;
    }
}

void responder_pause(responder *r, unsigned milliseconds)
{
    int untaken = 0;
    unsigned naps = 0;

    /* Waits until the master has read the bytes that were sent before the pause. */
    while (ioctl(r->line.ours, FIONREAD, &untaken) == 0 && untaken > 0 && naps++ < 1000)
        usleep(1000);
    held_clock_pass(&r->clock, 1000 * (int64_t)milliseconds);
    usleep(milliseconds * 1000);
}

void responder_pause_until_request(responder *r)
{
    struct pollfd wait = {r->line.theirs, POLLIN, 0};
    unsigned pauses = 0;

    do {
        if (pauses++ == 2000)
            abort();
        held_clock_pass(&r->clock, 10000);
    } while (poll(&wait, 1, 10) == 0);
}

static void *respond(void *argument)
{
    responder *r = (responder *)argument;
    uint8_t request[8];
    size_t have = 0;
    unsigned number = 0;

    for (;;) {
        struct pollfd waits[2] = {{r->line.theirs, POLLIN, 0}, {r->stop[0], POLLIN, 0}};
        ssize_t count;

        poll(waits, 2, -1);
        if (waits[1].revents)
            return NULL;
        count = read(r->line.theirs, request + have, sizeof request - have);
        if (count < 0)
            abort();
        have += (size_t)count;
        if (have == sizeof request) {
            have = 0;
            r->script(r, request, ++number);
            held_clock_done(&r->clock, 0, sizeof request);
        }
    }
}

void responder_start(responder *r, responder_script script)
{
    r->script = script;
    pty_open(&r->line);
    held_clock_start(&r->clock);
    if (pipe(r->stop) || pthread_create(&r->thread, NULL, respond, r))
        abort();
}

void responder_stop(responder *r)
{
    if (write(r->stop[1], "", 1) != 1)
        abort();
    pthread_join(r->thread, NULL);
    close(r->stop[0]);
    close(r->stop[1]);
    pty_close(&r->line);
}
