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

/* Of mbm_tcp.state. A lost one keeps its place: an object may still use it. */
enum { FREE, CONNECTING, CONNECTED, LOST };

/* Seconds of silence, between the probes that follow, and how many: what finds a
 * peer that is gone while nothing is sent. While something is, milliseconds. */
enum { QUIET_S = 15, PROBE_S = 5, PROBES = 3, UNANSWERED_MS = 30000 };

/* Microseconds: of sleep where the system refuses to poll, and of a wait that is long. */
enum { BLIND_NAP = 10000, LONG_WAIT = 100000 };

/* Kept out of the way of what is done for every request. */
#define SELDOM __attribute__((cold, noinline))

static int16_t tcp_read(void *context, uint8_t *bytes, uint16_t capacity);

static int refuse(int error)
{
    errno = error;
    return -1;
}

/* The cheapest clock that there is: it is read with every request. */
SELDOM int64_t mbm_tcp_milliseconds(void)
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

/* Has the socket's set tell of it. */
void mbm_tcp_markReady(mbm_tcp *tcp)
{
    if (!tcp->set || tcp->told & MBM_TCP_LISTED)
        return;
    tcp->told |= MBM_TCP_LISTED;
    tcp->next = NULL;
    *tcp->set->end = tcp;
    tcp->set->end = &tcp->next;
}

/* The set tells of the socket no more. */
static void untell(mbm_tcp *tcp)
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

/* What a socket is polled for from now on, also by its set. */
SELDOM static void await_in_set(mbm_tcp *tcp, uint8_t before)
{
    if (tcp->set->watch(tcp->set, tcp->fd, tcp, before, tcp->awaits) == 0)
        return;
    /* Nobody would learn what happens to it. */
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

/* The program used the port, so that waits tell of bytes again. */
static inline void used(mbm_tcp *tcp)
{
    tcp->told &= (uint8_t)~MBM_TCP_TOLD;
}

/* Bytes were moved. In a set the time of its last wait is near enough. */
static inline void moved(mbm_tcp *tcp)
{
    tcp->lastMoved = tcp->set ? tcp->set->now : mbm_tcp_milliseconds();
}

static void set(int fd, int level, int option, int value)
{
    /* A socket without it, of another family, works all the same. */
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

/* Begins with the next address; lost with `error` if there is none. */
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
    untell(tcp);
    /* Its descriptor may be what a connection waits for. */
    if (tcp->set && tcp->set->listener)
        tcp->set->listener->retryAt = 0;
    tcp->set = NULL;
}

/* 1 once connected, 0 before, -1 if there is no link. */
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

/* Nothing was moved, for a signal or for now; or else the link is gone. */
SELDOM static int16_t nothing(mbm_tcp *tcp, ssize_t count)
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
            return nothing(tcp, count) < 0 ? -1 : 1;
    }
    return there;
}

/* 1 if so many bytes may be moved at once: only what is connected awaits bytes alone. */
static inline int is_ready(const mbm_tcp *tcp, uint16_t length)
{
    return tcp->awaits == POLLIN && (int16_t)length > 0;
}

SELDOM static int16_t read_slowly(mbm_tcp *tcp, uint8_t *bytes, uint16_t capacity)
{
    int there = progress(tcp);

    if (there <= 0 || capacity == 0)
        return (int16_t)(there < 0 ? -1 : 0);
    /* Who reads is not stuck with what is to be sent. */
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
        return nothing(tcp, count);
    moved(tcp);
    return (int16_t)count;
}

/* So many of the bytes were taken, perhaps not all. */
SELDOM static int16_t wrote(mbm_tcp *tcp, ssize_t length, ssize_t count)
{
    if (count <= 0 && nothing(tcp, count) < 0)
        return -1;
    if (count == length)
        used(tcp);
    mbm_tcp_await(tcp, count == length ? POLLIN : tcp->awaits | POLLOUT);
    if (count <= 0)
        return 0;
    moved(tcp);
    return (int16_t)count;
}

SELDOM static int16_t write_slowly(mbm_tcp *tcp, const uint8_t *bytes, uint16_t length)
{
    /* Of more than can be said to be taken it is never all. */
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

/* Poll failed: for a signal, or for lack of memory or of descriptors, whose limit may have
 * been lowered. Then whoever waits looks for itself, and does not spin. */
SELDOM static int nap(uint32_t timeoutUs)
{
    if (errno == EINTR)
        return 0;
    usleep(timeoutUs < BLIND_NAP ? timeoutUs : BLIND_NAP);
    return 1;
}

/* What to poll a socket for: bytes that it told of do not end the wait again. Of who
 * awaits nothing a hang-up would end it too. */
static inline short events_of(const mbm_tcp *tcp)
{
    return tcp->told & MBM_TCP_TOLD ? tcp->awaits & POLLOUT : tcp->awaits;
}

/* Takes note of what poll tells of a socket. */
static inline void note(mbm_tcp *tcp, short events)
{
    if (tcp->awaits == POLLOUT && events)
        /* If it is being connected, that is known from now on. */
        (void)progress(tcp);
    else if (events & ~POLLOUT)
        tcp->told |= MBM_TCP_TOLD;
}

/* Of a long time a millisecond does not matter, and poll asks for less than ppoll. */
static inline int sleep_on(struct pollfd *waits, nfds_t count, uint32_t timeoutUs)
{
    if (timeoutUs >= LONG_WAIT)
        return poll(waits, count, timeoutUs == MBM_TCP_FOREVER ? -1 : (int)(timeoutUs / 1000 + 1));
    return ppoll(waits, count, &(struct timespec){0, (long)timeoutUs * 1000}, NULL);
}

SELDOM static int wait_for_many(mbm_tcp *tcps, size_t count, const mbm_tcp_listener *listener,
                                int fd, uint32_t timeoutUs)
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

    /* What a client waits for with every request. */
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
