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

/* A reply that waits for a time, and until so many others have been sent. */
typedef struct waiting {
    reply what;
    int64_t due;
    unsigned behind;
} waiting;

typedef struct stream {
    int fd;        /* -1 if the place is free */
    unsigned link; /* as the clock counts them */
    int ended;     /* our end of the stream is closed; what comes is dropped */
    uint8_t input[STREAM_INPUT];
    size_t have;
    waiting held[STREAM_HELD];
    size_t holds;
    uint8_t joined[STREAM_JOINED];
    size_t joins;       /* bytes that wait for one send */
    unsigned join_more; /* replies that are still to join */
    int64_t join_due;
} stream;

/* Closes, if it is open, and makes the place free. */
void stream_let_go(stream *c);

/* Closes with a reset (RST) instead of the end of the stream. */
void stream_reset(stream *c);

/* Ends our side of the stream; what still comes is dropped. */
void stream_end(stream *c);

/* Sends bytes that are no whole right reply, behind what waits to be sent
 * together with it. */
void stream_send_raw(stream *c, const uint8_t *bytes, size_t length);

/* Sends a reply, or joins it to others. */
void stream_send_whole(stream *c, const reply *r);

/* Sends a reply byte by byte, `pause` milliseconds between. */
void stream_split(stream *c, const reply *r, unsigned pause);

/* Sends a reply at the time `due`, or once `behind` others have been sent. */
void stream_hold(stream *c, const reply *r, int64_t due, unsigned behind);

/* Sends this one and the next replies, `more` of them, in one send, at the time
 * `due` at the latest. */
void stream_join(stream *c, const reply *r, int64_t due, unsigned more);

/* Sends what is due, and what waited for the reply that `one_was_sent`. */
void stream_release(stream *c, int64_t now, int one_was_sent);

/* When the first of what waits is due, or `latest`. */
int64_t stream_due(const stream *c, int64_t latest);

#endif
