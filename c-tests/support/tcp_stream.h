/* One connection of the TCP peer, and the replies that wait to be sent over it. */
#ifndef TCP_STREAM_H
#define TCP_STREAM_H

#include <stddef.h>
#include <stdint.h>

enum { STREAM_FRAME = 260, STREAM_HELD = 16, STREAM_INPUT = 8192, STREAM_JOINED = 32 * 260 };

typedef struct reply {
    uint8_t bytes[STREAM_FRAME];
    size_t length;
} reply;

/* A reply that waits for a time, or until a number of others have been sent. */
typedef struct waiting {
    reply what;
    int64_t due;
    unsigned replies_before;
} waiting;

typedef struct stream {
    int fd;        /* -1 if the place is free */
    unsigned link; /* the number that the clock gives to the connection */
    int ended;     /* 1: our side of the stream has ended, and received bytes are dropped */
    uint8_t input[STREAM_INPUT];
    size_t have;
    waiting held[STREAM_HELD];
    size_t holds;
    uint8_t joined[STREAM_JOINED];
    size_t joins;       /* bytes that wait to be sent together */
    unsigned join_more; /* how many replies are still to join them */
    int64_t join_due;
} stream;

/* Closes the socket, if it is open, and frees the place. */
void stream_let_go(stream *c);

/* Closes with a reset (RST) instead of the end of the stream. */
void stream_reset(stream *c);

/* Ends our side of the stream. Bytes that are received later are dropped. */
void stream_end(stream *c);

/* Sends bytes that are not a complete right reply. Bytes that wait to be sent together go
 * first. */
void stream_send_raw(stream *c, const uint8_t *bytes, size_t length);

/* Sends a reply, or joins it to those that wait to be sent together. */
void stream_send_whole(stream *c, const reply *r);

/* Sends a reply byte by byte, with pauses of `pause` milliseconds. */
void stream_split(stream *c, const reply *r, unsigned pause);

/* Sends a reply at the time `due`, or once `replies_before` other replies have been sent. */
void stream_hold(stream *c, const reply *r, int64_t due, unsigned replies_before);

/* Sends this reply and the next `more` replies in one send, at the time `due` at the latest. */
void stream_join(stream *c, const reply *r, int64_t due, unsigned more);

/* Sends the replies that are due. If `one_was_sent`, a reply has just been sent, which
 * others may have waited for. */
void stream_release(stream *c, int64_t now, int one_was_sent);

/* The time at which the first waiting reply is due, at most `latest`. */
int64_t stream_due(const stream *c, int64_t latest);

#endif
