#define _GNU_SOURCE
#include "metrics.h"

#include "clock.h"
#include "numbers.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum {
    REQUEST_BYTES = 2048, /* of the longest request */
    LIFE_MS = 5000,       /* how long a connection may last */
    RENDER_MS = 100,      /* a text that is not older is sent again */
    TIRED_MS = 1000       /* the wait after the system had no descriptor */
};

typedef struct visitor {
    int fd; /* 0: a free place */
    int64_t sinceMs;
    size_t have, length, sent;
    char *reply; /* NULL while the request is read */
    char request[REQUEST_BYTES];
} visitor;

static visitor visitors[METRICS_PLACES];
static int listener = -1, is_ready;
static char *rendered;
static int64_t rendered_at, tired_until; /* no connection is accepted before that time */

/* Reads ADDRESS:PORT. Returns NULL, or what is wrong. */
static const char *read_address(const char *text, struct sockaddr_storage *to, socklen_t *length)
{
    static const char RULE[] =
        "is not an address of this machine and a port, such as 127.0.0.1:9100 or [::1]:9100";
    struct sockaddr_in *four = (struct sockaddr_in *)to;
    struct sockaddr_in6 *six = (struct sockaddr_in6 *)to;
    const char *colon = strrchr(text, ':');
    char host[64];
    int64_t port;
    size_t bytes;

    memset(to, 0, sizeof *to);
    bytes = colon ? (size_t)(colon - text) : 0;
    if (bytes == 0 || bytes >= sizeof host || number_read(colon + 1, 0, 65535, &port))
        return RULE;
    memcpy(host, text, bytes);
    host[bytes] = '\0';
    if (strcmp(host, "[::1]") == 0) {
        six->sin6_family = AF_INET6;
        six->sin6_addr = in6addr_loopback;
        six->sin6_port = htons((uint16_t)port);
        *length = sizeof *six;
        return NULL;
    }
    /* 127.0.0.0/8 is this machine. */
    if (inet_pton(AF_INET, host, &four->sin_addr) != 1 ||
        ntohl(four->sin_addr.s_addr) >> 24 != IN_LOOPBACKNET)
        return RULE;
    four->sin_family = AF_INET;
    four->sin_port = htons((uint16_t)port);
    *length = sizeof *four;
    return NULL;
}

const char *metrics_check(const char *text)
{
    struct sockaddr_storage address;
    socklen_t length;

    return read_address(text, &address, &length);
}

int metrics_listen(const char *text)
{
    struct sockaddr_storage address;
    socklen_t length = 0;
    const int on = 1;

    if (read_address(text, &address, &length)) {
        errno = EINVAL;
        return -1;
    }
    listener = socket(address.ss_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (listener < 0)
        return -1;
    (void)setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    if (bind(listener, (struct sockaddr *)&address, length) != 0 ||
        listen(listener, METRICS_PLACES) != 0 ||
        getsockname(listener, (struct sockaddr *)&address, &length) != 0) {
        const int error = errno;

        close(listener);
        listener = -1;
        errno = error;
        return -1;
    }
    return ntohs(address.ss_family == AF_INET6 ? ((struct sockaddr_in6 *)&address)->sin6_port
                                               : ((struct sockaddr_in *)&address)->sin_port);
}

static void drop(visitor *one)
{
    if (one->fd > 0)
        close(one->fd);
    free(one->reply);
    one->reply = NULL;
    one->fd = 0;
}

nfds_t metrics_wait(struct pollfd *waits)
{
    nfds_t count = 0;
    int i;

    if (listener < 0)
        return 0;
    if (clock_milliseconds() >= tired_until)
        waits[count++] = (struct pollfd){listener, POLLIN, 0};
    for (i = 0; i < METRICS_PLACES; i++)
        if (visitors[i].fd > 0)
            waits[count++] =
                (struct pollfd){visitors[i].fd, visitors[i].reply ? POLLOUT : POLLIN, 0};
    return count;
}

uint32_t metrics_delay(void)
{
    uint32_t delay =
        listener >= 0 && clock_milliseconds() < tired_until ? TIRED_MS * 1000 : UINT32_MAX;
    int i;

    for (i = 0; i < METRICS_PLACES; i++) {
        int64_t left;

        if (visitors[i].fd <= 0)
            continue;
        left = visitors[i].sinceMs + LIFE_MS - clock_milliseconds();
        if (left < 0)
            left = 0;
        if ((uint32_t)left * 1000u < delay)
            delay = (uint32_t)left * 1000u;
    }
    return delay;
}

/* Accepts one connection a round. If all places are taken, the oldest connection ends. */
static void take_visitor(void)
{
    visitor *place = visitors;
    int i, fd;

    if (clock_milliseconds() < tired_until)
        return;
    fd = accept4(listener, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (fd < 0) {
        if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM)
            tired_until = clock_milliseconds() + TIRED_MS;
        return;
    }
    for (i = 1; i < METRICS_PLACES && place->fd > 0; i++)
        if (visitors[i].fd <= 0 || visitors[i].sinceMs < place->sinceMs)
            place = &visitors[i];
    drop(place);
    place->fd = fd;
    place->sinceMs = clock_milliseconds();
    place->have = place->sent = place->length = 0;
}

static void answer(visitor *one, const char *status, const char *body)
{
    static const char FORMAT[] = "HTTP/1.0 %s\r\n"
                                 "Content-Type: text/plain; version=0.0.4; charset=utf-8\r\n"
                                 "Content-Length: %zu\r\n"
                                 "Connection: close\r\n\r\n%s";
    const int length = asprintf(&one->reply, FORMAT, status, strlen(body), body);

    if (length < 0) {
        one->reply = NULL;
        drop(one);
        return;
    }
    one->length = (size_t)length;
}

static void answer_request(visitor *one, char *(*render)(void))
{
    if (strncmp(one->request, "GET ", 4) != 0) {
        answer(one, "405 Method Not Allowed", "Only GET is answered.\n");
        return;
    }
    if (strncmp(one->request, "GET /metrics ", 13) != 0 &&
        strncmp(one->request, "GET /metrics?", 13) != 0) {
        answer(one, "404 Not Found", "The numbers are at /metrics.\n");
        return;
    }
    if (!rendered || clock_milliseconds() - rendered_at >= RENDER_MS) {
        free(rendered);
        rendered = render();
        rendered_at = clock_milliseconds();
    }
    if (rendered)
        answer(one, "200 OK", rendered);
    else
        answer(one, "500 Internal Server Error", "There is not enough memory.\n");
}

static void read_request(visitor *one, char *(*render)(void))
{
    const ssize_t count =
        recv(one->fd, one->request + one->have, sizeof one->request - 1 - one->have, 0);

    if (count < 0 && (errno == EAGAIN || errno == EINTR))
        return;
    if (count <= 0) {
        drop(one);
        return;
    }
    one->have += (size_t)count;
    one->request[one->have] = '\0';
    if (strstr(one->request, "\r\n\r\n") || strstr(one->request, "\n\n"))
        answer_request(one, render);
    else if (one->have == sizeof one->request - 1 || strlen(one->request) < one->have)
        answer(one, "400 Bad Request", "The request is too long, or no HTTP.\n");
}

static void write_reply(visitor *one)
{
    const ssize_t count =
        send(one->fd, one->reply + one->sent, one->length - one->sent, MSG_NOSIGNAL);

    if (count < 0 && (errno == EAGAIN || errno == EINTR))
        return;
    if (count > 0)
        one->sent += (size_t)count;
    if (count <= 0 || one->sent == one->length)
        drop(one);
}

void metrics_polled(const struct pollfd *waits, nfds_t count)
{
    nfds_t i;

    for (i = 0; i < count; i++)
        is_ready |= waits[i].revents != 0;
}

void metrics_work(char *(*render)(void))
{
    int i;

    /* A visitor may be overdue. */
    for (i = 0; i < METRICS_PLACES; i++)
        is_ready |= visitors[i].fd > 0;
    if (listener < 0 || !is_ready)
        return;
    is_ready = 0;
    take_visitor();
    for (i = 0; i < METRICS_PLACES; i++) {
        visitor *one = &visitors[i];

        if (one->fd > 0 && !one->reply)
            read_request(one, render);
        if (one->fd > 0 && one->reply)
            write_reply(one);
        if (one->fd > 0 && clock_milliseconds() - one->sinceMs >= LIFE_MS)
            drop(one);
    }
}

void metrics_close(void)
{
    int i;

    for (i = 0; i < METRICS_PLACES; i++)
        drop(&visitors[i]);
    if (listener >= 0)
        close(listener);
    listener = -1;
    free(rendered);
    rendered = NULL;
}
