//! Sends one request on a serial line and finds its reply. `poll` moves the request on.
//!
//! The master and the client's serial lines use this engine. The client's requests choose
//! their framing, RTU or ASCII.
//!
//! - `poll` has the phases of a request and its one timer. It writes the request, and waits until
//!   the port has sent it.
//! - `search` finds the reply in RTU frames: for each byte it asks whether the reply ends there.
//! - `late` keeps a late reply from being delivered as the answer to a later request.
//! - `extras` has retries, echo discarding, the post-flush hold, and counters.
//! - `ascii` finds the reply in ASCII frames.
//!
//! `inline(never)` keeps the steps apart in firmware. Each step then needs few values at a
//! time, which fit into the registers, and the code is small.

pub mod ascii;
mod extras;
mod late;
mod late_units;
mod poll;
mod search;
mod settings;
mod storage;
mod transaction;

pub use late_units::LateUnits;
pub use settings::{MicrosSetting, Settings};
pub use storage::{Buffers, Count, Counter, Frame, Storage, Words, COUNTERS};
pub use transaction::Transaction;

use crate::error::Status;
use crate::frame::rtu::Crc16;
use crate::time::Micros;

/// The unit address of a broadcast (serial line guide V1.02, 2.2).
pub const BROADCAST: u8 = 0;

/// The phase of a request. The driver is on from `Send` on.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Hash, Debug)]
#[repr(u8)]
enum Phase {
    /// No request is pending.
    Idle,
    /// Waits until its unit owes no reply to earlier requests.
    Rest,
    /// Waits until the line is silent.
    Gap,
    /// Waits for the reply.
    Reply,
    /// Gives the devices time to carry out a broadcast.
    Turnaround,
    /// Writes the frame to the port.
    Send,
    /// Waits until the port has sent the last bit.
    Flush,
    /// Keeps the driver on for the post-flush hold.
    PostFlush,
}

/// One request and its reply, over a port and in the caller's storage.
// Small fields come first: a Cortex-M0 and an AVR need one more instruction to reach a field
// far from the start of an object. Of 25 orders of the fields from `late_units` on, this one is the
// smallest: on an AVR, FC03 takes 48 bytes less than in the order before, and a client 100.
#[derive(Clone, Hash, Debug)]
#[repr(C)]
pub struct Engine<P, S: Storage, Q> {
    /// The last request got no right reply. Its reply may still come.
    is_late: bool,
    phase: Phase,
    /// The phase began in the last poll. Its time starts with the next look at the clock.
    phase_begins: bool,
    /// The unit that the request is sent to.
    pub(crate) unit: u8,
    /// The function code of the request.
    pub(crate) function: u8,
    /// How often the request was repeated.
    retries: u8,
    /// The exception code of the last reply; 0 if the reply was no exception.
    pub(crate) exception: u8,
    /// The finding with which the request ends if no more bytes arrive.
    pub(crate) seen: Finding,
    /// The response or damaged reply in `seen` may lie within another frame, so a silence must
    /// follow it.
    pub(crate) is_early: bool,
    /// How many replies the unit owed when the request was begun, less the replies that have
    /// come since: see `late`.
    pub(crate) owed: u8,
    /// A reply is or was held, because it may be a late one.
    pub(crate) is_held: bool,
    /// A reply may have arrived that counts only once the bytes end: one of unknown length, or a
    /// deviating one.
    pub(crate) awaits_end: bool,
    /// The last poll may have left bytes unread.
    has_more: bool,
    /// The kind of the frame that is being received, if it ends with a right CRC. It is known
    /// from its second byte on: see `kind_of_frame`.
    run_kind: Finding,
    /// How many bytes have arrived since the last frame ended.
    pub(crate) run_length: S::Count,
    /// Length of the reply's frame that is no exception; 0 if the request does not determine it.
    pub(crate) length: S::Count,
    /// How many bytes the frame buffer holds.
    pub(crate) end: S::Count,
    /// How many bytes at the end of the frame buffer the observer has filled.
    pub(crate) kept: S::Count,
    /// Length of the right reply, unit and PDU, at the front of the frame buffer; 0 if there is
    /// none.
    pub(crate) content: S::Count,
    /// Length of the request's frame, as long as it is in the frame buffer to be sent, or its echo
    /// is expected; otherwise 0.
    outgoing: S::Count,
    /// How many bytes of the request were sent.
    sent: S::Count,
    /// How many of the sent bytes were counted. The request is counted with the first of them.
    counted: S::Count,
    /// How many skipped frames with a right CRC were not counted yet.
    pub(crate) foreign_frames: i8,
    /// CRC of the bytes that have arrived since the last frame ended.
    run: Crc16,
    /// How many bytes have arrived that were not counted yet.
    received: u16,
    /// The units that owe replies.
    // For model checkers.
    #[doc(hidden)]
    pub late_units: LateUnits,
    /// The byte stream.
    pub port: P,
    /// The caller's frame buffer, words and counters.
    pub storage: S,
    /// When the wait began. Before and between requests: when the line was last in use.
    pub(crate) since: Micros,
    /// How long the wait lasts.
    pub(crate) wait: Micros,
    /// The time of the current poll.
    pub(crate) now: Micros,
    /// When the phase began.
    begun: Micros,
    pub(crate) request: Q,
    /// Retries, echo discarding and the post-flush hold (see `extras`).
    extras: Option<Extension<P, S, Q>>,
    /// Accepts deviating replies; `None` if nothing does.
    lenient: Option<Extension<P, S, Q>>,
    /// Counts attempts and bytes. (A pointer, so that a program without counters does not
    /// contain its code.)
    tally: Option<fn(&mut Self, Status)>,
    /// Times and options of the requests.
    pub settings: Settings,
}

/// A function that does something at some moments of a request. `true` if that replaces the
/// engine's next step.
pub type Extension<P, S, Q> = fn(&mut Engine<P, S, Q>, Moment) -> bool;

/// When an [`Extension`] is called: `extras` at all but `Missed`, `lenient` at `Missed` and `End`.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Moment {
    /// The port has sent the last bit. `true` if the driver must stay on.
    Sent,
    /// A byte has arrived. `true` if it ends the echo of the request.
    Byte,
    /// The request ends with the finding in `seen`. `true` if it is repeated.
    End,
    /// The search has not ended with the byte that has arrived. `true` if that ends no frame,
    /// although the CRC is right.
    Missed,
}

/// The result of a request so far: the status of a response (0, or an exception code below 0x80),
/// or the most severe fault in the received bytes. The more severe fault is the greater one. The
/// low hexadecimal digit of a fault is the low digit of its status.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Hash, Debug)]
pub struct Finding(u8);

impl Finding {
    /// A right reply, or a broadcast that was sent.
    pub const OK: Finding = Finding(0x00);
    /// No frame arrived.
    pub const NOTHING: Finding = Finding(0x82);
    /// A frame of another unit.
    pub const OTHER_UNIT: Finding = Finding(0x90);
    /// A frame of our unit with another function.
    pub const OTHER_FUNCTION: Finding = Finding(0xA1);
    /// A frame of our unit and function that is not the reply.
    pub const MALFORMED: Finding = Finding(0xB5);
    /// A complete frame of our unit and function with a wrong CRC.
    pub const BAD_CRC: Finding = Finding(0xC3);
    /// No response, and the frame buffer cannot hold the reply.
    pub const TOO_LONG: Finding = Finding(0xD9);

    /// True for a response of the device: the right reply or an exception.
    pub const fn is_response(self) -> bool {
        self.0 < 0x80
    }

    /// The status of a request that ends with this finding.
    pub const fn status(self) -> Status {
        if self.is_response() {
            Status::from_code(self.0)
        } else {
            Status::from_code(0xE0 | (self.0 & 0x0F))
        }
    }
}

const _: () = {
    assert!(Finding::NOTHING.status().code() == Status::RESPONSE_TIMED_OUT.code());
    assert!(Finding::OTHER_UNIT.status().code() == Status::INVALID_SLAVE_ID.code());
    assert!(Finding::OTHER_FUNCTION.status().code() == Status::INVALID_FUNCTION.code());
    assert!(Finding::MALFORMED.status().code() == Status::MALFORMED_REPLY.code());
    assert!(Finding::BAD_CRC.status().code() == Status::INVALID_CRC.code());
    assert!(Finding::TOO_LONG.status().code() == Status::BUFFER_TOO_SMALL.code());
};

impl<P, S: Storage, Q> Engine<P, S, Q> {
    /// True if deviating replies are accepted.
    pub fn is_lenient(&self) -> bool {
        self.lenient.is_some()
    }

    /// Sets what [`Engine::lenient`] returns, for later requests. Call it only while no request
    /// is pending.
    pub fn set_lenience(&mut self, lenient: Option<Extension<P, S, Q>>) {
        self.lenient = lenient;
    }
}
