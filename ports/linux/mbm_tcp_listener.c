/* The listener of mbm_tcp.h. Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "mbm_tcp.h"

#include <string.h>

#ifdef MBM_TCP_OVER_LWIP
#include "mbm_lwip_sockets.h"
#else
#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>
#include <unistd.h>

/* A second descriptor of the same socket; -1 if the system refuses. */
static inline int mbm_tcp_duplicate(int fd)
{
    return fcntl(fd, F_DUPFD_CLOEXEC, 1);
}
#endif

/* The most connections that one mbm_tcp_accept turns away, so that a flood of connections
 * does not keep a program from those that it serves. */
enum { MAX_REJECTED = 64 };

static int refuse(int error)
{
    errno = error;
    return -1;
}

/* Sets what the listener is polled for, also by its set. If the set refuses, mbm_tcp_accept
 * tries again. */
static void set_events(mbm_tcp_listener *listener, uint8_t events)
{
    mbm_tcp_set *set = listener->set;
    const uint8_t before = listener->events;

    listener->events = events;
    if (set && before != events && set->watch(set, listener->fd, listener, before, events) < 0)
        listener->events = 0;
}

static uint16_t port_of(int fd)
{
    struct sockaddr_storage address;
    socklen_t size = sizeof address;

    memset(&address, 0, sizeof address);
    if (getsockname(fd, (struct sockaddr *)&address, &size) < 0)
        return 0;
#ifndef MBM_TCP_HAS_NO_IPV6
    if (address.ss_family == AF_INET6)
        return ntohs(((struct sockaddr_in6 *)&address)->sin6_port);
#endif
    return ntohs(((struct sockaddr_in *)&address)->sin_port);
}

static int listen_at(const struct addrinfo *address)
{
    int fd = socket(address->ai_family, SOCK_STREAM, 0), one = 1, error;

    if (fd < 0)
        return -1;
    /* Without this, a server that restarts could not listen, because of its old connections. */
    (void)setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    if (mbm_tcp_setFlags(fd) == 0 && bind(fd, address->ai_addr, address->ai_addrlen) == 0 &&
        listen(fd, SOMAXCONN) == 0)
        return fd;
    error = errno;
    close(fd);
    return refuse(error);
}

/* Opens the spare descriptor, if there is none: with it, connections for which the system has no
 * descriptor can be accepted and closed. */
static void keep_spare(mbm_tcp_listener *listener)
{
    if (listener->spare == 0)
        listener->spare = mbm_tcp_duplicate(listener->fd);
    if (listener->spare < 0)
        listener->spare = 0;
}

/* Closes the spare descriptor. Returns 0 if there was none. */
static int free_spare(mbm_tcp_listener *listener)
{
    const int spare = listener->spare;

    listener->spare = 0;
    return spare > 0 && close(spare) == 0;
}

int mbm_tcp_listen(mbm_tcp_listener *listener, const char *host, const char *service)
{
    struct addrinfo *found, *one;
    int fd = -1, error;

    if (listener->port != 0)
        return refuse(EBUSY);
    if (mbm_tcp_lookUp(host, service, AI_PASSIVE, &found, &listener->lookupError) < 0)
        return -1;
    errno = EADDRNOTAVAIL;
    for (one = found; one && fd < 0; one = one->ai_next)
        fd = listen_at(one);
    error = errno;
    freeaddrinfo(found);
    if (fd < 0)
        return refuse(error);
    listener->fd = fd;
    listener->spare = 0;
    keep_spare(listener);
    listener->port = port_of(fd);
    listener->events = POLLIN;
    listener->nothingToAccept = 0;
    listener->refused = 0;
    listener->idle = 0;
    return 0;
}

/* Closes a connection without a reset, also if the client has sent a request already. */
static void reject(int fd)
{
    uint8_t unread[512];
    int rounds = 0;

    shutdown(fd, SHUT_WR);
    while (rounds++ < 8 && recv(fd, unread, sizeof unread, MSG_DONTWAIT) > 0)
        ;
    close(fd);
}

/* Ends the connection that has been idle for longest. Returns whether there was one. */
static int close_oldest(mbm_tcp_listener *listener, mbm_tcp *tcps, size_t count)
{
    mbm_tcp *oldest = NULL;
    size_t i;

    if (listener->idleTimeMs == 0)
        return 0;
    for (i = 0; i < count; i++) {
        /* Compares the times of the last bytes, since the idle times grow from one call to
         * the next. */
        if (!tcps[i].isBusy && mbm_tcp_idleFor(&tcps[i]) >= (int64_t)listener->idleTimeMs &&
            (!oldest || tcps[i].lastActivityUs < oldest->lastActivityUs))
            oldest = &tcps[i];
    }
    if (!oldest)
        return 0;
    mbm_tcp_disconnect(oldest);
    oldest->error = ETIMEDOUT;
    mbm_tcp_markReady(oldest);
    listener->idle++;
    return 1;
}

static int is_connection_waiting(const mbm_tcp_listener *listener)
{
    struct pollfd wait = {listener->fd, POLLIN, 0};

    return poll(&wait, 1, 0) > 0;
}

static int is_shortage(int error)
{
    return error == EMFILE || error == ENFILE || error == ENOBUFS || error == ENOMEM;
}

/* Accepts a connection in place of the spare descriptor, and closes it. Returns 0 if the system
 * refuses that too. */
static int reject_by_spare(mbm_tcp_listener *listener)
{
    int fd = -1;

    if (free_spare(listener))
        fd = accept(listener->fd, NULL, NULL);
    if (fd >= 0) {
        listener->refused++;
        reject(fd);
    }
    keep_spare(listener);
    return fd >= 0;
}

/* Returns the descriptor of the next connection. Closes up to `rejects` connections for which the
 * system has no descriptor, and counts them off. */
static int take_next(mbm_tcp_listener *listener, mbm_tcp *tcps, size_t count, int *rejects)
{
    int fd;

    while (*rejects > 0) {
        fd = accept(listener->fd, NULL, NULL);
        if (fd >= 0)
            return fd;
        if (errno == EWOULDBLOCK)
            return refuse(EAGAIN);
        if (errno == EINTR || errno == ECONNABORTED)
            continue;
        if (is_shortage(errno)) {
            const int error = errno;

            /* Without a free descriptor accept fails also if no connection waits. */
            if (!is_connection_waiting(listener))
                return refuse(EAGAIN);
            if (close_oldest(listener, tcps, count))
                continue;
            if (reject_by_spare(listener)) {
                --*rejects;
                continue;
            }
            errno = error;
        }
        return -1;
    }
    return refuse(EAGAIN);
}

/* Makes a connection a port in a place, or closes it. */
static int put_in_place(const mbm_tcp_listener *listener, mbm_tcp *tcp, int fd)
{
    int error;

    if (mbm_tcp_attach(tcp, fd) < 0) {
        error = errno;
        close(fd);
        return refuse(error);
    }
    if (listener->set && listener->set->add(listener->set, tcp) < 0) {
        error = errno;
        mbm_tcp_close(tcp);
        return refuse(error);
    }
    return 0;
}

static int take_connection(mbm_tcp_listener *listener, mbm_tcp *tcps, size_t count)
{
    size_t place = 0;
    int fd, rejects = MAX_REJECTED;

    while (place < count && mbm_tcp_isInUse(&tcps[place]))
        place++;
    if (place == count && is_connection_waiting(listener) && close_oldest(listener, tcps, count))
        return refuse(EAGAIN);
    while ((fd = take_next(listener, tcps, count, &rejects)) >= 0) {
        if (place < count)
            return put_in_place(listener, &tcps[place], fd) < 0 ? -1 : (int)place;
        listener->refused++;
        rejects--;
        reject(fd);
    }
    return -1;
}

int mbm_tcp_accept(mbm_tcp_listener *listener, mbm_tcp *tcps, size_t count)
{
    int place, error;

    if (listener->port == 0)
        return refuse(EBADF);
    if (listener->nothingToAccept)
        return refuse(EAGAIN);
    place = take_connection(listener, tcps, count);
    error = errno;
    keep_spare(listener);
    /* A connection that must wait would end every wait at once. */
    set_events(listener, place >= 0 || error == EAGAIN ? POLLIN : 0);
    if (place < 0 && listener->set) {
        listener->nothingToAccept = 1;
        listener->retryAtMs = mbm_tcp_milliseconds() + MBM_TCP_RETRY / 1000;
    }
    errno = error;
    return place;
}

void mbm_tcp_closeListener(mbm_tcp_listener *listener)
{
    if (listener->port != 0) {
        set_events(listener, 0);
        (void)free_spare(listener);
        close(listener->fd);
    }
    if (listener->set)
        listener->set->listener = NULL;
    listener->set = NULL;
    listener->nothingToAccept = 0;
    listener->fd = -1;
    listener->port = 0;
}
