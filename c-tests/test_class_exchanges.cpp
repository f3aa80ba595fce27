/* The exchanges of support/exchanges.c, played by ModbusMaster and by ModbusSerialClient. */
#include "client_checks.h"

#include "ModbusMaster.h"

extern "C" {
#include "exchanges.h"
#include "sim.h"
}

fixture each_test = {reset_board, nullptr};

static Bytes bytes_of(const char *text)
{
    uint8_t bytes[512];
    const size_t length = text ? sim_bytes(bytes, text) : 0;

    return Bytes(bytes, bytes + length);
}

static uint8_t calls(ModbusMaster &node, const exchange *e)
{
#define MASTER(name, ...) node.name(__VA_ARGS__)
    EXCHANGE_CALL(e, MASTER);
}

static uint8_t calls(ModbusSerialClient &client, ModbusRequest &request, const exchange *e)
{
#define CLIENT(name, ...) client.name(request, __VA_ARGS__)
    EXCHANGE_CALL(e, CLIENT);
}

static void assert_request(const exchange *e)
{
    if (e->request && !e->request[0]) {
        assert_int_equal(Serial.sent.size(), 0);
        return;
    }
    assert_int_equal(Serial.sent.size(), 1);
    if (e->request)
        assert_bytes(Serial.sent[0], bytes_of(e->request));
    Serial.sent.clear();
}

static void master_plays(ModbusMaster &node, const exchange *e)
{
    uint16_t words[MBM_MAX_READ_REGISTERS];
    const uint16_t sent = exchange_words(words, e->words);
    for (uint8_t i = 0; i < sent; i++)
        node.setTransmitBuffer(i, words[i]);
    const uint16_t count = exchange_words(words, e->response);
    const uint16_t before = node.getResponseBuffer(0);
    node.setSlaveID(exchange_unit(e));
    if (e->reply)
        Serial.reply(bytes_of(e->reply));
    assert_int_equal(calls(node, e), e->status);
    assert_int_equal(node.getExceptionCode(), e->exception);
    assert_request(e);
    if (!e->response)
        assert_int_equal(node.getResponseBuffer(0), before);
    else
        assert_int_equal(node.available(), count);
    for (uint8_t i = 0; i < count; i++)
        assert_int_equal(node.getResponseBuffer(i), words[i]);
}

static void client_plays(ModbusSerialClient &client, const exchange *e)
{
    ModbusRequestOf<MBM_MAX_READ_REGISTERS> request(exchange_unit(e));
    uint16_t words[MBM_MAX_READ_REGISTERS];
    const uint16_t sent = exchange_words(words, e->words);
    for (uint16_t i = 0; i < sent; i++)
        request[i] = words[i];
    for (uint16_t i = 0; exchange_has_bits(e) && i < 16 * sent; i++)
        request.setBit(i, words[i / 16] >> i % 16 & 1);
    const uint16_t count = exchange_words(words, e->response);
    if (e->reply)
        Serial.reply(bytes_of(e->reply));
    const uint8_t status = calls(client, request, e);
    while (client.poll() == MBM_PENDING)
        board().now += 100;
    assert_int_equal(status == MBM_PENDING ? request.status() : status, e->status);
    assert_request(e);
    for (uint16_t i = 0; exchange_has_bits(e) && count > 0 && i < e->with[1]; i++)
        assert_int_equal(request.getBit(i), words[i / 16] >> i % 16 & 1);
    for (uint16_t i = 0; !exchange_has_bits(e) && i < count; i++)
        assert_int_equal(request[i], words[i]);
}

static void play(const exchange_group &group)
{
    static const exchange next = {3,      {0, 1, 0, 0}, nullptr, nullptr, "11 03 02 00 2A +",
                                  MBM_OK, "002A",       0};
    ModbusMaster node;
    node.begin(17, Serial);
    node.setQuietTime(0);
    node.setResponseTimeout(100);
    for (size_t i = 0; i < group.count; i++) {
        master_plays(node, &group.rows[i]);
        master_plays(node, &next);
    }
    ModbusSerialClient client;
    client.begin(Serial, 19200);
    client.setQuietTime(0);
    client.setResponseTimeout(100);
    for (size_t i = 0; i < group.count; i++) {
        client_plays(client, &group.rows[i]);
        client_plays(client, &next);
    }
}

#define GROUP_TEST(name) TEST_ROW(name, play(name##_rows))
EXCHANGE_GROUPS(GROUP_TEST)
