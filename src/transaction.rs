//! One request and its reply over a byte stream, moved on by `poll`.
//!
//! This is the only receive state machine of the client side. A reply is
//! found, not assumed: noise, frames of other units, late replies and a local
//! echo in front of it cost nothing but their own time.
//!
//! What RTU cannot tell apart: a late reply of the same unit, function and
//! length to an earlier request looks like the reply. After a timeout the
//! line is therefore given a quiet time before the next request.

use crate::bytes::Writer;
use crate::error::Status;
use crate::frame::rtu::{self, Event, Fit, Window};
use crate::pdu::request::Request;
use crate::pdu::{response, EXCEPTION};
use crate::port::Port;
use crate::time::{self, elapsed, millis};

/// What is counted, in the order of the counters' storage.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Counter {
    /// Requests sent, retries included.
    Requests,
    /// Replies that answered a request, exceptions included.
    Replies,
    /// Replies that were exceptions.
    Exceptions,
    /// Complete replies with a wrong CRC.
    BadCrc,
    /// Requests that were not answered in time.
    Timeouts,
    /// Frames with a right CRC that were not for us or no answer.
    ForeignFrames,
    /// Replies that were found behind bytes that were no frame.
    Resynchronisations,
    /// Bytes sent.
    BytesSent,
    /// Bytes received.
    BytesReceived,
}

/// How many kinds of [`Counter`] there are.
pub const COUNTERS: usize = 9;

/// The buffers that the caller lends.
pub struct Lent<'a> {
    /// One frame: of a request first, then of what arrives.
    pub frame: &'a mut [u8],
    /// The words that writing requests send.
    pub transmit: &'a mut [u16],
    /// The words that a successful read fills.
    pub response: &'a mut [u16],
}

/// What the caller lends to a transaction.
pub trait Storage {
    /// The buffers.
    fn lend(&mut self) -> Lent<'_>;

    /// Adds to a counter, if there is storage for counters.
    fn count(&mut self, _counter: Counter, _more: usize) {}
}

/// How a transaction behaves; kept from one to the next.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Silence before a request, in microseconds.
    pub gap: u32,
    /// The silence t3.5 that ends a frame, in microseconds.
    pub silence: u32,
    /// One character, in microseconds.
    pub character: u16,
    /// From the end of the request to the end of the reply, in milliseconds.
    pub response_timeout: u16,
    /// What slaves are given to carry out a broadcast, in milliseconds.
    pub turnaround_delay: u16,
    /// What a late reply is given after a timeout, in milliseconds.
    pub quiet_time: u16,
    /// How often a request is repeated that was not answered.
    pub retries: u8,
    /// How long the driver is held on after the flush, in characters.
    pub post_flush_hold: u8,
    /// Whether each request comes back before its reply.
    pub echo_discard: bool,
}

impl Settings {
    /// What holds until somebody says otherwise.
    pub const DEFAULT: Settings = Settings {
        gap: time::DEFAULT_SILENCE,
        silence: time::DEFAULT_SILENCE,
        character: time::DEFAULT_CHARACTER,
        response_timeout: 2000,
        turnaround_delay: 100,
        quiet_time: 100,
        retries: 0,
        post_flush_hold: 0,
        echo_discard: false,
    };
}

/// Where a transaction stands. Integers, since C holds the storage.
mod phase {
    /// Nothing to do.
    pub const IDLE: u8 = 0;
    /// Waiting for the line to be silent.
    pub const GAP: u8 = 1;
    /// Handing the frame to the port; the driver is on.
    pub const SEND: u8 = 2;
    /// Waiting for the port to drain; the driver is on.
    pub const FLUSH: u8 = 3;
    /// Holding the driver on a little longer.
    pub const HOLD: u8 = 4;
    /// Waiting for the reply.
    pub const REPLY: u8 = 5;
    /// Waiting for the slaves to carry out a broadcast.
    pub const TURNAROUND: u8 = 6;
}

/// What was seen while no reply came, the more telling the greater.
mod seen {
    pub const NOTHING: u8 = 0;
    pub const OTHER_UNIT: u8 = 1;
    pub const OTHER_FUNCTION: u8 = 2;
    pub const MALFORMED: u8 = 3;
    pub const BAD_CRC: u8 = 4;
    pub const TOO_LONG: u8 = 5;
}

/// One request and its reply.
#[derive(Clone, Copy, Debug)]
pub struct Transaction {
    /// When the phase began.
    since: u32,
    /// When the line was last seen busy.
    last_byte: u32,
    request: Request,
    window: Window,
    /// Bytes of the request frame, and how many of them are sent.
    length: u16,
    sent: u16,
    phase: u8,
    unit: u8,
    seen: u8,
    retries: u8,
    exception: u8,
    /// The phase began with the last poll; its time is that of the next.
    stamp: bool,
    /// The last poll found nothing to do.
    waiting: bool,
    /// What arrived was searched to its end.
    skimmed: bool,
    /// The last reply timed out, and may still come.
    late: bool,
    /// The request itself is expected to come back before the reply.
    echo: bool,
}

/// The unit that every slave listens to (serial line guide 2.2).
pub const BROADCAST: u8 = 0;

impl Transaction {
    /// No transaction.
    pub const NEW: Transaction = Transaction {
        since: 0,
        last_byte: 0,
        request: Request::NONE,
        window: Window::EMPTY,
        length: 0,
        sent: 0,
        phase: phase::IDLE,
        unit: 0,
        seen: 0,
        retries: 0,
        exception: 0,
        stamp: false,
        waiting: false,
        skimmed: false,
        late: false,
        echo: false,
    };

    /// True while a request is under way.
    pub const fn is_pending(&self) -> bool {
        self.phase != phase::IDLE
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

    /// Says that the line was busy at `now`, so the gap counts from there.
    pub fn line_used(&mut self, now: u32) {
        self.last_byte = now;
    }

    /// Starts `request` to `unit`; `poll` does the rest.
    ///
    /// # Errors
    /// [`Status::BUSY`] if one is under way, [`Status::BROADCAST_NOT_ALLOWED`]
    /// for a read from unit 0. Nothing is sent then.
    pub fn start(
        &mut self,
        now: u32,
        unit: u8,
        request: Request,
        settings: &Settings,
    ) -> Result<(), Status> {
        if self.is_pending() {
            return Err(Status::BUSY);
        }
        if unit == BROADCAST && request.is_read() {
            return Err(Status::BROADCAST_NOT_ALLOWED);
        }
        self.request = request;
        self.unit = unit;
        self.retries = settings.retries;
        self.forget();
        self.enter(phase::GAP);
        self.since = now;
        self.stamp = false;
        Ok(())
    }

    /// Gives the request up, with the driver off.
    pub fn cancel(&mut self, port: &mut impl Port) {
        if matches!(self.phase, phase::SEND | phase::FLUSH | phase::HOLD) {
            port.post_transmission();
        }
        self.phase = phase::IDLE;
    }

    /// Moves the transaction on, without waiting: [`Status::PENDING`] until
    /// it has ended, then how.
    pub fn poll<P: Port, S: Storage>(
        &mut self,
        now: u32,
        port: &mut P,
        storage: &mut S,
        settings: &Settings,
    ) -> Status {
        self.waiting = false;
        if self.stamp {
            self.stamp = false;
            self.since = now;
            self.last_byte = now;
        }
        let step = match self.phase {
            phase::GAP => self.listen(now, port, storage, settings),
            phase::SEND => self.send(now, port, storage, settings),
            phase::FLUSH => self.flush(now, port, settings),
            phase::HOLD => self.hold(now, port, settings),
            phase::REPLY => self.receive(now, port, storage, settings),
            phase::TURNAROUND => self.turn_around(now, settings),
            _ => return Status::OK,
        };
        if step == Status::PENDING {
            step
        } else {
            self.end(now, step, port, storage)
        }
    }

    /// Enters a phase whose time counts from the next poll on.
    fn enter(&mut self, phase: u8) {
        self.phase = phase;
        self.stamp = true;
    }

    /// Listens until the line has been silent, then sends. What arrives here
    /// belongs to no request of ours.
    fn listen<P: Port, S: Storage>(
        &mut self,
        now: u32,
        port: &mut P,
        storage: &mut S,
        settings: &Settings,
    ) -> Status {
        let count = match port.read(storage.lend().frame) {
            Ok(count) => count,
            Err(status) => return status,
        };
        if count > 0 {
            storage.count(Counter::BytesReceived, count);
            self.last_byte = now;
        }
        let quiet = if self.late {
            millis(settings.quiet_time)
        } else {
            0
        };
        let silent = elapsed(now, self.last_byte);
        if count == 0 && silent >= settings.gap && silent >= quiet {
            return self.emit(now, port, storage, settings);
        }
        if elapsed(now, self.since) >= millis(settings.response_timeout).saturating_add(quiet) {
            return Status::LINE_BUSY;
        }
        self.waiting = count == 0;
        Status::PENDING
    }

    /// Builds the frame and begins to send it.
    fn emit<P: Port, S: Storage>(
        &mut self,
        now: u32,
        port: &mut P,
        storage: &mut S,
        settings: &Settings,
    ) -> Status {
        let lent = storage.lend();
        let mut writer = Writer::new(lent.frame);
        writer.u8(self.unit);
        self.request.emit(&mut writer, lent.transmit);
        rtu::seal(&mut writer);
        let Some(length) = writer.finish() else {
            return Status::BUFFER_TOO_SMALL;
        };
        self.length = length as u16;
        self.sent = 0;
        self.late = false;
        self.seen = seen::NOTHING;
        self.skimmed = false;
        self.echo = settings.echo_discard;
        self.window = Window::EMPTY;
        self.since = now;
        self.phase = phase::SEND;
        storage.count(Counter::Requests, 1);
        port.pre_transmission();
        self.send(now, port, storage, settings)
    }

    fn send<P: Port, S: Storage>(
        &mut self,
        now: u32,
        port: &mut P,
        storage: &mut S,
        settings: &Settings,
    ) -> Status {
        let frame = storage.lend().frame;
        let rest = usize::from(self.sent)..usize::from(self.length);
        match port.write(frame.get(rest).unwrap_or_default()) {
            Ok(count) => {
                self.sent += count as u16;
                storage.count(Counter::BytesSent, count);
            }
            Err(status) => return status,
        }
        if self.sent >= self.length {
            self.phase = phase::FLUSH;
            return self.flush(now, port, settings);
        }
        self.stalled(now, settings)
    }

    fn flush<P: Port>(&mut self, now: u32, port: &mut P, settings: &Settings) -> Status {
        if !port.flush() {
            return self.stalled(now, settings);
        }
        if settings.post_flush_hold > 0 {
            self.enter(phase::HOLD);
        } else {
            self.release(port);
        }
        Status::PENDING
    }

    /// A port that takes nothing and drains nothing is not waited for longer
    /// than a reply.
    fn stalled(&self, now: u32, settings: &Settings) -> Status {
        if elapsed(now, self.since) >= millis(settings.response_timeout) {
            Status::LINE_BUSY
        } else {
            Status::PENDING
        }
    }

    fn hold<P: Port>(&mut self, now: u32, port: &mut P, settings: &Settings) -> Status {
        let hold = u32::from(settings.post_flush_hold) * u32::from(settings.character);
        if elapsed(now, self.since) >= hold {
            self.release(port);
        }
        Status::PENDING
    }

    /// The request is on the wire: the driver goes off, the wait begins.
    fn release<P: Port>(&mut self, port: &mut P) {
        port.post_transmission();
        self.enter(if self.unit == BROADCAST {
            phase::TURNAROUND
        } else {
            phase::REPLY
        });
    }

    fn turn_around(&mut self, now: u32, settings: &Settings) -> Status {
        if elapsed(now, self.since) >= millis(settings.turnaround_delay) {
            return Status::OK;
        }
        self.waiting = true;
        Status::PENDING
    }

    fn receive<P: Port, S: Storage>(
        &mut self,
        now: u32,
        port: &mut P,
        storage: &mut S,
        settings: &Settings,
    ) -> Status {
        let count = match port.read(self.window.room(storage.lend().frame)) {
            Ok(count) => count,
            Err(status) => return status,
        };
        let mut found = Status::PENDING;
        if count > 0 {
            self.last_byte = now;
            self.skimmed = false;
            self.window.arrived(count);
            storage.count(Counter::BytesReceived, count);
            found = self.search(storage, false);
        }
        let silent = count == 0 && elapsed(now, self.last_byte) >= settings.silence;
        let over = elapsed(now, self.since) >= millis(settings.response_timeout);
        if found == Status::PENDING && (silent || over) && !self.skimmed {
            found = self.skim(storage);
        }
        if found != Status::PENDING {
            return found;
        }
        if over || (silent && self.seen >= seen::BAD_CRC) {
            self.late = over;
            return self.failure();
        }
        self.waiting = count == 0;
        Status::PENDING
    }

    /// Looks for the reply in what has arrived, from the candidate on.
    fn search<S: Storage>(&mut self, storage: &mut S, skim: bool) -> Status {
        loop {
            let frame = storage.lend().frame;
            let (request, echo) = (&self.request, self.echo);
            let event = self.window.next(frame, self.unit, skim, |pdu| {
                if echo {
                    match request.fit_echo(pdu) {
                        Fit::No => {}
                        fit => return fit,
                    }
                }
                response::fit(request, pdu)
            });
            match event {
                Event::More => return Status::PENDING,
                Event::Frame { at, length } => {
                    let pdu = frame.get(at..at + length).unwrap_or_default();
                    if echo && request.fit_echo(pdu) == Fit::Length(length) {
                        self.echo = false;
                        self.window.at_boundary();
                        continue;
                    }
                    let status = response::judge(request, pdu);
                    self.exception = response::exception_code(request, pdu).unwrap_or(0);
                    if status != Status::MALFORMED_REPLY {
                        if self.window.has_passed_noise() {
                            storage.count(Counter::Resynchronisations, 1);
                        }
                        return status;
                    }
                    self.window.at_boundary();
                    storage.count(Counter::ForeignFrames, 1);
                    self.note(seen::MALFORMED);
                }
                Event::BadCrc { at } => {
                    let pdu = frame.get(at..).unwrap_or_default();
                    if echo && request.fit_echo(pdu) != Fit::No {
                        self.echo = false;
                    } else if !skim {
                        self.note(seen::BAD_CRC);
                    }
                }
                Event::TooLong => self.note(seen::TOO_LONG),
                Event::Foreign { unit, function } => {
                    storage.count(Counter::ForeignFrames, 1);
                    // What looked like a damaged reply was part of this frame.
                    if self.seen == seen::BAD_CRC {
                        self.seen = seen::NOTHING;
                    }
                    self.note(if unit != self.unit {
                        seen::OTHER_UNIT
                    } else if function & !EXCEPTION != self.request.function() {
                        seen::OTHER_FUNCTION
                    } else {
                        seen::MALFORMED
                    });
                }
            }
        }
    }

    /// Looks behind a candidate that does not get complete: it may be noise
    /// that looks like the reply's first bytes. The candidate is kept, for
    /// the rest of it may still come.
    fn skim<S: Storage>(&mut self, storage: &mut S) -> Status {
        self.skimmed = true;
        let candidate = self.window;
        let found = self.search(storage, true);
        if found == Status::PENDING {
            self.window = candidate;
        }
        found
    }

    fn note(&mut self, seen: u8) {
        self.seen = self.seen.max(seen);
    }

    /// The most telling status for a reply that never came.
    fn failure(&self) -> Status {
        match self.seen {
            seen::OTHER_UNIT => Status::INVALID_SLAVE_ID,
            seen::OTHER_FUNCTION => Status::INVALID_FUNCTION,
            seen::MALFORMED => Status::MALFORMED_REPLY,
            seen::BAD_CRC => Status::INVALID_CRC,
            seen::TOO_LONG => Status::BUFFER_TOO_SMALL,
            _ => Status::RESPONSE_TIMED_OUT,
        }
    }

    /// Ends an attempt: the driver is off, the outcome counted, and the
    /// request repeated if that may help.
    fn end<P: Port, S: Storage>(
        &mut self,
        now: u32,
        status: Status,
        port: &mut P,
        storage: &mut S,
    ) -> Status {
        self.cancel(port);
        match status {
            Status::RESPONSE_TIMED_OUT => storage.count(Counter::Timeouts, 1),
            Status::INVALID_CRC => storage.count(Counter::BadCrc, 1),
            Status::OK if self.unit == BROADCAST => {}
            Status::OK => storage.count(Counter::Replies, 1),
            status if status.is_exception() => {
                storage.count(Counter::Replies, 1);
                storage.count(Counter::Exceptions, 1);
            }
            _ => {}
        }
        if self.late {
            self.last_byte = now;
        }
        if self.retries > 0 && status.is_worth_a_retry() {
            self.retries -= 1;
            self.since = now;
            self.phase = phase::GAP;
            return Status::PENDING;
        }
        status
    }

    /// The PDU of the reply that ended the transaction with success.
    pub fn reply<'a>(&self, frame: &'a [u8]) -> &'a [u8] {
        self.window
            .last_frame(frame, self.request.response_length())
    }
}
