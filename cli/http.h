/* A responder of HTTP/1.0 for a few texts that can only be read: the metrics of a service, and the
 * page of mbm poll. It never blocks, has a fixed number of places, of which the oldest is freed for
 * a new connection, and renders a text at most ten times a second, so that a slow or hostile
 * visitor delays neither the program nor others. */
#pragma once

#include <poll.h>
#include <stddef.h>
#include <stdint.h>

enum {
    HTTP_PLACES = 8,
    HTTP_WAITS = HTTP_PLACES + 1,
    HTTP_REQUEST_BYTES = 8192 /* of the longest request: browsers send the cookies of a host */
};

/* A text that is answered. */
typedef struct http_page {
    const char *path, *type;
    const char *text; /* as it is; NULL if it is rendered */
    /* Returns the text, which is freed then, or NULL without memory. */
    char *(*render)(void *context);
    const char *header; /* more lines of the head, each with its \r\n; NULL: none */
} http_page;

typedef struct http_visitor {
    int fd; /* 0: a free place */
    int64_t sinceMs;
    size_t have, length, sent;
    char *reply; /* NULL while the request is read */
    char request[HTTP_REQUEST_BYTES];
} http_visitor;

/* A responder. It is zeroed at first, and the program sets the first three members. */
typedef struct http {
    const http_page *pages; /* the path of the last one is NULL */
    void *context;          /* of `render` */
    /* Answers only requests whose Host is an address in numbers or localhost: a web page of
     * others can make a name of its own mean this machine (DNS rebinding), but no address. */
    uint8_t checks_host;

    http_visitor visitors[HTTP_PLACES];
    int listener, is_ready; /* no descriptor of it is 0: that is standard input */
    const http_page *rendered_of;
    char *rendered;
    int64_t rendered_at, tired_until; /* no connection is accepted before that time */
} http;

/* Reads ADDRESS:PORT: 127.0.0.1:9100, [::1]:9100; port 0 is a free one. Only an address of this
 * machine that no other reaches is right, unless `may_be_any`; then a port alone means 127.0.0.1
 * too. Returns NULL, or what is wrong: a clause. */
const char *http_check(const char *text, int may_be_any);

/* Whether other machines may reach that address. */
int http_is_open(const char *text);

/* Begins to listen there. Returns the port, or -1 with errno set. */
int http_listen(http *h, const char *text);

/* What to poll, at most HTTP_WAITS, and for how long at most, in microseconds. */
nfds_t http_wait(const http *h, struct pollfd *waits);
uint32_t http_delay(const http *h);

/* Notes what a poll of those `count` waits has found. */
void http_polled(http *h, const struct pollfd *waits, nfds_t count);

/* Accepts, reads and answers, if the last poll has found something. */
void http_work(http *h);

void http_close(http *h);
