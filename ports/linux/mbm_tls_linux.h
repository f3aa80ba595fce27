/**
 * @file mbm_tls_linux.h
 * @brief What a program on Linux needs beside mbm_tls.h: random bytes, certificates from
 *        files, and one wait for connections over sockets of mbm_tcp.h.
 *
 * Licence: MIT OR Apache-2.0.
 */
#ifndef MBM_TLS_LINUX_H
#define MBM_TLS_LINUX_H

#include "mbm_tcp.h"
#include "mbm_tls.h"

#ifdef __cplusplus
extern "C" {
#endif

/** The longest file of certificates, in bytes. */
#define MBM_TLS_FILE_BYTES 16384

/** The files of an identity. The program provides the memory, mbm_tls_load fills it. */
typedef struct mbm_tls_files {
    uint8_t certificate[MBM_TLS_FILE_BYTES]; /**< private */
    uint8_t authorities[MBM_TLS_FILE_BYTES]; /**< private */
    uint8_t key[MBM_TLS_FILE_BYTES];         /**< private */
} mbm_tls_files;

/**
 * The system's random bytes, for mbm_tls_options.random.
 *
 * @param context  ignored
 * @param bytes    filled
 * @param count    number of bytes
 * @return 0, or a negative number if the system fails
 */
int mbm_tls_random(void *context, unsigned char *bytes, size_t count);

/**
 * Reads three files, PEM or DER, and sets the fields of the options that are for them, and
 * `random`.
 *
 * @param files        filled; must stay until mbm_tls_end, since DER is not copied
 * @param options      changed only if this succeeds
 * @param certificate  the path of this device's certificate
 * @param key          the path of its key
 * @param authorities  the path of the authorities' certificates
 * @return 0, or -1 with errno set: EFBIG for a file that is too long, ENODATA for an empty
 *         one, or an error of open or read
 */
int mbm_tls_load(mbm_tls_files *files, mbm_tls_options *options, const char *certificate,
                 const char *key, const char *authorities);

/** Overwrites the key with zeros. Call it after mbm_tls_begin, which has copied the key. */
void mbm_tls_forgetKey(mbm_tls_files *files);

/**
 * Begins to listen for clients of Modbus/TCP Security, as mbm_tcp_listen does. The system keeps
 * a connection back until its client has sent something, if it can, as Linux does. In
 * mbm_tls_listener.c.
 *
 * @param listener  as for mbm_tcp_listen
 * @param host      as for mbm_tcp_listen
 * @param service   as for mbm_tcp_listen, for example MBM_TLS_SERVICE
 * @return as mbm_tcp_listen
 */
int mbm_tls_listen(mbm_tcp_listener *listener, const char *host, const char *service);

/**
 * Accepts a connection that waits, and begins its handshake. Call it once in every round of
 * the program's loop: then a flood of connections does not keep the program from those that
 * it serves. In mbm_tls_listener.c.
 *
 * If a connection waits and every place is in use, one whose handshake is not finished is
 * closed for it. It belongs to the address that has the most of them (with IPv6 to the network of
 * 64 bits), and is the oldest of those that have come least far. A finished connection is closed
 * only as mbm_tcp_accept does it, after the listener's `idleTimeMs`. If there is none of either,
 * the new connection is closed.
 *
 * @param listener  where connections arrive
 * @param identity  a server's; must outlive the connections
 * @param tlss      the connections
 * @param tcps      their sockets, in the same order: the places
 * @param count     number of both
 * @return the index of the place, whose server the program begins anew; or -1 with errno set
 *         as by mbm_tcp_accept, ENOMEM also if Mbed TLS got no memory
 */
int mbm_tls_accept(mbm_tcp_listener *listener, const mbm_tls_identity *identity, mbm_tls *tlss,
                   mbm_tcp *tcps, size_t count);

/**
 * Sleeps as mbm_tcp_wait does, but not while a connection has received bytes that no socket
 * would report, and not longer than a handshake may take.
 *
 * @param tlss       the connections; that of a free socket is closed
 * @param tcps       their sockets, in the same order
 * @param count      number of both, at most MBM_TCP_WAITS - 2
 * @param listener   as for mbm_tcp_wait
 * @param fd         as for mbm_tcp_wait
 * @param timeoutUs  as for mbm_tcp_wait
 * @return as mbm_tcp_wait; 1 also if a connection needs the program
 */
int mbm_tls_wait(mbm_tls *tlss, mbm_tcp *tcps, size_t count, const mbm_tcp_listener *listener,
                 int fd, uint32_t timeoutUs);

#ifdef __cplusplus
}
#endif

#endif
