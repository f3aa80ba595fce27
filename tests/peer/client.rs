//! The client that never waits, against a live pymodbus server: TCP, RTU over TCP,
//! and RTU and ASCII over a pseudo-terminal; what libmodbus lacks, and the rest too.

#[path = "../common/task.rs"]
mod task;

use crate::served::{pattern, Served, PATIENCE};
use crate::UNIT;
use mbm::client::{Client, Line, Serial, Tcp};
use mbm::error::Status;
use mbm::frame::Framing;
use mbm::pdu::custom::Rule;
use mbm::pdu::outline::{Form, Outline};
use mbm::port::Port;
use std::collections::VecDeque;
use std::io::Write;
use std::time::{Duration, Instant};
use task::{Lent, Task};

/// In microseconds; what a malformed response takes to be told.
const TIMEOUT: u32 = 10_000_000;

/// The server's line as a port, with a clock.
struct Wire {
    served: Served,
    pending: VecDeque<u8>,
    begun: Instant,
}

impl Wire {
    fn new(framing: Framing) -> Wire {
        Wire {
            served: Served::new(framing),
            pending: VecDeque::new(),
            begun: Instant::now(),
        }
    }
}

impl Port for Wire {
    fn read(&mut self, bytes: &mut [u8]) -> i16 {
        self.pending
            .extend(self.served.arrived.try_iter().flatten());
        let count = bytes.len().min(self.pending.len());
        for (place, byte) in bytes.iter_mut().zip(self.pending.drain(..count)) {
            *place = byte;
        }
        count as i16
    }

    fn write(&mut self, bytes: &[u8]) -> i16 {
        self.served.out.write_all(bytes).expect("it is sent");
        bytes.len() as i16
    }

    fn micros(&mut self) -> u32 {
        self.begun.elapsed().as_micros() as u32
    }
}

/// A client and the clock that it is polled with.
struct Asker<L> {
    client: Client<L, Task, 4>,
    begun: Instant,
}

impl<L: Line<Task>> Asker<L> {
    fn new(line: L) -> Self {
        Self::with(Client::new(line))
    }

    fn with(client: Client<L, Task, 4>) -> Self {
        Asker {
            client,
            begun: Instant::now(),
        }
    }

    /// Asks, and waits for the end.
    fn ask(&mut self, data: &[u8], build: impl FnOnce(&mut Outline) -> Status) -> Task {
        assert!(self.client.queue(Task::new(UNIT, 1, data, build)).is_ok());
        let until = Instant::now() + PATIENCE;
        while Instant::now() < until {
            let now = self.begun.elapsed().as_micros() as u32;
            if let Some(task) = self.client.poll(now, true) {
                return task;
            }
            let delay = self.client.poll_delay(now).clamp(50, 1000);
            std::thread::sleep(Duration::from_micros(delay.into()));
        }
        panic!("the request did not end");
    }

    fn brings(&mut self, data: &[u8], build: impl FnOnce(&mut Outline) -> Status, expected: &[u8]) {
        let task = self.ask(data, build);
        assert_eq!(
            task.ticket.status,
            Status::OK,
            "{:02X?}",
            task.ticket.outline
        );
        assert_eq!(task.received(), expected, "{:02X?}", task.ticket.outline);
    }

    fn ends(&mut self, data: &[u8], build: impl FnOnce(&mut Outline) -> Status, status: Status) {
        let task = self.ask(data, build);
        assert_eq!(task.ticket.status, status, "{:02X?}", task.ticket.outline);
    }

    fn every_function(mut self) {
        self.what_libmodbus_lacks();
        self.registers_and_bits();
    }

    fn what_libmodbus_lacks(&mut self) {
        self.ends(
            &[],
            |o| o.set(Form::READ_EXCEPTION_STATUS, 0, 0),
            Status::OK,
        );
        let query = [0xA5, 0x37];
        self.brings(&query, |o| o.diagnostics(0, 1), &query);
        for sub_function in [
            1, 2, 0x0A, 0x0B, 0x0C, 0x0D, 0x0E, 0x0F, 0x10, 0x11, 0x12, 0x14,
        ] {
            self.ends(&[0, 0], |o| o.diagnostics(sub_function, 1), Status::OK);
        }
        let counter = self.ask(&[], |o| o.set(Form::GET_COMM_EVENT_COUNTER, 0, 0));
        assert_eq!(counter.received().get(..2), Some(&[0, 0][..]));
        let log = self.ask(&[], |o| o.set(Form::GET_COMM_EVENT_LOG, 0, 0));
        assert_eq!(log.ticket.status, Status::OK);
        assert!(log.received().len() >= 6);
        let id = b"Vendor-PC-V2.11\xFF";
        self.brings(&[], |o| o.set(Form::REPORT_SERVER_ID, 0, 0), id);
        // It has one record of twenty bytes, whatever is asked for.
        let record = b"SERVER DUMMY RECORD.";
        self.brings(&[], |o| o.read_file_record(4, 1, 10), record);
        let group = |records| [6, 0, 4, 0, 1, 0, records];
        let answer = [&[21, 6][..], record].concat();
        let (groups, answers) = ([group(10); 2].concat(), [&answer[..]; 2].concat());
        self.brings(&groups, |o| o.read_file_records(14), &answers);
        let others = [group(10), group(2)].concat();
        let malformed = Status::MALFORMED_REPLY;
        self.ends(&others, |o| o.read_file_records(14), malformed);
        let data = [0xAF, 4, 0xBE, 0x10];
        self.ends(&data, |o| o.write_file_record(4, 7, 2), Status::OK);
        let written = [6, 0, 4, 0, 7, 0, 1, 0xAF, 4];
        self.ends(&written, |o| o.write_file_records(9), Status::OK);
        let queue = [0, 0, 0, 1, 0, 2, 0, 3];
        self.brings(&[], |o| o.set(Form::READ_FIFO_QUEUE, 0x04DE, 0), &queue);
        self.identification();
        let rule = Rule::Counted(1, 0);
        self.brings(&[3, 7, 8, 9], |o| o.custom(0x41, 4, rule), &[3, 9, 8, 7]);
    }

    fn identification(&mut self) {
        let basic = self.ask(&[], |o| o.read_device_identification(1, 0));
        let objects = b"\x00\x06Vendor\x01\x02PC\x02\x05V2.11";
        assert_eq!(basic.received().get(1..4), Some(&[0, 0, 3][..]));
        assert_eq!(basic.received().get(4..), Some(&objects[..]));
        let one = self.ask(&[], |o| o.read_device_identification(4, 2));
        assert_eq!(one.received().get(3..), Some(&b"\x01\x02\x05V2.11"[..]));
        let missing = |o: &mut Outline| o.read_device_identification(4, 9);
        self.ends(&[], missing, Status::ILLEGAL_DATA_ADDRESS);
        // The same by the bytes, as any MEI type.
        let raw = self.ask(&[4, 2], |o| o.encapsulated(0x0E, 2));
        assert_eq!(raw.received().get(4..), Some(&b"\x01\x02\x05V2.11"[..]));
    }

    fn registers_and_bits(&mut self) {
        let words: Vec<u8> = (7..132).flat_map(pattern).collect();
        self.brings(&[], |o| o.set(Form::READ_HOLDING_REGISTERS, 7, 125), &words);
        let others: Vec<u8> = words.iter().map(|byte| !byte).collect();
        self.brings(&[], |o| o.set(Form::READ_INPUT_REGISTERS, 7, 125), &others);
        let bit = |address| pattern(address)[1] >> 7;
        let coils = (0..8).fold(0, |byte, i| byte | bit(30 + i) << i);
        self.brings(&[], |o| o.set(Form::READ_COILS, 30, 9), &[coils, bit(38)]);
        let inputs = [!coils, 1 - bit(38)];
        self.brings(&[], |o| o.set(Form::READ_DISCRETE_INPUTS, 30, 9), &inputs);
        self.ends(
            &[],
            |o| o.set(Form::WRITE_SINGLE_COIL, 30, 0xFF00),
            Status::OK,
        );
        self.ends(
            &[0b101],
            |o| o.set(Form::WRITE_MULTIPLE_COILS, 31, 3),
            Status::OK,
        );
        self.brings(&[], |o| o.set(Form::READ_COILS, 30, 4), &[0b1011]);
        self.ends(
            &[],
            |o| o.set(Form::WRITE_SINGLE_REGISTER, 9, 0xBEEF),
            Status::OK,
        );
        let data = [1, 2, 3, 4];
        self.ends(
            &data,
            |o| o.set(Form::WRITE_MULTIPLE_REGISTERS, 10, 2),
            Status::OK,
        );
        self.ends(
            &[],
            |o| o.mask_write_register(11, 0xFF00, 0x0025),
            Status::OK,
        );
        let all = [0xBE, 0xEF, 7, 8, 3, 0x25];
        self.brings(&[7, 8], |o| o.read_write_registers(9, 3, 10, 1), &all);
        let absent = |o: &mut Outline| o.set(Form::READ_HOLDING_REGISTERS, 60000, 1);
        self.ends(&[], absent, Status::ILLEGAL_DATA_ADDRESS);
    }
}

fn serial(mut line: Serial<Wire, Lent, Task>) -> Asker<Serial<Wire, Lent, Task>> {
    line.engine.settings.response_timeout = TIMEOUT;
    Asker::new(line)
}

#[test]
fn the_client_asks_pymodbus_for_every_function_over_rtu() {
    serial(Serial::new(Wire::new(Framing::Rtu), Lent::default())).every_function();
}

#[test]
fn the_client_asks_pymodbus_for_every_function_over_ascii() {
    serial(Serial::ascii(Wire::new(Framing::Ascii), Lent::default())).every_function();
}

#[test]
fn the_client_asks_pymodbus_for_every_function_over_tcp() {
    let mut line = Tcp::new(Wire::new(Framing::Tcp), Lent::default());
    line.settings.response_timeout = TIMEOUT;
    Asker::new(line).every_function();
}

#[test]
fn the_client_asks_pymodbus_for_every_function_over_rtu_in_tcp() {
    let wire = Wire::new(Framing::RtuOverTcp);
    let mut client: Client<Serial<Wire, Lent, Task>, Task, 4> =
        Client::over_tcp(wire, Lent::default());
    client.line.engine.settings.response_timeout = TIMEOUT;
    Asker::with(client).every_function();
}
