//! The facade from Rust, with a port that needs no C.

use mbm::error::Status;
use mbm::frame::checksum::crc16;
use mbm::master::Master;
use mbm::port::Port;
use mbm::transaction::{Counter, Storage, COUNTERS};

/// A wire that answers every request with the same bytes.
#[derive(Default)]
struct Wire {
    now: u32,
    sent: Vec<u8>,
    reply: Vec<u8>,
    arriving: Vec<u8>,
}

impl Port for Wire {
    fn read(&mut self, bytes: &mut [u8]) -> i16 {
        let count = bytes.len().min(self.arriving.len());
        for (place, byte) in bytes.iter_mut().zip(self.arriving.drain(..count)) {
            *place = byte;
        }
        count as i16
    }

    fn write(&mut self, bytes: &[u8]) -> i16 {
        self.sent.extend_from_slice(bytes);
        self.arriving = self.reply.clone();
        bytes.len() as i16
    }

    fn micros(&mut self) -> u32 {
        self.now = self.now.wrapping_add(100);
        self.now
    }
}

struct Buffers {
    frame: [u8; 256],
    transmit: [u16; 123],
    response: [u16; 125],
    counters: [usize; COUNTERS],
}

impl Default for Buffers {
    fn default() -> Self {
        Buffers {
            frame: [0; 256],
            transmit: [0; 123],
            response: [0; 125],
            counters: [0; COUNTERS],
        }
    }
}

impl Storage for Buffers {
    fn frame(&mut self) -> &mut [u8] {
        &mut self.frame
    }
    fn transmit(&mut self) -> &mut [u16] {
        &mut self.transmit
    }
    fn response(&mut self) -> &mut [u16] {
        &mut self.response
    }
    fn frame_and_transmit(&mut self) -> (&mut [u8], &[u16]) {
        (&mut self.frame, &self.transmit)
    }
    fn frame_and_response(&mut self) -> (&[u8], &mut [u16]) {
        (&self.frame, &mut self.response)
    }
    fn count(&mut self, counter: Counter, more: u16) {
        self.counters[counter as usize] += usize::from(more);
    }
}

fn sealed(bytes: &[u8]) -> Vec<u8> {
    let mut frame = bytes.to_vec();
    frame.extend(crc16(bytes).to_bytes());
    frame
}

fn master(reply: &[u8]) -> Master<Wire, Buffers> {
    let wire = Wire {
        reply: reply.to_vec(),
        ..Wire::default()
    };
    Master::new(7, wire, Buffers::default())
}

fn finish(master: &mut Master<Wire, Buffers>) -> Status {
    for _ in 0..1_000_000 {
        match master.poll() {
            Status::PENDING => {}
            status => return status,
        }
    }
    panic!("the transaction does not end");
}

#[test]
fn registers_are_read_into_the_response_words() {
    let mut master = master(&sealed(&[7, 3, 4, 0x12, 0x34, 0x56, 0x78]));
    assert_eq!(master.read_holding_registers(0x6B, 2), Status::PENDING);
    assert_eq!(finish(&mut master), Status::OK);
    assert_eq!(master.port().sent, sealed(&[7, 3, 0, 0x6B, 0, 2]));
    assert_eq!(master.available(), 2);
    assert_eq!((master.receive(), master.receive()), (0x1234, 0x5678));
    assert_eq!(master.receive(), 0xFFFF);
}

#[test]
fn unused_bits_of_the_last_word_are_zero_whatever_the_device_sent() {
    let mut master = master(&sealed(&[7, 1, 3, 0xFF, 0xFF, 0xFF]));
    assert_eq!(master.read_coils(0, 17), Status::PENDING);
    assert_eq!(finish(&mut master), Status::OK);
    assert_eq!(
        (master.response_word(0), master.response_word(1)),
        (0xFFFF, 1)
    );
}

#[test]
fn noise_and_a_foreign_frame_are_counted_and_passed_over() {
    let mut bytes = sealed(&[8, 6, 0, 1, 0, 2]);
    bytes.extend([0, 0, 0]);
    bytes.extend(sealed(&[7, 6, 0, 1, 0, 3]));
    let mut master = master(&bytes);
    assert_eq!(master.write_single_register(1, 3), Status::PENDING);
    assert_eq!(finish(&mut master), Status::OK);
    let counters = master.storage().counters;
    assert_eq!(counters[Counter::ForeignFrames as usize], 1);
    assert_eq!(counters[Counter::Resynchronisations as usize], 1);
    assert_eq!(counters[Counter::Replies as usize], 1);
    assert_eq!(counters[Counter::BytesReceived as usize], 19);
}

#[test]
fn a_damaged_reply_look_alike_inside_a_foreign_frame_does_not_end_the_wait() {
    // The foreign payload holds 07 06, which looks like our reply's start.
    let bytes = sealed(&[8, 3, 8, 7, 6, 0, 0, 0, 0, 0, 0]);
    let mut master = master(&bytes);
    assert_eq!(master.write_single_register(1, 3), Status::PENDING);
    assert_eq!(finish(&mut master), Status::INVALID_SLAVE_ID);
}

#[test]
fn a_request_that_is_answered_on_the_second_try_succeeds_with_a_retry() {
    let mut master = master(&[]);
    master.settings().retries = 1;
    assert_eq!(master.write_single_coil(5, 1), Status::PENDING);
    while master.storage().counters[Counter::Timeouts as usize] == 0 {
        assert_eq!(master.poll(), Status::PENDING);
    }
    master.port().reply = sealed(&[7, 5, 0, 5, 0xFF, 0]);
    assert_eq!(finish(&mut master), Status::OK);
    assert_eq!(master.storage().counters[Counter::Requests as usize], 2);
}
