/* Each side lets some peers in: certificates, roles, names, and the files for mbm_tls_begin. */
#define _GNU_SOURCE
#include "test.h"
#include "tls_pair.h"

static tls_pair pair;
static mbm_tls_files files;

static void begin(void)
{
    tls_pair_begin(&pair, "operator", "server");
}

static void end(void)
{
    tls_pair_end(&pair);
}

fixture each_test = {begin, end};

/* The authorities that client and server know. */
static const char *client_knows = "authority", *server_knows = "authority";

/* Shakes hands with a certificate of the client and one of the server. Neither side may send
 * a byte of what it is given to send, unless both are open. */
static void meet(const char *client, const char *server, const char *name)
{
    static const uint8_t secret[] = "the words of a register";

    mbm_tls_close(&pair.client.tls);
    mbm_tls_close(&pair.server.tls);
    mbm_tls_end(&pair.client_identity);
    mbm_tls_end(&pair.server_identity);
    tls_identify(&pair.client_identity, client, client_knows, 0);
    tls_identify(&pair.server_identity, server, server_knows, 1);
    tls_pair_open(&pair, name);
    for (unsigned rounds = 0; rounds < 20; rounds++) {
        (void)pair.client.port.write(&pair.client.tls, secret, sizeof secret);
        (void)pair.server.port.write(&pair.server.tls, secret, sizeof secret);
    }
    tls_pair_run(&pair);
    assert_false(tls_lane_carried(&pair.to_server, secret, 8));
    assert_false(tls_lane_carried(&pair.to_client, secret, 8));
}

/* The server refuses a client, which learns it by an alert. */
static void server_refuses(const char *client, uint8_t reason)
{
    meet(client, "server", NULL);
    if (pair.server.tls.status != reason)
        fail_msg("%s: %s (-0x%x)", client, mbm_tls_text(pair.server.tls.status),
                 (unsigned)-pair.server.tls.error);
    assert_null(mbm_tls_role(&pair.server.tls));
    assert_int_equal(pair.client.tls.status, MBM_TLS_REFUSED_BY_PEER);
    assert_string_not_equal(mbm_tls_alertText(pair.client.tls.alert), "unknown alert");
}

/* The client refuses a server. */
static void client_refuses(const char *server, const char *name, uint8_t reason)
{
    meet("operator", server, name);
    if (pair.client.tls.status != reason)
        fail_msg("%s: %s (-0x%x)", server, mbm_tls_text(pair.client.tls.status),
                 (unsigned)-pair.client.tls.error);
    assert_int_equal(pair.server.tls.status, MBM_TLS_REFUSED_BY_PEER);
    assert_null(mbm_tls_role(&pair.server.tls));
}

static void client_has_role(const char *client, const char *role)
{
    meet(client, "server", NULL);
    assert_int_equal(pair.server.tls.status, MBM_TLS_OPEN);
    assert_int_equal(pair.client.tls.status, MBM_TLS_OPEN);
    if (role)
        assert_string_equal(mbm_tls_role(&pair.server.tls), role);
    else
        assert_null(mbm_tls_role(&pair.server.tls));
    assert_int_equal(pair.server.tls.flags, 0);
}

TEST(the_role_of_the_client_is_the_whole_string)
{
    char longest[65] = {0};

    memset(longest, '0', 64);
    client_has_role("operator", "Operator");
    client_has_role("viewer", "Viewer");
    client_has_role("norole", NULL);
    client_has_role("rsa", "Operator");
    client_has_role("role-64", longest);
    client_has_role("role-utf8", "Betreiber S\xC3\xBC"
                                 "d");
}

TEST(a_malformed_role_is_refused)
{
    server_refuses("role-printable", MBM_TLS_BAD_ROLE);
    server_refuses("role-empty", MBM_TLS_BAD_ROLE);
    server_refuses("role-zero", MBM_TLS_BAD_ROLE);
    server_refuses("role-after", MBM_TLS_BAD_ROLE);
    server_refuses("role-65", MBM_TLS_BAD_ROLE);
}

TEST(a_client_of_another_authority_is_refused)
{
    server_refuses("stranger", MBM_TLS_UNKNOWN_AUTHORITY);
    assert_int_equal(pair.client.tls.alert, 48);
}

TEST(a_client_whose_time_is_over_or_not_come_is_refused)
{
    assert_int_equal(MBM_TLS_CHECKS_DATES, 1);
    server_refuses("expired", MBM_TLS_EXPIRED);
    assert_int_equal(pair.client.tls.alert, 45);
    server_refuses("future", MBM_TLS_NOT_YET_VALID);
}

/* A certificate says what it is for. */
TEST_ROW(a_client_with_the_certificate_of_a_server_is_refused,
         server_refuses("server", MBM_TLS_BAD_CERTIFICATE))

TEST(a_server_of_another_authority_is_refused)
{
    client_refuses("stranger-server", "localhost", MBM_TLS_UNKNOWN_AUTHORITY);
    client_refuses("stranger-server", NULL, MBM_TLS_UNKNOWN_AUTHORITY);
}

TEST_ROW(a_server_whose_time_is_over_is_refused,
         client_refuses("expired-server", "localhost", MBM_TLS_EXPIRED))

/* The peer's certificate is right. It is this side's authority whose time is over. */
TEST(an_authority_of_this_side_whose_time_is_over_or_not_come_is_named)
{
    static const struct {
        const char *authority;
        uint8_t reason;
    } dates[] = {{"expired-authority", MBM_TLS_AUTHORITY_EXPIRED},
                 {"future-authority", MBM_TLS_AUTHORITY_NOT_YET_VALID}};

    for (unsigned i = 0; i < COUNT(dates); i++) {
        server_knows = dates[i].authority;
        server_refuses("operator", dates[i].reason);
        server_knows = "authority";
        client_knows = dates[i].authority;
        client_refuses("server", "localhost", dates[i].reason);
        client_knows = "authority";
    }
    assert_non_null(strstr(mbm_tls_text(MBM_TLS_AUTHORITY_EXPIRED), "authority"));
    /* The renewed certificate may stand beside it. */
    server_knows = client_knows = "renewed-authority";
    client_has_role("operator", "Operator");
    server_refuses("expired", MBM_TLS_EXPIRED);
    server_knows = client_knows = "authority";
}

TEST(a_server_of_another_name_is_refused)
{
    client_refuses("server", "pump.example", MBM_TLS_OTHER_NAME);
    meet("operator", "server", "meter.example");
    assert_int_equal(pair.client.tls.status, MBM_TLS_OPEN);
    meet("operator", "server", NULL);
    assert_int_equal(pair.client.tls.status, MBM_TLS_OPEN);
}

/* --- mbm_tls_begin --- */

static mbm_tls_options options_of(const char *name, const char *authorities)
{
    mbm_tls_options options = {0};
    char certificate[128], key[128], known[128];

    snprintf(certificate, sizeof certificate, TLS_FOLDER "%s.pem", name);
    snprintf(key, sizeof key, TLS_FOLDER "%s.key.pem", name);
    snprintf(known, sizeof known, TLS_FOLDER "%s", authorities);
    assert_int_equal(mbm_tls_load(&files, &options, certificate, key, known), 0);
    return options;
}

TEST(a_revoked_certificate_is_refused)
{
    static mbm_tls_files lists;
    mbm_tls_options options = options_of("server", "authority.pem"), other = {0};

    assert_int_equal(mbm_tls_load(&lists, &other, TLS_FOLDER "revocations.pem",
                                  TLS_FOLDER "server.key.pem", TLS_FOLDER "authority.pem"),
                     0);
    client_has_role("revoked", "Operator");
    mbm_tls_close(&pair.server.tls);
    mbm_tls_end(&pair.server_identity);
    options.isServer = 1;
    options.revoked = other.certificate;
    options.revokedBytes = other.certificateBytes;
    assert_int_equal(mbm_tls_begin(&pair.server_identity, &options), 0);
    memset(&lists, 0, sizeof lists);
    tls_pair_open(&pair, NULL);
    tls_pair_run(&pair);
    assert_int_equal(pair.server.tls.status, MBM_TLS_REVOKED);
    assert_int_equal(pair.client.tls.alert, 44);
    options.revoked = (const uint8_t *)"no list";
    options.revokedBytes = 8;
    assert_int_equal(mbm_tls_begin(&(mbm_tls_identity){0}, &options), MBM_TLS_OWN_REVOKED);
}

TEST(der_is_used_where_it_is)
{
    mbm_tls_options options = {0};

    assert_int_equal(mbm_tls_load(&files, &options, TLS_FOLDER "operator.der",
                                  TLS_FOLDER "operator.key.der", TLS_FOLDER "authority.der"),
                     0);
    mbm_tls_close(&pair.client.tls);
    mbm_tls_end(&pair.client_identity);
    assert_int_equal(mbm_tls_begin(&pair.client_identity, &options), 0);
    mbm_tls_forgetKey(&files);
    assert_int_equal(files.key[0], 0);
    assert_int_equal(pair.client_identity.handshakeUs, 1000 * MBM_TLS_HANDSHAKE_MS);
    assert_ptr_equal(pair.client_identity.certificate.raw.p, files.certificate);
    tls_pair_open(&pair, NULL);
    tls_pair_run(&pair);
    assert_string_equal(mbm_tls_role(&pair.server.tls), "Operator");
}

TEST(what_cannot_be_read_is_named_and_changes_nothing)
{
    mbm_tls_options right = options_of("operator", "authority.pem"), wrong = right;
    mbm_tls_identity identity = {0}, zero = {0};
    static const uint8_t noise[] = "-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n";

    wrong.certificate = noise;
    wrong.certificateBytes = sizeof noise;
    assert_int_equal(mbm_tls_begin(&identity, &wrong), MBM_TLS_OWN_CERTIFICATE);
    assert_true(identity.error != 0);
    wrong = right;
    wrong.key = noise;
    wrong.keyBytes = sizeof noise;
    assert_int_equal(mbm_tls_begin(&identity, &wrong), MBM_TLS_OWN_KEY);
    wrong = right;
    wrong.authorities = noise;
    wrong.authoritiesBytes = sizeof noise;
    assert_int_equal(mbm_tls_begin(&identity, &wrong), MBM_TLS_OWN_AUTHORITIES);
    /* An error of Mbed TLS is negative, also if some of the certificates can be read. */
    wrong = options_of("operator", "half-authority.pem");
    assert_int_equal(mbm_tls_begin(&identity, &wrong), MBM_TLS_OWN_AUTHORITIES);
    assert_true(identity.error < -1);
    right = options_of("operator", "authority.pem");
    /* The zero at the end of PEM is part of it. */
    wrong = right;
    wrong.authoritiesBytes--;
    assert_int_equal(mbm_tls_begin(&identity, &wrong), MBM_TLS_OWN_AUTHORITIES);
    wrong = right;
    wrong.random = NULL;
    assert_int_equal(mbm_tls_begin(&identity, &wrong), MBM_TLS_INVALID_ARGUMENT);
    wrong = right;
    wrong.handshakeMs = 2000001;
    assert_int_equal(mbm_tls_begin(&identity, &wrong), MBM_TLS_INVALID_ARGUMENT);
    assert_int_equal(mbm_tls_begin(NULL, &right), MBM_TLS_INVALID_ARGUMENT);
    assert_int_equal(mbm_tls_begin(&identity, NULL), MBM_TLS_INVALID_ARGUMENT);
    assert_int_equal(identity.isReady, zero.isReady);
    mbm_tls_end(&identity);
    assert_int_equal(mbm_tls_begin(&identity, &right), 0);
    assert_int_equal(mbm_tls_begin(&identity, &right), MBM_TLS_IN_USE);
    mbm_tls_end(&identity);
    mbm_tls_end(&identity);
}

TEST(a_key_of_another_certificate_is_refused)
{
    mbm_tls_options options = {0};

    assert_int_equal(mbm_tls_load(&files, &options, TLS_FOLDER "operator.pem",
                                  TLS_FOLDER "viewer.key.pem", TLS_FOLDER "authority.pem"),
                     0);
    assert_int_equal(mbm_tls_begin(&(mbm_tls_identity){0}, &options), MBM_TLS_OWN_KEY);
}

TEST(a_file_that_is_missing_empty_or_too_long_is_refused)
{
    const char *own = TLS_FOLDER "server.pem", *known = TLS_FOLDER "authority.pem";
    mbm_tls_options options = {0};
    char path[] = "/tmp/mbm-tls-XXXXXX";
    int fd = mkstemp(path), i;
    FILE *file = fdopen(fd, "w");

    assert_int_equal(mbm_tls_load(&files, &options, own, TLS_FOLDER "none.pem", known), -1);
    assert_int_equal(errno, ENOENT);
    assert_int_equal(mbm_tls_load(&files, &options, own, path, known), -1);
    assert_int_equal(errno, ENODATA);
    for (i = 0; i < MBM_TLS_FILE_BYTES; i++)
        fputc('-', file);
    (void)fclose(file);
    assert_int_equal(mbm_tls_load(&files, &options, own, path, known), -1);
    assert_int_equal(errno, EFBIG);
    remove(path);
    assert_null(options.certificate);
}

/* Random bytes until the test takes them away. */
static int some_random(void *context, unsigned char *bytes, size_t count)
{
    return *(const int *)context ? mbm_tls_random(NULL, bytes, count) : -1;
}

TEST(without_random_bytes_nothing_is_sent)
{
    static int has_random = 1;
    mbm_tls_options options = options_of("operator", "authority.pem");

    mbm_tls_close(&pair.client.tls);
    mbm_tls_end(&pair.client_identity);
    options.random = some_random;
    options.randomContext = &has_random;
    assert_int_equal(mbm_tls_begin(&pair.client_identity, &options), 0);
    has_random = 0;
    tls_pair_open(&pair, NULL);
    tls_pair_run(&pair);
    assert_int_equal(pair.client.tls.status, MBM_TLS_FAILED);
    assert_int_equal(pair.client.tls.error, -1);
    assert_int_equal(pair.to_server.moved, 0);
}

TEST(sides_without_a_common_cipher_refuse_each_other)
{
    static const int one[] = {MBEDTLS_TLS_ECDHE_ECDSA_WITH_AES_128_GCM_SHA256, 0};
    static const int other[] = {MBEDTLS_TLS_ECDHE_ECDSA_WITH_AES_256_GCM_SHA384, 0};
    mbm_tls_options options = options_of("operator", "authority.pem");

    mbm_tls_close(&pair.client.tls);
    mbm_tls_close(&pair.server.tls);
    mbm_tls_end(&pair.client_identity);
    options.ciphers = one;
    assert_int_equal(mbm_tls_begin(&pair.client_identity, &options), 0);
    tls_pair_open(&pair, NULL);
    tls_pair_run(&pair);
    assert_int_equal(pair.server.tls.status, MBM_TLS_OPEN);
    mbm_tls_close(&pair.server.tls);
    mbm_tls_end(&pair.server_identity);
    options = options_of("server", "authority.pem");
    options.isServer = 1;
    options.ciphers = other;
    assert_int_equal(mbm_tls_begin(&pair.server_identity, &options), 0);
    tls_pair_open(&pair, NULL);
    tls_pair_run(&pair);
    assert_int_equal(pair.server.tls.status, MBM_TLS_NO_COMMON_CIPHER);
    assert_int_equal(pair.client.tls.status, MBM_TLS_REFUSED_BY_PEER);
    assert_int_equal(pair.client.tls.alert, 40);
}
