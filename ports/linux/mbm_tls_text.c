/* The reasons of mbm_tls.h in words. Licence: MIT OR Apache-2.0. */
#include "mbm_tls.h"

const char *mbm_tls_text(uint8_t status)
{
    switch (status) {
    case MBM_TLS_CLOSED: return "closed";
    case MBM_TLS_HANDSHAKE: return "the handshake goes on";
    case MBM_TLS_OPEN: return "open";
    case MBM_TLS_CLOSING: return "the end of the session is not sent yet";
    case MBM_TLS_PEER_CLOSED: return "the peer ended the session";
    case MBM_TLS_LINK_LOST: return "the link was lost";
    case MBM_TLS_TIMED_OUT: return "the handshake took too long";
    case MBM_TLS_NOT_TLS: return "the peer does not speak TLS";
    case MBM_TLS_NO_COMMON_VERSION: return "the peer's TLS is older than 1.2";
    case MBM_TLS_NO_COMMON_CIPHER: return "there is no cipher suite in common";
    case MBM_TLS_REFUSED_BY_PEER: return "the peer refused the connection";
    case MBM_TLS_NO_CERTIFICATE: return "the client sent no certificate";
    case MBM_TLS_UNKNOWN_AUTHORITY: return "no known authority signed the peer's certificate";
    case MBM_TLS_EXPIRED: return "the peer's certificate has expired";
    case MBM_TLS_NOT_YET_VALID: return "the peer's certificate is not valid yet";
    case MBM_TLS_REVOKED: return "the peer's certificate is revoked";
    case MBM_TLS_OTHER_NAME: return "the server's certificate is for another name";
    case MBM_TLS_BAD_CERTIFICATE: return "the peer's certificate cannot be used";
    case MBM_TLS_BAD_ROLE: return "the role in the client's certificate is malformed";
    case MBM_TLS_BAD_STREAM: return "the peer's messages are damaged or forged";
    case MBM_TLS_OWN_CERTIFICATE: return "this side's certificate cannot be read";
    case MBM_TLS_OWN_KEY: return "this side's key cannot be read, or is for another certificate";
    case MBM_TLS_OWN_AUTHORITIES: return "the authorities' certificates cannot be read";
    case MBM_TLS_OWN_REVOKED: return "the revocation list cannot be read";
    case MBM_TLS_NO_MEMORY: return "there is not enough memory";
    case MBM_TLS_IN_USE: return "the object is in use";
    case MBM_TLS_INVALID_ARGUMENT: return "an argument is invalid";
    case MBM_TLS_FAILED: return "the TLS library failed";
    case MBM_TLS_AUTHORITY_EXPIRED:
        return "the authority's certificate, which this side has, has expired";
    case MBM_TLS_AUTHORITY_NOT_YET_VALID:
        return "the authority's certificate, which this side has, is not valid yet";
    default: return "unknown status";
    }
}

const char *mbm_tls_alertText(uint8_t alert)
{
    switch (alert) {
    case 0: return "close notify";
    case 10: return "unexpected message";
    case 20: return "bad record mac";
    case 22: return "record overflow";
    case 40: return "handshake failure";
    case 42: return "bad certificate";
    case 43: return "unsupported certificate";
    case 44: return "certificate revoked";
    case 45: return "certificate expired";
    case 46: return "certificate unknown";
    case 47: return "illegal parameter";
    case 48: return "unknown ca";
    case 49: return "access denied";
    case 50: return "decode error";
    case 51: return "decrypt error";
    case 70: return "protocol version";
    case 71: return "insufficient security";
    case 80: return "internal error";
    case 86: return "inappropriate fallback";
    case 90: return "user canceled";
    case 109: return "missing extension";
    case 110: return "unsupported extension";
    case 112: return "unrecognized name";
    case 116: return "certificate required";
    case 120: return "no application protocol";
    default: return "unknown alert";
    }
}
