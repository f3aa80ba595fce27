/**
 * @file mbm_tcp.h
 * @brief An mbm_port over a TCP socket, for clients and for servers.
 *
 * mbm_tcp.c is the port. A server compiles mbm_tcp_listener.c too, and one with many
 * connections, on Linux, mbm_tcp_set.c.
 *
 * Nothing waits but mbm_tcp_wait, mbm_tcp_waitSet, and the lookup of a name that is no numeric
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

/** Most sockets of a set that one mbm_tcp_waitSet tells of; the others come next. */
#define MBM_TCP_READY 64

/** Microseconds after which to call mbm_tcp_accept again where it found no descriptor. */
#define MBM_TCP_RETRY 100000u

/** The addresses of a server, for a client that connects to it. Yours, and set by
 *  mbm_tcp_open. */
typedef struct mbm_tcp_addresses {
    uint8_t count;                                   /**< private */
    uint8_t next;                                    /**< private */
    socklen_t lengths[MBM_TCP_ADDRESSES];            /**< private */
    struct sockaddr_storage list[MBM_TCP_ADDRESSES]; /**< private */
} mbm_tcp_addresses;

/** A socket in use as a port; zero before first use. */
typedef struct mbm_tcp {
    int fd;            /**< the socket, while it is there */
    int error;         /**< errno of what lost the link, EPIPE if the peer closed it, ETIMEDOUT if
                            mbm_tcp_accept closed it as idle; else 0 */
    int lookup;        /**< why mbm_tcp_open found no address, for gai_strerror; else 0 */
    uint8_t isBusy;    /**< yours: 1 while a response to the peer is to come, so that the connection
                            is not idle; only for requests that may take longer than the idle time */
    uint8_t state;     /**< private */
    uint8_t awaits;    /**< what to poll it for: POLLIN, and POLLOUT while it takes no more */
    uint8_t told;      /**< private */
    int64_t lastMoved; /**< private */
    mbm_tcp_addresses *addresses; /**< private */
    struct mbm_tcp_set *set;      /**< private */
    struct mbm_tcp *next;         /**< private */
} mbm_tcp;

/** A socket that connections come to; zero before first use. */
typedef struct mbm_tcp_listener {
    int fd;              /**< the socket, while `port` is not 0 */
    int lookup;          /**< why mbm_tcp_listen found no address, for gai_strerror; else 0 */
    uint16_t port;       /**< where it listens */
    uint8_t awaits;      /**< what to poll it for: POLLIN, or 0 while connections can only wait */
    uint8_t isQuiet;     /**< private */
    uint32_t idleTimeMs; /**< yours: milliseconds without a byte read or written after which a
                            connection may be closed to make room for another; 0: never */
    uint32_t refused;    /**< connections that were turned away without a place */
    uint32_t idle;       /**< connections that were closed because they were idle */
    int64_t retryAt;     /**< private */
    struct mbm_tcp_set *set; /**< private */
} mbm_tcp_listener;

/** Any number of sockets, of which one wait says which are ready; zero before first use. */
typedef struct mbm_tcp_set {
    int fd;                     /**< the descriptor of epoll: a program that polls other descriptors
                                     too polls it for POLLIN, and then calls mbm_tcp_waitSet */
    uint8_t isOpen;             /**< private */
    int64_t now;                /**< private */
    mbm_tcp *first;             /**< private */
    mbm_tcp **end;              /**< private */
    mbm_tcp_listener *listener; /**< private */
    int (*watch)(struct mbm_tcp_set *set, int fd, void *who, uint8_t before,
                 uint8_t awaits);                      /**< private */
    int (*add)(struct mbm_tcp_set *set, mbm_tcp *tcp); /**< private */
} mbm_tcp_set;

/**
 * Begins to connect to a server, and does not wait for it. Until it is there the
 * port reads and takes nothing; if it does not come to be, the link is lost.
 *
 * @param tcp        zeroed, or closed before
 * @param addresses  filled here; must stay until `tcp` is closed, and serves one `tcp`
 * @param host       a name or a numeric address; a name may take the time of a lookup.
 *                   NULL is this machine. Of several addresses the first that
 *                   answers is taken
 * @param service    a port number, for example MBM_TCP_SERVICE
 * @return 0, or -1 with errno set: EBUSY if it is in use, EADDRNOTAVAIL for a name
 *         or service that is unknown, EAGAIN if the lookup may go well later, or as
 *         of socket and connect. Where it is the lookup that failed, `lookup` says why
 */
int mbm_tcp_open(mbm_tcp *tcp, mbm_tcp_addresses *addresses, const char *host, const char *service);

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
 * Whether a place is in use: from mbm_tcp_open, mbm_tcp_attach or mbm_tcp_accept until
 * mbm_tcp_close, also while the connection is being made and after it was lost.
 *
 * @param tcp  the place
 * @return 1 if it is in use, 0 if it is free; a zeroed one is free
 */
int mbm_tcp_isInUse(const mbm_tcp *tcp);

/**
 * How long a connection has been idle: since the port last read or wrote a byte.
 *
 * @param tcp  the socket
 * @return milliseconds, or -1 if there is no connection
 */
int64_t mbm_tcp_idleFor(const mbm_tcp *tcp);

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
 * The port to give to the begin functions. It may be made before the socket is open,
 * stays valid when it is closed and opened again, and may be given to several objects.
 * While a blocking call of a master waits, the port sleeps until bytes arrive, at most
 * as long as mbm_master_pollDelay of that master says.
 *
 * @param tcp  must outlive the port
 * @return the port; its read and write keep errno in `error` when the link is lost
 */
mbm_port mbm_tcp_port(mbm_tcp *tcp);

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
 * Takes a connection that waits. Call it in every round of the program's loop, until it
 * returns -1. Where the listener is in a set, the connection joins that set, and a call
 * costs next to nothing while the set knows of no connection that waits.
 *
 * Where every place is in use and a connection waits, the connection that has been idle
 * for longest is closed, if it has been idle for the listener's `idleTimeMs`. Its link is
 * lost: its server's next poll returns MBM_LINK_LOST, the program frees the place, and
 * the next call takes the new connection. Where none is idle, the connections that wait
 * are closed, so that their clients know at once.
 *
 * Where the system has no descriptor or no memory for a connection, the one that has
 * been idle for longest makes room in the same way. Where none is idle, connections wait
 * in the system's queue; mbm_tcp_wait then sleeps for at most MBM_TCP_RETRY.
 *
 * @param listener  where connections arrive
 * @param tcps      the places for connections
 * @param count     how many; each is free if zeroed or closed
 * @return the index of the place, or -1 with errno set: EAGAIN if there is nothing to
 *         take now, EMFILE, ENFILE, ENOBUFS or ENOMEM if connections can only wait, or
 *         as of accept
 */
int mbm_tcp_accept(mbm_tcp_listener *listener, mbm_tcp *tcps, size_t count);

/**
 * Listens no more; connections stay.
 *
 * @param listener  the socket
 */
void mbm_tcp_closeListener(mbm_tcp_listener *listener);

/**
 * Sleeps until one of a few sockets has something to do, or a time is over:
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
 * @param timeoutUs    at most so long, in microseconds, from 100000 on to the next
 *                  millisecond, or MBM_TCP_FOREVER; less while the listener's connections
 *                  can only wait
 * @return 1 if there is something, or if the system refused to poll, after a sleep of at
 *         most 10 ms; 0 if the time is over or a signal came; -1 with errno EINVAL for
 *         too many
 */
int mbm_tcp_wait(mbm_tcp *tcps, size_t count, const mbm_tcp_listener *listener, int fd,
                 uint32_t timeoutUs);

/**
 * Begins a set without sockets. It takes one descriptor.
 *
 * @param set  zeroed, or closed before
 * @return 0, or -1 with errno set: EBUSY if it is open, or as of epoll_create1
 */
int mbm_tcp_openSet(mbm_tcp_set *set);

/**
 * Puts a socket into a set. It stays there, also when it connects anew, until
 * mbm_tcp_close.
 *
 * @param set  an open set
 * @param tcp  a socket in use, in no set yet
 * @return 0, or -1 with errno set: EBADF for a set that is not open or a socket that is
 *         free, EBUSY for one that is in a set, or as of epoll_ctl
 */
int mbm_tcp_add(mbm_tcp_set *set, mbm_tcp *tcp);

/**
 * Puts a listener into a set, and with it each connection that mbm_tcp_accept will take.
 * It stays there until mbm_tcp_closeListener.
 *
 * @param set       an open set, without a listener
 * @param listener  one that listens, in no set
 * @return 0, or -1 with errno set, as mbm_tcp_add
 */
int mbm_tcp_addListener(mbm_tcp_set *set, mbm_tcp_listener *listener);

/**
 * Sleeps until a socket of the set has something to do, as mbm_tcp_wait does, or a
 * connection can be taken, or a time is over. What it does grows with the sockets that
 * are ready, not with those that are there.
 *
 * @param set     an open set
 * @param timeoutUs  at most so long, in microseconds, rounded up to milliseconds, or
 *                MBM_TCP_FOREVER; less while the listener's connections can only wait
 * @return 1 if there is something: see mbm_tcp_nextReady and mbm_tcp_accept; 0 if the
 *         time is over or a signal came; -1 with errno EBADF for a set that is not open
 */
int mbm_tcp_waitSet(mbm_tcp_set *set, uint32_t timeoutUs);

/**
 * Takes the next of the sockets that mbm_tcp_waitSet found ready: poll its client or
 * server. A connection that mbm_tcp_accept closed as idle is among them. One that was
 * closed meanwhile is not.
 *
 * @param set  an open set
 * @return the socket; NULL if there is none
 */
mbm_tcp *mbm_tcp_nextReady(mbm_tcp_set *set);

/**
 * Ends a set. Close its sockets and its listener before. Nothing happens if it is not
 * open.
 *
 * @param set  the set
 */
void mbm_tcp_closeSet(mbm_tcp_set *set);

/* Shared by the sources of this port; not for programs. */
enum {
    MBM_TCP_TOLD = 1,  /* of mbm_tcp.told: a wait told of it, and the port was not used since */
    MBM_TCP_LISTED = 2 /* mbm_tcp_nextReady has not returned it yet */
};
struct addrinfo;
int mbm_tcp_lookUp(const char *host, const char *service, int flags, struct addrinfo **found,
                   int *why);
int64_t mbm_tcp_milliseconds(void);
void mbm_tcp_markReady(mbm_tcp *tcp);
void mbm_tcp_await(mbm_tcp *tcp, uint8_t awaits);

#ifdef __cplusplus
}
#endif

#endif
