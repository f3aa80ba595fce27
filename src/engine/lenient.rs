//! Accepts a reply that deviates from the standard, if no valid reply arrives before the request
//! would fail.
//!
//! A *deviating reply* has the right unit, function and CRC. The reply to a write deviates if it
//! repeats another address, value or quantity than the request. The reply to a read deviates if
//! it has more or less data than requested, or more than the frame buffer holds. The strict
//! search skips such a reply and looks for a valid one. Here the skipped bytes are kept at the
//! front of the frame buffer, as far as they fill response words. So a valid reply always wins.
//!
//! Only [`Engine::receive_lenient`] calls this module. A program that does not call that function
//! contains none of this code.

use super::{Engine, Phase, Probation, Words, BROADCAST};
use crate::error::Status;
use crate::frame::rtu;
use crate::pdu::master_request::MasterRequest;
use crate::pdu::EXCEPTION;
use crate::port::Port;

/// Bytes before the data in the response to a read: unit, function code and byte count.
const BEFORE_DATA: u8 = 3;

/// Bytes of the frame buffer that must stay free beside the kept bytes. An exception fits into
/// them.
const LEFT_FREE: u8 = 8;

impl<P: Port, S: Words> Engine<P, S, MasterRequest> {
    /// Waits for the reply, as [`Engine::poll`] does, and accepts a deviating reply. A read may be
    /// sent to unit 0, which then has to reply.
    pub fn receive_lenient(&mut self) -> Status {
        if self.unit == BROADCAST {
            if !self.request.is_read() {
                return self.turn_around();
            }
            if self.phase == Phase::Turnaround {
                self.phase = Phase::Reply;
                self.wait = self.settings.response_timeout;
                // For a broadcast it was left at the value for "unit 0 did not reply".
                self.probation = Probation::Off;
            }
        }
        let status = self.receive::<true>();
        let most = u16::from(self.storage.response_words()) << 1;
        if status == Status::OK && most > 0 && u16::from(self.request.reads()) > most {
            self.request.set_reads(most as u8);
        }
        status
    }
}

impl<P, S: Words> Engine<P, S, MasterRequest> {
    /// Skips the byte at `front`, but keeps it if it may belong to a deviating response to a read.
    /// Returns the index of the next byte.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn skip_or_keep_byte(&mut self, front: u8) -> u8 {
        let is_kept = self.is_kept(front);
        self.skip_byte(front);
        if !is_kept {
            return front + 1;
        }
        let byte = self.storage.byte(front);
        self.storage.set_byte(0, byte);
        self.storage.set_aside(1);
        self.held += 1;
        self.end -= 1;
        self.processed = self.processed.saturating_sub(1);
        front
    }

    /// True if the byte at `front` must be kept. Sets `probation` if that byte completes a
    /// deviating response.
    fn is_kept(&mut self, front: u8) -> bool {
        let is_decided = matches!(self.probation, Probation::Held | Probation::Deviating);
        if is_decided || !self.request.is_read() {
            return false;
        }
        if self.skipped == 0 {
            self.drop_kept();
            let unit = self.storage.byte(front);
            let function = self.storage.byte(front + 1);
            return unit == self.unit && function == self.request.function();
        }
        if self.held == 0 {
            return false;
        }
        let byte = self.storage.bytes(front, 1);
        let is_residue = self.crc_skipped.with(byte).is_residue();
        let length = self.count_kept();
        if is_residue && length == self.kept_length() && self.kept_data() > 0 {
            self.probation = Probation::Deviating;
            return false;
        }
        if length == u8::MAX {
            // No frame is longer.
            self.drop_kept();
            return false;
        }
        let words = u16::from(self.storage.response_words());
        u16::from(self.held) < (words << 1) + u16::from(BEFORE_DATA)
            && self.storage.capacity() > LEFT_FREE
    }

    /// Counts one more byte of the response that the kept bytes begin. Returns how many bytes it
    /// has by now, including bytes that were not kept because the buffer is too small. The count
    /// is stored in place of the first kept byte, which is the unit.
    fn count_kept(&mut self) -> u8 {
        let held = self.held;
        self.storage.take_back(held);
        let more = match held {
            1 => 1,
            _ => self.storage.byte(0).saturating_add(1),
        };
        self.storage.set_byte(0, more);
        self.storage.set_aside(held);
        more.saturating_add(1)
    }

    /// Length of the frame that the kept bytes begin, from its byte count. 0 if the byte count is
    /// not kept yet, or is too great for a frame.
    fn kept_length(&mut self) -> u8 {
        let held = self.held;
        if held <= BEFORE_DATA {
            return 0;
        }
        self.storage.take_back(held);
        let count = self.storage.byte(2);
        self.storage.set_aside(held);
        count.checked_add(BEFORE_DATA + rtu::CRC).unwrap_or(0)
    }

    /// How many bytes of the frame's data are kept. For registers, only whole registers count.
    fn kept_data(&mut self) -> u8 {
        let length = self.kept_length();
        let kept = self.held.min(length.saturating_sub(rtu::CRC));
        let data = kept.saturating_sub(BEFORE_DATA);
        if self.request.has_registers() {
            data & !1
        } else {
            data
        }
    }

    /// Handles the frame at `front`, whose unit, function and CRC are right, but which is not the
    /// expected reply. It is a deviating reply, unless it is an exception.
    pub(super) fn note_deviating(&mut self, front: u8) {
        let is_exception = self.storage.byte(front + 1) & EXCEPTION != 0;
        if !is_exception && self.probation != Probation::Held {
            self.probation = Probation::Deviating;
        }
    }

    /// Drops the kept bytes, because a valid reply was found or their space is needed.
    pub(super) fn drop_kept(&mut self) {
        if self.probation != Probation::Held {
            let held = self.held;
            self.take_back();
            self.storage.move_down(held, self.end);
            if self.probation == Probation::Deviating {
                self.probation = Probation::Off;
            }
        }
    }

    /// Makes a deviating reply the result of the request. False if there was none.
    pub(super) fn accept_deviating(&mut self) -> bool {
        // The last bytes may look like the beginning of a valid reply. Skip them too.
        let mut front = 0;
        while front < self.end {
            front = self.skip_or_keep_byte(front);
        }
        if self.probation != Probation::Deviating {
            return false;
        }
        if self.request.is_read() {
            let data = self.kept_data();
            self.take_back();
            self.request.set_reads(data);
        }
        self.exception = 0;
        // The reply was counted as a skipped frame.
        self.skipped = 0;
        self.foreign_frames = self.foreign_frames.saturating_sub(1);
        true
    }
}
