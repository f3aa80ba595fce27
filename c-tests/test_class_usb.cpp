/* A serial port over USB, whose class the library knows: bytes come in packets, and silence means
 * nothing. */
#define ARDUINO_ARCH_STM32 /* whose class for USB is USBSerial */
#include "client_checks.h"
#include "server_checks.h"

#include "ModbusMaster.h"

/* The USB port of a core. Its rate is what the host chose, and means nothing. */
class USBSerial : public HardwareSerial {
public:
    static unsigned long baudRate() { return 300; }
};

static USBSerial usb;
static ModbusRegisterArray<40> registers;

static void begin()
{
    reset_board();
    usb = USBSerial();
    for (uint16_t i = 0; i < 40; i++)
        registers[i] = i;
}

fixture each_test = {begin, nullptr};

/* Polls once for each packet that arrives, and `ms` milliseconds pass before it. */
static void arrive(ModbusServer &server, const Bytes &bytes, size_t packet, uint32_t ms)
{
    for (size_t at = 0; at < bytes.size(); at += packet) {
        const size_t end = at + packet < bytes.size() ? at + packet : bytes.size();
        board().now += ms * 1000;
        usb.inject(Bytes(bytes.begin() + static_cast<std::ptrdiff_t>(at),
                         bytes.begin() + static_cast<std::ptrdiff_t>(end)));
        OK(server.poll());
    }
    OK(server.poll());
}

static Bytes write_of_40()
{
    Bytes pdu = {17, 16, 0, 0, 0, 40, 80};
    pdu.resize(7 + 80, 0x11);
    return sealed(pdu);
}

/* The packets of a request of 89 bytes come 20 ms apart, which is longer than t3.5 of any rate. */
TEST(a_server_answers_a_request_in_packets_at_once)
{
    ModbusServer server;
    server.holdingRegisters(registers);
    OK(server.begin(17, usb, 115200));
    arrive(server, write_of_40(), 64, 20);
    assert_sent(usb, {17, 16, 0, 0, 0, 40});
    assert_int_equal(registers[39], 0x1111);
}

TEST(a_server_needs_no_silence_before_its_response)
{
    ModbusServer server;
    server.holdingRegisters(registers);
    OK(server.begin(17, usb, 1200)); // 32 ms of silence on a wire
    const uint32_t before = board().now;
    arrive(server, adu({17, 3, 0, 1, 0, 1}), 64, 0);
    assert_in_range(usb.startedAt - before, 0, 1000);
    assert_sent(usb, {17, 3, 2, 0, 1});
}

TEST(several_units_are_served_over_usb)
{
    static ModbusUnit units[2];
    ModbusServer server;
    units[0].setUnitID(17);
    units[1].setUnitID(18);
    units[1].holdingRegisters(registers);
    OK(server.begin(units, usb));
    arrive(server, adu({18, 3, 0, 2, 0, 1}), 64, 0);
    assert_sent(usb, {18, 3, 2, 0, 2});
}

/* A class that the library does not know is named by the sketch. */
TEST(a_port_of_another_class_is_over_usb_with_beginUsb)
{
    ModbusServer server;
    server.holdingRegisters(registers);
    OK(server.beginUsb(17, Serial));
    Serial.inject(adu({17, 3, 0, 1, 0, 1}));
    OK(server.poll());
    assert_sent(Serial, {17, 3, 2, 0, 1});
}

TEST(a_client_keeps_no_gap_over_usb)
{
    ModbusSerialClient client;
    ModbusRequestOf<1> request(17);
    OK(client.begin(usb, 1200));
    for (int i = 0; i < 2; i++) {
        const uint32_t before = board().now;
        IS(MBM_PENDING, client.readHoldingRegisters(request, 0, 1));
        usb.reply(adu({17, 3, 2, 0, 5}));
        run_until_idle(client);
        OK(request.status());
        assert_in_range(usb.startedAt - before, 0, 2000);
    }
}

TEST(a_client_is_over_usb_with_beginUsb)
{
    ModbusSerialClient client;
    ModbusRequestOf<1> request(17);
    OK(client.beginUsb(Serial));
    IS(MBM_PENDING, client.readHoldingRegisters(request, 0, 1));
    Serial.reply(adu({17, 3, 2, 0, 5}));
    run_until_idle(client);
    OK(request.status());
}

/* The rate that the host chose, 300 baud, would be a silence of 128 ms. */
TEST(a_master_does_not_ask_usb_for_its_rate)
{
    ModbusMaster node;
    node.begin(17, usb);
    usb.reply(adu({17, 3, 2, 0, 5}));
    IS(MBM_OK, node.readHoldingRegisters(0, 1));
    const uint32_t before = board().now;
    usb.reply(adu({17, 3, 2, 0, 5}));
    IS(MBM_OK, node.readHoldingRegisters(0, 1));
    assert_in_range(usb.startedAt - before, 0, 5000);
}
