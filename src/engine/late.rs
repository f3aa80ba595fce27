//! Keeps a late reply from being delivered as the answer to a later request.
//!
//! RTU frames carry no transaction number. A late reply to an earlier request looks like the
//! reply if unit, function and length are the same, and a late exception looks like the reply
//! if the function is the same. Two rules keep late replies from being delivered:
//! - After a request without a right reply, the engine waits for the quiet time before it
//!   sends the next request.
//! - The next reply of that unit is on probation: the engine holds it until the line has been
//!   silent for the response timeout.
//!
//! A device that answers in order, but later than the timeout, sends two replies after the
//! next request: first the late reply, then the right one. If it answers within the response
//! timeout, it sends the second one before the hold is over. The second right reply replaces
//! the held one. If it arrives damaged, the request fails, because the held reply is then most
//! likely the late one. If only damaged replies came since the last right one, the quiet time
//! suffices as the hold, because none is late.
//!
//! A reply that arrives while no request has been sent shows that the replies are late, too.

use super::{Engine, Outcome, Phase, Probation, Storage, Transaction};
use crate::port::Port;

impl<P: Port, S: Storage, Q: Transaction<P, S>> Engine<P, S, Q> {
    /// The byte of `late_units` that has the bit of the pending request's unit, and that bit.
    fn late_unit(&mut self) -> (&mut u8, u8) {
        // The index is in range, so the compiler leaves the check out.
        #[allow(clippy::indexing_slicing)]
        let byte = &mut self.late_units[usize::from(self.unit & 3)];
        (byte, 1 << (self.unit >> 2 & 7))
    }

    /// True if the reply to the pending request may be a late one.
    pub(super) fn may_be_late(&mut self) -> bool {
        let (byte, bit) = self.late_unit();
        *byte & bit != 0 && self.settings.quiet_time.get() > 0 && !self.request.has_unique_reply()
    }

    /// Notes that the reply to the pending request may come late.
    pub(super) fn expect_late_reply(&mut self) {
        // A damaged reply has come, so none is late.
        let is_damaged = self.phase == Phase::Reply && self.seen == Outcome::BAD_CRC;
        self.has_slow_unit &= self.late_units != [0; 4];
        self.has_slow_unit |= !is_damaged;
        self.is_late = true;
        let (byte, bit) = self.late_unit();
        *byte |= bit;
    }

    /// Notes that the pending request's unit has answered.
    pub(super) fn expect_no_late_reply(&mut self) {
        let (byte, bit) = self.late_unit();
        *byte &= !bit;
    }

    /// The silence, in microseconds, that the next request waits for.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn required_silence(&self) -> u32 {
        if self.is_late {
            self.settings.gap.get().max(self.settings.quiet_time.get())
        } else {
            self.settings.gap.get()
        }
    }

    /// How long the line must be silent before a held reply is accepted.
    pub(super) fn hold(&mut self) -> u32 {
        if self.has_slow_unit {
            Q::response_timeout(self)
        } else {
            self.settings.quiet_time.get()
        }
    }

    /// True if the next reply is held, or one was held.
    pub(super) fn is_on_probation(&self) -> bool {
        self.probation != Probation::No
    }

    /// True if a reply is or was held.
    pub(super) fn is_held(&self) -> bool {
        self.probation == Probation::Held
    }

    /// Holds the response in `seen`, which is on probation. It replaces a response that was held
    /// before.
    pub(super) fn hold_response(&mut self) {
        if self.is_held() {
            self.note_foreign_frame();
        }
        self.probation = Probation::Held;
        self.end = self.content;
        self.begin_frame();
    }

    /// True if the held response is not the answer: the bytes after it may have been the answer,
    /// or the line is not silent. A single byte may be noise.
    pub(super) fn is_held_in_vain(&self) -> bool {
        self.is_held() && (self.run_length > 1u8.into() || !self.has_expired())
    }
}
