//! The master, used from Rust with a port that is written in Rust: its requests, and how it reads
//! replies.

mod common;
#[path = "common/vectors.rs"]
mod vectors;

use common::frame::sealed;
use common::master::{frame, Call, TestMaster};
use mbm::engine::{Buffers, Counter};
use mbm::error::{Error, Status};
use mbm::frame::rtu;
use mbm::master::Master;
use mbm::pdu::length::Length;
use mbm::pdu::request::Request;
use mbm::port::Port;
use vectors::{right_pdus, Direction};

/// A wire on which the same bytes arrive after every request.
#[derive(Default)]
struct Wire {
    now: u32,
    sent: Vec<u8>,
    reply: Vec<u8>,
    arriving: Vec<u8>,
    idled: u32,
}

impl Port for Wire {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, mbm::Error> {
        let count = bytes.len().min(self.arriving.len());
        for (place, byte) in bytes.iter_mut().zip(self.arriving.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, mbm::Error> {
        self.sent.extend_from_slice(bytes);
        self.arriving = self.reply.clone();
        Ok(bytes.len())
    }

    fn micros(&mut self) -> u32 {
        self.now = self.now.wrapping_add(100);
        self.now
    }

    fn idle(&mut self, micros: u32) {
        self.idled += 1;
        self.now = self.now.wrapping_add(micros);
    }
}

type Lent = Buffers<[u8; 256], [u16; 125], [u16; 123]>;

fn master(reply: &[u8]) -> Master<Wire, Lent> {
    let wire = Wire {
        reply: reply.to_vec(),
        ..Wire::default()
    };
    Master::new(7, wire, Buffers::new([0; 256], [0; 125], [0; 123]))
}

fn finish(master: &mut Master<Wire, Lent>) -> Status {
    for _ in 0..1_000_000 {
        if master.poll().is_ready() {
            return master.status();
        }
    }
    panic!("the transaction does not end");
}

#[test]
fn registers_are_read_into_the_response_words() {
    let mut master = master(&sealed(&[7, 3, 4, 0x12, 0x34, 0x56, 0x78]));
    assert_eq!(master.start_read_holding_registers(0x6B, 2), Ok(()));
    assert_eq!(finish(&mut master), Status::OK);
    assert_eq!(master.port().sent, sealed(&[7, 3, 0, 0x6B, 0, 2]));
    assert_eq!(master.response(), [0x1234, 0x5678]);
}

#[test]
fn unused_bits_of_the_last_word_are_zero_even_if_the_device_sets_them() {
    let mut master = master(&sealed(&[7, 1, 3, 0xFF, 0xFF, 0xFF]));
    assert_eq!(master.start_read_coils(0, 17), Ok(()));
    assert_eq!(finish(&mut master), Status::OK);
    assert_eq!(master.response(), [0xFFFF, 1]);
    assert!(master.response_bits().eq([true; 17]));
}

#[test]
fn noise_and_a_frame_of_another_unit_are_counted_and_skipped() {
    let mut bytes = sealed(&[8, 6, 0, 1, 0, 2]);
    bytes.extend([0, 0, 0]);
    bytes.extend(sealed(&[7, 6, 0, 1, 0, 3]));
    let mut master = master(&bytes);
    assert_eq!(master.start_write_single_register(1, 3), Ok(()));
    assert_eq!(finish(&mut master), Status::OK);
    let counters = master.storage().counters;
    assert_eq!(counters[Counter::ForeignFrames as usize], 1);
    assert_eq!(counters[Counter::Resynchronisations as usize], 1);
    assert_eq!(counters[Counter::Replies as usize], 1);
    assert_eq!(counters[Counter::BytesReceived as usize], 19);
}

#[test]
fn data_that_look_like_a_damaged_reply_inside_a_frame_of_another_unit_do_not_end_the_wait() {
    // The frame of unit 8 contains 07 06, which looks like the start of the expected reply.
    let bytes = sealed(&[8, 3, 8, 7, 6, 0, 0, 0, 0, 0, 0]);
    let mut master = master(&bytes);
    assert_eq!(master.start_write_single_register(1, 3), Ok(()));
    assert_eq!(finish(&mut master), Status::INVALID_SLAVE_ID);
}

#[test]
fn a_request_that_is_answered_after_one_retry_succeeds() {
    let mut master = master(&[]);
    master.settings().retries = 1;
    assert_eq!(master.start_write_single_coil(5, true), Ok(()));
    while master.storage().counters[Counter::Timeouts as usize] == 0 {
        assert!(master.poll().is_pending());
    }
    master.port().reply = sealed(&[7, 5, 0, 5, 0xFF, 0]);
    assert_eq!(finish(&mut master), Status::OK);
    assert_eq!(master.storage().counters[Counter::Requests as usize], 2);
}

#[test]
fn a_reply_at_the_end_of_the_buffer_is_not_taken_for_an_echo() {
    // The request's frame of 15 bytes fills the buffer, and is longer than the reply.
    for registers in [1, 2] {
        let data = &[0, 1, 0, 2][..2 * registers];
        let reply = sealed(&[&[7, 0x17, data.len() as u8], data].concat());
        let mut bytes = vec![0; 15 - reply.len()];
        bytes.extend(reply);
        let wire = Wire {
            reply: bytes,
            ..Wire::default()
        };
        let buffers = Buffers::new([0; 15], [0; 125], [0; 123]);
        let mut master = Master::new(7, wire, buffers);
        // The master expects an echo, but none arrives.
        master.settings().echo_discard = true;
        let read = registers as u16;
        let started = master.start_read_write_multiple_registers(0x6B, read, 1, &[9]);
        assert_eq!(started, Ok(()));
        while master.poll().is_pending() {}
        assert_eq!(master.status(), Status::OK);
        assert_eq!(master.response()[0], 1);
    }
}

/// A wire from which a slow program takes one byte after the other, as long as the next one arrives
/// meanwhile: one poll receives the whole reply.
struct SlowWire {
    wire: Wire,
    received: u32,
    silence: u32,
}

impl Port for SlowWire {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, mbm::Error> {
        let count = self.wire.read(&mut bytes[..1])?;
        if count > 0 {
            self.wire.now += 200;
            self.received = self.wire.now;
        }
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, mbm::Error> {
        self.silence = self.wire.now - self.received;
        self.wire.write(bytes)
    }

    fn micros(&mut self) -> u32 {
        self.wire.micros()
    }
}

#[test]
fn the_gap_counts_from_the_last_byte_although_one_poll_receives_them_all() {
    let wire = Wire {
        reply: sealed(&[
            7, 3, 20, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20,
        ]),
        ..Wire::default()
    };
    let port = SlowWire {
        wire,
        received: 0,
        silence: 0,
    };
    let mut master = Master::new(7, port, Buffers::new([0; 256], [0; 125], [0; 123]));
    for _ in 0..2 {
        assert_eq!(master.start_read_holding_registers(0, 10), Ok(()));
        while !master.poll().is_ready() {}
        assert_eq!(master.status(), Status::OK);
    }
    assert!((4000..4400).contains(&master.port().silence));
}

#[test]
fn a_call_that_waits_fills_a_slice_or_an_array_and_lets_the_port_idle() {
    let reply = sealed(&[7, 3, 4, 0x12, 0x34, 0x56, 0x78]);
    let mut master = master(&reply);
    assert_eq!(master.holding_registers(0x6B), Ok([0x1234, 0x5678]));
    assert_eq!(master.port().sent, sealed(&[7, 3, 0, 0x6B, 0, 2]));
    let mut words = [0; 2];
    assert_eq!(master.read_holding_registers(0x6B, &mut words), Ok(()));
    assert_eq!(words, [0x1234, 0x5678]);
    assert!(master.port().idled > 0);
}

#[test]
fn a_reply_with_fewer_data_than_were_requested_fills_nothing_even_of_a_lenient_master() {
    let reply = sealed(&[7, 3, 2, 0x12, 0x34]);
    let mut master = master(&reply);
    master.set_lenient(true);
    let mut words = [9; 2];
    assert_eq!(
        master.read_holding_registers(0x6B, &mut words),
        Err(Error::MalformedReply)
    );
    assert_eq!(words, [9; 2]);
    // A program that wants what there is starts the request.
    assert_eq!(master.start_read_holding_registers(0x6B, 2), Ok(()));
    assert_eq!(finish(&mut master), Status::OK);
    assert_eq!(master.response(), [0x1234]);
}

// --- the master's requests compared with those of `pdu::request`, and how the master reads replies
// ---

/// Calls the master's function `function`, and delivers `frame` as the reply. Returns the
/// status and the response words.
fn reply(unit: u8, function: u8, words: &[u16], frame: &[u8]) -> (Status, Vec<u16>) {
    let mut master = TestMaster::<false>::new(unit, 256);
    let status = master.request(Call::new(function, words), frame, 256, 100);
    (status, master.words())
}

/// The words that are sent as these bytes.
fn words(data: &[u8], join: impl Fn([u8; 2]) -> u16) -> Vec<u16> {
    let pairs = data
        .chunks(2)
        .map(|pair| [pair[0], *pair.get(1).unwrap_or(&0)]);
    pairs.map(join).collect()
}

/// The call that sends the same request, and the words to send; `None` if the master has no
/// such function.
fn call(request: &Request) -> Option<(Call, Vec<u16>)> {
    let (function, arguments, sent) = match *request {
        Request::ReadBits {
            function,
            address,
            quantity,
        }
        | Request::ReadRegisters {
            function,
            address,
            quantity,
        } => (function, vec![address, quantity], vec![]),
        Request::WriteSingleCoil { address, on } => (5, vec![address, u16::from(on)], vec![]),
        Request::WriteSingleRegister { address, value } => (6, vec![address, value], vec![]),
        Request::WriteMultipleCoils {
            address,
            quantity,
            data,
        } => {
            let sent = words(data, u16::from_le_bytes);
            (0x0F, vec![address, quantity], sent)
        }
        Request::WriteMultipleRegisters {
            address,
            quantity,
            data,
        } => {
            let sent = words(data, u16::from_be_bytes);
            (0x10, vec![address, quantity], sent)
        }
        Request::MaskWriteRegister {
            address,
            and_mask,
            or_mask,
        } => (0x16, vec![address, and_mask, or_mask], vec![]),
        Request::ReadWriteMultipleRegisters {
            read_address,
            read_quantity,
            write_address,
            write_quantity,
            data,
        } => {
            let arguments = vec![read_address, read_quantity, write_address, write_quantity];
            (0x17, arguments, words(data, u16::from_be_bytes))
        }
        _ => return None,
    };
    Some((Call::new(function, &arguments), sent))
}

/// Builds a request. Returns the status that refuses it, if any, and checks that the master
/// refuses it as well, before it is sent.
fn built(call: Call) -> Result<(), Error> {
    let built = call.query().map(drop);
    let mut master = TestMaster::<false>::new(17, 256);
    let expected = built.map_err(|exception| match exception {
        Error::IllegalDataAddress => Error::InvalidAddress,
        Error::IllegalDataValue => Error::InvalidQuantity,
        other => other,
    });
    assert_eq!(master.start(call, &[]), expected, "{call:?}");
    built
}

#[test]
fn the_master_sends_the_same_bytes_as_the_encoder_of_requests() {
    let mut compared = 0;
    for vector in right_pdus() {
        if vector.direction == Direction::Request {
            let request = Request::parse(&vector.bytes).unwrap();
            let Some((call, words)) = call(&request) else {
                continue;
            };
            let sent = frame(17, call, &words);
            let mut buffer = [0; 256];
            let length = rtu::emit(&mut buffer, 17, |pdu| request.emit(pdu));
            assert_eq!(sent, buffer[..length.unwrap()], "{}", vector.name);
            assert_eq!(sent[1..sent.len() - 2], vector.bytes, "{}", vector.name);
            compared += 1;
        }
    }
    assert!(compared > 30, "{compared}");
}

#[test]
fn the_master_expects_a_response_of_the_length_that_follows_from_the_request() {
    for vector in right_pdus() {
        if vector.direction == Direction::Request {
            let request = Request::parse(&vector.bytes).unwrap();
            if let Some((call, _)) = call(&request) {
                let length = usize::from(call.query().unwrap().response_length());
                assert_eq!(request.response_length(&[]), Length::Exactly(length));
            }
        }
    }
}

#[test]
fn the_master_refuses_with_the_same_status_as_the_encoder_of_requests() {
    let data = [0; 300];
    let sizes = [
        0, 1, 2, 121, 122, 123, 124, 125, 126, 1968, 1969, 2000, 2001,
    ];
    let addresses = [0, 1, 63_535, 65_410, 65_534, 65_535];
    let places = || {
        let with_sizes = move |address| sizes.map(|quantity| (address, quantity));
        addresses.into_iter().flat_map(with_sizes)
    };
    let same = |request: Request| {
        let (call, _) = call(&request).unwrap();
        let emitted = request.emit(&mut [0; 300]);
        assert_eq!(built(call), emitted.map(drop), "{request:?}");
    };
    for (address, quantity) in places() {
        let bytes = 2 * usize::from(quantity);
        for function in [1, 2] {
            same(Request::ReadBits {
                function,
                address,
                quantity,
            });
        }
        for function in [3, 4] {
            same(Request::ReadRegisters {
                function,
                address,
                quantity,
            });
        }
        same(Request::WriteMultipleCoils {
            address,
            quantity,
            data: &data[..usize::from(quantity).div_ceil(8)],
        });
        same(Request::WriteMultipleRegisters {
            address,
            quantity,
            data: &data[..bytes.min(300)],
        });
    }
}

#[test]
fn the_master_reports_a_fault_of_the_write_before_one_of_the_read() {
    let both = |read: (u16, u16), write: (u16, u16)| {
        let data = &[0; 500][..2 * usize::from(write.1)];
        let request = Request::ReadWriteMultipleRegisters {
            read_address: read.0,
            read_quantity: read.1,
            write_address: write.0,
            write_quantity: write.1,
            data,
        };
        let (call, _) = call(&request).unwrap();
        (built(call), request.emit(&mut [0; 600]).map(drop))
    };
    let address = Err(Error::IllegalDataAddress);
    let value = Err(Error::IllegalDataValue);
    let (right, past, many) = ((0, 1), (0xFFFF, 2), (0, 126));
    assert_eq!(both(right, right), (Ok(()), Ok(())));
    assert_eq!(both(past, right), (address, address));
    assert_eq!(both(right, past), (address, address));
    assert_eq!(both(past, past), (address, address));
    assert_eq!(both(many, right), (value, value));
    assert_eq!(both(right, many), (value, value));
    assert_eq!(both(past, many), (value, value));
    // A server checks both quantities before the addresses.
    assert_eq!(both(many, past), (address, value));
}

#[test]
fn a_reply_frame_with_a_right_crc_is_read() {
    let read = reply(1, 3, &[0x6B, 1], &[1, 3, 2, 0xCD, 0x6B, 0xAD, 0x3B]);
    assert_eq!(read, (Status::OK, vec![0xCD6B]));
    let read = reply(1, 4, &[0x6B, 1], &[1, 4, 2, 0xCD, 0x6B, 0xAC, 0x4F]);
    assert_eq!(read, (Status::OK, vec![0xCD6B]));
    let read = reply(3, 1, &[0, 16], &[3, 1, 2, 0xCD, 0x6B, 0xD5, 0x43]);
    assert_eq!(read, (Status::OK, vec![0x6BCD]));
    let read = reply(3, 2, &[0, 16], &[3, 2, 2, 0xCD, 0x6B, 0xD5, 0x07]);
    assert_eq!(read, (Status::OK, vec![0x6BCD]));
    let both = [0x0410, 1, 0x0112, 2];
    let read = reply(0x11, 0x17, &both, &[0x11, 0x17, 2, 0xCD, 0x6B, 0x69, 0x08]);
    assert_eq!(read, (Status::OK, vec![0xCD6B]));
    let coils = [0x11, 0x0F, 4, 0x10, 0, 3, 0x17, 0xAF];
    let wrote = reply(0x11, 0x0F, &[0x0410, 3], &coils);
    assert_eq!(wrote, (Status::OK, vec![]));
    let words = [0x11, 0x10, 4, 0x10, 0, 3, 0x82, 0x6D];
    let wrote = reply(0x11, 0x10, &[0x0410, 3], &words);
    assert_eq!(wrote, (Status::OK, vec![]));
    let wrote = reply(3, 5, &[2, 1], &[3, 5, 0, 2, 0xFF, 0, 0x2C, 0x18]);
    assert_eq!(wrote, (Status::OK, vec![]));
    let refused = reply(0x0A, 1, &[0, 8], &[0x0A, 0x81, 2, 0xB0, 0x53]);
    assert_eq!(refused, (Status::ILLEGAL_DATA_ADDRESS, vec![]));
}

#[test]
fn a_write_reply_with_another_address_or_value_is_malformed() {
    for (at, wrong) in [(1, 1), (2, 0x6C), (3, 0), (4, 0)] {
        let mut pdu = [6, 0, 0x6B, 1, 1];
        pdu[at] = wrong;
        let frame = sealed(&[&[9], &pdu[..]].concat());
        let mut master = TestMaster::<false>::new(9, 256);
        let status = master.request(Call::new(6, &[0x6B, 0x0101]), &frame, 256, 100);
        assert_eq!(status, Status::MALFORMED_REPLY);
        let foreign = master.0.storage().counters[Counter::ForeignFrames as usize];
        assert_eq!(foreign, 1);
    }
}

#[test]
fn exception_codes_of_0_and_from_80_are_malformed() {
    for code in 0..=255 {
        let expected = match code {
            1..=0x7F => Status::from_code(code),
            _ => Status::MALFORMED_REPLY,
        };
        let mut master = TestMaster::<false>::new(9, 256);
        let frame = sealed(&[9, 0x86, code]);
        let status = master.request(Call::new(6, &[1, 2]), &frame, 256, 100);
        assert_eq!(status, expected);
        assert_eq!(master.0.exception_code(), code);
    }
}

#[test]
fn quantities_and_addresses_outside_the_standard_are_refused() {
    use Error as S;
    let value = Err(S::IllegalDataValue);
    let address = Err(S::IllegalDataAddress);
    type Build = fn(u16, u16) -> Call;
    let calls: [(u16, Build); 8] = [
        (2000, |a, q| Call::new(0x01, &[a, q])),
        (2000, |a, q| Call::new(0x02, &[a, q])),
        (125, |a, q| Call::new(0x03, &[a, q])),
        (125, |a, q| Call::new(0x04, &[a, q])),
        (1968, |a, q| Call::new(0x0F, &[a, q])),
        (123, |a, q| Call::new(0x10, &[a, q])),
        (121, |a, q| Call::new(0x17, &[0, 1, a, q])),
        (125, |a, q| Call::new(0x17, &[a, q, 0, 1])),
    ];
    for (most, call) in calls {
        let build = |a, q| built(call(a, q));
        assert_eq!(build(0, 0), value);
        assert_eq!(build(0, 1), Ok(()));
        assert_eq!(build(0, most), Ok(()));
        assert_eq!(build(0, most + 1), value);
        assert_eq!(build(0, 0xFFFF), value);
        assert_eq!(build(0xFFFF, 1), Ok(()));
        assert_eq!(build(0xFFFF, 2), address);
        assert_eq!(build(0u16.wrapping_sub(most), most), Ok(()));
    }
}
