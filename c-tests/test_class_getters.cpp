/* The getters of the classes' settings: defaults, and what was set. */
#include "client_checks.h"
#include "server_checks.h"

#include "ModbusSniffer.h"

static void a_master_returns_its_settings(void **)
{
    ModbusMaster node;
    node.begin(19200);
    assert_int_equal(node.getResponseTimeout(), 2000);
    assert_int_equal(node.getGap(), 2006);
    assert_int_equal(node.getTurnaroundDelay(), 100);
    assert_int_equal(node.getQuietTime(), 100);
    assert_int_equal(node.getRetries(), 0);
    assert_false(node.getEchoDiscard());
    assert_false(node.getLenient());
    assert_int_equal(node.getPostFlushHold(), 0);
    assert_true(node.getBlocking());
    assert_int_equal(node.getWordOrder(), ModbusMaster::orderABCD);
    node.setResponseTimeout(300);
    node.setGap(5);
    node.setTurnaroundDelay(6);
    node.setQuietTime(7);
    node.setRetries(8);
    node.setEchoDiscard(true);
    node.setLenient(true);
    node.setPostFlushHold(9);
    node.setBlocking(false);
    node.setWordOrder(ModbusMaster::orderCDAB);
    const ModbusMaster &same = node;
    assert_int_equal(same.getResponseTimeout(), 300);
    assert_int_equal(same.getGap(), 5);
    assert_int_equal(same.getTurnaroundDelay(), 6);
    assert_int_equal(same.getQuietTime(), 7);
    assert_int_equal(same.getRetries(), 8);
    assert_true(same.getEchoDiscard());
    assert_true(same.getLenient());
    assert_int_equal(same.getPostFlushHold(), 9);
    assert_false(same.getBlocking());
    assert_int_equal(same.getWordOrder(), ModbusMaster::orderCDAB);
}

static void a_client_returns_its_settings(void **)
{
    ModbusSerialClient client;
    assert_int_equal(client.begin(Serial, 9600), MBM_OK);
    assert_int_equal(client.getResponseTimeout(), 2000);
    assert_int_equal(client.getGap(), 4011);
    client.setResponseTimeout(1);
    client.setTurnaroundDelay(2);
    client.setQuietTime(3);
    client.setRetries(4);
    client.setEchoDiscard(true);
    client.setPostFlushHold(5);
    client.setGap(6);
    const ModbusSerialClient &same = client;
    assert_int_equal(same.getResponseTimeout(), 1);
    assert_int_equal(same.getTurnaroundDelay(), 2);
    assert_int_equal(same.getQuietTime(), 3);
    assert_int_equal(same.getRetries(), 4);
    assert_true(same.getEchoDiscard());
    assert_int_equal(same.getPostFlushHold(), 5);
    assert_int_equal(same.getGap(), 6);
    ModbusRequestOf<2> request(17);
    assert_int_equal(request.getWordOrder(), ModbusRequestOf<2>::orderABCD);
    request.setWordOrder(ModbusRequestOf<2>::orderDefault);
    assert_int_equal(request.getWordOrder(), ModbusRequestOf<2>::orderABCD);
    request.setWordOrder(ModbusRequestOf<2>::orderDCBA);
    assert_int_equal(request.getWordOrder(), ModbusRequestOf<2>::orderDCBA);
}

static void a_server_returns_its_settings(void **)
{
    ModbusServer server;
    server.begin(17, Serial, 19200);
    assert_int_equal(server.getSilence(), 2006);
    assert_false(server.getEchoDiscard());
    server.setSilence(5000);
    server.setEchoDiscard(true);
    assert_int_equal(server.getSilence(), 5000);
    assert_true(server.getEchoDiscard());
}

static void a_sniffer_returns_its_settings(void **)
{
    ModbusSniffer sniffer;
    sniffer.begin(Serial, 19200);
    assert_int_equal(sniffer.getResponseTimeout(), 1000);
    assert_int_equal(sniffer.getFrameTimeout(), 50);
    sniffer.setResponseTimeout(1);
    sniffer.setFrameTimeout(65535);
    assert_int_equal(sniffer.getResponseTimeout(), 1);
    assert_int_equal(sniffer.getFrameTimeout(), 65535);
}

int main()
{
    const struct CMUnitTest tests[] = {
        TEST(a_master_returns_its_settings),
        TEST(a_client_returns_its_settings),
        TEST(a_server_returns_its_settings),
        TEST(a_sniffer_returns_its_settings),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}
