//! Settings that few programs use: retries, echo discarding, and the post-flush hold.
//!
//! Only [`Engine::use_extras`] names this module. A program that sets none of the three in C
//! contains none of this code.

use super::{Count, Engine, Moment, Outcome, Phase, Storage, Transaction};
use crate::error::Status;
use crate::port::Port;

impl<P: Port, S: Storage, Q: Transaction<P, S>> Engine<P, S, Q> {
    /// Makes the settings `retries`, `echo_discard` and `post_flush_hold` effective.
    pub fn use_extras(&mut self) {
        self.extras = Some(Engine::extras);
        if self.extension.is_none() {
            self.extension = self.extras;
        }
    }

    /// See [`super::Extension`].
    pub(super) fn extras(&mut self, moment: Moment) -> bool {
        match moment {
            Moment::Byte => self.ends_echo(),
            Moment::Sent => self.holds_driver(),
            Moment::End => self.is_repeated(),
            Moment::Missed => false,
        }
    }

    /// True if the last byte ends the echo of the request.
    fn ends_echo(&mut self) -> bool {
        let length = self.outgoing;
        if length == S::Count::ZERO
            || !self.ends_with(length, self.function)
            || !Q::is_echo(self, self.end - length)
        {
            return false;
        }
        self.outgoing = S::Count::ZERO;
        // A reply that silence ends may look like the echo.
        self.content = S::Count::ZERO;
        self.end = S::Count::ZERO;
        self.begin_frame();
        self.forget();
        true
    }

    /// True while the driver must stay on after the port has sent the last bit.
    fn holds_driver(&mut self) -> bool {
        let hold = self.settings.post_flush_hold;
        if self.phase == Phase::PostFlush {
            return !self.has_expired();
        }
        if hold > 0 {
            self.enter(Phase::PostFlush);
            self.wait = 0;
            self.wait_for_characters(self.settings.any_character(), hold.into());
        }
        hold > 0
    }

    /// True if the request has failed and is begun again.
    fn is_repeated(&mut self) -> bool {
        let retries = self.settings.retries;
        let is_final = self.seen.is_response() || self.seen == Outcome::TOO_LONG;
        if !Q::HAS_FIXED_REPLY || self.retries >= retries || is_final {
            return false;
        }
        self.retries += 1;
        self.tally(self.seen.status());
        // The damaged reply may have been noise, so the right reply may still come.
        self.expect_late_reply(false);
        self.since = self.now;
        self.begin() == Status::PENDING
    }
}
