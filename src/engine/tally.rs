//! Adds the attempts and the bytes on the line to the counters of the storage.

use super::{Count, Counter, Engine, Phase, Storage};
use crate::error::Status;

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
        let more: u16 = (self.sent - self.counted).into();
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
