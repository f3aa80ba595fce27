/* ModbusMaster with a real libmodbus server on a pty. */
#include "libmodbus_client.h"
#include "pty_stream.h"
#include "wire.h"

#include "ModbusClient.h"
#include "ModbusServer.h"

extern "C" {
#include "await.h"
#include "pty.h"
#include "server.h"
}

#include <poll.h>

static server peer;
static PtyStream line;
static ModbusMaster node;

static void start()
{
    board().realTime = true;
    server_start(&peer, 17);
    line.fd = peer.line.ours;
    node = ModbusMaster();
    node.begin(17, line);
    node.setBaudRate(115200);
    node.setResponseTimeout(PATIENCE_MS);
    node.idle([] {
        struct pollfd ready = {line.fd, POLLIN, 0};
        ::poll(&ready, 1, 1);
    });
}

static void stop()
{
    server_stop(&peer);
}

fixture each_test = {start, stop};

TEST(reads_what_the_server_holds)
{
    assert_int_equal(node.readHoldingRegisters(3, 125), 0);
    for (unsigned i = 0; i < 125; i++)
        assert_int_equal(node.getResponseBuffer(static_cast<uint8_t>(i)), server_pattern(3 + i));
    assert_int_equal(node.readInputRegisters(9, 1), 0);
    assert_int_equal(node.getResponseBuffer(0), static_cast<uint16_t>(~server_pattern(9)));
    assert_int_equal(node.readCoils(5, 2000), 0);
    for (unsigned i = 0; i < 2000; i++)
        assert_int_equal(node.getResponseBuffer(static_cast<uint8_t>(i / 16)) >> i % 16 & 1,
                         server_bit_pattern(5 + i));
    assert_int_equal(node.readDiscreteInputs(7, 3), 0);
    assert_int_equal(node.getResponseBuffer(0) & 1, !server_bit_pattern(7));
}

TEST(writes_reach_the_servers_memory)
{
    assert_int_equal(node.writeSingleRegister(40, 0xBEEF), 0);
    assert_int_equal(peer.mapping->tab_registers[40], 0xBEEF);
    assert_int_equal(node.writeSingleCoil(30, 1), 0);
    assert_int_equal(peer.mapping->tab_bits[30], 1);
    node.beginTransmission(50);
    node.send(uint32_t(0x11223344));
    node.send(5);
    assert_int_equal(node.writeMultipleRegisters(), 0);
    assert_int_equal(peer.mapping->tab_registers[50], 0x3344);
    assert_int_equal(peer.mapping->tab_registers[51], 0x1122);
    assert_int_equal(peer.mapping->tab_registers[52], 5);
    assert_int_equal(node.maskWriteRegister(50, 0xFF00, 0x0055), 0);
    assert_int_equal(peer.mapping->tab_registers[50], 0x3355);
    node.beginTransmission(60);
    node.sendBit(true);
    node.sendBit(false);
    node.sendBit(true);
    assert_int_equal(node.writeMultipleCoils(), 0);
    assert_int_equal(peer.mapping->tab_bits[60], 1);
    assert_int_equal(peer.mapping->tab_bits[61], 0);
    assert_int_equal(peer.mapping->tab_bits[62], 1);
    node.setTransmitBuffer(0, 0x7777);
    assert_int_equal(node.readWriteMultipleRegisters(70, 1, 70, 1), 0);
    assert_int_equal(node.getResponseBuffer(0), 0x7777);
}

TEST(an_exception_of_the_server_is_returned)
{
    assert_int_equal(node.readHoldingRegisters(SERVER_REGISTERS, 1),
                     ModbusMaster::ku8MBIllegalDataAddress);
    assert_int_equal(node.readHoldingRegisters(0, 1), 0);
}

TEST(copies_take_turns_on_one_line)
{
    ModbusMaster nodes[] = {node, node, node};
    for (unsigned i = 0; i < 9; i++) {
        assert_int_equal(nodes[i % 3].readHoldingRegisters(static_cast<uint16_t>(i), 1), 0);
        assert_int_equal(nodes[i % 3].getResponseBuffer(0), server_pattern(i));
    }
}

/* --- over USB, where a pty is like: bytes come in blocks, and silence means nothing */

TEST(a_client_over_usb_reads_what_the_server_holds)
{
    ModbusSerialClient client;
    ModbusRequestOf<125> request(17);
    assert_int_equal(client.beginUsb(line), MBM_OK);
    client.setResponseTimeout(PATIENCE_MS);
    assert_int_equal(client.readHoldingRegisters(request, 3, 125), MBM_PENDING);
    AWAIT(client.poll() != MBM_PENDING);
    assert_int_equal(request.status(), MBM_OK);
    for (unsigned i = 0; i < 125; i++)
        assert_int_equal(request[static_cast<uint8_t>(i)], server_pattern(3 + i));
}

static int read_and_write(modbus_t *client)
{
    uint16_t words[123] = {0};
    for (uint16_t i = 0; i < 100; i++)
        words[i] = static_cast<uint16_t>(i * 3);
    if (modbus_write_registers(client, 10, 100, words) != 100 ||
        modbus_read_registers(client, 0, 120, words) != 120)
        return -1;
    return words[0] == 0 && words[11] == 3 && words[109] == 297 && words[110] == 0;
}

TEST(a_server_over_usb_answers_a_libmodbus_client)
{
    ModbusRegisterArray<120> registers;
    ModbusServer ours;
    PtyStream usb;
    pty port;
    pty_open(&port);
    usb.fd = port.ours;
    ours.holdingRegisters(registers);
    assert_int_equal(ours.beginUsb(17, usb), MBM_OK);
    modbus_t *client = modbus_new_rtu(port.path, 115200, 'N', 8, 1);
    modbus_set_slave(client, 17);
    modbus_set_response_timeout(client, PATIENCE_MS / 1000, 0);
    assert_int_equal(modbus_connect(client), 0);
    assert_int_equal(result_of(client, read_and_write, [&ours] { ours.poll(); }), 1);
    close_client(client);
    pty_close(&port);
}
