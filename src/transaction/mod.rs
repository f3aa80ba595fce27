//! One request of a client and its reply over a serial line, moved on by `poll`.
//! The master has an engine of its own, `engine`.
//!
//! A reply is found, not assumed: noise, frames of other units, late replies and a
//! local echo in front of it cost nothing but their own time.
//!
//! What RTU cannot tell apart: a late reply of the same unit, function and
//! length to an earlier request, or a late exception to the same function,
//! looks like the reply. Two rules keep such a reply from being delivered. After
//! a request without a right reply, the line is left alone for the quiet time
//! before the next request. And the next reply of that unit is on probation: it
//! is held until nothing has arrived for the quiet time, and a second reply that
//! arrives meanwhile takes its place, for a device answers in order.
//!
//! A microcontroller's compiler is kept from inlining the steps: each has few
//! values in use at a time, so they stay in registers, and the code is small.

mod answer;
mod clock;
mod outcome;
mod probation;
mod question;
mod settings;
mod storage;

pub use question::Question;
pub use settings::Settings;
pub use storage::{Counter, Storage, COUNTERS};

use crate::error::Status;
use crate::frame::rtu::Window;
use crate::frame::Wanted as _;
use crate::frame::{Search, Seen};
use crate::port::Port;
use crate::time::{characters, elapsed};
use answer::Answer;
use probation::Probation;

/// Where a transaction stands.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
enum Phase {
    /// Nothing to do.
    Idle,
    /// Waiting for the line to be silent.
    Gap,
    /// Handing the frame to the port; the driver is on.
    Send,
    /// Waiting for the port to drain; the driver is on.
    Flush,
    /// Holding the driver on a little longer.
    Hold,
    /// Waiting for the reply.
    Reply,
    /// Waiting for the slaves to carry out a broadcast.
    Turnaround,
}

/// One request and its reply, over the port and in the storage it was given.
// In this order, small fields first: what lies far from the start of an object
// costs a Cortex-M0 and an AVR an instruction more at each access.
#[derive(Clone, Hash, Debug)]
#[repr(C)]
pub struct Transaction<P, S, Q, W = Window> {
    phase: Phase,
    /// The phase began with the last poll; its time is that of the next.
    stamp: bool,
    /// The last poll found nothing to do.
    waiting: bool,
    /// The last request went without a right reply, which may still come.
    late: bool,
    /// Whether the next reply may be a late one.
    probation: Probation,
    /// Over what is to be sent, then over what arrives.
    window: W,
    /// When the phase began.
    since: u32,
    /// When the line was last seen busy.
    last_byte: u32,
    /// The time that the poll under way was told.
    now: u32,
    /// What the caller lends.
    pub storage: S,
    /// The byte stream.
    pub port: P,
    wanted: Answer<Q>,
    /// How transactions behave.
    pub settings: Settings,
}

/// The unit that every slave listens to (serial line guide 2.2).
pub const BROADCAST: u8 = 0;

impl<P, S, Q: Question, W: Search> Transaction<P, S, Q, W> {
    /// No transaction yet.
    pub const fn new(port: P, storage: S) -> Self {
        Transaction {
            since: 0,
            last_byte: 0,
            now: 0,
            phase: Phase::Idle,
            stamp: false,
            waiting: false,
            late: false,
            probation: Probation::NONE,
            window: W::EMPTY,
            wanted: Answer::NONE,
            settings: Settings::DEFAULT,
            storage,
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

    /// The request, which [`Transaction::start`] sends.
    pub fn request(&mut self) -> &mut Q {
        &mut self.wanted.request
    }

    /// Enters a phase whose time counts from the next look at the clock on.
    fn enter(&mut self, phase: Phase) {
        self.phase = phase;
        self.stamp = true;
    }

    fn wait(&mut self) -> Status {
        self.waiting = true;
        Status::PENDING
    }
}

impl<P: Port, S: Storage, Q: Question, W: Search> Transaction<P, S, Q, W> {
    /// Starts the request to `unit`; `poll` does the rest.
    /// [`Status::BROADCAST_NOT_ALLOWED`], and nothing is sent, for a read from
    /// unit 0.
    pub fn start(&mut self, unit: u8) -> Status {
        if unit == BROADCAST && !self.wanted.request.may_be_broadcast() {
            return Status::BROADCAST_NOT_ALLOWED;
        }
        self.wanted.unit = unit;
        self.wanted.held = 0;
        self.window.hold(0);
        if !self.write_frame() {
            return Status::BUFFER_TOO_SMALL;
        }
        self.enter(Phase::Gap);
        Status::PENDING
    }

    /// Gives the request up, with the driver off. Bytes of it may be on the
    /// wire, and a whole one may be answered late.
    pub fn cancel(&mut self) {
        if !matches!(self.phase, Phase::Idle | Phase::Gap) {
            self.line_used();
            if self.phase != Phase::Send {
                self.expect_late_reply();
            }
        }
        self.end();
    }

    /// Ends the transaction, with the driver off.
    fn end(&mut self) {
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
        let (time, since) = match self.phase {
            Phase::Idle => return u32::MAX,
            Phase::Send | Phase::Flush | Phase::Hold => return 0,
            Phase::Gap => (self.silence_to_keep(), self.last_byte),
            Phase::Turnaround => (self.settings.turnaround_delay, self.since),
            Phase::Reply if self.probation.has_held => (self.settings.quiet_time, self.last_byte),
            Phase::Reply if self.window.is_skimmed() => {
                (self.settings.response_timeout, self.since)
            }
            Phase::Reply => (self.settings.silence, self.last_byte),
        };
        time.saturating_sub(elapsed(now, since))
    }

    /// The silence that the next request waits for.
    #[cfg_attr(target_os = "none", inline(never))]
    fn silence_to_keep(&self) -> u32 {
        if self.late {
            self.settings.gap.max(self.settings.quiet_time)
        } else {
            self.settings.gap
        }
    }

    /// Moves the transaction on to the time `now`, without waiting:
    /// [`Status::PENDING`] until it has ended, then how.
    pub fn poll(&mut self, now: u32) -> Status {
        self.waiting = false;
        self.look_at_clock(now);
        let status = match self.phase {
            Phase::Idle => return Status::OK,
            Phase::Gap => self.listen(),
            Phase::Send => self.send(),
            Phase::Flush => self.flush(),
            Phase::Hold => self.hold(),
            Phase::Reply => self.receive(),
            Phase::Turnaround => self.turn_around(),
        };
        if status.is_failure() {
            // What was on its way may still come.
            self.cancel();
        } else if status != Status::PENDING {
            self.end();
        }
        status
    }

    /// Receives into the window's room: how many bytes, negative if the link
    /// is lost.
    #[cfg_attr(target_os = "none", inline(never))]
    fn hear(&mut self) -> i16 {
        self.make_space();
        let held = usize::from(self.wanted.held);
        let buffer = self.storage.frame().get_mut(held..).unwrap_or_default();
        let Some(room) = self.window.room(buffer) else {
            return 0;
        };
        let heard = self.port.read(room);
        if heard > 0 {
            self.storage.count(Counter::BytesReceived, heard as u16);
            self.last_byte = self.now;
        }
        heard
    }

    /// Listens until the line has been silent, then sends. What arrives here
    /// belongs to no request of ours.
    #[cfg_attr(target_os = "none", inline(never))]
    fn listen(&mut self) -> Status {
        let heard = self.hear();
        if heard < 0 {
            return Status::LINK_LOST;
        }
        let silence = self.silence_to_keep();
        if heard > 0 {
            // It stands where the request stood.
            self.write_frame();
            return self.stalled(silence);
        }
        if !self.is_silent(silence) {
            return self.wait();
        }
        let length = self.wanted.request.length();
        self.window.hold(W::frame_length(length));
        self.storage.count(Counter::Requests, 1);
        self.late = false;
        self.phase = Phase::Send;
        self.since = self.now;
        self.port.pre_transmission();
        self.send()
    }

    /// Writes the request into the frame buffer, if that holds it: before the
    /// silence, so that this lasts no longer than it must.
    #[cfg_attr(target_os = "none", inline(never))]
    fn write_frame(&mut self) -> bool {
        let request = &self.wanted.request;
        let length = usize::from(request.length());
        let frame = self.storage.frame();
        self.window
            .write(frame, self.wanted.unit, length, |pdu| request.emit(pdu))
    }

    #[cfg_attr(target_os = "none", inline(never))]
    fn send(&mut self) -> Status {
        let Some(rest) = self.window.unsent(self.storage.frame()) else {
            return Status::BUFFER_TOO_SMALL;
        };
        let left = rest.len();
        let sent = self.port.write(rest);
        if sent < 0 {
            return Status::LINK_LOST;
        }
        let sent = sent as u16;
        self.storage.count(Counter::BytesSent, sent);
        self.window.sent(sent);
        if sent > 0 {
            self.since = self.now;
        }
        if usize::from(sent) < left {
            return self.stalled(0);
        }
        self.phase = Phase::Flush;
        self.flush()
    }

    #[cfg_attr(target_os = "none", inline(never))]
    fn flush(&mut self) -> Status {
        if !self.port.flush() {
            // No request takes longer than a frame of 256 characters.
            return self.stalled(u32::from(self.settings.character) << 8);
        }
        if cfg!(feature = "hold") && self.settings.post_flush_hold > 0 {
            self.enter(Phase::Hold);
        } else {
            self.release();
        }
        Status::PENDING
    }

    fn hold(&mut self) -> Status {
        let hold = characters(self.settings.character, self.settings.post_flush_hold);
        if cfg!(feature = "hold") && self.lasts(hold) {
            self.release();
        }
        Status::PENDING
    }

    /// The request is on the wire: the driver goes off, the wait begins.
    #[cfg_attr(target_os = "none", inline(never))]
    fn release(&mut self) {
        self.window.clear();
        self.begin_reply();
        self.port.post_transmission();
        if cfg!(feature = "echo") {
            self.wanted.echo = self.settings.echo_discard;
        }
        self.waiting = true;
        self.enter(
            if self.wanted.unit == BROADCAST || !self.wanted.request.is_answered() {
                Phase::Turnaround
            } else {
                Phase::Reply
            },
        );
    }

    fn turn_around(&mut self) -> Status {
        if self.lasts(self.settings.turnaround_delay) {
            return Status::OK;
        }
        self.wait()
    }

    #[cfg_attr(target_os = "none", inline(never))]
    fn receive(&mut self) -> Status {
        let mut over = self.stalled(0) != Status::PENDING;
        // As the deadline passes, all that has arrived is looked at, even if
        // the port hands it over byte by byte.
        let mut reads = if over { u8::MAX } else { 1 };
        loop {
            let heard = if reads > 0 { self.hear() } else { 0 };
            if heard < 0 {
                return Status::LINK_LOST;
            }
            if heard > 0 {
                reads -= 1;
                self.window.arrived(heard as u16);
                self.wanted.ends(false);
            } else {
                self.waiting = reads > 0;
                if self.probation.has_held {
                    over = self.is_hold_over();
                }
                if !over && !self.is_silent(self.settings.silence) {
                    return Status::PENDING;
                }
                if self.window.is_skimmed() {
                    if over && self.take_held() {
                        return self.found();
                    }
                    // Without diagnosis it is not known whether it was a reply.
                    let damaged = self.window.seen() >= Seen::BAD_CRC;
                    return if over || (cfg!(feature = "diagnosis") && damaged) {
                        self.fail()
                    } else {
                        Status::PENDING
                    };
                }
                self.window.skim();
                self.wanted.ends(true);
            }
            while self.finds_reply() {
                if !self.is_on_probation() {
                    return self.found();
                }
                self.hold_reply();
            }
        }
    }

    /// No reply came: says why, with the most telling status.
    #[cfg_attr(target_os = "none", inline(never))]
    fn fail(&mut self) -> Status {
        self.count_foreign();
        let status = self.window.seen().status();
        if status == Status::BUFFER_TOO_SMALL {
            return status;
        }
        let counter = if status == Status::INVALID_CRC {
            Counter::BadCrc
        } else {
            Counter::Timeouts
        };
        self.storage.count(counter, 1);
        status
    }
}
