/* A blocking master inside TLS: RTU frames, as some gateways take them. */
#include "test.h"
#include "tls_pair.h"

#include <string.h>

enum { UNIT = 17, FIRST = 100, WORDS = 20, TICK_US = 1000 };

static tls_pair pair;
static mbm_server server;
static mbm_line line;
static mbm_node master;
static mbm_unit unit;
static mbm_registerTable holding;
static uint16_t words[WORDS], response[WORDS];
static uint8_t frame[MBM_MAX_FRAME], own_frame[MBM_MAX_FRAME];
static unsigned idles;

/* The port below sleeps here. Meanwhile time passes, and the server serves. */
static void serve(void)
{
    idles++;
    pair.now += TICK_US;
    (void)mbm_server_poll(&server);
}

static void begin(void)
{
    tls_pair_begin(&pair, "operator", "server");
    pair.idle = serve;
    memset(&unit, 0, sizeof unit);
    unit.id = UNIT;
    holding = (mbm_registerTable){.words = words, .base = FIRST, .size = WORDS};
    for (unsigned i = 0; i < WORDS; i++)
        words[i] = (uint16_t)(0xC000 + i);
    OK(mbm_unit_serveHoldingRegisters(&unit, &holding));
    OK(mbm_server_beginRtuOverTcp(&server, &pair.server.port, &unit, 1, frame, sizeof frame));
    OK(mbm_line_beginRtu(&line, &pair.client.port, own_frame, sizeof own_frame));
    OK(mbm_node_begin(&master, &line, UNIT, response, WORDS, NULL, 0));
}

static void end(void)
{
    tls_pair_end(&pair);
}

fixture each_test = {begin, end};

TEST(a_master_reads_while_its_idle_hook_lets_the_port_below_sleep)
{
    tls_pair_run(&pair);
    idles = 0;
    for (unsigned i = 0; i < 3; i++) {
        memset(response, 0, sizeof response);
        OK(mbm_node_readHoldingRegisters(&master, FIRST, WORDS));
        assert_memory_equal(response, words, sizeof words);
    }
    assert_true(idles > 0);
}

TEST(a_master_without_a_session_reports_a_lost_link)
{
    mbm_tls_close(&pair.client.tls);
    IS(MBM_LINK_LOST, mbm_node_readHoldingRegisters(&master, FIRST, WORDS));
}
