/* Accepts the connections of visitors, reads their requests, and answers them. */
#include "http.h"

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
#include <strings.h>
#include <unistd.h>

enum {
    LIFE_MS = 5000,  /* how long a connection may last */
    RENDER_MS = 100, /* a text that is not older is sent again */
    TIRED_MS = 1000  /* the wait after the system had no descriptor */
};

/* An address and a port, as a program writes them. */
typedef struct address {
    union {
        struct sockaddr any;
        struct sockaddr_in four;
        struct sockaddr_in6 six;
    } of;
    socklen_t length;
    uint8_t is_open; /* other machines may reach it */
} address;

/* Reads the address of a host in numbers. Returns 0 if it is none. */
static int read_host(const char *host, address *to)
{
    char inner[INET6_ADDRSTRLEN];
    const size_t length = strlen(host);

    memset(to, 0, sizeof *to);
    if (inet_pton(AF_INET, host, &to->of.four.sin_addr) == 1) {
        to->of.four.sin_family = AF_INET;
        to->length = sizeof to->of.four;
        /* 127.0.0.0/8 is this machine. */
        to->is_open = ntohl(to->of.four.sin_addr.s_addr) >> 24 != IN_LOOPBACKNET;
        return 1;
    }
    if (length < 3 || host[0] != '[' || host[length - 1] != ']' || length - 2 >= sizeof inner)
        return 0;
    memcpy(inner, host + 1, length - 2);
    inner[length - 2] = '\0';
    if (inet_pton(AF_INET6, inner, &to->of.six.sin6_addr) != 1)
        return 0;
    to->of.six.sin6_family = AF_INET6;
    to->length = sizeof to->of.six;
    to->is_open = !IN6_IS_ADDR_LOOPBACK(&to->of.six.sin6_addr);
    return 1;
}

/* Reads ADDRESS:PORT, or PORT. Returns 0 if it is none. */
static int read_address(const char *text, address *to)
{
    const char *colon = strrchr(text, ':');
    const size_t length = colon ? (size_t)(colon - text) : 0;
    char host[64] = "127.0.0.1";
    int64_t port;

    if (length >= sizeof host || number_read(colon ? colon + 1 : text, 0, 65535, &port))
        return 0;
    if (colon) {
        memcpy(host, text, length);
        host[length] = '\0';
    }
    if (!read_host(host, to))
        return 0;
    if (to->of.any.sa_family == AF_INET6)
        to->of.six.sin6_port = htons((uint16_t)port);
    else
        to->of.four.sin_port = htons((uint16_t)port);
    return 1;
}

const char *http_check(const char *text, int may_be_any)
{
    address to;

    if (read_address(text, &to) && (may_be_any || (!to.is_open && strchr(text, ':'))))
        return NULL;
    return may_be_any ? "is not a port, or an address in numbers and a port, such as 8080, "
                        "127.0.0.1:8080 or 192.168.0.2:8080"
                      : "is not an address of this machine and a port, such as 127.0.0.1:9100 or "
                        "[::1]:9100";
}

int http_is_open(const char *text)
{
    address to;

    return read_address(text, &to) && to.is_open;
}

int http_listen(http *h, const char *text)
{
    const int on = 1;
    address to;

    if (!read_address(text, &to)) {
        errno = EINVAL;
        return -1;
    }
    h->listener = socket(to.of.any.sa_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (h->listener <= 0)
        return -1;
    (void)setsockopt(h->listener, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    if (bind(h->listener, &to.of.any, to.length) != 0 || listen(h->listener, HTTP_PLACES) != 0 ||
        getsockname(h->listener, &to.of.any, &to.length) != 0) {
        const int error = errno;

        close(h->listener);
        h->listener = 0;
        errno = error;
        return -1;
    }
    return ntohs(to.of.any.sa_family == AF_INET6 ? to.of.six.sin6_port : to.of.four.sin_port);
}

static void drop(http_visitor *one)
{
    if (one->fd > 0)
        close(one->fd);
    free(one->reply);
    one->reply = NULL;
    one->fd = 0;
}

nfds_t http_wait(const http *h, struct pollfd *waits)
{
    nfds_t count = 0;
    int i;

    if (h->listener <= 0)
        return 0;
    if (clock_milliseconds() >= h->tired_until)
        waits[count++] = (struct pollfd){h->listener, POLLIN, 0};
    for (i = 0; i < HTTP_PLACES; i++)
        if (h->visitors[i].fd > 0)
            waits[count++] =
                (struct pollfd){h->visitors[i].fd, h->visitors[i].reply ? POLLOUT : POLLIN, 0};
    return count;
}

uint32_t http_delay(const http *h)
{
    uint32_t delay =
        h->listener > 0 && clock_milliseconds() < h->tired_until ? TIRED_MS * 1000 : UINT32_MAX;
    int i;

    for (i = 0; i < HTTP_PLACES; i++) {
        int64_t left;

        if (h->visitors[i].fd <= 0)
            continue;
        left = h->visitors[i].sinceMs + LIFE_MS - clock_milliseconds();
        if (left < 0)
            left = 0;
        if ((uint32_t)left * 1000u < delay)
            delay = (uint32_t)left * 1000u;
    }
    return delay;
}

/* Accepts one connection a round. If all places are taken, the oldest connection ends. */
static void take_visitor(http *h)
{
    http_visitor *place = h->visitors;
    int i, fd;

    if (clock_milliseconds() < h->tired_until)
        return;
    fd = accept4(h->listener, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (fd < 0) {
        if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM)
            h->tired_until = clock_milliseconds() + TIRED_MS;
        return;
    }
    for (i = 1; i < HTTP_PLACES && place->fd > 0; i++)
        if (h->visitors[i].fd <= 0 || h->visitors[i].sinceMs < place->sinceMs)
            place = &h->visitors[i];
    drop(place);
    place->fd = fd;
    place->sinceMs = clock_milliseconds();
    place->have = place->sent = place->length = 0;
}

static void answer(http_visitor *one, const char *status, const http_page *as, const char *body)
{
    static const char FORMAT[] = "HTTP/1.0 %s\r\n"
                                 "Content-Type: %s\r\n"
                                 "Content-Length: %zu\r\n%s"
                                 "Connection: close\r\n\r\n%s";
    const int length =
        asprintf(&one->reply, FORMAT, status, as ? as->type : "text/plain; charset=utf-8",
                 strlen(body), as && as->header ? as->header : "", body);

    if (length < 0) {
        one->reply = NULL;
        drop(one);
        return;
    }
    one->length = (size_t)length;
}

/* Whether a host is an address in numbers or localhost, each with its port or without it. */
static int is_right_host(const char *from, size_t length)
{
    char host[64];
    size_t end;
    address to;

    if (length >= sizeof host)
        return 0;
    memcpy(host, from, length);
    host[length] = '\0';
    end = *host == '[' ? strcspn(host, "]") + 1 : strcspn(host, ":");
    if (end < length && host[end] != ':')
        return 0;
    host[end < length ? end : length] = '\0';
    return strcasecmp(host, "localhost") == 0 || read_host(host, &to);
}

static int has_right_host(const char *request)
{
    const char *at = request;

    while ((at = strchr(at, '\n')) != NULL) {
        at++;
        if (strncasecmp(at, "Host:", 5) != 0)
            continue;
        at += 5 + strspn(at + 5, " \t");
        if (!is_right_host(at, strcspn(at, " \t\r\n")))
            return 0;
    }
    return 1;
}

/* Returns the page of a request, or NULL. */
static const http_page *find_page(const http *h, const char *path)
{
    const size_t length = strcspn(path, " ?\r\n");
    const http_page *page;

    for (page = h->pages; page->path; page++)
        if (strlen(page->path) == length && memcmp(page->path, path, length) == 0 &&
            strchr(" ?", path[length]))
            return page;
    return NULL;
}

/* Returns the text of a page, or NULL without memory. */
static const char *text_of(http *h, const http_page *page)
{
    if (page->text)
        return page->text;
    if (!h->rendered || h->rendered_of != page ||
        clock_milliseconds() - h->rendered_at >= RENDER_MS) {
        free(h->rendered);
        h->rendered = page->render(h->context);
        h->rendered_of = page;
        h->rendered_at = clock_milliseconds();
    }
    return h->rendered;
}

static void answer_request(http *h, http_visitor *one)
{
    const http_page *page;
    const char *text;

    if (h->checks_host && !has_right_host(one->request)) {
        answer(one, "421 Misdirected Request", NULL,
               "Ask by the address in numbers, such as 127.0.0.1, or localhost.\n");
        return;
    }
    if (strncmp(one->request, "GET ", 4) != 0) {
        answer(one, "405 Method Not Allowed", NULL, "Only GET is answered.\n");
        return;
    }
    page = find_page(h, one->request + 4);
    text = page ? text_of(h, page) : NULL;
    if (!page)
        answer(one, "404 Not Found", NULL, say("Nothing is here. See %s.\n", h->pages->path));
    else if (text)
        answer(one, "200 OK", page, text);
    else
        answer(one, "500 Internal Server Error", NULL, "There is not enough memory.\n");
}

static void read_request(http *h, http_visitor *one)
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
        answer_request(h, one);
    else if (one->have == sizeof one->request - 1 || strlen(one->request) < one->have)
        answer(one, "400 Bad Request", NULL, "The request is too long, or no HTTP.\n");
}

static void write_reply(http_visitor *one)
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

void http_polled(http *h, const struct pollfd *waits, nfds_t count)
{
    nfds_t i;

    for (i = 0; i < count; i++)
        h->is_ready |= waits[i].revents != 0;
}

void http_work(http *h)
{
    int i;

    /* A visitor may be overdue. */
    for (i = 0; i < HTTP_PLACES; i++)
        h->is_ready |= h->visitors[i].fd > 0;
    if (h->listener <= 0 || !h->is_ready)
        return;
    h->is_ready = 0;
    take_visitor(h);
    for (i = 0; i < HTTP_PLACES; i++) {
        http_visitor *one = &h->visitors[i];

        if (one->fd > 0 && !one->reply)
            read_request(h, one);
        if (one->fd > 0 && one->reply)
            write_reply(one);
        if (one->fd > 0 && clock_milliseconds() - one->sinceMs >= LIFE_MS)
            drop(one);
    }
}

void http_close(http *h)
{
    int i;

    for (i = 0; i < HTTP_PLACES; i++)
        drop(&h->visitors[i]);
    if (h->listener > 0)
        close(h->listener);
    h->listener = 0;
    free(h->rendered);
    h->rendered = NULL;
}
