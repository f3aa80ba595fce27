#define _GNU_SOURCE
#include "tcp_stream.h"
#include "tcp_server.h"

#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

void stream_let_go(stream *c)
{
    if (c->fd >= 0)
        close(c->fd);
    memset(c, 0, sizeof *c);
    c->fd = -1;
}

void stream_reset(stream *c)
{
    (void)tcp_resetAtClose(c->fd);
    stream_let_go(c);
}

/* Does not close the socket: a close while bytes are unread would be a reset. */
void stream_end(stream *c)
{
    shutdown(c->fd, SHUT_WR);
    c->ended = 1;
    c->holds = c->joins = c->join_more = 0;
}

static void put(stream *c, const uint8_t *bytes, size_t length)
{
    while (c->fd >= 0 && !c->ended && length > 0) {
        ssize_t sent = send(c->fd, bytes, length, MSG_NOSIGNAL);

        if (sent <= 0) {
            stream_let_go(c);
            return;
        }
        bytes += sent;
        length -= (size_t)sent;
    }
}

static void flush_joined(stream *c)
{
    size_t length = c->joins;

    c->joins = c->join_more = 0;
    put(c, c->joined, length);
}

static void join(stream *c, const uint8_t *bytes, size_t length)
{
    if (c->joins + length > STREAM_JOINED)
        flush_joined(c);
    memcpy(c->joined + c->joins, bytes, length);
    c->joins += length;
}

void stream_send_raw(stream *c, const uint8_t *bytes, size_t length)
{
    flush_joined(c);
    put(c, bytes, length);
}

void stream_send_whole(stream *c, const reply *r)
{
    if (c->join_more == 0) {
        put(c, r->bytes, r->length);
        return;
    }
    join(c, r->bytes, r->length);
    if (--c->join_more == 0)
        flush_joined(c);
}

void stream_release(stream *c, int64_t now, int one_was_sent)
{
    size_t i = 0;

    while (i < c->holds) {
        waiting *w = &c->held[i];
        reply r;

        if (one_was_sent && w->replies_before > 0 && --w->replies_before == 0)
            w->due = now;
        if (w->due > now) {
            i++;
            continue;
        }
        r = w->what;
        memmove(w, w + 1, (--c->holds - i) * sizeof *w);
        stream_send_whole(c, &r);
    }
    if (c->join_more > 0 && c->join_due <= now)
        flush_joined(c);
}

void stream_hold(stream *c, const reply *r, int64_t due, unsigned replies_before)
{
    if (c->holds == STREAM_HELD) {
        c->held[0].due = 0;
        stream_release(c, 0, 0);
    }
    waiting *w = &c->held[c->holds++];
    w->what = *r;
    w->due = due;
    w->replies_before = replies_before;
}

void stream_split(stream *c, const reply *r, unsigned pause)
{
    flush_joined(c);
    for (size_t i = 0; i < r->length && c->fd >= 0; i++) {
        put(c, r->bytes + i, 1);
        if (pause > 0)
            usleep(pause * 1000);
    }
}

void stream_join(stream *c, const reply *r, int64_t due, unsigned more)
{
    if (c->join_more < more + 1)
        c->join_more = more + 1;
    c->join_due = due;
    stream_send_whole(c, r);
}

int64_t stream_due(const stream *c, int64_t latest)
{
    for (size_t i = 0; i < c->holds; i++)
        latest = c->held[i].due < latest ? c->held[i].due : latest;
    if (c->join_more > 0 && c->join_due < latest)
        latest = c->join_due;
    return latest;
}
