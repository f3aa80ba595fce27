/* setDriverPin of each class with a serial line: the levels of the pins around what is sent. */
#include "client_checks.h"
#include "server_checks.h"

#include "ModbusMaster.h"
#include "ModbusSniffer.h"

static void begin_log()
{
    reset_board();
    pins() = Pins();
    pins().areLogged = true;
}

static void end_log()
{
    pins() = Pins();
}

fixture each_test = {begin_log, end_log};

/* What happened since the last call: levels, and writes, flushes and reads of the port. */
static std::string happened()
{
    std::string log = board().log;
    board().log.clear();
    return log;
}

#define HAPPENED(events) assert_string_equal(happened().c_str(), events)

/* Each class, with a function that lets it send. */

static ModbusMaster &master()
{
    static ModbusMaster node;
    node.begin(17, Serial);
    return node;
}

static void send_as_master(ModbusMaster &node)
{
    Serial.reply(adu({17, 3, 2, 0, 5}));
    OK(node.readHoldingRegisters(0, 1));
}

static void send_as_client(ModbusSerialClient &client)
{
    ModbusRequestOf<1> request(17);
    client.readHoldingRegisters(request, 0, 1);
    Serial.reply(adu({17, 3, 2, 0, 5}));
    run_until_idle(client);
    OK(request.status());
}

static ModbusRegisterArray<1> registers;

static void send_as_server(ModbusServer &server)
{
    receive(server, adu({17, 3, 0, 0, 0, 1}));
    assert_int_equal(Serial.sent.size(), 1);
    Serial.sent.clear();
}

TEST(a_pin_becomes_an_output_with_the_driver_off)
{
    ModbusSerialClient client;
    client.begin(Serial, 19200);
    client.setDriverPin(2);
    HAPPENED("2=0 ");
    assert_int_equal(pins().mode[2], OUTPUT);
    client.setDriverPin(3, LOW);
    HAPPENED("3=1 ");
    assert_int_equal(pins().mode[3], OUTPUT);
}

TEST(a_master_sends_with_the_driver_on)
{
    ModbusMaster &node = master();
    node.setDriverPin(2);
    happened();
    send_as_master(node);
    HAPPENED("2=1 write flush 2=0 read ");
    node.setDriverPin(2, LOW);
    happened();
    send_as_master(node);
    HAPPENED("2=0 write flush 2=1 read ");
}

TEST(a_client_sends_with_the_driver_on)
{
    ModbusSerialClient client;
    client.setDriverPin(2); // before begin too
    client.begin(Serial, 19200);
    happened();
    send_as_client(client);
    HAPPENED("2=1 write flush 2=0 read ");
}

TEST(a_server_sends_with_the_driver_on)
{
    ModbusServer server;
    server.holdingRegisters(registers);
    server.begin(17, Serial, 19200);
    server.setDriverPin(2);
    happened();
    send_as_server(server);
    HAPPENED("read 2=1 write flush 2=0 ");
}

/* The receiver goes off before the driver goes on, and on after it is off: its output never has the
 * bytes that are sent. */
TEST(a_receiver_at_its_own_pin_is_off_meanwhile)
{
    ModbusSerialClient client;
    client.begin(Serial, 19200);
    client.setDriverPins(3, 2); // DE, /RE
    HAPPENED("3=0 2=0 ");
    send_as_client(client);
    HAPPENED("2=1 3=1 write flush 3=0 2=0 read ");
    client.setDriverPins(3, 2, LOW, HIGH);
    HAPPENED("3=1 2=1 ");
    send_as_client(client);
    HAPPENED("2=0 3=0 write flush 3=1 2=1 read ");
}

TEST(two_objects_have_a_pin_each)
{
    ModbusSerialClient first, second;
    first.begin(Serial, 19200);
    second.begin(Serial, 19200);
    first.setDriverPin(4);
    second.setDriverPin(31);
    happened();
    send_as_client(first);
    HAPPENED("4=1 write flush 4=0 read ");
    send_as_client(second);
    HAPPENED("31=1 write flush 31=0 read ");
}

TEST(a_callback_takes_the_place_of_a_pin)
{
    ModbusSerialClient client;
    client.begin(Serial, 19200);
    client.setDriverPin(2);
    client.preTransmission([] { board().logEvent("pre"); });
    client.postTransmission(nullptr);
    happened();
    send_as_client(client);
    HAPPENED("pre write flush read ");
}

TEST(a_sniffer_keeps_the_driver_off)
{
    ModbusSniffer::setDriverPin(2);
    HAPPENED("2=0 ");
    assert_int_equal(pins().mode[2], OUTPUT);
    ModbusSniffer::setDriverPin(2, LOW);
    HAPPENED("2=1 ");
}
