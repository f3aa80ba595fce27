//! Moves a request on, from its start to its end: writes its frame, waits until its last bit has
//! left, and takes the received bytes.

use super::{
    Count, Engine, Finding, LateUnits, Moment, Phase, Settings, Storage, Transaction, BROADCAST,
};
use crate::error::Status;
use crate::frame::rtu;
use crate::frame::rtu::{crc16, Crc16};
use crate::port::Port;
use crate::time::{add_characters, elapsed, has_elapsed, sure_to_be_sending};

impl<P, S: Storage, Q: Transaction<P, S>> Engine<P, S, Q> {
    /// True while a request is pending.
    pub fn is_pending(&self) -> bool {
        self.phase != Phase::Idle
    }

    /// True if the request waits for the line or the reply, with the driver off. The caller may
    /// do something else for a while.
    pub fn is_waiting(&self) -> bool {
        self.phase != Phase::Idle && self.phase < Phase::Send
    }

    /// True if the request was sent, and waits for its reply or, as a broadcast, for the devices.
    pub fn is_sent(&self) -> bool {
        matches!(self.phase, Phase::Reply | Phase::Turnaround)
    }

    /// True if the request was sent and its reply has not come.
    pub(crate) fn awaits_reply(&self) -> bool {
        self.phase == Phase::Reply
    }

    /// How many bytes the frame buffer holds.
    pub(crate) fn end(&self) -> S::Count {
        self.end
    }

    /// The request that [`Engine::start`] sends.
    pub const fn request(&mut self) -> &mut Q {
        &mut self.request
    }

    /// The raw exception code of the last reply; 0 if the reply was no exception.
    pub const fn exception_code(&self) -> u8 {
        self.exception
    }

    /// Makes `now` the zero of the clock. Times before `now - longest` become `now - longest`.
    /// For model checkers: two engines that will behave alike become equal.
    // For model checkers.
    #[doc(hidden)]
    pub fn rebase(&mut self, now: u32, longest: u32) {
        for time in [&mut self.since, &mut self.begun, &mut self.now] {
            *time = 0u32.wrapping_sub(elapsed(now, *time).min(longest));
        }
        self.late_units.rebase(now);
    }

    /// Enters a phase, whose wait begins with the next look at the clock.
    pub(super) fn enter(&mut self, phase: Phase) {
        self.phase = phase;
        self.phase_begins = true;
    }

    /// Stores the time `now`, and starts the time of a phase that has just begun.
    fn look_at_clock(&mut self, now: u32) {
        self.now = now;
        if self.phase_begins {
            self.phase_begins = false;
            self.begun = now;
            // Before a request, the silence counts from the last use of the line.
            if self.phase != Phase::Gap {
                self.since = now;
            }
        }
    }

    /// True once the wait is over.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn has_expired(&self) -> bool {
        has_elapsed(self.wait, self.now, self.since)
    }
}

impl<P: Port, S: Storage, Q: Transaction<P, S>> Engine<P, S, Q> {
    /// An engine without a request.
    pub const fn new(port: P, storage: S) -> Self {
        Engine {
            phase: Phase::Idle,
            phase_begins: false,
            unit: 0,
            function: 0,
            retries: 0,
            exception: 0,
            seen: Finding::OK,
            is_early: false,
            owed: 0,
            is_held: false,
            is_late: false,
            awaits_end: false,
            has_more: false,
            run_kind: Finding::MALFORMED,
            run_length: S::Count::ZERO,
            length: S::Count::ZERO,
            end: S::Count::ZERO,
            kept: S::Count::ZERO,
            content: S::Count::ZERO,
            outgoing: S::Count::ZERO,
            sent: S::Count::ZERO,
            counted: S::Count::ZERO,
            foreign_frames: 0,
            run: Crc16::START,
            received: 0,
            storage,
            since: 0,
            wait: 0,
            begun: 0,
            now: 0,
            late_units: LateUnits::NONE,
            port,
            request: Q::NONE,
            tally: Some(Engine::count),
            lenient: None,
            extras: Some(Engine::extras),
            settings: Settings::DEFAULT,
        }
    }

    /// Notes that the line is in use now. The gap counts from now. Nothing changes while a
    /// request is on the line.
    pub fn line_used(&mut self) {
        if self.phase <= Phase::Gap {
            self.since = self.port.micros();
        }
    }

    /// Notes that the line was in use at `time`, by the clock of the port. The gap counts from
    /// `time`, unless the line was in use later. Nothing changes while a request is on the line.
    pub fn line_used_at(&mut self, time: u32) {
        if self.phase <= Phase::Gap {
            let now = self.port.micros();
            if elapsed(now, time) < elapsed(now, self.since) {
                self.since = time;
            }
        }
    }

    /// Moves the request on at the time `now`, without waiting. Returns
    /// [`Status::PENDING`] until the request has ended, then its status.
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn poll(&mut self, now: u32) -> Status {
        self.look_at_clock(now);
        let status = match self.phase {
            Phase::Idle => return Status::OK,
            Phase::Rest | Phase::Gap | Phase::Reply => self.listen(),
            Phase::Turnaround if self.has_expired() => Status::OK,
            Phase::Turnaround => Status::PENDING,
            _ => self.send(),
        };
        self.tally(status);
        if status != Status::PENDING {
            if status.is_failure() {
                self.end_on_line(false);
            }
            self.phase = Phase::Idle;
        }
        status
    }

    /// Reads received bytes into `space` bytes of the frame buffer from `index` on. Returns how
    /// many; negative if the link is lost.
    #[inline(always)]
    fn read_bytes(&mut self, index: S::Count, space: S::Count) -> i16 {
        let received = self.port.read_count(self.storage.bytes(index, space));
        if received > 0 {
            self.received = self.received.wrapping_add(received as u16);
        }
        received
    }

    /// Reads the received bytes at the time `now` and drops them, while no request is pending. Notes
    /// which units have sent the frames among them. Negative if the link is lost.
    pub fn drop_received(&mut self, now: u32, is_rtu: bool) -> i16 {
        // Bytes of the frame that is being received may have been dropped. The frames that the
        // last request saw do not matter any more.
        if has_elapsed(self.settings.silence.get(), now, self.since)
            || self.end == self.space()
            || self.run_length > self.end
            || self.seen != Finding::NOTHING
        {
            self.end = S::Count::ZERO;
            self.begin_frame();
        }
        let received = self.read_bytes(self.end, self.space() - self.end);
        if received > 0 {
            self.since = now;
            self.now = now;
            if is_rtu {
                for _ in 0..received {
                    self.end += 1u8.into();
                    if self.continue_frame() {
                        let unit = self.storage.byte(self.end - self.run_length);
                        self.note_reply_of(unit);
                        self.begin_frame();
                    }
                }
            } else {
                // The reply before has been stored by now.
                self.content = S::Count::ZERO;
                Q::search(self, self.end, S::Count::of(received as usize));
            }
            self.see_nothing();
            self.tally(Status::PENDING);
        }
        received
    }

    /// Notes that the line was in use until now.
    #[cfg_attr(target_os = "none", inline(never))]
    fn note_use(&mut self) {
        self.now = self.port.micros();
        self.since = self.now;
    }

    /// Searches the bytes that have arrived, and ends the wait for silence or for the reply once
    /// it is over.
    fn listen(&mut self) -> Status {
        // All received bytes are searched, also if the port returns them one by one. If they never
        // end, the poll ends after as many as an AVR searches in 30 ms at most.
        const MOST: u8 = 80;
        let mut budget = S::Count::from(MOST);
        loop {
            if self.end == self.space() {
                self.make_space();
            }
            let first = self.end;
            let space = if P::READS_SINGLE_BYTES || self.is_lenient() {
                1u8.into()
            } else {
                self.space() - first
            };
            let received = self.read_bytes(first, space);
            if received < 0 {
                return Status::LINK_LOST;
            }
            let received = S::Count::of(received as usize);
            if received == S::Count::ZERO {
                break;
            }
            if self.phase <= Phase::Gap {
                // They overwrite the request.
                self.outgoing = S::Count::ZERO;
            }
            if Q::search(self, first, received) {
                if self.phase <= Phase::Gap {
                    self.note_unexpected();
                } else {
                    self.since = self.now;
                    if budget < MOST.into() {
                        // The poll has begun long before the last byte came.
                        self.note_use();
                    }
                    return self.settle();
                }
            }
            if budget < received {
                budget = S::Count::ZERO;
                break;
            }
            budget -= received;
        }
        self.has_more = budget == S::Count::ZERO;
        let mut is_old = false;
        if budget < MOST.into() {
            let is_before = self.phase <= Phase::Gap;
            if is_before || self.wait_for_silence() {
                // The search may have taken long. The silence begins after it.
                self.note_use();
            }
            if self.phase == Phase::Rest {
                // The request has waited for its unit. The line was not busy.
                self.begun = self.now;
            }
            // Received bytes extend the wait, but not for ever. They may also end the quiet time,
            // which counts until now.
            is_old = self.is_overdue(self.begun);
            if is_before {
                self.wait = self.line_silence();
                self.phase = Phase::Gap;
            }
        }
        let is_over = !self.has_more && self.has_expired();
        if self.phase <= Phase::Gap {
            if is_over {
                return self.leave_gap();
            }
            return if is_old {
                Status::LINE_BUSY
            } else {
                Status::PENDING
            };
        }
        if !is_over && !is_old {
            return Status::PENDING;
        }
        if self.may_end_in_silence() && !self.find_in_silence() {
            return Status::PENDING;
        }
        if self.is_held_in_vain() && self.seen.is_response() {
            self.seen = Finding::NOTHING;
        }
        self.settle()
    }

    /// True if the wait and the response timeout after it have passed since the time `since`.
    pub(super) fn is_overdue(&self, since: u32) -> bool {
        let limit = self.wait.wrapping_add(Q::response_timeout(self));
        has_elapsed(limit, self.now, since)
    }

    /// Lets silence end the wait for the reply if it is known how the request ends, and sets how
    /// long the silence must last. Returns false if it is not known.
    fn wait_for_silence(&mut self) -> bool {
        if self.is_held {
            self.wait = self.hold();
        } else if self.is_early || self.may_end_in_silence() {
            self.wait = self.settings.silence.get();
        } else {
            return false;
        }
        true
    }

    /// True if bytes have arrived that may be a reply of unknown length, which silence ends.
    fn may_end_in_silence(&self) -> bool {
        !Q::IS_OF_MASTER && self.awaits_end
    }

    /// Searches the received bytes for a reply that ends with the silence. False if the request
    /// still waits for its reply.
    fn find_in_silence(&mut self) -> bool {
        self.awaits_end = false;
        let length = Q::find_ending_reply(self, true);
        if length > S::Count::ZERO && self.accept(length) && self.take_response() {
            return true;
        }
        if self.is_held {
            self.wait = self.hold();
        } else if !self.is_early {
            self.since = self.begun;
            self.wait_for_reply();
        }
        self.has_expired()
    }

    /// Ends the request with the finding in `seen`.
    fn settle(&mut self) -> Status {
        self.run_lenient(Moment::End);
        if self.run_extras(Moment::End) {
            return Status::PENDING;
        }
        if self.seen.is_response() {
            self.expect_no_late_reply();
        }
        self.seen.status()
    }

    /// Runs `extras`, if it is in use. Returns true if it replaces the code that follows.
    #[cfg_attr(target_arch = "avr", inline(never))]
    pub(super) fn run_extras(&mut self, moment: Moment) -> bool {
        self.extras.is_some_and(|extras| extras(self, moment))
    }

    /// As [`Engine::run_extras`], what accepts deviating replies.
    #[inline(always)]
    pub(super) fn run_lenient(&mut self, moment: Moment) -> bool {
        self.lenient.is_some_and(|lenient| lenient(self, moment))
    }

    /// Cancels the request and switches the driver off. If the request was sent completely,
    /// its reply may still come.
    pub fn cancel(&mut self) {
        self.tally(Status::CANCELLED);
        self.end_on_line(true);
        self.phase = Phase::Idle;
    }

    /// Ends a request without a right reply on the line: switches the driver off, and notes that
    /// the reply may come late. `is_cancelled` is true if the program has cancelled it.
    fn end_on_line(&mut self, is_cancelled: bool) {
        if self.phase <= Phase::Gap {
            return;
        }
        if self.phase != Phase::Send && self.phase != Phase::Turnaround {
            self.expect_late_reply(is_cancelled);
        }
        if self.phase >= Phase::Send {
            self.port.post_transmission();
        }
        self.since = self.port.micros();
    }

    /// Microseconds from `now` for which poll will find nothing to do unless a byte arrives; 0 if
    /// the last poll has left bytes unread, or if only the port knows; `u32::MAX` if no request is
    /// pending. A phase that has just begun counts its time from this call, so the caller may sleep
    /// for the returned time.
    pub fn poll_delay(&mut self, now: u32) -> u32 {
        self.look_at_clock(now);
        let (wait, since) = match self.phase {
            Phase::Idle => return u32::MAX,
            // The port may take the next byte at any time.
            _ if self.has_more || self.phase == Phase::Send => return 0,
            Phase::Flush => {
                let sent = self.sent.to_u16();
                (
                    sure_to_be_sending(self.settings.character, sent),
                    self.begun,
                )
            }
            _ => (self.wait, self.since),
        };
        wait.saturating_sub(elapsed(now, since))
    }
}

impl<P: Port, S: Storage, Q: Transaction<P, S>> Engine<P, S, Q> {
    /// Starts the request to `unit`; the calls of `poll` send it. A refused request sends
    /// nothing: [`Status::BROADCAST_NOT_ALLOWED`] for a request to unit 0 that may not be
    /// broadcast, [`Status::BUFFER_TOO_SMALL`] if the frame buffer cannot hold the request.
    pub fn start(&mut self, unit: u8) -> Status {
        if unit == BROADCAST && !self.request.may_be_broadcast() {
            return Status::BROADCAST_NOT_ALLOWED;
        }
        self.start_any(unit)
    }

    /// As [`Engine::start`], also for a request to unit 0 that may not be broadcast.
    #[inline(always)]
    pub fn start_any(&mut self, unit: u8) -> Status {
        if !self.request.fits(self.storage.capacity()) {
            return Status::BUFFER_TOO_SMALL;
        }
        self.unit = unit;
        self.function = self.request.function();
        self.length = self.request.reply_length();
        if Q::IS_OF_MASTER {
            self.retries = 0;
        }
        self.begin()
    }

    /// Writes the frame of the request and enters the phase that waits for silence.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn begin(&mut self) -> Status {
        Q::write(self);
        self.look_up_owed();
        self.begin_search();
        self.wait = self.line_silence();
        self.enter(Phase::Gap);
        Status::PENDING
    }

    /// Prepares the search for the reply to the request.
    fn begin_search(&mut self) {
        self.kept = S::Count::ZERO;
        self.awaits_end = false;
        self.end = S::Count::ZERO;
        self.content = S::Count::ZERO;
        self.see_nothing();
        self.has_more = false;
        self.is_held = false;
        self.begin_frame();
    }

    /// A right reply has arrived before the request was sent. It belongs to an earlier request. If
    /// the unit owes none, more late replies may come. None of them is that of a cancelled request.
    #[cold]
    pub(super) fn note_unexpected(&mut self) {
        if self.owes() {
            self.note_reply_of(self.unit);
        } else {
            self.owed = 0;
            self.expect_late_reply(false);
        }
        self.begin_search();
    }

    /// Sends the request, now that the line is silent, unless its unit is not clean yet.
    pub(super) fn leave_gap(&mut self) -> Status {
        self.is_late = false;
        self.look_up_owed();
        if self.rest() {
            return Status::PENDING;
        }
        self.wait = 0;
        self.transmit()
    }

    /// Switches the driver on and begins to send.
    fn transmit(&mut self) -> Status {
        if self.outgoing == S::Count::ZERO {
            Q::write(self);
        }
        self.since = self.now;
        self.begun = self.now;
        self.phase = Phase::Send;
        self.port.pre_transmission();
        self.send()
    }

    /// Writes the frame to the port, waits until the port has sent it, and keeps the driver on
    /// for the post-flush hold.
    pub(super) fn send(&mut self) -> Status {
        if self.phase == Phase::Send {
            let left = self.outgoing - self.sent;
            let sent = self.port.write_count(self.storage.bytes(self.sent, left));
            if sent < 0 {
                return Status::LINK_LOST;
            }
            if sent == 0 {
                return self.stalled();
            }
            let sent = S::Count::of(sent as usize);
            self.sent += sent;
            self.since = self.now;
            if sent < left {
                return Status::PENDING;
            }
            self.phase = Phase::Flush;
            self.wait_for_characters(self.settings.any_character(), self.sent);
        }
        if self.phase == Phase::Flush && !self.port.flush() {
            return self.stalled();
        }
        if self.run_extras(Moment::Sent) {
            return Status::PENDING;
        }
        // The request has been sent: the driver goes off, and the wait for the reply begins.
        self.begin_search();
        if !self.settings.echo_discard {
            self.outgoing = S::Count::ZERO;
        }
        self.port.post_transmission();
        let is_broadcast = self.unit == BROADCAST && self.request.may_be_broadcast();
        let phase = if is_broadcast || !self.request.is_answered() {
            Phase::Turnaround
        } else {
            Phase::Reply
        };
        self.enter(phase);
        self.begun = self.now;
        self.wait_for_reply();
        Status::PENDING
    }

    /// The status of a request whose port does not go on.
    fn stalled(&self) -> Status {
        // The port has as long as the request waited for silence, and the response timeout.
        if self.is_overdue(self.since) {
            Status::LINE_BUSY
        } else {
            Status::PENDING
        }
    }

    /// Waits for the reply until the response timeout, or for the turnaround delay. A port that
    /// does not know when the last bit has left may have bytes left to send.
    pub(super) fn wait_for_reply(&mut self) {
        self.wait = if self.phase == Phase::Turnaround {
            self.settings.turnaround_delay.get()
        } else {
            Q::response_timeout(self)
        };
        if !self.port.knows_when_sent() {
            self.wait_for_characters(self.settings.character, self.sent);
        }
    }

    /// Extends the wait by `count` characters of `character` microseconds.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn wait_for_characters(&mut self, character: u16, count: S::Count) {
        add_characters(&mut self.wait, count, character);
    }
}

impl<P, S: Storage, Q> Engine<P, S, Q> {
    /// Appends the CRC to the `length` bytes in the frame buffer, and makes them the frame to
    /// send.
    pub(crate) fn append_crc(&mut self, length: S::Count) {
        let [low, high] = crc16(self.storage.slice(S::Count::ZERO, length)).to_bytes();
        self.storage.set_byte(length, low);
        self.storage.set_byte(length + 1u8.into(), high);
        self.set_frame_length(length + rtu::CRC.into());
    }

    /// Sets how many bytes of the frame buffer are to be sent.
    pub(crate) fn set_frame_length(&mut self, length: S::Count) {
        self.outgoing = length;
        self.sent = S::Count::ZERO;
    }
}
