"""mbm gateway between clients of pymodbus or raw ones, and devices of libmodbus and pymodbus, all of them unit 17 on their line."""

import asyncio
import re
import socket
import threading
import types

import pytest
from peers import (LINE, NO_ANSWER, NO_PATH, PATIENCE, READ, Client, Program, SerialDevice, Strace, Wire, between_sends, number, pymodbus,
                   tcp_frame, wait, word)

LISTEN, NOWHERE = "tcp://127.0.0.1:0", "rtu:/dev/null"


@pytest.fixture
def six(plain, libmodbus):
    """A gateway with six lines: libmodbus's server in RTU and TCP, and pymodbus's in RTU, ASCII, TCP and RTU over TCP."""
    rtu, ascii = Wire(), Wire()
    devices = {framing: pymodbus(framing, *place) for framing, place in (
        ("rtu", ("--tty", rtu.names[0])), ("ascii", ("--tty", ascii.names[0])), ("tcp", ("--port", "0")), ("rtu-over-tcp", ("--port", "0")))}
    gateway = plain.begin("gateway", "--timeout", "3s", LISTEN, libmodbus.rtu, "17",
                          f"rtu:{rtu.names[1]}?baud=115200&parity=none", "117=17,255=17,40", f"ascii:{ascii.names[1]}?baud=115200&parity=none", "217=17",
                          libmodbus.tcp, "57=17", f"tcp://localhost:{devices['tcp'].ready[0]}", "157-157=17",
                          f"rtu+tcp://127.0.0.1:{devices['rtu-over-tcp'].ready[0]}", "227=17")
    return types.SimpleNamespace(gateway=gateway, port=gateway.last_word(), rtu=rtu, devices=devices)


UNITS = [17, 117, 217, 57, 157, 227]


def read_of(address):
    return b"\3" + address.to_bytes(2, "big") + b"\0\1"


def holds(address):
    """The reply to `read_of`."""
    return number(word(address))


def test_four_clients_of_pymodbus_read_and_write_over_six_lines(six):
    from pymodbus.client import AsyncModbusTcpClient

    async def one(index):
        client = AsyncModbusTcpClient("127.0.0.1", port=int(six.port), timeout=PATIENCE)
        assert await client.connect()
        for round in range(5):
            for unit in (17, 117, 217, 255, 57, 157, 227):
                address = 100 + 10 * index + round
                reply = await client.read_holding_registers(address, count=3, device_id=unit)
                assert not reply.isError() and reply.registers == [word(address + i) for i in range(3)]
        address = 150 + index
        for unit in (117, 217, 57, 157, 227):
            await client.write_register(address, 0x1000 + index, device_id=unit)
            await client.write_registers(address + 10, [index, 7], device_id=unit)
            reply = await client.read_holding_registers(address, count=1, device_id=unit)
            assert reply.registers == [0x1000 + index]
            coils = await client.read_coils(30, count=9, device_id=unit)
            assert coils.bits[:9] == [bool(word(30 + i) >> 7 & 1) for i in range(9)]
        # The exception of a device passes, and a unit without a line gets 0A.
        assert (await client.read_holding_registers(60000, count=1, device_id=117)).exception_code == 2
        assert (await client.read_holding_registers(0, count=1, device_id=18)).exception_code == 10
        client.close()

    async def all_at_once():
        await asyncio.gather(*(one(index) for index in range(4)))

    asyncio.run(all_at_once())
    summary = six.gateway.end().error
    assert re.search(r": ascii:.*: requests: (\d+), replies: \1, exceptions: 0, timeouts: 0, bad CRCs: 0\.$", summary, re.M)


def test_each_of_many_requests_at_once_gets_its_response(six):
    """Twelve in one segment, to six lines; then two with the same transaction identifier."""
    client = Client(six.port)
    asked = {0x4000 + i: (unit, 200 + i) for i, unit in enumerate(UNITS * 2)}
    client.socket.sendall(b"".join(tcp_frame(t, unit, read_of(address)) for t, (unit, address) in asked.items()))
    answered = {transaction: (unit, pdu) for transaction, unit, pdu in (client.response() for _ in asked)}
    assert answered == {t: (unit, holds(address)) for t, (unit, address) in asked.items()}
    client.socket.sendall(tcp_frame(7, 117, read_of(1)) + tcp_frame(7, 117, read_of(2)))
    assert [client.response() for _ in range(2)] == [(7, 117, holds(1)), (7, 117, holds(2))]


def test_a_flood_of_one_client_does_not_starve_another(six):
    """One has 60 requests in its socket, and one sends eight at once. From then on the line takes their requests in turn."""
    flood, calm = Client(six.port), Client(six.port)
    flood.socket.sendall(b"".join(tcp_frame(i, 117, read_of(i)) for i in range(60)))
    flood.response()
    calm.socket.sendall(b"".join(tcp_frame(i, 117, read_of(500 + i)) for i in range(8)))
    for client, count, first in ((calm, 8, 500), (flood, 59, 0)):
        for transaction, unit, pdu in (client.response() for _ in range(count)):
            assert (unit, pdu) == (117, holds(first + transaction))
    # Each request has eight bytes in RTU.
    asked = [int.from_bytes(six.rtu.sent[1][i + 2 : i + 4], "big") for i in range(0, 68 * 8, 8)]
    places = [asked.index(500 + i) for i in range(8)]
    assert max(after - before - 1 for before, after in zip(places, places[1:])) <= 1


def test_a_client_that_disconnects_does_not_disturb_others(six):
    """Its request is on the line. The gateway discards the late reply."""
    hasty, client = Client(six.port), Client(six.port)
    hasty.send(117, read_of(700))
    hasty.socket.close()
    assert client.ask(117, read_of(800)) == holds(800)


def test_a_device_that_is_gone_gets_an_exception_until_it_is_back(six):
    client = Client(six.port)
    assert client.ask(227, read_of(3)) == holds(3)
    six.devices["rtu-over-tcp"].close()
    assert client.ask(227, read_of(0)) == NO_PATH
    pymodbus("rtu-over-tcp", "--port", six.devices["rtu-over-tcp"].ready[0])
    assert wait(lambda: (found := client.ask(227, read_of(3))) != NO_PATH and found) == holds(3)
    # Of a serial line only the device is gone, and the other lines go on.
    six.devices["rtu"].close()
    assert client.ask(117, read_of(0)) == NO_ANSWER
    assert client.ask(217, read_of(9)) == holds(9)


@pytest.mark.parametrize("options, places", [(["--connections", "40"], 40), ([], 16), (["-c", "200"], 40)], ids=["40", "default", "200"])
def test_of_forty_clients_as_many_are_served_as_there_are_places(plain, libmodbus, options, places):
    """The others are refused at once."""
    gateway = plain.begin("gateway", *options, "--timeout", "3s", LISTEN, libmodbus.tcp, "57=17")
    clients = [Client(gateway.last_word()) for _ in range(40)]

    def is_served(client):
        try:
            return client.ask(57, read_of(5)) == holds(5)
        except ConnectionError:
            return False

    assert [is_served(client) for client in clients].count(True) == places


def test_a_port_in_use_is_refused(plain):
    with socket.create_server(("127.0.0.1", 0)) as other:
        plain.fails(LINE, "Another program listens there", "gateway", f"tcp://127.0.0.1:{other.getsockname()[1]}", NOWHERE, "1-9")


def test_unit_0_of_a_device_over_tcp_answers_and_on_a_serial_line_it_stays_a_broadcast(plain, libmodbus):
    """pymodbus's server has unit 0 only. libmodbus's on the serial line carries broadcasts out."""
    from pymodbus.client import ModbusTcpClient

    device = pymodbus("tcp", "--port", "0", "--unit", 0).ready[0]
    gateway = plain.begin("gateway", LISTEN, libmodbus.rtu, "17,0=0", f"tcp://127.0.0.1:{device}", "5=0,1", f"rtu+tcp://127.0.0.1:{device}", "9")
    client, peer = Client(gateway.last_word()), ModbusTcpClient("127.0.0.1", port=int(gateway.last_word()), timeout=PATIENCE)
    assert peer.read_holding_registers(100, count=2, device_id=5).registers == [word(100), word(101)]
    assert not peer.write_register(100, 4321, device_id=5).isError()
    assert peer.read_holding_registers(100, count=1, device_id=5).registers == [4321]
    assert peer.read_holding_registers(60000, count=1, device_id=5).exception_code == 2
    peer.close()
    # The broadcast has no response, and 17 has its value when it answers.
    client.send(0, b"\6\0\xb4\x12\x34")
    assert client.ask(17, read_of(180)) == number(0x1234)
    assert client.ask(0, read_of(180)) == b"\x83\1"
    other = plain.begin("gateway", LISTEN, f"tcp://127.0.0.1:{device}", "0-9")
    client = Client(other.last_word())
    assert client.ask(0, read_of(7)) == holds(7)
    assert client.ask(0, b"\6\0\xb4\x12\x34") == b"\6\0\xb4\x12\x34"
    assert client.ask(0, read_of(180)) == number(0x1234)


# --- system calls

@pytest.fixture
def traced(plain, folder):
    """Begins a gateway whose system calls are counted."""
    strace = Strace(f"{folder}/calls")
    return strace, lambda *words: Program(*strace.before, plain.path, "gateway", "--timeout", "20s", LISTEN, *words)


@pytest.mark.parametrize("clients, each, others", [(1, 300, 0), (1, 300, 12), (10, 40, 0)])
def test_a_request_costs_few_system_calls_however_many_connections_and_lines_are_idle(traced, folder, record_property, clients, each, others):
    strace, begin = traced
    gateway = begin(SerialDevice(folder, name="asked").line, "7", SerialDevice(folder, name="idle").line, "8")
    peers = [Client(gateway.last_word()) for _ in range(clients + others)]
    assert [one.ask(7) for one in peers] == [number(7)] * len(peers)
    right = []
    threads = [threading.Thread(target=lambda one=one: right.extend(one.ask(7) == number(7) for _ in range(each))) for one in peers[:clients]]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert right == [True] * clients * each
    gateway.end()
    found, sent = between_sends(strace.calls(), clients * each)
    record_property(f"system calls of mbm gateway for a request, {clients} clients asking and {others} idle", f"{found:.2f}")
    assert sent == clients * each + len(peers) and found <= 8


def test_no_sleep_keeps_requests_waiting_that_have_arrived_at_once(traced):
    """More requests in one segment than the gateway takes from a connection in one poll."""
    strace, begin = traced
    gateway = begin("rtu:/dev/no-such-line", "1", "--requests", "128", "--log-level", "error")
    client = Client(gateway.last_word())
    client.socket.sendall(b"".join(tcp_frame(i, 9, READ) for i in range(100)))
    assert [client.take() for _ in range(100)] == [NO_PATH] * 100
    gateway.end()
    calls = strace.calls()
    sent = [at for at, call in enumerate(calls) if call.startswith("send")]
    assert not [call for call in calls[sent[0] : sent[-1]] if "(Timeout)" in call and "tv_sec=0, tv_nsec=0}" not in call]
