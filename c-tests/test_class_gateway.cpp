/* ModbusTcpGateway between a real libmodbus TCP client and a real libmodbus RTU server on a
 * pty. */
#include "libmodbus_client.h"
#include "pty_stream.h"
#include "wire.h"

#include "ModbusTcpGateway.h"
#include <ESP8266WiFi.h>

extern "C" {
#include "server.h"
}

static server device;
static PtyStream tty;
static WiFiServer *wifi;
static ModbusSerialClient *line;
static ModbusTcpGateway<WiFiServer> *gateway;

static void start()
{
    reset_board();
    board().realTime = true;
    server_start(&device, 17);
    tty.fd = device.line.ours;
    wifi = new WiFiServer(502);
    line = new ModbusSerialClient;
    gateway = new ModbusTcpGateway<WiFiServer>;
    wifi->begin();
    line->begin(tty, 115200);
    line->setResponseTimeout(PATIENCE_MS);
    IS(MBM_NOT_INITIALISED, gateway->poll());
    IS(MBM_INVALID_ARGUMENT, gateway->begin(*wifi, *line, 0));
    IS(MBM_INVALID_ARGUMENT, gateway->begin(*wifi, *line, 273, 274));
    OK(gateway->begin(*wifi, *line, 17, 18));
}

static void stop()
{
    delete gateway;
    delete line;
    delete wifi;
    server_stop(&device);
}

fixture each_test = {start, stop};

/* Returns the result of a client's call, while the sketch's loop polls the gateway. */
static int passes(modbus_t *peer, int (*call)(modbus_t *))
{
    return result_of(peer, call, [] { OK(gateway->poll()); });
}

static modbus_t *client_of(int unit)
{
    return connect_client(502, unit);
}

static void hang_up(modbus_t *peer)
{
    close_client(peer);
    AWAIT((gateway->poll(), gateway->connections() == 0));
}

static uint16_t words[125];
static uint8_t bits[2000];

static int read_registers(modbus_t *peer)
{
    return modbus_read_registers(peer, 3, 125, words);
}

static int error_of_a_read(modbus_t *peer)
{
    return modbus_read_registers(peer, 3, 1, words) == 1 ? 0 : errno;
}

TEST(requests_and_replies_of_any_length_are_forwarded)
{
    modbus_t *peer = client_of(17);
    assert_int_equal(passes(peer, read_registers), 125);
    for (unsigned i = 0; i < 125; i++)
        assert_int_equal(words[i], server_pattern(3 + i));
    assert_int_equal(passes(peer, [](modbus_t *p) { return modbus_read_bits(p, 5, 2000, bits); }),
                     2000);
    for (unsigned i = 0; i < 2000; i++)
        assert_int_equal(bits[i], server_bit_pattern(5 + i));
    assert_int_equal(
        passes(peer, [](modbus_t *p) { return modbus_write_registers(p, 40, 123, words); }), 123);
    assert_int_equal(device.mapping->tab_registers[162], words[122]);
    assert_int_equal(passes(peer, [](modbus_t *p) { return modbus_write_bit(p, 30, 1); }), 1);
    assert_int_equal(device.mapping->tab_bits[30], 1);
    assert_int_equal(passes(peer,
                            [](modbus_t *p) {
                                return modbus_write_and_read_registers(p, 70, 2, words, 70, 2,
                                                                       words + 2);
                            }),
                     2);
    assert_int_equal(words[2], words[0]);
    hang_up(peer);
}

TEST(the_exception_of_a_device_is_forwarded)
{
    modbus_t *peer = client_of(17);
    assert_int_equal(passes(peer,
                            [](modbus_t *p) {
                                int count = modbus_read_registers(p, SERVER_REGISTERS, 1, words);
                                return count < 0 ? errno : count;
                            }),
                     EMBXILADD);
    hang_up(peer);
}

TEST(a_unit_without_a_line_gets_0a_and_a_silent_unit_0b)
{
    modbus_t *peer = client_of(19);
    assert_int_equal(passes(peer, error_of_a_read), EMBXGPATH);
    modbus_set_slave(peer, 255);
    assert_int_equal(passes(peer, error_of_a_read), EMBXGPATH);
    line->setResponseTimeout(50);
    modbus_set_slave(peer, 18);
    assert_int_equal(passes(peer, error_of_a_read), EMBXGTAR);
    line->setResponseTimeout(PATIENCE_MS);
    modbus_set_slave(peer, 17);
    assert_int_equal(passes(peer, error_of_a_read), 0);
    hang_up(peer);
}

TEST(clients_and_the_sketch_share_the_line)
{
    modbus_t *peers[] = {client_of(17), client_of(17), client_of(17), client_of(17)};
    ModbusRequestOf<1> own(17);
    for (unsigned round = 0; round < 3; round++)
        for (modbus_t *peer : peers) {
            IS(MBM_PENDING, line->readHoldingRegisters(own, 9, 1));
            assert_int_equal(passes(peer, read_registers), 125);
            AWAIT((gateway->poll(), !own.pending()));
            assert_int_equal(own[0], server_pattern(9));
        }
    assert_int_equal(gateway->connections(), 4);
    for (modbus_t *peer : peers)
        close_client(peer);
    AWAIT((gateway->poll(), gateway->connections() == 0));
}

TEST(closing_a_connection_cancels_its_request)
{
    const uint8_t request[] = {0, 1, 0, 0, 0, 6, 18, 3, 0, 3, 0, 1};
    WiFiClient hasty;
    assert_int_equal(hasty.connect("gateway", 502), 1);
    hasty.write(request, sizeof request);
    AWAIT((gateway->poll(), line->pending() == 1)); // unit 18 does not exist
    // The gateway does not read a client whose request is pending. begin closes all of them.
    OK(gateway->begin(*wifi, *line));
    assert_int_equal(line->pending(), 0);
    assert_int_equal(gateway->connections(), 0);
    modbus_t *peer = client_of(17);
    assert_int_equal(passes(peer, error_of_a_read), 0);
    hang_up(peer);
}
