/**
 * @file mbm_tls.h
 * @brief An mbm_port inside TLS: Modbus/TCP Security, for clients and for servers.
 *
 * It takes the mbm_port of any byte stream, and makes an mbm_port from it whose bytes cross
 * that stream encrypted: a socket's (mbm_tcp.h), or the one of a microcontroller's network.
 * Both sides prove who they are by a certificate, TLS is 1.2, and the role in the client's
 * certificate is there for the server's hooks (Modbus/TCP Security Protocol Specification
 * V21).
 *
 * mbm_tls.c, mbm_tls_identity.c and the library Mbed TLS (2.28 or 3) are all that is needed.
 * mbm_tls_text.c has the reasons in words. mbm_tls_linux.h has what a program on Linux needs
 * too. This port allocates no memory, but Mbed TLS does: see docs/security.md.
 *
 * No function waits for the peer. The handshake goes on in the port's read and write, and in
 * mbm_tls_poll: each call takes it on by one message at most, so that other connections wait
 * for one computation and no more. One computation may take long on a microcontroller. Until the
 * handshake has succeeded, and after any failure, the port neither reads nor sends a byte of
 * Modbus.
 * No function is re-entrant on one object, nor are two connections of one mbm_tls_identity
 * to be used in two threads.
 *
 * Licence: MIT OR Apache-2.0.
 */
#ifndef MBM_TLS_H
#define MBM_TLS_H

#include "mbm.h"

#include <stddef.h>

#include <mbedtls/ssl.h>
#include <mbedtls/x509_crl.h>
#include <mbedtls/x509_crt.h>

#if !defined(MBEDTLS_SSL_TLS_C) || !defined(MBEDTLS_X509_CRT_PARSE_C)
#error "mbm_tls.h: configure Mbed TLS with MBEDTLS_SSL_TLS_C and MBEDTLS_X509_CRT_PARSE_C"
#endif

#ifdef __cplusplus
extern "C" {
#endif

/** The port of Modbus/TCP Security, as a service of mbm_tcp_open and mbm_tcp_listen. */
#define MBM_TLS_SERVICE "802"

/** The longest role in bytes. A certificate with a longer one is refused. */
#define MBM_TLS_ROLE_BYTES 64

/** The time for a handshake in milliseconds, if the options leave it 0. */
#define MBM_TLS_HANDSHAKE_MS 10000u

/** 1 if Mbed TLS checks the dates of certificates, 0 if it was built without a calendar. */
#ifdef MBEDTLS_HAVE_TIME_DATE
#define MBM_TLS_CHECKS_DATES 1
#else
#define MBM_TLS_CHECKS_DATES 0
#endif

/** What mbm_tls.status says, and what functions return. */
enum {
    MBM_TLS_CLOSED = 0,    /**< not opened, or closed by this side; a function's success */
    MBM_TLS_HANDSHAKE = 1, /**< the handshake goes on */
    MBM_TLS_OPEN = 2,      /**< both sides are authenticated; Modbus may flow */
    MBM_TLS_CLOSING = 3,   /**< this side's close_notify is not sent yet */

    /* The connection ended. */
    MBM_TLS_PEER_CLOSED = 4, /**< the peer ended the session with close_notify */
    MBM_TLS_LINK_LOST = 5,   /**< the stream below was lost, without close_notify */
    MBM_TLS_TIMED_OUT = 6,   /**< the handshake took longer than its time */

    /* The peer and this side do not fit. */
    MBM_TLS_NOT_TLS = 7, /**< the peer's first bytes are not TLS, for example plain Modbus */
    MBM_TLS_NO_COMMON_VERSION = 8,  /**< the peer's TLS is older than 1.2 */
    MBM_TLS_NO_COMMON_CIPHER = 9,   /**< no cipher suite in common, or the peer's TLS is newer */
    MBM_TLS_REFUSED_BY_PEER = 10,   /**< the peer refused the connection; `alert` says why */
    MBM_TLS_NO_CERTIFICATE = 11,    /**< the client sent no certificate */
    MBM_TLS_UNKNOWN_AUTHORITY = 12, /**< no authority of this side signed the peer's certificate */
    MBM_TLS_EXPIRED = 13,           /**< a certificate of the peer is valid no longer */
    MBM_TLS_NOT_YET_VALID = 14,     /**< a certificate of the peer is not valid yet */
    MBM_TLS_REVOKED = 15,           /**< a certificate of the peer is on the revocation list */
    MBM_TLS_OTHER_NAME = 16,        /**< the server's certificate is for another name */
    MBM_TLS_BAD_CERTIFICATE = 17, /**< the peer's certificate is damaged, has a weak key, or is not
                                       for this use */
    MBM_TLS_BAD_ROLE = 18,        /**< the client's role is no UTF8String, empty, longer than
                                       MBM_TLS_ROLE_BYTES, has a zero byte, or there are two */
    MBM_TLS_BAD_STREAM = 19,      /**< damaged or forged records, or messages out of order */

    /* This side. */
    MBM_TLS_OWN_CERTIFICATE = 20, /**< the options' certificate cannot be read */
    MBM_TLS_OWN_KEY = 21, /**< the options' key cannot be read, or is for another certificate */
    MBM_TLS_OWN_AUTHORITIES = 22, /**< the options' authorities cannot be read */
    MBM_TLS_OWN_REVOKED = 23,     /**< the options' revocation list cannot be read */
    MBM_TLS_NO_MEMORY = 24,       /**< Mbed TLS got no memory */
    MBM_TLS_IN_USE = 25,          /**< the object is in use: close it first */
    MBM_TLS_INVALID_ARGUMENT = 26,
    MBM_TLS_FAILED = 27,            /**< anything else; `error` has the number of Mbed TLS */
    MBM_TLS_AUTHORITY_EXPIRED = 28, /**< the authority that signed the peer's certificate is one
                                         of the options' authorities, and valid no longer */
    MBM_TLS_AUTHORITY_NOT_YET_VALID = 29 /**< the same, and not valid yet */
};

/** Who this device is and whom it trusts, for mbm_tls_begin. PEM, with its terminating zero
 *  counted in the length, or DER. PEM may be freed after mbm_tls_begin. DER of certificates
 *  is not copied, so that it may be in flash: it must stay until mbm_tls_end. */
typedef struct mbm_tls_options {
    const uint8_t *certificate; /**< this device's; in PEM followed by those that signed it */
    size_t certificateBytes;    /**< its length */
    const uint8_t *key;         /**< the private key of the certificate, RSA or EC */
    size_t keyBytes;            /**< its length */
    const char *keyPassword;    /**< of the key, or NULL */
    const uint8_t *authorities; /**< the authorities whose certificates the peer may have;
                                     several only in PEM */
    size_t authoritiesBytes;    /**< their length */
    const uint8_t *revoked;     /**< optional: revocation lists of these authorities, copied */
    size_t revokedBytes;        /**< their length */
    int (*random)(void *context, unsigned char *bytes, size_t count); /**< fills bytes with random
                                       ones that no one can guess, and returns 0; or fails with
                                       another number. mbm_tls_random on Linux; elsewhere for
                                       example mbedtls_ctr_drbg_random */
    void *randomContext;  /**< the first argument of `random` */
    const int *ciphers;   /**< optional: the cipher suites to allow, best first, numbers
                               MBEDTLS_TLS_..., ended by 0; must stay until mbm_tls_end */
    uint32_t handshakeMs; /**< the longest handshake, up to 2000000 ms, with the connecting
                               of the stream below; 0: MBM_TLS_HANDSHAKE_MS */
    uint8_t isServer;     /**< 1 for a server's connections, 0 for a client's */
} mbm_tls_options;

/** Certificates and rules that any number of connections share. Initialise them with MBM_INIT. */
typedef struct mbm_tls_identity {
    int error;                    /**< the number of Mbed TLS for what mbm_tls_begin refused */
    uint8_t isReady;              /**< private */
    uint8_t isServer;             /**< private */
    uint32_t handshakeUs;         /**< private */
    mbedtls_ssl_config config;    /**< private */
    mbedtls_x509_crt certificate; /**< private */
    mbedtls_x509_crt authorities; /**< private */
    mbedtls_x509_crl revoked;     /**< private */
    mbedtls_pk_context key;       /**< private */
} mbm_tls_identity;

/** A connection. Initialise it with MBM_INIT. It is the `context` of its port, so a server's hooks
 *  that get the connection's context get a pointer to it. */
typedef struct mbm_tls {
    uint8_t status; /**< MBM_TLS_CLOSED to MBM_TLS_CLOSING, or why the connection ended */
    uint8_t alert;  /**< for MBM_TLS_REFUSED_BY_PEER: the description of the peer's alert
                         (RFC 5246, 7.2) */
    int error;      /**< the number of Mbed TLS for a connection that failed, or 0 */
    uint32_t flags; /**< what is wrong with the peer's certificates, and with the authority that
                         signed them: MBEDTLS_X509_BADCERT_... */
    uint32_t authorityFlags;            /**< private */
    char role[MBM_TLS_ROLE_BYTES + 1];  /**< private: see mbm_tls_role */
    uint8_t isSetUp;                    /**< private */
    uint8_t isLost;                     /**< private */
    uint8_t isSeen;                     /**< private */
    uint8_t hasBadRole;                 /**< private */
    uint8_t isTold;                     /**< private */
    uint8_t isFirst;                    /**< private */
    uint8_t isDue;                      /**< private */
    uint8_t hasAhead;                   /**< private */
    uint8_t ahead[7];                   /**< private */
    uint8_t sending[MBM_MAX_TCP_FRAME]; /**< private */
    uint16_t sent, toSend;              /**< private */
    uint32_t startedAtUs;               /**< private */
    const mbm_tls_identity *identity;   /**< private */
    mbm_port below;                     /**< private */
    mbm_linkHooks link;                 /**< private */
    mbedtls_ssl_context ssl;            /**< private */
} mbm_tls;

/**
 * Reads certificates and key. It computes, and does not wait.
 *
 * @param identity  initialised with MBM_INIT, or ended before
 * @param options   certificate, key, authorities and random must be given
 * @return 0, or MBM_TLS_OWN_CERTIFICATE, MBM_TLS_OWN_KEY, MBM_TLS_OWN_AUTHORITIES,
 *         MBM_TLS_OWN_REVOKED, MBM_TLS_NO_MEMORY, MBM_TLS_IN_USE, MBM_TLS_INVALID_ARGUMENT
 *         or MBM_TLS_FAILED, with the number of Mbed TLS in `error`. Except by `error`, a
 *         refused call changes nothing
 */
uint8_t mbm_tls_begin(mbm_tls_identity *identity, const mbm_tls_options *options);

/** Frees what mbm_tls_begin read. Close all connections before. Does nothing if the identity is
 *  not in use. */
void mbm_tls_end(mbm_tls_identity *identity);

/**
 * Begins a connection over a stream, whose port is copied. The handshake goes on in
 * mbm_tls_poll, and in the port's read and write.
 *
 * @param tls       initialised with MBM_INIT, or closed before
 * @param identity  says whether this is the server's side; must outlive the connection
 * @param below     the port of the stream, which may still be connecting
 * @param name      a client's: the name or address that must be in the server's certificate
 *                  (an address only with Mbed TLS 3.5 and newer); NULL allows every
 *                  certificate of the authorities. A server's: NULL
 * @param link      a client's that connects anew: hooks that close and open the stream
 *                  below, copied, for example mbm_tcp_disconnect and mbm_tcp_connect; else
 *                  NULL
 * @return MBM_TLS_HANDSHAKE; or MBM_TLS_IN_USE, MBM_TLS_INVALID_ARGUMENT, also for an
 *         identity that was not begun and for a port without read, write or micros;
 *         MBM_TLS_NO_MEMORY or MBM_TLS_FAILED, and then nothing is changed
 */
uint8_t mbm_tls_open(mbm_tls *tls, const mbm_tls_identity *identity, const mbm_port *below,
                     const char *name, const mbm_linkHooks *link);

/**
 * Returns the port for the begin functions. It may be made before mbm_tls_open, and stays
 * valid when the connection is closed and opened again. A lost or refused connection is a
 * lost link.
 *
 * @param tls  must outlive the port
 * @return the port; its `context` is `tls`
 */
mbm_port mbm_tls_port(mbm_tls *tls);

/**
 * Moves the connection on: the handshake, bytes that the stream below has not accepted yet,
 * the end. Looks whether the peer ended the session. Call it while no client or server reads
 * the port, for example from mbm_tls_open on until the session is open.
 *
 * @return its `status`
 */
uint8_t mbm_tls_poll(mbm_tls *tls);

/**
 * Returns how long the port needs no call, unless the stream below accepts bytes again or
 * bytes arrive there. It is 0 if received bytes are in the port that no wait for the stream
 * below would report, or if a handshake can go on without further bytes; it says so once,
 * until the port's read or write, or mbm_tls_poll, was called again.
 *
 * @return microseconds, UINT32_MAX without a limit
 */
uint32_t mbm_tls_pollDelay(mbm_tls *tls);

/**
 * Returns the role in the certificate of the client that a server is connected with: the
 * whole UTF8String of the extension 1.3.6.1.4.1.50316.802.1. Compare it with strcmp.
 *
 * @param tls  a connection, or the connection's context that a hook got
 * @return the role; NULL if the certificate has none, at a client, and while the session is
 *         not open
 */
const char *mbm_tls_role(const mbm_tls *tls);

/**
 * Ends the session with close_notify, as TLS demands before the stream is closed. From now
 * on the port reads and accepts no bytes. Call it again while it returns MBM_TLS_CLOSING, if
 * the close_notify shall be sent although the stream below is full.
 *
 * @return MBM_TLS_CLOSED, MBM_TLS_CLOSING, or why the connection ended
 */
uint8_t mbm_tls_shutDown(mbm_tls *tls);

/** Ends the session, with close_notify if the stream below accepts it at once, and frees what
 *  Mbed TLS allocated for it. The stream below stays as it is. Does nothing if the connection is
 *  not in use. */
void mbm_tls_close(mbm_tls *tls);

/**
 * Connects the stream below by the hook of mbm_tls_open, and begins a new handshake. A hook
 * for a function that reconnects. Without a hook of mbm_tls_open the stream below must be
 * connected anew already.
 *
 * @param context  an mbm_tls
 * @return MBM_PENDING while the connection is being made, or MBM_LINK_LOST
 */
uint8_t mbm_tls_connect(void *context);

/**
 * Ends the session as mbm_tls_close does, and closes the stream below by the hook of
 * mbm_tls_open. The link is lost until mbm_tls_connect. A hook for a function that
 * reconnects.
 *
 * @param context  an mbm_tls
 */
void mbm_tls_disconnect(void *context);

/**
 * Returns what the session is doing, as a hook of mbm_linkHooks. Takes the handshake on.
 *
 * @param context  an mbm_tls
 * @return MBM_OK if the session is open, MBM_PENDING during the handshake,
 *         MBM_CONNECT_TIMED_OUT if it took longer than its time, or MBM_LINK_LOST
 */
uint8_t mbm_tls_status(void *context);

/**
 * Returns the hooks for mbm_link_begin, for a client's connection of mbm_tls_open. The link is
 * open when the handshake is over: `handshakeMs` and the link's connect timeout both limit it.
 * In the callback of the link, `status` of the mbm_tls says why a session ended or was not
 * made.
 *
 * @param tls  opened with the hooks of the stream below, for example those of mbm_tcp_link; must
 *             outlive the link
 * @return the hooks
 */
static inline mbm_linkHooks mbm_tls_link(mbm_tls *tls)
{
    mbm_linkHooks hooks;

    hooks.context = tls;
    hooks.disconnect = mbm_tls_disconnect;
    hooks.connect = mbm_tls_connect;
    hooks.status = mbm_tls_status;
    return hooks;
}

/**
 * Returns a status in words. In mbm_tls_text.c.
 *
 * @param status  an MBM_TLS_ value
 * @return a sentence without a full stop; never NULL
 */
const char *mbm_tls_text(uint8_t status);

/**
 * Returns the description of a peer's alert in words. In mbm_tls_text.c.
 *
 * @param alert  mbm_tls.alert
 * @return the name that RFC 8446 gives it; "unknown alert" for others; never NULL
 */
const char *mbm_tls_alertText(uint8_t alert);

/* Private: shared by the sources of this port. */
enum { MBM_TLS_NO_ROLE, MBM_TLS_ONE_ROLE, MBM_TLS_WRONG_ROLE };
int mbm_tls_findRole(const mbedtls_x509_buf *extensions, char *role);

/* How far a server's handshake has come: nothing understood of the client yet; its first message;
 * a certificate of an authority, though not yet that the client has its key; everything. */
enum { MBM_TLS_SILENT, MBM_TLS_GREETED, MBM_TLS_CERTIFIED, MBM_TLS_PROVEN };
uint8_t mbm_tls_progress(const mbm_tls *tls);

/* Whether a connection was opened before another one. Both have the same clock. */
int mbm_tls_isOlder(const mbm_tls *tls, const mbm_tls *other);

#ifdef __cplusplus
}
#endif

#endif
