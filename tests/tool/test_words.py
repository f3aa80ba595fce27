"""What the command line of mbm refuses, and how it helps: --help, completion and man pages."""

import os
import re

import pytest
from peers import BUILD, DONE, LINE, ROOT, WRONG, run

PLACE = "tcp://127.0.0.1:1"
BAD_WORDS = """
read LINE|ADDRESS is missing
read|LINE is missing
read LINE 0x10|ADDRESS "0x10" is not a whole decimal number, here from 0 to 65535
read LINE 21,5|"21,5" is not a whole
read LINE +5|"+5" is not a whole
read LINE 5x|"5x" is not a whole
read LINE 65536|ADDRESS "65536" is out of range: from 0 to 65535
read LINE 99999999999999999999|is out of range
read LINE 0 --one-based|ADDRESS "0" is out of range: from 1 to 65536
read LINE 1 0|COUNT "0" is out of range
read LINE 1 two|COUNT "two" is not a whole
read LINE 65535 2|2 addresses from 65535 on end beyond the last address, 65535
read LINE 65534 1 --type double|4 addresses from 65534 on end beyond
read LINE 1 2 3|"3" is one word too many
read LINE 1 --unit 256|--unit "256" is out of range
read LINE 1 --unit=-1|--unit "-1" is not
read LINE 1 --unit 0|--unit "0" is out of range: from 1 to 255
read LINE 1 --unit 1,|--unit "" is not a whole
read LINE 1 --unit 1-3,2|--unit: unit 2 is there twice
write rtu+tcp://127.0.0.1:1 1 1 --unit 0|--unit 0 means all units
call rtu+tcp://127.0.0.1:1 03 --unit 0|--unit 0 means all units
identify rtu:/dev/null --unit 0|--unit 0 means all units
read LINE 1 --table coil|--table "coil" is not one of coils, discrete, holding and input
read LINE 1 --type flaot|--type "flaot" is not one of bit, uint16,
read LINE 1 --order abcd|--order "abcd" is not one of ABCD, CDAB, BADC and DCBA
read LINE 1 --table coils --type uint16|the table coils has no values of type uint16
read LINE 1 --type bit|the table holding has no values of type bit
read LINE 1 --scale 0|--scale "0" is not a decimal number other than 0
read LINE 1 --scale 0,1|--scale "0,1" is not
read LINE 1 --scale 2 --type text|--scale needs a number
read LINE 1 --hex --type float|--hex needs an integer type
read LINE 1 --timeout 500|--timeout "500" is not a time: write a whole number and its unit, such as 500ms, 2s or 1m
read LINE 1 --timeout 1.5s|is not a time
read LINE 1 --timeout 0ms|is out of range: from 1ms to 1000s
read LINE 1 --every 25h|is out of range
read LINE 1 --retries 255|--retries "255" is out of range
read LINE 1 --in-flight 17|--in-flight "17" is out of range
read LINE 1 --times 3|--times needs --every
read LINE 1 --csv --json|exclude each other
read LINE 1 --tabel coils|unrecognized option '--tabel'
read LINE 1 -z|invalid option -- 'z'
write LINE|ADDRESS is missing
write LINE 1|VALUE is missing
write LINE 1 0x10|VALUE "0x10" is not a decimal number
write LINE 1 21,5|VALUE "21,5" is not a decimal number
write LINE 1 +5|VALUE "+5" is not a decimal number
write LINE 1 5x|VALUE "5x" is not a decimal number
write LINE 1 -1|VALUE "-1" is out of range of the type uint16
write LINE 1 65536|VALUE "65536" is out of range of the type uint16
write LINE 1 1.5|VALUE "1.5" is not a whole number
write LINE 1 1.05 --scale 0.1|VALUE "1.05" is not a multiple of the scale
write LINE 1 1e39 --type float|VALUE "1e39" is out of range of the type float
write LINE 1 2 --table coils|VALUE "2" is no value of a coil: 1 is on, and 0 is off
write LINE 1 on -t coils|VALUE "on" is no value of a coil: 1 is on, and 0 is off
read LINE 465537|ADDRESS "465537" is out of range: from 0 to 65535
write LINE 300101 5|is the input register with address 100, which cannot be written.
write LINE 1 10000 --hex|VALUE "10000" is out of range of the type uint16
write LINE 1 xyz --hex|VALUE "xyz" is not a hexadecimal number
write LINE 1 1 --table input|the table input cannot be written
write LINE 65535 1 2|2 addresses from 65535 on end beyond
call LINE|HEX is missing
call LINE 0|HEX "0" is not hexadecimal bytes
call LINE 0x03|HEX "0x03" is not hexadecimal bytes
call LINE 83 00|HEX begins with 83: a function code is 01 to 7F
scan|LINE is missing
scan LINE more|"more" is one word too many
scan LINE --units 0|--units "0" is out of range
scan LINE --units 5-3|--units "3" is out of range: from 5 to 255
scan LINE --units 1,|--units "" is not
scan LINE --units 1-3,2|unit 2 is there twice
scan LINE --rates 9600|--rates and --parities need a serial line
scan rtu:/dev/null --rates many|--rates "many" is not
scan rtu:/dev/null --parities E|--parities "E" is not one of none, even and odd
identify LINE --category all|--category "all" is not one of basic, regular and extended
identify LINE 17|"17" is one word too many
"""
BAD_LINES = """
nothing|"nothing" is not a line: it begins with rtu:, ascii:, tcp://
tcp:127.0.0.1,502|is not a line
tcp://|the host is missing
tcp://127.0.0.1:0|the port "0" is out of range
tcp://127.0.0.1:70000|the port "70000" is out of range
tcp://127.0.0.1:no|the port "no" is not a whole decimal number
tcp://127.0.0.1,502|is not a host
tcp://::1|an IPv6 address needs brackets
tcp://[::1|the bracket after the address is missing
tcp://[::1]502|after the address is not :PORT
tcp://127.0.0.1?unit=1|"unit" is unknown: tcp:// has no keys
rtu+tcp://127.0.0.1|the port is missing
rtu:|the path of the terminal is missing
rtu:/dev/null?|
rtu:/dev/null?baud|"baud" is not KEY=VALUE
rtu:/dev/null?baud=|is not KEY=VALUE
rtu:/dev/null?baud=fast|baud: "fast" is not a whole decimal number
rtu:/dev/null?baud=9600&baud=9600|the key "baud" is given twice
rtu:/dev/null?bauds=9600|the key "bauds" is unknown: rtu: has baud, parity, stop, rs485, echo, gap, latency and shared
rtu:/dev/null?parity=E|parity: "E" is not one of none, even and odd
rtu:/dev/null?stop=3|stop: "3" is out of range
rtu:/dev/null?data=7|the key "data" is unknown
rtu:/dev/null?gap=5|gap: "5" is not a time
rtu:/dev/null?echo=1|echo: "1" is not one of no and yes
ascii:/dev/null?gap=5ms|the key "gap" is unknown
pty:|only a server makes a pseudo terminal
tls://127.0.0.1|tls:// needs the keys ca, cert and key
tls://127.0.0.1?ca=a&cert=b&kye=c|the key "kye" is unknown: tls:// has ca, cert, key and name
"""


def cases(text):
    return [case.split("|") for case in text.strip().splitlines()]


@pytest.mark.parametrize("words, sentence", cases(BAD_WORDS))
def test_a_wrong_word_is_named(mbm, words, sentence):
    mbm.fails(WRONG, sentence, *words.replace("LINE", PLACE).split())


@pytest.mark.parametrize("line, sentence", cases(BAD_LINES))
def test_a_wrong_line_is_named(mbm, line, sentence):
    # A question mark without keys is no mistake; that terminal is.
    mbm.fails(WRONG if sentence else LINE, sentence, "read", line, 1)


@pytest.mark.parametrize("words, sentence", [
    (("read", PLACE, 400101, 2), f'ADDRESS "400101" is above 65535. In a manual, 400101 is the holding register with address 100:\n  mbm read {PLACE} 100 2\n'),
    (("read", PLACE, 300101, "-u", 3), f"is the input register with address 100:\n  mbm read --table input -u 3 {PLACE} 100\n"),
    (("read", PLACE, " 5"), '" 5" is not a whole'),
    (("write", PLACE, "-T", "text", 1, "a", "b"), "a write has one text"),
    (("write", PLACE, "-T", "text", 1, "ä"), "is not ASCII text"),
    (("write", PLACE, 1, *range(124)), "one request writes at most 123 registers"),
    (("write", PLACE, "-t", "coils", 1, *[1] * 1969), "one request writes at most 1968 coils"),
    (("call", PLACE, "03" * 254), "has more than 253 bytes"),
], ids=lambda one: one if isinstance(one, str) else one[0])
def test_words_that_are_too_many_or_of_a_manual_are_refused(mbm, words, sentence):
    mbm.fails(WRONG, sentence, *words)


def test_each_command_has_its_help(mbm):
    assert (mbm().code, mbm().out) == (WRONG, "")
    code, out, error = mbm("--help")
    assert code == DONE and out.startswith("Usage: mbm COMMAND") and not error
    assert mbm("help") == (DONE, out, "")
    commands = re.findall(r"^  (\w+) ", out.split("Options:")[0], re.M)
    assert len(commands) == 11, commands
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
    ("mbm read tcp://h --table ", ["coils", "discrete", "holding", "input"]), ("mbm read -o D", ["DCBA"]),
    ("mbm read tcp", ["tcp://"]), ("mbm header tcp", []), ("mbm header --mark", ["--markdown"])])
def test_bash_completes_commands_options_words_and_lines(completed, line, wanted):
    assert completed(line) == wanted


def test_bash_completes_a_terminal_after_its_colon(completed):
    assert "/dev/tty" in completed("mbm read rtu:/dev/tt")


def test_completion_and_man_pages_have_every_command_and_option(mbm, completed):
    commands = completed("mbm ")[:-3]
    assert len(commands) == 11
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
