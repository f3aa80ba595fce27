#define _GNU_SOURCE
#include "held_clock.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static int64_t machine(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

/* Microseconds after which a master that does not sleep looks again. */
enum { LOOK = 5000 };

static int64_t read_clock(held_clock *c)
{
    const int64_t now = machine(), most = c->due < c->seen ? c->due : c->seen;

    if (c->bytes > 0)
        return c->stopped;
    if (now - c->lag > most)
        c->lag = now - most;
    return now - c->lag;
}

static void see(held_clock *c, int64_t until)
{
    if (c->seen != HELD_CLOCK_NEVER && until > c->seen)
        c->seen = until;
}

/* Goes on from the time that it shows. The device still has `bytes` bytes to process. */
static void set(held_clock *c, uint32_t bytes)
{
    int64_t shown = read_clock(c);

    c->stopped = shown;
    c->bytes = bytes;
    c->lag = machine() - shown;
    see(c, shown);
}

void held_clock_start(held_clock *c)
{
    memset(c, 0, sizeof *c);
    c->due = HELD_CLOCK_NEVER;
    c->readTime = machine();
    c->seen = HELD_CLOCK_NEVER;
    if (pthread_mutex_init(&c->lock, NULL)) {
        perror("held_clock");
        abort();
    }
}

int64_t held_clock_now(held_clock *c)
{
    pthread_mutex_lock(&c->lock);
    int64_t shown = read_clock(c);
    pthread_mutex_unlock(&c->lock);
    return shown;
}

void held_clock_done(held_clock *c, unsigned link, uint32_t bytes)
{
    pthread_mutex_lock(&c->lock);
    /* A connection made before held_clock_forget, or by a client without this clock, does
     * not count. */
    if (link == c->link)
        set(c, c->bytes > bytes ? c->bytes - bytes : 0);
    pthread_mutex_unlock(&c->lock);
}

unsigned held_clock_link(held_clock *c)
{
    unsigned link;

    pthread_mutex_lock(&c->lock);
    link = c->link;
    pthread_mutex_unlock(&c->lock);
    return link;
}

void held_clock_forget(held_clock *c)
{
    pthread_mutex_lock(&c->lock);
    set(c, 0);
    c->link++;
    pthread_mutex_unlock(&c->lock);
}

void held_clock_pass(held_clock *c, int64_t microseconds)
{
    pthread_mutex_lock(&c->lock);
    c->stopped += microseconds;
    pthread_mutex_unlock(&c->lock);
}

void held_clock_due(held_clock *c, int64_t at)
{
    pthread_mutex_lock(&c->lock);
    set(c, c->bytes);
    c->due = at > c->stopped ? at : c->stopped;
    pthread_mutex_unlock(&c->lock);
}

void held_clock_sleep(held_clock *c, int64_t microseconds)
{
    pthread_mutex_lock(&c->lock);
    if (c->seen == HELD_CLOCK_NEVER)
        c->seen = c->readTime;
    see(c, c->readTime + microseconds);
    pthread_mutex_unlock(&c->lock);
}

/* --- the port */

static int16_t clock_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    const held_clock *c = (held_clock *)context;

    return c->port.read(c->port.context, bytes, capacity);
}

static int16_t clock_write(void *context, const uint8_t *bytes, uint16_t length)
{
    held_clock *c = (held_clock *)context;

    /* Before the write, because the device may process the bytes at once. The bytes are
     * written at the time that the master read last, so the master is never late either. */
    pthread_mutex_lock(&c->lock);
    set(c, c->bytes);
    if (c->bytes == 0)
        c->stopped = c->readTime;
    c->bytes += length;
    pthread_mutex_unlock(&c->lock);
    int16_t taken = c->port.write(c->port.context, bytes, length);
    held_clock_done(c, c->link, taken < 0 ? length : (uint32_t)(length - taken));
    return taken;
}

static uint32_t clock_micros(void *context)
{
    held_clock *c = (held_clock *)context;

    pthread_mutex_lock(&c->lock);
    c->readTime = read_clock(c);
    see(c, c->readTime + LOOK);
    uint32_t shown = (uint32_t)c->readTime;
    pthread_mutex_unlock(&c->lock);
    return shown;
}

static uint8_t clock_flush(void *context)
{
    const held_clock *c = (held_clock *)context;

    return c->port.flush(c->port.context);
}

static void clock_idle(void *context, mbm_node *node)
{
    const held_clock *c = (held_clock *)context;

    c->port.idle(c->port.context, node);
}

mbm_port held_clock_port(held_clock *c, const mbm_port *line)
{
    mbm_port port = {
        .context = c, .read = clock_read, .write = clock_write, .micros = clock_micros};

    c->port = *line;
    port.flush = line->flush ? clock_flush : NULL;
    port.idle = line->idle ? clock_idle : NULL;
    return port;
}
