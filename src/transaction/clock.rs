//! The times that a transaction counts, by the clock of its port.

use super::{Phase, Question, Storage, Transaction};
use crate::error::Status;
use crate::frame::Search;
use crate::port::Port;
use crate::time::{elapsed, has_elapsed};

impl<P, S, Q: Question, W: Search> Transaction<P, S, Q, W> {
    /// Notes the time `now`, and starts the time of a phase that just began.
    pub(super) fn look_at_clock(&mut self, now: u32) {
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

    /// True once the phase has lasted `time`.
    #[inline(always)]
    pub(super) fn lasts(&self, time: u32) -> bool {
        self.has_passed(time, false)
    }

    /// True once the line has been silent for `time`.
    #[inline(always)]
    pub(super) fn is_silent(&self, time: u32) -> bool {
        self.has_passed(time, true)
    }

    /// True once `time` has passed since the phase began, or since the line was
    /// last busy. (One function: 32 bits are much work for an AVR.)
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn has_passed(&self, time: u32, since_last_byte: bool) -> bool {
        let since = if since_last_byte {
            self.last_byte
        } else {
            self.since
        };
        has_elapsed(time, self.now, since)
    }

    /// A line that is not silent, or a port that does not move, is not waited
    /// for longer than a reply and the `time` that it may take.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn stalled(&self, time: u32) -> Status {
        if self.lasts(self.settings.response_timeout.wrapping_add(time)) {
            Status::LINE_BUSY
        } else {
            Status::PENDING
        }
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
}

impl<P: Port, S: Storage, Q: Question, W: Search> Transaction<P, S, Q, W> {
    /// Says that the line was busy just now, so the gap counts from here.
    pub fn line_used(&mut self) {
        self.last_byte = self.port.micros();
    }
}
