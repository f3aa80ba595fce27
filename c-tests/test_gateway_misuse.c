/* A gateway that is begun wrongly, begun again, and called from within hooks. */
#include "refused.h"
#include "gateway_bench.h"
#include "test.h"

static gateway_bench b;

static const mbm_gatewayRoute routes[] = {
    {1, 31, 0, 0}, {101, 131, 1, 1}, {200, 200, MBM_GATEWAY_LOCAL, 0}};

#define READ "\x03\x00\x10\x00\x01"
#define VALUE "\x03\x02\x12\x34"
#define OTHER_VALUE "\x03\x02\xAB\xCD"

static void start(void)
{
    gateway_bench_start(&b, routes, COUNT(routes));
}

fixture each_test = {start, NULL};

/* --- refused --- */

static void refuses_config(uint8_t status, mbm_gatewayConfig config)
{
    mbm_gateway other = {0};

    REFUSED(status, b.gateway, mbm_gateway_begin(&b.gateway, &config));
    IS(status, mbm_gateway_begin(&other, &config));
    IS(MBM_NOT_INITIALISED, mbm_gateway_poll(&other));
}

TEST(a_gateway_goes_on_after_a_refused_begin)
{
    static const mbm_gatewayRoute bad[] = {{2, 1, 0, 0},
                                           {1, 1, 2, 0},
                                           {1, 11, 0, 246},
                                           {0, 1, MBM_GATEWAY_ALL_LINES, 0},
                                           {1, 1, MBM_GATEWAY_ALL_LINES, 0},
                                           {0, 0, MBM_GATEWAY_ALL_LINES, 1},
                                           {300, 300, 0, 0}, /* not 44 */
                                           {1, 287, 0, 0},
                                           {256, 257, 0, 0},
                                           {0, 256, MBM_GATEWAY_ALL_LINES, 0},
                                           {1, 1, 0, 300},
                                           {0, 0, MBM_GATEWAY_ALL_LINES, MBM_GATEWAY_UNIT_0},
                                           {1, 1, 0, MBM_GATEWAY_UNIT_0 + 1},
                                           {1, 1, MBM_GATEWAY_LOCAL, 300}};
    static mbm_client none;
    mbm_gatewayLine line = {0};
    mbm_gatewayConfig config;

    ASK(0, 1, 2, READ);
    ON_LINE(0, 2, READ);
    INVALID(b.gateway, mbm_gateway_begin(&b.gateway, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_gateway_begin(NULL, &b.config));
    config = b.config;
#define REFUSES(status, field, value) WITH(config.field, value, refuses_config(status, config))
    REFUSES(MBM_INVALID_ARGUMENT, routes, NULL);
    REFUSES(MBM_INVALID_ARGUMENT, lines, NULL);
    REFUSES(MBM_INVALID_ARGUMENT, connections, NULL);
    REFUSES(MBM_INVALID_ARGUMENT, requests, NULL);
    REFUSES(MBM_INVALID_ARGUMENT, routeCount, 0);
    REFUSES(MBM_INVALID_ARGUMENT, connectionCount, 0);
    REFUSES(MBM_INVALID_ARGUMENT, requestCount, BENCH_CONNECTIONS - 1);
    REFUSES(MBM_INVALID_ARGUMENT, requestCount, 65535);
    REFUSES(MBM_INVALID_ARGUMENT, lineCount, 254);
    REFUSES(MBM_INVALID_ARGUMENT, lineCount, 1); /* a route leads to line 1 */
    config.routeCount = 1;
    for (unsigned i = 0; i < COUNT(bad); i++)
        REFUSES(MBM_INVALID_ARGUMENT, routes, &bad[i]);
    config.lines = &line;
    config.lineCount = 1;
    refuses_config(MBM_INVALID_ARGUMENT, config); /* no client */
    line.client = &none;
    refuses_config(MBM_NOT_INITIALISED, config);
    /* The request is still pending. */
    REPLY(0, 2, VALUE);
    EXPECT(0, 1, 2, VALUE);
}

TEST(a_refused_call_changes_nothing)
{
    static const mbm_function bad[] = {{0x41, {0}, {0}}, {128, {0}, {0}}};
    mbm_port deaf = memory_port_of(&b.sockets[0]);
    mbm_unit beyond = {.id = 300};

    deaf.read = NULL;
    OK(mbm_gateway_close(&b.gateway, 1));
    INVALID(b, mbm_gateway_open(&b.gateway, 1, &deaf));
    INVALID(b, mbm_gateway_serveUnits(&b.gateway, &beyond, 1));
    INVALID(b, mbm_gateway_setFunctions(&b.gateway, bad, COUNT(bad)));
    assert_int_equal(mbm_gateway_pending(&b.gateway, 250), 0);
    assert_int_equal(mbm_gateway_isReading(&b.gateway, 250), 0);
}

/* --- begin again --- */

TEST(begin_again_gives_up_all_connections_and_requests)
{
    OK(mbm_gateway_setMaxPending(&b.gateway, 2));
    OK(mbm_gateway_setQueueTime(&b.gateway, 20));
    ASK(0, 1, 2, READ);
    ASK(0, 2, 2, READ);
    ASK(1, 1, 102, READ);
    ON_LINE(0, 2, READ);
    ON_LINE(1, 2, READ);
    OK(mbm_gateway_begin(&b.gateway, &b.config));
    assert_int_equal(mbm_client_pending(&b.clients[0]), 0);
    assert_int_equal(mbm_client_pending(&b.clients[1]), 0);
    IS(MBM_NOT_INITIALISED, mbm_gateway_status(&b.gateway, 0));
    assert_int_equal(mbm_gateway_pollDelay(&b.gateway), UINT32_MAX);
    gateway_bench_open(&b, 0);
    ASK(0, 3, 2, "\x03\x00\x20\x00\x01");
    OK(mbm_gateway_poll(&b.gateway));
    REPLY(0, 2, VALUE); /* late, to the request that was given up */
    ON_LINE(0, 2, "\x03\x00\x20\x00\x01");
    REPLY(0, 2, OTHER_VALUE);
    EXPECT(0, 3, 2, OTHER_VALUE);
    /* The settings are the defaults: more than two requests, which wait for more than 20 ms. */
    ASK(0, 4, 2, READ);
    ASK(0, 5, 3, READ);
    ASK(0, 6, 4, READ);
    ON_LINE(0, 2, READ);
    assert_int_equal(mbm_gateway_pending(&b.gateway, 0), 3);
    EXPECT(0, 4, 2, "\x83\x0B"); /* after 100 ms */
    ON_LINE(0, 3, READ);
}

TEST(begin_again_with_other_parts_works)
{
    static mbm_gatewayConnection connections[2];
    static mbm_gatewayRequest requests[2];
    static mbm_gatewayLine line;
    static const mbm_gatewayRoute route[] = {{9, 9, 0, 0}};
    const mbm_gatewayConfig config = {.routes = route,
                                      .routeCount = 1,
                                      .lines = &line,
                                      .lineCount = 1,
                                      .connections = connections,
                                      .connectionCount = 2,
                                      .requests = requests,
                                      .requestCount = 2};

    ASK(0, 1, 2, READ);
    ON_LINE(0, 2, READ);
    line.client = &b.clients[1];
    OK(mbm_gateway_begin(&b.gateway, &config));
    assert_int_equal(mbm_client_pending(&b.clients[0]), 0);
    memset(b.requests, 0xFF, sizeof b.requests); /* not the gateway's any more */
    memset(b.connections, 0xFF, sizeof b.connections);
    gateway_bench_open(&b, 1);
    ASK(1, 1, 9, READ);
    ON_LINE(1, 9, READ);
    REPLY(1, 9, VALUE);
    EXPECT(1, 1, 9, VALUE);
}

/* --- calls from within hooks --- */

static unsigned entered;
static mbm_port inner; /* the hooks that do the work */

static void every_call_is_busy(void)
{
    static mbm_unit unit;
    const mbm_port port = memory_port_of(&b.sockets[1]);

    entered++;
    REFUSED(MBM_BUSY, b.gateway, mbm_gateway_begin(&b.gateway, &b.config));
    IS(MBM_BUSY, mbm_gateway_poll(&b.gateway));
    assert_int_equal(mbm_gateway_pollDelay(&b.gateway), 0);
    IS(MBM_BUSY, mbm_gateway_open(&b.gateway, 1, &port));
    IS(MBM_BUSY, mbm_gateway_close(&b.gateway, 0));
    IS(MBM_BUSY, mbm_gateway_close(&b.gateway, 1));
    IS(MBM_BUSY, mbm_gateway_status(&b.gateway, 0));
    assert_int_equal(mbm_gateway_pending(&b.gateway, 0), 0);
    assert_int_equal(mbm_gateway_isReading(&b.gateway, 0), 0);
    IS(MBM_BUSY, mbm_gateway_setMaxPending(&b.gateway, 1));
    IS(MBM_BUSY, mbm_gateway_setQueueTime(&b.gateway, 1));
    IS(MBM_BUSY, mbm_gateway_serveUnits(&b.gateway, &unit, 1));
    IS(MBM_BUSY, mbm_gateway_setFunctions(&b.gateway, NULL, 0));
}

static int16_t hooked_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    every_call_is_busy();
    return inner.read(context, bytes, capacity);
}

static int16_t hooked_write(void *context, const uint8_t *bytes, uint16_t length)
{
    every_call_is_busy();
    return inner.write(context, bytes, length);
}

static uint32_t hooked_micros(void *context)
{
    every_call_is_busy();
    return inner.micros(context);
}

static mbm_port hooked(memory_port *m)
{
    mbm_port port = inner = memory_port_of(m);

    port.read = hooked_read;
    port.write = hooked_write;
    port.micros = hooked_micros;
    return port;
}

static uint8_t is_ready(void *context)
{
    every_call_is_busy();
    return 1;
}

static uint16_t serve(void *context, const mbm_request *request, uint8_t *response,
                      uint16_t capacity)
{
    every_call_is_busy();
    response[0] = 0x77;
    return 1;
}

static void done(void *context, mbm_clientRequest *request)
{
    every_call_is_busy();
}

static void exchange(void)
{
    ASK(0, 1, 2, READ);
    ON_LINE(0, 2, READ);
    REPLY(0, 2, VALUE);
    EXPECT(0, 1, 2, VALUE);
}

TEST(hooks_of_a_connection_cannot_use_the_gateway)
{
    const mbm_port port = hooked(&b.sockets[0]);

    OK(mbm_gateway_close(&b.gateway, 0));
    OK(mbm_gateway_open(&b.gateway, 0, &port));
    OK(mbm_gateway_setQueueTime(&b.gateway, 1000));
    entered = 0;
    exchange();
    assert_true(entered > 3);
}

TEST(hooks_of_a_line_cannot_use_the_gateway)
{
    mbm_port port = hooked(&b.wires[0]);

    /* The clock of the new port is read at once, in begin, when nothing may be refused. */
    memset(&b.clients[0], 0, sizeof b.clients[0]);
    WITH(port.micros, inner.micros,
         OK(mbm_client_beginRtu(&b.clients[0], &port, b.frames[0], MBM_MAX_FRAME)));
    b.lines[0].isReady = is_ready;
    entered = 0;
    exchange();
    assert_true(entered > 3);
}

TEST(functions_of_own_units_and_of_own_requests_cannot_use_the_gateway)
{
    static mbm_unit unit;
    static mbm_custom custom = {.serve = serve, .code = 0x41};
    static mbm_clientRequest own = {.unit = 9, .done = done};

    OK(mbm_unit_serveCustom(&unit, &custom));
    OK(mbm_gateway_serveUnits(&b.gateway, &unit, 1));
    entered = 0;
    ASK(0, 1, 200, "\x41");
    EXPECT(0, 1, 200, "\x41\x77");
    assert_int_equal(entered, 1);
    IS(MBM_PENDING, mbm_client_readExceptionStatus(&b.clients[0], &own));
    ON_LINE(0, 9, "\x07");
    REPLY(0, 9, "\x07\x01");
    while (own.status == MBM_PENDING)
        gateway_bench_step(&b);
    assert_int_equal(entered, 2);
}

/* A program may poll a line's client itself. While its port has the control, the gateway
 * cannot take its requests back from it. */
static void close_and_poll(int busy)
{
    const uint8_t expected = busy ? MBM_BUSY : MBM_OK;

    IS(expected, mbm_gateway_poll(&b.gateway));
    IS(expected, mbm_gateway_close(&b.gateway, 0));
}

static int16_t read_and_close(void *context, uint8_t *bytes, uint16_t capacity)
{
    entered++;
    IS(MBM_BUSY, mbm_gateway_begin(&b.gateway, &b.config));
    close_and_poll(1);
    return inner.read(context, bytes, capacity);
}

TEST(a_hook_of_a_line_that_the_program_polls_cannot_use_the_gateway)
{
    mbm_port port = inner = memory_port_of(&b.wires[0]);

    port.read = read_and_close;
    OK(mbm_client_beginRtu(&b.clients[0], &port, b.frames[0], MBM_MAX_FRAME));
    ASK(0, 1, 2, READ);
    inner.read = memory_port_of(&b.wires[0]).read;
    entered = 0;
    /* The gateway queues the request; then the program polls the client. */
    OK(mbm_gateway_poll(&b.gateway));
    while (entered == 0) {
        b.wires[0].now += 1000;
        IS(MBM_PENDING, mbm_client_poll(&b.clients[0]));
    }
    OK(mbm_gateway_status(&b.gateway, 0));
    assert_int_equal(mbm_gateway_pending(&b.gateway, 0), 1);
}

/* `done` of a request may use the gateway, if the program itself polls the client. */
static void done_and_close(void *context, mbm_clientRequest *request)
{
    entered++;
    close_and_poll(0);
}

TEST(done_may_use_the_gateway_if_the_program_polls_the_line)
{
    static mbm_clientRequest own;

    own = (mbm_clientRequest){.unit = 9, .done = done_and_close};
    IS(MBM_PENDING, mbm_client_readExceptionStatus(&b.clients[0], &own));
    ASK(0, 1, 2, READ);
    ON_LINE(0, 9, "\x07");
    REPLY(0, 9, "\x07\x01");
    entered = 0;
    while (entered == 0) {
        b.wires[0].now += 1000;
        (void)mbm_client_poll(&b.clients[0]);
    }
    IS(MBM_NOT_INITIALISED, mbm_gateway_status(&b.gateway, 0));
    assert_int_equal(mbm_client_pending(&b.clients[0]), 0);
    ASK(1, 1, 2, READ);
    ON_LINE(0, 2, READ);
}

/* Each function of the gateway is held to its comment in mbm.h: results, limits, defaults, NULL.
 * test_gateway_misuse has every config that is refused, and the calls from within hooks. */

enum { FREE = 2 };

static void start_with_a_free_place(void)
{
    gateway_bench_start(&b, routes, COUNT(routes));
    OK(mbm_gateway_close(&b.gateway, FREE));
}

TEST_WITH(a_place_is_opened_and_closed, start_with_a_free_place, NULL)
{
    const mbm_port port = memory_port_of(&b.sockets[FREE]);

    REFUSED(MBM_NOT_INITIALISED, b, mbm_gateway_status(&b.gateway, FREE));
    INVALID(b, mbm_gateway_status(&b.gateway, BENCH_CONNECTIONS));
    REFUSED(MBM_OK, b, mbm_gateway_close(&b.gateway, FREE)); /* it is free already */
    INVALID(b, mbm_gateway_close(&b.gateway, BENCH_CONNECTIONS));
    INVALID(b, mbm_gateway_open(&b.gateway, BENCH_CONNECTIONS, &port));
    INVALID(b, mbm_gateway_open(&b.gateway, FREE, NULL));
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

TEST_WITH(requests_are_counted_until_they_are_answered, start_with_a_free_place, NULL)
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

TEST_WITH(settings_have_the_defaults_and_ranges_of_the_header, start_with_a_free_place, NULL)
{
    static const mbm_function right = {.code = 65}, wrong = {.code = 128};
    static mbm_unit unit;

    INVALID(b, mbm_gateway_setMaxPending(&b.gateway, 0));
    OK(mbm_gateway_setMaxPending(&b.gateway, 1));
    OK(mbm_gateway_setQueueTime(&b.gateway, 1000000));
    INVALID(b, mbm_gateway_setQueueTime(&b.gateway, 1000001));
    OK(mbm_gateway_setFunctions(&b.gateway, &right, 1));
    OK(mbm_gateway_setFunctions(&b.gateway, NULL, 0));
    INVALID(b, mbm_gateway_setFunctions(&b.gateway, &wrong, 1));
    INVALID(b, mbm_gateway_setFunctions(&b.gateway, NULL, 1));
    OK(mbm_gateway_serveUnits(&b.gateway, &unit, 1));
    INVALID(b, mbm_gateway_serveUnits(&b.gateway, NULL, 1));
    INVALID(b, mbm_gateway_begin(&b.gateway, NULL));
    OK(mbm_gateway_begin(&b.gateway, &b.config));
    IS(MBM_NOT_INITIALISED, mbm_gateway_status(&b.gateway, 0));
}

TEST_WITH(what_was_never_begun_is_refused, start_with_a_free_place, NULL)
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
