/* The getters of settings: defaults, what was set, what is in effect, and what they return of an
 * object that was never begun. */
#include "mbm.h"
#include "test.h"

#include <string.h>

static mbm_line line;
static mbm_node node;
static mbm_client client;
static mbm_server server;
static mbm_sniffer sniffer;
static mbm_unit unit;
static uint8_t frame[MBM_MAX_TCP_FRAME], incoming[MBM_MAX_TCP_FRAME], other[MBM_MAX_TCP_FRAME];

static int16_t no_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    (void)context;
    (void)bytes;
    (void)capacity;
    return 0;
}

static int16_t no_write(void *context, const uint8_t *bytes, uint16_t length)
{
    (void)context;
    (void)bytes;
    return (int16_t)length;
}

static void (*on_clock)(void);

static uint32_t clock_hook(void *context)
{
    (void)context;
    if (on_clock != NULL)
        on_clock();
    return 0;
}

static const mbm_port port = {.read = no_read, .write = no_write, .micros = clock_hook};

static int reset(void **state)
{
    (void)state;
    memset(&line, 0, sizeof line);
    memset(&node, 0, sizeof node);
    memset(&client, 0, sizeof client);
    memset(&server, 0, sizeof server);
    memset(&sniffer, 0, sizeof sniffer);
    on_clock = NULL;
    return 0;
}

static void all_are_zero(const mbm_line *l, const mbm_node *m, const mbm_client *c,
                         const mbm_server *s, const mbm_sniffer *n)
{
    assert_int_equal(mbm_node_getResponseTimeout(m), 0);
    assert_int_equal(mbm_line_getGap(l), 0);
    assert_int_equal(mbm_line_getTurnaroundDelay(l), 0);
    assert_int_equal(mbm_line_getQuietTime(l), 0);
    assert_int_equal(mbm_line_getRetries(l), 0);
    assert_int_equal(mbm_line_getEchoDiscard(l), 0);
    assert_int_equal(mbm_node_getLenient(m), 0);
    assert_int_equal(mbm_line_getPostFlushHold(l), 0);
    assert_int_equal(mbm_node_getBlocking(m), 0);
    assert_int_equal(mbm_node_getWordOrder(m), MBM_ORDER_ABCD);
    assert_int_equal(mbm_client_getResponseTimeout(c), 0);
    assert_int_equal(mbm_client_getGap(c), 0);
    assert_int_equal(mbm_client_getTurnaroundDelay(c), 0);
    assert_int_equal(mbm_client_getQuietTime(c), 0);
    assert_int_equal(mbm_client_getRetries(c), 0);
    assert_int_equal(mbm_client_getEchoDiscard(c), 0);
    assert_int_equal(mbm_client_getPostFlushHold(c), 0);
    assert_int_equal(mbm_client_getInFlight(c), 0);
    assert_int_equal(mbm_server_getSilence(s), 0);
    assert_int_equal(mbm_server_getEchoDiscard(s), 0);
    assert_int_equal(mbm_sniffer_getResponseTimeout(n), 0);
    assert_int_equal(mbm_sniffer_getFrameTimeout(n), 0);
}

static void an_object_that_was_never_begun_has_no_settings(void **state)
{
    (void)state;
    all_are_zero(NULL, NULL, NULL, NULL, NULL);
    all_are_zero(&line, &node, &client, &server, &sniffer);
}

static unsigned hooks_called;

static void within_the_line(void)
{
    hooks_called++;
    assert_int_equal(mbm_line_getGap(&line), 0);
    assert_int_equal(mbm_line_getRetries(&line), 0);
}

static void within_the_client(void)
{
    hooks_called++;
    assert_int_equal(mbm_client_getResponseTimeout(&client), 0);
    assert_int_equal(mbm_client_getInFlight(&client), 0);
}

static void within_the_server(void)
{
    hooks_called++;
    assert_int_equal(mbm_server_getSilence(&server), 0);
}

static void a_hook_gets_no_settings_of_its_object(void **state)
{
    (void)state;
    hooks_called = 0;
    OK(mbm_line_beginRtu(&line, &port, frame, sizeof frame));
    on_clock = within_the_line;
    OK(mbm_line_used(&line));
    assert_int_equal(hooks_called, 1);
    on_clock = within_the_client;
    OK(mbm_client_beginRtu(&client, &port, frame, sizeof frame));
    OK(mbm_client_poll(&client));
    assert_true(hooks_called > 1);
    hooks_called = 0;
    on_clock = within_the_server;
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, other, sizeof other));
    OK(mbm_server_poll(&server));
    assert_true(hooks_called > 0);
}

static void a_line_and_a_node_return_their_settings(void **state)
{
    unsigned order;

    (void)state;
    OK(mbm_line_beginRtu(&line, &port, frame, sizeof frame));
    OK(mbm_node_begin(&node, &line, 1, NULL, 0, NULL, 0));
    assert_int_equal(mbm_node_getResponseTimeout(&node), 2000);
    assert_int_equal(mbm_line_getGap(&line), 4000);
    assert_int_equal(mbm_line_getTurnaroundDelay(&line), 100);
    assert_int_equal(mbm_line_getQuietTime(&line), 100);
    assert_int_equal(mbm_line_getRetries(&line), 0);
    assert_int_equal(mbm_node_getBlocking(&node), 1);
    assert_int_equal(mbm_node_getWordOrder(&node), MBM_ORDER_ABCD);
    OK(mbm_node_setResponseTimeout(&node, 65535));
    OK(mbm_line_setTurnaroundDelay(&line, 1));
    OK(mbm_line_setQuietTime(&line, 60001));
    OK(mbm_line_setRetries(&line, 255));
    OK(mbm_line_setEchoDiscard(&line, 1));
    OK(mbm_node_setLenient(&node, 3));
    OK(mbm_line_setPostFlushHold(&line, 7));
    OK(mbm_node_setBlocking(&node, 0));
    assert_int_equal(mbm_node_getResponseTimeout(&node), 65535);
    assert_int_equal(mbm_line_getTurnaroundDelay(&line), 1);
    assert_int_equal(mbm_line_getQuietTime(&line), 60001);
    assert_int_equal(mbm_line_getRetries(&line), 255);
    assert_int_equal(mbm_line_getEchoDiscard(&line), 1);
    assert_int_equal(mbm_node_getLenient(&node), 1);
    assert_int_equal(mbm_line_getPostFlushHold(&line), 7);
    assert_int_equal(mbm_node_getBlocking(&node), 0);
    /* The gap is what is in effect. */
    OK(mbm_line_setBaudRate(&line, 9600));
    assert_int_equal(mbm_line_getGap(&line), 4011);
    OK(mbm_line_setGap(&line, 0xFFFFFFFF));
    assert_int_equal(mbm_line_getGap(&line), 0x80000000u);
    OK(mbm_line_setBaudRate(&line, 115200));
    assert_int_equal(mbm_line_getGap(&line), 1750);
    for (order = MBM_ORDER_ABCD; order <= MBM_ORDER_DCBA; order++) {
        OK(mbm_node_setWordOrder(&node, (uint8_t)order));
        assert_int_equal(mbm_node_getWordOrder(&node), order);
    }
    IS(MBM_INVALID_ARGUMENT, mbm_node_setWordOrder(&node, 99));
    assert_int_equal(mbm_node_getWordOrder(&node), MBM_ORDER_DCBA);
    /* Settings stay when a line and a node begin again. */
    OK(mbm_line_beginRtu(&line, &port, frame, sizeof frame));
    OK(mbm_node_begin(&node, &line, 2, NULL, 0, NULL, 0));
    assert_int_equal(mbm_line_getRetries(&line), 255);
    assert_int_equal(mbm_node_getResponseTimeout(&node), 65535);
    assert_int_equal(mbm_node_getBlocking(&node), 0);
}

static void a_client_returns_its_settings(void **state)
{
    uint8_t kind, most;

    (void)state;
    for (kind = 0; kind < 4; kind++) {
        OK(kind == 0   ? mbm_client_beginRtu(&client, &port, frame, sizeof frame)
           : kind == 1 ? mbm_client_beginAscii(&client, &port, frame, sizeof frame)
           : kind == 2 ? mbm_client_beginRtuOverTcp(&client, &port, frame, sizeof frame)
                       : mbm_client_beginTcp(&client, &port, incoming, sizeof incoming, other,
                                             sizeof other));
        assert_int_equal(mbm_client_getResponseTimeout(&client), 2000);
        assert_int_equal(mbm_client_getInFlight(&client), kind == 3 ? 16 : 1);
        if (kind == 0)
            assert_int_equal(mbm_client_getGap(&client), 4000);
        OK(mbm_client_setResponseTimeout(&client, 1));
        OK(mbm_client_setTurnaroundDelay(&client, 65535));
        OK(mbm_client_setQuietTime(&client, 12345));
        OK(mbm_client_setRetries(&client, 3));
        OK(mbm_client_setEchoDiscard(&client, 2));
        OK(mbm_client_setPostFlushHold(&client, 255));
        OK(mbm_client_setBaudRate(&client, 19200));
        assert_int_equal(mbm_client_getResponseTimeout(&client), 1);
        assert_int_equal(mbm_client_getTurnaroundDelay(&client), 65535);
        assert_int_equal(mbm_client_getQuietTime(&client), 12345);
        assert_int_equal(mbm_client_getRetries(&client), 3);
        assert_int_equal(mbm_client_getEchoDiscard(&client), 1);
        assert_int_equal(mbm_client_getPostFlushHold(&client), 255);
        assert_int_equal(mbm_client_getGap(&client), 2006);
        OK(mbm_client_setGap(&client, 5));
        assert_int_equal(mbm_client_getGap(&client), 5);
    }
    for (most = 1; most <= 16; most++) {
        OK(mbm_client_setInFlight(&client, most));
        assert_int_equal(mbm_client_getInFlight(&client), most);
    }
    IS(MBM_INVALID_ARGUMENT, mbm_client_setInFlight(&client, 17));
    assert_int_equal(mbm_client_getInFlight(&client), 16);
    OK(mbm_client_beginRtu(&client, &port, frame, sizeof frame));
    assert_int_equal(mbm_client_getResponseTimeout(&client), 2000);
    assert_int_equal(mbm_client_getRetries(&client), 0);
}

static void a_server_returns_its_settings(void **state)
{
    (void)state;
    OK(mbm_server_beginRtu(&server, &port, &unit, 1, frame, sizeof frame));
    assert_int_equal(mbm_server_getSilence(&server), 4000);
    assert_int_equal(mbm_server_getEchoDiscard(&server), 0);
    OK(mbm_server_setBaudRate(&server, 19200));
    assert_int_equal(mbm_server_getSilence(&server), 2006);
    OK(mbm_server_setSilence(&server, 0xFFFFFFFF));
    assert_int_equal(mbm_server_getSilence(&server), 0x80000000u);
    OK(mbm_server_setEchoDiscard(&server, 5));
    assert_int_equal(mbm_server_getEchoDiscard(&server), 1);
    OK(mbm_server_setEchoDiscard(&server, 0));
    assert_int_equal(mbm_server_getEchoDiscard(&server), 0);
    OK(mbm_server_beginAscii(&server, &port, &unit, 1, frame, sizeof frame));
    assert_int_equal(mbm_server_getSilence(&server), 1000000);
    IS(MBM_INVALID_ARGUMENT, mbm_server_setEchoDiscard(&server, 1));
    assert_int_equal(mbm_server_getEchoDiscard(&server), 0);
}

static void a_sniffer_returns_its_settings(void **state)
{
    static uint8_t buffer[1024];

    (void)state;
    OK(mbm_sniffer_beginRtu(&sniffer, buffer, sizeof buffer));
    assert_int_equal(mbm_sniffer_getResponseTimeout(&sniffer), 1000);
    assert_int_equal(mbm_sniffer_getFrameTimeout(&sniffer), 50);
    OK(mbm_sniffer_setResponseTimeout(&sniffer, 65535));
    OK(mbm_sniffer_setFrameTimeout(&sniffer, 1));
    IS(MBM_INVALID_ARGUMENT, mbm_sniffer_setFrameTimeout(&sniffer, 0));
    assert_int_equal(mbm_sniffer_getResponseTimeout(&sniffer), 65535);
    assert_int_equal(mbm_sniffer_getFrameTimeout(&sniffer), 1);
    OK(mbm_sniffer_beginAscii(&sniffer, buffer, sizeof buffer));
    assert_int_equal(mbm_sniffer_getFrameTimeout(&sniffer), 1000);
}

#define TEST(test) cmocka_unit_test_setup(test, reset)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(an_object_that_was_never_begun_has_no_settings),
        TEST(a_hook_gets_no_settings_of_its_object),
        TEST(a_line_and_a_node_return_their_settings),
        TEST(a_client_returns_its_settings),
        TEST(a_server_returns_its_settings),
        TEST(a_sniffer_returns_its_settings),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
