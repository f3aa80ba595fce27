/**
 * @file mbm_lwip.h
 * @brief An mbm_port over lwIP's raw API: Modbus TCP without sockets, for clients and servers.
 *
 * mbm_lwip.c is the port. A server needs mbm_lwip_listener.c too. Both work with lwIP 2.0 and
 * later, with and without an operating system. Nothing here waits, and nothing is allocated but
 * what lwIP takes for a connection.
 *
 * lwIP allows its raw API in one thread at a time. There are two ways to keep to that:
 *
 * - All calls are made where lwIP runs: in the main loop of NO_SYS, in tcpip_thread, by
 *   tcpip_callback or sys_timeout, or by a task that holds the lock of the core. This is the
 *   default.
 * - Each call takes the lock of the core itself. Then clients and servers are polled by a task
 *   of yours, which must not hold the lock. Set `isTask` of a client's connection and of a
 *   listener. mbm_lwip_listen sets that of the places.
 *
 * Functions return a status of mbm.h: MBM_INVALID_ARGUMENT for NULL, and for `isTask` if lwIP is
 * compiled without the lock (LWIP_TCPIP_CORE_LOCKING).
 *
 * Licence: MIT OR Apache-2.0.
 */
#ifndef MBM_LWIP_H
#define MBM_LWIP_H

#include "mbm.h"

#include "lwip/tcp.h"

#ifdef __cplusplus
extern "C" {
#endif

#if !LWIP_TCP
#error "mbm's port for lwIP needs TCP: set LWIP_TCP to 1 in lwipopts.h."
#endif
#if !LWIP_CALLBACK_API
#error "mbm's port for lwIP needs its callbacks: set LWIP_CALLBACK_API to 1 in lwipopts.h."
#endif

/** The TCP port of Modbus. */
#define MBM_LWIP_PORT 502

/* A peer may send many small segments while its server is away, and each takes a pbuf, from which
 * the other connections and the network driver live too. */
#ifndef MBM_LWIP_PBUFS
/** Most pbufs with received bytes that a connection holds. What comes beyond them stays
 * unacknowledged, and the peer sends it again later. */
#define MBM_LWIP_PBUFS (PBUF_POOL_SIZE / 2)
#endif

/** Milliseconds after which a connection is lost if the peer has acknowledged nothing of what was
 *  sent. */
#ifndef MBM_LWIP_UNACKNOWLEDGED_MS
#define MBM_LWIP_UNACKNOWLEDGED_MS 30000u
#endif

/** A connection in use as a port. Zero it, and keep it where it is. */
typedef struct mbm_lwip {
    /** Optional, set by the program: called by lwIP's callbacks when bytes have come, the
     * connection was made or lost, and while bytes wait to be sent, when lwIP may take them: at
     * least twice a second. It runs where lwIP runs. With `isTask` it may only wake the task.
     * Without, it may poll the client or server. */
    void (*ready)(void *context);
    void *context;     /**< set by the program: passed to `ready` */
    uint8_t isTask;    /**< set by the program: 1 if a task makes the calls, which does not hold the
                          lock of lwIP's core: each call takes it */
    uint8_t isBusy;    /**< set by the program: 1 while the peer waits for a response, so that the
                            connection is not idle; needed only for requests that may take longer than
                            the idle time of the listener */
    err_t error;       /**< why there is no link, an err_t of lwIP; mbm_lwip_text says it in words.
                            ERR_INPROGRESS while the connection is being made; ERR_RST if the peer
                            refused or reset it, ERR_CLSD if it closed it; ERR_TIMEOUT if nothing has
                            answered, or if the listener took the place of an idle connection;
                            ERR_ABRT if the peer acknowledges nothing, or the interface has another
                            address; ERR_RTE if no interface that is up leads to the peer; ERR_MEM;
                            ERR_CONN after mbm_lwip_disconnect; ERR_OK while there is a link */
    uint8_t state;     /**< private */
    uint8_t flags;     /**< private */
    u16_t port;        /**< private */
    ip_addr_t address; /**< private */
    struct tcp_pcb *pcb;     /**< private */
    struct tcp_pcb *calling; /**< private */
    struct pbuf *received;   /**< private */
    u16_t taken;             /**< private */
    u32_t activeMs;          /**< private */
    u32_t progressMs;        /**< private */
} mbm_lwip;

/** Where connections arrive. Zero it, and keep it where it is. */
typedef struct mbm_lwip_listener {
    void (*ready)(void *context); /**< as of mbm_lwip, for a new connection */
    void *context;                /**< set by the program: passed to `ready` */
    uint8_t isTask;               /**< as of mbm_lwip */
    err_t error;      /**< why mbm_lwip_listen failed: ERR_USE if the TCP port is taken, ERR_MEM */
    u32_t idleTimeMs; /**< set by the program: milliseconds without a byte read or written after
                           which a connection may be closed for a new one; 0: never */
    u32_t refused;    /**< number of connections that were reset for lack of a place */
    u32_t idle;       /**< number of connections that were closed because they were idle */
    u32_t shortages;  /**< number of connections for which lwIP had no memory: their clients try
                           again; raise MEMP_NUM_TCP_PCB */
    struct tcp_pcb *pcb; /**< private */
    mbm_lwip *places;    /**< private */
    uint16_t count;      /**< private */
} mbm_lwip_listener;

/**
 * Notes a server, and begins to connect to it. If that fails, `link` is in use all the same, and
 * its link is lost: mbm_lwip_connect tries again, which an mbm_link does by itself. So a program
 * may begin before the network is there.
 *
 * @param link     `ready`, `context` and `isTask` may be set, all else is zero; or closed before
 * @param address  the server's address; copied
 * @param port     the server's TCP port, usually MBM_LWIP_PORT
 * @return MBM_PENDING while the connection is being made; MBM_LINK_LOST, with the reason in
 *         `error`; MBM_BUSY if `link` is in use; MBM_INVALID_ARGUMENT also for port 0 and the
 *         address 0.0.0.0
 */
uint8_t mbm_lwip_open(mbm_lwip *link, const ip_addr_t *address, uint16_t port);

/** Closes the connection, and frees the place for a listener. Does nothing if the place is free
 *  already. What was written before still leaves. */
void mbm_lwip_close(mbm_lwip *link);

/**
 * Returns whether a place is in use. It is from mbm_lwip_open or mbm_lwip_accept until
 * mbm_lwip_close, also after the link was lost.
 *
 * @return 1 if it is in use, 0 if it is free; a zeroed one is free
 */
int mbm_lwip_isInUse(const mbm_lwip *link);

/**
 * Connects to the server of mbm_lwip_open, and does not wait for it. A connection that is there
 * is ended before. A hook of mbm_linkHooks.
 *
 * @param context  an mbm_lwip
 * @return MBM_PENDING while the connection is being made; MBM_LINK_LOST with the reason in `error`:
 *         ERR_CONN if no server was noted
 */
uint8_t mbm_lwip_connect(void *context);

/**
 * Ends the connection, or the attempt to make it. Bytes that the peer has not acknowledged are
 * given up, so that no request is carried out later. The link is lost until mbm_lwip_connect. A
 * hook of mbm_linkHooks.
 *
 * @param context  an mbm_lwip
 */
void mbm_lwip_disconnect(void *context);

/**
 * Returns whether there is a connection, as far as lwIP knows. A hook of mbm_linkHooks. The end of
 * the stream is seen only after all bytes were read.
 *
 * @param context  an mbm_lwip
 * @return MBM_OK, MBM_PENDING while the connection is being made, MBM_CONNECT_TIMED_OUT if nothing
 *         has answered, or MBM_LINK_LOST
 */
uint8_t mbm_lwip_status(void *context);

/** Returns in words why there is no link, for an `error` of a connection or a listener. */
const char *mbm_lwip_text(err_t error);

/**
 * Returns the hooks for mbm_link_begin, for a client of the server of mbm_lwip_open.
 *
 * @param link  in use; must outlive the mbm_link
 */
static inline mbm_linkHooks mbm_lwip_link(mbm_lwip *link)
{
    mbm_linkHooks hooks;

    hooks.context = link;
    hooks.disconnect = mbm_lwip_disconnect;
    hooks.connect = mbm_lwip_connect;
    hooks.status = mbm_lwip_status;
    return hooks;
}

/**
 * Returns the port for the begin functions. It may be made before the connection is, stays valid
 * when it is closed and opened again, and may be given to several objects.
 *
 * A client never sends into a network that is down: if no interface that is up leads to
 * the server, the link is lost at once. Otherwise lwIP would send the request once the
 * network is back, which may be long after the program has given it up.
 *
 * @param link  must outlive the port
 */
mbm_port mbm_lwip_port(mbm_lwip *link);

/**
 * Begins to listen for connections.
 *
 * @param listener  `ready`, `context`, `isTask` and `idleTimeMs` may be set, all else is zero; or
 *                  closed before
 * @param address   the address to listen at; NULL for all addresses
 * @param port      the TCP port, usually MBM_LWIP_PORT
 * @param places    the places for connections, zeroed; their `ready` and `context` may be set.
 *                  They must stay until mbm_lwip_closeListener
 * @param count     number of places, at least 1. lwIP needs as many MEMP_NUM_TCP_PCB, and two more
 * @return MBM_OK; MBM_BUSY if it listens already, or a place is in use; MBM_LINK_LOST with the
 * reason in `error`; MBM_INVALID_ARGUMENT also for port 0 and for no place
 */
uint8_t mbm_lwip_listen(mbm_lwip_listener *listener, const ip_addr_t *address, uint16_t port,
                        mbm_lwip *places, uint16_t count);

/**
 * Hands over a connection that has arrived. Call it in every round of the program's loop, until it
 * returns -1, and begin a server for the connection.
 *
 * A new connection takes a place that is free. If none is, it takes one whose connection was lost,
 * else that of the connection that has been idle for longest, if it has been idle for
 * `idleTimeMs`: the port reports the loss of the old connection, the program closes it, and the
 * next mbm_lwip_accept hands over the new one. If there is no such place, the new connection is
 * reset, so that its client knows at once.
 *
 * @return the index of the place, or -1 if no connection has arrived
 */
int mbm_lwip_accept(mbm_lwip_listener *listener);

/** Stops listening. Connections that were handed over stay; the others are closed. */
void mbm_lwip_closeListener(mbm_lwip_listener *listener);

/* --- between the files of the port */

enum { MBM_LWIP_FREE, MBM_LWIP_CONNECTING, MBM_LWIP_CONNECTED, MBM_LWIP_LOST };
enum {
    MBM_LWIP_HAS_SERVER = 1,   /* mbm_lwip_open has noted one */
    MBM_LWIP_IS_NEW = 2,       /* the connection was not handed over yet */
    MBM_LWIP_IS_SUCCESSOR = 4, /* the program has not closed the connection before it */
    MBM_LWIP_IS_ENDED = 8,     /* the peer sends no more */
    MBM_LWIP_WAITS = 16        /* bytes wait until lwIP takes them */
};

/* Takes and gives the lock of lwIP's core, if a task makes the calls. */
#if !NO_SYS && LWIP_TCPIP_CORE_LOCKING
#include "lwip/tcpip.h"
#define MBM_LWIP_CAN_LOCK 1
#define MBM_LWIP_TAKE(object)                                                                      \
    do {                                                                                           \
        if ((object)->isTask)                                                                      \
            LOCK_TCPIP_CORE();                                                                     \
    } while (0)
#define MBM_LWIP_GIVE(object)                                                                      \
    do {                                                                                           \
        if ((object)->isTask)                                                                      \
            UNLOCK_TCPIP_CORE();                                                                   \
    } while (0)
#else
#define MBM_LWIP_CAN_LOCK 0
#define MBM_LWIP_TAKE(object) ((void)(object))
#define MBM_LWIP_GIVE(object) ((void)(object))
#endif

void mbm_lwip_adopt(mbm_lwip *link, struct tcp_pcb *pcb, uint8_t state);
void mbm_lwip_leave(mbm_lwip *link, uint8_t state, err_t error, uint8_t isHard);
void mbm_lwip_reset(mbm_lwip *link, err_t error);

#ifdef __cplusplus
}
#endif

#endif
