/**
 * @file mbm_tcp.h
 * @brief An mbm_port over a TCP socket, for clients and for servers.
 *
 * mbm_tcp.c is the port. A server needs mbm_tcp_listener.c too. A server with many
 * connections, on Linux, also needs mbm_tcp_set.c.
 *
 * Only mbm_tcp_wait, mbm_tcp_waitSet, and the lookup of a name that is no numeric address
 * block: it is done by mbm_tcp_open and mbm_tcp_connect. Functions that return int return -1 with
 * errno set when they fail. No function is re-entrant on one mbm_tcp. Any number of mbm_tcp may be
 * used side by side.
 *
 * Sockets send at once (TCP_NODELAY). They find a peer that is gone within about 30 s, if
 * the system has the options for it.
 *
 * Licence: MIT OR Apache-2.0.
 */
#ifndef MBM_TCP_H
#define MBM_TCP_H

#include "mbm.h"

#include <stddef.h>
#ifdef MBM_TCP_OVER_LWIP
#include "mbm_lwip_limits.h" /* the port over lwIP's sockets: docs/guide-lwip.md */
#else
#include <sys/socket.h>
#endif

#ifdef __cplusplus
extern "C" {
#endif

/** The port of Modbus over TCP, as a service of mbm_tcp_open and mbm_tcp_listen. */
#define MBM_TCP_SERVICE "502"

/** For mbm_tcp_wait: no time limit. */
#define MBM_TCP_FOREVER UINT32_MAX

#ifndef MBM_TCP_OVER_LWIP
/** Most addresses of one name that are tried, one after the other. */
#define MBM_TCP_ADDRESSES 4

/** Most sockets that one mbm_tcp_wait looks at. */
#define MBM_TCP_WAITS 256

/** The longest name of a host, and of a service, with the terminating zero. */
#define MBM_TCP_HOST_BYTES 256
#define MBM_TCP_SERVICE_BYTES 32
#endif

/** Most sockets of a set that one mbm_tcp_waitSet reports. The next one reports the others. */
#define MBM_TCP_READY 64

/** Microseconds after which to call mbm_tcp_accept again if it found no descriptor. */
#define MBM_TCP_RETRY 100000u

/** A server and its addresses, for a client that connects to it. The program provides the
 *  memory, mbm_tcp_open or mbm_tcp_openLater fills it. */
typedef struct mbm_tcp_addresses {
    char host[MBM_TCP_HOST_BYTES];                   /**< private */
    char service[MBM_TCP_SERVICE_BYTES];             /**< private */
    uint8_t isLocal;                                 /**< private */
    uint8_t first;                                   /**< private */
    uint8_t count;                                   /**< private */
    uint8_t next;                                    /**< private */
    socklen_t lengths[MBM_TCP_ADDRESSES];            /**< private */
    struct sockaddr_storage list[MBM_TCP_ADDRESSES]; /**< private */
} mbm_tcp_addresses;

/** A socket in use as a port. Initialise it with MBM_INIT. */
typedef struct mbm_tcp {
    int fd;    /**< the socket, while there is one */
    int error; /**< why there is no link, an errno: ETIMEDOUT while the connection is being
                    made, and if it was given up meanwhile, since nothing has answered;
                    EPIPE if the peer closed it, ETIMEDOUT if mbm_tcp_accept closed it as
                    idle, ENOTCONN after mbm_tcp_disconnect; 0 while there is a link. It
                    stays until the program connects anew */
    int16_t lookupError; /**< why no address was found, for gai_strerror; else 0 */
    uint16_t lastWrite;  /**< private */
    uint8_t isBusy;      /**< set by the program: 1 while the peer waits for a response, so that the
                              connection is not idle; needed only for requests that may take longer
                              than the idle time */
    uint8_t state;       /**< private */
    uint8_t events; /**< what to poll it for: POLLIN, and POLLOUT while it accepts no more bytes */
    uint8_t readiness;            /**< private */
    int64_t lastActivityUs;       /**< private */
    int64_t clockUs;              /**< private */
    mbm_tcp_addresses *addresses; /**< private */
    struct mbm_tcp_set *set;      /**< private */
    struct mbm_tcp *next;         /**< private */
    void *owner;                  /**< private */
#ifdef MBM_TCP_OVER_LWIP
    uint32_t unanswered; /**< private */
#endif
} mbm_tcp;

/** A socket that listens for connections. Initialise it with MBM_INIT. It takes two descriptors,
 * one of them as a spare. */
typedef struct mbm_tcp_listener {
    int fd;                  /**< the socket, while `port` is not 0 */
    int spare;               /**< private */
    int lookupError;         /**< why mbm_tcp_listen found no address, for gai_strerror; else 0 */
    uint16_t port;           /**< where it listens */
    uint8_t events;          /**< what to poll it for: POLLIN, or 0 while connections must wait */
    uint8_t nothingToAccept; /**< private */
    uint32_t idleTimeMs; /**< set by the program: milliseconds without a byte read or written after
                            which a connection may be closed for a new one; 0: never */
    uint32_t refused;    /**< number of connections that were closed for lack of a place or of a
                            descriptor */
    uint32_t idle;       /**< number of connections that were closed because they were idle */
    int64_t retryAtMs;   /**< private */
    struct mbm_tcp_set *set; /**< private */
} mbm_tcp_listener;

/** Any number of sockets. One wait finds those that are ready. Initialise it with MBM_INIT. */
typedef struct mbm_tcp_set {
    int fd;                     /**< the descriptor of epoll: a program that polls other descriptors
                                     too polls it for POLLIN, and then calls mbm_tcp_waitSet */
    uint8_t isOpen;             /**< private */
    int64_t nowMs;              /**< private */
    mbm_tcp *first;             /**< private */
    mbm_tcp **end;              /**< private */
    mbm_tcp_listener *listener; /**< private */
    int (*watch)(struct mbm_tcp_set *set, int fd, void *owner, uint8_t before,
                 uint8_t events);                      /**< private */
    int (*add)(struct mbm_tcp_set *set, mbm_tcp *tcp); /**< private */
} mbm_tcp_set;

/**
 * Begins to connect to a server, and does not wait for it. Until it is connected the port
 * reads and accepts no bytes. If the connection fails, the link is lost. A program with a link
 * calls mbm_tcp_openLater instead, which does not fail while there is no network.
 *
 * @param tcp        initialised with MBM_INIT, or closed before
 * @param addresses  filled here; must stay until `tcp` is closed, for one `tcp` only
 * @param host       a name or a numeric address; the lookup of a name may block. NULL is
 *                   this machine. The first of several addresses that answers is used
 * @param service    a port number, for example MBM_TCP_SERVICE
 * @return 0, or -1 with errno set: EBUSY if `tcp` is in use, ENAMETOOLONG, ENXIO for an
 *         unknown name or service, EAGAIN if the lookup may succeed later, or an error of
 *         socket or connect. If the lookup failed, `lookupError` says why
 */
int mbm_tcp_open(mbm_tcp *tcp, mbm_tcp_addresses *addresses, const char *host, const char *service);

/**
 * Notes a server, and leaves the connecting to mbm_tcp_connect, which a link calls
 * (mbm_tcp_link). So a program can begin before the network is there, and before the name of
 * the server is known.
 *
 * @param tcp        zeroed, or closed before. It is in use, and its link is lost
 * @param addresses  as for mbm_tcp_open
 * @param host       as for mbm_tcp_open; copied
 * @param service    as for mbm_tcp_open; copied
 * @return 0, or -1 with errno set: EBUSY if `tcp` is in use, or ENAMETOOLONG
 */
int mbm_tcp_openLater(mbm_tcp *tcp, mbm_tcp_addresses *addresses, const char *host,
                      const char *service);

/**
 * Returns in words why there is no link: `lookupError`, or `error`.
 *
 * @return a text of the system; strerror of 0 if there is a link
 */
const char *mbm_tcp_text(const mbm_tcp *tcp);

/**
 * Uses a stream socket that is connected already; makes it non-blocking.
 *
 * @param tcp  initialised with MBM_INIT, or closed before
 * @param fd   belongs to `tcp` from now on, if this succeeds
 * @return 0, or -1 with errno set
 */
int mbm_tcp_attach(mbm_tcp *tcp, int fd);

/**
 * Closes the socket, and frees the place for mbm_tcp_accept. Does nothing if the place is free
 * already.
 *
 * A socket of mbm_tcp_open or mbm_tcp_openLater is closed by a reset if the peer has not
 * acknowledged a request: otherwise the system would still send it for up to 30 s, and a write that
 * failed would be carried out later. Bytes that were written in the last 20 ms are still sent: the
 * end of a TLS session, a request without a response. mbm_tcp_disconnect and mbm_tcp_connect end a
 * connection in the same way.
 */
void mbm_tcp_close(mbm_tcp *tcp);

/**
 * Returns whether a place is in use. It is from mbm_tcp_open, mbm_tcp_attach or
 * mbm_tcp_accept until mbm_tcp_close, also while the connection is being made and after it
 * was lost.
 *
 * @return 1 if it is in use, 0 if it is free; a zeroed one is free
 */
int mbm_tcp_isInUse(const mbm_tcp *tcp);

/**
 * Returns for how long a connection has been idle: since the port last read or wrote a byte.
 *
 * @return milliseconds, or -1 if there is no connection
 */
int64_t mbm_tcp_idleFor(const mbm_tcp *tcp);

/**
 * Returns whether there is a connection, as far as the system knows without sending
 * anything. The end of the stream is seen only after all bytes were read.
 *
 * @return 1 if connected, 0 while connecting, -1 if the link is lost or closed
 */
int mbm_tcp_isConnected(mbm_tcp *tcp);

/**
 * Connects to the server of mbm_tcp_open or mbm_tcp_openLater, and does not wait for it. Looks
 * up a name anew. If that fails, it uses the addresses of the last lookup. A hook for a
 * function that reconnects.
 *
 * @param context  an mbm_tcp
 * @return MBM_OK, MBM_PENDING while the connection is being made, or MBM_LINK_LOST
 *         with errno in its `error`: ENOTCONN if it was never opened
 */
uint8_t mbm_tcp_connect(void *context);

/**
 * Ends the connection, or the attempt to make it. The link is lost until mbm_tcp_connect. A
 * hook for a function that
 * reconnects.
 *
 * @param context  an mbm_tcp
 */
void mbm_tcp_disconnect(void *context);

/**
 * Returns whether there is a connection, as a hook of mbm_linkHooks.
 *
 * @param tcp  an mbm_tcp
 * @return MBM_OK, MBM_PENDING while the connection is being made, MBM_CONNECT_TIMED_OUT if
 *         nothing has answered, or MBM_LINK_LOST
 */
uint8_t mbm_tcp_status(void *tcp);

/**
 * Returns the hooks for mbm_link_begin, for a client of the server of mbm_tcp_openLater or
 * mbm_tcp_open. In the callback of the link, mbm_tcp_text says why a connection was lost or
 * not made.
 *
 * @param tcp  in use; must outlive the link
 * @return the hooks
 */
static inline mbm_linkHooks mbm_tcp_link(mbm_tcp *tcp)
{
    mbm_linkHooks hooks;

    hooks.context = tcp;
    hooks.disconnect = mbm_tcp_disconnect;
    hooks.connect = mbm_tcp_connect;
    hooks.status = mbm_tcp_status;
    return hooks;
}

/**
 * Returns the port for the begin functions. It may be made before the socket is open, stays
 * valid when the socket is closed and opened again, and may be given to several objects.
 * While a blocking call of a node waits, the port sleeps until bytes arrive, at most for
 * the time of mbm_node_pollDelay.
 *
 * @param tcp  must outlive the port
 * @return the port; its read and write set `error` to errno when the link is lost
 */
mbm_port mbm_tcp_port(mbm_tcp *tcp);

/**
 * Begins to listen for connections.
 *
 * @param listener  initialised with MBM_INIT, or closed before
 * @param host      the address to listen at; NULL for all addresses of the machine
 * @param service   a port number; "0" for a free one, which is then in `port`
 * @return 0, or -1 with errno set: EBUSY if the listener is in use, EADDRINUSE, EACCES for
 *         a port below 1024 without the right to it, or an error of mbm_tcp_open
 */
int mbm_tcp_listen(mbm_tcp_listener *listener, const char *host, const char *service);

/**
 * Accepts a connection that waits. Call it in every round of the program's loop, until it
 * returns -1. If the listener is in a set, the connection joins that set, and a call costs
 * next to nothing while the set has found no waiting connection.
 *
 * If a connection waits and every place is in use, the connection that has been idle for
 * longest is closed, if it has been idle for the listener's `idleTimeMs`. Its link is lost:
 * its server's next poll returns MBM_LINK_LOST, the program frees the place, and the next
 * call accepts the new connection. If no connection is idle, the waiting connections are
 * closed, so that their clients know at once.
 *
 * If the system has no descriptor or no memory for a connection, the connection that has
 * been idle for longest is closed in the same way. If none is idle, the waiting connections
 * are closed too: for them the listener has a spare descriptor. Only if the system refuses
 * even this, connections wait in its queue, and mbm_tcp_wait sleeps for at most
 * MBM_TCP_RETRY.
 *
 * @param listener  where connections arrive
 * @param tcps      the places for connections
 * @param count     number of places; a place is free if it is zeroed or closed
 * @return the index of the place, or -1 with errno set: EAGAIN if there is nothing to
 *         accept now, EMFILE, ENFILE, ENOBUFS or ENOMEM if connections must wait, or an
 *         error of accept
 */
int mbm_tcp_accept(mbm_tcp_listener *listener, mbm_tcp *tcps, size_t count);

/** Stops listening. Connections stay. */
void mbm_tcp_closeListener(mbm_tcp_listener *listener);

/**
 * Sleeps until one of a few sockets needs the program, or a time is over. A socket needs it
 * when bytes or a connection have arrived, when it is connected or its link is lost, or
 * when a full socket accepts bytes again. Bytes and the end of a stream that were reported
 * do not end the wait again until the program has used the port: a client without requests,
 * and a server whose function is pending, read none.
 *
 * @param tcps      the sockets; those that are free or lost are skipped
 * @param count     number of sockets, at most MBM_TCP_WAITS - 2
 * @param listener  waits for connections too; may be NULL
 * @param fd        waits for bytes of another descriptor too, for example that of
 *                  an mbm_tty; -1 for none
 * @param timeoutUs the longest sleep in microseconds, from 100000 on rounded up to the next
 *                  millisecond, or MBM_TCP_FOREVER; it is shorter while the listener's
 *                  connections must wait
 * @return 1 if a socket needs the program, or if the system refused to poll, after a sleep
 *         of at most 10 ms; 0 if the time is over or a signal came; -1 with errno EINVAL
 *         for too many sockets
 */
int mbm_tcp_wait(mbm_tcp *tcps, size_t count, const mbm_tcp_listener *listener, int fd,
                 uint32_t timeoutUs);

/**
 * Begins a set without sockets. It takes one descriptor.
 *
 * @param set  initialised with MBM_INIT, or closed before
 * @return 0, or -1 with errno set: EBUSY if the set is open, or an error of epoll_create1
 */
int mbm_tcp_openSet(mbm_tcp_set *set);

/**
 * Adds a socket to a set. It stays there until mbm_tcp_close, also when it connects anew.
 *
 * @param set  an open set
 * @param tcp  a socket in use, in no set yet
 * @return 0, or -1 with errno set: EBADF for a set that is not open or a socket that is
 *         free, EBUSY for a socket that is in a set, or an error of epoll_ctl
 */
int mbm_tcp_add(mbm_tcp_set *set, mbm_tcp *tcp);

/** Takes a socket out of its set and leaves it open. Does nothing if it is in no set. */
void mbm_tcp_remove(mbm_tcp *tcp);

/**
 * Adds a listener to a set, and with it each connection that mbm_tcp_accept will accept.
 * The listener stays there until mbm_tcp_closeListener.
 *
 * @param set       an open set, without a listener
 * @param listener  a listener in use, in no set
 * @return 0, or -1 with errno set, as of mbm_tcp_add
 */
int mbm_tcp_addListener(mbm_tcp_set *set, mbm_tcp_listener *listener);

/**
 * Sleeps until a socket of the set needs the program, as with mbm_tcp_wait, or a connection
 * can be accepted, or a time is over. Its work grows with the number of sockets that are
 * ready, not with the number of all sockets.
 *
 * @param set     an open set
 * @param timeoutUs  the longest sleep in microseconds, rounded up to milliseconds, or
 *                MBM_TCP_FOREVER; it is shorter while the listener's connections must wait
 * @return 1 if a socket is ready or a connection waits: see mbm_tcp_nextReady and
 *         mbm_tcp_accept; 0 if the time is over or a signal came; -1 with errno EBADF for a
 *         set that is not open
 */
int mbm_tcp_waitSet(mbm_tcp_set *set, uint32_t timeoutUs);

/**
 * Returns the next of the sockets that mbm_tcp_waitSet found ready. Poll its client or
 * server. Connections that mbm_tcp_accept closed as idle are among them, those that the
 * program has closed meanwhile are not.
 *
 * @param set  an open set
 * @return the socket; NULL if there is none
 */
mbm_tcp *mbm_tcp_nextReady(mbm_tcp_set *set);

/** Ends a set. Close its sockets and its listener before. Does nothing if the set is not open. */
void mbm_tcp_closeSet(mbm_tcp_set *set);

/* Private: shared by the sources of this port. */
enum {
    MBM_TCP_REPORTED =
        1, /* in mbm_tcp.readiness: a wait reported it, and the port was not used since */
    MBM_TCP_LISTED = 2 /* mbm_tcp_nextReady has not returned it yet */
};
struct addrinfo;
int mbm_tcp_lookUp(const char *host, const char *service, int flags, struct addrinfo **found,
                   int *error);
int64_t mbm_tcp_milliseconds(void);
/* No call waits for the socket, and no program that this one starts inherits it. */
int mbm_tcp_setFlags(int fd);
void mbm_tcp_markReady(mbm_tcp *tcp);
void mbm_tcp_noteEvents(mbm_tcp *tcp, uint32_t events);
void mbm_tcp_setEvents(mbm_tcp *tcp, uint8_t events);

#ifdef __cplusplus
}
#endif

#endif
