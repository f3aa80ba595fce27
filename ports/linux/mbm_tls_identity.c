/* The identities of mbm_tls.h: certificates, keys and roles. Licence: MIT OR Apache-2.0. */
#include "mbm_tls.h"

#include <string.h>

#include <mbedtls/asn1.h>
#include <mbedtls/version.h>

/* These parts of Mbed TLS compute with PSA, which must be begun first. */
#if defined(MBEDTLS_USE_PSA_CRYPTO) || defined(MBEDTLS_SSL_PROTO_TLS1_3)
#define USES_PSA
#include <psa/crypto.h>
#endif

/* The first byte of everything in DER. */
enum { DER = 0x30 };

/* The longest handshake time: a comparison of wrapping microseconds needs less than 2^31. */
enum { LONGEST_MS = 2000000 };

/* --- the role --- */

/* 1.3.6.1.4.1.50316.802.1 in DER, without tag and length. */
static const uint8_t role_oid[] = {0x2B, 0x06, 0x01, 0x04, 0x01, 0x83,
                                   0x89, 0x0C, 0x86, 0x22, 0x01};

/* Reads one Extension (RFC 5280, 4.1) up to `end`, which is its end, and copies its role. */
static int take_role(unsigned char *p, const unsigned char *end, char *role)
{
    size_t length;
    int ignored;

    if (mbedtls_asn1_get_tag(&p, end, &length, MBEDTLS_ASN1_OID) != 0)
        return MBM_TLS_WRONG_ROLE;
    if (length != sizeof role_oid || memcmp(p, role_oid, length) != 0)
        return MBM_TLS_NO_ROLE;
    p += length;
    /* The flag `critical` may be left out. */
    (void)mbedtls_asn1_get_bool(&p, end, &ignored);
    if (mbedtls_asn1_get_tag(&p, end, &length, MBEDTLS_ASN1_OCTET_STRING) != 0 ||
        p + length != end ||
        mbedtls_asn1_get_tag(&p, end, &length, MBEDTLS_ASN1_UTF8_STRING) != 0 ||
        p + length != end || length == 0 || length > MBM_TLS_ROLE_BYTES ||
        memchr(p, 0, length) != NULL)
        return MBM_TLS_WRONG_ROLE;
    memcpy(role, p, length);
    role[length] = 0;
    return MBM_TLS_ONE_ROLE;
}

/* Looks for the role in the extensions of a certificate. `role` has MBM_TLS_ROLE_BYTES and one
 * more. It is changed only if there is exactly one role. */
int mbm_tls_findRole(const mbedtls_x509_buf *extensions, char *role)
{
    char found[MBM_TLS_ROLE_BYTES + 1];
    unsigned char *p = extensions->p;
    const unsigned char *end = p + extensions->len;
    int result = MBM_TLS_NO_ROLE;
    size_t length;

    if (extensions->len == 0)
        return MBM_TLS_NO_ROLE;
    if (mbedtls_asn1_get_tag(&p, end, &length, MBEDTLS_ASN1_CONSTRUCTED | MBEDTLS_ASN1_SEQUENCE) !=
        0)
        return MBM_TLS_WRONG_ROLE;
    while (p < end) {
        int one;

        if (mbedtls_asn1_get_tag(&p, end, &length,
                                 MBEDTLS_ASN1_CONSTRUCTED | MBEDTLS_ASN1_SEQUENCE) != 0)
            return MBM_TLS_WRONG_ROLE;
        one = take_role(p, p + length, found);
        if (one == MBM_TLS_WRONG_ROLE || (one == MBM_TLS_ONE_ROLE && result != MBM_TLS_NO_ROLE))
            return MBM_TLS_WRONG_ROLE;
        if (one == MBM_TLS_ONE_ROLE)
            result = one;
        p += length;
    }
    if (result == MBM_TLS_ONE_ROLE)
        memcpy(role, found, sizeof found);
    return result;
}

/* --- certificates and key --- */

static int read_certificates(mbedtls_x509_crt *into, const uint8_t *bytes, size_t length)
{
    const int error = bytes[0] == DER ? mbedtls_x509_crt_parse_der_nocopy(into, bytes, length)
                                      : mbedtls_x509_crt_parse(into, bytes, length);

    /* For PEM a positive number says how many of the certificates were not read. */
    return error > 0 ? MBEDTLS_ERR_X509_INVALID_FORMAT : error;
}

static int read_key(mbm_tls_identity *identity, const mbm_tls_options *options)
{
    const uint8_t *password = (const uint8_t *)options->keyPassword;
    const size_t length = password ? strlen(options->keyPassword) : 0;
    int error;

#if MBEDTLS_VERSION_NUMBER >= 0x03000000
    error = mbedtls_pk_parse_key(&identity->key, options->key, options->keyBytes, password, length,
                                 options->random, options->randomContext);
    if (error == 0)
        error = mbedtls_pk_check_pair(&identity->certificate.pk, &identity->key, options->random,
                                      options->randomContext);
#else
    error = mbedtls_pk_parse_key(&identity->key, options->key, options->keyBytes, password, length);
    if (error == 0)
        error = mbedtls_pk_check_pair(&identity->certificate.pk, &identity->key);
#endif
    return error;
}

static int read_revoked(mbm_tls_identity *identity, const mbm_tls_options *options)
{
#ifdef MBEDTLS_X509_CRL_PARSE_C
    if (options->revoked)
        return mbedtls_x509_crl_parse(&identity->revoked, options->revoked, options->revokedBytes);
    return 0;
#else
    (void)identity;
    return options->revoked ? MBEDTLS_ERR_X509_FEATURE_UNAVAILABLE : 0;
#endif
}

/* --- rules of TLS --- */

/* TLS 1.2 and no other. Mbed TLS 3.5 has 1.3 too, but there it does not call the function that
 * finds the role. */
static void set_version(mbedtls_ssl_config *config)
{
#if MBEDTLS_VERSION_NUMBER >= 0x03020000
    mbedtls_ssl_conf_min_tls_version(config, MBEDTLS_SSL_VERSION_TLS1_2);
    mbedtls_ssl_conf_max_tls_version(config, MBEDTLS_SSL_VERSION_TLS1_2);
#else
    mbedtls_ssl_conf_min_version(config, MBEDTLS_SSL_MAJOR_VERSION_3, MBEDTLS_SSL_MINOR_VERSION_3);
    mbedtls_ssl_conf_max_version(config, MBEDTLS_SSL_MAJOR_VERSION_3, MBEDTLS_SSL_MINOR_VERSION_3);
#endif
}

static int configure(mbm_tls_identity *identity, const mbm_tls_options *options)
{
    mbedtls_ssl_config *config = &identity->config;
    mbedtls_x509_crl *revoked = NULL;
    int error = mbedtls_ssl_config_defaults(
        config, options->isServer ? MBEDTLS_SSL_IS_SERVER : MBEDTLS_SSL_IS_CLIENT,
        MBEDTLS_SSL_TRANSPORT_STREAM, MBEDTLS_SSL_PRESET_DEFAULT);

    if (error != 0)
        return error;
#ifdef MBEDTLS_X509_CRL_PARSE_C
    if (options->revoked)
        revoked = &identity->revoked;
#endif
    set_version(config);
    mbedtls_ssl_conf_authmode(config, MBEDTLS_SSL_VERIFY_REQUIRED);
    mbedtls_ssl_conf_ca_chain(config, &identity->authorities, revoked);
    mbedtls_ssl_conf_rng(config, options->random, options->randomContext);
    if (options->ciphers)
        mbedtls_ssl_conf_ciphersuites(config, options->ciphers);
#if defined(MBEDTLS_SSL_SESSION_TICKETS) && defined(MBEDTLS_SSL_CLI_C)
    /* Each connection verifies the certificates anew. */
    mbedtls_ssl_conf_session_tickets(config, MBEDTLS_SSL_SESSION_TICKETS_DISABLED);
#endif
    return mbedtls_ssl_conf_own_cert(config, &identity->certificate, &identity->key);
}

static void begin_all(mbm_tls_identity *identity)
{
    mbedtls_ssl_config_init(&identity->config);
    mbedtls_x509_crt_init(&identity->certificate);
    mbedtls_x509_crt_init(&identity->authorities);
    mbedtls_pk_init(&identity->key);
#ifdef MBEDTLS_X509_CRL_PARSE_C
    mbedtls_x509_crl_init(&identity->revoked);
#endif
}

static void free_all(mbm_tls_identity *identity)
{
    mbedtls_ssl_config_free(&identity->config);
    mbedtls_x509_crt_free(&identity->certificate);
    mbedtls_x509_crt_free(&identity->authorities);
    mbedtls_pk_free(&identity->key);
#ifdef MBEDTLS_X509_CRL_PARSE_C
    mbedtls_x509_crl_free(&identity->revoked);
#endif
}

static uint8_t reason_of(int error, uint8_t reason)
{
    if (error == MBEDTLS_ERR_X509_ALLOC_FAILED || error == MBEDTLS_ERR_PK_ALLOC_FAILED ||
        error == MBEDTLS_ERR_SSL_ALLOC_FAILED)
        return MBM_TLS_NO_MEMORY;
    return reason;
}

/* Reads everything. Returns 0 or the reason. */
static uint8_t fill(mbm_tls_identity *identity, const mbm_tls_options *options)
{
    int error =
        read_certificates(&identity->certificate, options->certificate, options->certificateBytes);
    uint8_t reason = MBM_TLS_OWN_CERTIFICATE;

    if (error == 0) {
        reason = MBM_TLS_OWN_KEY;
        error = read_key(identity, options);
    }
    if (error == 0) {
        reason = MBM_TLS_OWN_AUTHORITIES;
        error = read_certificates(&identity->authorities, options->authorities,
                                  options->authoritiesBytes);
    }
    if (error == 0) {
        reason = MBM_TLS_OWN_REVOKED;
        error = read_revoked(identity, options);
    }
    if (error == 0) {
        reason = MBM_TLS_FAILED;
        error = configure(identity, options);
    }
    identity->error = error;
    return error == 0 ? 0 : reason_of(error, reason);
}

static int is_complete(const mbm_tls_options *options)
{
    return options->certificate && options->certificateBytes && options->key && options->keyBytes &&
           options->authorities && options->authoritiesBytes && options->random &&
           (!options->revoked || options->revokedBytes) && options->handshakeMs <= LONGEST_MS;
}

uint8_t mbm_tls_begin(mbm_tls_identity *identity, const mbm_tls_options *options)
{
    const uint32_t handshakeMs =
        options && options->handshakeMs ? options->handshakeMs : MBM_TLS_HANDSHAKE_MS;
    uint8_t reason;

    if (!identity || !options || !is_complete(options))
        return MBM_TLS_INVALID_ARGUMENT;
    if (identity->isReady)
        return MBM_TLS_IN_USE;
#ifdef USES_PSA
    if (psa_crypto_init() != PSA_SUCCESS)
        return MBM_TLS_FAILED;
#endif
    begin_all(identity);
    reason = fill(identity, options);
    if (reason != 0) {
        free_all(identity);
        return reason;
    }
    identity->isReady = 1;
    identity->isServer = options->isServer;
    identity->handshakeUs = handshakeMs * 1000u;
    return 0;
}

void mbm_tls_end(mbm_tls_identity *identity)
{
    if (identity->isReady)
        free_all(identity);
    identity->isReady = 0;
}
