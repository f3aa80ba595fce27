/* Each function of the gateway is held to its comment in mbm.h: results, limits, defaults, NULL.
 * test_gateway_misuse has every config that is refused, and the calls from within hooks. */
#include "refused.h"
#include "gateway_bench.h"
#include "test.h"

#include <string.h>

enum { FREE = 2 };

static gateway_bench b;

static const mbm_gatewayRoute routes[] = {{1, 31, 0, 0}, {101, 131, 1, 1}};

#define READ "\x03\x00\x10\x00\x01"
#define VALUE "\x03\x02\x12\x34"

static void start(void)
{
    gateway_bench_start(&b, routes, COUNT(routes));
    OK(mbm_gateway_close(&b.gateway, FREE));
}

fixture each_test = {start, NULL};

TEST(a_place_is_opened_and_closed)
{
    const mbm_port port = memory_port_of(&b.sockets[FREE]);

    REFUSED(MBM_NOT_INITIALISED, b, mbm_gateway_status(&b.gateway, FREE));
    REFUSED(MBM_INVALID_ARGUMENT, b, mbm_gateway_status(&b.gateway, BENCH_CONNECTIONS));
    REFUSED(MBM_OK, b, mbm_gateway_close(&b.gateway, FREE)); /* it is free already */
    REFUSED(MBM_INVALID_ARGUMENT, b, mbm_gateway_close(&b.gateway, BENCH_CONNECTIONS));
    REFUSED(MBM_INVALID_ARGUMENT, b, mbm_gateway_open(&b.gateway, BENCH_CONNECTIONS, &port));
    REFUSED(MBM_INVALID_ARGUMENT, b, mbm_gateway_open(&b.gateway, FREE, NULL));
    OK(mbm_gateway_open(&b.gateway, FREE, &port));
    REFUSED(MBM_BUSY, b, mbm_gateway_open(&b.gateway, FREE, &port));
    OK(mbm_gateway_status(&b.gateway, FREE));
    b.sockets[FREE].is_lost = 1;
    OK(mbm_gateway_poll(&b.gateway));
    IS(MBM_LINK_LOST, mbm_gateway_status(&b.gateway, FREE));
    OK(mbm_gateway_close(&b.gateway, FREE));
    b.sockets[FREE].is_lost = 0;
    OK(mbm_gateway_open(&b.gateway, FREE, &port));
    memory_port_bytes(&b.sockets[FREE], (const uint8_t *)"no Modbus", 9);
    gateway_bench_settle(&b);
    IS(MBM_MALFORMED_FRAME, mbm_gateway_status(&b.gateway, FREE));
}

TEST(requests_are_counted_until_they_are_answered)
{
    assert_int_equal(mbm_gateway_pollDelay(&b.gateway), UINT32_MAX);
    assert_int_equal(mbm_gateway_isReading(&b.gateway, 0), 1);
    assert_int_equal(mbm_gateway_isReading(&b.gateway, FREE), 0);
    OK(mbm_gateway_setMaxPending(&b.gateway, 1));
    ASK(0, 1, 2, READ);
    ON_LINE(0, 2, READ);
    assert_int_equal(mbm_gateway_pending(&b.gateway, 0), 1);
    assert_int_equal(mbm_gateway_pending(&b.gateway, 1), 0);
    assert_int_equal(mbm_gateway_pending(&b.gateway, FREE), 0);
    assert_int_equal(mbm_gateway_pending(&b.gateway, 255), 0);
    assert_int_equal(mbm_gateway_isReading(&b.gateway, 0), 0);
    REPLY(0, 2, VALUE);
    EXPECT(0, 1, 2, VALUE);
    assert_int_equal(mbm_gateway_pending(&b.gateway, 0), 0);
    assert_int_equal(mbm_gateway_isReading(&b.gateway, 0), 1);
}

TEST(settings_have_the_defaults_and_ranges_of_the_header)
{
    static const mbm_function right = {.code = 65}, wrong = {.code = 128};
    static mbm_unit unit;

    REFUSED(MBM_INVALID_ARGUMENT, b, mbm_gateway_setMaxPending(&b.gateway, 0));
    OK(mbm_gateway_setMaxPending(&b.gateway, 1));
    OK(mbm_gateway_setQueueTime(&b.gateway, 1000000));
    REFUSED(MBM_INVALID_ARGUMENT, b, mbm_gateway_setQueueTime(&b.gateway, 1000001));
    OK(mbm_gateway_setFunctions(&b.gateway, &right, 1));
    OK(mbm_gateway_setFunctions(&b.gateway, NULL, 0));
    REFUSED(MBM_INVALID_ARGUMENT, b, mbm_gateway_setFunctions(&b.gateway, &wrong, 1));
    REFUSED(MBM_INVALID_ARGUMENT, b, mbm_gateway_setFunctions(&b.gateway, NULL, 1));
    OK(mbm_gateway_serveUnits(&b.gateway, &unit, 1));
    REFUSED(MBM_INVALID_ARGUMENT, b, mbm_gateway_serveUnits(&b.gateway, NULL, 1));
    REFUSED(MBM_INVALID_ARGUMENT, b, mbm_gateway_begin(&b.gateway, NULL));
    OK(mbm_gateway_begin(&b.gateway, &b.config));
    IS(MBM_NOT_INITIALISED, mbm_gateway_status(&b.gateway, 0));
}

TEST(what_was_never_begun_is_refused)
{
    static mbm_gateway none;
    mbm_gateway *const both[] = {NULL, &none};
    const mbm_port port = memory_port_of(&b.sockets[0]);

    IS(MBM_INVALID_ARGUMENT, mbm_gateway_begin(NULL, &b.config));
    for (unsigned i = 0; i < COUNT(both); i++) {
        uint8_t status = both[i] == NULL ? MBM_INVALID_ARGUMENT : MBM_NOT_INITIALISED;

        IS(status, mbm_gateway_poll(both[i]));
        IS(status, mbm_gateway_open(both[i], 0, &port));
        IS(status, mbm_gateway_close(both[i], 0));
        IS(status, mbm_gateway_status(both[i], 0));
        IS(status, mbm_gateway_setMaxPending(both[i], 1));
        IS(status, mbm_gateway_setQueueTime(both[i], 1));
        IS(status, mbm_gateway_serveUnits(both[i], NULL, 0));
        IS(status, mbm_gateway_setFunctions(both[i], NULL, 0));
        assert_int_equal(mbm_gateway_pollDelay(both[i]), UINT32_MAX);
        assert_int_equal(mbm_gateway_pending(both[i], 0), 0);
        assert_int_equal(mbm_gateway_isReading(both[i], 0), 0);
    }
}
