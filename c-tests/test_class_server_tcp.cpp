/* The class of a TCP server, over the shim's Ethernet and WiFi libraries, asked by real
 * libmodbus clients from threads of their own. */
#include "wire.h"

#include "ModbusTcpServer.h"
#include <ESP8266WiFi.h>
#include <Ethernet.h>

extern "C" {
#include "await.h"
#include <modbus.h>
#include <pthread.h>
}

/* A library from before accept: available hands over any connection with bytes. */
class OlderServer : public SocketServer {
public:
    explicit OlderServer(uint16_t port) : SocketServer(port) {}
    EthernetClient available() { return speaking(known); }

private:
    std::vector<EthernetClient> known;
};

/* What a libmodbus client does in its thread, while the test polls the server. */
struct Task {
    modbus_t *peer;
    int (*work)(modbus_t *);
    int result;
    pthread_t thread;
    volatile int over;
};

static void *run(void *argument)
{
    Task *task = static_cast<Task *>(argument);
    task->result = task->work(task->peer);
    __atomic_store_n(&task->over, 1, __ATOMIC_SEQ_CST);
    return nullptr;
}

template <typename Server>
static int serves(Server &server, modbus_t *peer, int (*work)(modbus_t *))
{
    Task task = {peer, work, -2, pthread_t(), 0};
    assert_int_equal(pthread_create(&task.thread, nullptr, run, &task), 0);
    AWAIT((assert_int_equal(server.poll(), MBM_OK), __atomic_load_n(&task.over, __ATOMIC_SEQ_CST)));
    pthread_join(task.thread, nullptr);
    return task.result;
}

static modbus_t *client_of(uint16_t port, int unit = 255)
{
    modbus_t *peer = modbus_new_tcp("127.0.0.1", networkPort(port));
    modbus_set_slave(peer, unit);
    modbus_set_response_timeout(peer, PATIENCE_MS / 1000, 0);
    assert_int_equal(modbus_connect(peer), 0);
    return peer;
}

static void hang_up(modbus_t *peer)
{
    modbus_close(peer);
    modbus_free(peer);
}

static int real_time(void **state)
{
    reset_board(state);
    bench().realTime = true;
    return 0;
}

static uint16_t words[8];

template <typename Listener> static void each_function_is_served()
{
    Listener listener(502);
    ModbusTcpServer<Listener> server;
    ModbusRegisterArray<8> holding;
    ModbusBitArray<8> coils;
    assert_int_equal(server.poll(), MBM_NOT_INITIALISED);
    listener.begin();
    server.holdingRegisters(holding);
    server.maskAndReadWrite(holding);
    server.coils(coils);
    assert_int_equal(server.begin(7, listener), MBM_OK);
    assert_int_equal(server.getUnitID(), 7);
    holding[2] = 0xBEEF;
    coils.set(1, true);
    modbus_t *peer = client_of(502);
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
    hang_up(peer);
    AWAIT((server.poll(), server.connections() == 0));
}

static void libmodbus_reads_and_writes_over_ethernet(void **)
{
    each_function_is_served<EthernetServer>();
}

static void libmodbus_reads_and_writes_over_wifi(void **)
{
    each_function_is_served<WiFiServer>();
}

static void a_library_without_accept_serves_too(void **)
{
    each_function_is_served<OlderServer>();
}

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
        peer = client_of(502);
    for (uint16_t round = 0; round < 3; round++)
        for (modbus_t *peer : peers) {
            holding[0] = static_cast<uint16_t>(100 + round);
            assert_int_equal(serves(server, peer, read_first), 100 + round);
        }
    assert_int_equal(server.connections(), 4);
    for (modbus_t *peer : peers)
        hang_up(peer);
    AWAIT((server.poll(), server.connections() == 0));
}

static void four_clients_are_served_at_once(void **)
{
    four_at_once<EthernetServer>();
    four_at_once<WiFiServer>();
    four_at_once<OlderServer>();
}

static void a_client_without_a_place_is_hung_up_on(void **)
{
    EthernetServer listener(502);
    ModbusTcpServer<EthernetServer, 1> server;
    ModbusRegisterArray<1> holding;
    listener.begin();
    server.holdingRegisters(holding);
    server.begin(1, listener);
    holding[0] = 5;
    modbus_t *first = client_of(502);
    assert_int_equal(serves(server, first, read_first), 5);
    modbus_t *second = client_of(502);
    assert_int_equal(serves(server, second, read_first), -1);
    assert_int_equal(serves(server, first, read_first), 5);
    hang_up(second);
    hang_up(first);
    AWAIT((server.poll(), server.connections() == 0));
    // The place is free again.
    modbus_t *third = client_of(502);
    assert_int_equal(serves(server, third, read_first), 5);
    hang_up(third);
}

static void the_connection_that_was_idle_for_longest_gives_its_place_up(void **)
{
    EthernetServer listener(502);
    ModbusTcpServer<EthernetServer, 2> server;
    ModbusRegisterArray<1> holding;
    listener.begin();
    server.holdingRegisters(holding);
    server.begin(1, listener);
    bench().realTime = false; // a clock of the test's own
    bench().tick = 0;
    modbus_t *busy = client_of(502), *idle = client_of(502);
    assert_int_equal(serves(server, busy, read_first), 0);
    assert_int_equal(serves(server, idle, read_first), 0);
    bench().now += 40000000u;
    assert_int_equal(serves(server, busy, read_first), 0);
    bench().now += 25000000u; // 65 s after `idle`, 25 s after `busy`
    modbus_t *newcomer = client_of(502);
    assert_int_equal(serves(server, newcomer, read_first), 0);
    assert_int_equal(server.connections(), 2);
    assert_int_equal(serves(server, idle, read_first), -1);
    assert_int_equal(serves(server, busy, read_first), 0);
    hang_up(idle);
    hang_up(busy);
    hang_up(newcomer);
}

static void what_is_not_modbus_is_hung_up_on(void **)
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

static void several_units_are_told_apart(void **)
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
    assert_int_equal(server.begin(units, listener), MBM_OK);
    modbus_t *peer = client_of(502, 2);
    assert_int_equal(serves(server, peer, read_first), 22);
    modbus_set_slave(peer, 255);
    assert_int_equal(serves(server, peer, read_first), 11);
    hang_up(peer);
}

static ModbusTcpServer<EthernetServer> *polled;
static EthernetServer *again;

static void a_hook_cannot_poll_or_begin_its_server(void **)
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
        assert_int_equal(polled->poll(), MBM_BUSY);
        assert_int_equal(polled->begin(9, *again), MBM_BUSY);
    });
    server.holdingRegisters(holding);
    server.begin(1, listener);
    modbus_t *peer = client_of(502);
    assert_int_equal(
        serves(server, peer, [](modbus_t *p) { return modbus_write_register(p, 0, 8); }), 1);
    assert_int_equal(holding[0], 8);
    assert_int_equal(server.getUnitID(), 1);
    // Beginning again closes what there is.
    assert_int_equal(server.begin(3, listener), MBM_OK);
    assert_int_equal(server.connections(), 0);
    assert_int_equal(serves(server, peer, read_first), -1);
    hang_up(peer);
}

static void a_connection_that_takes_few_bytes_gets_the_whole_response(void **)
{
    static const size_t few = 7;
    class NarrowServer : public SocketServer {
    public:
        explicit NarrowServer(uint16_t port) : SocketServer(port) {}
        EthernetClient accept()
        {
            int fd = take();
            EthernetClient link = fd >= 0 ? EthernetClient(fd) : EthernetClient();
            link.room = few;
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
    modbus_t *peer = client_of(502);
    assert_int_equal(
        serves(server, peer, [](modbus_t *p) { return modbus_read_registers(p, 0, 100, all); }),
        100);
    assert_int_equal(all[99], 0x1234);
    hang_up(peer);
}

#define REAL(test) cmocka_unit_test_setup(test, real_time)

int main()
{
    const struct CMUnitTest tests[] = {
        REAL(libmodbus_reads_and_writes_over_ethernet),
        REAL(libmodbus_reads_and_writes_over_wifi),
        REAL(a_library_without_accept_serves_too),
        REAL(four_clients_are_served_at_once),
        REAL(a_client_without_a_place_is_hung_up_on),
        REAL(the_connection_that_was_idle_for_longest_gives_its_place_up),
        REAL(what_is_not_modbus_is_hung_up_on),
        REAL(several_units_are_told_apart),
        REAL(a_hook_cannot_poll_or_begin_its_server),
        REAL(a_connection_that_takes_few_bytes_gets_the_whole_response),
    };

    return cmocka_run_group_tests_name("class of a TCP server", tests, nullptr, nullptr);
}
