/* The port for lwIP's raw API, client and server, over Debian's lwIP and a wire in memory: what
 * comes in other pieces than frames, and what lwIP or the network does not take. */
#include "mbm_lwip.h"
#include "lwip_wire.h"
#include "test.h"

enum { PLACES = 3, REGISTERS = 125, PORT = 502 };

static uint16_t words[REGISTERS];
static mbm_registerTable holding;
static mbm_unit unit;
static mbm_lwip_listener listener;
static mbm_lwip places[PLACES];
static mbm_server servers[PLACES];
static uint8_t frames[PLACES][MBM_MAX_TCP_FRAME];

static mbm_lwip device;
static mbm_client client;
static uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
static uint16_t reply[REGISTERS];
static mbm_clientRequest request;

/* The main loop of a server. */
static void serve(void)
{
    int i;

    while ((i = mbm_lwip_accept(&listener)) >= 0) {
        const mbm_port port = mbm_lwip_port(&places[i]);

        OK(mbm_server_beginTcp(&servers[i], &port, &unit, 1, frames[i], sizeof frames[i]));
    }
    for (i = 0; i < PLACES; i++) {
        if (mbm_lwip_isInUse(&places[i]) && mbm_server_poll(&servers[i]) != MBM_OK)
            mbm_lwip_close(&places[i]);
    }
}

static void serve_and_poll(void)
{
    serve();
    (void)mbm_client_poll(&client);
}

static void setup(void)
{
    int i;

    wire_begin();
    memset(&holding, 0, sizeof holding);
    memset(&unit, 0, sizeof unit);
    memset(&listener, 0, sizeof listener);
    memset(places, 0, sizeof places);
    memset(servers, 0, sizeof servers);
    memset(&device, 0, sizeof device);
    memset(&client, 0, sizeof client);
    memset(&request, 0, sizeof request);
    for (i = 0; i < REGISTERS; i++)
        words[i] = (uint16_t)(0x100 * i + 7);
    holding.words = words;
    holding.size = REGISTERS;
    unit.id = 1;
    OK(mbm_unit_serveHoldingRegisters(&unit, &holding));
    OK(mbm_lwip_listen(&listener, NULL, PORT, places, PLACES));
}

static void teardown(void)
{
    int i;

    mbm_lwip_closeListener(&listener);
    for (i = 0; i < PLACES; i++)
        mbm_lwip_close(&places[i]);
    mbm_lwip_close(&device);
    wire_end();
}

fixture each_test = {setup, teardown};

static void connect_client(void)
{
    const mbm_port port = mbm_lwip_port(&device);

    IS(MBM_PENDING, mbm_lwip_open(&device, &the_wire.far, PORT));
    OK(mbm_client_beginTcp(&client, &port, incoming, sizeof incoming, outgoing, sizeof outgoing));
    wire_deliver();
    OK(mbm_lwip_status(&device));
}

static void queue_read(uint16_t quantity)
{
    request.unit = 1;
    request.reply = reply;
    request.replyBytes = sizeof reply;
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &request, 0, quantity));
}

static void read_all(void)
{
    memset(reply, 0, sizeof reply);
    queue_read(REGISTERS);
    wire_pass(500, serve_and_poll);
    IS(MBM_OK, request.status);
    assert_memory_equal(reply, words, sizeof words);
}

TEST(a_client_reads_what_a_server_has)
{
    connect_client();
    read_all();
    read_all();
}
