//! Code that few programs use: retries, echo discarding, the post-flush hold, and counters.
//!
//! Only [`Engine::use_extras`] and [`Engine::set_counting`] name this code. A program in C contains
//! it if it calls them.

use super::{Count, Counter, Engine, Finding, Moment, Phase, Storage, Transaction};
use crate::error::Status;
use crate::port::Port;

impl<P: Port, S: Storage, Q: Transaction<P, S>> Engine<P, S, Q> {
    /// Makes the settings `retries`, `echo_discard` and `post_flush_characters` effective.
    pub fn use_extras(&mut self) {
        self.extras = Some(Engine::extras);
    }

    /// See [`super::Extension`].
    pub(super) fn extras(&mut self, moment: Moment) -> bool {
        match moment {
            Moment::Byte => self.take_echo(),
            Moment::Sent => self.hold_driver(),
            Moment::End => self.repeat_if_allowed(),
            Moment::Missed => false,
        }
    }

    /// Drops the echo of the request if it ends with the last byte, and returns true then.
    fn take_echo(&mut self) -> bool {
        let length = self.outgoing;
        if length == S::Count::ZERO
            || !self.check_end(length, self.function)
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

    /// Keeps the driver on after the port has sent the last bit, for the post-flush hold. Returns
    /// false when it is over.
    fn hold_driver(&mut self) -> bool {
        let hold = self.settings.post_flush_characters;
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

    /// Begins the request again if it has failed and has retries left, and returns true then.
    fn repeat_if_allowed(&mut self) -> bool {
        let retries = self.settings.retries;
        let is_final = self.seen.is_response() || self.seen == Finding::TOO_LONG;
        if !Q::IS_OF_MASTER || self.retries >= retries || is_final {
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

impl<P, S: Storage, Q> Engine<P, S, Q> {
    /// Counts from now on.
    pub fn set_counting(&mut self) {
        self.tally = Some(Engine::count);
    }

    /// Counts the events since its last call, if the engine counts: the request, the bytes that
    /// have arrived, and, if `status` is not [`Status::PENDING`], the attempt that ends with
    /// it.
    pub(super) fn tally(&mut self, status: Status) {
        if let Some(tally) = self.tally {
            tally(self, status);
        }
    }

    /// As [`Engine::tally`], for an engine that counts.
    pub(super) fn count(&mut self, status: Status) {
        let storage = &mut self.storage;
        storage.count(Counter::BytesReceived, self.received.into());
        self.received = 0;
        // The reply may take one back until the request ends: see `accept`.
        let kept = i8::from(status == Status::PENDING).min(self.foreign_frames.max(0));
        let foreign_frames = self.foreign_frames.max(0) - kept;
        storage.count(Counter::ForeignFrames, foreign_frames as u32);
        self.foreign_frames = kept;
        if self.phase <= Phase::Gap {
            return;
        }
        let more = (self.sent - self.counted).to_u16();
        storage.count(Counter::BytesSent, more.into());
        let is_over = status != Status::PENDING;
        if self.counted == S::Count::ZERO && (is_over || more > 0) {
            storage.count(Counter::Requests, 1);
        }
        self.counted = self.sent;
        if !is_over {
            return;
        }
        self.counted = S::Count::ZERO;
        if self.phase != Phase::Reply {
            return;
        }
        if self.seen.is_response() {
            storage.count(Counter::Replies, 1);
            storage.count(Counter::Exceptions, u32::from(status.is_exception()));
            storage.count(Counter::Resynchronisations, u32::from(self.is_early));
        } else if status == Status::INVALID_CRC {
            storage.count(Counter::BadCrc, 1);
        } else if status == self.seen.status() && status != Status::BUFFER_TOO_SMALL {
            storage.count(Counter::Timeouts, 1);
        }
    }
}
