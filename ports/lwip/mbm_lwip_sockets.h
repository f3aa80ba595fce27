/* Private: what the sources of the port over TCP, ports/linux/mbm_tcp.c and mbm_tcp_listener.c,
 * take from lwIP in place of Linux. A program includes mbm_tcp.h, and defines MBM_TCP_OVER_LWIP for
 * all files that include it. docs/guide-lwip.md says which files to compile, and lwIP's options.
 * lwIP 2.1 or later. Licence: MIT OR Apache-2.0. */
#ifndef MBM_LWIP_SOCKETS_H
#define MBM_LWIP_SOCKETS_H

#include "lwip/errno.h"
#include "lwip/mem.h"
#include "lwip/netdb.h"
#include "lwip/sockets.h"
#include "lwip/sys.h"

#include <stdlib.h>

#if !LWIP_SOCKET
#error "mbm over lwIP's sockets: set LWIP_SOCKET to 1 and NO_SYS to 0 in lwipopts.h"
#endif
/* Without lwIP's poll a task cannot sleep until bytes come. */
#if !LWIP_SOCKET_POLL
#error "mbm over lwIP's sockets: set LWIP_SOCKET_POLL to 1 in lwipopts.h"
#endif

/* The structure of an address of IPv6 is not there. */
#if !LWIP_IPV6
#define MBM_TCP_HAS_NO_IPV6
#endif

/* lwIP's own names, whatever LWIP_COMPAT_SOCKETS is. */
#undef socket
#undef connect
#undef bind
#undef listen
#undef accept
#undef shutdown
#undef getsockname
#undef setsockopt
#undef getsockopt
#undef recv
#undef send
#undef read
#undef close
#undef poll
#undef freeaddrinfo
#undef gai_strerror
#define socket(family, kind, protocol) lwip_socket(family, kind, protocol)
#define connect(fd, address, length) lwip_connect(fd, address, length)
#define bind(fd, address, length) lwip_bind(fd, address, length)
#define listen(fd, backlog) lwip_listen(fd, backlog)
#define accept(fd, address, length) lwip_accept(fd, address, length)
#define shutdown(fd, how) lwip_shutdown(fd, how)
#define getsockname(fd, address, length) lwip_getsockname(fd, address, length)
#define setsockopt(fd, level, option, value, length)                                               \
    lwip_setsockopt(fd, level, option, value, length)
#define getsockopt(fd, level, option, value, length)                                               \
    lwip_getsockopt(fd, level, option, value, length)
#define recv(fd, bytes, length, flags) lwip_recv(fd, bytes, length, flags)
#define send(fd, bytes, length, flags) lwip_send(fd, bytes, length, flags)
#define read(fd, bytes, length) lwip_read(fd, bytes, length)
#define close(fd) lwip_close(fd)
#define poll(waits, count, timeout) lwip_poll(waits, count, timeout)
#define freeaddrinfo(found) mbm_lwip_freeAddresses(found)
#define gai_strerror(error) "lwIP found no address of this name"

#ifndef SOMAXCONN
#define SOMAXCONN 16
#endif

#if !LWIP_DNS && !defined AI_PASSIVE
#define AI_PASSIVE 1
struct addrinfo {
    int ai_family;
    socklen_t ai_addrlen;
    struct sockaddr *ai_addr;
    struct addrinfo *ai_next;
};
#endif

void mbm_lwip_freeAddresses(struct addrinfo *found);

/* The clock is lwIP's sys_now, and so in whole milliseconds. */
int64_t mbm_tcp_microseconds(void);

/* lwIP has no second descriptor of a socket. A connection that finds no descriptor is closed by
 * lwIP itself. */
static inline int mbm_tcp_duplicate(int fd)
{
    (void)fd;
    return -1;
}

/* Rounds up: a socket that has bytes ends the wait in any case. */
static inline int mbm_tcp_pollFor(struct pollfd *waits, nfds_t count, uint32_t timeoutUs)
{
    return lwip_poll(
        waits, count,
        timeoutUs == MBM_TCP_FOREVER ? -1 : (int)(timeoutUs / 1000 + (timeoutUs % 1000 != 0)));
}

/* lwIP does not say what the peer has acknowledged: at most all that was written since the last
 * read.
 */
static inline uint32_t mbm_tcp_unacknowledged(const mbm_tcp *tcp)
{
    return tcp->unanswered;
}

static inline void mbm_tcp_noteWritten(mbm_tcp *tcp, uint16_t count)
{
    tcp->lastWrite = count;
    tcp->unanswered += count;
}

static inline void mbm_tcp_noteRead(mbm_tcp *tcp)
{
    tcp->unanswered = 0;
}

/* lwIP may have queued the bytes of a write that failed, for lack of a route. */
static inline void mbm_tcp_noteFailed(mbm_tcp *tcp)
{
    tcp->unanswered = UINT32_MAX;
}

static inline void mbm_tcp_sleep(uint32_t micros)
{
    sys_msleep(micros / 1000 + 1);
}

#endif
