//! Accepts a reply that deviates from the standard, if no valid reply arrives before the request
//! would fail.
//!
//! A *deviating reply* has the right unit, function and CRC. The reply to a write deviates if it
//! repeats another address, value or quantity than the request. The reply to a read deviates if
//! it has more or less data than requested, or more than the frame buffer holds. The search does
//! not find such a reply and looks for a valid one. Meanwhile this module copies the bytes of
//! the frame that is being received to the end of the frame buffer, in reverse order, as far as
//! they fill response words. So a valid reply always wins.
//!
//! Only [`Engine::lenient`] names this module. A program that does not call that function
//! contains none of this code.

use super::request::MasterRequest;
use crate::engine::{Engine, Extension, Finding, Moment, Words};
use crate::frame::rtu;
use crate::port::Port;

/// Bytes before the data in the response to a read: unit, function code and byte count.
const BEFORE_DATA: u8 = 3;

/// Bytes of the frame buffer that must stay free beside the kept bytes. An exception fits into
/// them.
const LEFT_FREE: u8 = 8;

impl<P: Port, S: Words> Engine<P, S, MasterRequest> {
    /// The argument for [`Engine::set_lenience`]: deviating replies are accepted if `on`. A read
    /// may then be sent to unit 0, which has to reply.
    pub const fn lenient(on: bool) -> Option<Extension<P, S, MasterRequest>> {
        if on {
            Some(extend)
        } else {
            None
        }
    }

    /// Keeps the last byte if it may belong to a deviating response to a read. Notes a deviating
    /// reply that ends with it. True if its last byte has yet to come although the CRC is right: a
    /// reply whose last byte is 0 has a right CRC without it, too.
    fn keep(&mut self) -> bool {
        let byte = self.storage.byte(self.end - 1);
        let is_whole = self.is_whole_frame();
        let function = self.function;
        if self.is_held || (self.awaits_end && !self.drop_deviating(byte)) {
            return false;
        }
        if !self.request.is_read() {
            // The search has found that it is not the reply.
            if self.check_end(self.length, function) {
                self.note_deviating(is_whole);
            }
            return false;
        }
        if self.run_length == 1 {
            self.kept = 0;
        }
        let is_ours = match self.run_length {
            1 => byte == self.unit,
            2 => self.kept == 1 && byte == function,
            // A reply that begins as the expected one needs no copy, if the search has space
            // for it.
            3 if byte == self.request.reads() && self.length <= self.storage.capacity() => false,
            _ => self.kept > 0,
        };
        if !is_ours {
            self.kept = 0;
            return false;
        }
        if is_whole && self.run_length == self.kept_length() && self.kept_data() > 0 {
            self.note_deviating(is_whole);
            return false;
        }
        if is_whole && self.run_length.wrapping_add(1) == self.kept_length() {
            self.note(Finding::MALFORMED);
            return true;
        }
        let words = u16::from(self.storage.response_words());
        let space = self.space();
        if u16::from(self.kept) >= (words << 1) + u16::from(BEFORE_DATA) || space <= LEFT_FREE {
            return false;
        }
        // The search has taken in the last byte, so the buffer may be full.
        if self.end == space {
            self.drop_to(1);
        }
        self.storage.set_byte(space - 1, byte);
        self.kept += 1;
        false
    }

    /// Drops a deviating reply that may be a late one if the byte begins another frame with our unit
    /// and function: the second one is the answer, as with right replies. True if the search goes on.
    fn drop_deviating(&mut self, byte: u8) -> bool {
        if self.owed == 0 || !self.request.is_read() {
            return self.owed != 0;
        }
        let begins = self.run_length == 2
            && self.end >= 2
            && self.storage.byte(self.end - 2) == self.unit
            && byte == self.function;
        if begins {
            // The unit is still there from the first one.
            self.kept = 1;
            self.awaits_end = false;
        }
        begins
    }

    /// Notes a deviating reply. A whole frame is not counted as one that does not answer.
    fn note_deviating(&mut self, is_whole: bool) {
        self.awaits_end = true;
        self.foreign_frames = self.foreign_frames.wrapping_sub(is_whole.into());
        if self.may_be_late() {
            // It is held, as a right reply would be. A fault that seemed to lie in it is forgotten.
            if is_whole {
                self.see_nothing();
            }
            self.since = self.now;
            self.wait = self.hold();
        }
    }

    /// The kept byte at `index`.
    fn kept_byte(&self, index: u8) -> u8 {
        self.storage.byte(self.storage.capacity() - 1 - index)
    }

    /// Length of the frame that the kept bytes begin, from its byte count. 0 if the byte count is
    /// not kept yet, or is too great for a frame.
    fn kept_length(&self) -> u8 {
        if self.kept < BEFORE_DATA {
            return 0;
        }
        let count = self.kept_byte(BEFORE_DATA - 1);
        count.checked_add(BEFORE_DATA + rtu::CRC).unwrap_or(0)
    }

    /// How many bytes of the frame's data are kept. For registers, only whole registers count.
    fn kept_data(&self) -> u8 {
        let length = self.kept_length();
        let kept = self.kept.min(length.saturating_sub(rtu::CRC));
        let data = kept.saturating_sub(BEFORE_DATA);
        if self.request.has_registers() {
            data & !1
        } else {
            data
        }
    }

    /// Moves the kept bytes, in the order in which they arrived, to the front of the buffer.
    fn move_kept_to_front(&mut self) {
        let (mut front, mut back) = (0, self.storage.capacity());
        while front < back {
            back -= 1;
            let (first, last) = (self.storage.byte(front), self.storage.byte(back));
            self.storage.set_byte(front, last);
            self.storage.set_byte(back, first);
            front += 1;
        }
    }

    /// Makes a deviating reply the result of a request that would fail. If the reply has more
    /// data than there are response words, only the data that fill these words count.
    fn accept_deviating(&mut self) {
        if self.awaits_end && !self.is_held && !self.seen.is_response() {
            if self.request.is_read() {
                let data = self.kept_data();
                self.request.set_reads(data);
                self.move_kept_to_front();
            }
            self.exception = 0;
            self.is_early = false;
            self.seen = Finding::OK;
        } else if self.awaits_end {
            self.note_foreign_frame();
        }
        let most = u16::from(self.storage.response_words()) << 1;
        if most > 0 && u16::from(self.request.reads()) > most {
            self.request.set_reads(most as u8);
        }
    }
}

/// See [`Extension`]. The end of the frame buffer is used, so `Missed` must follow each byte before
/// the next one is read.
fn extend<P: Port, S: Words>(engine: &mut Engine<P, S, MasterRequest>, moment: Moment) -> bool {
    match moment {
        Moment::Missed => return engine.keep(),
        Moment::End => engine.accept_deviating(),
        Moment::Sent | Moment::Byte => {}
    }
    false
}
