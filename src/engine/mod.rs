//! One request and its reply on a serial line, moved on by `poll`: of the master, and of
//! the client, whose requests bring their framing along (see `request`).
//!
//! A reply is found, not assumed: noise, frames of other units, late replies and a
//! local echo in front of it cost nothing but their own time (see `search`).
//!
//! What RTU cannot tell apart: a late reply of the same unit, function and
//! length to an earlier request, or a late exception to the same function,
//! looks like the reply. Two rules keep such a reply from being delivered. After
//! a request without a right reply, the line is left alone for the quiet time
//! before the next request. And the next reply of that unit is on probation (see
//! `receive`).
//!
//! A microcontroller's compiler is kept from inlining the steps: each has few
//! values in use at a time, so they stay in registers, and the code is small.

pub mod ascii;
mod lenient;
mod plain;
mod poll;
mod receive;
mod request;
mod search;
mod seen;
mod send;
mod settings;
mod storage;

pub use request::{Request, Verdict};
pub use seen::Seen;
pub use settings::Settings;
pub use storage::{Buffers, Count, Counter, Frame, Storage, Words, COUNTERS};

use crate::error::Status;
use crate::frame::checksum::Crc16;

/// The unit that every slave listens to (serial line guide 2.2).
pub const BROADCAST: u8 = 0;

/// Where a request stands, in this order.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Hash, Debug)]
#[repr(u8)]
enum Phase {
    /// There is none.
    Idle,
    /// Waits for the line to be silent.
    Gap,
    /// Is handed to the port; the driver is on.
    Send,
    /// Waits for the port to drain; the driver is on.
    Flush,
    /// The driver is held on a little longer.
    Hold,
    /// Waits for the reply.
    Reply,
    /// The slaves carry out a broadcast.
    Turnaround,
}

/// Whether the reply to the request under way may be a late one.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
#[repr(u8)]
enum Probation {
    /// It may not.
    Off,
    /// It may.
    On,
    /// It may, and one was held.
    Held,
    /// A deviating reply has come (see `lenient`).
    Deviating,
}

/// A function that waits for the reply.
pub type Receive<E> = fn(&mut E) -> Status;

/// One request and its reply, over the port and in the storage it was given.
// In this order, small fields first: what lies far from the start of an object
// costs a Cortex-M0 and an AVR an instruction more at each access.
#[derive(Clone, Hash, Debug)]
#[repr(C)]
pub struct Engine<P, S: Storage, Q> {
    phase: Phase,
    /// The phase began with the last poll; its time is that of the next.
    stamp: bool,
    /// The last poll found nothing to do.
    waiting: bool,
    /// Whom the request is for.
    pub(crate) unit: u8,
    retries: u8,
    /// The exception code of the last reply; 0 if it was none.
    pub(crate) exception: u8,
    /// See [`Request::reply_length`].
    length: S::Count,
    /// Bytes in the frame buffer.
    end: S::Count,
    /// How many of these were sent, or taken into the CRC.
    done: S::Count,
    /// How many bytes the candidate at the front of the buffer needs at least; of a reply
    /// that was found, the length of its frame.
    least: S::Count,
    /// Bytes of a held reply, or of what may become a deviating one (see `lenient`), which
    /// the storage has set aside.
    pub(crate) held: S::Count,
    /// Whether the next reply may be a late one.
    probation: Probation,
    /// The unit that did not answer its last request; 0 if every unit did.
    late_unit: u8,
    /// The last request went without a right reply, which may still come.
    late: bool,
    /// The request itself is expected to come back first.
    pub(crate) echo: bool,
    /// Nothing has arrived since the bytes were last looked through.
    skimmed: bool,
    /// The most telling thing that was passed over.
    seen: Seen,
    /// Frames with a right CRC that were passed over.
    foreign: u8,
    /// Bytes passed over since a frame ended, at most `MIN_FRAME`.
    passed: u8,
    /// What they are if they turn out to be a frame.
    passed_as: Seen,
    /// What the caller lends.
    pub storage: S,
    /// When the phase began.
    since: u32,
    /// How long it may last.
    wait: u32,
    /// When the line was last seen busy.
    last_byte: u32,
    /// The time that the poll under way was told.
    now: u32,
    /// The CRC of the bytes since a frame ended: of those passed over, and of these
    /// and the first `done` of the buffer.
    crc_passed: Crc16,
    crc: Crc16,
    /// How the CRC of what was passed over weighs behind a reply; 0 if not reckoned.
    weight: Crc16,
    /// The byte stream.
    pub port: P,
    pub(crate) request: Q,
    /// How requests behave.
    pub settings: Settings,
}
