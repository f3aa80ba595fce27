//! Keeps a late reply from being delivered as the answer to a later request, and lets the right
//! one through again in bounded time.
//!
//! RTU frames carry no transaction number. A late reply to an earlier request looks like the
//! reply if unit, function and length are the same, and a late exception looks like the reply
//! if the function is the same. So the engine counts for each unit how many replies it owes:
//! the requests that were sent and whose reply was not seen. A frame of the unit, wanted or
//! not, takes one away. A unit that owes none is *clean*. A unit is also clean once it was
//! silent for two response timeouts and the quiet time since its last request was sent. If an
//! earlier request has a longer timeout, that one counts.
//!
//! - After a request without a right reply, the line is left alone for the quiet time.
//! - After a request that timed out, the next one to that unit is sent. Its reply is held until
//!   nothing has arrived for the response timeout, unless it is the last one that the unit owes. A
//!   device that answers in order, but later than the timeout, sends two replies: first the late
//!   one, which is held, then the right one, which is the last and is delivered at once. If the
//!   second one arrives damaged, the request fails, because the held reply is then most likely
//!   the late one. If only damaged replies came, the quiet time suffices as the hold.
//! - After a request that was cancelled, the next one to that unit is sent once the unit is
//!   clean. Its reply is delivered at once. (If it were held, a program that cancels each request
//!   before the hold is over would never get a reply again.)
//!
//! A reply that arrives while no request has been sent and the unit owes none shows that more may
//! be late.

use super::late_units::{ANY, CANCELLED, LATE_UNITS, REPLIES, SLOW};
use super::{Engine, Finding, Phase, Storage, Transaction, BROADCAST};
use crate::port::Port;

impl<P: Port, S: Storage, Q: Transaction<P, S>> Engine<P, S, Q> {
    /// Looks up how many replies the unit of the pending request owes.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn look_up_owed(&mut self) {
        self.owed = 0;
        if let Some(record) = self.late_units.record(self.unit) {
            let is_broadcast = self.unit == BROADCAST && self.request.may_be_broadcast();
            if !is_broadcast && record.left(self.now) > 0 {
                self.owed = record.owed;
            }
        }
    }

    /// Makes the request wait until its unit is clean. Returns false if it need not wait.
    pub(super) fn rest(&mut self) -> bool {
        if self.owed & CANCELLED == 0 || !self.may_be_late() {
            return false;
        }
        let Some(record) = self.late_units.record(self.unit) else {
            return false;
        };
        self.since = self.now;
        self.wait = record.left(self.now);
        self.phase = Phase::Rest;
        true
    }

    /// True if the unit owes a reply to an earlier request.
    pub(super) fn owes(&self) -> bool {
        self.owed & REPLIES != 0
    }

    /// True if the next reply may be a late one.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(crate) fn may_be_late(&self) -> bool {
        self.owes() && self.settings.quiet_time.get() > 0 && !self.request.has_unique_reply()
    }

    /// Notes that the reply to the pending request may come late. `is_cancelled` is true if the
    /// program has cancelled it.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn expect_late_reply(&mut self, is_cancelled: bool) {
        self.is_late = true;
        self.add_owed_reply(is_cancelled);
        let has_heard_unit = self.is_held || self.seen > Finding::OTHER_UNIT;
        // The wait of a request that was not sent goes on, so its begin stays.
        self.write_record(if has_heard_unit { self.now } else { self.begun });
    }

    /// Counts the pending request among those whose reply the unit owes.
    #[inline(always)]
    fn add_owed_reply(&mut self, is_cancelled: bool) {
        if self.owed & REPLIES != REPLIES {
            self.owed += 1;
        }
        let has_damaged_reply = self.phase == Phase::Reply && self.seen == Finding::BAD_CRC;
        if !has_damaged_reply {
            self.owed |= SLOW;
        }
        if is_cancelled {
            self.owed |= CANCELLED;
        }
    }

    /// Writes into the record of the unit how many replies it owes, and when it is clean at the
    /// latest, if it is silent since the time `since`.
    #[inline(always)]
    fn write_record(&mut self, since: u32) {
        let place = self.find_record_place();
        let timeout = Q::response_timeout(self);
        let silence = timeout
            .wrapping_add(timeout)
            .wrapping_add(self.settings.quiet_time.get());
        // The index is in range, so the compiler leaves the check out.
        #[allow(clippy::indexing_slicing)]
        let record = &mut self.late_units.records[place.min(LATE_UNITS - 1)];
        if place == LATE_UNITS {
            self.owed = ANY;
        }
        // An earlier request may have had a longer timeout.
        record.clean_after(silence, since);
        record.unit = self.unit;
        record.owed = self.owed;
    }

    /// Finds the record of the pending request's unit, or else a free one, and frees the records whose
    /// units have been silent for long enough. Returns its index, or [`LATE_UNITS`] if there is none:
    /// then the last record stands for all units from now on.
    #[cfg_attr(target_os = "none", inline(never))]
    fn find_record_place(&mut self) -> usize {
        let (mut place, mut index) = (LATE_UNITS, 0);
        while index < LATE_UNITS {
            // The index is in range, so the compiler leaves the check out.
            #[allow(clippy::indexing_slicing)]
            let record = &mut self.late_units.records[index];
            if record.left(self.now) == 0 {
                record.owed = 0;
            }
            // A unit takes its own record even if that is free, so it never has two records.
            if record.unit == self.unit || record.owed == ANY {
                return index;
            }
            if record.owed == 0 && place == LATE_UNITS {
                place = index;
            }
            index += 1;
        }
        place
    }

    /// Notes that the last request, which was cancelled while it was sent, has left only now. None is
    /// pending.
    pub fn note_sent_late(&mut self, now: u32) {
        self.now = now;
        self.since = now;
        self.write_record(now);
    }

    /// Notes that no reply comes any more: the line is a new one.
    pub fn forget_late_replies(&mut self) {
        self.is_late = false;
        self.late_units.clear();
    }

    /// Notes that the pending request's unit has answered.
    pub(super) fn expect_no_late_reply(&mut self) {
        match self.late_units.record(self.unit) {
            Some(record) if record.owed != ANY => record.owed = 0,
            _ => {}
        }
    }

    /// Notes a frame of a unit: if the unit owes replies, it owes one less.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn note_reply_of(&mut self, unit: u8) {
        if unit == self.unit && self.owes() {
            self.owed -= 1;
        }
        let Some(record) = self.late_units.record(unit) else {
            return;
        };
        if record.owed == ANY {
            return;
        }
        // This is the reply that the quiet time waits for.
        self.is_late = false;
        record.owed -= 1;
        if record.owed & REPLIES == 0 {
            record.owed = 0;
        }
    }

    /// The silence of the line, in microseconds, that the next request waits for.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn line_silence(&self) -> u32 {
        let silence = self.settings.gap.get();
        if self.is_late {
            silence.max(self.settings.quiet_time.get())
        } else {
            silence
        }
    }

    /// True if the pending request was not sent yet because it waits until its unit is clean.
    pub fn waits_for_unit(&self) -> bool {
        self.phase == Phase::Rest
    }

    /// How long the line must be silent before a held reply is accepted.
    pub(crate) fn hold(&mut self) -> u32 {
        if self.owed & SLOW != 0 {
            Q::response_timeout(self)
        } else {
            self.settings.quiet_time.get()
        }
    }

    /// Decides on the response in `seen`. True if it answers the request. If it may be a late one,
    /// it is held. It replaces a response that was held before.
    pub(crate) fn take_response(&mut self) -> bool {
        if self.is_held {
            self.note_foreign_frame();
        }
        if !self.may_be_late() {
            return true;
        }
        self.note_reply_of(self.unit);
        self.is_held = true;
        self.end = self.content;
        self.begin_frame();
        false
    }

    /// True if the held response is not the answer: the bytes after it may have been the answer,
    /// or the line is not silent. A single byte may be noise.
    pub(super) fn is_held_in_vain(&self) -> bool {
        self.is_held && (self.run_length > 1u8.into() || !self.has_expired())
    }
}
