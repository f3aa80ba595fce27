//! Keeps a late reply from being delivered as the answer to a later request.
//!
//! A device that answers in order, but later than the timeout, sends two replies
//! after the next request: first the late one, then the right one. So after a
//! request without a right reply, the next reply of that unit is held in the
//! frame buffer until the line has been silent for the quiet time. A second right
//! reply takes the place of the first. A second one that is damaged makes the
//! request fail, because the held reply is then most likely the late one.

use super::{Question, Storage, Transaction};
use crate::bytes::move_to_front;
use crate::frame::{Search, Seen, Wanted as _};
use crate::port::Port;
use crate::transaction::Counter;

/// Whether the next reply may be a late one.
#[derive(Clone, Copy, Hash, Debug)]
#[repr(C)]
pub(super) struct Probation {
    /// The unit that did not answer its last request; 0 if every unit did.
    unit: u8,
    /// The reply to the request under way is on probation.
    is_on: bool,
    /// A reply to the request under way was held.
    pub(super) has_held: bool,
}

impl Probation {
    /// No reply may be late.
    pub(super) const NONE: Self = Probation {
        unit: 0,
        is_on: false,
        has_held: false,
    };
}

impl<P, S, Q: Question, W: Search> Transaction<P, S, Q, W> {
    /// Notes that the reply to the request under way may come late.
    pub(super) fn expect_late_reply(&mut self) {
        self.late = true;
        self.probation.unit = self.wanted.unit;
    }

    /// Notes that the unit has answered.
    pub(super) fn end_probation(&mut self) {
        if self.probation.unit == self.wanted.unit {
            self.probation.unit = 0;
        }
    }

    /// Decides, for a request that was just sent, whether its reply is on
    /// probation.
    pub(super) fn begin_reply(&mut self) {
        self.wanted.held = 0;
        self.probation.has_held = false;
        self.probation.is_on =
            self.probation.unit == self.wanted.unit && self.settings.quiet_time > 0;
    }

    /// True if the reply that was just found is to be held.
    pub(super) const fn is_on_probation(&self) -> bool {
        self.probation.is_on
    }

    /// True once no second reply is waited for any longer. A line that is never
    /// silent ends the wait too.
    pub(super) fn is_hold_over(&self) -> bool {
        let timeout = self.settings.response_timeout;
        let quiet_time = self.settings.quiet_time;
        self.is_silent(quiet_time)
            || self.lasts(timeout.wrapping_add(timeout).wrapping_add(quiet_time))
    }
}

impl<P: Port, S: Storage, Q: Question, W: Search> Transaction<P, S, Q, W> {
    /// True if the reply is among the bytes that arrived after the held
    /// one.
    pub(super) fn finds_reply(&mut self) -> bool {
        let held = usize::from(self.wanted.held);
        let buffer = self.storage.frame().get_mut(held..).unwrap_or_default();
        self.window.search(buffer, &mut self.wanted)
    }

    /// Holds the reply that was just found at the front of the frame buffer. What
    /// arrived after it is searched for another one.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn hold_reply(&mut self) {
        self.count_superseded();
        let frame = self.window.keep();
        let buffer = self.storage.frame();
        move_to_front(buffer, usize::from(self.wanted.held + frame.start));
        let content = usize::from(frame.content);
        if let Some(rest) = buffer.get_mut(content..) {
            move_to_front(rest, usize::from(frame.length - frame.content));
        }
        self.wanted.held = frame.content;
        self.probation.has_held = true;
    }

    /// Gives up the held reply if the bytes that arrived after it fill the rest of
    /// the buffer: they are the beginning of another reply.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn make_space(&mut self) {
        let held = usize::from(self.wanted.held);
        let buffer = self.storage.frame();
        if held > 0 && self.window.fills(buffer.len().saturating_sub(held)) {
            move_to_front(buffer, held);
            self.count_superseded();
            self.wanted.held = 0;
        }
    }

    /// Counts a held reply that is given up: it answers no request.
    fn count_superseded(&mut self) {
        if self.wanted.held > 0 {
            self.storage.count(Counter::ForeignFrames, 1);
        }
    }

    /// Takes the held reply as the answer; false if there is none, or if what
    /// arrived after it may have been the answer.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn take_held(&mut self) -> bool {
        let held = usize::from(self.wanted.held);
        if held == 0
            || self.window.seen() >= Seen::BAD_CRC
            || self.window.has_begun()
            || !self.is_silent(self.settings.quiet_time)
        {
            return false;
        }
        self.window.hold(0);
        // A damaged second reply may have overwritten what the first one said.
        let frame = self.storage.frame().get(..held).unwrap_or_default();
        self.wanted.judge(frame);
        true
    }
}
