/* The links of the Linux ports: a program that begins before its terminal, the network or the name
 * of its server is there, and terminals and servers that come and go. The test plays the system's
 * lookup and its network. The devices are servers of mbm, on the other end of a pty, and
 * libmodbus's replies over TCP. */
#define _GNU_SOURCE
#include "await.h"
#include "client.h"
#include "pty.h"
#include "tcp_peer.h"
#include "tcp_server.h"
#include "test.h"

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

enum { UNIT = 17, FIRST_MS = 5, MOST_MS = 20 };

static asker a;
static mbm_link kept;
static mbm_linkCounters counters;
static mbm_clientRequest request;
static uint16_t word;
static char reason[100]; /* of the last attempt that failed, as a program prints it */

/* --- the system, as the test wants it --- */

static int lookup_fails_with; /* an EAI_ constant, or 0 */
static int has_network;
static unsigned lookups, count_of_addresses;
static uint16_t ports[2]; /* the server's ports on this machine, one for each address */

int getaddrinfo(const char *host, const char *name, const struct addrinfo *hints,
                struct addrinfo **found)
{
    static struct sockaddr_in places[2];
    static struct addrinfo all[2];

    assert_string_equal(host, "meter.plant.example");
    assert_string_equal(name, "502");
    lookups++;
    if (lookup_fails_with != 0)
        return lookup_fails_with;
    for (unsigned i = 0; i < count_of_addresses; i++) {
        places[i].sin_family = AF_INET;
        /* TCP has no way to a group of hosts: this fails as without a network. */
        places[i].sin_addr.s_addr = htonl(has_network ? INADDR_LOOPBACK : INADDR_ALLHOSTS_GROUP);
        places[i].sin_port = htons(ports[i]);
        all[i].ai_family = AF_INET;
        all[i].ai_addr = (struct sockaddr *)&places[i];
        all[i].ai_addrlen = sizeof places[i];
        all[i].ai_next = i + 1 < count_of_addresses ? &all[i + 1] : NULL;
    }
    *found = all;
    return 0;
}

void freeaddrinfo(struct addrinfo *found) {}

/* --- a program with a link --- */

static void note(void *context, uint8_t event, uint8_t status)
{
    if (event == MBM_LINK_EVENT_FAILED)
        snprintf(reason, sizeof reason, "%s",
                 a.service[0] ? mbm_tcp_text(&a.tcp) : strerror(a.tty.error));
}

static void keep(const mbm_linkHooks *hooks)
{
    memset(&counters, 0, sizeof counters);
    memset(&kept, 0, sizeof kept);
    reason[0] = '\0';
    OK(mbm_client_setResponseTimeout(&a.client, PATIENCE_MS));
    OK(mbm_link_begin(&kept, &a.client, hooks));
    OK(mbm_link_setBackoff(&kept, MBM_BACKOFF_EXPONENTIAL, FIRST_MS, MOST_MS));
    OK(mbm_link_setCounters(&kept, &counters));
    OK(mbm_link_setCallback(&kept, note, NULL));
    OK(mbm_link_setRequestsWait(&kept, 1));
}

static void (*device)(void);

/* Polls until a condition holds, and sleeps between as a program does. */
#define UNTIL(condition)                                                                           \
    do {                                                                                           \
        unsigned polls_ = 0;                                                                       \
                                                                                                   \
        while (!(condition)) {                                                                     \
            if (polls_++ == PATIENCE_MS)                                                           \
                fail_msg("this did not happen: %s; %s", #condition, reason);                       \
            wait_once();                                                                           \
            (void)mbm_client_poll(&a.client);                                                      \
            if (device)                                                                            \
                device();                                                                          \
        }                                                                                          \
    } while (0)

static void wait_once(void)
{
    const uint32_t delay = mbm_client_pollDelay(&a.client), most = device ? 1000 : 1000000;
    const uint32_t time = delay < most ? delay : most;

    if (a.service[0])
        assert_in_range(mbm_tcp_wait(&a.tcp, 1, NULL, -1, time), 0, 1);
    else
        assert_in_range(mbm_tty_wait(&a.tty, time), 0, 1);
}

static void read_word(uint16_t address, uint16_t expected)
{
    request = asker_request(UNIT, &word, sizeof word, NULL);
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&a.client, &request, address, 1));
    UNTIL(request.status != MBM_PENDING);
    IS(MBM_OK, request.status);
    assert_int_equal(word, expected);
}

/* --- TCP --- */

static void begin_tcp(void)
{
    memset(&a, 0, sizeof a);
    strcpy(a.service, "502");
    a.port = mbm_tcp_port(&a.tcp);
    device = NULL;
    lookup_fails_with = 0;
    has_network = 1;
    lookups = 0;
    count_of_addresses = 1;
    OK(mbm_client_beginTcp(&a.client, &a.port, a.incoming, sizeof a.incoming, a.outgoing,
                           sizeof a.outgoing));
    assert_int_equal(mbm_tcp_openLater(&a.tcp, &a.addresses, "meter.plant.example", a.service), 0);
    assert_int_equal(mbm_tcp_isInUse(&a.tcp), 1);
    assert_int_equal(lookups, 0);
    mbm_linkHooks hooks = mbm_tcp_link(&a.tcp);
    keep(&hooks);
}

TEST(a_program_begins_before_the_network_and_the_name_are_there)
{
    tcp_peer *peer = tcp_peer_new();

    begin_tcp();
    lookup_fails_with = EAI_AGAIN;
    UNTIL(counters.failed == 2);
    assert_string_equal(reason, gai_strerror(EAI_AGAIN));
    assert_int_equal(lookups, 2);
    lookup_fails_with = 0;
    has_network = 0;
    UNTIL(counters.failed == 4);
    assert_string_equal(reason, strerror(ENETUNREACH));
    has_network = 1;
    ports[0] = tcp_peer_start(peer, 0);
    read_word(5, tcp_peer_word(5));
    assert_int_equal(a.tcp.error, 0);
    assert_int_equal(a.tcp.lookupError, 0);
    mbm_tcp_close(&a.tcp);
    tcp_peer_stop(peer);
}

TEST(a_server_that_moves_to_another_address_is_found_again)
{
    tcp_peer *first = tcp_peer_new(), *second = tcp_peer_new();

    begin_tcp();
    ports[0] = tcp_peer_start(first, 0);
    read_word(5, tcp_peer_word(5));
    ports[0] = tcp_peer_start(second, 0);
    tcp_peer_stop(first);
    UNTIL(counters.connected == 2);
    read_word(6, tcp_peer_word(6));
    /* While names cannot be looked up, the last addresses serve. */
    lookup_fails_with = EAI_AGAIN;
    tcp_peer_hang_up(second);
    UNTIL(counters.connected == 3);
    read_word(7, tcp_peer_word(7));
    mbm_tcp_close(&a.tcp);
    tcp_peer_stop(second);
}

/* The first address is a listener whose queue is full. */
TEST(an_address_that_never_answers_does_not_keep_the_link_from_the_next)
{
    tcp_peer *peer = tcp_peer_new();

    begin_tcp();
    int listener = tcp_listenOnFree(&ports[0]);
    assert_int_equal(listen(listener, 0), 0);
    int filler = tcp_connectTo(ports[0]);
    ports[1] = tcp_peer_start(peer, 0);
    count_of_addresses = 2;
    OK(mbm_link_setConnectTimeout(&kept, 50));
    UNTIL(counters.failed == 1);
    assert_string_equal(reason, strerror(ETIMEDOUT));
    read_word(5, tcp_peer_word(5));
    mbm_tcp_close(&a.tcp);
    tcp_peer_stop(peer);
    close(filler);
    close(listener);
}

TEST(a_server_that_cannot_be_noted_is_refused)
{
    static mbm_tcp tcp;
    static mbm_tcp_addresses addresses;
    char name[MBM_TCP_HOST_BYTES + 1];

    memset(name, 'a', sizeof name);
    name[MBM_TCP_HOST_BYTES] = '\0';
    FAILS(ENAMETOOLONG, mbm_tcp_openLater(&tcp, &addresses, name, "502"));
    FAILS(ENAMETOOLONG, mbm_tcp_openLater(&tcp, &addresses, "host", name));
    assert_int_equal(mbm_tcp_isInUse(&tcp), 0);
    name[MBM_TCP_HOST_BYTES - 1] = '\0';
    assert_int_equal(mbm_tcp_openLater(&tcp, &addresses, name, "502"), 0);
    FAILS(EBUSY, mbm_tcp_openLater(&tcp, &addresses, "host", "502"));
    mbm_tcp_close(&tcp);
}

/* --- a terminal --- */

static pty line;
static mbm_tty far_end;
static mbm_server server;
static mbm_unit unit;
static uint16_t words[1];
static mbm_registerTable table = {.words = words, .size = 1};
static uint8_t frame[MBM_MAX_TCP_FRAME];
static char folder[] = "/tmp/mbm-link-XXXXXX", path[64];

static void serve(void)
{
    (void)mbm_server_poll(&server);
}

/* The adapter is plugged in: with another terminal, at the same path. */
static void plug_in(void)
{
    mbm_port port = mbm_tty_port(&far_end);

    pty_open(&line);
    assert_int_equal(symlink(line.path, path), 0);
    memset(&far_end, 0, sizeof far_end);
    assert_int_equal(mbm_tty_attach(&far_end, line.ours), 0);
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    OK(mbm_server_setBaudRate(&server, 115200));
    device = serve;
}

static void unplug(void)
{
    device = NULL;
    mbm_tty_detach(&far_end);
    unlink(path);
    pty_close(&line);
}

TEST(a_terminal_that_is_not_there_yet_or_was_unplugged_is_opened_when_it_comes)
{
    const mbm_tty_options options = {.baud = 115200, .parity = 'N', .stop = 1};

    assert_non_null(mkdtemp(folder));
    snprintf(path, sizeof path, "%s/tty", folder);
    unit = (mbm_unit){.id = UNIT};
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    memset(&a, 0, sizeof a);
    a.port = mbm_tty_port(&a.tty);
    device = NULL;
    OK(mbm_client_beginRtu(&a.client, &a.port, a.incoming, sizeof a.incoming));
    OK(mbm_client_setBaudRate(&a.client, options.baud));
    assert_int_equal(mbm_tty_openLater(&a.tty, path, &options), 0);
    mbm_linkHooks hooks = mbm_tty_link(&a.tty);
    keep(&hooks);
    for (unsigned i = 1; i <= 3; i++) {
        /* While it is closed, the wait sleeps. */
        UNTIL(counters.failed >= 2 * i);
        assert_string_equal(reason, strerror(ENOENT));
        words[0] = (uint16_t)(0x1200 + i);
        plug_in();
        UNTIL(counters.connected == i);
        read_word(0, words[0]);
        unplug();
        UNTIL(counters.lost == i);
    }
    mbm_tty_close(&a.tty);
    IS(MBM_LINK_LOST, mbm_tty_connect(&a.tty));
    assert_int_equal(a.tty.error, EBADF);
    FAILS(EBADF, mbm_tty_wait(&a.tty, 0));
    rmdir(folder);
}

TEST(a_terminal_that_cannot_be_noted_is_refused)
{
    const mbm_tty_options right = {.baud = 9600, .parity = 'E', .stop = 1},
                          wrong = {.baud = 9600, .parity = 'X', .stop = 1};
    char name[MBM_TTY_PATH_BYTES + 1];
    mbm_tty tty = {0};

    memset(name, 'a', sizeof name);
    name[MBM_TTY_PATH_BYTES] = '\0';
    FAILS(ENAMETOOLONG, mbm_tty_openLater(&tty, name, &right));
    FAILS(EINVAL, mbm_tty_openLater(&tty, "/dev/tty", &wrong));
    FAILS(EBADF, mbm_tty_wait(&tty, 0));
    /* One that could not be opened is not opened later. */
    FAILS(ENOENT, mbm_tty_openWith(&tty, "/dev/there-is-none", &right));
    IS(MBM_LINK_LOST, mbm_tty_connect(&tty));
    assert_int_equal(tty.error, EBADF);
}
