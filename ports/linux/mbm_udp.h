/**
 * @file mbm_udp.h
 * @brief An mbm_port over UDP: one Modbus TCP frame in one datagram, for clients and servers.
 *
 * Use it with mbm_client_beginTcp and mbm_server_beginTcp. A datagram that is not exactly one
 * frame is dropped and counted. Datagrams get lost, arrive twice, and overtake each other: a
 * client finds its reply by number, and needs retries (mbm_client_setRetries). A repeated
 * write is carried out once more, so write values, not changes.
 *
 * Modbus/UDP is no part of the Modbus standard. Anyone can send a datagram in another's name:
 * use it in a network that you trust.
 *
 * Only mbm_udp_wait and the lookup of a name block. Functions that return int return -1 with
 * errno set when they fail. No function is re-entrant on one mbm_udp.
 *
 * Licence: MIT OR Apache-2.0.
 */
#ifndef MBM_UDP_H
#define MBM_UDP_H

#include "mbm.h"

#include <stddef.h>
#include <sys/socket.h>

#ifdef __cplusplus
extern "C" {
#endif

/** The port that devices with Modbus over UDP use, as a service of mbm_udp_open and
 *  mbm_udp_listen. */
#define MBM_UDP_SERVICE "502"

/** For mbm_udp_wait: no time limit. */
#define MBM_UDP_FOREVER UINT32_MAX

/** Most sockets that one mbm_udp_wait looks at. */
#define MBM_UDP_WAITS 64

/** Most datagrams that one read drops. The next one drops the others. */
#define MBM_UDP_DROPS 16

/** A socket in use as a port. Initialise it with MBM_INIT. */
typedef struct mbm_udp {
    int fd;           /**< the socket, while `port` is not 0 */
    int error;        /**< why the link was lost, or why a datagram was not sent or its receiver
                           refused it, an errno; else 0 */
    int lookupError;  /**< why no address was found, for gai_strerror; else 0 */
    uint16_t port;    /**< this side's port */
    uint32_t dropped; /**< number of received datagrams that were not one frame */
    uint32_t unsent;  /**< number of frames that the system did not send, or whose receiver
                           refused them */
    uint8_t isServer; /**< private */
    uint8_t isFull;   /**< private */
    uint8_t isLost;   /**< private */
    uint8_t isUsed;   /**< private */
    uint8_t incoming[MBM_MAX_TCP_FRAME + 1];           /**< private */
    uint8_t outgoing[MBM_MAX_TCP_FRAME];               /**< private */
    uint16_t from, to;                                 /**< private */
    uint16_t collected;                                /**< private */
    socklen_t peerLength;                              /**< private */
    struct sockaddr_storage peer;                      /**< private */
    int (*watch)(void *owner, int fd, uint8_t isOpen); /**< private */
    void *owner;                                       /**< private */
} mbm_udp;

/**
 * Opens a client's socket for one server. It does not find out whether there is one.
 *
 * @param udp      initialised with MBM_INIT, or closed before
 * @param host     a name or a numeric address; the lookup of a name may block. NULL is this
 *                 machine. The first address that the system has a route to is used
 * @param service  a port number, for example MBM_UDP_SERVICE
 * @return 0, or -1 with errno set: EBUSY if `udp` is in use, ENXIO for an unknown
 *         name or service, EAGAIN if the lookup may succeed later, or an error of socket or
 *         connect
 */
int mbm_udp_open(mbm_udp *udp, const char *host, const char *service);

/**
 * Opens a server's socket. One mbm_server serves all clients: each response goes to the
 * sender of the request before it. On a machine with several addresses, listen at one of
 * them: clients drop a response that comes from another.
 *
 * @param udp      initialised with MBM_INIT, or closed before
 * @param host     the address to receive at; NULL for all addresses of the machine
 * @param service  a port number; "0" for a free one, which is then in `port`
 * @return 0, or -1 with errno set, as of mbm_udp_open, or an error of bind
 */
int mbm_udp_listen(mbm_udp *udp, const char *host, const char *service);

/** Closes the socket. Does nothing if there is none. */
void mbm_udp_close(mbm_udp *udp);

/**
 * Returns the port for the begin functions. It may be made before the socket is open. Its
 * read returns bytes of one datagram at a time. Its write sends a frame when it has all of
 * it, and collects bytes until then. A datagram that is no frame loses the link. A server that is
 * not there does not: it is counted in `unsent`.
 *
 * @param udp  must outlive the port
 * @return the port
 */
mbm_port mbm_udp_port(mbm_udp *udp);

/**
 * Sleeps until a datagram arrives at one of a few sockets, or until a full socket accepts one
 * again, or a time is over.
 *
 * @param udps       the sockets; those that are closed are skipped
 * @param count      number of sockets, at most MBM_UDP_WAITS
 * @param fd         waits for bytes of another descriptor too; -1 for none
 * @param timeoutUs  the longest sleep in microseconds, or MBM_UDP_FOREVER; the value that a
 *                   pollDelay function returned
 * @return 1 if a socket or the descriptor is ready, 0 if the time is over or a signal came,
 *         -1 with errno EINVAL for too many sockets, or an error of ppoll
 */
int mbm_udp_wait(const mbm_udp *udps, size_t count, int fd, uint32_t timeoutUs);

#ifdef __cplusplus
}
#endif

#endif
