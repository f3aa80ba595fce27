/**
 * @file mbm_tcp.h
 * @brief An mbm_port over a TCP socket, and the hooks that reconnect it.
 *
 * Nothing waits: a connection is opened in the background, and until it stands
 * the port takes no bytes. A connection that fails or is closed by the far end is
 * a lost link.
 *
 * Licence: MIT OR Apache-2.0.
 */
#ifndef MBM_TCP_H
#define MBM_TCP_H

#include "mbm.h"

#ifdef __cplusplus
extern "C" {
#endif

/** A TCP socket in use as a port. */
typedef struct mbm_tcp {
    int fd;             /**< the socket, for poll and select; -1 without one */
    const char *host;   /**< the host, to reconnect to */
    const char *service; /**< the port there */
    uint8_t connecting; /**< 1 until the connection stands */
} mbm_tcp;

/**
 * Begins to connect to a device; does not wait for the connection.
 *
 * @param tcp      receives the socket
 * @param host     an address or a name; must outlive `tcp`. A name is looked up,
 *                 which may take time; an address is not
 * @param service  the port, "502" for most devices; must outlive `tcp`
 * @return 0, or -1 with errno set
 */
int mbm_tcp_open(mbm_tcp *tcp, const char *host, const char *service);

/** Uses a socket that is connected already; makes it non-blocking. It cannot be
 * reconnected. */
int mbm_tcp_attach(mbm_tcp *tcp, int fd);

/** Closes the socket. */
void mbm_tcp_close(mbm_tcp *tcp);

/** Whether the connection does not stand yet: wait for the socket to become
 * writable then, as well as readable. */
uint8_t mbm_tcp_is_connecting(const mbm_tcp *tcp);

/** The port to give to mbm_client_beginTcp; `tcp` must outlive it. */
mbm_port mbm_tcp_port(mbm_tcp *tcp);

/** The hooks to give to mbm_client_reconnect; `tcp` must outlive them. */
mbm_link mbm_tcp_link(mbm_tcp *tcp);

#ifdef __cplusplus
}
#endif

#endif
