//! Accepts a reply that deviates from the standard, if no better one arrives before
//! the request would fail.
//!
//! A *deviating reply* has the right unit, function and CRC. It repeats another address,
//! value or quantity than the request to write, or it carries other data than the
//! request to read asked for, or more than the frame buffer holds. The strict search
//! passes over such a reply, and goes on to look for a right one. Here the bytes that it
//! passes over are kept at the front of the frame buffer, as far as they fill response
//! words. So a right reply always wins.
//!
//! Only [`Engine::receive_lenient`] calls this. A program that does not name that
//! function carries none of it.

use super::{Engine, Phase, Probation, Words, BROADCAST};
use crate::error::Status;
use crate::frame::rtu;
use crate::pdu::master_request::MasterRequest;
use crate::pdu::EXCEPTION;
use crate::port::Port;

/// Unit, function and byte count: the bytes of a response to a read before its data.
const BEFORE_DATA: u8 = 3;

/// Bytes of the frame buffer that stay free beside kept bytes. An exception fits.
const LEFT_FREE: u8 = 8;

impl<P: Port, S: Words> Engine<P, S, MasterRequest> {
    /// Waits for the reply, as [`Engine::poll`] does, and accepts a deviating one. A
    /// request to read is sent to unit 0 too, which is to reply then.
    pub fn receive_lenient(&mut self) -> Status {
        if self.unit == BROADCAST {
            if !self.request.is_read() {
                return self.turn_around();
            }
            if self.phase == Phase::Turnaround {
                self.phase = Phase::Reply;
                self.wait = self.settings.response_timeout;
                // Broadcasts leave it at "unit 0 did not answer".
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
    /// Passes over the byte at `front`, but keeps it if it belongs to what may become a
    /// deviating response to a read. Returns where the next byte stands.
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

    /// True if the byte at `front` is to be kept. Notes it if that byte completes a
    /// deviating response.
    fn is_kept(&mut self, front: u8) -> bool {
        let is_settled = matches!(self.probation, Probation::Held | Probation::Deviating);
        if is_settled || !self.request.is_read() {
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

    /// Counts one more byte after those kept, some of which were dropped for want of room;
    /// returns how many there are. The count stands in the place of the first kept byte,
    /// which is the unit.
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

    /// The length of the frame that the kept bytes begin, by its byte count; 0 if that is
    /// not kept, or too great for a frame.
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

    /// How many bytes of the kept frame's data are kept; of registers, whole ones.
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

    /// Notes the frame at `front`: its unit, function and CRC are right, but it is not the
    /// reply. That is a deviating reply, unless it is an exception.
    pub(super) fn note_deviating(&mut self, front: u8) {
        let is_exception = self.storage.byte(front + 1) & EXCEPTION != 0;
        if !is_exception && self.probation != Probation::Held {
            self.probation = Probation::Deviating;
        }
    }

    /// Drops the kept bytes: a right reply was found, or the room is needed.
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

    /// Has a deviating reply be the answer; false if there was none.
    pub(super) fn accept_deviating(&mut self) -> bool {
        // The last bytes may look like the beginning of a right reply, which waits for more.
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
        // The reply was counted as a frame that was passed over.
        self.skipped = 0;
        self.foreign_frames = self.foreign_frames.saturating_sub(1);
        true
    }
}
