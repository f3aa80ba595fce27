//! The master, used from Rust with a port that is written in Rust.

#[path = "common/frame.rs"]
mod frame;

use frame::sealed;
use mbm::engine::Buffers;
use mbm::engine::Counter;
use mbm::error::{Error, Status};
use mbm::master::Master;
use mbm::port::Port;

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
