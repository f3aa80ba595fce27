"""What mbm prints with --trace is what tshark reads in its --pcap files. Each frame is in both, with the same time, link,
direction and bytes, and tshark reads the same unit, function, addresses, values, exception and transaction from it that mbm
prints in words."""

import re
import signal

import pytest
from peers import EXCEPTION, SYSTEM, WRONG, ROOT, SerialDevice, TcpDevice, Wire, demonstration, pymodbus, run, sealed

FIELDS = """frame.time_epoch frame.p2p_dir frame.interface_name frame.comment _ws.col.Protocol
    tcp.dstport exported_pdu.dst_port tcp.payload exported_pdu.exported_pdu mbrtu.unit_id
    mbtcp.unit_id mbtcp.trans_id mbrtu.crc16.status modbus.func_code modbus.reference_num
    modbus.read_reference_num modbus.write_reference_num modbus.word_cnt modbus.bit_cnt
    modbus.read_word_cnt modbus.write_word_cnt modbus.regnum16 modbus.regval_uint16 modbus.bitnum
    modbus.bitval modbus.exception_code modbus.data modbus.and_mask modbus.or_mask
    ip.checksum.status tcp.checksum.status tcp.analysis.flags _ws.malformed""".split()
LINE = re.compile(r"(\d\d:\d\d:\d\d\.\d{6})  (.*?)  (sent|received) +(.*) \[([0-9A-F ]+)\]")
WORDS = re.compile(
    r"unit (\d+) +(request|reply|exception|unpaired) +([0-9A-F]{2}) ([^:]*?)(?:  ([^:]*))?(?:: (.*))?"
)
BITS = (1, 2)


def extent(first, count):
    return str(first) if count == 1 else f"{first}..{first + count - 1}"


def numbers(text):
    return [int(number, 0) for number in text.split(",")] if text else []


def words_of(text):
    """A string of hexadecimal words as mbm prints them."""
    return " ".join(str(int(text[at : at + 4], 16)) for at in range(0, len(text), 4))


def bits_of(text, count):
    """A string of hexadecimal bytes as `count` bits, the lowest of each byte first."""
    data = bytes.fromhex(text)
    return " ".join(f"{byte:08b}"[::-1] for byte in data)[: count + (count - 1) // 8]


def read_by_tshark(field, sniffed):
    """The unit, kind, function, addresses and values in the words of mbm."""
    unit = int(field["mbrtu.unit_id"] or field["mbtcp.unit_id"])
    port = field["tcp.dstport"] or field["exported_pdu.dst_port"]
    is_request = port in ("502", "503")
    code = int(field["modbus.func_code"])
    if field["modbus.exception_code"]:
        what = f"exception {int(field['modbus.exception_code']):02X}"
        return unit, "exception", code, None, what
    where = what = None
    reference = field["modbus.reference_num"]
    count = int(field["modbus.bit_cnt"] or field["modbus.word_cnt"] or 0)
    data = field["modbus.data"]
    if code in (1, 2, 3, 4) and is_request:
        where = extent(int(reference), count)
    elif code in BITS:
        what = "".join("1" if bit in ("1", "True") else "0" for bit in field["modbus.bitval"].split(","))
        places = numbers(field["modbus.bitnum"])
        where = extent(places[0], len(places)) if sniffed else None
    elif code in (3, 4):
        what = field["modbus.regval_uint16"].replace(",", " ")
        places = numbers(field["modbus.regnum16"])
        where = extent(places[0], len(places)) if sniffed else None
    elif code == 5:
        where, what = reference, "on" if data == "ff00" else "off"
    elif code == 6:
        where, what = reference, words_of(data)
    elif code == 15:
        where, what = extent(int(reference), count), bits_of(data, count) if is_request else None
    elif code == 16:
        where = extent(int(reference), count)
        what = field["modbus.regval_uint16"].replace(",", " ") if is_request else None
    elif code == 22:
        masks = [int(field[f"modbus.{name}_mask"], 16) for name in ("and", "or")]
        where, what = reference, "and {:04X} or {:04X}".format(*masks)
    elif code == 23 and is_request:
        read = extent(int(field["modbus.read_reference_num"]), int(field["modbus.read_word_cnt"]))
        write = extent(int(field["modbus.write_reference_num"]), int(field["modbus.write_word_cnt"]))
        where, what = f"read {read}, write {write}", words_of(data)
    elif code == 23:
        what = words_of(data)
    elif code >= 65:
        what = " ".join(re.findall("..", data.upper()))
    else:
        raise AssertionError(f"no rule for function {code:02X}")
    return unit, "request" if is_request else "reply", code, where, what


def read_by_mbm(words):
    match = WORDS.fullmatch(words)
    if not match:
        return words
    unit, kind, code, _, where, what = match.groups()
    code = int(code, 16)
    if kind == "exception":
        what = what[: len("exception 00")]
    elif code in BITS and kind == "reply":
        what = what.replace(" ", "")
    return int(unit), kind, code, where, what


def differences(line, field, ascii_line=False, sniffed=False, seen=None):
    """What tshark found in a packet, and what mbm printed in a line of --trace. Adds to `seen` what kind of frame it is."""
    time, link, direction, words, text = line
    epoch = field["frame.time_epoch"]
    seconds = int(epoch.split(".")[0]) % 86400
    clock = f"{seconds // 3600:02}:{seconds // 60 % 60:02}:{seconds % 60:02}.{epoch.split('.')[1][:6]}"
    found = [clock, field["frame.interface_name"], "sent" if field["frame.p2p_dir"] == "0" else "received"]
    wanted = [time, link, direction]
    data = text.replace(" ", "").lower()
    if not ascii_line:
        found.append((field["tcp.payload"] or field["exported_pdu.exported_pdu"]).replace(":", ""))
        wanted.append(data)
    protocol = field["_ws.col.Protocol"]
    # 1: the checksum is right. No sequence number is missing, and no packet is malformed.
    found += [field[name] for name in FIELDS[-4:]]
    wanted += ["1", "1", "", ""] if protocol == "Modbus/TCP" else [""] * 4
    if field["frame.comment"]:
        comment = field["frame.comment"]
        if not sniffed:
            wanted.append(f"{comment}, {len(data) // 2} bytes")
            found.append(words)
        kind = (protocol, comment)
    else:
        by_tshark, by_mbm = read_by_tshark(field, sniffed), read_by_mbm(words)
        if by_mbm[1] == "unpaired":
            # tshark takes an earlier request for that of the reply.
            by_tshark = (by_tshark[0], "unpaired", by_tshark[2], None, by_tshark[4])
        if by_tshark[2] in BITS and by_tshark[1] == "reply" and len(by_mbm) == 5:
            # mbm prints the bits that fill the last byte too, unless it knows the request.
            by_mbm = (*by_mbm[:4], by_mbm[4][: len(by_tshark[4])])
        # 1: tshark has verified the CRC.
        found += [by_tshark, int(field["mbtcp.trans_id"]) if protocol == "Modbus/TCP" else field["mbrtu.crc16.status"]]
        wanted += [by_mbm, int(data[:4], 16) if protocol == "Modbus/TCP" else "1"]
        kind = (protocol, by_tshark[1], by_tshark[2])
    if seen is not None:
        seen.add(kind)
    return found, wanted


def compare(trace, path, least, ascii_line=False, sniffed=False, faults=()):
    """Compares the lines of --trace with the packets of a --pcap file. Returns the kinds of frames."""
    options = [word for option in ("mbrtu.tcp.port:503", "mbrtu.crc_verification:TRUE", "ip.check_checksum:TRUE", "tcp.check_checksum:TRUE")
               for word in ("-o", option)]
    done = run("tshark", *options, "-r", path, "-T", "fields", "-E", "separator=|", *(part for name in FIELDS for part in ("-e", name)))
    assert done.code == 0, done.error
    packets, seen = done.out.splitlines(), set()
    lines = [match.groups() for match in map(LINE.fullmatch, trace.splitlines()) if match]
    assert len(packets) == len(lines) >= least, trace
    assert sniffed or [words.split(",")[0] for _, _, _, words, _ in lines if not words.startswith("unit")] == list(faults)
    for line, packet in zip(lines, packets):
        found, wanted = differences(line, dict(zip(FIELDS, packet.split("|"))), ascii_line, sniffed, seen)
        assert found == wanted, line
    return seen


@pytest.fixture
def traced(plain, folder):
    def traced(command, words, least, code=0, text="", **kind):
        """Runs a command. Returns the kinds of its frames."""
        path = f"{folder}/frames.pcapng"
        found = plain(command, *words, "--trace", "--pcap", path, text=text)
        assert found.code == code, found.error
        return compare(found.error, path, least, **kind)

    return traced


def reads(traced, place, rounds=2, **kind):
    """Reads registers, and an address that is not there."""
    unit = [place, "--unit", 17]
    return traced("read", [*unit, "--every", "100ms", "--times", rounds, 100, 3], 2 * rounds, **kind) | traced(
        "read", [*unit, 60000], 2, code=EXCEPTION, **kind)


def test_tshark_reads_each_function_in_rtu_as_mbm_does(traced, libmodbus):
    place, seen = libmodbus.rtu, set()
    for words, _, code in demonstration():
        command, *more = words.split()
        seen |= traced(command, [place, "--unit", 17, *more], 1, code=code)
    seen |= reads(traced, place)
    seen |= traced("read", [place, "--unit", 17, "--table", "coils", 30, 9], 2)
    seen |= traced("read", [place, "--unit", 17, "--table", "input", "--every", "20ms", "--times", 2, 8, 2], 4)
    seen |= traced("scan", [place, "--timeout", "300ms", "--units", "14-20"], 8)
    assert {("Modbus RTU", kind, code) for kind in ("request", "reply") for code in (1, 2, 3, 4, 5, 6, 15, 16, 22, 23)} <= seen
    assert ("Modbus RTU", "exception", 3) in seen


def test_tshark_reads_modbus_tcp_as_mbm_does(traced, libmodbus):
    place = libmodbus.tcp
    seen = reads(traced, place)
    seen |= traced("read", [place, "--unit", 17, "--table", "coils", 30, 9], 2)
    seen |= traced("read", [place, "--unit", 17, "--table", "input", "--every", "20ms", "--times", 2, 8, 2], 4)
    seen |= traced("scan", [place, "--units", "1-40"], 80)
    # Functions of a user.
    for pdu in ("41 05", "42 01 02 03"):
        seen |= traced("call", [TcpDevice(lambda pdu: pdu).line, pdu], 2)
    assert {("Modbus/TCP", kind, code) for kind in ("request", "reply") for code in (1, 3, 4, 65, 66)} <= seen
    assert ("Modbus/TCP", "exception", 3) in seen


def test_a_gateway_has_the_frames_of_its_clients_and_of_its_lines_in_one_file(plain, traced, libmodbus, folder):
    path = f"{folder}/gateway.pcapng"
    gateway = plain.begin("gateway", "--trace", "--pcap", path, "tcp://127.0.0.1:0", libmodbus.rtu, "17-18")
    place = f"tcp://127.0.0.1:{gateway.last_word()}"
    reads(traced, place)
    # A unit does not answer.
    traced("scan", [place, "--timeout", "5s", "--units", "17-19"], 6)
    compare(gateway.end(signal.SIGINT).error, path, 6 + 6 + 6 + 3)


def test_noise_damaged_replies_parts_and_silence_have_comments(traced, folder):
    def answer(request):
        reply = sealed(bytes([request[0], 3, 2, 0, request[0]]))
        return {1: b"\0xyz" + reply, 2: reply[:-1] + bytes([reply[-1] ^ 1]), 3: reply[:4], 4: b""}[request[0]]

    seen = traced("scan", [SerialDevice(folder, answer).line, "--timeout", "1s", "--units", "1-4"], 8,
                  faults=["no frame", "bad CRC", "incomplete frame"])
    assert {("Modbus RTU", "bad CRC"), ("", "incomplete frame"), ("", "no frame")} <= seen


def test_tshark_reads_frames_in_ascii_as_mbm_does(traced):
    theirs, ours = Wire().names
    pymodbus("ascii", "--tty", theirs)
    place = f"ascii:{ours}?baud=115200"
    reads(traced, place, rounds=1, ascii_line=True)
    traced("read", [place, "--unit", 17, "--table", "coils", 30, 9], 2, ascii_line=True)


def test_tshark_reads_rtu_over_tcp_as_mbm_does(traced):
    port, = pymodbus("rtu-over-tcp", "--port", "0").ready
    reads(traced, f"rtu+tcp://127.0.0.1:{port}", rounds=1)


def test_tshark_reads_a_recording_of_a_bus_as_mbm_does(traced):
    with open(f"{ROOT}/examples/recordings/bus.hex") as recording:
        traced("sniff", ["-", "--baud", 19200], 9, text=recording.read(), sniffed=True)


def test_a_pcap_file_that_cannot_be_written_is_refused(plain):
    plain.fails(WRONG, "requires an argument", "scan", "--pcap")
    plain.fails(SYSTEM, "/nowhere/file", "scan", "--pcap", "/nowhere/file", "tcp://127.0.0.1")


@pytest.mark.parametrize("at, one, other", [
    (0, "", ""), (0, "02", "03"), (1, "bus", "sub"), (2, "sent", "received"), (3, "17", "18"), (3, "03", "04"), (3, "request", "reply"),
    (3, "107", "106"), (3, "109", "110"), (4, "76", "77")])
def test_the_comparison_sees_a_difference_in_each_part_of_a_line(at, one, other):
    line = ("00:00:01.000002", "bus", "sent", "unit 17  request    03 read holding registers  107..109", "11 03 00 6B 00 03 76 87")
    field = {**dict.fromkeys(FIELDS, ""),
             "frame.time_epoch": "1.000002000", "frame.p2p_dir": "0", "frame.interface_name": "bus",
             "exported_pdu.exported_pdu": "1103006b00037687", "exported_pdu.dst_port": "503", "mbrtu.unit_id": "17", "mbrtu.crc16.status": "1",
             "modbus.func_code": "3", "modbus.reference_num": "107", "modbus.word_cnt": "3", "_ws.col.Protocol": "Modbus RTU"}
    planted = (*line[:at], line[at].replace(one, other), *line[at + 1:])
    found, wanted = differences(planted, field)
    assert (found == wanted) == (one == other)
