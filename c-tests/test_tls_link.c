/* A link over TLS: a session that is lost, a server that is not there yet, and a peer that never
 * answers. */
#define _GNU_SOURCE
#include "await.h"
#include "mbm_loop.h"
#include "tcp_server.h"
#include "test.h"
#include "tls_pair.h"

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
    unit = (mbm_unit){.id = 17};
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
    uint16_t at;

    int silent = tcp_listenOnFree(&at);
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

/* The role of a certificate: how it is found in the extensions, and what a server does with it. */

/* --- extensions as in a certificate --- */

/* A sequence of extensions: a basic constraint, and the roles that a test adds. */
typedef struct extensions {
    uint8_t bytes[512];
    size_t length;
} extensions;

#define OID 0x06, 0x0B, 0x2B, 0x06, 0x01, 0x04, 0x01, 0x83, 0x89, 0x0C, 0x86, 0x22, 0x01

static const uint8_t constraint[] = {0x30, 0x0C, 0x06, 0x03, 0x55, 0x1D, 0x13,
                                     0x01, 0x01, 0xFF, 0x04, 0x02, 0x30, 0x00};
static const uint8_t role_plain[] = {0x30, 0x13, OID, 0x04, 0x04, 0x0C, 0x02, 'A', 'B'};
static const uint8_t role_critical[] = {0x30, 0x16, OID,  0x01, 0x01, 0xFF,
                                        0x04, 0x04, 0x0C, 0x02, 'C',  'D'};
/* Another OID that begins with the same bytes, and one that is longer. */
static const uint8_t other_oid[] = {0x30, 0x13, 0x06, 0x0B, 0x2B, 0x06, 0x01,
                                    0x04, 0x01, 0x83, 0x89, 0x0C, 0x86, 0x22,
                                    0x02, 0x04, 0x04, 0x0C, 0x02, 'E',  'F'};

static void add(extensions *e, const uint8_t *bytes, size_t length)
{
    if (e->length == 0) {
        e->bytes[0] = 0x30;
        e->bytes[1] = 0;
        e->length = 2;
    }
    memcpy(e->bytes + e->length, bytes, length);
    e->length += length;
    e->bytes[1] = (uint8_t)(e->length - 2);
}

/* Looks for the role in a copy that ends where the extensions do, so that the address sanitizer and
 * valgrind see a byte too many. */
static int find(const extensions *e, size_t length, char *found)
{
    uint8_t *copy = (uint8_t *)malloc(length ? length : 1);
    mbedtls_x509_buf buffer = {.len = length, .p = copy};

    memcpy(copy, e->bytes, length);
    memset(found, 'x', MBM_TLS_ROLE_BYTES + 1);
    int result = mbm_tls_findRole(&buffer, found);
    free(copy);
    if (result != MBM_TLS_ONE_ROLE)
        assert_int_equal(found[0], 'x');
    else
        assert_non_null(memchr(found, 0, MBM_TLS_ROLE_BYTES + 1));
    return result;
}

TEST_WITH(the_role_is_found_among_other_extensions, NULL, NULL)
{
    char found[MBM_TLS_ROLE_BYTES + 1];
    extensions e = {.length = 0};

    assert_int_equal(find(&e, 0, found), MBM_TLS_NO_ROLE);
    add(&e, constraint, sizeof constraint);
    add(&e, other_oid, sizeof other_oid);
    assert_int_equal(find(&e, e.length, found), MBM_TLS_NO_ROLE);
    add(&e, role_plain, sizeof role_plain);
    assert_int_equal(find(&e, e.length, found), MBM_TLS_ONE_ROLE);
    assert_string_equal(found, "AB");
    add(&e, constraint, sizeof constraint);
    assert_int_equal(find(&e, e.length, found), MBM_TLS_ONE_ROLE);
    assert_string_equal(found, "AB");
    e.length = 0;
    add(&e, role_critical, sizeof role_critical);
    assert_int_equal(find(&e, e.length, found), MBM_TLS_ONE_ROLE);
    assert_string_equal(found, "CD");
}

TEST_WITH(two_roles_are_no_role, NULL, NULL)
{
    char found[MBM_TLS_ROLE_BYTES + 1];
    extensions e = {.length = 0};

    add(&e, role_plain, sizeof role_plain);
    add(&e, role_critical, sizeof role_critical);
    assert_int_equal(find(&e, e.length, found), MBM_TLS_WRONG_ROLE);
}

/* No length and no change of a byte makes the search leave the extensions, or find a role that is
 * not two characters long. */
TEST_WITH(damaged_extensions_are_read_within_their_bounds, NULL, NULL)
{
    char found[MBM_TLS_ROLE_BYTES + 1];
    extensions e = {.length = 0}, changed;

    add(&e, constraint, sizeof constraint);
    add(&e, role_critical, sizeof role_critical);
    for (size_t length = 1; length < e.length; length++)
        assert_int_equal(find(&e, length, found), MBM_TLS_WRONG_ROLE);
    for (size_t i = 0; i < e.length; i++)
        for (unsigned value = 0; value < 256; value++) {
            changed = e;
            changed.bytes[i] = (uint8_t)value;
            if (find(&changed, e.length, found) == MBM_TLS_ONE_ROLE)
                assert_int_equal(strlen(found), 2);
        }
}

/* --- a server that serves by role --- */

enum { FIRST_WORD = 100, WORDS = 4 };

static tls_pair pair;
static mbm_server server;
static mbm_client client;

static mbm_registerTable held;
static mbm_custom every_function;
static uint16_t held_words[WORDS], read_words[WORDS], new_word;
static uint8_t frame[MBM_MAX_TCP_FRAME], incoming[600], outgoing[600];
static mbm_clientRequest request;
static const mbm_tls *seen; /* the connection that the hook of the table got */

static int may(const mbm_tls *connection, const char *found)
{
    const char *own = mbm_tls_role(connection);

    return own && strcmp(own, found) == 0;
}

/* Refuses with exception 01 what the role does not allow, before any record is asked. */
static uint16_t authorise(void *context, const mbm_request *asked, uint8_t *response,
                          uint16_t capacity)
{
    const mbm_tls *connection = (const mbm_tls *)asked->connection;

    if (may(connection, "Operator") ||
        (may(connection, "Viewer") && asked->function == MBM_FC_READ_HOLDING_REGISTERS))
        return MBM_REPLY_DECLINED;
    return MBM_REPLY_EXCEPTION | MBM_ILLEGAL_FUNCTION;
}

/* Only the operator may write register 103. */
static uint8_t before_write(void *context, const mbm_access *access)
{
    seen = (const mbm_tls *)access->connection;
    if (access->address + access->quantity > FIRST_WORD + 3 && !may(seen, "Operator"))
        return MBM_ILLEGAL_DATA_ADDRESS;
    return 0;
}

static void begin_unit(int guarded)
{
    static const mbm_accessHooks hooks = {.beforeWrite = before_write};

    memset(&unit, 0, sizeof unit);
    every_function = (mbm_custom){.serve = authorise};
    held = (mbm_registerTable){.words = held_words, .base = FIRST_WORD, .size = WORDS};
    for (unsigned i = 0; i < WORDS; i++)
        held_words[i] = (uint16_t)(500 + i);
    unit.id = 17;
    seen = NULL;
    if (guarded)
        OK(mbm_unit_serveCustom(&unit, &every_function));
    OK(mbm_unit_serveHoldingRegisters(&unit, &held));
    OK(mbm_registerTable_setHooks(&held, &hooks));
}

static void connect_as(const char *name)
{
    tls_pair_begin(&pair, name, "server");
    memset(&request, 0, sizeof request);
    request.unit = 17;
    request.reply = read_words;
    request.replyBytes = sizeof read_words;
    request.data = &new_word;
    OK(mbm_client_beginTcp(&client, &pair.client.port, incoming, sizeof incoming, outgoing,
                           sizeof outgoing));
    OK(mbm_server_beginTcp(&server, &pair.server.port, &unit, 1, frame, sizeof frame));
}

static uint8_t see_through(void)
{
    while (request.status == MBM_PENDING) {
        (void)mbm_client_poll(&client);
        (void)mbm_server_poll(&server);
    }
    return request.status;
}

static uint8_t read_all(void)
{
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &request, FIRST_WORD, WORDS));
    return see_through();
}

static uint8_t write_one(uint16_t address, uint16_t word)
{
    new_word = word;
    IS(MBM_PENDING, mbm_client_writeMultipleRegisters(&client, &request, address, 1));
    return see_through();
}

TEST_WITH(a_function_that_the_role_does_not_allow_is_exception_01, NULL, NULL)
{
    begin_unit(1);
    connect_as("operator");
    IS(MBM_OK, read_all());
    IS(MBM_OK, write_one(FIRST_WORD, 9));
    assert_int_equal(held_words[0], 9);
    tls_pair_end(&pair);
    connect_as("viewer");
    IS(MBM_OK, read_all());
    assert_int_equal(read_words[0], 9);
    IS(MBM_ILLEGAL_FUNCTION, write_one(FIRST_WORD, 10));
    assert_int_equal(request.exception, 1);
    assert_int_equal(held_words[0], 9);
    tls_pair_end(&pair);
    connect_as("norole");
    IS(MBM_ILLEGAL_FUNCTION, read_all());
    IS(MBM_ILLEGAL_FUNCTION, write_one(FIRST_WORD, 10));
    assert_int_equal(held_words[0], 9);
    tls_pair_end(&pair);
}

TEST_WITH(a_hook_of_a_table_gets_the_connection_and_its_role, NULL, NULL)
{
    begin_unit(0);
    connect_as("viewer");
    IS(MBM_OK, write_one(FIRST_WORD + 2, 1));
    assert_ptr_equal(seen, &pair.server.tls);
    IS(MBM_ILLEGAL_DATA_ADDRESS, write_one(FIRST_WORD + 3, 1));
    tls_pair_end(&pair);
    connect_as("operator");
    IS(MBM_OK, write_one(FIRST_WORD + 3, 1));
    assert_int_equal(held_words[3], 1);
    tls_pair_end(&pair);
}

/* --- A blocking master inside TLS: RTU frames, as some gateways take them --- */

enum { UNIT = 17, MASTER_FIRST = 100, MASTER_WORDS = 20, TICK_US = 1000 };

static mbm_line line;
static mbm_node master;

static mbm_registerTable master_holding;
static uint16_t master_words[MASTER_WORDS], response[MASTER_WORDS];
static uint8_t server_frame[MBM_MAX_FRAME], own_frame[MBM_MAX_FRAME];
static unsigned idles;

/* The port below sleeps here. Meanwhile time passes, and the server serves. */
static void serve(void)
{
    idles++;
    pair.now += TICK_US;
    (void)mbm_server_poll(&server);
}

static void begin_pair(void)
{
    tls_pair_begin(&pair, "operator", "server");
    pair.idle = serve;
    unit = (mbm_unit){.id = UNIT};
    master_holding =
        (mbm_registerTable){.words = master_words, .base = MASTER_FIRST, .size = MASTER_WORDS};
    for (unsigned i = 0; i < MASTER_WORDS; i++)
        master_words[i] = (uint16_t)(0xC000 + i);
    OK(mbm_unit_serveHoldingRegisters(&unit, &master_holding));
    OK(mbm_server_beginRtuOverTcp(&server, &pair.server.port, &unit, 1, server_frame,
                                  sizeof server_frame));
    OK(mbm_line_beginRtu(&line, &pair.client.port, own_frame, sizeof own_frame));
    OK(mbm_node_begin(&master, &line, UNIT, response, MASTER_WORDS, NULL, 0));
}

static void end_pair(void)
{
    tls_pair_end(&pair);
}

TEST_WITH(a_master_reads_while_its_idle_hook_lets_the_port_below_sleep, begin_pair, end_pair)
{
    tls_pair_run(&pair);
    idles = 0;
    for (unsigned i = 0; i < 3; i++) {
        memset(response, 0, sizeof response);
        OK(mbm_node_readHoldingRegisters(&master, MASTER_FIRST, MASTER_WORDS));
        assert_memory_equal(response, master_words, sizeof master_words);
    }
    assert_true(idles > 0);
}

TEST_WITH(a_master_without_a_session_reports_a_lost_link, begin_pair, end_pair)
{
    mbm_tls_close(&pair.client.tls);
    IS(MBM_LINK_LOST, mbm_node_readHoldingRegisters(&master, MASTER_FIRST, MASTER_WORDS));
}
