/* The role of a certificate: how it is found in the extensions, and what a server does with it. */
#define _GNU_SOURCE
#include "test.h"
#include "tls_pair.h"

#include <stdlib.h>
#include <string.h>

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

/* Looks for the role in a copy that ends where the extensions do, so that the address
 * sanitizer and valgrind see a byte too many. */
static int find(const extensions *e, size_t length, char *role)
{
    uint8_t *copy = (uint8_t *)malloc(length ? length : 1);
    mbedtls_x509_buf buffer = {.len = length, .p = copy};
    int result;

    memcpy(copy, e->bytes, length);
    memset(role, 'x', MBM_TLS_ROLE_BYTES + 1);
    result = mbm_tls_findRole(&buffer, role);
    free(copy);
    if (result != MBM_TLS_ONE_ROLE)
        assert_int_equal(role[0], 'x');
    else
        assert_non_null(memchr(role, 0, MBM_TLS_ROLE_BYTES + 1));
    return result;
}

TEST(the_role_is_found_among_other_extensions)
{
    char role[MBM_TLS_ROLE_BYTES + 1];
    extensions e = {.length = 0};

    assert_int_equal(find(&e, 0, role), MBM_TLS_NO_ROLE);
    add(&e, constraint, sizeof constraint);
    add(&e, other_oid, sizeof other_oid);
    assert_int_equal(find(&e, e.length, role), MBM_TLS_NO_ROLE);
    add(&e, role_plain, sizeof role_plain);
    assert_int_equal(find(&e, e.length, role), MBM_TLS_ONE_ROLE);
    assert_string_equal(role, "AB");
    add(&e, constraint, sizeof constraint);
    assert_int_equal(find(&e, e.length, role), MBM_TLS_ONE_ROLE);
    assert_string_equal(role, "AB");
    e.length = 0;
    add(&e, role_critical, sizeof role_critical);
    assert_int_equal(find(&e, e.length, role), MBM_TLS_ONE_ROLE);
    assert_string_equal(role, "CD");
}

TEST(two_roles_are_no_role)
{
    char role[MBM_TLS_ROLE_BYTES + 1];
    extensions e = {.length = 0};

    add(&e, role_plain, sizeof role_plain);
    add(&e, role_critical, sizeof role_critical);
    assert_int_equal(find(&e, e.length, role), MBM_TLS_WRONG_ROLE);
}

/* No length and no change of a byte makes the search leave the extensions, or find a role that
 * is not two characters long. */
TEST(damaged_extensions_are_read_within_their_bounds)
{
    char role[MBM_TLS_ROLE_BYTES + 1];
    extensions e = {.length = 0}, changed;

    add(&e, constraint, sizeof constraint);
    add(&e, role_critical, sizeof role_critical);
    for (size_t length = 1; length < e.length; length++)
        assert_int_equal(find(&e, length, role), MBM_TLS_WRONG_ROLE);
    for (size_t i = 0; i < e.length; i++)
        for (unsigned value = 0; value < 256; value++) {
            changed = e;
            changed.bytes[i] = (uint8_t)value;
            if (find(&changed, e.length, role) == MBM_TLS_ONE_ROLE)
                assert_int_equal(strlen(role), 2);
        }
}

/* --- a server that serves by role --- */

enum { FIRST = 100, WORDS = 4 };

static tls_pair pair;
static mbm_server server;
static mbm_client client;
static mbm_unit unit;
static mbm_registerTable holding;
static mbm_custom every_function;
static uint16_t words[WORDS], read_words[WORDS], new_word;
static uint8_t frame[MBM_MAX_TCP_FRAME], incoming[600], outgoing[600];
static mbm_clientRequest request;
static const mbm_tls *seen; /* the connection that the hook of the table got */

static int may(const mbm_tls *connection, const char *role)
{
    const char *own = mbm_tls_role(connection);

    return own && strcmp(own, role) == 0;
}

/* Refuses with exception 01 what the role does not allow, before any record is asked. */
static uint16_t authorise(void *context, const mbm_request *asked, uint8_t *response,
                          uint16_t capacity)
{
    const mbm_tls *connection = (const mbm_tls *)asked->connection;

    (void)context;
    (void)response;
    (void)capacity;
    if (may(connection, "Operator") ||
        (may(connection, "Viewer") && asked->function == MBM_FC_READ_HOLDING_REGISTERS))
        return MBM_REPLY_DECLINED;
    return MBM_REPLY_EXCEPTION | MBM_ILLEGAL_FUNCTION;
}

/* Only the operator may write register 103. */
static uint8_t before_write(void *context, const mbm_access *access)
{
    (void)context;
    seen = (const mbm_tls *)access->connection;
    if (access->address + access->quantity > FIRST + 3 && !may(seen, "Operator"))
        return MBM_ILLEGAL_DATA_ADDRESS;
    return 0;
}

static void begin_unit(int guarded)
{
    static const mbm_accessHooks hooks = {.beforeWrite = before_write};

    memset(&unit, 0, sizeof unit);
    memset(&every_function, 0, sizeof every_function);
    every_function.serve = authorise;
    holding = (mbm_registerTable){.words = words, .base = FIRST, .size = WORDS};
    for (unsigned i = 0; i < WORDS; i++)
        words[i] = (uint16_t)(500 + i);
    unit.id = 17;
    seen = NULL;
    if (guarded)
        OK(mbm_unit_serveCustom(&unit, &every_function));
    OK(mbm_unit_serveHoldingRegisters(&unit, &holding));
    OK(mbm_registerTable_setHooks(&holding, &hooks));
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
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &request, FIRST, WORDS));
    return see_through();
}

static uint8_t write_one(uint16_t address, uint16_t word)
{
    new_word = word;
    IS(MBM_PENDING, mbm_client_writeMultipleRegisters(&client, &request, address, 1));
    return see_through();
}

TEST(a_function_that_the_role_does_not_allow_is_exception_01)
{
    begin_unit(1);
    connect_as("operator");
    IS(MBM_OK, read_all());
    IS(MBM_OK, write_one(FIRST, 9));
    assert_int_equal(words[0], 9);
    tls_pair_end(&pair);
    connect_as("viewer");
    IS(MBM_OK, read_all());
    assert_int_equal(read_words[0], 9);
    IS(MBM_ILLEGAL_FUNCTION, write_one(FIRST, 10));
    assert_int_equal(request.exception, 1);
    assert_int_equal(words[0], 9);
    tls_pair_end(&pair);
    connect_as("norole");
    IS(MBM_ILLEGAL_FUNCTION, read_all());
    IS(MBM_ILLEGAL_FUNCTION, write_one(FIRST, 10));
    assert_int_equal(words[0], 9);
    tls_pair_end(&pair);
}

TEST(a_hook_of_a_table_gets_the_connection_and_its_role)
{
    begin_unit(0);
    connect_as("viewer");
    IS(MBM_OK, write_one(FIRST + 2, 1));
    assert_ptr_equal(seen, &pair.server.tls);
    IS(MBM_ILLEGAL_DATA_ADDRESS, write_one(FIRST + 3, 1));
    tls_pair_end(&pair);
    connect_as("operator");
    IS(MBM_OK, write_one(FIRST + 3, 1));
    assert_int_equal(words[3], 1);
    tls_pair_end(&pair);
}
