/* The places of a secure server with more clients than places: clients that do not finish their
 * handshake leave first. openssl's s_client is the client that comes late. */
#define _GNU_SOURCE
#include "await.h"
#include "program.h"
#include "tcp_server.h"
#include "test.h"
#include "tls_pair.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

enum { PLACES = 4, STEP_US = 20000, MANY = 40, JUMP_S = 10 };

static time_t ahead;        /* seconds by which the clock is fast */
static unsigned looks_left; /* looks at the clock before it jumps; 0: it does not */
static unsigned looks;      /* looks_left when the server accepts */

/* This function replaces that of libc. */
int clock_gettime(clockid_t id, struct timespec *time)
{
    const int result = (int)syscall(SYS_clock_gettime, id, time);

    time->tv_sec += ahead;
    if (looks_left > 0 && --looks_left == 0)
        ahead += JUMP_S;
    return result;
}

static mbm_tls_identity identity, operator_identity;
static mbm_tcp_listener listener;
static mbm_tcp tcps[PLACES];
static mbm_tls tlss[PLACES];
static mbm_server servers[PLACES];
static uint8_t frames[PLACES][MBM_MAX_TCP_FRAME];
static uint16_t words[1];
static mbm_registerTable holding = {.words = words, .size = 1};
static mbm_unit unit;

/* Reads register 0 of unit 17; the reply. */
static const uint8_t ask[] = {0x12, 0x34, 0, 0, 0, 6, 17, 3, 0, 0, 0, 1};
static const uint8_t reply[] = {0x12, 0x34, 0, 0, 0, 5, 17, 3, 2, 0xBE, 0xEF};

/* The first bytes of a ClientHello, and a whole one of TLS 1.2 without extensions. */
static const uint8_t part[] = {22, 3, 1, 0, 200, 1, 0, 0, 196};
static uint8_t hello[512];
static size_t hello_bytes;

static int16_t keep_hello(void *context, const uint8_t *bytes, uint16_t length)
{
    assert_true(hello_bytes + length <= sizeof hello);
    memcpy(hello + hello_bytes, bytes, length);
    hello_bytes += length;
    return (int16_t)length;
}

static int16_t read_none(void *context, uint8_t *bytes, uint16_t capacity)
{
    return 0;
}

static uint32_t no_time(void *context)
{
    return 0;
}

static void record_hello(void)
{
    const mbm_port wire = {.read = read_none, .write = keep_hello, .micros = no_time};
    static mbm_tls tls;

    hello_bytes = 0;
    assert_int_equal(mbm_tls_open(&tls, &operator_identity, &wire, NULL, NULL), MBM_TLS_HANDSHAKE);
    while (mbm_tls_poll(&tls) == MBM_TLS_HANDSHAKE && mbm_tls_pollDelay(&tls) == 0)
        ;
    assert_true(hello_bytes > 50);
    mbm_tls_close(&tls);
}

static void begin(void)
{
    ahead = 0;
    looks = 0;
    unit = (mbm_unit){.id = 17};
    words[0] = 0xBEEF;
    OK(mbm_unit_serveHoldingRegisters(&unit, &holding));
    tls_identify(&identity, "server", "authority", 1);
    tls_identify(&operator_identity, "operator", "authority", 0);
    record_hello();
    assert_int_equal(mbm_tls_listen(&listener, "127.0.0.1", "0"), 0);
}

static void leave(int place)
{
    mbm_tls_close(&tlss[place]);
    mbm_tcp_close(&tcps[place]);
}

static void end(void)
{
    for (int i = 0; i < PLACES; i++)
        leave(i);
    mbm_tcp_closeListener(&listener);
    mbm_tls_end(&identity);
    mbm_tls_end(&operator_identity);
}

fixture each_test = {begin, end};

/* One round of the server's loop. The wait also ends when there are bytes at `fd`. */
static void go_round(int fd)
{
    (void)mbm_tls_wait(tlss, tcps, PLACES, &listener, fd, STEP_US);
    looks_left = looks;
    int i = mbm_tls_accept(&listener, &identity, tlss, tcps, PLACES);
    looks_left = 0;
    if (i >= 0) {
        const mbm_port port = mbm_tls_port(&tlss[i]);

        OK(mbm_server_beginTcp(&servers[i], &port, &unit, 1, frames[i], MBM_MAX_TCP_FRAME));
    }
    for (i = 0; i < PLACES; i++)
        if (mbm_tcp_isInUse(&tcps[i]) && mbm_server_poll(&servers[i]) != MBM_OK)
            leave(i);
}

/* Connects from an address of this machine, and sends some bytes. */
static int come(const char *from, const void *bytes, size_t length)
{
    struct sockaddr_in here = {.sin_family = AF_INET}, there = {.sin_family = AF_INET};
    const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);

    assert_int_equal(inet_pton(AF_INET, from, &here.sin_addr), 1);
    there.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    there.sin_port = htons(listener.port);
    assert_int_equal(bind(fd, (const struct sockaddr *)&here, sizeof here), 0);
    assert_int_equal(connect(fd, (const struct sockaddr *)&there, sizeof there), 0);
    if (length > 0)
        assert_int_equal(write(fd, bytes, length), length);
    return fd;
}

/* The place of a client's socket at the server, -1 if it has none. */
static int place_of(int fd)
{
    struct sockaddr_in ours, theirs;
    socklen_t size = sizeof ours;

    assert_int_equal(getsockname(fd, (struct sockaddr *)&ours, &size), 0);
    for (int i = 0; i < PLACES; i++) {
        size = sizeof theirs;
        if (mbm_tcp_isInUse(&tcps[i]) &&
            getpeername(tcps[i].fd, (struct sockaddr *)&theirs, &size) == 0 &&
            theirs.sin_port == ours.sin_port && theirs.sin_addr.s_addr == ours.sin_addr.s_addr)
            return i;
    }
    return -1;
}

/* Goes round until a condition holds. */
#define UNTIL(condition)                                                                           \
    do {                                                                                           \
        unsigned rounds_ = 0;                                                                      \
                                                                                                   \
        while (!(condition)) {                                                                     \
            if (rounds_++ == PATIENCE_MS)                                                          \
                fail_msg("this did not happen: %s", #condition);                                   \
            go_round(-1);                                                                          \
        }                                                                                          \
    } while (0)

/* Connects and gets a place. */
static int get_place(const char *from, const void *bytes, size_t length, uint8_t progress)
{
    const int fd = come(from, bytes, length);

    UNTIL(place_of(fd) >= 0 && mbm_tls_progress(&tlss[place_of(fd)]) == progress);
    return fd;
}

static int get_half_open(const char *from)
{
    return get_place(from, part, sizeof part, MBM_TLS_SILENT);
}

static void close_all(const int *fds, unsigned count)
{
    while (count-- > 0)
        close(fds[count]);
}

/* The server has closed a client's connection, and the client knows it: the system needs time for
 * that on a busy machine. It is read to its end first. */
static int is_closed(int fd)
{
    uint8_t byte;
    ssize_t count;

    do
        count = recv(fd, &byte, 1, MSG_DONTWAIT);
    while (count > 0);
    return count == 0 || errno == ECONNRESET;
}

TEST(the_oldest_unfinished_handshake_leaves_for_a_new_client)
{
    int fds[2 * PLACES];
    unsigned i;

    for (i = 0; i < PLACES; i++)
        fds[i] = get_half_open("127.0.0.1");
    for (; i < 2 * PLACES; i++) {
        fds[i] = get_half_open("127.0.0.1");
        UNTIL(is_closed(fds[i - PLACES]));
        for (unsigned k = i - PLACES + 1; k <= i; k++)
            assert_true(place_of(fds[k]) >= 0);
    }
    assert_int_equal(listener.refused, 0);
    close_all(fds, 2 * PLACES);
}

/* A busy machine may stop a program between two looks at the clock. */
TEST(the_oldest_leaves_also_if_time_passes_while_handshakes_are_compared)
{
    int fds[PLACES + 1];

    for (unsigned jump = 1; jump <= PLACES; jump++) {
        for (unsigned i = 0; i <= PLACES; i++) {
            looks = i == PLACES ? jump : 0;
            fds[i] = get_half_open("127.0.0.1");
        }
        looks = 0;
        UNTIL(is_closed(fds[0]));
        for (unsigned i = 1; i <= PLACES; i++)
            assert_true(place_of(fds[i]) >= 0);
        close_all(fds, PLACES + 1);
        for (unsigned i = 0; i < PLACES; i++)
            leave((int)i);
    }
}

TEST(a_client_whose_first_message_is_there_stays_longer_than_one_that_sent_half)
{
    int fds[PLACES + 1];

    fds[0] = get_place("127.0.0.1", hello, hello_bytes, MBM_TLS_GREETED);
    for (unsigned i = 1; i <= PLACES; i++)
        fds[i] = get_half_open("127.0.0.1");
    assert_true(place_of(fds[0]) >= 0);
    UNTIL(is_closed(fds[1]));
    close_all(fds, PLACES + 1);
}

/* This holds however far its handshakes have come, and however old that of the other is. */
TEST(the_address_with_the_most_unfinished_handshakes_loses_one_first)
{
    int fds[PLACES + 1];

    fds[0] = get_half_open("127.0.0.2");
    for (unsigned i = 1; i <= PLACES; i++)
        fds[i] = get_place("127.0.0.1", hello, hello_bytes, MBM_TLS_GREETED);
    assert_true(place_of(fds[0]) >= 0);
    UNTIL(is_closed(fds[1]));
    close_all(fds, PLACES + 1);
}

TEST(clients_that_say_nothing_get_no_place)
{
    int fds[MANY], other;

    for (unsigned i = 0; i < MANY; i++)
        fds[i] = come("127.0.0.1", NULL, 0);
    other = get_half_open("127.0.0.1");
    for (unsigned i = 0; i < MANY; i++)
        assert_int_equal(place_of(fds[i]), -1);
    assert_int_equal(listener.refused, 0);
    close(other);
    close_all(fds, MANY);
}

/* --- a client that finishes its handshake --- */

/* Starts openssl's client with a request at its input. */
static void start_openssl(program *p)
{
    char address[32];
    const char *const arguments[] = {"s_client", "-connect",
                                     address,    "-quiet",
                                     "-CAfile",  TLS_FOLDER "authority.pem",
                                     "-cert",    TLS_FOLDER "operator.pem",
                                     "-key",     TLS_FOLDER "operator.key.pem",
                                     NULL};

    snprintf(address, sizeof address, "127.0.0.1:%u", listener.port);
    program_start_other(p, "openssl", arguments);
    assert_int_equal(fcntl(p->output, F_SETFL, O_NONBLOCK), 0);
    assert_int_equal(write(p->input, ask, sizeof ask), sizeof ask);
}

/* Reads the reply, once there is a part of it. */
static int is_answered(const program *p)
{
    uint8_t received[sizeof reply];
    size_t have = 0;
    ssize_t count = read(p->output, received, sizeof received);

    while (count != 0 && (have > 0 || count > 0) && have < sizeof received) {
        if (count > 0)
            have += (size_t)count;
        else
            go_round(p->output);
        count = read(p->output, received + have, sizeof received - have);
    }
    if (have > 0)
        assert_memory_equal(received, reply, sizeof reply);
    return have > 0;
}

static void stop_openssl(program *p)
{
    kill(p->pid, SIGTERM);
    (void)program_end(p);
}

/* Replaces each connection that the server has closed. Returns how many it has closed. */
static unsigned refill(int *fds, unsigned count)
{
    unsigned i, closed = 0;

    for (i = 0; i < count; i++)
        if (fds[i] < 0 || is_closed(fds[i])) {
            closed += fds[i] >= 0;
            if (fds[i] >= 0)
                close(fds[i]);
            fds[i] = come("127.0.0.1", part, sizeof part);
        }
    return closed;
}

TEST(openssl_gets_in_while_half_open_connections_fill_every_place_again)
{
    int fds[2 * PLACES];
    unsigned rounds = 0, closed = 0;
    program p;

    memset(fds, -1, sizeof fds);
    (void)refill(fds, 2 * PLACES);
    UNTIL(place_of(fds[2 * PLACES - 1]) >= 0);
    start_openssl(&p);
    while (!is_answered(&p)) {
        if (rounds++ == 10 * PATIENCE_MS)
            fail_msg("openssl gets no reply; %u were closed for others", closed);
        closed += refill(fds, 2 * PLACES);
        go_round(p.output);
    }
    assert_true(closed >= PLACES);
    stop_openssl(&p);
    close_all(fds, 2 * PLACES);
}

TEST(a_client_whose_handshake_is_over_keeps_its_place)
{
    int fds[2 * PLACES];
    program p;

    start_openssl(&p);
    UNTIL(is_answered(&p));
    for (unsigned i = 0; i < 2 * PLACES; i++)
        fds[i] = get_half_open("127.0.0.1");
    assert_int_equal(write(p.input, ask, sizeof ask), sizeof ask);
    UNTIL(is_answered(&p));
    stop_openssl(&p);
    close_all(fds, 2 * PLACES);
}
