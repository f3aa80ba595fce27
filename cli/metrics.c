/* Accepts the connections of scrapers, reads their requests, and answers them.
 *
 * Licence: MIT OR Apache-2.0. */
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
    LIFE_MS = 5000,  /* how long a connection may last */
    RENDER_MS = 100, /* a text that is not older is sent again */
    TIRED_MS = 1000  /* the wait after the system had no descriptor */
};

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

int metrics_listen(metrics *m, const char *text, char *(*render)(void *context), void *context)
{
    struct sockaddr_storage address;
    socklen_t length = 0;
    const int on = 1;

    m->render = render;
    m->context = context;
    if (read_address(text, &address, &length)) {
        errno = EINVAL;
        return -1;
    }
    m->listener = socket(address.ss_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (m->listener <= 0)
        return -1;
    (void)setsockopt(m->listener, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    if (bind(m->listener, (struct sockaddr *)&address, length) != 0 ||
        listen(m->listener, METRICS_PLACES) != 0 ||
        getsockname(m->listener, (struct sockaddr *)&address, &length) != 0) {
        const int error = errno;

        close(m->listener);
        m->listener = 0;
        errno = error;
        return -1;
    }
    return ntohs(address.ss_family == AF_INET6 ? ((struct sockaddr_in6 *)&address)->sin6_port
                                               : ((struct sockaddr_in *)&address)->sin_port);
}

static void drop(metrics_visitor *one)
{
    if (one->fd > 0)
        close(one->fd);
    free(one->reply);
    one->reply = NULL;
    one->fd = 0;
}

nfds_t metrics_wait(const metrics *m, struct pollfd *waits)
{
    nfds_t count = 0;
    int i;

    if (m->listener <= 0)
        return 0;
    if (clock_milliseconds() >= m->tired_until)
        waits[count++] = (struct pollfd){m->listener, POLLIN, 0};
    for (i = 0; i < METRICS_PLACES; i++)
        if (m->visitors[i].fd > 0)
            waits[count++] =
                (struct pollfd){m->visitors[i].fd, m->visitors[i].reply ? POLLOUT : POLLIN, 0};
    return count;
}

uint32_t metrics_delay(const metrics *m)
{
    uint32_t delay =
        m->listener > 0 && clock_milliseconds() < m->tired_until ? TIRED_MS * 1000 : UINT32_MAX;
    int i;

    for (i = 0; i < METRICS_PLACES; i++) {
        int64_t left;

        if (m->visitors[i].fd <= 0)
            continue;
        left = m->visitors[i].sinceMs + LIFE_MS - clock_milliseconds();
        if (left < 0)
            left = 0;
        if ((uint32_t)left * 1000u < delay)
            delay = (uint32_t)left * 1000u;
    }
    return delay;
}

/* Accepts one connection a round. If all places are taken, the oldest connection ends. */
static void take_visitor(metrics *m)
{
    metrics_visitor *place = m->visitors;
    int i, fd;

    if (clock_milliseconds() < m->tired_until)
        return;
    fd = accept4(m->listener, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (fd < 0) {
        if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM)
            m->tired_until = clock_milliseconds() + TIRED_MS;
        return;
    }
    for (i = 1; i < METRICS_PLACES && place->fd > 0; i++)
        if (m->visitors[i].fd <= 0 || m->visitors[i].sinceMs < place->sinceMs)
            place = &m->visitors[i];
    drop(place);
    place->fd = fd;
    place->sinceMs = clock_milliseconds();
    place->have = place->sent = place->length = 0;
}

static void answer(metrics_visitor *one, const char *status, const char *body)
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

static void answer_request(metrics *m, metrics_visitor *one)
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
    if (!m->rendered || clock_milliseconds() - m->rendered_at >= RENDER_MS) {
        free(m->rendered);
        m->rendered = m->render(m->context);
        m->rendered_at = clock_milliseconds();
    }
    if (m->rendered)
        answer(one, "200 OK", m->rendered);
    else
        answer(one, "500 Internal Server Error", "There is not enough memory.\n");
}

static void read_request(metrics *m, metrics_visitor *one)
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
        answer_request(m, one);
    else if (one->have == sizeof one->request - 1 || strlen(one->request) < one->have)
        answer(one, "400 Bad Request", "The request is too long, or no HTTP.\n");
}

static void write_reply(metrics_visitor *one)
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

void metrics_polled(metrics *m, const struct pollfd *waits, nfds_t count)
{
    nfds_t i;

    for (i = 0; i < count; i++)
        m->is_ready |= waits[i].revents != 0;
}

void metrics_work(metrics *m)
{
    int i;

    /* A visitor may be overdue. */
    for (i = 0; i < METRICS_PLACES; i++)
        m->is_ready |= m->visitors[i].fd > 0;
    if (m->listener <= 0 || !m->is_ready)
        return;
    m->is_ready = 0;
    take_visitor(m);
    for (i = 0; i < METRICS_PLACES; i++) {
        metrics_visitor *one = &m->visitors[i];

        if (one->fd > 0 && !one->reply)
            read_request(m, one);
        if (one->fd > 0 && one->reply)
            write_reply(one);
        if (one->fd > 0 && clock_milliseconds() - one->sinceMs >= LIFE_MS)
            drop(one);
    }
}

void metrics_close(metrics *m)
{
    int i;

    for (i = 0; i < METRICS_PLACES; i++)
        drop(&m->visitors[i]);
    if (m->listener > 0)
        close(m->listener);
    m->listener = 0;
    free(m->rendered);
    m->rendered = NULL;
}
