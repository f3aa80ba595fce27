//! One request and its reply over a byte stream, moved on by `poll`.
//!
//! This is the only receive state machine of the client side. A reply is
//! found, not assumed: noise, frames of other units, late replies and a local
//! echo in front of it cost nothing but their own time.
//!
//! What RTU cannot tell apart: a late reply of the same unit, function and
//! length to an earlier request, or a late exception to the same function,
//! looks like the reply. After a request that got no right reply the line is
//! therefore given a quiet time before the next request.

mod settings;
mod storage;

pub use settings::Settings;
pub use storage::{Counter, Storage, COUNTERS};

use crate::error::Status;
use crate::frame::rtu::{self, Seen, Window};
use crate::pdu::request::Request;
use crate::pdu::response;
use crate::port::Port;
use crate::time::{elapsed, millis};

/// Where a transaction stands.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
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
#[repr(C)]
pub struct Transaction<P, S> {
    phase: Phase,
    unit: u8,
    retries: u8,
    exception: u8,
    /// The phase began with the last poll; its time is that of the next.
    stamp: bool,
    /// The last poll found nothing to do.
    waiting: bool,
    /// What has arrived was searched behind its first candidate.
    skimmed: bool,
    /// The last request went without a right reply, which may still come.
    late: bool,
    /// The request itself is expected to come back before the reply.
    echo: bool,
    request: Request,
    window: Window,
    /// Bytes of the request that are sent, then where the reply's PDU starts.
    at: u16,
    /// When the phase began.
    since: u32,
    /// When the line was last seen busy.
    last_byte: u32,
    /// The time that the poll under way was told.
    now: u32,
    /// The byte stream.
    pub port: P,
    /// What the caller lends.
    pub storage: S,
    /// How transactions behave.
    pub settings: Settings,
}

/// The unit that every slave listens to (serial line guide 2.2).
pub const BROADCAST: u8 = 0;

impl<P, S> Transaction<P, S> {
    /// No transaction yet.
    pub const fn new(port: P, storage: S) -> Self {
        Transaction {
            since: 0,
            last_byte: 0,
            now: 0,
            phase: Phase::Idle,
            unit: 0,
            retries: 0,
            exception: 0,
            at: 0,
            stamp: false,
            waiting: false,
            skimmed: false,
            late: false,
            echo: false,
            window: Window::EMPTY,
            request: Request::NONE,
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

    /// The raw exception code of the last reply; 0 if it was none.
    pub const fn exception_code(&self) -> u8 {
        self.exception
    }

    /// Forgets the outcome of the last transaction.
    pub fn forget(&mut self) {
        self.exception = 0;
    }

    /// The request that was started last.
    pub const fn request(&self) -> &Request {
        &self.request
    }

    /// True once the phase has lasted `time`.
    fn lasts(&self, time: u32) -> bool {
        elapsed(self.now, self.since) >= time
    }

    /// True once the phase has lasted as long as the response timeout and
    /// `more` microseconds.
    fn is_over(&self, more: u32) -> bool {
        self.lasts(millis(self.settings.response_timeout).saturating_add(more))
    }

    /// A line that is not silent, or a port that does not move, is not waited
    /// for longer than a reply and the `time` that it may take.
    fn stalled(&self, time: u32) -> Status {
        if self.is_over(time) {
            Status::LINE_BUSY
        } else {
            Status::PENDING
        }
    }

    /// How long the request is on the wire.
    fn send_time(&self) -> u32 {
        u32::from(self.settings.character) * (self.request.length() + rtu::OVERHEAD) as u32
    }

    fn listen_from(&mut self, now: u32) {
        self.phase = Phase::Gap;
        self.since = now;
        self.stamp = false;
    }

    /// Enters a phase whose time counts from the next poll on.
    fn enter(&mut self, phase: Phase) {
        self.phase = phase;
        self.stamp = true;
    }

    fn wait(&mut self) -> Status {
        self.waiting = true;
        Status::PENDING
    }
}

impl<P: Port, S: Storage> Transaction<P, S> {
    /// Says that the line was busy just now, so the gap counts from here.
    pub fn line_used(&mut self) {
        self.last_byte = self.port.micros();
    }

    /// The data bytes of the reply that ended the last transaction, and the
    /// words to fill from them.
    pub fn data_and_words(&mut self) -> (&[u8], &mut [u16]) {
        let (frame, words) = self.storage.frame_and_response();
        let pdu = frame.get(usize::from(self.at)..).unwrap_or_default();
        (response::data(&self.request, pdu), words)
    }

    /// Starts `request` to `unit`; `poll` does the rest.
    ///
    /// # Errors
    /// [`Status::BUSY`] if one is under way, [`Status::BROADCAST_NOT_ALLOWED`]
    /// for a read from unit 0. Nothing is sent then.
    pub fn start(&mut self, unit: u8, request: Request) -> Result<(), Status> {
        if self.is_pending() {
            return Err(Status::BUSY);
        }
        if unit == BROADCAST && request.is_read() {
            return Err(Status::BROADCAST_NOT_ALLOWED);
        }
        self.request = request;
        self.unit = unit;
        self.retries = self.settings.retries;
        self.forget();
        let now = self.port.micros();
        self.listen_from(now);
        Ok(())
    }

    /// Gives the request up, with the driver off. Bytes of it may be on the
    /// wire, and a whole one may be answered late.
    pub fn cancel(&mut self) {
        if !matches!(self.phase, Phase::Idle | Phase::Gap) {
            self.line_used();
            self.late = self.phase != Phase::Send;
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
    /// a byte arrives; the greatest value if there is no request.
    pub fn poll_delay(&self, now: u32) -> u32 {
        let (time, since) = match self.phase {
            Phase::Idle => return u32::MAX,
            Phase::Send | Phase::Flush | Phase::Hold => return 0,
            Phase::Gap => (self.silence_to_keep(), self.last_byte),
            Phase::Turnaround => (millis(self.settings.turnaround_delay), self.since),
            Phase::Reply if self.skimmed => (millis(self.settings.response_timeout), self.since),
            Phase::Reply => (self.settings.silence, self.last_byte),
        };
        if self.stamp {
            time
        } else {
            time.saturating_sub(elapsed(now, since))
        }
    }

    /// The silence that the next request waits for.
    fn silence_to_keep(&self) -> u32 {
        if self.late {
            self.settings.gap.max(millis(self.settings.quiet_time))
        } else {
            self.settings.gap
        }
    }

    /// Moves the transaction on to the time `now`, without waiting:
    /// [`Status::PENDING`] until it has ended, then how.
    pub fn poll(&mut self, now: u32) -> Status {
        self.waiting = false;
        self.now = now;
        if self.stamp {
            self.stamp = false;
            self.since = now;
            self.last_byte = now;
        }
        let status = match self.phase {
            Phase::Idle => return Status::OK,
            Phase::Gap => self.listen(),
            Phase::Send => self.send(),
            Phase::Flush => self.flush(),
            Phase::Hold => self.hold(),
            Phase::Reply => self.receive(),
            Phase::Turnaround => self.turn_around(),
        };
        match status {
            Status::PENDING => {}
            // The line may come back, and with it what was on its way.
            Status::LINK_LOST | Status::LINE_BUSY => self.cancel(),
            _ => self.end(),
        }
        status
    }

    /// Listens until the line has been silent, then sends. What arrives here
    /// belongs to no request of ours.
    fn listen(&mut self) -> Status {
        match self.port.read(self.storage.frame()) {
            Err(status) => return status,
            Ok(0) => {}
            Ok(count) => {
                self.storage.count(Counter::BytesReceived, count);
                self.last_byte = self.now;
                return self.stalled(self.silence_to_keep());
            }
        }
        if elapsed(self.now, self.last_byte) < self.silence_to_keep() {
            return self.wait();
        }
        if !self.write_frame() {
            return Status::BUFFER_TOO_SMALL;
        }
        self.storage.count(Counter::Requests, 1);
        self.at = 0;
        self.late = false;
        self.phase = Phase::Send;
        self.since = self.now;
        self.port.pre_transmission();
        self.send()
    }

    /// Writes the request into the frame buffer, if that holds it.
    fn write_frame(&mut self) -> bool {
        let request = &self.request;
        let (frame, words) = self.storage.frame_and_transmit();
        rtu::write(frame, self.unit, request.length(), |pdu| {
            request.emit(pdu, words);
        })
    }

    fn send(&mut self) -> Status {
        let rest = usize::from(self.at)..self.request.length() + rtu::OVERHEAD;
        let rest = self.storage.frame().get(rest).unwrap_or_default();
        let left = rest.len();
        match self.port.write(rest) {
            Err(status) => status,
            Ok(count) => {
                self.storage.count(Counter::BytesSent, count);
                self.at += count as u16;
                if count > 0 {
                    self.since = self.now;
                }
                if count < left {
                    return self.stalled(0);
                }
                self.phase = Phase::Flush;
                self.flush()
            }
        }
    }

    fn flush(&mut self) -> Status {
        if !self.port.flush() {
            return self.stalled(self.send_time());
        }
        if self.settings.post_flush_hold > 0 {
            self.enter(Phase::Hold);
        } else {
            self.release();
        }
        Status::PENDING
    }

    fn hold(&mut self) -> Status {
        let character = u32::from(self.settings.character);
        if self.lasts(character * u32::from(self.settings.post_flush_hold)) {
            self.release();
        }
        Status::PENDING
    }

    /// The request is on the wire: the driver goes off, the wait begins.
    fn release(&mut self) {
        self.port.post_transmission();
        self.window = Window::EMPTY;
        self.echo = self.settings.echo_discard;
        self.waiting = true;
        // Nothing has arrived yet.
        self.skimmed = true;
        self.enter(if self.unit == BROADCAST {
            Phase::Turnaround
        } else {
            Phase::Reply
        });
    }

    fn turn_around(&mut self) -> Status {
        if self.lasts(millis(self.settings.turnaround_delay)) {
            return Status::OK;
        }
        self.wait()
    }

    fn receive(&mut self) -> Status {
        let over = self.is_over(0);
        // As the deadline passes, all that has arrived is looked at, even if
        // the port hands it over byte by byte.
        for _ in 0..if over { rtu::MAX_FRAME } else { 1 } {
            match self.port.read(self.window.room(self.storage.frame())) {
                Err(status) => return status,
                Ok(0) => {
                    self.waiting = true;
                    break;
                }
                Ok(count) => {
                    self.storage.count(Counter::BytesReceived, count);
                    self.last_byte = self.now;
                    self.skimmed = false;
                    self.window.arrived(count);
                    let found = self.search(false);
                    if found != Status::PENDING {
                        return found;
                    }
                }
            }
        }
        if !over && elapsed(self.now, self.last_byte) < self.settings.silence {
            return Status::PENDING;
        }
        // A candidate that does not get complete may be noise that looks like
        // the reply, so look behind it; the rest of it may still come.
        if !self.skimmed {
            self.skimmed = true;
            let found = self.search(true);
            if found != Status::PENDING {
                return found;
            }
        }
        if over || self.window.seen() >= Seen::BadCrc {
            self.fail()
        } else {
            Status::PENDING
        }
    }

    /// Looks for the reply in what has arrived.
    fn search(&mut self, skim: bool) -> Status {
        loop {
            let (request, echo) = (&self.request, self.echo);
            let frame = self.storage.frame();
            let found = self.window.search(frame, self.unit, skim, |pdu| {
                if echo && request.agrees(pdu) {
                    Some(request.length())
                } else {
                    response::expected(request, pdu)
                }
            });
            let Some(range) = found else {
                return Status::PENDING;
            };
            let pdu = frame.get(range.clone()).unwrap_or_default();
            if echo && pdu.len() == request.length() && request.agrees(pdu) {
                self.echo = false;
                self.window.drop_echo(frame, range);
                continue;
            }
            let status = response::judge(request, pdu);
            self.exception = response::exception_code(pdu).unwrap_or(0);
            if status == Status::MALFORMED_REPLY {
                self.window.refuse(frame, range);
                continue;
            }
            self.at = range.start as u16;
            self.count_reply(status);
            return status;
        }
    }

    fn count_reply(&mut self, status: Status) {
        self.storage.count(Counter::Replies, 1);
        if status != Status::OK {
            self.storage.count(Counter::Exceptions, 1);
        }
        if self.window.has_passed_noise() {
            self.storage.count(Counter::Resynchronisations, 1);
        }
        self.count_foreign();
    }

    fn count_foreign(&mut self) {
        let frames = usize::from(self.window.foreign_frames());
        self.storage.count(Counter::ForeignFrames, frames);
    }

    /// No reply came: asks again, or says why with the most telling status.
    fn fail(&mut self) -> Status {
        self.count_foreign();
        // What was taken for a damaged reply may have been noise.
        self.late = true;
        self.last_byte = self.now;
        let status = match self.window.seen() {
            Seen::Nothing => Status::RESPONSE_TIMED_OUT,
            Seen::OtherUnit => Status::INVALID_SLAVE_ID,
            Seen::OtherFunction => Status::INVALID_FUNCTION,
            Seen::Malformed => Status::MALFORMED_REPLY,
            Seen::BadCrc => Status::INVALID_CRC,
            Seen::TooLong => return Status::BUFFER_TOO_SMALL,
        };
        let counter = if status == Status::INVALID_CRC {
            Counter::BadCrc
        } else {
            Counter::Timeouts
        };
        self.storage.count(counter, 1);
        if self.retries == 0 {
            return status;
        }
        self.retries -= 1;
        self.listen_from(self.now);
        Status::PENDING
    }
}
