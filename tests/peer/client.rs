//! mbm's client against a live pymodbus server: Modbus TCP, RTU over TCP, and RTU and ASCII
//! over a pseudo-terminal. Functions that libmodbus lacks are included.

#[path = "../common/task.rs"]
mod task;

use crate::live_server::{pattern, LiveServer, PEER_TIMEOUT};
use crate::UNIT;
use mbm::client::{Client, RequestState, Serial, Tcp, Transport};
use mbm::engine::MicrosSetting;
use mbm::error::Status;
use mbm::frame::Framing;
use mbm::pdu::custom::Rule;
use mbm::pdu::functions::FunctionSpec;
use mbm::port::Port;
use std::collections::VecDeque;
use std::io::Write;
use std::time::{Duration, Instant};
use task::{Lent, Task};

/// The response timeout in microseconds. A malformed response is reported only after it.
const TIMEOUT: u32 = 10_000_000;

/// A port on the line to the pymodbus server.
pub struct Wire {
    server: LiveServer,
    pending: VecDeque<u8>,
    begun: Instant,
}

impl Wire {
    pub fn new(framing: Framing) -> Wire {
        Wire {
            server: LiveServer::new(framing),
            pending: VecDeque::new(),
            begun: Instant::now(),
        }
    }
}

impl Port for Wire {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, mbm::Error> {
        self.pending
            .extend(self.server.arrived.try_iter().flatten());
        let count = bytes.len().min(self.pending.len());
        for (place, byte) in bytes.iter_mut().zip(self.pending.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, mbm::Error> {
        self.server
            .out
            .write_all(bytes)
            .expect("the bytes are sent");
        Ok(bytes.len())
    }

    fn micros(&mut self) -> u32 {
        self.begun.elapsed().as_micros() as u32
    }

    fn idle(&mut self, micros: u32) {
        std::thread::sleep(Duration::from_micros(micros.min(1000).into()));
    }
}

/// A client and the clock with which it is polled.
struct Requester<L> {
    client: Client<L, Task, 4>,
    begun: Instant,
}

impl<L: Transport<Task>> Requester<L> {
    fn new(line: L) -> Self {
        Self::with(Client::new(line))
    }

    fn with(client: Client<L, Task, 4>) -> Self {
        Requester {
            client,
            begun: Instant::now(),
        }
    }

    /// Sends a request and waits until it has ended.
    fn request(&mut self, data: &[u8], build: impl FnOnce(&mut RequestState) -> Status) -> Task {
        assert!(self.client.queue(Task::new(UNIT, 1, data, build)).is_ok());
        let until = Instant::now() + PEER_TIMEOUT;
        while Instant::now() < until {
            let now = self.begun.elapsed().as_micros() as u32;
            if let Some(task) = self.client.poll(now) {
                return task;
            }
            let delay = self.client.poll_delay(now).clamp(50, 1000);
            std::thread::sleep(Duration::from_micros(delay.into()));
        }
        panic!("the request did not end");
    }

    fn expect_data(
        &mut self,
        data: &[u8],
        build: impl FnOnce(&mut RequestState) -> Status,
        expected: &[u8],
    ) {
        let task = self.request(data, build);
        assert_eq!(task.state.status, Status::OK, "{:02X?}", task.state);
        assert_eq!(task.received(), expected, "{:02X?}", task.state);
    }

    fn expect_status(
        &mut self,
        data: &[u8],
        build: impl FnOnce(&mut RequestState) -> Status,
        status: Status,
    ) {
        let task = self.request(data, build);
        assert_eq!(task.state.status, status, "{:02X?}", task.state);
    }

    fn check_every_function(mut self) {
        self.functions_that_libmodbus_lacks();
        self.registers_and_bits();
    }

    fn functions_that_libmodbus_lacks(&mut self) {
        self.expect_status(
            &[],
            |o| o.set(FunctionSpec::READ_EXCEPTION_STATUS, 0, 0),
            Status::OK,
        );
        let query = [0xA5, 0x37];
        self.expect_data(&query, |o| o.diagnostics(0, 1), &query);
        for sub_function in [
            1, 2, 0x0A, 0x0B, 0x0C, 0x0D, 0x0E, 0x0F, 0x10, 0x11, 0x12, 0x14,
        ] {
            self.expect_status(&[0, 0], |o| o.diagnostics(sub_function, 1), Status::OK);
        }
        let counter = self.request(&[], |o| o.set(FunctionSpec::GET_COMM_EVENT_COUNTER, 0, 0));
        assert_eq!(counter.received().get(..2), Some(&[0, 0][..]));
        let log = self.request(&[], |o| o.set(FunctionSpec::GET_COMM_EVENT_LOG, 0, 0));
        assert_eq!(log.state.status, Status::OK);
        assert!(log.received().len() >= 6);
        let id = b"Vendor-PC-V2.11\xFF";
        self.expect_data(&[], |o| o.set(FunctionSpec::REPORT_SERVER_ID, 0, 0), id);
        // The server returns the same record of 20 bytes for every request.
        let record = b"SERVER DUMMY RECORD.";
        self.expect_data(&[], |o| o.read_file_record(4, 1, 10), record);
        let group = |records| [6, 0, 4, 0, 1, 0, records];
        let answer = [&[21, 6][..], record].concat();
        let (groups, answers) = ([group(10); 2].concat(), [&answer[..]; 2].concat());
        self.expect_data(&groups, |o| o.read_file_records(14), &answers);
        let others = [group(10), group(2)].concat();
        let malformed = Status::MALFORMED_REPLY;
        self.expect_status(&others, |o| o.read_file_records(14), malformed);
        let data = [0xAF, 4, 0xBE, 0x10];
        self.expect_status(&data, |o| o.write_file_record(4, 7, 2), Status::OK);
        let written = [6, 0, 4, 0, 7, 0, 1, 0xAF, 4];
        self.expect_status(&written, |o| o.write_file_records(9), Status::OK);
        let queue = [0, 0, 0, 1, 0, 2, 0, 3];
        self.expect_data(
            &[],
            |o| o.set(FunctionSpec::READ_FIFO_QUEUE, 0x04DE, 0),
            &queue,
        );
        self.identification();
        let rule = Rule::Counted(1, 0);
        self.expect_data(&[3, 7, 8, 9], |o| o.custom(0x41, 4, rule), &[3, 9, 8, 7]);
    }

    fn identification(&mut self) {
        // The regular category is the basic one and four more objects. The server has one of them.
        let objects = b"\x00\x06Vendor\x01\x02PC\x02\x05V2.11\x03\x0Bexample.org";
        for (code, count, length) in [(1, 3, 19), (2, 4, 32), (3, 4, 32)] {
            let all = self.request(&[], |o| o.read_device_identification(code, 0));
            assert_eq!(all.received().get(1..4), Some(&[0, 0, count][..]));
            assert_eq!(all.received().get(4..), Some(&objects[..length]));
        }
        let one = self.request(&[], |o| o.read_device_identification(4, 2));
        assert_eq!(one.received().get(3..), Some(&b"\x01\x02\x05V2.11"[..]));
        let missing = |o: &mut RequestState| o.read_device_identification(4, 9);
        self.expect_status(&[], missing, Status::ILLEGAL_DATA_ADDRESS);
        // The same request as raw bytes of any MEI type.
        let raw = self.request(&[4, 2], |o| o.encapsulated(0x0E, 2));
        assert_eq!(raw.received().get(4..), Some(&b"\x01\x02\x05V2.11"[..]));
    }

    fn reads(&mut self, function: FunctionSpec, address: u16, quantity: u16, expected: &[u8]) {
        self.expect_data(&[], |o| o.set(function, address, quantity), expected);
    }

    fn writes(&mut self, function: FunctionSpec, address: u16, value: u16, data: &[u8]) {
        self.expect_status(data, |o| o.set(function, address, value), Status::OK);
    }

    fn registers_and_bits(&mut self) {
        let words: Vec<u8> = (7..132).flat_map(pattern).collect();
        self.reads(FunctionSpec::READ_HOLDING_REGISTERS, 7, 125, &words);
        let others: Vec<u8> = words.iter().map(|byte| !byte).collect();
        self.reads(FunctionSpec::READ_INPUT_REGISTERS, 7, 125, &others);
        let bit = |address| pattern(address)[1] >> 7;
        let coils = (0..8).fold(0, |byte, i| byte | bit(30 + i) << i);
        self.reads(FunctionSpec::READ_COILS, 30, 9, &[coils, bit(38)]);
        let inputs = [!coils, 1 - bit(38)];
        self.reads(FunctionSpec::READ_DISCRETE_INPUTS, 30, 9, &inputs);
        self.writes(FunctionSpec::WRITE_SINGLE_COIL, 30, 0xFF00, &[]);
        self.writes(FunctionSpec::WRITE_MULTIPLE_COILS, 31, 3, &[0b101]);
        self.reads(FunctionSpec::READ_COILS, 30, 4, &[0b1011]);
        self.writes(FunctionSpec::WRITE_SINGLE_REGISTER, 9, 0xBEEF, &[]);
        let data = [1, 2, 3, 4];
        self.writes(FunctionSpec::WRITE_MULTIPLE_REGISTERS, 10, 2, &data);
        self.expect_status(
            &[],
            |o| o.mask_write_register(11, 0xFF00, 0x0025),
            Status::OK,
        );
        let all = [0xBE, 0xEF, 7, 8, 3, 0x25];
        self.expect_data(&[7, 8], |o| o.read_write_registers(9, 3, 10, 1), &all);
        let absent = |o: &mut RequestState| o.set(FunctionSpec::READ_HOLDING_REGISTERS, 60000, 1);
        self.expect_status(&[], absent, Status::ILLEGAL_DATA_ADDRESS);
    }
}

fn serial(mut line: Serial<Wire, Lent, Task>) -> Requester<Serial<Wire, Lent, Task>> {
    line.settings.response_timeout = MicrosSetting::new(TIMEOUT);
    Requester::new(line)
}

#[test]
fn the_client_reads_every_response_of_a_pymodbus_server_over_rtu() {
    serial(Serial::new(Wire::new(Framing::Rtu), Lent::default())).check_every_function();
}

#[test]
fn the_client_reads_every_response_of_a_pymodbus_server_over_ascii() {
    serial(Serial::ascii(Wire::new(Framing::Ascii), Lent::default())).check_every_function();
}

#[test]
fn the_client_reads_every_response_of_a_pymodbus_server_over_tcp() {
    let mut line = Tcp::new(Wire::new(Framing::Tcp), Lent::default());
    line.settings.response_timeout = MicrosSetting::new(TIMEOUT);
    Requester::new(line).check_every_function();
}

#[test]
fn the_client_reads_every_response_of_a_pymodbus_server_over_rtu_in_tcp() {
    let wire = Wire::new(Framing::RtuOverTcp);
    let mut client: Client<Serial<Wire, Lent, Task>, Task, 4> =
        Client::over_tcp(wire, Lent::default());
    client.line.settings.response_timeout = MicrosSetting::new(TIMEOUT);
    Requester::with(client).check_every_function();
}
