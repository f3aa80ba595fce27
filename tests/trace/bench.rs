//! A trace before a port in memory, and the records that it hands out.

use mbm::error::Status;
use mbm::frame::{ascii, Framing};
use mbm::packet::PduKind;
use mbm::pdu::custom::Function;
use mbm::port::Port;
use mbm::trace::{Direction, Observer, Record, Trace};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

/// The port of a test: bytes to be read, how many bytes each write accepts, and a clock.
#[derive(Default)]
pub struct Wire {
    pub arriving: VecDeque<u8>,
    /// How many bytes the next writes accept; without an entry all of them.
    pub accepts: VecDeque<usize>,
    pub now: u32,
    pub is_lost: bool,
    pub flushed: bool,
    pub calls: Vec<&'static str>,
}

pub type Shared = Rc<RefCell<Wire>>;

pub struct TestPort(pub Shared);

impl Port for TestPort {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, mbm::Error> {
        let mut wire = self.0.borrow_mut();
        if wire.is_lost {
            return Err(mbm::Error::LinkLost);
        }
        let count = bytes.len().min(wire.arriving.len());
        for (place, byte) in bytes.iter_mut().zip(wire.arriving.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, mbm::Error> {
        let mut wire = self.0.borrow_mut();
        if wire.is_lost {
            return Err(mbm::Error::LinkLost);
        }
        let accepted = wire.accepts.pop_front().unwrap_or(usize::MAX);
        Ok(accepted.min(bytes.len()))
    }

    fn micros(&mut self) -> u32 {
        self.0.borrow().now
    }

    fn flush(&mut self) -> bool {
        let mut wire = self.0.borrow_mut();
        wire.calls.push("flush");
        wire.flushed
    }

    fn pre_transmission(&mut self) {
        self.0.borrow_mut().calls.push("pre");
    }

    fn post_transmission(&mut self) {
        self.0.borrow_mut().calls.push("post");
    }
}

/// A record that outlives its bytes.
#[derive(Clone, PartialEq, Debug)]
pub struct Kept {
    pub direction: Direction,
    pub kind: PduKind,
    pub status: Status,
    pub time: u32,
    pub bytes: Vec<u8>,
}

#[derive(Default)]
pub struct Keeper {
    pub records: Rc<RefCell<Vec<Kept>>>,
    pub functions: Vec<Function>,
}

impl Observer for Keeper {
    fn frame(&mut self, record: &Record<'_>) {
        self.records.borrow_mut().push(Kept {
            direction: record.direction,
            kind: record.kind,
            status: record.status,
            time: record.time,
            bytes: record.bytes.to_vec(),
        });
    }

    fn declaration(&self, code: u8) -> Option<Function> {
        self.functions
            .iter()
            .find(|function| function.code == code)
            .copied()
    }
}

/// A trace, its wire, and the records that it has handed out.
pub struct Bench {
    pub wire: Shared,
    pub records: Rc<RefCell<Vec<Kept>>>,
    pub trace: Trace<TestPort, Vec<u8>, Keeper>,
}

impl Bench {
    pub fn new(framing: Framing, sends: PduKind) -> Bench {
        Bench::with_buffer(framing, sends, 2 * framing.max_frame())
    }

    pub fn with_buffer(framing: Framing, sends: PduKind, size: usize) -> Bench {
        let wire = Shared::default();
        let keeper = Keeper::default();
        let records = keeper.records.clone();
        let port = TestPort(wire.clone());
        let trace = Trace::new(port, framing, sends, ascii::END, vec![0; size], keeper);
        Bench {
            wire,
            records,
            trace,
        }
    }

    /// Lets bytes arrive, and reads as a master does: until nothing is left.
    pub fn receive(&mut self, bytes: &[u8]) {
        self.wire.borrow_mut().arriving.extend(bytes);
        let mut place = [0; 64];
        while matches!(self.trace.read(&mut place), Ok(1..)) {}
    }

    /// Writes a frame as a master does: the rest of it again and again, until all is accepted.
    pub fn send(&mut self, frame: &[u8]) {
        let mut left = frame;
        self.trace.pre_transmission();
        while !left.is_empty() {
            let count = self.trace.write(left).unwrap();
            left = &left[count..];
        }
        self.trace.post_transmission();
    }

    pub fn pass(&mut self, micros: u32) {
        let mut wire = self.wire.borrow_mut();
        wire.now = wire.now.wrapping_add(micros);
    }

    pub fn taken(&mut self) -> Vec<Kept> {
        self.records.take()
    }
}

pub fn frame(framing: Framing, pdu: &[u8]) -> Vec<u8> {
    crate::frame::framed(framing, 7, 17, pdu)
}

pub fn record(
    direction: Direction,
    kind: PduKind,
    status: Status,
    time: u32,
    bytes: &[u8],
) -> Kept {
    Kept {
        direction,
        kind,
        status,
        time,
        bytes: bytes.to_vec(),
    }
}

pub const ALL: [Framing; 4] = [
    Framing::Rtu,
    Framing::Ascii,
    Framing::Tcp,
    Framing::RtuOverTcp,
];

pub const READ: &[u8] = &[3, 0, 107, 0, 3];
pub const REPLY: &[u8] = &[3, 6, 2, 43, 0, 0, 0, 100];
