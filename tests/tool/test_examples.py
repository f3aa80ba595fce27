"""The demonstration of `make demo`, and the programs of examples/linux, with libmodbus and pymodbus on the other side."""

import os
import re
import resource
import signal
import socket
import ssl
import subprocess
import threading
import time

import peers
import pytest
from peers import (CERTIFICATES, NO_REPLY, PATIENCE, PLAIN, ROOT, Peer, Program, context, demonstration, keys, numbered, run, served,
                   ten_registers, tls_line, wait, word)

# --- the demonstration



def test_the_demonstration_shows_each_function(plain):
    _, path, _ = peers.libmodbus()
    for words, wanted, code in demonstration():
        command, *more = words.split()
        assert plain(command, f"rtu:{path}", "--unit", "17", *more)[:2] == (code, wanted), words


def test_a_plan_reads_ten_fields_by_five_requests_and_none_is_old(plain):
    _, path, _ = peers.libmodbus()
    rounds = 4
    found = plain("poll", f"rtu:{path}?parity=none", f"{ROOT}/examples/devices/energy-meter.yaml", "--gap", "16", "--timeout", "300ms",
                  "--rounds", rounds, "--show-plan")
    # A unit does not answer.
    assert (found.code, found.error.count("every")) == (NO_REPLY, 5)
    assert "mbm poll: unit 18 did not answer within 300ms. Check" in found.error
    last = found.out.split(f"round {rounds}")[-1]
    power = word(6) << 16 | word(7)
    for name, value in {"voltage 1": word(0) / 10, "voltage 3": word(2) / 10, "power": (power - (power >> 31 << 32)) / 1000,
                        "energy in": word(21) << 16 | word(20)}.items():
        row = re.search(rf"{name} .*?(-?[0-9.]+) k?[VW]h? +(\d+)ms +success", last)
        assert row and abs(float(row[1]) - value) <= 1e-6 * max(1, abs(value)) and int(row[2]) <= 2600, name
    assert re.search(r"level +- .*no complete reply in time", last)


# --- keep_link

def test_keep_link_connects_again_to_a_server_that_goes_and_comes_back(device):
    program = Program(f"{PLAIN}/linux/keep_link", "127.0.0.1", device.port)
    program.is_ours = False
    at = 0

    def until(start):
        """The first line after the last one that begins with `start`."""
        nonlocal at
        found = program.await_output(f"^{start}", at)
        at = program.output.index(found, at) + 1
        return found

    assert [until("link"), until("register")] == ["link: connected", "register 0: 42"]
    device.go()
    assert [until("link").split(": ")[1], until("link").split(": ")[1]] == ["lost", "not connected"]
    device.come()
    assert [until("link: connected"), until("register")] == ["link: connected", "register 0: 42"]


# --- many_devices

SERVERS, EVERY_S = 6, 4
DEVICES, SECONDS = int(os.environ.get("DEVICES") or 1000), float(os.environ.get("MANY_SECONDS") or 20)


class Devices:
    """What many_devices prints, read in a thread. Each value is checked when it comes."""

    def __init__(self, program):
        self.lost, self.known, self.values, self.wrong, self.reasons = set(), set(), 0, [], set()
        self.lines = program.stdout
        threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        for line in self.lines:
            device, text = re.fullmatch(r"device (\d+): (.*)\n", line).groups()
            device = int(device)
            if text.startswith("lost: "):
                self.lost.add(device)
                self.reasons.add(text[6:])
            elif text == "back":
                self.lost.discard(device)
            else:
                # The register counts the time in steps of 4 s. Nothing takes longer than 6 s.
                now = time.time()
                steps = range(int((now - 6) / EVERY_S), int((now + 1) / EVERY_S) + 1)
                if int(text) not in ((word(device) + step) % 65536 for step in steps) or device in self.lost:
                    self.wrong.append(line.strip())
                self.known.add(device)
                self.values += 1

    def await_lost(self, lost):
        """Waits until just these devices are lost."""
        return wait(lambda: self.lost == lost and self.known | self.lost == set(range(DEVICES)))


def test_many_devices_are_polled_while_a_third_of_their_servers_goes_and_comes(record_property):
    """DEVICES (1000) in one process, for MANY_SECONDS (20)."""
    # The servers get at most 1000 connections each, and the program at first fewer descriptors than devices.
    soft, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(most, 1100), most))
    servers = [Peer(f"{PLAIN}/serve_many", "0") for _ in range(max(SERVERS, -(-DEVICES // 900)))]
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, most))
    ports, few = [server.ready[0] for server in servers], DEVICES - DEVICES // 10
    program = subprocess.Popen([f"{PLAIN}/linux/many_devices", str(DEVICES), "127.0.0.1", *ports], stdout=subprocess.PIPE, text=True,
                               preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (few, most)))
    peers.endings.append(program.kill)
    devices = Devices(program)
    # Standard input, output and errors and the loop take 4 descriptors, so as many more devices are lost.
    assert wait(lambda: len(devices.known | devices.lost) == DEVICES)
    assert (len(devices.lost), devices.reasons) == (DEVICES - few + 4, {os.strerror(24)})
    resource.prlimit(program.pid, resource.RLIMIT_NOFILE, (most, most))
    assert devices.await_lost(set())
    begun, rounds = time.monotonic(), 0
    third = range(0, len(servers), 3)
    of_third = {device for device in range(DEVICES) if device % len(servers) in third}
    while rounds == 0 or time.monotonic() - begun < SECONDS:
        rounds += 1
        for one in third:
            servers[one].close()
        assert devices.await_lost(of_third)
        time.sleep(1)
        for one in third:
            servers[one] = Peer(f"{PLAIN}/serve_many", ports[one])
        assert devices.await_lost(set())
    assert devices.wrong == []
    assert program.poll() is None
    with open(f"/proc/{program.pid}/stat", encoding="ascii") as stat, open(f"/proc/{program.pid}/status", encoding="ascii") as status:
        ticks = sum(map(int, stat.read().rsplit(")", 1)[1].split()[11:13]))
        memory = int(re.search(r"VmHWM:\s+(\d+) kB", status.read())[1])
    record_property("many_devices", f"{DEVICES} devices, {time.monotonic() - begun:.0f} s, {rounds} rounds in which {len(of_third)} were lost and "
                    f"came back: {devices.values} values; processor time {ticks / os.sysconf('SC_CLK_TCK'):.2f} s, memory {memory} kB")
    program.send_signal(signal.SIGTERM)
    program.wait(PATIENCE)


# --- udp

UDP_READ = "success\n" + "".join(f"register {100 + i}: {1000 + i}\n" for i in range(10))


def lossy_network(port, lose):
    """A network that loses the first datagrams of a client, and doubles the others. Returns its port."""
    ours, server = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    ours.bind(("127.0.0.1", 0))
    server.connect(("127.0.0.1", port))

    def pass_on():
        for number in range(100):
            data, client = ours.recvfrom(2000)
            if number < lose:
                continue
            for _ in range(2):
                server.send(data)
                reply = server.recv(2000)
                ours.sendto(reply, client)
                ours.sendto(reply, client)

    threading.Thread(target=pass_on, daemon=True).start()
    return ours.getsockname()[1]


def asked_over_udp(port):
    found = run(f"{PLAIN}/linux/udp", "ask", "127.0.0.1", port)
    return found.out + found.error


def test_a_client_over_udp_reads_though_requests_and_replies_get_lost_or_doubled():
    from pymodbus.client import ModbusUdpClient

    server = Program(f"{PLAIN}/linux/udp", "serve", "0")
    port = int(server.await_output().split()[1])
    assert asked_over_udp(port) == UDP_READ
    assert asked_over_udp(lossy_network(port, 3)) == UDP_READ
    client = ModbusUdpClient("127.0.0.1", port=port, timeout=20)
    client.connect()
    read = lambda first, count: client.read_holding_registers(first, count=count, device_id=17)
    assert read(100, 10).registers == [1000 + i for i in range(10)]
    assert not client.write_registers(109, [7], device_id=17).isError()
    assert read(109, 1).registers == [7]
    assert read(109, 2).exception_code == 2
    client.close()
    socket.socket(socket.AF_INET, socket.SOCK_DGRAM).sendto(b"not Modbus", ("127.0.0.1", port))
    assert asked_over_udp(port) == UDP_READ.replace("1009", "7")
    assert server.end(code=None).out.splitlines()[1:] == ["1 datagrams dropped"]


def test_a_client_over_udp_reads_a_server_of_pymodbus():
    from pymodbus.server import ModbusUdpServer

    assert asked_over_udp(served(lambda: ModbusUdpServer(ten_registers(), address=("127.0.0.1", 0)))) == UDP_READ


# --- secure_server

NOT_ALLOWED = "unit 17: exception 01: illegal function. The device does not have this function; values may be in another table.\n"


@pytest.fixture
def secure():
    """The port of secure_server: who may do what is in the roles of certificates."""
    server = Program(f"{PLAIN}/linux/secure_server", "0", *keys("server"), f"{CERTIFICATES}/authority.pem")
    server.is_ours = False
    return int(server.await_output().split()[1])


def reads_and_writes(mbm, port, name, host="localhost"):
    """What mbm prints of a read and of a write, without the place."""
    line = tls_line(port, name, f"&name={host}")
    found = [mbm(command, line, "--unit", "17", "--timeout", "15s", "100", more) for command, more in (("read", "3"), ("write", "2000"))]
    return [(one.out + one.error).replace(f"{line}: ", "") for one in found]


def values(first):
    return numbered(100, [first, 1001, 1002])


WROTE = "unit 17: wrote 1 holding register from address 100 on, function 06\n"


def refused(reason):
    return [f"mbm {command}: {reason}. docs/security.md says what to look at.\n" for command in ("read", "write")]


@pytest.mark.parametrize("name, host, wanted", [
    ("operator", "localhost", [values(1000), WROTE]),
    ("viewer", "localhost", [values(1000), f"mbm write: {NOT_ALLOWED}"]),
    ("norole", "localhost", [f"mbm read: {NOT_ALLOWED}", f"mbm write: {NOT_ALLOWED}"]),
    ("stranger", "localhost", refused("the peer refused the connection: unknown ca")),
    ("expired", "localhost", refused("the peer refused the connection: certificate expired")),
    ("operator", "pump.example", refused("the server's certificate is for another name")),
])
def test_the_role_of_a_certificate_says_what_mbm_may_do(plain, secure, name, host, wanted):
    assert reads_and_writes(plain, secure, name, host) == wanted


def answers(client, *calls):
    from pymodbus.exceptions import ModbusException

    found = []
    client.connect()
    for call in calls:
        try:
            reply = call()
            found.append(f"exception {reply.exception_code:02}" if reply.isError() else reply.registers)
        except ModbusException:
            found.append("no reply")
    client.close()
    return found


@pytest.mark.parametrize("name, wanted", [("operator", [[], [1000, 3001], []]), ("viewer", ["exception 01", [1000, 1001], "exception 01"]),
                                          ("stranger", ["no reply"] * 3)])
def test_the_role_of_a_certificate_says_what_pymodbus_may_do(secure, name, wanted):
    from pymodbus.client import ModbusTlsClient

    client = ModbusTlsClient("127.0.0.1", port=secure, sslctx=context(name, ssl.PROTOCOL_TLS_CLIENT), retries=0, timeout=20)
    assert answers(client, lambda: client.write_registers(101, [3001], device_id=17),
                   lambda: client.read_holding_registers(100, count=2, device_id=17),
                   lambda: client.write_registers(101, [1001], device_id=17)) == wanted


def test_a_client_without_tls_gets_no_reply(secure):
    from pymodbus.client import ModbusTcpClient

    client = ModbusTcpClient("127.0.0.1", port=secure, retries=0, timeout=20)
    assert answers(client, lambda: client.read_holding_registers(100, count=2, device_id=17)) == ["no reply"]
