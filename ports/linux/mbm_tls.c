/* The connections of mbm_tls.h. Licence: MIT OR Apache-2.0. */
#include "mbm_tls.h"

#include <string.h>

#include <mbedtls/platform_util.h>

/* Mbed TLS 2.28 has no such macro, and lets everyone read the members of its structs. */
#ifndef MBEDTLS_PRIVATE
#define MBEDTLS_PRIVATE(member) member
#endif

/* The types of records that a peer may send first, and the level of an alert that ends the
 * connection. */
enum { RECORD_ALERT = 21, RECORD_HANDSHAKE = 22, FATAL = 2 };

/* The most bytes that one read or write returns. */
enum { MOST = INT16_MAX };

/* How often a connection that is over reads the stream below, MBM_MAX_TCP_FRAME bytes each. */
enum { DRAINS = 64 };

/* --- the stream below, as Mbed TLS calls it --- */

static int lose(mbm_tls *tls)
{
    tls->isLost = 1;
    return MBEDTLS_ERR_SSL_CONN_EOF;
}

static int read_below(mbm_tls *tls, uint8_t *bytes, size_t capacity)
{
    const int count = tls->isLost ? -1
                                  : tls->below.read(tls->below.context, bytes,
                                                    (uint16_t)(capacity < MOST ? capacity : MOST));

    if (count < 0)
        return lose(tls);
    if (count == 0)
        return MBEDTLS_ERR_SSL_WANT_READ;
    if (tls->isFirst) {
        tls->isFirst = 0;
        if (bytes[0] != RECORD_HANDSHAKE && bytes[0] != RECORD_ALERT)
            tls->status = MBM_TLS_NOT_TLS;
    }
    return count;
}

static int receive_below(void *context, unsigned char *bytes, size_t capacity)
{
    mbm_tls *tls = (mbm_tls *)context;
    size_t count = tls->hasAhead;

    if (count == 0)
        return read_below(tls, bytes, capacity);
    if (count > capacity)
        count = capacity;
    memcpy(bytes, tls->ahead, count);
    tls->hasAhead = (uint8_t)(tls->hasAhead - count);
    memmove(tls->ahead, tls->ahead + count, tls->hasAhead);
    return (int)count;
}

/* Takes a refusal of the peer in the middle of this side's messages, and returns 1 then. Mbed
 * TLS reads only after it has sent all: too late if the peer has closed the stream meanwhile. */
static int take_refusal(mbm_tls *tls)
{
    const int count =
        tls->hasAhead < sizeof tls->ahead
            ? read_below(tls, tls->ahead + tls->hasAhead, sizeof tls->ahead - tls->hasAhead)
            : 0;

    if (count > 0)
        tls->hasAhead = (uint8_t)(tls->hasAhead + count);
    if (tls->hasAhead < sizeof tls->ahead || tls->ahead[0] != RECORD_ALERT || tls->ahead[3] != 0 ||
        tls->ahead[4] != 2 || tls->ahead[5] != FATAL)
        return 0;
    tls->alert = tls->ahead[6];
    tls->status = MBM_TLS_REFUSED_BY_PEER;
    return 1;
}

static int send_below(void *context, const unsigned char *bytes, size_t length)
{
    mbm_tls *tls = (mbm_tls *)context;
    int16_t count;

    if (tls->status == MBM_TLS_HANDSHAKE && take_refusal(tls))
        return MBEDTLS_ERR_SSL_FATAL_ALERT_MESSAGE;
    if (tls->isLost)
        return lose(tls);
    count = tls->below.write(tls->below.context, bytes, (uint16_t)(length < MOST ? length : MOST));
    if (count < 0)
        return lose(tls);
    return count > 0 ? count : MBEDTLS_ERR_SSL_WANT_WRITE;
}

/* --- failures --- */

/* Whether Mbed TLS only waits. Then the same call is made again later. */
static int must_wait(int error)
{
    switch (error) {
    case MBEDTLS_ERR_SSL_WANT_READ:
    case MBEDTLS_ERR_SSL_WANT_WRITE:
    case MBEDTLS_ERR_SSL_ASYNC_IN_PROGRESS:
    case MBEDTLS_ERR_SSL_CRYPTO_IN_PROGRESS:
#ifdef MBEDTLS_ERR_SSL_RECEIVED_NEW_SESSION_TICKET
    case MBEDTLS_ERR_SSL_RECEIVED_NEW_SESSION_TICKET: /* it is not kept */
#endif
        return 1;
    default: return 0;
    }
}

/* What is wrong with the peer's certificates. If no authority signed one, the rest of what
 * it says means nothing. */
static uint8_t certificate_reason(const mbm_tls *tls)
{
    if (tls->flags & MBEDTLS_X509_BADCERT_MISSING)
        return MBM_TLS_NO_CERTIFICATE;
    if (tls->flags & MBEDTLS_X509_BADCERT_NOT_TRUSTED)
        return MBM_TLS_UNKNOWN_AUTHORITY;
    if (tls->flags & MBEDTLS_X509_BADCERT_REVOKED)
        return MBM_TLS_REVOKED;
    if (tls->authorityFlags & MBEDTLS_X509_BADCERT_EXPIRED)
        return MBM_TLS_AUTHORITY_EXPIRED;
    if (tls->authorityFlags & MBEDTLS_X509_BADCERT_FUTURE)
        return MBM_TLS_AUTHORITY_NOT_YET_VALID;
    if (tls->flags & MBEDTLS_X509_BADCERT_EXPIRED)
        return MBM_TLS_EXPIRED;
    if (tls->flags & MBEDTLS_X509_BADCERT_FUTURE)
        return MBM_TLS_NOT_YET_VALID;
    if (tls->flags & MBEDTLS_X509_BADCERT_CN_MISMATCH)
        return MBM_TLS_OTHER_NAME;
    return tls->hasBadRole ? MBM_TLS_BAD_ROLE : MBM_TLS_BAD_CERTIFICATE;
}

/* The reason for an error of Mbed TLS. Its versions report some cases differently. */
static uint8_t reason_of(const mbm_tls *tls, int error)
{
    if (tls->isLost || error == 0)
        return MBM_TLS_LINK_LOST;
    switch (error) {
    case MBEDTLS_ERR_SSL_PEER_CLOSE_NOTIFY: return MBM_TLS_PEER_CLOSED;
    case MBEDTLS_ERR_SSL_CONN_EOF: return MBM_TLS_LINK_LOST;
    case MBEDTLS_ERR_SSL_FATAL_ALERT_MESSAGE: return MBM_TLS_REFUSED_BY_PEER;
    case MBEDTLS_ERR_SSL_NO_CLIENT_CERTIFICATE: return MBM_TLS_NO_CERTIFICATE;
    case MBEDTLS_ERR_SSL_ALLOC_FAILED:
    case MBEDTLS_ERR_X509_ALLOC_FAILED:
    case MBEDTLS_ERR_PK_ALLOC_FAILED: return MBM_TLS_NO_MEMORY;
    case MBEDTLS_ERR_X509_CERT_VERIFY_FAILED: return certificate_reason(tls);
#ifdef MBEDTLS_ERR_SSL_BAD_HS_PROTOCOL_VERSION
    case MBEDTLS_ERR_SSL_BAD_HS_PROTOCOL_VERSION: return MBM_TLS_NO_COMMON_VERSION;
    case MBEDTLS_ERR_SSL_NO_CIPHER_CHOSEN:
    case MBEDTLS_ERR_SSL_NO_USABLE_CIPHERSUITE: return MBM_TLS_NO_COMMON_CIPHER;
    case MBEDTLS_ERR_SSL_BAD_HS_CERTIFICATE: return MBM_TLS_BAD_CERTIFICATE;
#else
    case MBEDTLS_ERR_SSL_BAD_PROTOCOL_VERSION: return MBM_TLS_NO_COMMON_VERSION;
    case MBEDTLS_ERR_SSL_HANDSHAKE_FAILURE: return MBM_TLS_NO_COMMON_CIPHER;
    case MBEDTLS_ERR_SSL_BAD_CERTIFICATE: return MBM_TLS_BAD_CERTIFICATE;
    case MBEDTLS_ERR_SSL_DECODE_ERROR:
    case MBEDTLS_ERR_SSL_ILLEGAL_PARAMETER:
#endif
    case MBEDTLS_ERR_SSL_INVALID_MAC:
    case MBEDTLS_ERR_SSL_INVALID_RECORD:
    case MBEDTLS_ERR_SSL_UNEXPECTED_MESSAGE:
    case MBEDTLS_ERR_SSL_UNEXPECTED_RECORD: return MBM_TLS_BAD_STREAM;
    default: break;
    }
    /* Mbed TLS parses a certificate before it verifies it. */
    if (error <= MBEDTLS_ERR_X509_FEATURE_UNAVAILABLE && error >= MBEDTLS_ERR_X509_FATAL_ERROR)
        return MBM_TLS_BAD_CERTIFICATE;
    return tls->status == MBM_TLS_OPEN ? MBM_TLS_BAD_STREAM : MBM_TLS_FAILED;
}

/* Discards bytes that the peer has sent and that will not be read. With unread bytes a socket that
 * is closed sends a reset, and the peer's system then drops the alert that says why. */
static void drain(mbm_tls *tls)
{
    unsigned rounds;

    for (rounds = 0; rounds < DRAINS && !tls->isLost; rounds++)
        if (tls->below.read(tls->below.context, tls->sending, sizeof tls->sending) <= 0)
            return;
}

/* Ends the connection for an error. The first reason stays. */
static void fail(mbm_tls *tls, int error)
{
    const uint32_t flags = mbedtls_ssl_get_verify_result(&tls->ssl);

    if (flags != UINT32_MAX)
        tls->flags |= flags;
    tls->error = error;
    if (error == MBEDTLS_ERR_SSL_FATAL_ALERT_MESSAGE && tls->status != MBM_TLS_REFUSED_BY_PEER)
        tls->alert = tls->ssl.MBEDTLS_PRIVATE(in_msg)[1];
    if (tls->status <= MBM_TLS_CLOSING)
        tls->status = reason_of(tls, error);
    drain(tls);
}

/* --- the handshake --- */

/* Whether a certificate is one of the authorities that this side was given. */
static int is_own_authority(const mbm_tls_identity *identity, const mbedtls_x509_crt *certificate)
{
    const mbedtls_x509_crt *one = &identity->authorities;

    while (one && one != certificate)
        one = one->next;
    return one != NULL;
}

/* Called by Mbed TLS for each certificate of the peer's chain, for its own at last. Finds the
 * role even if Mbed TLS was built not to keep the peer's certificate. */
static int look_at_certificate(void *context, mbedtls_x509_crt *certificate, int depth,
                               uint32_t *flags)
{
    mbm_tls *tls = (mbm_tls *)context;

    tls->isSeen |= depth == 0;
    if (depth == 0 && tls->identity->isServer &&
        mbm_tls_findRole(&certificate->v3_ext, tls->role) == MBM_TLS_WRONG_ROLE) {
        tls->hasBadRole = 1;
        *flags |= MBEDTLS_X509_BADCERT_OTHER;
    }
    tls->flags |= *flags;
    if (is_own_authority(tls->identity, certificate))
        tls->authorityFlags |= *flags;
    return 0;
}

static uint32_t now(const mbm_tls *tls)
{
    return tls->below.micros(tls->below.context);
}

/* For how many microseconds the handshake has gone on. A clock that steps back is not far
 * ahead. */
static uint32_t age_of(const mbm_tls *tls)
{
    const uint32_t time = now(tls) - tls->startedAtUs;

    return time <= INT32_MAX ? time : 0;
}

int mbm_tls_isOlder(const mbm_tls *tls, const mbm_tls *other)
{
    return tls->startedAtUs - other->startedAtUs > INT32_MAX;
}

static int state_of(const mbm_tls *tls)
{
    return tls->ssl.MBEDTLS_PRIVATE(state);
}

uint8_t mbm_tls_progress(const mbm_tls *tls)
{
    if (tls->status != MBM_TLS_HANDSHAKE)
        return MBM_TLS_PROVEN;
    if (tls->isSeen && tls->flags == 0)
        return MBM_TLS_CERTIFIED;
    return state_of(tls) > MBEDTLS_SSL_CLIENT_HELLO ? MBM_TLS_GREETED : MBM_TLS_SILENT;
}

static void begin_handshake(mbm_tls *tls)
{
    tls->alert = tls->isLost = tls->isSeen = tls->hasBadRole = tls->isTold = tls->isDue =
        tls->hasAhead = 0;
    tls->isFirst = 1;
    tls->error = 0;
    tls->flags = tls->authorityFlags = 0;
    tls->sent = tls->toSend = 0;
    memset(tls->role, 0, sizeof tls->role);
    tls->startedAtUs = now(tls);
    tls->status = MBM_TLS_HANDSHAKE;
}

/* One message at a time, because each may take a computation that other connections of the
 * program must wait for. */
static void shake_hands(mbm_tls *tls)
{
    int result = 0, is_over;

    /* The first step moves no message. */
    if (state_of(tls) == MBEDTLS_SSL_HELLO_REQUEST)
        result = mbedtls_ssl_handshake_step(&tls->ssl);
    if (result == 0)
        result = mbedtls_ssl_handshake_step(&tls->ssl);
    is_over = result == 0 && state_of(tls) == MBEDTLS_SSL_HANDSHAKE_OVER;
    tls->isDue = result == 0;
    /* Mbed TLS demands a verified certificate of the peer. This makes sure of it. */
    if (is_over &&
        (!tls->isSeen || tls->flags != 0 || mbedtls_ssl_get_verify_result(&tls->ssl) != 0))
        result = MBEDTLS_ERR_X509_CERT_VERIFY_FAILED;
    if (result != 0 && !must_wait(result))
        fail(tls, result);
    else if (tls->status == MBM_TLS_HANDSHAKE && is_over)
        tls->status = MBM_TLS_OPEN;
    else if (tls->status == MBM_TLS_HANDSHAKE && age_of(tls) >= tls->identity->handshakeUs)
        tls->status = MBM_TLS_TIMED_OUT;
}

/* Sends what the port has accepted. Mbed TLS wants a call that waits again with the same bytes,
 * so `sending` keeps them. */
static void push(mbm_tls *tls)
{
    int result;

    while (tls->sent < tls->toSend && tls->status <= MBM_TLS_CLOSING) {
        result = mbedtls_ssl_write(&tls->ssl, tls->sending + tls->sent,
                                   (size_t)(tls->toSend - tls->sent));
        if (result > 0)
            tls->sent = (uint16_t)(tls->sent + result);
        else if (must_wait(result))
            return;
        else
            fail(tls, result);
    }
    tls->sent = tls->toSend = 0;
}

/* Carries on with the handshake or the records. Returns 1 if the session is open, 0 if it may
 * become open, -1 if it is over. */
static int advance(mbm_tls *tls)
{
    if (tls->status == MBM_TLS_HANDSHAKE)
        shake_hands(tls);
    if (tls->status == MBM_TLS_OPEN)
        push(tls);
    if (tls->status == MBM_TLS_OPEN)
        return 1;
    return tls->status == MBM_TLS_HANDSHAKE ? 0 : -1;
}

/* --- the port --- */

static int16_t take(mbm_tls *tls, uint8_t *bytes, uint16_t capacity)
{
    const int result = mbedtls_ssl_read(&tls->ssl, bytes, capacity < MOST ? capacity : MOST);

    if (result > 0)
        return (int16_t)result;
    /* For no bytes Mbed TLS returns 0, as for the end of the stream. */
    if (must_wait(result) || (result == 0 && capacity == 0 && !tls->isLost))
        return 0;
    fail(tls, result);
    return -1;
}

static int16_t tls_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    mbm_tls *tls = (mbm_tls *)context;
    const int is_open = advance(tls);

    tls->isTold = 0;
    if (is_open > 0 && capacity > 0)
        return take(tls, bytes, capacity);
    return (int16_t)(is_open < 0 ? -1 : 0);
}

static int16_t tls_write(void *context, const uint8_t *bytes, uint16_t length)
{
    mbm_tls *tls = (mbm_tls *)context;
    uint16_t accepted = 0;

    tls->isTold = 0;
    while (advance(tls) > 0 && tls->toSend == 0 && accepted < length && accepted < MOST) {
        uint16_t count = (uint16_t)(length - accepted);

        if (count > sizeof tls->sending)
            count = sizeof tls->sending;
        if (count > MOST - accepted)
            count = (uint16_t)(MOST - accepted);
        memcpy(tls->sending, bytes + accepted, count);
        tls->toSend = count;
        accepted = (uint16_t)(accepted + count);
    }
    return (int16_t)(tls->status == MBM_TLS_OPEN || tls->status == MBM_TLS_HANDSHAKE ? accepted
                                                                                     : -1);
}

static uint8_t tls_flush(void *context)
{
    mbm_tls *tls = (mbm_tls *)context;

    if (advance(tls) > 0 && tls->toSend != 0)
        return 0;
    return !tls->below.flush || tls->below.flush(tls->below.context) != 0;
}

static uint32_t tls_micros(void *context)
{
    const mbm_tls *tls = (const mbm_tls *)context;

    return tls->below.micros ? now(tls) : 0;
}

static void tls_idle(void *context, struct mbm_node *node)
{
    mbm_tls *tls = (mbm_tls *)context;

    if (tls->below.idle && mbm_tls_pollDelay(tls) != 0)
        tls->below.idle(tls->below.context, node);
}

mbm_port mbm_tls_port(mbm_tls *tls)
{
    return (mbm_port){tls, tls_read, tls_write, tls_micros, tls_flush, NULL, NULL, tls_idle};
}

/* --- opening and closing --- */

uint8_t mbm_tls_open(mbm_tls *tls, const mbm_tls_identity *identity, const mbm_port *below,
                     const char *name, const mbm_linkHooks *link)
{
    int error;

    if (!tls || !identity || !identity->isReady || !below || !below->read || !below->write ||
        !below->micros || (identity->isServer && name))
        return MBM_TLS_INVALID_ARGUMENT;
    if (tls->isSetUp)
        return MBM_TLS_IN_USE;
    mbedtls_ssl_init(&tls->ssl);
    error = mbedtls_ssl_setup(&tls->ssl, &identity->config);
#ifdef MBEDTLS_SSL_CLI_C
    /* Also if it is NULL: newer versions of Mbed TLS demand the call. */
    if (error == 0 && !identity->isServer)
        error = mbedtls_ssl_set_hostname(&tls->ssl, name);
#endif
    if (error != 0) {
        mbedtls_ssl_free(&tls->ssl);
        return error == MBEDTLS_ERR_SSL_ALLOC_FAILED ? MBM_TLS_NO_MEMORY : MBM_TLS_FAILED;
    }
    mbedtls_ssl_set_bio(&tls->ssl, tls, send_below, receive_below, NULL);
    mbedtls_ssl_set_verify(&tls->ssl, look_at_certificate, tls);
    tls->isSetUp = 1;
    tls->identity = identity;
    tls->below = *below;
    tls->link = link ? *link : (mbm_linkHooks){0};
    begin_handshake(tls);
    return tls->status;
}

uint8_t mbm_tls_poll(mbm_tls *tls)
{
    uint8_t none;

    if (advance(tls) > 0 && mbedtls_ssl_get_bytes_avail(&tls->ssl) == 0)
        (void)take(tls, &none, 0);
    if (tls->status == MBM_TLS_CLOSING)
        (void)mbm_tls_shutDown(tls);
    return tls->status;
}

uint32_t mbm_tls_pollDelay(mbm_tls *tls)
{
    if (tls->status == MBM_TLS_HANDSHAKE) {
        const uint32_t past = age_of(tls), longest = tls->identity->handshakeUs;

        if (tls->isDue) {
            tls->isDue = 0;
            return 0;
        }
        return past < longest ? longest - past : 0;
    }
    if (tls->status != MBM_TLS_OPEN || tls->isTold || mbedtls_ssl_get_bytes_avail(&tls->ssl) == 0)
        return UINT32_MAX;
    tls->isTold = 1;
    return 0;
}

const char *mbm_tls_role(const mbm_tls *tls)
{
    return tls->status == MBM_TLS_OPEN && tls->role[0] ? tls->role : NULL;
}

uint8_t mbm_tls_shutDown(mbm_tls *tls)
{
    int result;

    if (tls->status == MBM_TLS_HANDSHAKE)
        tls->status = MBM_TLS_CLOSED;
    if (tls->status != MBM_TLS_OPEN && tls->status != MBM_TLS_CLOSING)
        return tls->status;
    tls->status = MBM_TLS_CLOSING;
    push(tls);
    if (tls->status != MBM_TLS_CLOSING || tls->toSend != 0)
        return tls->status;
    result = mbedtls_ssl_close_notify(&tls->ssl);
    if (result == 0)
        tls->status = MBM_TLS_CLOSED;
    else if (!must_wait(result))
        fail(tls, result);
    return tls->status;
}

void mbm_tls_close(mbm_tls *tls)
{
    if (!tls->isSetUp)
        return;
    (void)mbm_tls_shutDown(tls);
    drain(tls);
    mbedtls_ssl_free(&tls->ssl);
    mbedtls_platform_zeroize(tls->sending, sizeof tls->sending);
    tls->isSetUp = 0;
    tls->status = MBM_TLS_CLOSED;
}

uint8_t mbm_tls_connect(void *context)
{
    mbm_tls *tls = (mbm_tls *)context;
    uint8_t status = MBM_OK;
    int error;

    if (!tls->isSetUp)
        return MBM_LINK_LOST;
    error = mbedtls_ssl_session_reset(&tls->ssl);
    if (error != 0) {
        fail(tls, error);
        return MBM_LINK_LOST;
    }
    if (tls->link.connect)
        status = tls->link.connect(tls->link.context);
    if (status != MBM_OK && status != MBM_PENDING) {
        tls->status = MBM_TLS_LINK_LOST;
        return status;
    }
    begin_handshake(tls);
    return MBM_PENDING;
}

void mbm_tls_disconnect(void *context)
{
    mbm_tls *tls = (mbm_tls *)context;

    if (!tls->isSetUp)
        return;
    if (mbm_tls_shutDown(tls) == MBM_TLS_CLOSING)
        tls->status = MBM_TLS_CLOSED;
    if (tls->link.disconnect)
        tls->link.disconnect(tls->link.context);
}

uint8_t mbm_tls_status(void *context)
{
    switch (mbm_tls_poll((mbm_tls *)context)) {
    case MBM_TLS_OPEN: return MBM_OK;
    case MBM_TLS_HANDSHAKE: return MBM_PENDING;
    case MBM_TLS_TIMED_OUT: return MBM_CONNECT_TIMED_OUT;
    default: return MBM_LINK_LOST;
    }
}
