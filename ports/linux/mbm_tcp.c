/* An mbm_port over a TCP socket. Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "mbm_tcp.h"

#include <string.h>

/* The same sources are the port over the sockets of lwIP. */
#ifdef MBM_TCP_OVER_LWIP
#include "mbm_lwip_sockets.h"
#else
#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>

/* The shortest wait that poll does instead of ppoll: there a millisecond does not matter, and poll
 * costs less. */
enum { MBM_TCP_LONG_WAIT_US = 100000 };

static inline int mbm_tcp_pollFor(struct pollfd *waits, nfds_t count, uint32_t timeoutUs)
{
    if (timeoutUs >= MBM_TCP_LONG_WAIT_US)
        return poll(waits, count, timeoutUs == MBM_TCP_FOREVER ? -1 : (int)(timeoutUs / 1000 + 1));
    return ppoll(waits, count, &(struct timespec){0, (long)timeoutUs * 1000}, NULL);
}

/* The number of bytes that the peer has not acknowledged. */
static inline uint32_t mbm_tcp_unacknowledged(const mbm_tcp *tcp)
{
    int count = 0;

    return ioctl(tcp->fd, TIOCOUTQ, &count) == 0 && count > 0 ? (uint32_t)count : 0;
}

static inline void mbm_tcp_noteWritten(mbm_tcp *tcp, uint16_t count)
{
    tcp->lastWrite = count;
}

static inline void mbm_tcp_noteRead(mbm_tcp *tcp)
{
    (void)tcp;
}

static inline void mbm_tcp_noteFailed(mbm_tcp *tcp)
{
    (void)tcp;
}

static inline void mbm_tcp_sleep(uint32_t micros)
{
    usleep(micros);
}

static inline int64_t mbm_tcp_microseconds(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000 + (uint32_t)now.tv_nsec / 1000u;
}

#endif

/* Values of mbm_tcp.state. A lost socket keeps its place, since an object may still use it. */
enum { FREE, CONNECTING, CONNECTED, LOST };

/* The link is lost if the peer sends nothing for IDLE_S and then answers none of the probes, or
 * if it does not acknowledge a sent byte for UNACKNOWLEDGED_MS. */
enum { IDLE_S = 15, PROBE_INTERVAL_S = 5, PROBE_COUNT = 3, UNACKNOWLEDGED_MS = 30000 };

/* A write that is as recent at the end of its connection is no request that was given up: it is the
 * alert that ends a TLS session, or a request without a reply. */
enum { JUST_WRITTEN_US = 20000 };

/* The sleep after poll has failed. */
enum { POLL_RETRY_US = 10000 };

/* For functions that are rarely called: keeps them apart from those of every request. */
#define COLD __attribute__((cold, noinline))

static int16_t tcp_read(void *context, uint8_t *bytes, uint16_t capacity);

static int refuse(int error)
{
    errno = error;
    return -1;
}

#ifndef MBM_TCP_OVER_LWIP
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

COLD int mbm_tcp_setFlags(int fd)
{
    return ioctl(fd, FIONBIO, &(int){1}) < 0 ? -1 : fcntl(fd, F_SETFD, FD_CLOEXEC);
}
#endif

static int has_socket(const mbm_tcp *tcp)
{
    return tcp->state == CONNECTING || tcp->state == CONNECTED;
}

/* Makes the socket's set report it. */
void mbm_tcp_markReady(mbm_tcp *tcp)
{
    if (!tcp->set || tcp->readiness & MBM_TCP_LISTED)
        return;
    tcp->readiness |= MBM_TCP_LISTED;
    tcp->next = NULL;
    *tcp->set->end = tcp;
    tcp->set->end = &tcp->next;
}

/* Removes the socket from those that its set reports. */
static void remove_from_ready(mbm_tcp *tcp)
{
    mbm_tcp **one;

    if (tcp->readiness & MBM_TCP_LISTED) {
        for (one = &tcp->set->first; *one != tcp; one = &(*one)->next)
            ;
        *one = tcp->next;
        if (!tcp->next)
            tcp->set->end = one;
    }
    tcp->readiness = 0;
}

static void set(int fd, int level, int option, const void *value, socklen_t size)
{
    /* A socket of another family, without the option, works too. */
    (void)setsockopt(fd, level, option, value, size);
}

static void set_number(int fd, int level, int option, int value)
{
    set(fd, level, option, &value, sizeof value);
}

/* Whether a client's connection has bytes of a request that was given up. A response of a server is
 * still sent. */
static int has_given_up(const mbm_tcp *tcp)
{
    const uint32_t count =
        tcp->addresses && tcp->state == CONNECTED ? mbm_tcp_unacknowledged(tcp) : 0;

    return count > tcp->lastWrite ||
           (count > 0 && mbm_tcp_microseconds() - tcp->lastActivityUs >= JUST_WRITTEN_US);
}

/* Makes the close of a socket a reset if it has bytes of a request that was given up. The system
 * would send them for up to UNACKNOWLEDGED_MS after the close, lwIP for minutes, and a write that
 * failed would be carried out then. */
COLD static void drop_given_up(const mbm_tcp *tcp)
{
    struct linger now;

    if (!has_given_up(tcp))
        return;
    now.l_onoff = 1;
    now.l_linger = 0;
    set(tcp->fd, SOL_SOCKET, SO_LINGER, &now, sizeof now);
}

/* Enters a state without a socket. */
static void leave_socket(mbm_tcp *tcp, uint8_t state, int error)
{
    const int fd = has_socket(tcp) ? tcp->fd : -1;

    drop_given_up(tcp);

    mbm_tcp_setEvents(tcp, 0);
    tcp->state = state;
    tcp->error = error;
    tcp->fd = -1;
    if (fd >= 0)
        close(fd);
}

/* Sets what the socket's set waits for from now on. */
COLD static void set_events_in_set(mbm_tcp *tcp, uint8_t before)
{
    if (tcp->set->watch(tcp->set, tcp->fd, tcp, before, tcp->events) == 0)
        return;
    /* The program would never learn what happens to the socket, so its link is lost. */
    tcp->events = 0;
    leave_socket(tcp, LOST, errno);
    mbm_tcp_markReady(tcp);
}

void mbm_tcp_setEvents(mbm_tcp *tcp, uint8_t events)
{
    const uint8_t before = tcp->events;

    tcp->events = events;
    if (before != events && tcp->set)
        set_events_in_set(tcp, before);
}

static void enter(mbm_tcp *tcp, uint8_t state)
{
    tcp->state = state;
    tcp->readiness &= (uint8_t)~MBM_TCP_REPORTED;
    mbm_tcp_setEvents(tcp, state == CONNECTING ? POLLOUT : POLLIN);
}

/* The program used the port, so waits report bytes again. */
static inline void report_again(mbm_tcp *tcp)
{
    tcp->readiness &= (uint8_t)~MBM_TCP_REPORTED;
}

/* Bytes were moved. An object reads the port's clock in each poll, and that time is accurate
 * enough. In a set without such a read the time of the last wait is. */
static inline void note_activity(mbm_tcp *tcp)
{
    if (tcp->clockUs != 0)
        tcp->lastActivityUs = tcp->clockUs;
    else
        tcp->lastActivityUs = (tcp->set ? tcp->set->nowMs : mbm_tcp_milliseconds()) * 1000;
}

static int prepare(int fd)
{
    if (mbm_tcp_setFlags(fd) < 0)
        return -1;
    set_number(fd, IPPROTO_TCP, TCP_NODELAY, 1);
    set_number(fd, SOL_SOCKET, SO_KEEPALIVE, 1);
#ifdef TCP_KEEPIDLE
    set_number(fd, IPPROTO_TCP, TCP_KEEPIDLE, IDLE_S);
    set_number(fd, IPPROTO_TCP, TCP_KEEPINTVL, PROBE_INTERVAL_S);
    set_number(fd, IPPROTO_TCP, TCP_KEEPCNT, PROBE_COUNT);
#endif
#ifdef TCP_USER_TIMEOUT
    set_number(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, UNACKNOWLEDGED_MS);
#endif
    return 0;
}

/* Begins to connect to the next address. If there is none, the link is lost with `error`. */
static int try_next(mbm_tcp *tcp, int error)
{
    mbm_tcp_addresses *all = tcp->addresses;

    leave_socket(tcp, LOST, error);
    while (all && all->next < all->count) {
        const struct sockaddr_storage *address = &all->list[all->next];
        const socklen_t length = all->lengths[all->next++];
        const int fd = socket(address->ss_family, SOCK_STREAM, 0);

        if (fd >= 0 && prepare(fd) == 0) {
            const int failed = connect(fd, (const struct sockaddr *)address, length);

            if (!failed || errno == EINPROGRESS || errno == EINTR) {
                tcp->fd = fd;
                tcp->error = failed ? ETIMEDOUT : 0;
                mbm_tcp_noteRead(tcp);
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

#ifndef MBM_TCP_OVER_LWIP
int mbm_tcp_lookUp(const char *host, const char *service, int flags, struct addrinfo **found,
                   int *error)
{
    struct addrinfo hints = {0};

    hints.ai_socktype = SOCK_STREAM;
    hints.ai_flags = flags;
    *error = getaddrinfo(host, service, &hints, found);
    switch (*error) {
    case 0: return 0;
    case EAI_SYSTEM: *error = 0; return -1;
    case EAI_AGAIN: return refuse(EAGAIN);
    case EAI_MEMORY: return refuse(ENOMEM);
    default: return refuse(ENXIO);
    }
}
#endif

/* Finds the server's addresses. If that fails, those that were found before stay. */
static int look_up(mbm_tcp *tcp)
{
    mbm_tcp_addresses *all = tcp->addresses;
    struct addrinfo *found, *one;
    int error;

    if (mbm_tcp_lookUp(all->isLocal ? NULL : all->host, all->service, 0, &found, &error) < 0) {
        tcp->lookupError = all->count == 0 ? (int16_t)error : 0;
        return all->count == 0 ? -1 : 0;
    }
    tcp->lookupError = 0;
    all->count = 0;
    for (one = found; one && all->count < MBM_TCP_ADDRESSES; one = one->ai_next) {
        if (one->ai_addrlen > sizeof all->list[0])
            continue;
        memcpy(&all->list[all->count], one->ai_addr, one->ai_addrlen);
        all->lengths[all->count++] = one->ai_addrlen;
    }
    freeaddrinfo(found);
    return 0;
}

int mbm_tcp_openLater(mbm_tcp *tcp, mbm_tcp_addresses *addresses, const char *host,
                      const char *service)
{
    if (tcp->state != FREE)
        return refuse(EBUSY);
    if ((host && strlen(host) >= sizeof addresses->host) ||
        strlen(service) >= sizeof addresses->service)
        return refuse(ENAMETOOLONG);
    memset(tcp, 0, sizeof *tcp);
    tcp->addresses = addresses;
    addresses->next = addresses->count = addresses->first = 0;
    addresses->isLocal = host == NULL;
    strcpy(addresses->host, host ? host : "");
    strcpy(addresses->service, service);
    leave_socket(tcp, LOST, ENOTCONN);
    return 0;
}

int mbm_tcp_open(mbm_tcp *tcp, mbm_tcp_addresses *addresses, const char *host, const char *service)
{
    if (mbm_tcp_openLater(tcp, addresses, host, service) < 0)
        return -1;
    if (mbm_tcp_connect(tcp) == MBM_LINK_LOST) {
        leave_socket(tcp, FREE, tcp->error);
        tcp->addresses = NULL;
        return refuse(tcp->error);
    }
    return 0;
}

const char *mbm_tcp_text(const mbm_tcp *tcp)
{
    return tcp->lookupError ? gai_strerror(tcp->lookupError) : strerror(tcp->error);
}

int mbm_tcp_attach(mbm_tcp *tcp, int fd)
{
    if (tcp->state != FREE)
        return refuse(EBUSY);
    if (prepare(fd) < 0)
        return -1;
    memset(tcp, 0, sizeof *tcp);
    tcp->fd = fd;
    tcp->lastActivityUs = mbm_tcp_milliseconds() * 1000;
    enter(tcp, CONNECTED);
    return 0;
}

int mbm_tcp_isInUse(const mbm_tcp *tcp)
{
    return tcp->state != FREE;
}

int64_t mbm_tcp_idleFor(const mbm_tcp *tcp)
{
    int64_t idle;

    if (tcp->state != CONNECTED)
        return -1;
    /* The clock of the port is finer, and so a little ahead. */
    idle = mbm_tcp_milliseconds() - tcp->lastActivityUs / 1000;
    return idle > 0 ? idle : 0;
}

void mbm_tcp_remove(mbm_tcp *tcp)
{
    const uint8_t events = tcp->events;

    mbm_tcp_setEvents(tcp, 0);
    remove_from_ready(tcp);
    tcp->set = NULL;
    /* Those that the set has dropped, because the port was not used, count again. */
    if (has_socket(tcp))
        tcp->events = (uint8_t)(events | (tcp->state == CONNECTING ? POLLOUT : POLLIN));
}

void mbm_tcp_close(mbm_tcp *tcp)
{
    leave_socket(tcp, FREE, tcp->error);
    remove_from_ready(tcp);
    /* A waiting connection may need the descriptor that this frees. */
    if (tcp->set && tcp->set->listener)
        tcp->set->listener->retryAtMs = 0;
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
        tcp->error = 0;
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
    mbm_tcp_addresses *all = tcp->addresses;

    if (all) {
        if (look_up(tcp) < 0) {
            leave_socket(tcp, LOST, errno);
            return MBM_LINK_LOST;
        }
        all->next = all->first < all->count ? all->first : 0;
        all->first = 0;
    }
    if (try_next(tcp, all ? EADDRNOTAVAIL : ENOTCONN) < 0)
        return MBM_LINK_LOST;
    return tcp->state == CONNECTED ? MBM_OK : MBM_PENDING;
}

void mbm_tcp_disconnect(void *context)
{
    mbm_tcp *tcp = (mbm_tcp *)context;

    if (!has_socket(tcp))
        return;
    /* An address that does not answer must not keep the next attempt from those after it. */
    if (tcp->state == CONNECTING && tcp->addresses)
        tcp->addresses->first = tcp->addresses->next;
    leave_socket(tcp, LOST, tcp->state == CONNECTING ? ETIMEDOUT : ENOTCONN);
}

/* No bytes were moved. Returns 0 for a signal or if there are none yet, -1 for a lost link. */
COLD static int16_t none_moved(mbm_tcp *tcp, ssize_t count)
{
    const int error = count < 0 ? errno : EPIPE;

    if (tcp->state == LOST)
        return -1;
    if (error == EAGAIN || error == EWOULDBLOCK || error == EINTR)
        return 0;
    if (count < 0)
        mbm_tcp_noteFailed(tcp);
    leave_socket(tcp, LOST, error);
    return -1;
}

int mbm_tcp_isConnected(mbm_tcp *tcp)
{
    int link = progress(tcp);
    char byte;

    if (link == 1) {
        const ssize_t count = recv(tcp->fd, &byte, 1, MSG_PEEK | MSG_DONTWAIT);

        if (count <= 0)
            return none_moved(tcp, count) < 0 ? -1 : 1;
    }
    return link;
}

uint8_t mbm_tcp_status(void *tcp)
{
    const int there = mbm_tcp_isConnected((mbm_tcp *)tcp);

    if (there >= 0)
        return there > 0 ? MBM_OK : MBM_PENDING;
    return ((const mbm_tcp *)tcp)->error == ETIMEDOUT ? MBM_CONNECT_TIMED_OUT : MBM_LINK_LOST;
}

/* 1 if a read or write can go ahead: only a connected socket polls for POLLIN alone. */
static inline int is_ready(const mbm_tcp *tcp, uint16_t length)
{
    return tcp->events == POLLIN && (int16_t)length > 0;
}

COLD static int16_t read_slowly(mbm_tcp *tcp, uint8_t *bytes, uint16_t capacity)
{
    int link = progress(tcp);

    if (link <= 0 || capacity == 0)
        return (int16_t)(link < 0 ? -1 : 0);
    /* A program that reads need not wait until its bytes can be sent. */
    mbm_tcp_setEvents(tcp, POLLIN);
    return tcp_read(tcp, bytes, capacity > INT16_MAX ? INT16_MAX : capacity);
}

static int16_t tcp_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    mbm_tcp *tcp = (mbm_tcp *)context;
    ssize_t count;

    if (!is_ready(tcp, capacity))
        return read_slowly(tcp, bytes, capacity);
    count = read(tcp->fd, bytes, capacity);
    report_again(tcp);
    if (count <= 0)
        return none_moved(tcp, count);
    note_activity(tcp);
    mbm_tcp_noteRead(tcp);
    return (int16_t)count;
}

/* Evaluates a send: `count` of `length` bytes were accepted. */
COLD static int16_t finish_write(mbm_tcp *tcp, ssize_t length, ssize_t count)
{
    if (count <= 0 && none_moved(tcp, count) < 0)
        return -1;
    if (count == length)
        report_again(tcp);
    mbm_tcp_setEvents(tcp, count == length ? POLLIN : tcp->events | POLLOUT);
    if (count <= 0)
        return 0;
    note_activity(tcp);
    mbm_tcp_noteWritten(tcp, (uint16_t)count);
    return (int16_t)count;
}

COLD static int16_t write_slowly(mbm_tcp *tcp, const uint8_t *bytes, uint16_t length)
{
    /* A length above INT16_MAX is never accepted completely, since the result is an int16_t. */
    const uint16_t most = length > INT16_MAX ? INT16_MAX : length;
    int link = progress(tcp);

    if (link <= 0 || length == 0)
        return (int16_t)(link < 0 ? -1 : 0);
    return finish_write(tcp, length, send(tcp->fd, bytes, most, MSG_NOSIGNAL));
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
        return finish_write(tcp, all, count);
    report_again(tcp);
    note_activity(tcp);
    mbm_tcp_noteWritten(tcp, length);
    /* If the next read or write comes without a look at the clock, this time is too old for it. */
    tcp->clockUs = 0;
    return (int16_t)count;
}

static uint32_t tcp_micros(void *context)
{
    mbm_tcp *tcp = (mbm_tcp *)context;

    tcp->clockUs = mbm_tcp_microseconds();
    return (uint32_t)tcp->clockUs;
}

static void tcp_idle(void *context, mbm_node *node)
{
    mbm_tcp_wait((mbm_tcp *)context, 1, NULL, -1, mbm_node_pollDelay(node));
}

mbm_port mbm_tcp_port(mbm_tcp *tcp)
{
    mbm_port port = {.context = tcp, .read = tcp_read, .write = tcp_write, .micros = tcp_micros};
    port.idle = tcp_idle;
    return port;
}

/* poll failed: for a signal, or for lack of memory or descriptors (their limit may have been
 * lowered). Then sleeps, so that the program does not spin, and returns 1: it must look. */
COLD static int after_failed_poll(uint32_t timeoutUs)
{
    if (errno == EINTR)
        return 0;
    mbm_tcp_sleep(timeoutUs < POLL_RETRY_US ? timeoutUs : POLL_RETRY_US);
    return 1;
}

/* What to poll a socket for. Bytes that were reported do not end the wait again. A socket
 * without events is left out, since a hang-up would end the wait. */
static inline short events_of(const mbm_tcp *tcp)
{
    return tcp->readiness & MBM_TCP_REPORTED ? tcp->events & POLLOUT : tcp->events;
}

/* Notes what poll has found for a socket. */
static inline void note_events(mbm_tcp *tcp, short events)
{
    if (tcp->events == POLLOUT && events)
        /* If the socket is connecting, this finds out whether it is connected. */
        (void)progress(tcp);
    else if (events & ~POLLOUT)
        tcp->readiness |= MBM_TCP_REPORTED;
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
    if (is_listening && listener->events == 0 && timeoutUs > MBM_TCP_RETRY)
        timeoutUs = MBM_TCP_RETRY;
    for (i = 0; i < count; i++)
        if (events_of(&tcps[i]) != 0)
            waits[used++] = (struct pollfd){tcps[i].fd, events_of(&tcps[i]), 0};
    if (is_listening && listener->events != 0)
        waits[used++] = (struct pollfd){listener->fd, POLLIN, 0};
    if (fd >= 0)
        waits[used++] = (struct pollfd){fd, POLLIN, 0};
    ready = mbm_tcp_pollFor(waits, used, timeoutUs);
    if (ready < 0)
        return after_failed_poll(timeoutUs);
    used = 0;
    for (i = 0; i < count; i++)
        if (events_of(&tcps[i]) != 0)
            note_events(&tcps[i], waits[used++].revents);
    return ready > 0;
}

int mbm_tcp_wait(mbm_tcp *tcps, size_t count, const mbm_tcp_listener *listener, int fd,
                 uint32_t timeoutUs)
{
    struct pollfd wait;
    int ready;

    /* The usual case: a client waits for a response. */
    if (count != 1 || listener || fd >= 0 || tcps->readiness || tcps->events != POLLIN)
        return wait_for_many(tcps, count, listener, fd, timeoutUs);
    wait = (struct pollfd){tcps->fd, POLLIN, 0};
    ready = mbm_tcp_pollFor(&wait, 1, timeoutUs);
    if (ready < 0)
        return after_failed_poll(timeoutUs);
    if (ready > 0)
        tcps->readiness = MBM_TCP_REPORTED;
    return ready;
}
