/* An mbm_port over UDP. Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "mbm_udp.h"

#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

/* The header up to the length, and the shortest and longest frame: unit and function, and a
 * PDU of 253 bytes. */
enum { LENGTH_END = 6, SHORTEST = LENGTH_END + 2, LONGEST = MBM_MAX_TCP_FRAME };

static int refuse(int error)
{
    errno = error;
    return -1;
}

/* --- opening and closing --- */

static uint16_t port_of(int fd)
{
    struct sockaddr_storage address;
    socklen_t size = sizeof address;

    memset(&address, 0, sizeof address);
    if (getsockname(fd, (struct sockaddr *)&address, &size) < 0)
        return 0;
    if (address.ss_family == AF_INET6)
        return ntohs(((struct sockaddr_in6 *)&address)->sin6_port);
    return ntohs(((struct sockaddr_in *)&address)->sin_port);
}

/* A socket at an address: bound to it for a server, connected to it for a client, so that the
 * system drops the datagrams of others. */
static int socket_at(const struct addrinfo *address, int is_server)
{
    const int fd = socket(address->ai_family, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    int error;

    if (fd < 0)
        return -1;
    if ((is_server ? bind(fd, address->ai_addr, address->ai_addrlen)
                   : connect(fd, address->ai_addr, address->ai_addrlen)) == 0)
        return fd;
    error = errno;
    close(fd);
    return refuse(error);
}

static int look_up(mbm_udp *udp, const char *host, const char *service, int flags,
                   struct addrinfo **found)
{
    struct addrinfo hints = {0};

    hints.ai_socktype = SOCK_DGRAM;
    hints.ai_flags = flags;
    udp->lookupError = getaddrinfo(host, service, &hints, found);
    switch (udp->lookupError) {
    case 0: return 0;
    case EAI_SYSTEM: udp->lookupError = 0; return -1;
    case EAI_AGAIN: return refuse(EAGAIN);
    case EAI_MEMORY: return refuse(ENOMEM);
    default: return refuse(ENXIO);
    }
}

static int open_at(mbm_udp *udp, const char *host, const char *service, int is_server)
{
    struct addrinfo *found, *one;
    int fd = -1, error;

    if (udp->port != 0)
        return refuse(EBUSY);
    if (look_up(udp, host, service, is_server ? AI_PASSIVE : 0, &found) < 0)
        return -1;
    errno = EADDRNOTAVAIL;
    for (one = found; one && fd < 0; one = one->ai_next)
        fd = socket_at(one, is_server);
    error = errno;
    freeaddrinfo(found);
    if (fd < 0)
        return refuse(error);
    memset(udp, 0, sizeof *udp);
    udp->fd = fd;
    udp->port = port_of(fd);
    udp->isServer = (uint8_t)is_server;
    return 0;
}

int mbm_udp_open(mbm_udp *udp, const char *host, const char *service)
{
    return open_at(udp, host, service, 0);
}

int mbm_udp_listen(mbm_udp *udp, const char *host, const char *service)
{
    return open_at(udp, host, service, 1);
}

void mbm_udp_close(mbm_udp *udp)
{
    if (udp->port != 0 && udp->watch)
        (void)udp->watch(udp->owner, udp->fd, 0);
    if (udp->port != 0)
        close(udp->fd);
    udp->watch = NULL;
    udp->fd = -1;
    udp->port = 0;
    udp->from = udp->to = udp->collected = 0;
}

/* --- the port --- */

/* The length of the frame that begins with a header, or 0 if none can. */
static size_t frame_length(const uint8_t *header)
{
    const size_t length = (size_t)header[4] << 8 | header[5];

    if (header[2] != 0 || header[3] != 0 || length < SHORTEST - LENGTH_END ||
        length > LONGEST - LENGTH_END)
        return 0;
    return LENGTH_END + length;
}

/* Whether an error says something about one datagram and not about the socket. A client's
 * socket reports here that the server's machine refused an earlier datagram. */
static int is_passing(int error)
{
    switch (error) {
    case ECONNREFUSED:
    case EHOSTUNREACH:
    case ENETUNREACH:
    case EHOSTDOWN:
    case ENETDOWN:
    case EPERM:
    case EACCES:
    case EMSGSIZE:
    case ECONNRESET: return 1;
    default: return 0;
    }
}

static int must_wait(int error)
{
    return error == EAGAIN || error == EWOULDBLOCK || error == EINTR || error == ENOBUFS ||
           error == ENOMEM;
}

static int16_t lose(mbm_udp *udp, int error)
{
    udp->isLost = 1;
    udp->error = error;
    return -1;
}

/* Receives one datagram. Returns 1 if it is one frame, 0 if there is none now, -1 if the link is
 * lost, and 2 if it was dropped. */
static int receive(mbm_udp *udp)
{
    struct sockaddr_storage from;
    socklen_t size = sizeof from;
    const ssize_t count = recvfrom(udp->fd, udp->incoming, sizeof udp->incoming, MSG_DONTWAIT,
                                   (struct sockaddr *)&from, &size);

    if (count < 0 && is_passing(errno)) {
        udp->error = errno;
        udp->unsent++;
        return 2;
    }
    if (count < 0)
        return must_wait(errno) ? 0 : lose(udp, errno);
    if (count < SHORTEST || frame_length(udp->incoming) != (size_t)count) {
        udp->dropped++;
        return 2;
    }
    udp->from = 0;
    udp->to = (uint16_t)count;
    if (udp->isServer) {
        udp->peer = from;
        udp->peerLength = size;
        udp->collected = 0;
    }
    return 1;
}

static int16_t udp_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    mbm_udp *udp = (mbm_udp *)context;
    int result = 2, drops;
    uint16_t count;

    if (udp->port == 0 || udp->isLost)
        return -1;
    udp->isUsed = 1;
    for (drops = 0; udp->from == udp->to && result == 2; drops++) {
        if (drops == MBM_UDP_DROPS)
            return 0;
        result = receive(udp);
    }
    if (udp->from == udp->to)
        return (int16_t)(result < 0 ? -1 : 0);
    count = (uint16_t)(udp->to - udp->from);
    if (count > capacity)
        count = capacity;
    memcpy(bytes, udp->incoming + udp->from, count);
    udp->from = (uint16_t)(udp->from + count);
    return (int16_t)count;
}

/* Sends the collected frame. Returns 1, 0 if the system has no space for it now, -1 if the link
 * is lost. */
static int send_frame(mbm_udp *udp)
{
    const struct sockaddr *to = udp->isServer ? (const struct sockaddr *)&udp->peer : NULL;
    ssize_t count;

    /* A server sends only responses. */
    if (udp->isServer && udp->peerLength == 0)
        return lose(udp, EDESTADDRREQ);
    count = sendto(udp->fd, udp->outgoing, udp->collected, MSG_DONTWAIT | MSG_NOSIGNAL, to,
                   to ? udp->peerLength : 0);
    if (count < 0 && must_wait(errno))
        return 0;
    if (count < 0 && !is_passing(errno))
        return lose(udp, errno);
    /* A datagram that is not sent counts as lost. */
    if (count < 0) {
        udp->error = errno;
        udp->unsent++;
    }
    udp->collected = 0;
    return 1;
}

/* Adds bytes to the frame that is collected, up to its end. Returns how many, 0 if the frame is
 * complete and cannot be sent now, -1 if the link is lost. */
static int collect(mbm_udp *udp, const uint8_t *bytes, size_t count)
{
    const size_t whole = udp->collected < LENGTH_END ? LENGTH_END : frame_length(udp->outgoing);
    int sent;

    if (whole == 0)
        return lose(udp, EPROTO);
    if (count > whole - udp->collected)
        count = whole - udp->collected;
    memcpy(udp->outgoing + udp->collected, bytes, count);
    udp->collected = (uint16_t)(udp->collected + count);
    if (udp->collected < whole || whole == LENGTH_END)
        return (int)count;
    sent = send_frame(udp);
    udp->isFull = sent == 0;
    if (sent == 0)
        udp->collected = (uint16_t)(udp->collected - count);
    return sent > 0 ? (int)count : sent;
}

static int16_t udp_write(void *context, const uint8_t *bytes, uint16_t length)
{
    mbm_udp *udp = (mbm_udp *)context;
    uint16_t accepted = 0;
    int count = 1;

    if (udp->port == 0 || udp->isLost)
        return -1;
    if (length > INT16_MAX)
        length = INT16_MAX;
    while (accepted < length && count > 0) {
        count = collect(udp, bytes + accepted, (size_t)(length - accepted));
        if (count > 0)
            accepted = (uint16_t)(accepted + count);
    }
    return (int16_t)(count < 0 ? -1 : accepted);
}

static uint32_t udp_micros(void *context)
{
    struct timespec now;

    (void)context;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)now.tv_sec * 1000000u + (uint32_t)now.tv_nsec / 1000u;
}

mbm_port mbm_udp_port(mbm_udp *udp)
{
    return (mbm_port){.context = udp, .read = udp_read, .write = udp_write, .micros = udp_micros};
}

int mbm_udp_wait(const mbm_udp *udps, size_t count, int fd, uint32_t timeoutUs)
{
    const struct timespec time = {(time_t)(timeoutUs / 1000000u),
                                  (long)(timeoutUs % 1000000u) * 1000};
    struct pollfd waits[MBM_UDP_WAITS + 1];
    nfds_t used = 0;
    int ready;
    size_t i;

    if (count > MBM_UDP_WAITS)
        return refuse(EINVAL);
    for (i = 0; i < count; i++)
        if (udps[i].port != 0 && !udps[i].isLost)
            waits[used++] =
                (struct pollfd){udps[i].fd, (short)(udps[i].isFull ? POLLIN | POLLOUT : POLLIN), 0};
    if (fd >= 0)
        waits[used++] = (struct pollfd){fd, POLLIN, 0};
    ready = ppoll(waits, used, timeoutUs == MBM_UDP_FOREVER ? NULL : &time, NULL);
    if (ready < 0)
        return errno == EINTR ? 0 : -1;
    return ready > 0;
}
