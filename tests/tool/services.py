"""What tests of `mbm gateway` and `mbm bridge` as services need: readers of their statistics and of what they tell systemd, a
broker and its clients."""

import json
import os
import re
import socket
import subprocess
import threading
import time

from peers import PATIENCE, Program, endings, run, wait


class Notified:
    """What a service tells systemd."""

    def __init__(self, folder):
        self.path = os.path.join(folder, "notify")
        self.env = {"NOTIFY_SOCKET": self.path}
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(self.path)
        self.socket.settimeout(PATIENCE)
        endings.append(self.socket.close)

    def expect(self, *beginnings):
        for beginning in beginnings:
            assert self.socket.recv(200).decode().startswith(beginning)


def http(port, request=b"GET /metrics HTTP/1.1\r\nHost: here\r\n\r\n"):
    """Returns the head and the body of a reply."""
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as connection:
        connection.sendall(request)
        data = b""
        while part := connection.recv(65536):
            data += part
    head, _, body = data.decode().partition("\r\n\r\n")
    return head, body


def metrics_port(service):
    return int(re.search(r"metrics are at port (\d+)", service.await_line("metrics are at port"))[1])


HELP = re.compile(r"# HELP (mbm_[a-z_]+) .+\.")
TYPE = re.compile(r"# TYPE (mbm_[a-z_]+) (counter|gauge)")
SAMPLE = re.compile(r'(mbm_[a-z_]+)(?:\{line="((?:[^"\\\n]|\\["\\n])*)"\})? (\d+)')


def metrics(service):
    """Reads the text format strictly: each name has its help and its type, then all its samples; a counter's ends
    with _total, and no sample is there twice. Returns the numbers, by name and line."""
    head, body = http(metrics_port(service))
    assert head.startswith("HTTP/1.0 200 OK\r\n") and "Content-Type: text/plain; version=0.0.4" in head
    assert f"Content-Length: {len(body.encode())}\r\n" in head and body.endswith("\n")
    found, name = {}, None
    lines = iter(body.splitlines())
    for line in lines:
        if match := HELP.fullmatch(line):
            name, kind = match[1], TYPE.fullmatch(next(lines))
            assert kind and kind[1] == name and (kind[2] == "counter") == name.endswith("_total"), line
            assert not any(one == name for one, _ in found)
            continue
        match = SAMPLE.fullmatch(line)
        assert match and match[1] == name and (name, match[2]) not in found, line
        found[name, match[2]] = int(match[3])
    return found


class Broker:
    """A mosquitto broker, which can go, come back and stop to read."""

    def __init__(self, folder, *lines, anonymous="true"):
        with socket.create_server(("127.0.0.1", 0)) as one:
            self.port = one.getsockname()[1]
        self.place, self.client = f"127.0.0.1:{self.port}", ("-p", self.port)
        self.file = f"{folder}/mosquitto-{self.port}.conf"
        with open(self.file, "w") as file:
            file.write("\n".join([f"listener {self.port} 127.0.0.1", f"allow_anonymous {anonymous}", "user root", *lines, ""]))

    def come(self):
        self.program = Program("mosquitto", "-c", self.file)
        self.program.is_ours = False

        def listens():
            try:
                socket.create_connection(("127.0.0.1", self.port)).close()
                return True
            except ConnectionRefusedError:
                return False

        assert wait(listens)
        return self

    def go(self):
        self.program.close()

    def publish(self, topic, payload, *options):
        command = ["mosquitto_pub", *map(str, self.client), "-t", topic, "-s" if payload else "-n", *options]
        subprocess.run(command, input=payload if isinstance(payload, bytes) else payload.encode(), check=True)

    def retained(self):
        """What the broker keeps: the payload of each topic."""
        self.publish("end", "end", "-r")
        found = run("mosquitto_sub", *self.client, "-t", "#", "-F", "%t\t%p", "--retained-only", "-W", "1")
        return dict(line.split("\t", 1) for line in found.out.splitlines())


class Subscriber:
    """Keeps all messages, and writes to fields of a bridge."""

    def __init__(self, broker):
        self.broker, self.last, self.messages = broker, {}, []
        self.program = Program("mosquitto_sub", *broker.client, "-t", "#", "-F", "%t\t%p")
        self.program.is_ours = False
        threading.Thread(target=self.read, daemon=True).start()
        # What is not retained arrives only after the subscription has begun.
        while "probe" not in self.last:
            broker.publish("probe", "1")
            time.sleep(0.02)

    def read(self):
        at = 0
        while self.program.process.returncode is None:
            for line in self.program.output[at:]:
                at += 1
                topic, payload = line.split("\t", 1)
                self.messages.append((topic, payload))
                self.last[topic] = payload
            time.sleep(0.01)

    def of(self, topic):
        return [text for name, text in list(self.messages) if name == topic]

    def value(self, topic):
        try:
            return json.loads(self.last[topic])["value"]
        except (KeyError, ValueError, TypeError):
            return None

    def expect_value(self, topic, value):
        def is_there():
            found = self.value(topic)
            return found == value or type(found) is type(value) is float and abs(found - value) < 1e-6 * abs(value)

        assert wait(is_there), (topic, value, self.last.get(topic))

    def expect_last(self, topic, payload):
        assert wait(lambda: self.last.get(topic) == payload), (topic, payload, self.last.get(topic))

    def expect_result(self, topic, payload, pattern):
        """Writes, and expects a result. Repeats a write to which the device did not reply in time: the machine may be busy."""
        for _ in range(5):
            count = len(self.of(f"{topic}/result"))
            self.broker.publish(f"{topic}/set", payload)
            found = wait(lambda: self.of(f"{topic}/result")[count:])
            if found != ["no complete reply in time"]:
                break
        assert found and re.fullmatch(pattern, found[0]), (topic, payload, pattern, found)
