/* TLS over sockets against openssl: its s_client asks mbm's server, and mbm's client asks its
 * s_server. Also clients that speak no TLS or go away, and many connections. */
#define _GNU_SOURCE
#include "await.h"
#include "program.h"
#include "tcp_server.h"
#include "test.h"
#include "tls_pair.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

enum {
    PLACES = 32,
    FIRST = 100,
    COUNT_OF_WORDS = 10,
    STEP_US = 20000,
    AT_ONCE = 0,
    WITHOUT_REPLY = 0
};

static mbm_tls_identity identity;
static mbm_tcp_listener listener;
static mbm_tcp tcps[PLACES];
static mbm_tls tlss[PLACES];
static mbm_server servers[PLACES];
static uint8_t frames[PLACES][MBM_MAX_TCP_FRAME];
static uint16_t words[COUNT_OF_WORDS];
static mbm_registerTable holding = {.words = words, .base = FIRST, .size = COUNT_OF_WORDS};
static mbm_unit unit;
static uint8_t ended;                     /* the status of the connection that ended last */
static unsigned endings;                  /* how many have ended */
static char role[MBM_TLS_ROLE_BYTES + 1]; /* of the connection that was polled last */
static char address[32];

static const char authorities[] = TLS_FOLDER "authority.pem";

/* Reads registers 100 to 102 of unit 17, with the number 0x1234; the reply. */
static const uint8_t ask[] = {0x12, 0x34, 0, 0, 0, 6, 17, 3, 0, FIRST, 0, 3};
static const uint8_t reply[] = {0x12, 0x34, 0, 0, 0, 9, 17, 3, 6, 0xA0, 0, 0xA0, 1, 0xA0, 2};

static void begin(void)
{
    unit = (mbm_unit){.id = 17};
    for (unsigned i = 0; i < COUNT_OF_WORDS; i++)
        words[i] = (uint16_t)(0xA000 + i);
    OK(mbm_unit_serveHoldingRegisters(&unit, &holding));
    tls_identify(&identity, "server", "authority", 1);
    assert_int_equal(mbm_tcp_listen(&listener, "127.0.0.1", "0"), 0);
    snprintf(address, sizeof address, "127.0.0.1:%u", listener.port);
    endings = 0;
    ended = MBM_TLS_CLOSED;
    memset(role, 0, sizeof role);
}

static void leave(unsigned place)
{
    mbm_tls_close(&tlss[place]);
    mbm_tcp_close(&tcps[place]);
}

static void end(void)
{
    for (unsigned i = 0; i < PLACES; i++)
        leave(i);
    mbm_tcp_closeListener(&listener);
    mbm_tls_end(&identity);
}

fixture each_test = {begin, end};

static void keep_role(const mbm_tls *tls)
{
    const char *found = mbm_tls_role(tls);

    if (tls->status == MBM_TLS_OPEN)
        strcpy(role, found ? found : "(none)");
}

/* One round of the server's loop. The wait also ends when there are bytes at `fd`. */
static void go_round_after(int fd, uint32_t timeoutUs)
{
    int i;

    (void)mbm_tls_wait(tlss, tcps, PLACES, &listener, fd, timeoutUs);
    while ((i = mbm_tcp_accept(&listener, tcps, PLACES)) >= 0) {
        const mbm_port socket = mbm_tcp_port(&tcps[i]), port = mbm_tls_port(&tlss[i]);

        assert_int_equal(mbm_tls_open(&tlss[i], &identity, &socket, NULL, NULL), MBM_TLS_HANDSHAKE);
        OK(mbm_server_beginTcp(&servers[i], &port, &unit, 1, frames[i], MBM_MAX_TCP_FRAME));
    }
    for (i = 0; i < PLACES; i++) {
        uint8_t status;

        if (!mbm_tcp_isInUse(&tcps[i]))
            continue;
        status = mbm_server_poll(&servers[i]);
        keep_role(&tlss[i]);
        if (status != MBM_OK) {
            ended = tlss[i].status;
            endings++;
            leave((unsigned)i);
        }
    }
}

static void go_round(int fd)
{
    go_round_after(fd, STEP_US);
}

/* Starts openssl s_client with a certificate, or without one, and more arguments. */
static void start_client(program *p, const char *name, const char *const *more)
{
    char certificate[128], key[128];
    const char *arguments[30] = {"s_client",
                                 "-connect",
                                 address,
                                 "-quiet",
                                 "-CAfile",
                                 authorities,
                                 "-verify_return_error",
                                 "-verify_hostname",
                                 "localhost"};
    unsigned count = 9;

    snprintf(certificate, sizeof certificate, TLS_FOLDER "%s.pem", name ? name : "");
    snprintf(key, sizeof key, TLS_FOLDER "%s.key.pem", name ? name : "");
    if (name) {
        arguments[count++] = "-cert";
        arguments[count++] = certificate;
        arguments[count++] = "-key";
        arguments[count++] = key;
    }
    while (more && *more)
        arguments[count++] = *more++;
    program_start_other(p, "openssl", arguments);
}

/* Lets a client ask one question, and the server answer or refuse it. Returns the number of
 * bytes that the client received. */
static size_t ask_once(const char *name, const char *const *more)
{
    uint8_t received[64];
    size_t have = 0;
    program p;

    start_client(&p, name, more);
    assert_int_equal(fcntl(p.output, F_SETFL, O_NONBLOCK), 0);
    assert_int_equal(write(p.input, ask, sizeof ask), sizeof ask);
    for (unsigned rounds = 0; have < sizeof reply && endings == 0; rounds++) {
        ssize_t count;

        if (rounds == PATIENCE_MS)
            fail_msg("no reply, and no end");
        go_round(p.output);
        count = read(p.output, received + have, sizeof received - have);
        if (count > 0)
            have += (size_t)count;
    }
    if (have > 0) {
        assert_int_equal(have, sizeof reply);
        assert_memory_equal(received, reply, sizeof reply);
    }
    kill(p.pid, SIGTERM);
    (void)program_end(&p);
    while (endings == 0)
        go_round(-1);
    return have;
}

static void is_refused(const char *name, const char *const *more, uint8_t reason)
{
    endings = 0;
    memset(role, 0, sizeof role);
    assert_int_equal(ask_once(name, more), WITHOUT_REPLY);
    if (ended != reason)
        fail_msg("%s: %s", name ? name : "no certificate", mbm_tls_text(ended));
    assert_string_equal(role, "");
}

static void is_answered(const char *name, const char *const *more, const char *expected)
{
    endings = 0;
    assert_int_equal(ask_once(name, more), sizeof reply);
    assert_string_equal(role, expected);
}

#define ARGUMENTS(...) ((const char *const[]){__VA_ARGS__, NULL})

TEST(openssl_asks_and_gets_the_bytes_of_the_reply)
{
    is_answered("operator", NULL, "Operator");
    is_answered("norole", NULL, "(none)");
    is_answered("rsa", ARGUMENTS("-tls1_2"), "Operator");
    is_answered("viewer", ARGUMENTS("-cipher", "ECDHE-ECDSA-AES128-GCM-SHA256", "-tls1_2"),
                "Viewer");
}

TEST(openssl_without_a_right_certificate_is_refused)
{
    is_refused(NULL, NULL, MBM_TLS_NO_CERTIFICATE);
    is_refused("stranger", NULL, MBM_TLS_UNKNOWN_AUTHORITY);
    is_refused("expired", NULL, MBM_TLS_EXPIRED);
    is_refused("future", NULL, MBM_TLS_NOT_YET_VALID);
    is_refused("role-printable", NULL, MBM_TLS_BAD_ROLE);
}

/* Mbed TLS does not know the extension, and so must refuse it where it is critical. */
TEST_ROW(a_critical_role_is_refused, is_refused("role-critical", NULL, MBM_TLS_BAD_CERTIFICATE))

TEST(other_versions_and_ciphers_that_hide_nothing_are_refused)
{
    is_refused("operator", ARGUMENTS("-tls1_1", "-cipher", "DEFAULT:@SECLEVEL=0"),
               MBM_TLS_NO_COMMON_VERSION);
    is_refused("operator", ARGUMENTS("-tls1_3"), MBM_TLS_NO_COMMON_CIPHER);
    is_refused("operator", ARGUMENTS("-tls1", "-cipher", "DEFAULT:@SECLEVEL=0"),
               MBM_TLS_NO_COMMON_VERSION);
    is_refused("operator", ARGUMENTS("-tls1_2", "-cipher", "ECDHE-ECDSA-NULL-SHA:@SECLEVEL=0"),
               MBM_TLS_NO_COMMON_CIPHER);
}

/* Polls until the server has ended a connection, and reads what it sent. */
static size_t read_to_end(int fd, uint8_t *bytes, size_t capacity)
{
    size_t have = 0;
    ssize_t count;

    while (endings == 0)
        go_round(-1);
    while ((count = read(fd, bytes + have, capacity - have)) > 0)
        have += (size_t)count;
    close(fd);
    return have;
}

TEST(a_client_without_tls_is_refused)
{
    int fd = tcp_connectTo(listener.port);
    uint8_t received[64];

    assert_int_equal(write(fd, ask, sizeof ask), sizeof ask);
    size_t have = read_to_end(fd, received, sizeof received);
    assert_int_equal(ended, MBM_TLS_NOT_TLS);
    /* An alert at most: 7 bytes that begin with 21. */
    assert_true(have == 0 || (have == 7 && received[0] == 21));
}

TEST(a_client_that_closes_its_half_in_the_handshake_is_dropped)
{
    static const uint8_t part[] = {22, 3, 1, 0, 200, 1, 0, 0, 196};
    int fd = tcp_connectTo(listener.port);
    uint8_t received[64];

    assert_int_equal(write(fd, part, sizeof part), sizeof part);
    assert_int_equal(shutdown(fd, SHUT_WR), 0);
    (void)read_to_end(fd, received, sizeof received);
    assert_int_equal(ended, MBM_TLS_LINK_LOST);
}

/* --- mbm's client --- */

typedef struct asker {
    mbm_tcp tcp;
    mbm_tls tls;
    mbm_client client;
    mbm_clientRequest request;
    uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
    uint16_t words[3];
} asker;

static void start_asking(asker *a, const mbm_tls_identity *who, const char *name)
{
    const mbm_port socket = mbm_tcp_port(&a->tcp), port = mbm_tls_port(&a->tls);

    assert_int_equal(mbm_tls_open(&a->tls, who, &socket, name, NULL), MBM_TLS_HANDSHAKE);
    OK(mbm_client_beginTcp(&a->client, &port, a->incoming, sizeof a->incoming, a->outgoing,
                           sizeof a->outgoing));
    OK(mbm_client_setResponseTimeout(&a->client, UINT16_MAX));
    memset(&a->request, 0, sizeof a->request);
    a->request.unit = 17;
    a->request.reply = a->words;
    a->request.replyBytes = sizeof a->words;
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&a->client, &a->request, FIRST, 3));
}

static void stop_asking(asker *a)
{
    mbm_tls_close(&a->tls);
    mbm_tcp_close(&a->tcp);
}

/* Lets mbm's client ask openssl s_server, whose standard input and output the test plays the
 * device on. Returns the status of the request. `tls` is closed, but for its reasons. */
static uint8_t ask_server(asker *a, const char *server, const char *client, const char *version)
{
    struct sockaddr_un place = {.sun_family = AF_UNIX};
    char folder[] = "/tmp/mbm-tls-XXXXXX", certificate[128], key[128];
    const char *arguments[] = {"s_server",
                               "-unix",
                               place.sun_path,
                               "-quiet",
                               "-naccept",
                               "1",
                               "-CAfile",
                               authorities,
                               "-Verify",
                               "1",
                               "-verify_return_error",
                               "-cert",
                               certificate,
                               "-key",
                               key,
                               "-cipher",
                               "DEFAULT:@SECLEVEL=0",
                               version,
                               NULL};
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    mbm_tls_identity who = {0};
    uint8_t received[64], status;
    size_t have = 0;
    program p;

    memset(a, 0, sizeof *a);
    assert_non_null(mkdtemp(folder));
    snprintf(place.sun_path, sizeof place.sun_path, "%s/s", folder);
    snprintf(certificate, sizeof certificate, TLS_FOLDER "%s.pem", server);
    snprintf(key, sizeof key, TLS_FOLDER "%s.key.pem", server);
    program_start_other(&p, "openssl", arguments);
    AWAIT(connect(fd, (const struct sockaddr *)&place, sizeof place) == 0);
    tls_identify(&who, client, "authority", 0);
    assert_int_equal(mbm_tcp_attach(&a->tcp, fd), 0);
    start_asking(a, &who, "localhost");
    assert_int_equal(fcntl(p.output, F_SETFL, O_NONBLOCK), 0);
    while (mbm_client_poll(&a->client) == MBM_PENDING) {
        ssize_t count;

        (void)mbm_tls_wait(&a->tls, &a->tcp, 1, NULL, p.output, STEP_US);
        count = read(p.output, received + have, sizeof received - have);
        if (count > 0 && (have += (size_t)count) == sizeof ask) {
            uint8_t answer[sizeof reply];

            assert_memory_equal(received + 2, ask + 2, sizeof ask - 2);
            memcpy(answer, reply, sizeof reply);
            memcpy(answer, received, 2);
            assert_int_equal(write(p.input, answer, sizeof answer), sizeof answer);
        }
    }
    kill(p.pid, SIGTERM);
    (void)program_end(&p);
    unlink(place.sun_path);
    rmdir(folder);
    if (a->request.status != MBM_OK)
        assert_int_equal(have, 0);
    mbm_tcp_close(&a->tcp);
    status = a->tls.status;
    mbm_tls_close(&a->tls);
    a->tls.status = status;
    mbm_tls_end(&who);
    return a->request.status;
}

TEST(openssl_answers_a_request)
{
    static asker a;

    IS(MBM_OK, ask_server(&a, "server", "operator", NULL));
    assert_memory_equal(a.words, words, sizeof a.words);
    IS(MBM_OK, ask_server(&a, "server", "rsa", "-tls1_2"));
}

TEST(a_server_without_a_right_certificate_gets_no_request)
{
    static asker a;

    IS(MBM_LINK_LOST, ask_server(&a, "stranger-server", "operator", NULL));
    assert_int_equal(a.tls.status, MBM_TLS_UNKNOWN_AUTHORITY);
    IS(MBM_LINK_LOST, ask_server(&a, "expired-server", "operator", NULL));
    assert_int_equal(a.tls.status, MBM_TLS_EXPIRED);
    /* It is a client's. */
    IS(MBM_LINK_LOST, ask_server(&a, "operator", "operator", NULL));
    assert_int_equal(a.tls.status, MBM_TLS_OTHER_NAME);
    IS(MBM_LINK_LOST, ask_server(&a, "server", "operator", "-tls1_1"));
    assert_int_equal(a.tls.status, MBM_TLS_NO_COMMON_VERSION);
}

/* The server closes the socket after its alert, while the client still sends. */
TEST(a_server_that_refuses_the_client_says_why)
{
    static asker a;

    IS(MBM_LINK_LOST, ask_server(&a, "server", "stranger", "-tls1_2"));
    assert_int_equal(a.tls.status, MBM_TLS_REFUSED_BY_PEER);
    assert_int_equal(a.tls.alert, 48);
    IS(MBM_LINK_LOST, ask_server(&a, "server", "expired", "-tls1_2"));
    assert_int_equal(a.tls.status, MBM_TLS_REFUSED_BY_PEER);
    assert_int_equal(a.tls.alert, 45);
}

TEST(many_connections_keep_their_roles_apart)
{
    const unsigned count = getenv("MBM_TRANSACTIONS") ? 6 : PLACES;
    const char *const names[] = {"operator", "viewer", "norole"};
    const char *const roles[] = {"Operator", "Viewer", "(none)"};
    static mbm_tls_identity who[3];
    static asker askers[PLACES];
    char service[8];
    unsigned pending;

    memset(askers, 0, sizeof askers);
    snprintf(service, sizeof service, "%u", listener.port);
    for (unsigned i = 0; i < 3; i++)
        tls_identify(&who[i], names[i], "authority", 0);
    for (unsigned i = 0; i < count; i++) {
        assert_int_equal(mbm_tcp_attach(&askers[i].tcp, tcp_connectTo(listener.port)), 0);
        start_asking(&askers[i], &who[i % 3], "localhost");
        go_round_after(-1, AT_ONCE);
    }
    do {
        for (unsigned i = pending = 0; i < count; i++)
            pending += mbm_client_poll(&askers[i].client) == MBM_PENDING;
        go_round_after(-1, AT_ONCE);
    } while (pending > 0);
    /* Connections were accepted in the order in which they were made. */
    for (unsigned i = 0; i < count; i++) {
        if (askers[i].request.status != MBM_OK)
            fail_msg("%u: %s, %s; %s", i, mbm_status_text(askers[i].request.status),
                     mbm_tls_text(askers[i].tls.status), mbm_tls_text(tlss[i].status));
        assert_memory_equal(askers[i].words, words, sizeof askers[i].words);
        keep_role(&tlss[i]);
        assert_string_equal(role, roles[i % 3]);
    }
    for (unsigned i = 0; i < count; i++)
        stop_asking(&askers[i]);
    while (endings < count)
        go_round(-1);
    assert_int_equal(ended, MBM_TLS_PEER_CLOSED);
    for (unsigned i = 0; i < 3; i++)
        mbm_tls_end(&who[i]);
}
