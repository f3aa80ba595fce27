//! Sends one request: writes the frame, waits until its last bit has left.

use super::{Count, Engine, Moment, Phase, Storage, Transaction, BROADCAST};
use crate::error::Status;
use crate::frame::checksum::crc16;
use crate::frame::rtu;
use crate::port::Port;
use crate::time::add_characters;

impl<P: Port, S: Storage, Q: Transaction<P, S>> Engine<P, S, Q> {
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
        self.function = self.request.function();
        self.length = self.request.reply_length();
        if Q::IS_REPEATED {
            self.retries = 0;
        }
        self.begin()
    }

    /// Writes the frame of the request and enters the phase that waits for silence.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn begin(&mut self) -> Status {
        Q::write(self);
        self.look_up_owed();
        self.begin_search();
        self.wait = self.line_silence();
        self.enter(Phase::Gap);
        Status::PENDING
    }

    /// Prepares the search for the reply to the request.
    fn begin_search(&mut self) {
        self.kept = S::Count::ZERO;
        self.awaits_end = false;
        self.end = S::Count::ZERO;
        self.content = S::Count::ZERO;
        self.see_nothing();
        self.has_more = false;
        self.is_held = false;
        self.begin_frame();
    }

    /// A right reply has arrived before the request was sent. It belongs to an earlier request. If
    /// the unit owes none, more late replies may come.
    #[cold]
    pub(super) fn note_unexpected(&mut self) {
        if self.owes() {
            self.note_reply_of(self.unit);
        } else {
            self.expect_late_reply(false);
        }
        self.begin_search();
        self.wait = self.line_silence();
    }

    /// Sends the request, now that the line is silent, unless its unit is not clean yet.
    pub(super) fn leave_gap(&mut self) -> Status {
        self.is_late = false;
        self.look_up_owed();
        if self.rest() {
            return Status::PENDING;
        }
        self.wait = 0;
        self.transmit()
    }

    /// Switches the driver on and begins to send.
    fn transmit(&mut self) -> Status {
        if self.outgoing == S::Count::ZERO {
            Q::write(self);
        }
        self.since = self.now;
        self.begun = self.now;
        self.phase = Phase::Send;
        self.port.pre_transmission();
        self.send()
    }

    /// Writes the frame to the port, waits until the port has sent it, and keeps the driver on
    /// for the post-flush hold.
    pub(super) fn send(&mut self) -> Status {
        if self.phase == Phase::Send {
            let left = self.outgoing - self.sent;
            let sent = self.port.write_count(self.storage.bytes(self.sent, left));
            if sent < 0 {
                return Status::LINK_LOST;
            }
            if sent == 0 {
                return self.stalled();
            }
            let sent = S::Count::of(sent as usize);
            self.sent += sent;
            self.since = self.now;
            if sent < left {
                return Status::PENDING;
            }
            self.phase = Phase::Flush;
            self.wait_for_characters(self.settings.any_character(), self.sent);
        }
        if self.phase == Phase::Flush && !self.port.flush() {
            return self.stalled();
        }
        if self.run_extension(Moment::Sent) {
            return Status::PENDING;
        }
        // The request has been sent: the driver goes off, and the wait for the reply begins.
        self.begin_search();
        if !self.settings.echo_discard {
            self.outgoing = S::Count::ZERO;
        }
        self.port.post_transmission();
        let is_broadcast = self.unit == BROADCAST && self.request.may_be_broadcast();
        let phase = if is_broadcast || !self.request.is_answered() {
            Phase::Turnaround
        } else {
            Phase::Reply
        };
        self.enter(phase);
        self.begun = self.now;
        self.wait_for_reply();
        Status::PENDING
    }

    /// The status of a request whose port does not go on.
    fn stalled(&self) -> Status {
        // The port has as long as the request waited for silence, and the response timeout.
        if self.is_overdue(self.since) {
            Status::LINE_BUSY
        } else {
            Status::PENDING
        }
    }

    /// Waits for the reply until the response timeout, or for the turnaround delay. A port that
    /// does not know when the last bit has left may have bytes left to send.
    pub(super) fn wait_for_reply(&mut self) {
        self.wait = if self.phase == Phase::Turnaround {
            self.settings.turnaround_delay.get()
        } else {
            Q::response_timeout(self)
        };
        if !self.port.knows_when_sent() {
            self.wait_for_characters(self.settings.character, self.sent);
        }
    }

    /// Extends the wait by `count` characters of `character` microseconds.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn wait_for_characters(&mut self, character: u16, count: S::Count) {
        add_characters(&mut self.wait, count, character);
    }
}

impl<P, S: Storage, Q> Engine<P, S, Q> {
    /// Appends the CRC to the `length` bytes in the frame buffer, and makes them the frame to
    /// send.
    pub(crate) fn append_crc(&mut self, length: S::Count) {
        let [low, high] = crc16(self.storage.slice(S::Count::ZERO, length)).to_bytes();
        self.storage.set_byte(length, low);
        self.storage.set_byte(length + 1u8.into(), high);
        self.set_frame_length(length + rtu::CRC.into());
    }

    /// Sets how many bytes of the frame buffer are to be sent.
    pub(crate) fn set_frame_length(&mut self, length: S::Count) {
        self.outgoing = length;
        self.sent = S::Count::ZERO;
    }
}
