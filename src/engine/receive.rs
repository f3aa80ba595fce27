//! Waits for the reply, and keeps a late reply from being delivered as the answer to a later
//! request.
//!
//! A device that answers in order, but later than the timeout, sends two replies after the
//! next request: first the late reply, then the right one. So after a request without a right
//! reply, the engine holds the next reply of that unit until the line has been silent for the
//! response timeout. A device that answers within the response timeout sends its second reply
//! before that. The second right reply replaces the held one. If it arrives damaged, the
//! request fails, because the held reply is then most likely the late one. If only damaged
//! replies came since the last right one, the quiet time suffices, because none is late.

use super::{
    Count, Counter, Engine, Phase, Probation, RequestSpec, RxFault, Storage, Words, BROADCAST,
};
use crate::error::Status;
use crate::frame::checksum::Crc16;
use crate::pdu::master_request::MasterRequest;
use crate::port::Port;
use crate::FIRMWARE;

impl<P: Port, S: Storage, Q: RequestSpec<P, S>> Engine<P, S, Q> {
    /// Reads the received bytes at the time `now` and drops them. Negative if the link is lost.
    pub fn drop_received(&mut self, now: u32) -> i16 {
        self.look_at_clock(now);
        self.read_bytes(S::Count::ZERO)
    }

    /// Reads received bytes into the frame buffer from `index` on. Returns how many; negative
    /// if the link is lost.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn read_bytes(&mut self, index: S::Count) -> i16 {
        let space = self.storage.capacity() - index;
        let received = self.port.read(self.storage.bytes(index, space));
        if received > 0 {
            self.storage.count(Counter::BytesReceived, received as u16);
            self.last_byte = self.now;
        }
        received
    }

    /// Notes that the reply to the pending request may come late.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn expect_late_reply(&mut self) {
        // A damaged reply has come, so none is late.
        let is_damaged = self.phase == Phase::Reply && self.fault == RxFault::BAD_CRC;
        self.has_slow_unit &= self.late_units != [0; 4];
        self.has_slow_unit |= !is_damaged;
        self.late = true;
        let (byte, bit) = self.late_unit();
        *byte |= bit;
    }

    /// How long the line must be silent before a held reply is accepted.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn hold(&mut self) -> u32 {
        let quiet_time = self.settings.quiet_time;
        if self.has_slow_unit {
            quiet_time.max(Q::response_timeout(self))
        } else {
            quiet_time
        }
    }

    /// The byte of `late_units` that has the bit of the pending request's unit, and that bit.
    #[cfg_attr(target_os = "none", inline(never))]
    fn late_unit(&mut self) -> (&mut u8, u8) {
        let [zero, one, two, three] = &mut self.late_units;
        let byte = match self.unit & 3 {
            0 => zero,
            1 => one,
            2 => two,
            _ => three,
        };
        (byte, 1 << (self.unit >> 2 & 7))
    }

    /// True if the pending request's unit did not answer its last request.
    fn is_late_unit(&mut self) -> bool {
        let (byte, bit) = self.late_unit();
        *byte & bit != 0
    }

    /// Prepares the search for the reply to the request that has just been sent.
    #[cfg_attr(target_os = "none", inline(never))]
    #[cfg_attr(not(target_os = "none"), inline(always))]
    pub(super) fn begin_reply(&mut self) {
        self.end = S::Count::ZERO;
        self.begin_frame(S::Count::ZERO);
        self.length = self.request.reply_length(self.storage.capacity());
        self.weight = Crc16::RESIDUE;
        self.fault = RxFault::NOTHING;
        self.foreign_frames = 0;
        self.resynced = true;
        if cfg!(feature = "echo") {
            self.echo = self.settings.echo_discard;
        }
        self.probation = if self.is_late_unit()
            && self.settings.quiet_time > 0
            && !self.request.has_unique_reply()
        {
            Probation::On
        } else {
            Probation::Off
        };
    }

    /// Searches the `received` bytes that have arrived before the request is sent. A right
    /// reply among them belongs to an earlier request, so more late replies may come.
    #[cold]
    #[inline(never)]
    pub(super) fn search_unexpected(&mut self, received: S::Count) {
        if self.resynced {
            self.begin_reply();
            self.resynced = false;
            self.echo = false;
        }
        self.end += received;
        let is_known = self.is_late_unit() || self.unit == BROADCAST;
        let found = !is_known && Q::find_reply(self);
        if found {
            self.exception = 0;
            self.expect_late_reply();
        }
        if found || self.end == self.storage.capacity() {
            self.end = S::Count::ZERO;
            self.begin_frame(S::Count::ZERO);
        }
    }

    #[cfg_attr(target_os = "none", inline(never))]
    #[cfg_attr(not(target_os = "none"), inline(always))]
    pub(super) fn receive<const LENIENT: bool>(&mut self) -> Status {
        let mut over = self.has_expired();
        // At the deadline all received bytes are searched, also if the port returns them one
        // by one, but at most as many as a frame buffer holds.
        let mut budget = S::Count::MAX;
        loop {
            if self.end == self.storage.capacity() {
                self.make_space::<LENIENT>();
            }
            let received = self.read_bytes(self.end);
            if received < 0 {
                return Status::LINK_LOST;
            }
            let received = S::Count::of(received as usize);
            if received == S::Count::ZERO {
                self.waiting = true;
                break;
            }
            self.end += received;
            self.resynced = false;
            let found = self.find_reply::<LENIENT>();
            if self.is_answered::<LENIENT>(found) {
                return self.found();
            }
            if !over {
                return Status::PENDING;
            }
            if budget < received {
                break;
            }
            budget -= received;
        }
        if !self.resynced && (over || self.is_silent(self.settings.silence)) {
            self.resynced = true;
            let found = Q::find_reply_in_silence(self);
            if self.is_answered::<LENIENT>(found) {
                return self.found();
            }
        }
        if self.probation == Probation::Held {
            let hold = self.hold();
            over = self.is_silent(hold) || self.has_expired();
        }
        if over {
            let is_held = !LENIENT || self.probation == Probation::Held;
            if is_held && self.accept_held() {
                return self.found();
            }
            return self.fail_unless_deviating::<LENIENT>();
        }
        // Without diagnosis the engine does not know whether the damaged bytes were a reply.
        if cfg!(feature = "diagnosis") && self.resynced && self.fault >= RxFault::BAD_CRC {
            return self.fail_unless_deviating::<LENIENT>();
        }
        Status::PENDING
    }

    /// Searches the received bytes for the reply.
    #[inline(always)]
    fn find_reply<const LENIENT: bool>(&mut self) -> bool {
        if LENIENT {
            self.find_rtu_reply::<true>()
        } else {
            Q::find_reply(self)
        }
    }

    /// Makes space in a full frame buffer: drops what was set aside.
    #[inline(always)]
    fn make_space<const LENIENT: bool>(&mut self) {
        if LENIENT {
            Q::drop_kept(self);
        }
        if !LENIENT || self.probation == Probation::Held {
            self.discard_held();
        }
    }

    /// Ends a request without a right reply. If `LENIENT`, a deviating reply that has arrived is
    /// the answer.
    #[inline(always)]
    fn fail_unless_deviating<const LENIENT: bool>(&mut self) -> Status {
        if LENIENT && Q::accept_deviating(self) {
            return self.found();
        }
        self.fail()
    }

    /// True if the reply that was `found` is the answer. A reply on probation is held, and the
    /// bytes after it are searched.
    #[inline(always)]
    fn is_answered<const LENIENT: bool>(&mut self, found: bool) -> bool {
        if !FIRMWARE && !LENIENT && self.probation == Probation::Off {
            return found;
        }
        self.is_answered_after_held::<LENIENT>(found)
    }

    #[inline(never)]
    fn is_answered_after_held<const LENIENT: bool>(&mut self, mut found: bool) -> bool {
        while found {
            if LENIENT {
                Q::drop_kept(self);
            }
            if self.probation == Probation::Off {
                return true;
            }
            self.hold_reply();
            found = self.find_reply::<LENIENT>();
        }
        false
    }

    /// Counts the reply that was found, and returns its status.
    #[cfg_attr(target_os = "none", inline(never))]
    fn found(&mut self) -> Status {
        let (byte, bit) = self.late_unit();
        *byte &= !bit;
        self.storage.count(Counter::Replies, 1);
        if self.exception != 0 {
            self.storage.count(Counter::Exceptions, 1);
        }
        if self.skipped > 0 {
            self.storage.count(Counter::Resynchronisations, 1);
        }
        self.storage
            .count(Counter::ForeignFrames, self.foreign_frames.into());
        Status::from_code(self.exception)
    }

    /// Ends a request without a reply: repeats it, or returns the status of the most severe
    /// fault.
    #[cfg_attr(target_os = "none", inline(never))]
    fn fail(&mut self) -> Status {
        self.storage
            .count(Counter::ForeignFrames, self.foreign_frames.into());
        let status = self.fault.status();
        if status == Status::BUFFER_TOO_SMALL {
            return status;
        }
        let counter = if status == Status::INVALID_CRC {
            Counter::BadCrc
        } else {
            Counter::Timeouts
        };
        self.storage.count(counter, 1);
        if !cfg!(feature = "retries") || !Q::HAS_FIXED_REPLY || self.retries == 0 {
            return status;
        }
        self.retries -= 1;
        // The damaged reply may have been noise, so the right reply may still come.
        self.expect_late_reply();
        self.last_byte = self.now;
        self.begin()
    }

    /// Holds the reply at the front of the frame buffer. It replaces a reply that was held
    /// before.
    #[cfg_attr(target_os = "none", inline(never))]
    fn hold_reply(&mut self) {
        self.discard_held();
        // Only unit and PDU are kept, so at least one byte is free for the next byte.
        self.held = self.request.content(self.needed);
        self.storage.set_aside(self.held);
        self.end -= self.held;
        self.drop_front(self.needed - self.held);
        self.begin_frame(S::Count::ZERO);
        self.fault = RxFault::NOTHING;
        self.probation = Probation::Held;
        // If the line is never silent, the wait for a second reply ends at this time.
        let timeout = Q::response_timeout(self);
        self.wait = timeout.wrapping_add(timeout).wrapping_add(self.hold());
    }

    /// Drops the held reply and counts it as a foreign frame.
    #[cfg_attr(target_os = "none", inline(never))]
    fn discard_held(&mut self) {
        let held = self.held;
        if held > S::Count::ZERO {
            self.storage.count(Counter::ForeignFrames, 1);
            self.take_back();
            self.storage.move_down(held, self.end);
        }
    }

    /// Accepts the held reply as the answer. False if no reply is held, or if the bytes after
    /// it may have been the answer.
    #[cfg_attr(target_os = "none", inline(never))]
    fn accept_held(&mut self) -> bool {
        let (held, hold) = (self.held, self.hold());
        // A single byte may be noise; more bytes may be the beginning of a reply.
        if held == S::Count::ZERO
            || self.fault >= RxFault::BAD_CRC
            || self.end > 1u8.into()
            || !self.is_silent(hold)
        {
            return false;
        }
        self.take_back();
        // A damaged second reply may have overwritten the exception code of the first.
        Q::validate(self, S::Count::ZERO, held);
        true
    }
}

impl<P, S: Storage, Q> Engine<P, S, Q> {
    /// Has the frame buffer begin with the held reply again.
    pub(super) fn take_back(&mut self) {
        self.storage.take_back(self.held);
        self.held = S::Count::ZERO;
    }
}

impl<P: Port, S: Words> Engine<P, S, MasterRequest> {
    /// Copies the data of the reply into the response words. False, with nothing copied, if
    /// there are too few words.
    #[cfg_attr(target_os = "none", inline(never))]
    #[cfg_attr(not(target_os = "none"), inline(always))]
    pub fn store_words(&mut self) -> bool {
        let count = self.request.reads();
        if self.response_words() > self.storage.response_words() {
            return false;
        }
        // The data follow unit, function and byte count.
        let last = 2 + count;
        let byte = self.storage.byte(last) & self.request.mask();
        self.storage.set_byte(last, byte);
        self.storage
            .store_words(3, count, self.request.has_registers());
        true
    }

    /// How many response words the data of a successful reply fill.
    pub fn response_words(&self) -> u8 {
        self.request.reads().div_ceil(2)
    }
}
