/* An mbm_port over a TCP socket. Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "mbm_tcp.h"

#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stddef.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

/* Requests are short and answered one by one: none is to wait for another. */
static int prepare(int fd)
{
    int flags = fcntl(fd, F_GETFL), on = 1;

    if (flags < 0 || fcntl(fd, F_SETFL, flags | O_NONBLOCK) < 0)
        return -1;
    /* Fails on what is no TCP socket, which works all the same. */
    (void)setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    return 0;
}

static int connect_to(mbm_tcp *tcp, const struct addrinfo *at)
{
    int fd = socket(at->ai_family, at->ai_socktype | SOCK_CLOEXEC, at->ai_protocol);
    int failed;

    if (fd < 0)
        return -1;
    if (prepare(fd) == 0) {
        if (connect(fd, at->ai_addr, at->ai_addrlen) == 0 || errno == EINPROGRESS) {
            tcp->fd = fd;
            tcp->connecting = 1;
            return 0;
        }
    }
    failed = errno;
    close(fd);
    errno = failed;
    return -1;
}

static int open_again(mbm_tcp *tcp)
{
    struct addrinfo wanted, *found, *at;
    int outcome = -1;

    memset(&wanted, 0, sizeof wanted);
    wanted.ai_family = AF_UNSPEC;
    wanted.ai_socktype = SOCK_STREAM;
    if (getaddrinfo(tcp->host, tcp->service, &wanted, &found) != 0) {
        errno = EHOSTUNREACH;
        return -1;
    }
    for (at = found; at && outcome < 0; at = at->ai_next)
        outcome = connect_to(tcp, at);
    freeaddrinfo(found);
    return outcome;
}

int mbm_tcp_open(mbm_tcp *tcp, const char *host, const char *service)
{
    tcp->fd = -1;
    tcp->host = host;
    tcp->service = service;
    tcp->connecting = 0;
    return open_again(tcp);
}

int mbm_tcp_attach(mbm_tcp *tcp, int fd)
{
    tcp->fd = fd;
    tcp->host = NULL;
    tcp->service = NULL;
    tcp->connecting = 0;
    return prepare(fd);
}

void mbm_tcp_close(mbm_tcp *tcp)
{
    if (tcp->fd >= 0)
        close(tcp->fd);
    tcp->fd = -1;
    tcp->connecting = 0;
}

uint8_t mbm_tcp_is_connecting(const mbm_tcp *tcp)
{
    return tcp->connecting;
}

/* 1 if the connection stands, 0 if not yet, -1 if it failed. */
static int stands(mbm_tcp *tcp)
{
    struct pollfd socket_of = {tcp->fd, POLLOUT, 0};
    int failed = 0;
    socklen_t length = sizeof failed;

    if (tcp->fd < 0)
        return -1;
    if (!tcp->connecting)
        return 1;
    if (poll(&socket_of, 1, 0) == 0)
        return 0;
    if (getsockopt(tcp->fd, SOL_SOCKET, SO_ERROR, &failed, &length) < 0 || failed != 0)
        return -1;
    tcp->connecting = 0;
    return 1;
}

/* A signal and "try again" mean that nothing was moved; all else that the
 * link is gone. */
static int16_t outcome(ssize_t count)
{
    if (count > 0)
        return (int16_t)count;
    if (count < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR))
        return 0;
    return -1;
}

/* A count of more than fits is asked for in parts. */
static size_t at_most(uint16_t length)
{
    return length < INT16_MAX ? length : INT16_MAX;
}

static int16_t tcp_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    mbm_tcp *tcp = (mbm_tcp *)context;
    int up = stands(tcp);

    if (up <= 0 || capacity == 0)
        return (int16_t)(up < 0 ? -1 : 0);
    return outcome(recv(tcp->fd, bytes, at_most(capacity), 0));
}

static int16_t tcp_write(void *context, const uint8_t *bytes, uint16_t length)
{
    mbm_tcp *tcp = (mbm_tcp *)context;
    int up = stands(tcp);

    if (up <= 0 || length == 0)
        return (int16_t)(up < 0 ? -1 : 0);
    return outcome(send(tcp->fd, bytes, at_most(length), MSG_NOSIGNAL));
}

static uint32_t tcp_micros(void *context)
{
    struct timespec now;

    (void)context;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)now.tv_sec * 1000000u + (uint32_t)now.tv_nsec / 1000u;
}

mbm_port mbm_tcp_port(mbm_tcp *tcp)
{
    mbm_port port = {0};

    port.context = tcp;
    port.read = tcp_read;
    port.write = tcp_write;
    port.micros = tcp_micros;
    return port;
}

static void link_disconnect(void *context)
{
    mbm_tcp_close((mbm_tcp *)context);
}

static uint8_t link_connect(void *context)
{
    mbm_tcp *tcp = (mbm_tcp *)context;

    if (!tcp->host || open_again(tcp) < 0)
        return MBM_LINK_LOST;
    return MBM_PENDING;
}

mbm_link mbm_tcp_link(mbm_tcp *tcp)
{
    mbm_link link = {tcp, link_disconnect, link_connect};

    return link;
}
