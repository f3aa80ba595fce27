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
mod plain;
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
use crate::frame::checksum::{crc16, Crc16};
use crate::frame::rtu;
use crate::port::Port;
use crate::time::{elapsed, has_elapsed, LONGEST};
use receive::Probation;

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
    /// Bytes of a held reply, which the storage has set aside.
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

impl<P, S: Storage, Q: Request<P, S>> Engine<P, S, Q> {
    /// No request yet.
    pub const fn new(port: P, storage: S) -> Self {
        Engine {
            phase: Phase::Idle,
            stamp: false,
            waiting: false,
            unit: 0,
            retries: 0,
            exception: 0,
            length: S::Count::ZERO,
            end: S::Count::ZERO,
            done: S::Count::ZERO,
            least: S::Count::ZERO,
            held: S::Count::ZERO,
            probation: Probation::Off,
            late_unit: 0,
            late: false,
            echo: false,
            skimmed: false,
            seen: Seen::NOTHING,
            foreign: 0,
            passed: 0,
            passed_as: Seen::NOTHING,
            crc_passed: Crc16::START,
            crc: Crc16::START,
            weight: Crc16::RESIDUE,
            request: Q::NONE,
            since: 0,
            wait: 0,
            last_byte: 0,
            now: 0,
            storage,
            settings: Settings::DEFAULT,
            port,
        }
    }

    /// True while a request is under way.
    pub fn is_pending(&self) -> bool {
        self.phase != Phase::Idle
    }

    /// True if the last poll found nothing to do and the driver is off, so
    /// that the caller may do something else for a while.
    pub const fn is_waiting(&self) -> bool {
        self.waiting
    }

    /// The request, which [`Engine::start`] sends.
    pub fn request(&mut self) -> &mut Q {
        &mut self.request
    }

    /// The raw exception code of the last reply; 0 if it was none.
    pub const fn exception_code(&self) -> u8 {
        self.exception
    }

    /// Forgets the outcome of the last request.
    pub fn forget(&mut self) {
        self.exception = 0;
    }

    /// Moves the clock's zero to `now`; what is longer ago than `longest` counts as
    /// that long ago. For model checkers, to which two objects are equal if they
    /// will behave alike.
    #[doc(hidden)]
    pub fn rebase(&mut self, now: u32, longest: u32) {
        for time in [&mut self.since, &mut self.last_byte, &mut self.now] {
            *time = 0u32.wrapping_sub(elapsed(now, *time).min(longest));
        }
    }

    /// Completes a frame to be sent, of which `length` bytes are in the frame buffer, with
    /// its CRC.
    #[inline(always)]
    pub(crate) fn append_crc(&mut self, length: S::Count) {
        let [low, high] = crc16(self.storage.bytes(S::Count::ZERO, length)).to_bytes();
        self.storage.set_byte(length, low);
        self.storage.set_byte(length + 1u8.into(), high);
        self.set_frame_length(length + rtu::CRC.into());
    }

    /// Writes the frame of the request if that is a function code and two words. For hosts:
    /// such requests are most, and this costs half.
    #[inline(always)]
    pub(crate) fn write_short(&mut self, words: [u8; 4]) {
        let frame = rtu::short(self.unit, self.request.function(), words);
        let length = S::Count::from(frame.len() as u8);
        if let Some(place) = self.storage.bytes(S::Count::ZERO, length).first_chunk_mut() {
            *place = frame;
        }
        self.set_frame_length(length);
    }

    /// Sets how many bytes of the frame buffer are to be sent.
    #[inline(always)]
    pub(crate) fn set_frame_length(&mut self, length: S::Count) {
        self.end = length;
        self.done = S::Count::ZERO;
    }

    /// Enters a phase that lasts `wait`, from the next look at the clock on.
    fn enter(&mut self, phase: Phase, wait: u32) {
        self.phase = phase;
        self.wait = wait;
        self.stamp = true;
    }

    fn wait(&mut self) -> Status {
        self.waiting = true;
        Status::PENDING
    }

    /// Notes the time `now`, and starts the time of a phase that just began.
    #[cfg_attr(target_os = "none", inline(never))]
    fn look_at_clock(&mut self, now: u32) {
        self.now = now;
        if self.stamp {
            self.stamp = false;
            self.since = now;
            // The silence is measured from the end of our request. Before a
            // request it is measured from the last byte received.
            if self.phase != Phase::Gap {
                self.last_byte = now;
            }
        }
    }

    /// True once the phase has lasted as long as it may.
    fn is_over(&self) -> bool {
        self.has_passed(self.wait, false)
    }

    /// True once the line has been silent for `time`.
    #[inline(always)]
    fn is_silent(&self, time: u32) -> bool {
        self.has_passed(time, true)
    }

    /// True once `time` has passed since the line was last busy, or since the phase
    /// began. (One function: 32 bits are much work for an AVR.)
    #[cfg_attr(target_os = "none", inline(never))]
    fn has_passed(&self, time: u32, since_last_byte: bool) -> bool {
        let since = if since_last_byte {
            self.last_byte
        } else {
            self.since
        };
        has_elapsed(time, self.now, since)
    }

    /// What a line that is not silent, or a port that does not move, makes of a
    /// request.
    #[cfg_attr(target_os = "none", inline(never))]
    fn stalled(&self) -> Status {
        if self.is_over() {
            Status::LINE_BUSY
        } else {
            Status::PENDING
        }
    }
}

impl<P: Port, S: Storage, Q: Request<P, S>> Engine<P, S, Q> {
    /// Says that the line was busy just now, so the gap counts from here.
    pub fn line_used(&mut self) {
        self.last_byte = self.port.micros();
    }

    /// Says that the line was used at that time, by the clock of the port. The gap
    /// counts from then, unless the line was used later.
    pub fn line_used_at(&mut self, time: u32) {
        if time.wrapping_sub(self.last_byte) < LONGEST {
            self.last_byte = time;
        }
    }

    /// Moves the request on to the time `now`, without waiting:
    /// [`Status::PENDING`] until it has ended, then how.
    #[cfg_attr(not(target_os = "none"), inline(always))]
    pub fn poll(&mut self, now: u32) -> Status {
        self.waiting = false;
        self.look_at_clock(now);
        let status = match self.phase {
            Phase::Idle => return Status::OK,
            Phase::Gap => self.listen(),
            Phase::Send | Phase::Flush | Phase::Hold => self.send(),
            Phase::Reply => self.receive(),
            Phase::Turnaround if self.is_over() => Status::OK,
            Phase::Turnaround => self.wait(),
        };
        if status.is_failure() {
            self.cancel();
        } else if status != Status::PENDING {
            self.end();
        }
        status
    }

    /// Gives the request up, with the driver off. Bytes of it may be on the
    /// wire, and a whole one may be answered late.
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn cancel(&mut self) {
        if self.phase > Phase::Gap {
            self.line_used();
        }
        if self.phase > Phase::Send {
            self.expect_late_reply();
        }
        self.end();
    }

    /// Ends the request, with the driver off.
    #[cfg_attr(target_os = "none", inline(never))]
    fn end(&mut self) {
        self.take_back();
        if matches!(self.phase, Phase::Send | Phase::Flush | Phase::Hold) {
            self.port.post_transmission();
        }
        self.phase = Phase::Idle;
        self.waiting = false;
    }

    /// How long, in microseconds from `now`, poll will find nothing to do unless
    /// a byte arrives; the greatest value if there is no request. A phase that just
    /// began counts its time from this call, so the caller may sleep that long.
    pub fn poll_delay(&mut self, now: u32) -> u32 {
        self.look_at_clock(now);
        let settings = &self.settings;
        let (time, since) = match self.phase {
            Phase::Idle => return u32::MAX,
            Phase::Send | Phase::Flush | Phase::Hold => return 0,
            Phase::Gap => (self.silence_to_keep(), self.last_byte),
            Phase::Reply if self.probation == Probation::Held => {
                (settings.quiet_time, self.last_byte)
            }
            Phase::Reply if !self.skimmed => (settings.silence, self.last_byte),
            Phase::Reply | Phase::Turnaround => (self.wait, self.since),
        };
        time.saturating_sub(elapsed(now, since))
    }
}
