/* ModbusTcpClient over the shim's Ethernet library, with a real libmodbus server. */
#include "wire.h"

#include "ModbusClient.h"
#include <Ethernet.h>

extern "C" {
#include "await.h"
#include "server.h"
#include "tcp_peer.h"
#include "tcp_server.h"
}

static tcp_server peer;
static EthernetClient *ethernet;
static ModbusTcpClient *client;
static const IPAddress device(192, 168, 1, 20);

static void fresh()
{
    reset_board();
    board().realTime = true;
    tcp_server_start(&peer);
    networkPort(502) = peer.port;
    ethernet = new EthernetClient;
    client = new ModbusTcpClient;
    client->begin(*ethernet);
    client->setResponseTimeout(PATIENCE_MS);
}

static void gone()
{
    ethernet->stop();
    delete client;
    delete ethernet;
    tcp_server_stop(&peer);
}

fixture each_test = {fresh, gone};

/* Calls poll, as a sketch's loop does, until no request is pending. */
static void run_until_idle()
{
    AWAIT(client->poll() != MBM_PENDING);
}

TEST(reads_what_libmodbus_holds)
{
    ModbusRequestOf<125> request(255);
    OK(client->connect(device));
    assert_true(client->isConnected());
    IS(MBM_INVALID_ARGUMENT, client->setInFlight(17));
    OK(client->setInFlight(1));
    OK(client->wait((client->readHoldingRegisters(request, 3, 125), request)));
    for (uint16_t i = 0; i < 125; i++)
        assert_int_equal(request[i], server_pattern(3u + i));
    assert_int_equal(request.length(), 250);
    IS(MBM_PENDING, client->readCoils(request, 5, 2000));
    run_until_idle();
    for (uint16_t i = 0; i < 2000; i++)
        assert_int_equal(request.getBit(i), server_bit_pattern(5u + i));
    IS(MBM_PENDING, client->readDiscreteInputs(request, 7, 3));
    run_until_idle();
    assert_int_equal(request.getBit(0), !server_bit_pattern(7));
    IS(MBM_PENDING, client->readInputRegisters(request, 9, 1));
    run_until_idle();
    assert_int_equal(request[0], static_cast<uint16_t>(~server_pattern(9)));
}

TEST(writes_reach_libmodbus)
{
    ModbusRequestOf<4> request(255);
    client->connect("device");
    request.setFloat(0, 21.5f);
    request.setInt32(2, -3);
    OK(client->wait((client->writeMultipleRegisters(request, 40, 4), request)));
    assert_int_equal(peer.mapping->tab_registers[40], 0x41AC);
    assert_int_equal(peer.mapping->tab_registers[43], 0xFFFD);
    assert_int_equal(client->wait((client->writeSingleRegister(request, 50, 0xBEEF), request)), 0);
    assert_int_equal(peer.mapping->tab_registers[50], 0xBEEF);
    assert_int_equal(client->wait((client->maskWriteRegister(request, 50, 0xFF00, 0x12), request)),
                     0);
    assert_int_equal(peer.mapping->tab_registers[50], 0xBE12);
    OK(client->wait((client->writeSingleCoil(request, 30, true), request)));
    assert_int_equal(peer.mapping->tab_bits[30], 1);
    request[0] = 5;
    OK(client->wait((client->writeMultipleCoils(request, 60, 3), request)));
    assert_int_equal(peer.mapping->tab_bits[60], 1);
    assert_int_equal(peer.mapping->tab_bits[61], 0);
    assert_int_equal(peer.mapping->tab_bits[62], 1);
    request[0] = 0x7777;
    OK(client->wait((client->readWriteMultipleRegisters(request, 70, 1, 70, 1), request)));
    assert_int_equal(request[0], 0x7777);
    IS(MBM_ILLEGAL_DATA_ADDRESS,
       client->wait((client->readHoldingRegisters(request, 499, 2), request)));
}

TEST(many_requests_are_in_flight_at_once)
{
    ModbusRequestOf<1> a(255), b(255), c(255);
    unsigned sum = 0;
    OK(client->setInFlight(16));
    client->connect(device);
    a.onDone([&sum](ModbusRequest &reply) { sum += reply[0]; });
    b.onDone([&sum](ModbusRequest &reply) { sum += reply[0]; });
    c.onDone([&sum](ModbusRequest &reply) { sum += reply[0]; });
    client->readHoldingRegisters(a, 1, 1);
    client->readHoldingRegisters(b, 2, 1);
    client->readHoldingRegisters(c, 3, 1);
    assert_int_equal(client->pending(), 3);
    client->poll();
    assert_int_not_equal(a.wireTransaction(), b.wireTransaction());
    assert_int_not_equal(b.wireTransaction(), c.wireTransaction());
    run_until_idle();
    assert_int_equal(sum, server_pattern(1) + server_pattern(2) + server_pattern(3));
}

TEST(a_client_that_takes_few_bytes_gets_all_of_them)
{
    ModbusRequestOf<123> request(255);
    client->connect(device);
    ethernet->writeSpace = 5;
    for (uint16_t i = 0; i < 123; i++)
        request[i] = static_cast<uint16_t>(1000u + i);
    IS(MBM_PENDING, client->writeMultipleRegisters(request, 10, 123));
    run_until_idle();
    OK(request.status());
    assert_int_equal(peer.mapping->tab_registers[132], 1122);
}

TEST(without_a_connection_requests_end_at_once)
{
    ModbusTcpClient other;
    ModbusRequestOf<1> request(255);
    IS(MBM_NOT_INITIALISED, other.connect(device));
    assert_false(other.isConnected());
    assert_false(client->isConnected());
    client->readHoldingRegisters(request, 0, 1);
    run_until_idle();
    IS(MBM_LINK_LOST, request.status());
    uint16_t unusedPort;
    int reserved = tcp_reserve(&unusedPort);
    networkPort(502) = unusedPort;
    IS(MBM_LINK_LOST, client->connect(device));
    close(reserved);
}

TEST(a_lost_connection_can_be_made_again)
{
    ModbusRequestOf<1> request(255);
    client->connect(device);
    OK(client->wait((client->readHoldingRegisters(request, 8, 1), request)));
    tcp_server_stop(&peer);
    AWAIT(!client->isConnected());
    client->readHoldingRegisters(request, 8, 1);
    run_until_idle();
    IS(MBM_LINK_LOST, request.status());
    tcp_server_start(&peer);
    networkPort(502) = peer.port;
    request[0] = 0;
    IS(MBM_PENDING, client->readHoldingRegisters(request, 8, 1)); // stays in the queue
    OK(client->connect(device));
    run_until_idle();
    OK(request.status());
    assert_int_equal(request[0], server_pattern(8));
}

TEST(replies_in_any_order_find_their_requests)
{
    tcp_peer *faulty = tcp_peer_new();
    ModbusRequestOf<1> late(7), early(7);
    tcp_peer_fault(faulty, 1, FAULT_DELAY, 300);
    networkPort(502) = tcp_peer_start(faulty, 0);
    OK(client->setInFlight(16));
    client->connect(device);
    client->readHoldingRegisters(late, 11, 1);
    client->readHoldingRegisters(early, 12, 1);
    AWAIT((client->poll(), !early.pending()));
    OK(early.status());
    assert_true(late.pending());
    run_until_idle();
    OK(late.status());
    assert_int_equal(early[0], tcp_peer_word(12));
    assert_int_equal(late[0], tcp_peer_word(11));
    client->stop();
    tcp_peer_stop(faulty);
}

TEST(poll_never_waits_for_a_device)
{
    tcp_peer *faulty = tcp_peer_new();
    ModbusRequestOf<1> request(7);
    tcp_peer_fault(faulty, 1, FAULT_DELAY, 300);
    networkPort(502) = tcp_peer_start(faulty, 0);
    client->connect(device);
    client->readHoldingRegisters(request, 11, 1);
    unsigned polls = 0;
    while (client->poll() == MBM_PENDING)
        polls++;
    assert_true(polls > 10);
    OK(request.status());
    client->stop();
    tcp_peer_stop(faulty);
}

TEST(rtu_frames_are_sent_over_a_tcp_connection)
{
    uint16_t port;
    int listener = tcp_listenOnFree(&port);
    ModbusRequestOf<1> request(17);
    networkPort(4001) = port;
    OK(client->beginRtuOverTcp(*ethernet));
    client->setResponseTimeout(PATIENCE_MS);
    OK(client->connect(device, 4001));
    int converter = accept(listener, nullptr, nullptr);
    client->readHoldingRegisters(request, 107, 1);
    client->poll();
    Bytes expected = adu({17, 3, 0, 107, 0, 1}), reply = adu({17, 3, 2, 2, 43}), seen(8);
    assert_int_equal(recv(converter, seen.data(), 8, MSG_WAITALL), 8);
    assert_bytes(seen, expected);
    assert_int_equal(send(converter, reply.data(), reply.size(), 0), reply.size());
    run_until_idle();
    OK(request.status());
    assert_int_equal(request[0], 555);
    close(converter);
    close(listener);
}

TEST(begin_is_refused_while_a_request_is_pending)
{
    EthernetClient another;
    ModbusRequestOf<1> request(255);
    client->connect(device);
    client->readHoldingRegisters(request, 8, 1);
    IS(MBM_BUSY, client->begin(another));
    run_until_idle();
    OK(request.status());
    OK(client->begin(another));
    assert_false(client->isConnected());
}
