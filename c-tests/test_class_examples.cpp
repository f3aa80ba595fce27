/* The unchanged examples that use a network, on a simulated board. Real sockets connect them
 * to a real libmodbus. */
#include "libmodbus_client.h"
#include "wire.h"

#include "ModbusTcpGateway.h"
#include "ModbusTcpServer.h"
#include <ESP8266WiFi.h>
#include <Ethernet.h>

extern "C" {
#include "server.h"
#include "tcp_server.h"
}

/* Arduino cores do not enable this warning for sketches. */
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
namespace tcp_client {
#include "../examples/arduino/TcpClient/TcpClient.ino"
}
namespace tcp_server_sketch {
#include "../examples/arduino/TcpServer/TcpServer.ino"
}
namespace gateway_sketch {
#include "../examples/arduino/TcpToRtuGateway/TcpToRtuGateway.ino"
}
#pragma GCC diagnostic pop

/* Returns the result of a client's call, while the sketch's `loop` runs. */
static int gets(void (*loop)(), int (*call)(modbus_t *))
{
    modbus_t *peer = connect_client(502);
    const int result = result_of(peer, call, loop);
    close_client(peer);
    return result;
}

static void real_time()
{
    reset_board();
    pins() = Pins();
    board().realTime = true;
}

fixture each_test = {real_time, nullptr};

TEST(the_tcp_client_reads_writes_and_connects_again)
{
    tcp_server device;
    tcp_server_start(&device);
    networkPort(502) = device.port;
    tcp_client::setup();
    device.mapping->tab_registers[10] = 300;
    device.mapping->tab_registers[11] = 33;
    AWAIT((tcp_client::loop(),
           __atomic_load_n(&device.mapping->tab_registers[20], __ATOMIC_SEQ_CST) == 333));
    assert_int_equal(pins().level[13], HIGH);
    tcp_server_stop(&device);
    AWAIT((tcp_client::loop(), pins().level[13] == LOW));
    tcp_server_start(&device);
    networkPort(502) = device.port;
    AWAIT((tcp_client::loop(), pins().level[13] == HIGH)); // the sketch tries every five seconds
    tcp_client::client.stop();
    tcp_server_stop(&device);
}

TEST(the_tcp_server_serves_a_sensor_and_a_relay)
{
    static uint16_t word;
    pins().voltage[A0] = 513;
    tcp_server_sketch::setup();
    AWAIT((tcp_server_sketch::loop(), tcp_server_sketch::sensor[0] == 513));
    assert_int_equal(gets(tcp_server_sketch::loop,
                          [](modbus_t *peer) {
                              return modbus_read_input_registers(peer, 0, 1, &word) == 1 &&
                                             modbus_write_bit(peer, 0, 1) == 1
                                         ? word
                                         : -1;
                          }),
                     513);
    assert_int_equal(pins().level[4], HIGH);
    assert_int_equal(
        gets(tcp_server_sketch::loop, [](modbus_t *peer) { return modbus_write_bit(peer, 0, 0); }),
        1);
    assert_int_equal(pins().level[4], LOW);
}

TEST(the_gateway_passes_a_request_to_its_line)
{
    static uint16_t word;
    board().realTime = false; // the simulated UART has a clock of its own
    gateway_sketch::setup();
    assert_int_equal(Serial.baud, 19200);
    Serial.reply(adu({17, 3, 2, 2, 43}));
    assert_int_equal(gets(gateway_sketch::loop,
                          [](modbus_t *peer) {
                              modbus_set_slave(peer, 17);
                              return modbus_read_registers(peer, 107, 1, &word) == 1 ? word : -1;
                          }),
                     555);
    assert_sent(Serial, {17, 3, 0, 107, 0, 1});
    assert_int_equal(pins().level[4], LOW); // the driver is off
    assert_int_equal(gets(gateway_sketch::loop,
                          [](modbus_t *peer) {
                              modbus_set_slave(peer, 32); // not one of the gateway's units
                              return modbus_read_registers(peer, 107, 1, &word) == 1 ? 0 : errno;
                          }),
                     EMBXGPATH);
    assert_int_equal(Serial.sent.size(), 0);
}
