/* A link over TLS: a session that is lost, a server that is not there yet, and a peer that never
 * answers. */
#define _GNU_SOURCE
#include "await.h"
#include "mbm_loop.h"
#include "tcp_server.h"
#include "test.h"
#include "tls_pair.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { PLACES = 4, FIRST = 100 };

static mbm_tls_identity identity;
static mbm_tcp_listener listener;
static mbm_tcp tcps[PLACES];
static mbm_tls tlss[PLACES];
static mbm_server servers[PLACES];
static uint8_t frames[PLACES][MBM_MAX_TCP_FRAME];
static uint16_t words[3] = {0xA000, 0xA001, 0xA002};
static mbm_registerTable holding = {.words = words, .base = FIRST, .size = 3};
static mbm_unit unit;
static char role[MBM_TLS_ROLE_BYTES + 1]; /* of the session that was polled last */

static void begin(void)
{
    memset(&unit, 0, sizeof unit);
    unit.id = 17;
    OK(mbm_unit_serveHoldingRegisters(&unit, &holding));
    tls_identify(&identity, "server", "authority", 1);
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

/* One round of the server's loop, without a wait. */
static void go_round(void)
{
    const int place = mbm_tls_accept(&listener, &identity, tlss, tcps, PLACES);

    if (place >= 0) {
        const mbm_port port = mbm_tls_port(&tlss[place]);

        OK(mbm_server_beginTcp(&servers[place], &port, &unit, 1, frames[place], MBM_MAX_TCP_FRAME));
    }
    for (unsigned i = 0; i < PLACES; i++) {
        if (!mbm_tcp_isInUse(&tcps[i]))
            continue;
        if (mbm_server_poll(&servers[i]) != MBM_OK)
            leave(i);
        else if (mbm_tls_role(&tlss[i]))
            strcpy(role, mbm_tls_role(&tlss[i]));
    }
}

typedef struct asker {
    mbm_tcp tcp;
    mbm_tls tls;
    mbm_client client;
    mbm_clientRequest request;
    uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
    uint16_t words[3];
} asker;

typedef struct linked {
    asker a;
    mbm_tcp_addresses addresses;
    mbm_link kept;
    mbm_linkCounters counters;
    uint8_t tls_status, status; /* what the callback found when an attempt had failed */
} linked;

static void note_failure(void *context, uint8_t event, uint8_t status)
{
    linked *l = (linked *)context;

    if (event == MBM_LINK_EVENT_CONNECTED)
        return;
    l->tls_status = l->a.tls.status;
    l->status = status;
}

static void keep(linked *l, const mbm_tls_identity *who, uint16_t at)
{
    const mbm_port socket = mbm_tcp_port(&l->a.tcp), port = mbm_tls_port(&l->a.tls);
    const mbm_linkHooks below = mbm_tcp_link(&l->a.tcp), hooks = mbm_tls_link(&l->a.tls);
    char service[8];

    memset(l, 0, sizeof *l);
    snprintf(service, sizeof service, "%u", at);
    assert_int_equal(mbm_tcp_openLater(&l->a.tcp, &l->addresses, "127.0.0.1", service), 0);
    assert_int_equal(mbm_tls_open(&l->a.tls, who, &socket, "localhost", &below), MBM_TLS_HANDSHAKE);
    OK(mbm_client_beginTcp(&l->a.client, &port, l->a.incoming, sizeof l->a.incoming, l->a.outgoing,
                           sizeof l->a.outgoing));
    OK(mbm_client_setResponseTimeout(&l->a.client, UINT16_MAX));
    OK(mbm_link_begin(&l->kept, &l->a.client, &hooks));
    OK(mbm_link_setBackoff(&l->kept, MBM_BACKOFF_FIXED, 5, 5));
    OK(mbm_link_setConnectTimeout(&l->kept, 0));
    OK(mbm_link_setRequestsWait(&l->kept, 1));
    OK(mbm_link_setCounters(&l->kept, &l->counters));
    OK(mbm_link_setCallback(&l->kept, note_failure, l));
}

/* One round of the client's program and of the server's. */
static void go_both(linked *l)
{
    const uint32_t delay = mbm_client_pollDelay(&l->a.client);

    (void)mbm_tls_wait(&l->a.tls, &l->a.tcp, 1, NULL, -1, delay < 1000 ? delay : 1000);
    (void)mbm_client_poll(&l->a.client);
    go_round();
}

#define UNTIL(linked_, condition)                                                                  \
    do {                                                                                           \
        unsigned rounds_ = 0;                                                                      \
                                                                                                   \
        while (!(condition)) {                                                                     \
            if (rounds_++ == PATIENCE_MS)                                                          \
                fail_msg("this did not happen: %s; %s", #condition,                                \
                         mbm_tls_text((linked_)->a.tls.status));                                   \
            go_both(linked_);                                                                      \
        }                                                                                          \
    } while (0)

static void read_by_link(linked *l)
{
    memset(l->a.words, 0, sizeof l->a.words);
    l->a.request =
        (mbm_clientRequest){.unit = 17, .reply = l->a.words, .replyBytes = sizeof l->a.words};
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&l->a.client, &l->a.request, FIRST, 3));
    UNTIL(l, l->a.request.status != MBM_PENDING);
    IS(MBM_OK, l->a.request.status);
    assert_memory_equal(l->a.words, words, sizeof l->a.words);
}

TEST(a_link_opens_a_session_anew_when_it_was_lost)
{
    static linked l;
    mbm_tls_identity who = {0};
    uint16_t at;
    const int reserved = tcp_reserve(&at);
    char service[8];

    snprintf(service, sizeof service, "%u", at);
    tls_identify(&who, "operator", "authority", 0);
    /* Before there is a server. */
    keep(&l, &who, at);
    UNTIL(&l, l.counters.failed == 2);
    assert_int_equal(l.tls_status, MBM_TLS_LINK_LOST);
    assert_int_equal(mbm_tls_listen(&listener, "127.0.0.1", service), 0);
    for (unsigned i = 1; i <= 3; i++) {
        read_by_link(&l);
        assert_int_equal(l.counters.connected, i);
        assert_string_equal(role, "Operator");
        for (unsigned k = 0; k < PLACES; k++)
            leave(k);
        UNTIL(&l, l.counters.lost == i);
        assert_int_equal(l.tls_status, MBM_TLS_PEER_CLOSED);
    }
    mbm_tls_close(&l.a.tls);
    mbm_tcp_close(&l.a.tcp);
    mbm_tls_end(&who);
    close(reserved);
}

TEST(a_request_finds_the_session_closed_and_is_answered_in_a_new_one)
{
    static linked l;
    mbm_tls_identity who = {0};

    tls_identify(&who, "operator", "authority", 0);
    assert_int_equal(mbm_tls_listen(&listener, "127.0.0.1", "0"), 0);
    keep(&l, &who, listener.port);
    OK(mbm_link_setRequestsWait(&l.kept, 0));
    OK(mbm_link_setBackoff(&l.kept, MBM_BACKOFF_FIXED, 1000000, 1000000));
    for (unsigned i = 1; i <= 4; i++) {
        read_by_link(&l);
        assert_int_equal(l.counters.connected, i);
        for (unsigned k = 0; k < PLACES; k++)
            leave(k);
    }
    assert_int_equal(l.counters.failed, 0);
    mbm_tls_close(&l.a.tls);
    mbm_tcp_close(&l.a.tcp);
    mbm_tls_end(&who);
}

TEST(a_peer_that_never_answers_is_a_timeout_of_the_connection)
{
    const char *const reasons[] = {"the connection was not made in time",
                                   "the handshake took too long"};
    static linked l;
    mbm_tls_identity who = {0};
    int silent;
    uint16_t at;

    silent = tcp_listen(&at);
    tls_identify(&who, "operator", "authority", 0);
    who.handshakeUs = 20000;
    keep(&l, &who, at);
    OK(mbm_link_setRequestsWait(&l.kept, 0));
    l.a.request =
        (mbm_clientRequest){.unit = 17, .reply = l.a.words, .replyBytes = sizeof l.a.words};
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&l.a.client, &l.a.request, FIRST, 3));
    UNTIL(&l, l.a.request.status != MBM_PENDING);
    IS(MBM_CONNECT_TIMED_OUT, l.a.request.status);
    IS(MBM_CONNECT_TIMED_OUT, l.status);
    assert_int_equal(l.tls_status, MBM_TLS_TIMED_OUT);
    assert_string_equal(mbm_status_text(l.status), reasons[0]);
    assert_string_equal(mbm_tls_text(l.tls_status), reasons[1]);
    mbm_tls_close(&l.a.tls);
    mbm_tcp_close(&l.a.tcp);
    mbm_tls_end(&who);
    close(silent);
}

/* --- in a loop --- */

static mbm_loop loop;
static mbm_loop_place in_loop[PLACES + 2];
static mbm_loop_entry accepting, served[PLACES], asking;

static uint32_t lesser(uint32_t one, uint32_t other)
{
    return one < other ? one : other;
}

static uint32_t poll_secure_client(mbm_loop_entry *entry)
{
    asker *a = (asker *)entry->context;

    (void)mbm_client_poll(&a->client);
    return lesser(mbm_client_pollDelay(&a->client), mbm_tls_pollDelay(&a->tls));
}

static uint32_t poll_secure_server(mbm_loop_entry *entry)
{
    const size_t place = (size_t)(entry - served);

    if (mbm_server_poll(&servers[place]) != MBM_OK) {
        mbm_loop_remove(entry);
        leave((unsigned)place);
        return MBM_LOOP_FOREVER;
    }
    return lesser(mbm_server_pollDelay(&servers[place]), mbm_tls_pollDelay(&tlss[place]));
}

static uint32_t accept_one(mbm_loop_entry *entry)
{
    const int place = mbm_tls_accept(&listener, &identity, tlss, tcps, PLACES);

    (void)entry;
    if (place >= 0) {
        const mbm_port port = mbm_tls_port(&tlss[place]);

        OK(mbm_server_beginTcp(&servers[place], &port, &unit, 1, frames[place], MBM_MAX_TCP_FRAME));
        served[place].poll = poll_secure_server;
        assert_int_equal(mbm_loop_addTcp(&loop, &served[place], &tcps[place]), 0);
    }
    return MBM_LOOP_FOREVER;
}

#define UNTIL_IN_LOOP(condition)                                                                   \
    do {                                                                                           \
        while (!(condition))                                                                       \
            assert_true(mbm_loop_wait(&loop, MBM_LOOP_FOREVER) >= 0);                              \
    } while (0)

TEST(a_loop_polls_client_and_server_and_a_lost_session_comes_back)
{
    static linked l;
    mbm_tls_identity own = {0};

    assert_int_equal(mbm_tls_listen(&listener, "127.0.0.1", "0"), 0);
    tls_identify(&own, "operator", "authority", 0);
    keep(&l, &own, listener.port);
    memset(&loop, 0, sizeof loop);
    assert_int_equal(mbm_loop_open(&loop, in_loop, COUNT(in_loop)), 0);
    accepting.poll = accept_one;
    assert_int_equal(mbm_loop_addListener(&loop, &accepting, &listener), 0);
    asking.poll = poll_secure_client;
    asking.context = &l.a;
    assert_int_equal(mbm_loop_addTcp(&loop, &asking, &l.a.tcp), 0);
    for (unsigned round = 1; round <= 3; round++) {
        UNTIL_IN_LOOP(l.counters.connected == round);
        l.a.request =
            (mbm_clientRequest){.unit = 17, .reply = l.a.words, .replyBytes = sizeof l.a.words};
        IS(MBM_PENDING, mbm_client_readHoldingRegisters(&l.a.client, &l.a.request, FIRST, 3));
        mbm_loop_wake(&asking);
        UNTIL_IN_LOOP(l.a.request.status != MBM_PENDING);
        IS(MBM_OK, l.a.request.status);
        assert_memory_equal(l.a.words, words, sizeof words);
        for (unsigned i = 0; i < PLACES; i++) {
            mbm_loop_remove(&served[i]);
            leave(i);
        }
        UNTIL_IN_LOOP(l.counters.lost == round);
    }
    for (unsigned i = 0; i < PLACES; i++)
        mbm_loop_remove(&served[i]);
    mbm_loop_remove(&asking);
    mbm_loop_remove(&accepting);
    mbm_tls_close(&l.a.tls);
    mbm_tcp_close(&l.a.tcp);
    mbm_loop_close(&loop);
    mbm_tls_end(&own);
}
