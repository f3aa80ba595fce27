//! Sends a request: waits for silence, writes the frame, waits until its last bit has left.

use super::{Count, Counter, Engine, Phase, RequestSpec, Storage, BROADCAST};
use crate::error::Status;
use crate::port::Port;
use crate::time::characters;

impl<P: Port, S: Storage, Q: RequestSpec<P, S>> Engine<P, S, Q> {
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
        if cfg!(feature = "retries") && Q::HAS_FIXED_REPLY {
            self.retries = self.settings.retries;
        }
        self.begin()
    }

    /// Writes the frame of the request and enters the phase that waits for silence.
    #[cfg_attr(target_os = "none", inline(never))]
    #[cfg_attr(not(target_os = "none"), inline(always))]
    pub(super) fn begin(&mut self) -> Status {
        self.take_back();
        Q::write(self);
        self.resynced = true;
        let wait = Q::response_timeout(self);
        self.enter(Phase::Gap, wait.wrapping_add(self.required_silence()));
        Status::PENDING
    }

    /// The silence, in microseconds, that the next request waits for.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn required_silence(&self) -> u32 {
        if self.late {
            self.settings.gap.max(self.settings.quiet_time)
        } else {
            self.settings.gap
        }
    }

    /// Waits until the line has been silent for the gap, then sends. Bytes that arrive here
    /// answer no request and are dropped. If the line is never silent, the wait ends after
    /// the response timeout plus the gap.
    #[cfg_attr(target_os = "none", inline(never))]
    #[cfg_attr(not(target_os = "none"), inline(always))]
    pub(super) fn wait_for_silence(&mut self) -> Status {
        let index = if self.resynced {
            S::Count::ZERO
        } else {
            self.end
        };
        let received = self.read_bytes(index);
        if received < 0 {
            return Status::LINK_LOST;
        }
        if received > 0 {
            self.search_unexpected(S::Count::of(received as usize));
            return self.stalled();
        }
        if !self.is_silent(self.required_silence()) {
            return self.wait();
        }
        if !self.resynced {
            // The received bytes have overwritten the request.
            Q::write(self);
        }
        self.storage.count(Counter::Requests, 1);
        self.late = false;
        self.phase = Phase::Send;
        self.phase_start = self.now;
        self.port.pre_transmission();
        self.send()
    }

    /// Writes the frame to the port, waits until the port has sent it, and keeps the driver on
    /// for the post-flush hold. If the port accepts nothing, the wait ends after the response
    /// timeout plus the silence that the request waited for.
    #[cfg_attr(target_os = "none", inline(never))]
    #[cfg_attr(not(target_os = "none"), inline(always))]
    pub(super) fn send(&mut self) -> Status {
        if self.phase == Phase::Send {
            let left = self.end - self.processed;
            let sent = self.port.write(self.storage.bytes(self.processed, left));
            if sent < 0 {
                return Status::LINK_LOST;
            }
            if sent == 0 {
                return self.stalled();
            }
            self.storage.count(Counter::BytesSent, sent as u16);
            let sent = S::Count::of(sent as usize);
            self.processed += sent;
            self.phase_start = self.now;
            if sent < left {
                return Status::PENDING;
            }
            self.phase = Phase::Flush;
            // The longest frame takes 256 characters.
            self.wait = self
                .wait
                .wrapping_add(u32::from(self.settings.any_character()) << 8);
        }
        if cfg!(feature = "hold") && self.phase == Phase::PostFlush {
            if !self.has_expired() {
                return Status::PENDING;
            }
        } else {
            if !self.port.flush() {
                return self.stalled();
            }
            let hold_reply = self.settings.post_flush_hold;
            if cfg!(feature = "hold") && hold_reply > 0 {
                self.enter(
                    Phase::PostFlush,
                    characters(self.settings.any_character(), hold_reply),
                );
                return Status::PENDING;
            }
        }
        // The request has been sent: the driver goes off, and the wait for the reply begins.
        let sent: u16 = self.end.into();
        self.begin_reply();
        self.port.post_transmission();
        let (phase, mut time) = if self.unit == BROADCAST || !self.request.is_answered() {
            (Phase::Turnaround, self.settings.turnaround_delay)
        } else {
            (Phase::Reply, Q::response_timeout(self))
        };
        if !self.port.knows_when_sent() {
            // The port may have bytes left to send.
            let [low, high] = sent.to_le_bytes();
            time += characters(self.settings.character, low);
            time += characters(self.settings.character, high) << 8;
        }
        self.enter(phase, time);
        self.wait()
    }
}
