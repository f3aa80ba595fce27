/**
 * @file mbm_tcp.h
 * @brief An mbm_port over a TCP socket, for clients and for servers.
 *
 * Nothing waits but mbm_tcp_wait, and the lookup of a name that is no numeric
 * address. Functions that return int return -1 with errno set when they fail.
 * None is re-entrant on one mbm_tcp; any number may be used side by side.
 *
 * Sockets are set to send at once (TCP_NODELAY) and to find out about a peer that
 * is gone: within about 30 s, where the system lets a socket say so.
 *
 * Licence: MIT OR Apache-2.0.
 */
#ifndef MBM_TCP_H
#define MBM_TCP_H

#include "mbm.h"

#include <stddef.h>
#include <sys/socket.h>

#ifdef __cplusplus
extern "C" {
#endif

/** The port of Modbus over TCP, as a service of mbm_tcp_open and mbm_tcp_listen. */
#define MBM_TCP_SERVICE "502"

/** For mbm_tcp_wait: as long as it takes. */
#define MBM_TCP_FOREVER UINT32_MAX

/** Most addresses of one name that are tried, one behind the other. */
#define MBM_TCP_ADDRESSES 4

/** Most sockets that one mbm_tcp_wait looks at. */
#define MBM_TCP_WAITS 256

/** A socket in use as a port; zero before first use. */
typedef struct mbm_tcp {
    int fd;                   /**< the socket, while it is there */
    int error;                /**< errno of what lost the link, EPIPE if the peer closed it; else 0 */
    const mbm_master *master; /**< who uses it; says how long to sleep */
    uint8_t state;            /**< not for you */
    uint8_t is_full;          /**< 1 while it takes no more bytes, so wait for room too */
    uint8_t is_unread;        /**< not for you */
    uint8_t count;            /**< not for you */
    uint8_t next;             /**< not for you */
    socklen_t lengths[MBM_TCP_ADDRESSES];               /**< not for you */
    struct sockaddr_storage addresses[MBM_TCP_ADDRESSES]; /**< not for you */
} mbm_tcp;

/** A socket that connections come to; zero before first use. */
typedef struct mbm_tcp_listener {
    int fd;           /**< the socket, while `port` is not 0 */
    uint16_t port;    /**< where it listens */
    uint32_t refused; /**< connections that found no free place */
} mbm_tcp_listener;

/**
 * Begins to connect to a server, and does not wait for it. Until it is there the
 * port reads and takes nothing; if it does not come to be, the link is lost.
 *
 * @param tcp      zeroed, or closed before
 * @param host     a name or a numeric address; a name may take the time of a lookup.
 *                 NULL is this machine. Of several addresses the first that
 *                 answers is taken
 * @param service  a port number, for example MBM_TCP_SERVICE
 * @return 0, or -1 with errno set: EBUSY if it is in use, EADDRNOTAVAIL for a name
 *         or service that is unknown, EAGAIN if the lookup may go well later, or as
 *         of socket and connect
 */
int mbm_tcp_open(mbm_tcp *tcp, const char *host, const char *service);

/**
 * Uses a stream socket that is connected already; makes it non-blocking.
 *
 * @param tcp  zeroed, or closed before
 * @param fd   belongs to `tcp` from now on, if this succeeds
 * @return 0, or -1 with errno set
 */
int mbm_tcp_attach(mbm_tcp *tcp, int fd);

/**
 * Closes the socket, and frees the place for mbm_tcp_accept. Nothing happens if
 * it is free already.
 *
 * @param tcp  the socket
 */
void mbm_tcp_close(mbm_tcp *tcp);

/**
 * Whether there is a connection, as far as it is known without asking the peer. An
 * end of the stream is seen behind what is still to be read.
 *
 * @param tcp  the socket
 * @return 1 if there is, 0 while it is being made, -1 if it is lost or closed
 */
int mbm_tcp_isConnected(mbm_tcp *tcp);

/**
 * Connects anew to the server that mbm_tcp_open was told, and does not wait for
 * it. A hook for whoever reconnects.
 *
 * @param tcp  an mbm_tcp
 * @return MBM_OK, MBM_PENDING while the connection is being made, or MBM_LINK_LOST
 *         with errno in its `error`: ENOTCONN if it was never opened
 */
uint8_t mbm_tcp_connect(void *tcp);

/**
 * Ends the connection; the link is lost until mbm_tcp_connect. A hook for whoever
 * reconnects.
 *
 * @param tcp  an mbm_tcp
 */
void mbm_tcp_disconnect(void *tcp);

/**
 * The port to give to the begin functions. While a blocking call of `master`
 * waits, it sleeps until bytes arrive or `master` has something else to do.
 *
 * @param tcp     must outlive the port
 * @param master  the object that the port is for; NULL for an object that never
 *                waits by itself, and there is no idle hook
 * @return the port; its read and write keep errno in `error` when the link is lost
 */
mbm_port mbm_tcp_port(mbm_tcp *tcp, const mbm_master *master);

/**
 * Begins to listen for connections.
 *
 * @param listener  zeroed, or closed before
 * @param host      the address to listen at; NULL for every one of the machine
 * @param service   a port number; "0" for one that is free, told in `port`
 * @return 0, or -1 with errno set: EBUSY if it is in use, EADDRINUSE, EACCES for a
 *         port below 1024 without the right to it, or as of mbm_tcp_open
 */
int mbm_tcp_listen(mbm_tcp_listener *listener, const char *host, const char *service);

/**
 * Takes a connection that waits. When every place is in use, those that wait are
 * closed in order, so that their clients know at once.
 *
 * @param listener  where they come to
 * @param tcps      the places for connections
 * @param count     how many; each is free if zeroed or closed
 * @return the index of the place, or -1 with errno set: EAGAIN if none waits (or
 *         none is left that was not refused), or as of accept
 */
int mbm_tcp_accept(mbm_tcp_listener *listener, mbm_tcp *tcps, size_t count);

/**
 * Listens no more; connections stay.
 *
 * @param listener  the socket
 */
void mbm_tcp_closeListener(mbm_tcp_listener *listener);

/**
 * Sleeps until one of several sockets has something to do, or a time is over:
 * bytes or a connection arrived, a connection came to be or is lost, or there is
 * room again for bytes that a full socket did not take. Bytes and an end that it told
 * of do not end it again before the port was used, for a client without requests and
 * a server that is not done take none.
 *
 * @param tcps      the sockets; those that are free or lost are passed over
 * @param count     how many, at most MBM_TCP_WAITS - 2
 * @param listener  waits for connections too; may be NULL
 * @param fd        waits for bytes of another descriptor too, for example that of
 *                  an mbm_tty; -1 for none
 * @param micros    at most so long, in microseconds, or MBM_TCP_FOREVER
 * @return 1 if there is something; 0 if the time is over or a signal came; -1 with
 *         errno set, EINVAL for too many
 */
int mbm_tcp_wait(mbm_tcp *tcps, size_t count, const mbm_tcp_listener *listener, int fd,
                 uint32_t micros);

#ifdef __cplusplus
}
#endif

#endif
