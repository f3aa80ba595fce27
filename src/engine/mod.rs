//! Sends one request on a serial line and finds its reply. `poll` moves the request on.
//!
//! The master and the client's serial lines use this engine. The client's requests choose
//! their framing, RTU or ASCII (see `spec`).
//!
//! The engine searches the received bytes for the reply (see `rtu`, `ascii`). Noise, frames
//! of other units, late replies and a local echo before the reply do no harm.
//!
//! RTU frames carry no transaction number. A late reply to an earlier request looks like the
//! reply if unit, function and length are the same, and a late exception looks like the reply
//! if the function is the same. Two rules keep late replies from being delivered:
//! - After a request without a right reply, the engine waits for the quiet time before it
//!   sends the next request.
//! - The next reply of that unit is on probation (see `receive`).
//!
//! A reply that arrives while no request has been sent shows that the replies are late, too.
//!
//! `inline(never)` keeps the steps apart in firmware. Each step then needs few values at a
//! time, which fit into the registers, and the code is small.

pub mod ascii;
mod fault;
mod lenient;
mod master_request;
mod poll;
mod receive;
mod rtu;
mod send;
mod settings;
mod spec;
mod storage;

pub use fault::RxFault;
pub use settings::Settings;
pub use spec::{Match, RequestSpec};
pub use storage::{Buffers, Count, Counter, Frame, Storage, Words, COUNTERS};

use crate::error::Status;
use crate::frame::checksum::Crc16;

/// The unit address of a broadcast (serial line guide V1.02, 2.2).
pub const BROADCAST: u8 = 0;

/// The phase of a request. The phases follow each other in this order.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Hash, Debug)]
#[repr(u8)]
enum Phase {
    /// No request is pending.
    Idle,
    /// Waits until the line is silent.
    Gap,
    /// Writes the frame to the port. The driver is on.
    Send,
    /// Waits until the port has sent the last bit. The driver is on.
    Flush,
    /// Keeps the driver on for the post-flush hold.
    PostFlush,
    /// Waits for the reply.
    Reply,
    /// Gives the slaves time to carry out a broadcast.
    Turnaround,
}

/// Whether the reply to the pending request may be a late reply.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
#[repr(u8)]
enum Probation {
    /// No late reply is expected.
    Off,
    /// The next reply may be late.
    On,
    /// The next reply may be late, and one reply is or was held.
    Held,
    /// A deviating reply has come (see `lenient`).
    Deviating,
}

/// A function that waits for the reply.
pub type Receive<E> = fn(&mut E) -> Status;

/// One request and its reply, over a port and in the caller's storage.
// Small fields come first: a Cortex-M0 and an AVR need one more instruction to reach a field
// far from the start of an object.
#[derive(Clone, Hash, Debug)]
#[repr(C)]
pub struct Engine<P, S: Storage, Q> {
    phase: Phase,
    /// The phase began in the last poll. Its time starts with the next look at the clock.
    phase_begins: bool,
    /// The last poll found nothing to do.
    waiting: bool,
    /// The unit that the request is sent to.
    pub(crate) unit: u8,
    retries: u8,
    /// The exception code of the last reply; 0 if the reply was no exception.
    pub(crate) exception: u8,
    /// See [`RequestSpec::reply_length`].
    length: S::Count,
    /// How many bytes the frame buffer holds.
    end: S::Count,
    /// How many of these bytes were sent, or are part of `crc`.
    processed: S::Count,
    /// The least length of the candidate at the front of the buffer. Once the reply is
    /// found: the length of its frame.
    needed: S::Count,
    /// Length of the bytes that the storage has set aside: a held reply, or what may become a
    /// deviating reply (see `lenient`); 0 if there are none.
    pub(crate) held: S::Count,
    /// Whether the next reply may be a late reply.
    probation: Probation,
    /// The last request got no right reply. Its reply may still come.
    late: bool,
    /// One of the late units sent no reply, not only a damaged one.
    has_slow_unit: bool,
    /// The echo of the request is expected before the reply.
    pub(crate) echo: bool,
    /// No byte has arrived since the received bytes were last searched for a reply after an
    /// incomplete candidate. Before a request is sent: the frame buffer holds the request.
    resynced: bool,
    /// The most severe fault among the skipped bytes.
    fault: RxFault,
    /// How many skipped frames had a right CRC.
    foreign_frames: u8,
    /// How many bytes were skipped since the last frame ended, at most `MIN_FRAME`.
    skipped: u8,
    /// The fault to note if the skipped bytes turn out to be a frame.
    skipped_as: RxFault,
    /// The caller's frame buffer, words and counters.
    pub storage: S,
    /// Time at which the phase began.
    phase_start: u32,
    /// How long the phase may last.
    wait: u32,
    /// Time at which the line was last in use.
    last_byte: u32,
    /// The time of the current poll.
    now: u32,
    /// The units that did not answer their last request. Each bit stands for the units whose
    /// numbers are equal modulo 32.
    late_units: [u8; 4],
    /// CRC of the bytes skipped since the last frame ended. `crc` continues it over the first
    /// `processed` bytes of the buffer.
    crc_skipped: Crc16,
    crc: Crc16,
    /// Factor that carries `crc_skipped` over the length of a reply; `RESIDUE` until computed.
    weight: Crc16,
    /// The byte stream.
    pub port: P,
    pub(crate) request: Q,
    /// Times and options of the requests.
    pub settings: Settings,
}
