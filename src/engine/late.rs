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

use super::{Engine, Finding, Phase, Storage, Transaction, BROADCAST};
use crate::port::Port;
use crate::time::Micros;

/// How many units that owe replies at the same time are remembered exactly: 10 on a host, 4 where
/// pointers have 32 bits, 1 on an AVR, where each takes 8 bytes of 2048.
const LATE_UNITS: usize = match size_of::<usize>() {
    2 => 1,
    4 => 4,
    _ => 10,
};

/// In [`LateUnit::owed`]: how many replies the unit owes.
const REPLIES: u8 = 0x1F;
/// One of them may be later than the quiet time: no damaged reply to its request was seen.
const SLOW: u8 = 0x20;
/// A request was cancelled, so the next one waits until the unit is clean.
const CANCELLED: u8 = 0x40;
/// The `owed` of the record that stands for all units without a record of their own.
const ANY: u8 = 0xFF;

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

/// A unit that owes replies.
#[derive(Clone, Copy, Hash, Debug)]
#[repr(C)]
pub struct LateUnit {
    unit: u8,
    /// How many replies it owes, and flags; 0: the record is free.
    owed: u8,
    /// The most time that can be left until the unit is clean, in units of 2^16 microseconds.
    /// If the clock shows more, the unit has been clean for long.
    most: u16,
    /// When the unit is clean: it has been silent for long enough since its last request.
    clean: Micros,
}

impl LateUnit {
    /// True if the record says what `unit` owes.
    fn is_of(&self, unit: u8) -> bool {
        self.owed != 0 && (self.unit == unit || self.owed == ANY)
    }

    /// Microseconds from `now` until the unit is clean.
    #[cfg_attr(target_os = "none", inline(never))]
    fn left(&self, now: u32) -> u32 {
        let left = self.clean.wrapping_sub(now);
        if (left >> 16) as u16 > self.most {
            0
        } else {
            left
        }
    }

    /// Sets the time at which the unit is clean to `silence` microseconds after `since`, unless
    /// it is later already.
    #[inline(always)]
    fn clean_after(&mut self, silence: u32, since: u32) {
        let clean = since.wrapping_add(silence);
        if self.owed == 0 || (self.clean.wrapping_sub(clean) as i32) < 0 {
            self.clean = clean;
            // The clock may step back a little.
            self.most = (silence >> 16) as u16 + 1;
        }
    }
}

/// The units that owe replies. If more owe some than there are records, the last record stands for
/// all others: then these wait as after a cancelled request.
#[derive(Clone, Hash, Debug)]
#[repr(C)]
pub struct LateUnits {
    records: [LateUnit; LATE_UNITS],
}

impl LateUnits {
    /// No unit owes a reply.
    pub(super) const NONE: LateUnits = LateUnits {
        records: [LateUnit {
            unit: 0,
            owed: 0,
            most: 0,
            clean: 0,
        }; LATE_UNITS],
    };

    /// The record of the replies that the unit owes.
    #[cfg_attr(target_os = "none", inline(never))]
    fn record(&mut self, unit: u8) -> Option<&mut LateUnit> {
        let records = self.records.iter_mut();
        // The records that were ever used come first. Looking at these alone saves time on a
        // host, which has more records.
        let mut used = records.take_while(|record| LATE_UNITS <= 4 || record.most > 0);
        used.find(|record| record.is_of(unit))
    }

    /// Microseconds after `now` for which the next request to the unit waits until it is clean.
    pub fn rest(&mut self, unit: u8, now: u32) -> u32 {
        match self.record(unit) {
            Some(record) if record.owed & CANCELLED != 0 => record.left(now),
            _ => 0,
        }
    }

    /// Makes the engine hold the next reply after a cancelled request, as after a timeout. It
    /// is for model checkers: they find that the master then never gets a reply of the device
    /// again.
    // For model checkers.
    #[doc(hidden)]
    pub fn forget_cancelled(&mut self) {
        for record in &mut self.records {
            record.owed &= !CANCELLED;
        }
    }

    /// No unit owes a reply any more.
    pub(crate) fn clear(&mut self) {
        *self = LateUnits::NONE;
    }

    /// As [`super::Engine::rebase`].
    pub(super) fn rebase(&mut self, now: u32) {
        for record in &mut self.records {
            match record.owed {
                0 => {
                    let most = record.most.min(1);
                    *record = LateUnit {
                        most,
                        ..LateUnits::NONE.records[0]
                    };
                }
                _ => record.clean = record.left(now),
            }
        }
    }
}
