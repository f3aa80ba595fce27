"""What the command line of mbm refuses, and how it helps: --help, completion and man pages."""

import os
import re

import pytest
from peers import BUILD, DONE, ROOT, WRONG, run

PLACE = "tcp://127.0.0.1:1"
# Words, and a part of the sentence; before them an exit code other than WRONG. @LINE is a line without a server, @TTY a terminal,
# and these are files:
FILES = {
    "@FILE": "fields: [{name: a, table: holding, address: 0, type: uint16}]\n",
    "@BAD": "fields:\n  - name: a\n    table: input\n    address: 0\n    type: real\n",
    "@WRITTEN": "fields:\n  - {name: a, table: coils, address: 0, access: write}\n",
    "@GATEWAY": "listen: tcp://127.0.0.1:0\nlines: [{line: rtu:/dev/no-such-line, units: 1}]\n",
}
REFUSED = """
read @LINE|ADDRESS is missing
read|LINE is missing
read @LINE 0x10|ADDRESS "0x10" is not a whole decimal number, here from 0 to 65535
read @LINE 21,5|"21,5" is not a whole
read @LINE +5|"+5" is not a whole
read @LINE 5x|"5x" is not a whole
read @LINE 65536|ADDRESS "65536" is out of range: from 0 to 65535
read @LINE 99999999999999999999|is out of range
read @LINE 0 --one-based|ADDRESS "0" is out of range: from 1 to 65536
read @LINE 1 0|COUNT "0" is out of range
read @LINE 1 two|COUNT "two" is not a whole
read @LINE 65535 2|2 addresses from 65535 on end beyond the last address, 65535
read @LINE 65534 1 --type double|4 addresses from 65534 on end beyond
read @LINE 1 2 3|"3" is one word too many
read @LINE 1 --unit 256|--unit "256" is out of range
read @LINE 1 --unit=-1|--unit "-1" is not
read rtu:/dev/null 1 --unit 0|unit 0 is read in frames of Modbus TCP only
read @LINE 1 --unit 1,|--unit "" is not a whole
read @LINE 1 --unit 1-3,2|--unit: unit 2 is there twice
write rtu+tcp://127.0.0.1:1 1 1 --unit 0|--unit 0 means all units
call rtu+tcp://127.0.0.1:1 03 --unit 0|--unit 0 means all units
identify rtu:/dev/null --unit 0|--unit 0 means all units
read @LINE 1 --table coil|--table "coil" is not one of coils, discrete, holding and input
read @LINE 1 --type flaot|--type "flaot" is not one of the 38 words in docs/device-file.md: the nearest is float.
read @LINE 1 --order abcd|--order "abcd" is not one of ABCD, CDAB, BADC, DCBA, EFGHABCD,
read @LINE 1 --table coils --type uint16|the table coils has no values of type uint16
read @LINE 1 --type bit|the table holding has no values of type bit
read @LINE 1 --scale 0|--scale "0" is not a decimal number other than 0
read @LINE 1 --scale 0,1|--scale "0,1" is not
read @LINE 1 --scale 2 --type text|--scale needs a number
read @LINE 1 --hex --type float|--hex needs an integer type
read @LINE 1 --timeout 500|--timeout "500" is not a time: write a whole number and its unit, such as 500ms, 2s or 1m
read @LINE 1 --timeout 1.5s|is not a time
read @LINE 1 --timeout 0ms|is out of range: from 1ms to 1000s
read @LINE 1 --every 25h|is out of range
read @LINE 1 --retries 255|--retries "255" is out of range
read @LINE 1 --in-flight 17|--in-flight "17" is out of range
read @LINE 1 --times 3|--times needs --every
read @LINE 1 --csv --json|exclude each other
read @LINE 1 --tabel coils|unrecognized option '--tabel'
read @LINE 1 -z|invalid option -- 'z'
write @LINE|ADDRESS is missing
write @LINE 1|VALUE is missing
write @LINE 1 0x10|VALUE "0x10" is not a decimal number
write @LINE 1 21,5|VALUE "21,5" is not a decimal number
write @LINE 1 +5|VALUE "+5" is not a decimal number
write @LINE 1 5x|VALUE "5x" is not a decimal number
write @LINE 1 -1|VALUE "-1" is out of range of the type uint16
write @LINE 1 65536|VALUE "65536" is out of range of the type uint16
write @LINE 1 1.5|VALUE "1.5" is not a whole number
write @LINE 1 1.05 --scale 0.1|VALUE "1.05" is not a multiple of the scale
write @LINE 1 1e39 --type float|VALUE "1e39" is out of range of the type float
write @LINE 1 2 --table coils|VALUE "2" is no value of a coil: 1 is on, and 0 is off
write @LINE 1 on -t coils|VALUE "on" is no value of a coil: 1 is on, and 0 is off
read @LINE 465537|ADDRESS "465537" is out of range: from 0 to 65535
write @LINE 300101 5|is the input register with address 100, which cannot be written.
write @LINE 1 10000 --hex|VALUE "10000" is out of range of the type uint16
write @LINE 1 xyz --hex|VALUE "xyz" is not a hexadecimal number
write @LINE 1 1 --table input|the table input cannot be written
write @LINE 65535 1 2|2 addresses from 65535 on end beyond
call @LINE|HEX is missing
call @LINE 0|HEX "0" is not hexadecimal bytes
call @LINE 0x03|HEX "0x03" is not hexadecimal bytes
call @LINE 83 00|HEX begins with 83: a function code is 01 to 7F
scan|LINE is missing
scan @LINE more|"more" is one word too many
scan rtu:/dev/null --units 0|unit 0 is read in frames of Modbus TCP only
scan @LINE --units 5-3|--units "3" is out of range: from 5 to 255
scan @LINE --units 1,|--units "" is not
scan @LINE --units 1-3,2|unit 2 is there twice
scan @LINE --rates 9600|--rates and --parities need a serial line
scan rtu:/dev/null --rates many|--rates "many" is not
scan rtu:/dev/null --parities E|--parities "E" is not one of none, even and odd
identify @LINE --category all|--category "all" is not one of basic, regular and extended
identify @LINE 17|"17" is one word too many
read nothing 1|"nothing" is not a line: it begins with rtu:, ascii:, tcp://
read tcp:127.0.0.1,502 1|is not a line
read tcp:// 1|the host is missing
read tcp://127.0.0.1:0 1|the port "0" is out of range
read tcp://127.0.0.1:70000 1|the port "70000" is out of range
read tcp://127.0.0.1:no 1|the port "no" is not a whole decimal number
read tcp://127.0.0.1,502 1|is not a host
read tcp://::1 1|an IPv6 address needs brackets
read tcp://[::1 1|the bracket after the address is missing
read tcp://[::1]502 1|after the address is not :PORT
read tcp://127.0.0.1?unit=1 1|the key "unit" is unknown: tcp:// has accept, lenient, delay
read rtu+tcp://127.0.0.1 1|the port is missing
read rtu: 1|the path of the terminal is missing
3 read rtu:/dev/null? 1|
read rtu:/dev/null?baud 1|"baud" is not KEY=VALUE
read rtu:/dev/null?baud= 1|is not KEY=VALUE
read rtu:/dev/null?baud=fast 1|baud: "fast" is not a whole decimal number
read rtu:/dev/null?baud=9600&baud=9600 1|the key "baud" is given twice
read rtu:/dev/null?bauds=9600 1|the key "bauds" is unknown: rtu: has baud, parity, stop, rs485, echo, gap, latency and shared
read rtu:/dev/null?parity=E 1|parity: "E" is not one of none, even and odd
read rtu:/dev/null?stop=3 1|stop: "3" is out of range
read rtu:/dev/null?data=7 1|the key "data" is unknown
read rtu:/dev/null?gap=5 1|gap: "5" is not a time
read rtu:/dev/null?echo=1 1|echo: "1" is not one of no and yes
read ascii:/dev/null?gap=5ms 1|the key "gap" is unknown
read pty: 1|only a server makes a pseudo terminal
read tls://127.0.0.1 1|tls:// needs the keys ca, cert and key
read tls://127.0.0.1?ca=a&cert=b&kye=c 1|the key "kye" is unknown: tls:// has ca, cert, key and name
serve|LINE is missing
serve pty:|give a device FILE, or --random, or --echo
serve pty: @FILE --echo|give a device FILE, or --random, or --echo
serve pty: --random --echo|give a device FILE, or --random, or --echo
serve pty: @FILE more|"more" is one word too many
serve pty: @FILE -u 3|--unit goes with --random and --echo
serve pty: --echo -u 0|unit 0 is read in frames of Modbus TCP only
serve pty: --echo -u 9-5|--unit "5" is out of range: from 9 to 255 is allowed
serve pty: --echo -u ,|--unit "" is not a whole decimal number
serve pty: --echo -u 1,,2|--unit "" is not a whole decimal number
serve pty: --echo -u 1-3,2|--unit: unit 2 is there twice
serve pty: --echo -u 1,x|--unit "x" is not a whole decimal number
serve carrier:pigeon @FILE|"carrier:pigeon" is not a line
serve pty: @FILE --fault lait|--fault "lait" is no fault: on this line they are late, deaf, slow, damaged, cut, noise, twice, exception, foreign, wrong-length
serve pty: @FILE --fault close|--fault "close": this line cannot have it: it can have late, deaf, slow, damaged, cut, noise, twice, exception, foreign, wrong-length
serve udp://:0 @FILE --fault cut=3|it can have late, deaf, twice, exception, foreign
serve pty: @FILE --fault late|--fault "late": the value is missing, such as late=750ms
serve pty: @FILE --fault late=|--fault "late=": "" is not a time
serve pty: @FILE --fault late=750|"750" is not a time: write a whole number and its unit
serve pty: @FILE --fault late=11m|"11m" is out of range: from 1ms to 10m is allowed
serve pty: @FILE --fault deaf=1|--fault "deaf=1": deaf has no value
serve pty: @FILE --fault cut=0|"0" is out of range: from 1 to 512 is allowed
serve pty: @FILE --fault exception=128|"128" is out of range: from 1 to 127 is allowed
serve pty: @FILE --fault noise=0x4|"0x4" is not a whole decimal number
serve pty: @FILE --fault deaf@|after @ stand N, N- or N/M, such as @3, @3- or @3/10
serve pty: @FILE --fault deaf@0|"0" is out of range: from 1
serve pty: @FILE --fault deaf@3/0|"0" is out of range: from 1
serve pty: @FILE --fault deaf@-3|after @ stand N, N- or N/M
serve tcp://:0 @FILE --fault unit=256|--fault "unit=256": "256" is out of range: from 0 to 255 is allowed
serve tcp://:0 @FILE --fault transaction=own|"own" is not a whole decimal number
serve tcp://:0 @FILE --fault transaction|the value is missing, such as transaction=0
serve pty: @FILE --fault transaction=0|"transaction": this line cannot have it
serve tcp://:0 @FILE --fault hole=9-5|"hole=9-5": the range ends before it begins
serve tcp://:0 @FILE --fault hole=1-65536|"65536" is out of range
serve tcp://:0 @FILE --fault only-function=0x80|"0x80" is not a function code: from 0x01 to 0x7F is allowed
serve tcp://:0 @FILE --fault only-function=0x|"0x" is not a function code
serve tcp://:0 @FILE --fault only-function=3,4|"3,4" is not a whole decimal number
serve tcp://:0 @FILE --fault most-registers=126|"126" is out of range: from 1 to 125 is allowed
serve tcp://:0 @FILE --fault busy|"busy": it goes with needs-delay, needs-message-wait or one-request
serve tcp://:0 @FILE --fault refused-with=3|"refused-with": it goes with most-registers, most-bits or hole
serve tcp://:0 @FILE --fault deaf-after=1@2|deaf-after is there for the whole run, and has no @
serve pty: @FILE --fault connections=1|"connections": this line cannot have it
serve udp://:0 @FILE --fault one-request|"one-request": this line cannot have it
serve pty: @BAD|@BAD:5: type: "real" is not one of the 38 words in docs/device-file.md: among them are bit, uint16,
serve tls://:0?ca=/a&cert=/b&key=/c --echo|serve: /b: No such file or directory
poll|LINE is missing
poll @LINE|FILE is missing
poll pty: @FILE|only a server makes a pseudo terminal
poll @LINE @FILE more|"more" is one word too many
poll @LINE @FILE --rounds 0|--rounds "0" is out of range
poll @LINE @FILE --for 10|--for "10" is not a time
poll @LINE @FILE --gap 2001|--gap "2001" is out of range
poll @LINE @FILE --watch|--watch: standard output is no terminal. Leave it out to print each round.
poll @LINE @FILE --watch --json|--watch and --json exclude each other
poll @LINE @FILE --http localhost:8080|--http "localhost:8080" is not a port, or an address in numbers and a port
poll @LINE @FILE --http 8080x|is not a port, or an address in numbers
poll @LINE @FILE --http 65536|is not a port, or an address in numbers
poll @LINE @FILE --http 127.0.0.1|is not a port, or an address in numbers
poll @LINE @FILE --http ::1:80|is not a port, or an address in numbers
poll @LINE @FILE --http [::1]|is not a port, or an address in numbers
poll @LINE @FILE --http :80|is not a port, or an address in numbers
poll @LINE @BAD|@BAD:5: type: "real" is not one of the 38 words in docs/device-file.md: among them are bit, uint16,
poll @LINE @WRITTEN|@WRITTEN has no field that can be read
1 serve pty: /nowhere.yaml|/nowhere.yaml: No such file or directory
1 poll @LINE /nowhere.yaml|/nowhere.yaml: No such file or directory
3 serve rtu:/dev/no-such-line --echo|rtu:/dev/no-such-line: No such file or directory
3 serve tcp://no-such-host.invalid:1502 --echo|tcp://no-such-host.invalid:1502: 
3 serve pty:@FILE --echo|@FILE is there already and is no link
3 poll @LINE @FILE --once|Connection refused
header|FILE is missing
header @FILE more|"more" is one word too many
header @FILE --gap 2001|--gap "2001" is out of range: from 0 to 2000 is allowed
header @FILE --name 9|"9" cannot be the device's name in C
1 header /nowhere.yaml|/nowhere.yaml: No such file or directory
1 header @FILE -o /nowhere/a.h|/nowhere/a.h: No such file or directory
1 header @FILE -o /dev/full|/dev/full: No space left on device
gateway tcp://127.0.0.1:0 rtu:/dev/null|a gateway needs LISTEN, and for each LINE its UNITS
gateway tcp://127.0.0.1:0 rtu:/dev/null 1-9 rtu:/dev/zero|UNITS of the last line are missing
gateway 502 rtu:/dev/null 1-9|"502" is not a line
gateway udp://:502 rtu:/dev/null 1-9|a gateway listens at tcp://
gateway tcp://127.0.0.1:0 /dev/ttyUSB0,19200,E1 1-9|"/dev/ttyUSB0,19200,E1" is not a line
gateway tcp://127.0.0.1:0 udp://127.0.0.1 1-9|a line of a gateway is rtu:, ascii:, tcp:// or rtu+tcp://
gateway tcp://127.0.0.1:0 rtu:/dev/null 1-9,x|UNITS "1-9,x": units are FIRST-LAST or FIRST-LAST=UNIT, from 0 to 255
gateway tcp://127.0.0.1:0 rtu:/dev/null 9-1|the first unit of a range is above its last one
gateway tcp://127.0.0.1:0 rtu:/dev/null 1-9=250|the last unit of the range would be above 255
gateway tcp://127.0.0.1:0 rtu:/dev/null 1=0|UNITS "1=0": 0 on a line is a broadcast, which no device answers
gateway tcp://127.0.0.1:0 rtu+tcp://127.0.0.1:1 1=0|0 on a line is a broadcast, which no device answers, except on a line tcp://
gateway tcp://127.0.0.1:0 tcp://127.0.0.1 5=0,5|a range before has one of these units
gateway tcp://127.0.0.1:0 rtu:/dev/null 0=0,5-9=0|UNITS "0=0,5-9=0": 0 on a line is a broadcast
gateway tcp://127.0.0.1:0 rtu:/dev/null 1-9 rtu:/dev/zero 9|a range before has one of these units
gateway tcp://127.0.0.1:0 rtu:/dev/null 1-9 rtu:/dev/null 10|the line rtu:/dev/null is there twice
gateway --timeout 500 tcp://127.0.0.1:0 rtu:/dev/null 1-9|--timeout "500" is not a time
gateway --connections 256 tcp://127.0.0.1:0 rtu:/dev/null 1-9|from 1 to 255 is allowed
gateway @GATEWAY --metrics 0.0.0.0:9100|"0.0.0.0:9100" is not an address of this machine
gateway @GATEWAY --metrics 192.168.0.1:9100|is not an address of this machine
gateway @GATEWAY --metrics 127.0.0.1|is not an address of this machine and a port
gateway @GATEWAY --metrics 127.0.0.1:x|is not an address of this machine and a port
gateway @GATEWAY --stats-every 10s|--stats-every needs --stats
gateway @GATEWAY --log-level loud|is not one of error, warning, info and debug
gateway @GATEWAY --log-level info rtu:/dev/null|one word too many
bridge rtu:@TTY|a bridge needs LINE and FILE
bridge rtu:@TTY @FILE @FILE|is not a line
bridge @FILE rtu:@TTY|one word too many: the lines are in the file
bridge /dev/ttyUSB0 @FILE|"/dev/ttyUSB0" is not a line
1 bridge rtu:@TTY /nowhere/nothing.yaml|nothing.yaml: No such file or directory
bridge -b 127.0.0.1,1883 rtu:@TTY @FILE|127.0.0.1,1883
bridge -b 127.0.0.1:0 rtu:@TTY @FILE|from 1 to 65535 is allowed
bridge -b ::1 rtu:@TTY @FILE|an IPv6 address needs brackets
bridge -b [::1]x:1883 rtu:@TTY @FILE|[::1]x:1883
bridge -t hall/# rtu:@TTY @FILE|--topic "hall/#" is not 1 to 200 bytes without + and #
bridge --timeout 200 rtu:@TTY @FILE|--timeout "200" is not a time
bridge --gap 124 rtu:@TTY @FILE|from 0 to 123 is allowed
bridge --cert me.crt rtu:@TTY @FILE|--cert and --key need --ca
bridge --ca /nowhere/no.crt rtu:@TTY @FILE|Check --ca, --cert and --key
3 bridge rtu:/dev/no-such-line @FILE|Is the adapter plugged in?
sniff|LINE is missing
sniff - -|one word too many
sniff /dev/null|is not a line: it begins with rtu:
sniff tcp://127.0.0.1|a sniffer listens to rtu:, ascii: or rtu+tcp://
sniff rtu:/dev/null?baud=19200x|"19200x" is not a whole decimal number
sniff rtu:/dev/null?baud=0|from 50 to 4000000
sniff rtu:/dev/null?parity=X|"X" is not one of none, even and odd
sniff rtu:/dev/null?speed=9600|the key "speed" is unknown
sniff rtu:/dev/null --baud 9600|--baud and --framing are for a recording
sniff - --baud many|--baud "many" is not a whole decimal number
sniff - --framing usb|"usb" is not one of rtu, ascii and tcp
sniff - --timeout 5|"5" is not a time
sniff - --frame-timeout 0ms|--frame-timeout "0ms" is out of range: from 1ms to 65535ms
sniff - --pcap|requires an argument
1 sniff - --pcap /nowhere/file|/nowhere/file
3 sniff rtu:/dev/no-such-line|Is the adapter plugged in?
3 sniff rtu:/dev/null|/dev/null
3 sniff rtu+tcp://127.0.0.1:1|Check host and port
"""


@pytest.mark.parametrize("words, sentence", [row.split("|") for row in REFUSED.strip().splitlines()])
def test_what_is_wrong_on_the_command_line_is_named(mbm, request, write, words, sentence):
    code, words = re.fullmatch(r"(?:(\d) )?(.*)", words).groups()
    names = {name: write(f"{name[1:]}.yaml", text) for name, text in FILES.items()}
    if "@TTY" in words:
        names["@TTY"] = request.getfixturevalue("wire").names[1]
    for name, place in {**names, "@LINE": PLACE}.items():
        words, sentence = words.replace(name, place), sentence.replace(name, place)
    mbm.fails(int(code or WRONG), sentence, *words.split())


@pytest.mark.parametrize("words, sentence", [
    (("read", PLACE, 400101, 2), f'ADDRESS "400101" is above 65535. In a manual, 400101 is the holding register with address 100:\n  mbm read {PLACE} 100 2\n'),
    (("read", PLACE, 300101, "-u", 3), f"is the input register with address 100:\n  mbm read --table input -u 3 {PLACE} 100\n"),
    (("read", PLACE, " 5"), '" 5" is not a whole'),
    (("write", PLACE, "-T", "text", 1, "a", "b"), "a write has one text"),
    (("write", PLACE, "-T", "text", 1, "ä"), "is not ASCII text"),
    (("write", PLACE, 1, *range(124)), "one request writes at most 123 registers"),
    (("write", PLACE, "-t", "coils", 1, *[1] * 1969), "one request writes at most 1968 coils"),
    (("call", PLACE, "03" * 254), "has more than 253 bytes"),
    (("serve", "pty:", "--echo", *["--fault", "deaf"] * 33), "there are more than 32 --fault options"),
    (("bridge", "-t", "h" * 201, PLACE, __file__), "is not 1 to 200 bytes without + and #"),
], ids=lambda one: one if isinstance(one, str) else one[0])
def test_words_that_are_too_many_or_of_a_manual_are_refused(mbm, words, sentence):
    mbm.fails(WRONG, sentence, *words)


def test_each_command_has_its_help(mbm):
    assert (mbm().code, mbm().out) == (WRONG, "")
    code, out, error = mbm("--help")
    assert code == DONE and out.startswith("Usage: mbm COMMAND") and not error
    assert mbm("help") == (DONE, out, "")
    commands = re.findall(r"^  (\w+) ", out.split("Options:")[0], re.M)
    assert len(commands) == 12, commands
    for command in commands:
        code, text, error = mbm(command, "--help")
        assert code == DONE and text.startswith(f"Usage: mbm {command} ") and re.search(rf"^ *mbm {command} ", text, re.M), text + error
        assert mbm("help", command) == (DONE, text, "")
        assert max(map(len, text.splitlines())) < 80
    code, out, error = mbm("--version")
    assert code == DONE and re.fullmatch(r"mbm \d+\.\d+\.\d+\n", out), out + error


@pytest.mark.parametrize("word, sentence", [
    ("raed", 'there is no command "raed". Is "mbm read" meant?'), ("zzzzzzz", '"mbm --help" lists them')])
def test_a_command_that_is_not_there_is_named(mbm, word, sentence):
    code, out, error = mbm(word, "tcp://127.0.0.1", 1)
    assert code == WRONG and sentence in error and not out


@pytest.fixture
def completed(mbm):
    def completed(line):
        """What bash completes the line with."""
        command = f"source {ROOT}/cli/completion/mbm.bash; COMP_LINE='{line}' COMP_POINT={len(line)}; _mbm; echo ${{COMPREPLY[*]}}"
        path = {**os.environ, "PATH": f"{os.path.dirname(mbm.path)}:{os.environ['PATH']}"}
        return run("bash", "-c", command, env=path).out.split()

    return completed


@pytest.mark.parametrize("line, wanted", [
    ("mbm wr", ["write"]), ("mbm help sc", ["scan"]), ("mbm read --ta", ["--table"]),
    ("mbm read tcp://h --table ", ["coils", "discrete", "holding", "input"]), ("mbm read -o D", ["DCBA", "DCBAHGFE"]),
    ("mbm read tcp", ["tcp://"]), ("mbm header tcp", []), ("mbm import tel", ["telegraf"]), ("mbm header --mark", ["--markdown"])])
def test_bash_completes_commands_options_words_and_lines(completed, line, wanted):
    assert completed(line) == wanted


def test_bash_completes_a_terminal_after_its_colon(completed):
    assert "/dev/tty" in completed("mbm read rtu:/dev/tt")


def test_completion_and_man_pages_have_every_command_and_option(mbm, completed):
    commands = completed("mbm ")[:-3]
    assert len(commands) == 12
    assert sorted(os.listdir(f"{BUILD}/man")) == sorted([f"mbm-{command}.1" for command in commands] + ["mbm.1"])
    with open(f"{ROOT}/cli/completion/_mbm") as file:
        of_zsh = file.read()
    lists = 0
    for command in commands:
        text = mbm(command, "--help").out
        assert set(re.findall(r"^ +(?:-., )?(--[a-z-]+)", text, re.M)) - set(completed(f"mbm {command} --")) == set()
        for option in re.findall(r"(--[a-z-]+)=", text):
            known = re.search(r" is not one of (.*)\.\n", mbm(command, option, "").error)
            if known:
                lists += 1
                assert sorted(completed(f"mbm {command} {option} ")) == sorted(re.findall(r"\w+", known[1].replace(" and ", " ")))
                assert f"{option} |" in of_zsh
    assert lists > 5
