/* The listener of mbm_tls_linux.h: who gets a place. Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "mbm_tls_linux.h"

#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <string.h>

/* How long the system keeps a connection whose client sends nothing, in seconds. */
enum { DEFER_S = MBM_TLS_HANDSHAKE_MS / 1000 };

/* The bytes of an address by which peers count as one: an IPv6 network has 64 bits. */
enum { SAME_V4 = 4, SAME_V6 = 8 };

typedef struct peer {
    int family;
    uint8_t bytes[SAME_V6];
} peer;

int mbm_tls_listen(mbm_tcp_listener *listener, const char *host, const char *service)
{
    const int result = mbm_tcp_listen(listener, host, service);

#ifdef TCP_DEFER_ACCEPT
    /* A peer that sends nothing gets no place. A system that lacks the option works too. */
    if (result == 0)
        (void)setsockopt(listener->fd, IPPROTO_TCP, TCP_DEFER_ACCEPT, &(int){DEFER_S}, sizeof(int));
#endif
    return result;
}

static peer peer_of(const mbm_tcp *tcp)
{
    struct sockaddr_storage address;
    socklen_t size = sizeof address;
    peer found;

    memset(&address, 0, sizeof address);
    memset(&found, 0, sizeof found);
    if (getpeername(tcp->fd, (struct sockaddr *)&address, &size) < 0)
        return found;
    found.family = address.ss_family;
    if (address.ss_family == AF_INET) {
        memcpy(found.bytes, &((struct sockaddr_in *)&address)->sin_addr, SAME_V4);
    } else if (address.ss_family == AF_INET6) {
        const struct in6_addr *v6 = &((struct sockaddr_in6 *)&address)->sin6_addr;

        /* An IPv4 client of a socket for both. */
        if (IN6_IS_ADDR_V4MAPPED(v6))
            memcpy(found.bytes, v6->s6_addr + 12, SAME_V4);
        else
            memcpy(found.bytes, v6->s6_addr, SAME_V6);
    }
    return found;
}

static int is_unfinished(const mbm_tls *tls, const mbm_tcp *tcp)
{
    return mbm_tcp_isInUse(tcp) && tls->status == MBM_TLS_HANDSHAKE;
}

/* The number of unfinished handshakes with the peer of one of them. */
static size_t crowd_of(const mbm_tls *tlss, const mbm_tcp *tcps, size_t count, size_t one)
{
    const peer wanted = peer_of(&tcps[one]);
    size_t i, crowd = 0;

    for (i = 0; i < count; i++)
        if (is_unfinished(&tlss[i], &tcps[i])) {
            const peer other = peer_of(&tcps[i]);

            crowd += memcmp(&other, &wanted, sizeof other) == 0;
        }
    return crowd;
}

/* Returns the unfinished handshake that goes first. It belongs to the peer with the most of them,
 * and is the oldest of those that came least far. `count` if there is none. */
static size_t first_to_go(const mbm_tls *tlss, const mbm_tcp *tcps, size_t count)
{
    size_t i, found = count, most = 0;

    for (i = 0; i < count; i++) {
        size_t crowd;
        uint8_t progress;

        if (!is_unfinished(&tlss[i], &tcps[i]))
            continue;
        crowd = crowd_of(tlss, tcps, count, i);
        progress = mbm_tls_progress(&tlss[i]);
        if (found == count || crowd > most ||
            (crowd == most && (progress < mbm_tls_progress(&tlss[found]) ||
                               (progress == mbm_tls_progress(&tlss[found]) &&
                                mbm_tls_isOlder(&tlss[i], &tlss[found]))))) {
            found = i;
            most = crowd;
        }
    }
    return found;
}

static int is_connection_waiting(const mbm_tcp_listener *listener)
{
    struct pollfd wait = {listener->fd, POLLIN, 0};

    return listener->port != 0 && poll(&wait, 1, 0) > 0;
}

/* Frees a place for a connection that waits, if all are in use. */
static void make_place(mbm_tcp_listener *listener, mbm_tls *tlss, mbm_tcp *tcps, size_t count)
{
    size_t i;

    for (i = 0; i < count; i++)
        if (!mbm_tcp_isInUse(&tcps[i]))
            return;
    if (!is_connection_waiting(listener))
        return;
    i = first_to_go(tlss, tcps, count);
    if (i < count) {
        mbm_tls_close(&tlss[i]);
        mbm_tcp_close(&tcps[i]);
    }
}

int mbm_tls_accept(mbm_tcp_listener *listener, const mbm_tls_identity *identity, mbm_tls *tlss,
                   mbm_tcp *tcps, size_t count)
{
    mbm_port socket;
    int place;

    make_place(listener, tlss, tcps, count);
    place = mbm_tcp_accept(listener, tcps, count);
    if (place < 0)
        return -1;
    socket = mbm_tcp_port(&tcps[place]);
    if (mbm_tls_open(&tlss[place], identity, &socket, NULL, NULL) != MBM_TLS_HANDSHAKE) {
        mbm_tcp_close(&tcps[place]);
        errno = ENOMEM;
        return -1;
    }
    /* Its first message may be there. A peer that has sent it is not the first to go. */
    (void)mbm_tls_poll(&tlss[place]);
    return place;
}
