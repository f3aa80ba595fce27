/* ModbusTcpServer over the shim's Ethernet and WiFi libraries. Its clients are real libmodbus
 * clients in threads of their own. */
#include "libmodbus_client.h"
#include "wire.h"

#include "ModbusTcpServer.h"
#include <ESP8266WiFi.h>
#include <Ethernet.h>

/* An older library, without accept: available returns any connection with bytes. */
class OlderServer : public SocketServer {
public:
    explicit OlderServer(uint16_t port) : SocketServer(port) {}
    EthernetClient available() { return withBytes(known); }

private:
    std::vector<EthernetClient> known;
};

/* Returns the result of a client's call, while the sketch's loop polls the server. */
template <typename Server>
static int serves(Server &server, modbus_t *peer, int (*call)(modbus_t *))
{
    return result_of(peer, call, [&server] { OK(server.poll()); });
}

static void real_time()
{
    reset_board();
    board().realTime = true;
}

fixture each_test = {real_time, nullptr};

static uint16_t words[8];

template <typename Listener> static void each_function_is_served()
{
    Listener listener(502);
    ModbusTcpServer<Listener> server;
    ModbusRegisterArray<8> holding;
    ModbusBitArray<8> coils;
    IS(MBM_NOT_INITIALISED, server.poll());
    listener.begin();
    server.holdingRegisters(holding);
    server.maskAndReadWrite(holding);
    server.coils(coils);
    OK(server.begin(7, listener));
    IS(MBM_INVALID_ARGUMENT, server.begin(263, listener));
    assert_int_equal(server.getUnitID(), 7);
    holding[2] = 0xBEEF;
    coils.set(1, true);
    modbus_t *peer = connect_client(502);
    assert_int_equal(
        serves(server, peer, [](modbus_t *p) { return modbus_read_registers(p, 1, 3, words); }), 3);
    assert_int_equal(words[1], 0xBEEF);
    assert_int_equal(
        serves(server, peer, [](modbus_t *p) { return modbus_write_register(p, 5, 77); }), 1);
    assert_int_equal(holding[5], 77);
    assert_int_equal(serves(server, peer,
                            [](modbus_t *p) {
                                const uint16_t more[] = {1, 2, 3};
                                return modbus_write_registers(p, 0, 3, more);
                            }),
                     3);
    assert_int_equal(holding[2], 3);
    assert_int_equal(
        serves(server, peer, [](modbus_t *p) { return modbus_mask_write_register(p, 5, 0xF0, 5); }),
        1);
    assert_int_equal(holding[5], (77 & 0xF0) | 5);
    assert_int_equal(serves(server, peer, [](modbus_t *p) { return modbus_write_bit(p, 3, 1); }),
                     1);
    assert_true(coils[3] && coils[1] && !coils[2]);
    assert_int_equal(serves(server, peer,
                            [](modbus_t *p) {
                                int count = modbus_read_registers(p, 6, 3, words);
                                return count < 0 ? errno : count;
                            }),
                     EMBXILADD);
    assert_int_equal(server.connections(), 1);
    close_client(peer);
    AWAIT((server.poll(), server.connections() == 0));
}

TEST_ROW(libmodbus_reads_and_writes_over_ethernet, each_function_is_served<EthernetServer>())
TEST_ROW(libmodbus_reads_and_writes_over_wifi, each_function_is_served<WiFiServer>())
TEST_ROW(a_library_without_accept_serves_too, each_function_is_served<OlderServer>())

static int read_first(modbus_t *peer)
{
    return modbus_read_registers(peer, 0, 1, words) == 1 ? words[0] : -1;
}

template <typename Listener> static void four_at_once()
{
    Listener listener(502);
    ModbusTcpServer<Listener, 4> server;
    ModbusRegisterArray<1> holding;
    modbus_t *peers[4];
    listener.begin();
    server.holdingRegisters(holding);
    server.begin(1, listener);
    for (modbus_t *&peer : peers)
        peer = connect_client(502);
    for (uint16_t round = 0; round < 3; round++)
        for (modbus_t *peer : peers) {
            holding[0] = static_cast<uint16_t>(100 + round);
            assert_int_equal(serves(server, peer, read_first), 100 + round);
        }
    assert_int_equal(server.connections(), 4);
    for (modbus_t *peer : peers)
        close_client(peer);
    AWAIT((server.poll(), server.connections() == 0));
}

TEST(four_clients_are_served_at_once)
{
    four_at_once<EthernetServer>();
    four_at_once<WiFiServer>();
    four_at_once<OlderServer>();
}

TEST(a_connection_without_a_free_place_is_closed)
{
    EthernetServer listener(502);
    ModbusTcpServer<EthernetServer, 1> server;
    ModbusRegisterArray<1> holding;
    listener.begin();
    server.holdingRegisters(holding);
    server.begin(1, listener);
    holding[0] = 5;
    modbus_t *first = connect_client(502);
    assert_int_equal(serves(server, first, read_first), 5);
    modbus_t *second = connect_client(502);
    assert_int_equal(serves(server, second, read_first), -1);
    assert_int_equal(serves(server, first, read_first), 5);
    close_client(second);
    close_client(first);
    AWAIT((server.poll(), server.connections() == 0));
    // The place of the closed connection is free.
    modbus_t *third = connect_client(502);
    assert_int_equal(serves(server, third, read_first), 5);
    close_client(third);
}

TEST(the_connection_that_was_idle_for_longest_is_closed_for_a_new_one)
{
    EthernetServer listener(502);
    ModbusTcpServer<EthernetServer, 2> server;
    ModbusRegisterArray<1> holding;
    listener.begin();
    server.holdingRegisters(holding);
    server.begin(1, listener);
    board().realTime = false; // the test sets the clock
    board().tick = 0;
    modbus_t *busy = connect_client(502), *idle = connect_client(502);
    assert_int_equal(serves(server, busy, read_first), 0);
    assert_int_equal(serves(server, idle, read_first), 0);
    board().now += 40000000u;
    assert_int_equal(serves(server, busy, read_first), 0);
    board().now += 25000000u; // 65 s after `idle`, 25 s after `busy`
    modbus_t *newcomer = connect_client(502);
    assert_int_equal(serves(server, newcomer, read_first), 0);
    assert_int_equal(server.connections(), 2);
    assert_int_equal(serves(server, idle, read_first), -1);
    assert_int_equal(serves(server, busy, read_first), 0);
    close_client(idle);
    close_client(busy);
    close_client(newcomer);
}

TEST(a_connection_with_bytes_that_are_no_modbus_is_closed)
{
    EthernetServer listener(502);
    ModbusTcpServer<EthernetServer> server;
    ModbusRegisterArray<1> holding;
    EthernetClient browser;
    listener.begin();
    server.holdingRegisters(holding);
    server.begin(1, listener);
    assert_int_equal(browser.connect("server", 502), 1);
    const char request[] = "GET / HTTP/1.1\r\n\r\n";
    browser.write(reinterpret_cast<const uint8_t *>(request), sizeof request - 1);
    AWAIT((server.poll(), !browser.connected()));
    assert_int_equal(server.connections(), 0);
}

TEST(requests_reach_the_unit_they_address)
{
    EthernetServer listener(502);
    ModbusTcpServer<EthernetServer> server;
    ModbusUnit units[2] = {{1}, {2}};
    ModbusRegisterArray<1> first, second;
    listener.begin();
    units[0].holdingRegisters(first);
    units[1].holdingRegisters(second);
    first[0] = 11;
    second[0] = 22;
    OK(server.begin(units, listener));
    modbus_t *peer = connect_client(502, 2);
    assert_int_equal(serves(server, peer, read_first), 22);
    modbus_set_slave(peer, 255);
    assert_int_equal(serves(server, peer, read_first), 11);
    close_client(peer);
}

static ModbusTcpServer<EthernetServer> *polled;
static EthernetServer *again;

TEST(a_hook_cannot_poll_or_begin_its_server)
{
    EthernetServer listener(502);
    ModbusTcpServer<EthernetServer> server;
    ModbusRegisterArray<1> holding;
    polled = &server;
    again = &listener;
    listener.begin();
    ModbusHooks hooks;
    holding.setHooks(hooks);
    hooks.afterWrite([](const mbm_access &) {
        IS(MBM_BUSY, polled->poll());
        IS(MBM_BUSY, polled->begin(9, *again));
    });
    server.holdingRegisters(holding);
    server.begin(1, listener);
    modbus_t *peer = connect_client(502);
    assert_int_equal(
        serves(server, peer, [](modbus_t *p) { return modbus_write_register(p, 0, 8); }), 1);
    assert_int_equal(holding[0], 8);
    assert_int_equal(server.getUnitID(), 1);
    // begin closes the connections.
    OK(server.begin(3, listener));
    assert_int_equal(server.connections(), 0);
    assert_int_equal(serves(server, peer, read_first), -1);
    close_client(peer);
}

TEST(a_connection_that_takes_few_bytes_gets_the_whole_response)
{
    static const size_t few = 7;
    class NarrowServer : public SocketServer {
    public:
        explicit NarrowServer(uint16_t port) : SocketServer(port) {}
        EthernetClient accept()
        {
            int fd = acceptFd();
            EthernetClient link = fd >= 0 ? EthernetClient(fd) : EthernetClient();
            link.writeSpace = few;
            return link;
        }
        EthernetClient available() { return accept(); }
    } listener(502);
    ModbusTcpServer<NarrowServer> server;
    ModbusRegisterArray<100> holding;
    static uint16_t all[100];
    listener.begin();
    server.holdingRegisters(holding);
    server.begin(1, listener);
    holding[99] = 0x1234;
    modbus_t *peer = connect_client(502);
    assert_int_equal(
        serves(server, peer, [](modbus_t *p) { return modbus_read_registers(p, 0, 100, all); }),
        100);
    assert_int_equal(all[99], 0x1234);
    close_client(peer);
}
