/**
 * @file mbm_wiznet.h
 * @brief An mbm_port over the sockets of a WIZnet chip with TCP/IP inside: W5500, W5100S, W5200,
 * W6100.
 *
 * Over WIZnet's ioLibrary_Driver. The chip has its sockets in hardware, eight in a W5500, and each
 * is a client's connection, or listens and then is one connection to a server. Nothing here waits
 * but for a transfer to the chip; a program that has nothing to do polls.
 *
 * The network (wizchip_setnetinfo) and the bus of the chip (reg_wizchip_spi_cbfunc) are the
 * program's. All calls are made by one task, as ioLibrary asks for.
 *
 * Licence: MIT OR Apache-2.0.
 */
#ifndef MBM_WIZNET_H
#define MBM_WIZNET_H

#include "mbm.h"

#ifdef __cplusplus
extern "C" {
#endif

/** The TCP port of Modbus. */
#define MBM_WIZNET_PORT 502

/** A socket of the chip in use as a port. Zero it, set the fields that the function asks for, and
 * keep it where it is. */
typedef struct mbm_wiznet {
    uint8_t number;      /**< set by the program: the number of the chip's socket, from 0 on */
    uint8_t address[4];  /**< set by the program for a client: the server's IPv4 address */
    uint16_t port;       /**< set by the program: the server's TCP port, or that to listen at; 0:
                              MBM_WIZNET_PORT */
    uint16_t localPort;  /**< set by the program for a client, or 0: the first local port, 49152 to
                              65279. A board that starts anew with the same ports may find its old
                              connections still open at the server: take a random one */
    uint32_t idleTimeMs; /**< set by the program for a server: milliseconds without a byte after
                            which the connection is closed, at most 4000000; 0: never. The chip does
                            not say that another client waits */
    uint32_t (*micros)(void *context); /**< set by the program: a clock in microseconds that wraps
                              at 2^32; a millisecond tick times 1000 will do */
    void *context;                     /**< set by the program: passed to `micros` */
    int8_t error;  /**< why there is no link, a SOCKERR_ of ioLibrary: SOCKERR_SOCKINIT if the chip
                        has no address or does not answer; SOCKERR_TIMEOUT if the peer has not
                        answered, or was idle; SOCKERR_SOCKCLOSED if it closed, reset or refused
                        the connection, or the program ended it; 0 while there is a link */
    uint8_t state; /**< private */
    uint32_t activeUs; /**< private */
} mbm_wiznet;

/**
 * Begins to connect to the server, and does not wait for it. A connection that there is, is ended
 * before. A hook of mbm_linkHooks, which connects by itself.
 *
 * @param context  an mbm_wiznet with `number`, `address` and `micros`
 * @return MBM_PENDING while the connection is being made, or MBM_LINK_LOST with the reason in
 * `error`
 */
uint8_t mbm_wiznet_connect(void *context);

/**
 * Ends the connection, or the attempt to make it. What the peer has not acknowledged is given up,
 * so that no request is carried out later. The link is lost until mbm_wiznet_connect. A hook of
 * mbm_linkHooks.
 *
 * @param context  an mbm_wiznet
 */
void mbm_wiznet_disconnect(void *context);

/**
 * Returns whether there is a connection. The end of the stream is seen only after all bytes were
 * read. A hook of mbm_linkHooks.
 *
 * @param context  an mbm_wiznet
 * @return MBM_OK, MBM_PENDING while the connection is being made, MBM_CONNECT_TIMED_OUT if nothing
 *         has answered, or MBM_LINK_LOST
 */
uint8_t mbm_wiznet_status(void *context);

/** The hooks for mbm_link_begin, for a client. */
static inline mbm_linkHooks mbm_wiznet_link(mbm_wiznet *chip)
{
    mbm_linkHooks hooks;

    hooks.context = chip;
    hooks.disconnect = mbm_wiznet_disconnect;
    hooks.connect = mbm_wiznet_connect;
    hooks.status = mbm_wiznet_status;
    return hooks;
}

/**
 * Returns the port for the begin functions. It stays valid while the connection comes and goes.
 *
 * @param chip  must outlive the port
 */
mbm_port mbm_wiznet_port(mbm_wiznet *chip);

/**
 * Serves a place: listens while there is no connection, and listens again after one has ended. Call
 * it for each place in every round of the main loop, before its server is polled. Places that share
 * a TCP port are as many connections at once: the chip hands a client to one of those that listen,
 * and refuses it if none does.
 *
 * @param chip  with `number` and `micros`; `port` if it is not MBM_WIZNET_PORT
 * @return 1 once for each new connection: begin its server then; 2 while the connection is there:
 *         poll the server; 0 while there is none; -1 if the chip does not listen, with the reason
 * in `error`: the next call tries again
 */
int mbm_wiznet_serve(mbm_wiznet *chip);

#ifdef __cplusplus
}
#endif

#endif
