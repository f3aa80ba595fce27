/* An mbm_port over a TCP socket. Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "mbm_tcp.h"

#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <string.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>

/* Values of mbm_tcp.state. A lost socket keeps its place, since an object may still use it. */
enum { FREE, CONNECTING, CONNECTED, LOST };

/* A peer is gone if, after seconds of silence, it answers none of some probes, which are
 * seconds apart, or if it acknowledges no sent byte for milliseconds. */
enum { QUIET_S = 15, PROBE_S = 5, PROBES = 3, UNANSWERED_MS = 30000 };

/* Microseconds: of sleep if the system refuses to poll, and of the shortest long wait. */
enum { BLIND_NAP = 10000, LONG_WAIT = 100000 };

/* For functions that are rarely called: keeps them apart from those of every request. */
#define COLD __attribute__((cold, noinline))

static int16_t tcp_read(void *context, uint8_t *bytes, uint16_t capacity);

static int refuse(int error)
{
    errno = error;
    return -1;
}

/* Uses the cheapest clock, since it is read with every request. */
COLD int64_t mbm_tcp_milliseconds(void)
{
    struct timespec now;

#ifdef CLOCK_MONOTONIC_COARSE
    clock_gettime(CLOCK_MONOTONIC_COARSE, &now);
#else
    clock_gettime(CLOCK_MONOTONIC, &now);
#endif
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

static int has_socket(const mbm_tcp *tcp)
{
    return tcp->state == CONNECTING || tcp->state == CONNECTED;
}

/* Makes the socket's set report it. */
void mbm_tcp_markReady(mbm_tcp *tcp)
{
    if (!tcp->set || tcp->told & MBM_TCP_LISTED)
        return;
    tcp->told |= MBM_TCP_LISTED;
    tcp->next = NULL;
    *tcp->set->end = tcp;
    tcp->set->end = &tcp->next;
}

/* Removes the socket from those that its set reports. */
static void remove_from_ready(mbm_tcp *tcp)
{
    mbm_tcp **one;

    if (tcp->told & MBM_TCP_LISTED) {
        for (one = &tcp->set->first; *one != tcp; one = &(*one)->next)
            ;
        *one = tcp->next;
        if (!tcp->next)
            tcp->set->end = one;
    }
    tcp->told = 0;
}

/* Enters a state without a socket. */
static void drop(mbm_tcp *tcp, uint8_t state, int error)
{
    const int fd = has_socket(tcp) ? tcp->fd : -1;

    mbm_tcp_await(tcp, 0);
    tcp->state = state;
    tcp->error = error;
    tcp->fd = -1;
    if (fd >= 0)
        close(fd);
}

/* Sets what the socket's set waits for from now on. */
COLD static void await_in_set(mbm_tcp *tcp, uint8_t before)
{
    if (tcp->set->watch(tcp->set, tcp->fd, tcp, before, tcp->awaits) == 0)
        return;
    /* The program would never learn what happens to the socket, so its link is lost. */
    tcp->awaits = 0;
    drop(tcp, LOST, errno);
    mbm_tcp_markReady(tcp);
}

void mbm_tcp_await(mbm_tcp *tcp, uint8_t awaits)
{
    const uint8_t before = tcp->awaits;

    tcp->awaits = awaits;
    if (before != awaits && tcp->set)
        await_in_set(tcp, before);
}

static void enter(mbm_tcp *tcp, uint8_t state)
{
    tcp->state = state;
    tcp->told &= (uint8_t)~MBM_TCP_TOLD;
    mbm_tcp_await(tcp, state == CONNECTING ? POLLOUT : POLLIN);
}

/* The program used the port, so waits report bytes again. */
static inline void used(mbm_tcp *tcp)
{
    tcp->told &= (uint8_t)~MBM_TCP_TOLD;
}

/* Bytes were moved. In a set the time of the last wait is accurate enough. */
static inline void moved(mbm_tcp *tcp)
{
    tcp->lastMoved = tcp->set ? tcp->set->now : mbm_tcp_milliseconds();
}

static void set(int fd, int level, int option, int value)
{
    /* A socket of another family, without the option, works too. */
    (void)setsockopt(fd, level, option, &value, sizeof value);
}

static int prepare(int fd)
{
    if (ioctl(fd, FIONBIO, &(int){1}) < 0 || fcntl(fd, F_SETFD, FD_CLOEXEC) < 0)
        return -1;
    set(fd, IPPROTO_TCP, TCP_NODELAY, 1);
    set(fd, SOL_SOCKET, SO_KEEPALIVE, 1);
#ifdef TCP_KEEPIDLE
    set(fd, IPPROTO_TCP, TCP_KEEPIDLE, QUIET_S);
    set(fd, IPPROTO_TCP, TCP_KEEPINTVL, PROBE_S);
    set(fd, IPPROTO_TCP, TCP_KEEPCNT, PROBES);
#endif
#ifdef TCP_USER_TIMEOUT
    set(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, UNANSWERED_MS);
#endif
    return 0;
}

/* Begins to connect to the next address. If there is none, the link is lost with `error`. */
static int try_next(mbm_tcp *tcp, int error)
{
    mbm_tcp_addresses *all = tcp->addresses;

    drop(tcp, LOST, error);
    while (all && all->next < all->count) {
        const struct sockaddr_storage *address = &all->list[all->next];
        const socklen_t length = all->lengths[all->next++];
        const int fd = socket(address->ss_family, SOCK_STREAM, 0);

        if (fd >= 0 && prepare(fd) == 0) {
            const int failed = connect(fd, (const struct sockaddr *)address, length);

            if (!failed || errno == EINPROGRESS || errno == EINTR) {
                tcp->fd = fd;
                tcp->error = 0;
                enter(tcp, failed ? CONNECTING : CONNECTED);
                return has_socket(tcp) ? 0 : -1;
            }
        }
        tcp->error = errno;
        if (fd >= 0)
            close(fd);
    }
    return -1;
}

int mbm_tcp_lookUp(const char *host, const char *service, int flags, struct addrinfo **found,
                   int *why)
{
    struct addrinfo hints = {0};

    hints.ai_socktype = SOCK_STREAM;
    hints.ai_flags = flags;
    *why = getaddrinfo(host, service, &hints, found);
    switch (*why) {
    case 0: return 0;
    case EAI_SYSTEM: *why = 0; return -1;
    case EAI_AGAIN: return refuse(EAGAIN);
    case EAI_MEMORY: return refuse(ENOMEM);
    default: return refuse(EADDRNOTAVAIL);
    }
}

int mbm_tcp_open(mbm_tcp *tcp, mbm_tcp_addresses *addresses, const char *host, const char *service)
{
    struct addrinfo *found, *one;

    if (tcp->state != FREE)
        return refuse(EBUSY);
    if (mbm_tcp_lookUp(host, service, 0, &found, &tcp->lookup) < 0)
        return -1;
    memset(tcp, 0, sizeof *tcp);
    tcp->addresses = addresses;
    addresses->next = addresses->count = 0;
    for (one = found; one && addresses->count < MBM_TCP_ADDRESSES; one = one->ai_next) {
        if (one->ai_addrlen > sizeof addresses->list[0])
            continue;
        memcpy(&addresses->list[addresses->count], one->ai_addr, one->ai_addrlen);
        addresses->lengths[addresses->count++] = one->ai_addrlen;
    }
    freeaddrinfo(found);
    if (try_next(tcp, EADDRNOTAVAIL) < 0) {
        drop(tcp, FREE, tcp->error);
        return refuse(tcp->error);
    }
    return 0;
}

int mbm_tcp_attach(mbm_tcp *tcp, int fd)
{
    if (tcp->state != FREE)
        return refuse(EBUSY);
    if (prepare(fd) < 0)
        return -1;
    memset(tcp, 0, sizeof *tcp);
    tcp->fd = fd;
    tcp->lastMoved = mbm_tcp_milliseconds();
    enter(tcp, CONNECTED);
    return 0;
}

int mbm_tcp_isInUse(const mbm_tcp *tcp)
{
    return tcp->state != FREE;
}

int64_t mbm_tcp_idleFor(const mbm_tcp *tcp)
{
    return tcp->state == CONNECTED ? mbm_tcp_milliseconds() - tcp->lastMoved : -1;
}

void mbm_tcp_close(mbm_tcp *tcp)
{
    drop(tcp, FREE, tcp->error);
    remove_from_ready(tcp);
    /* A waiting connection may need the descriptor that this frees. */
    if (tcp->set && tcp->set->listener)
        tcp->set->listener->retryAt = 0;
    tcp->set = NULL;
}

/* Returns 1 once connected, 0 before, -1 if there is no link. */
static int progress(mbm_tcp *tcp)
{
    struct pollfd wait = {tcp->fd, POLLOUT, 0};
    socklen_t size = sizeof(int);
    int error = 0;

    while (tcp->state == CONNECTING) {
        wait.fd = tcp->fd;
        if (poll(&wait, 1, 0) <= 0)
            return 0;
        if (getsockopt(tcp->fd, SOL_SOCKET, SO_ERROR, &error, &size) < 0)
            error = errno;
        if (error == 0)
            enter(tcp, CONNECTED);
        else
            try_next(tcp, error);
    }
    return tcp->state == CONNECTED ? 1 : -1;
}

uint8_t mbm_tcp_connect(void *context)
{
    mbm_tcp *tcp = (mbm_tcp *)context;

    if (tcp->addresses)
        tcp->addresses->next = 0;
    if (try_next(tcp, ENOTCONN) < 0)
        return MBM_LINK_LOST;
    return tcp->state == CONNECTED ? MBM_OK : MBM_PENDING;
}

void mbm_tcp_disconnect(void *context)
{
    mbm_tcp *tcp = (mbm_tcp *)context;

    if (tcp->state != FREE)
        drop(tcp, LOST, ENOTCONN);
}

/* No bytes were moved. Returns 0 for a signal or if there are none yet, -1 for a lost link. */
COLD static int16_t none_moved(mbm_tcp *tcp, ssize_t count)
{
    if (tcp->state == LOST)
        return -1;
    if (count < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR))
        return 0;
    drop(tcp, LOST, count < 0 ? errno : EPIPE);
    return -1;
}

int mbm_tcp_isConnected(mbm_tcp *tcp)
{
    int there = progress(tcp);
    char byte;

    if (there == 1) {
        const ssize_t count = recv(tcp->fd, &byte, 1, MSG_PEEK | MSG_DONTWAIT);

        if (count <= 0)
            return none_moved(tcp, count) < 0 ? -1 : 1;
    }
    return there;
}

/* 1 if a read or write can go ahead: only a connected socket awaits POLLIN alone. */
static inline int is_ready(const mbm_tcp *tcp, uint16_t length)
{
    return tcp->awaits == POLLIN && (int16_t)length > 0;
}

COLD static int16_t read_slowly(mbm_tcp *tcp, uint8_t *bytes, uint16_t capacity)
{
    int there = progress(tcp);

    if (there <= 0 || capacity == 0)
        return (int16_t)(there < 0 ? -1 : 0);
    /* A program that reads need not wait until its bytes can be sent. */
    mbm_tcp_await(tcp, POLLIN);
    return tcp_read(tcp, bytes, capacity > INT16_MAX ? INT16_MAX : capacity);
}

static int16_t tcp_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    mbm_tcp *tcp = (mbm_tcp *)context;
    ssize_t count;

    if (!is_ready(tcp, capacity))
        return read_slowly(tcp, bytes, capacity);
    count = read(tcp->fd, bytes, capacity);
    used(tcp);
    if (count <= 0)
        return none_moved(tcp, count);
    moved(tcp);
    return (int16_t)count;
}

/* Evaluates a send: `count` of `length` bytes were accepted. */
COLD static int16_t wrote(mbm_tcp *tcp, ssize_t length, ssize_t count)
{
    if (count <= 0 && none_moved(tcp, count) < 0)
        return -1;
    if (count == length)
        used(tcp);
    mbm_tcp_await(tcp, count == length ? POLLIN : tcp->awaits | POLLOUT);
    if (count <= 0)
        return 0;
    moved(tcp);
    return (int16_t)count;
}

COLD static int16_t write_slowly(mbm_tcp *tcp, const uint8_t *bytes, uint16_t length)
{
    /* A length above INT16_MAX is never accepted completely, since the result is an int16_t. */
    const uint16_t most = length > INT16_MAX ? INT16_MAX : length;
    int there = progress(tcp);

    if (there <= 0 || length == 0)
        return (int16_t)(there < 0 ? -1 : 0);
    return wrote(tcp, length, send(tcp->fd, bytes, most, MSG_NOSIGNAL));
}

static int16_t tcp_write(void *context, const uint8_t *bytes, uint16_t length)
{
    mbm_tcp *tcp = (mbm_tcp *)context;
    const ssize_t all = length;
    ssize_t count;

    if (!is_ready(tcp, length))
        return write_slowly(tcp, bytes, length);
    count = send(tcp->fd, bytes, (size_t)all, MSG_NOSIGNAL);
    if (count != all)
        return wrote(tcp, all, count);
    used(tcp);
    moved(tcp);
    return (int16_t)count;
}

static uint32_t tcp_micros(void *context)
{
    struct timespec now;

    (void)context;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)now.tv_sec * 1000000u + (uint32_t)now.tv_nsec / 1000u;
}

static void tcp_idle(void *context, mbm_master *master)
{
    mbm_tcp_wait((mbm_tcp *)context, 1, NULL, -1, mbm_master_pollDelay(master));
}

mbm_port mbm_tcp_port(mbm_tcp *tcp)
{
    mbm_port port = {.context = tcp, .read = tcp_read, .write = tcp_write, .micros = tcp_micros};
    port.idle = tcp_idle;
    return port;
}

/* poll failed: for a signal, or for lack of memory or descriptors (their limit may have been
 * lowered). Then sleeps, so that the program does not spin, and returns 1: it must look. */
COLD static int nap(uint32_t timeoutUs)
{
    if (errno == EINTR)
        return 0;
    usleep(timeoutUs < BLIND_NAP ? timeoutUs : BLIND_NAP);
    return 1;
}

/* What to poll a socket for. Bytes that were reported do not end the wait again. A socket
 * that awaits nothing is left out, since a hang-up would end the wait. */
static inline short events_of(const mbm_tcp *tcp)
{
    return tcp->told & MBM_TCP_TOLD ? tcp->awaits & POLLOUT : tcp->awaits;
}

/* Notes what poll has found for a socket. */
static inline void note(mbm_tcp *tcp, short events)
{
    if (tcp->awaits == POLLOUT && events)
        /* If the socket is connecting, this finds out whether it is connected. */
        (void)progress(tcp);
    else if (events & ~POLLOUT)
        tcp->told |= MBM_TCP_TOLD;
}

/* In a long wait a millisecond does not matter, and poll costs less than ppoll. */
static inline int sleep_on(struct pollfd *waits, nfds_t count, uint32_t timeoutUs)
{
    if (timeoutUs >= LONG_WAIT)
        return poll(waits, count, timeoutUs == MBM_TCP_FOREVER ? -1 : (int)(timeoutUs / 1000 + 1));
    return ppoll(waits, count, &(struct timespec){0, (long)timeoutUs * 1000}, NULL);
}

COLD static int wait_for_many(mbm_tcp *tcps, size_t count, const mbm_tcp_listener *listener, int fd,
                              uint32_t timeoutUs)
{
    const int is_listening = listener && listener->port != 0;
    struct pollfd waits[MBM_TCP_WAITS];
    nfds_t used = 0;
    size_t i;
    int ready;

    if (count > MBM_TCP_WAITS - 2)
        return refuse(EINVAL);
    if (is_listening && listener->awaits == 0 && timeoutUs > MBM_TCP_RETRY)
        timeoutUs = MBM_TCP_RETRY;
    for (i = 0; i < count; i++)
        if (events_of(&tcps[i]) != 0)
            waits[used++] = (struct pollfd){tcps[i].fd, events_of(&tcps[i]), 0};
    if (is_listening && listener->awaits != 0)
        waits[used++] = (struct pollfd){listener->fd, POLLIN, 0};
    if (fd >= 0)
        waits[used++] = (struct pollfd){fd, POLLIN, 0};
    ready = sleep_on(waits, used, timeoutUs);
    if (ready < 0)
        return nap(timeoutUs);
    used = 0;
    for (i = 0; i < count; i++)
        if (events_of(&tcps[i]) != 0)
            note(&tcps[i], waits[used++].revents);
    return ready > 0;
}

int mbm_tcp_wait(mbm_tcp *tcps, size_t count, const mbm_tcp_listener *listener, int fd,
                 uint32_t timeoutUs)
{
    struct pollfd wait;
    int ready;

    /* The usual case: a client waits for a response. */
    if (count != 1 || listener || fd >= 0 || tcps->told || tcps->awaits != POLLIN)
        return wait_for_many(tcps, count, listener, fd, timeoutUs);
    wait = (struct pollfd){tcps->fd, POLLIN, 0};
    ready = sleep_on(&wait, 1, timeoutUs);
    if (ready < 0)
        return nap(timeoutUs);
    if (ready > 0)
        tcps->told = MBM_TCP_TOLD;
    return ready;
}
