//! The programs against servers of pymodbus and libmodbus, and clients of pymodbus.
#![cfg(feature = "pymodbus")]

use embedded_io_adapters::tokio_1::FromTokio;
use mbm::client::BlockingClient;
use mbm::port::PolledIo;
use mbm::Error;
use mbm_host_example::micros;
use std::io::{BufRead, BufReader};
use std::process::{Child, ChildStdout, Command, Stdio};
use tokio::net::TcpStream;

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../..");

/// A peer, which ends with its input.
struct Peer {
    child: Child,
    line: String,
    output: BufReader<ChildStdout>,
}

impl Peer {
    /// Starts a program, which prints a line when it is ready.
    fn start(program: &str, arguments: &[&str]) -> Peer {
        let mut command = Command::new(program);
        command.args(arguments).current_dir(ROOT);
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap_or_else(|error| {
                panic!("{program}: {error}; run `make venv build/plain/serve_libmodbus`")
            });
        let output = child.stdout.take().expect("the output");
        let mut peer = Peer {
            child,
            line: String::new(),
            output: BufReader::new(output),
        };
        peer.line = peer.next_line();
        peer
    }

    fn next_line(&mut self) -> String {
        let mut line = String::new();
        self.output.read_line(&mut line).expect("a line");
        line.trim_end().into()
    }

    fn python(arguments: &[&str]) -> Peer {
        Peer::start(&format!("{ROOT}/build/venv/bin/python"), arguments)
    }

    /// A server of pymodbus.
    fn pymodbus(framing: &str, place: [&str; 2]) -> Peer {
        let script = "tests/peer/pymodbus_server.py";
        Peer::python(&[
            "-B",
            script,
            "--framing",
            framing,
            place[0],
            place[1],
            "--baud",
            "19200",
        ])
    }

    /// The words of the line after the first.
    fn words(&self) -> Vec<&str> {
        self.line.split(' ').collect()
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        drop(self.child.stdin.take());
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// What a program prints.
fn run(program: &str, argument: &str) -> String {
    let output = Command::new(program)
        .arg(argument)
        .output()
        .expect("the program runs");
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{program} {argument}: {error}");
    String::from_utf8(output.stdout)
        .expect("a text")
        .trim_end()
        .to_owned()
}

/// The registers 107 and 108 of the servers.
fn expected() -> String {
    let pattern = |address: u16| address.wrapping_mul(40503).wrapping_add(0x1234);
    format!("{} {}", pattern(107), pattern(108))
}

#[test]
fn two_registers_of_a_pymodbus_server_are_read_over_tcp_and_by_rtu_frames_in_tcp() {
    for (program, framing) in [
        (env!("CARGO_BIN_EXE_read_tcp"), "tcp"),
        (env!("CARGO_BIN_EXE_read_tcp_async"), "tcp"),
        (env!("CARGO_BIN_EXE_read_rtu_over_tcp"), "rtu-over-tcp"),
        (
            env!("CARGO_BIN_EXE_read_rtu_over_tcp_async"),
            "rtu-over-tcp",
        ),
    ] {
        let server = Peer::pymodbus(framing, ["--port", "0"]);
        let address = format!("127.0.0.1:{}", server.words()[1]);
        assert_eq!(run(program, &address), expected());
    }
}

#[test]
fn two_registers_of_a_pymodbus_server_are_read_on_serial_lines() {
    for (program, framing) in [
        (env!("CARGO_BIN_EXE_read_rtu"), "rtu"),
        (env!("CARGO_BIN_EXE_read_rtu_async"), "rtu"),
        (env!("CARGO_BIN_EXE_read_ascii"), "ascii"),
        (env!("CARGO_BIN_EXE_read_ascii_async"), "ascii"),
    ] {
        let line = Peer::python(&[
            "-B",
            concat!(env!("CARGO_MANIFEST_DIR"), "/tests/pty_pair.py"),
        ]);
        let ends = line.words();
        let _server = Peer::pymodbus(framing, ["--tty", ends[0]]);
        assert_eq!(run(program, ends[1]), expected());
    }
}

#[test]
fn two_registers_of_a_libmodbus_server_are_read_over_tcp_and_on_a_serial_line() {
    let server = Peer::start(&format!("{ROOT}/build/plain/serve_libmodbus"), &[]);
    let words = server.words();
    for program in [
        env!("CARGO_BIN_EXE_read_rtu"),
        env!("CARGO_BIN_EXE_read_rtu_async"),
    ] {
        assert_eq!(run(program, words[1]), expected());
    }
    let address = format!("127.0.0.1:{}", words[2]);
    for program in [
        env!("CARGO_BIN_EXE_read_tcp"),
        env!("CARGO_BIN_EXE_read_tcp_async"),
    ] {
        assert_eq!(run(program, &address), expected());
    }
}

#[test]
fn a_pymodbus_client_reads_and_writes_the_registers_of_the_server_on_two_connections() {
    let server = Peer::start(env!("CARGO_BIN_EXE_serve_tcp"), &["127.0.0.1:0"]);
    let port = server.line.rsplit(':').next().expect("a port").to_owned();
    let script = "\
import sys
from pymodbus.client import ModbusTcpClient
one, two = (ModbusTcpClient('127.0.0.1', port=int(sys.argv[1])) for _ in range(2))
one.connect(), two.connect()
read = lambda client, address, count: client.read_holding_registers(address, count=count, device_id=17)
print(read(one, 107, 4).registers)
one.write_registers(109, [888, 999], device_id=17)
print(read(two, 108, 3).registers)
print(read(two, 108, 4).exception_code)
print(two.read_coils(0, count=1, device_id=17).exception_code)
";
    let python = format!("{ROOT}/build/venv/bin/python");
    let output = Command::new(python)
        .args(["-c", script, &port])
        .output()
        .expect("Python runs");
    let printed = String::from_utf8_lossy(&output.stdout);
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(
        printed, "[555, 100, 0, 0]\n[100, 888, 999]\n2\n1\n",
        "{error}"
    );
}

#[test]
fn two_tasks_share_a_connection_to_a_libmodbus_server() {
    let server = Peer::start(&format!("{ROOT}/build/plain/serve_libmodbus"), &[]);
    let address = format!("127.0.0.1:{}", server.words()[2]);
    let printed = run(env!("CARGO_BIN_EXE_share_async"), &address);
    let expected = expected();
    let (first, second) = expected.split_once(' ').expect("two numbers");
    for (register, value) in [(107, first), (108, second)] {
        let line = format!("register {register} is {value}");
        assert!(printed.lines().any(|printed| printed == line), "{printed}");
    }
    let is_right = |line: &str| {
        line == format!("register 107 is {first}")
            || line == format!("register 108 is {second}")
            || line.ends_with("no reply in time")
    };
    assert!(printed.lines().all(is_right), "{printed}");
}

/// A client that blocks polls the futures of the socket, on a thread of its own: in a task tokio lets only 128
/// reads and writes succeed between two awaits.
#[tokio::test]
async fn a_polled_socket_of_tokio_writes_and_reads_a_libmodbus_server_400_times() {
    let server = Peer::start(&format!("{ROOT}/build/plain/serve_libmodbus"), &[]);
    let address = format!("127.0.0.1:{}", server.words()[2]);
    let socket = TcpStream::connect(address).await.expect("a connection");
    let port = PolledIo::stream(FromTokio::new(socket), micros);
    let mut client = BlockingClient::tcp(port);
    let requests = tokio::task::spawn_blocking(move || {
        for round in 0..400 {
            let words = [round, !round];
            client
                .write_multiple_registers(17, 107, &words)
                .expect("the registers are written");
            assert_eq!(client.holding_registers(17, 107), Ok(words));
        }
        assert_eq!(
            client.holding_registers::<1>(17, 0xFFFF),
            Err(Error::IllegalDataAddress)
        );
        drop(server);
        assert_eq!(client.holding_registers::<2>(17, 107), Err(Error::LinkLost));
    });
    requests.await.expect("the requests are right");
}

/// What a program in Python prints.
fn python(script: &str, arguments: &[&str]) -> String {
    let output = Command::new(format!("{ROOT}/build/venv/bin/python"))
        .args(["-c", script])
        .args(arguments)
        .output()
        .expect("Python runs");
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{error}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Clients of pymodbus, by their arguments.
const PYMODBUS: &str = "\
import sys
from pymodbus import FramerType
from pymodbus.client import ModbusSerialClient, ModbusTcpClient
framer, place = FramerType(sys.argv[1]), sys.argv[2]
def client():
    if place.startswith('/'):
        made = ModbusSerialClient(place, framer=framer, baudrate=19200)
    else:
        made = ModbusTcpClient('127.0.0.1', port=int(place), framer=framer)
    assert made.connect()
    return made
";

/// A client of libmodbus.
const LIBMODBUS: &str = "\
import ctypes, sys
lib = ctypes.CDLL('libmodbus.so.5', use_errno=True)
lib.modbus_new_rtu.restype = lib.modbus_new_tcp.restype = ctypes.c_void_p
lib.modbus_strerror.restype = ctypes.c_char_p
place = sys.argv[1].encode()
made = lib.modbus_new_rtu(place, 19200, ctypes.c_char(b'N'), 8, 1) if place.startswith(b'/') else lib.modbus_new_tcp(b'127.0.0.1', int(place))
line = ctypes.c_void_p(made)
lib.modbus_set_slave(line, 17)
lib.modbus_set_response_timeout(line, 5, 0)
assert lib.modbus_connect(line) == 0
def read(address, count):
    words = (ctypes.c_uint16 * count)()
    done = lib.modbus_read_registers(line, address, count, words)
    print(list(words) if done == count else lib.modbus_strerror(ctypes.get_errno()).decode())
def write(address, *values):
    done = lib.modbus_write_registers(line, address, len(values), (ctypes.c_uint16 * len(values))(*values))
    print('written' if done == len(values) else lib.modbus_strerror(ctypes.get_errno()).decode())
";

/// Two pseudo-terminals as one line.
fn pty_pair() -> Peer {
    Peer::python(&[
        "-B",
        concat!(env!("CARGO_MANIFEST_DIR"), "/tests/pty_pair.py"),
    ])
}

#[test]
fn a_server_on_tokio_is_read_and_written_by_clients_of_pymodbus_and_libmodbus_over_tcp() {
    let server = Peer::start(env!("CARGO_BIN_EXE_serve_tcp_async"), &["127.0.0.1:0"]);
    let port = server.line.rsplit(':').next().expect("a port");
    let script = "\
one, two = client(), client()
read = lambda client, address, count: client.read_holding_registers(address, count=count, device_id=17)
print(read(one, 107, 4).registers)
one.write_registers(109, [888, 999], device_id=17)
print(read(two, 108, 3).registers, read(two, 108, 4).exception_code)
";
    let printed = python(&[PYMODBUS, script].concat(), &["socket", port]);
    assert_eq!(printed, "[555, 100, 0, 0]\n[100, 888, 999] 2\n");
    let script = "read(107, 4); write(110, 7); read(107, 4); read(108, 4)";
    let printed = python(&[LIBMODBUS, script].concat(), &[port]);
    assert_eq!(
        printed,
        "[555, 100, 888, 999]\nwritten\n[555, 100, 888, 7]\nIllegal data address\n"
    );
}

#[test]
fn a_server_of_rtu_frames_on_tokio_measures_for_each_client_of_pymodbus() {
    let server = Peer::start(
        env!("CARGO_BIN_EXE_serve_rtu_over_tcp_async"),
        &["127.0.0.1:0"],
    );
    let port = server.line.rsplit(':').next().expect("a port");
    let script = "\
one, two = client(), client()
read = lambda client, address: client.read_input_registers(address, count=1, device_id=17)
print(read(one, 0).registers, read(two, 0).registers, read(one, 0).registers, read(two, 1).exception_code)
";
    let printed = python(&[PYMODBUS, script].concat(), &["rtu", port]);
    assert_eq!(printed, "[201] [202] [203] 2\n");
}

#[test]
fn a_server_on_a_serial_line_on_tokio_is_written_by_clients_of_libmodbus_and_pymodbus() {
    let line = pty_pair();
    let ends = line.words();
    let mut server = Peer::start(env!("CARGO_BIN_EXE_serve_rtu_async"), &[ends[0]]);
    let script = "read(0, 2); write(0, 1500); read(0, 2); write(0, 3001); write(1, 1); read(1, 2)";
    let printed = python(&[LIBMODBUS, script].concat(), &[ends[1]]);
    let refused = "Illegal data value\nIllegal data address\nIllegal data address\n";
    assert_eq!(printed, format!("[0, 7]\nwritten\n[1500, 7]\n{refused}"));
    let script = "\
one = client()
print(one.write_register(0, 2000, device_id=17).registers)
print(one.read_holding_registers(0, count=2, device_id=17).registers)
";
    let printed = python(&[PYMODBUS, script].concat(), &["rtu", ends[1]]);
    assert_eq!(printed, "[2000]\n[2000, 7]\n");
    let speeds = [server.next_line(), server.next_line()];
    assert_eq!(speeds, ["speed 1500", "speed 2000"]);
}

#[test]
fn an_ascii_server_on_tokio_is_read_and_written_by_a_client_of_pymodbus() {
    let line = pty_pair();
    let ends = line.words();
    let _server = Peer::start(env!("CARGO_BIN_EXE_serve_ascii_async"), &[ends[0]]);
    let script = "\
one = client()
print(one.write_registers(109, [888, 999], device_id=17).isError())
print(one.read_holding_registers(107, count=4, device_id=17).registers)
";
    let printed = python(&[PYMODBUS, script].concat(), &["ascii", ends[1]]);
    assert_eq!(printed, "False\n[555, 100, 888, 999]\n");
}
