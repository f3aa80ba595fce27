/* Buffers of more bytes than an int16_t can count. A port's read and write return an int16_t, and
 * hooked_port.c fails if it gets a larger capacity. */
#include "crc.h"
#include "hooked_port.h"
#include "test.h"

enum { LARGE = UINT16_MAX };

static uint8_t incoming[LARGE], outgoing[LARGE];

static hooked_port wire;
static mbm_port port;

static void reset(void)
{
    memset(&wire, 0, sizeof wire);
    wire.step = 1000;
    port = hooked_port_of(&wire);
}

fixture each_test = {reset, NULL};

TEST(a_client_over_tcp_works_with_large_buffers)
{
    static const uint8_t response[] = {0, 0, 0, 0, 0, 7, 1, 3, 4, 0, 1, 0, 2};
    static mbm_client client;
    uint16_t words[2] = {0};
    mbm_clientRequest request = {.unit = 1, .reply = words, .replyBytes = sizeof words};

    OK(mbm_client_beginTcp(&client, &port, incoming, LARGE, outgoing, LARGE));
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &request, 0, 2));
    IS(MBM_PENDING, mbm_client_poll(&client));
    hooked_port_arrive(&wire, response, sizeof response);
    OK(mbm_client_poll(&client));
    OK(request.status);
    assert_int_equal(words[1], 2);
}

TEST(a_client_on_a_serial_line_works_with_large_buffers)
{
    uint8_t response[] = {1, 3, 4, 0, 1, 0, 2, 0, 0};
    static mbm_client client;
    uint16_t words[2] = {0};
    mbm_clientRequest request = {.unit = 1, .reply = words, .replyBytes = sizeof words};

    OK(mbm_client_beginRtu(&client, &port, incoming, LARGE));
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &request, 0, 2));
    for (unsigned i = 0; i < 10; i++)
        IS(MBM_PENDING, mbm_client_poll(&client));
    (void)seal(response, 7);
    hooked_port_arrive(&wire, response, sizeof response);
    for (unsigned i = 0; i < 10; i++)
        (void)mbm_client_poll(&client);
    OK(request.status);
    assert_int_equal(words[1], 2);
}

static void assert_served(uint8_t (*begin)(mbm_server *, const mbm_port *, mbm_unit *, uint8_t,
                                           uint8_t *, uint16_t),
                          const uint8_t *request, size_t length, size_t answered)
{
    static mbm_server server;
    static uint16_t words[2];
    mbm_unit unit = {0};
    mbm_registerTable table = {0};

    memset(&server, 0, sizeof server);
    reset();
    unit.id = 1;
    table.words = words;
    table.size = 2;
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(begin(&server, &port, &unit, 1, incoming, LARGE));
    hooked_port_arrive(&wire, request, length);
    for (unsigned i = 0; i < 10; i++)
        OK(mbm_server_poll(&server));
    assert_int_equal(wire.length, answered);
}

TEST(a_server_works_with_large_buffers)
{
    static const uint8_t over_tcp[] = {0, 0, 0, 0, 0, 6, 1, 3, 0, 0, 0, 2};
    uint8_t over_rtu[] = {1, 3, 0, 0, 0, 2, 0, 0};

    (void)seal(over_rtu, 6);
    assert_served(mbm_server_beginTcp, over_tcp, sizeof over_tcp, 13);
    assert_served(mbm_server_beginRtu, over_rtu, sizeof over_rtu, 9);
    assert_served(mbm_server_beginRtuOverTcp, over_rtu, sizeof over_rtu, 9);
}
