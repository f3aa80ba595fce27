//! Finds the reply among the received bytes of an RTU line.
//!
//! The request determines its reply: unit, function code, length, and the byte count or the
//! repeated head. So each received byte may be the last one of the reply: the reply ends there
//! if the bytes before it begin as the reply does and have a right CRC. Bytes that precede them
//! do not matter: noise, frames of other units, late replies or an echo. An exception to the
//! request, which has five bytes, and the echo of the request are found in the same way.
//!
//! The engine also computes the CRC of all bytes since the last frame ended. If it is right,
//! these bytes were a whole frame. If that frame is not the reply, it is skipped, and an
//! exception or a damaged reply that seemed to lie in it is forgotten.

use super::{Count, Engine, Finding, Moment, Phase, Storage, Transaction};
use crate::error::Status;
use crate::frame::rtu::Crc16;
use crate::frame::rtu::{self, MIN_FRAME};
use crate::pdu::EXCEPTION;
use crate::port::Port;

/// Length of the frame of an exception: unit, function, code, CRC.
const EXCEPTION_FRAME: u8 = rtu::OVERHEAD as u8 + 2;

impl<P: Port, S: Storage, Q: Transaction<P, S>> Engine<P, S, Q> {
    /// Searches the `received` bytes that the port has written to the frame buffer from `first`
    /// on. True if the request ends. The bytes after the reply are dropped then.
    pub(crate) fn search(&mut self, first: S::Count, received: S::Count) -> bool {
        if !Q::IS_OF_MASTER && self.length == S::Count::ZERO {
            self.awaits_end = true;
        }
        if P::READS_SINGLE_BYTES {
            // One byte, at the end.
            return self.take_in();
        }
        if first == S::Count::ZERO && received == self.length && self.accept_reply_alone(received) {
            return true;
        }
        let mut index = first;
        let end = first + received;
        while index < end {
            // The search moves bytes to the front only, so this byte is still there.
            let byte = self.storage.byte(index);
            self.storage.set_byte(self.end, byte);
            if self.take_in() {
                return true;
            }
            index += 1u8.into();
        }
        false
    }

    /// Accepts the received bytes if they are exactly the reply. Returns true if they end the
    /// request. Hosts receive most replies in this way, and save 2000 instructions for ten registers.
    fn accept_reply_alone(&mut self, received: S::Count) -> bool {
        let frame = self.storage.slice(S::Count::ZERO, received);
        let start = [self.unit, self.function];
        if self.may_be_late()
            || self.outgoing > S::Count::ZERO
            || !frame.starts_with(&start)
            || !rtu::is_frame(frame)
        {
            return false;
        }
        self.end = received;
        self.run_length = received;
        let is_reply = self.accept(received);
        if !is_reply {
            self.end = S::Count::ZERO;
            self.run_length = S::Count::ZERO;
        }
        is_reply
    }

    /// Takes in the byte at the end of the frame buffer. True if the request ends with it.
    #[cfg_attr(target_os = "none", inline(never))]
    fn take_in(&mut self) -> bool {
        self.end += 1u8.into();
        let is_whole = self.continue_frame();
        let function = self.function;
        if self.run_extras(Moment::Byte) {
            return false;
        }
        let is_response = if self.check_end(EXCEPTION_FRAME.into(), function | EXCEPTION) {
            self.accept_exception()
        } else {
            let length = self.find_ending_reply();
            length > S::Count::ZERO && self.accept(length)
        };
        if is_response {
            if !self.take_response() {
                return false;
            }
            if self.content > S::Count::ZERO || !self.is_early {
                return true;
            }
        }
        let goes_on = self.run_lenient(Moment::Missed);
        is_whole && !goes_on && self.skip_frame()
    }

    /// Makes the exception at the end of the buffer the finding. False if its code is invalid.
    fn accept_exception(&mut self) -> bool {
        let code = self.storage.byte(self.end - 3u8.into());
        if !self.is_held {
            self.exception = code;
        }
        if let Status::MALFORMED_REPLY = Status::exception(code) {
            self.note(Finding::MALFORMED);
            return false;
        }
        self.exception = code;
        self.seen = Finding(code);
        self.content = S::Count::ZERO;
        // It may lie within another frame, unless it is a whole frame itself.
        self.is_early = self.run_length != EXCEPTION_FRAME.into();
        true
    }

    /// Finds the reply's frame that ends with the last byte, with a right CRC. Returns its length, or
    /// 0 if there is none.
    fn find_ending_reply(&mut self) -> S::Count {
        if !Q::IS_OF_MASTER && self.length == S::Count::ZERO {
            return Q::find_ending_reply(self, false);
        }
        match self.check_end(self.length, self.function) {
            true => self.length,
            false => S::Count::ZERO,
        }
    }

    /// The kind of a frame that begins with the last two bytes and is not the reply.
    fn kind_of_frame(&self) -> Finding {
        // Bytes that were dropped were not of our unit.
        if self.end < 2u8.into() {
            return Finding::OTHER_UNIT;
        }
        let front = self.end - 2u8.into();
        let function = self.storage.byte(front + 1u8.into());
        if self.storage.byte(front) != self.unit {
            Finding::OTHER_UNIT
        } else if function & !EXCEPTION == self.function {
            Finding::MALFORMED
        } else {
            Finding::OTHER_FUNCTION
        }
    }

    /// Moves the frame of `length` bytes at the end of the buffer to its front, and makes it the
    /// reply. False, with nothing changed, if it does not answer the request.
    pub(super) fn accept(&mut self, length: S::Count) -> bool {
        let front = self.end - length;
        if !Q::is_reply(self, front, length) {
            self.note(Finding::MALFORMED);
            return false;
        }
        // By chance, the CRC may be right within the reply. Then that was no frame.
        if self.run_length < length {
            self.foreign_frames = self.foreign_frames.wrapping_sub(1);
        }
        self.is_early = self.run_length > length;
        self.seen = Finding::OK;
        self.exception = 0;
        self.content = length - rtu::CRC.into();
        if front > S::Count::ZERO {
            self.storage.move_down(front, self.content);
        }
        true
    }

    /// Checks whether the last `length` bytes are a frame of our unit with that function code and a
    /// right CRC, and notes a wrong CRC.
    pub(crate) fn check_end(&mut self, length: S::Count, function: u8) -> bool {
        let have = self.end - self.content;
        if length > have {
            return false;
        }
        let front = self.end - length;
        if self.storage.byte(front) != self.unit
            || self.storage.byte(front + 1u8.into()) != function
        {
            return false;
        }
        if rtu::is_frame(self.storage.slice(front, length)) {
            return true;
        }
        // A damaged reply ends the request, unless it lies within the reply or another frame.
        let is_long = self.length > S::Count::ZERO && have >= self.length;
        if is_long || self.run_length == length {
            self.is_early = true;
        }
        self.note_damaged();
        false
    }

    /// Drops the bytes before `front`.
    #[inline(always)]
    pub(crate) fn drop_to(&mut self, front: S::Count) {
        self.content = S::Count::ZERO;
        self.end -= front;
        self.storage.move_down(front, self.end);
    }

    /// Notes a damaged reply. It may be the answer, so a held reply is not.
    #[inline(always)]
    pub(super) fn note_damaged(&mut self) {
        if self.is_held {
            self.seen = Finding::BAD_CRC;
        }
        self.note(Finding::BAD_CRC);
    }

    /// The next byte begins a frame.
    pub(crate) fn begin_frame(&mut self) {
        self.run_length = S::Count::ZERO;
        self.run = Crc16::START;
    }

    /// Counts the byte as one of the frame that is being received. True if all bytes since the
    /// last frame form a frame.
    #[inline(always)]
    pub(super) fn continue_frame(&mut self) -> bool {
        self.run_length = self.run_length.next();
        if self.run_length == 2u8.into() {
            self.run_kind = self.kind_of_frame();
        }
        let last = self.storage.slice(self.end - 1u8.into(), 1u8.into());
        self.run = self.run.with(last);
        self.is_whole_frame()
    }

    /// True if all bytes since the last frame form a frame.
    pub(crate) fn is_whole_frame(&self) -> bool {
        self.run.is_residue() && self.run_length >= MIN_FRAME.into()
    }

    /// Skips a whole frame that is not the reply. True if the frame buffer cannot hold the reply,
    /// and the frame may be the reply: that ends the request.
    fn skip_frame(&mut self) -> bool {
        let kind = self.run_kind;
        if self.seen == Finding::TOO_LONG && kind == Finding::MALFORMED {
            return true;
        }
        self.note_foreign_frame();
        self.note_frame();
        self.begin_frame();
        if self.is_held {
            // A damaged reply that seemed to follow the held one lies in this frame.
            self.seen = if self.content > S::Count::ZERO || self.exception > 0 {
                Finding(self.exception)
            } else {
                Finding::NOTHING
            };
        } else if self.is_early || self.seen == Finding::BAD_CRC {
            self.forget();
        }
        self.note(kind);
        false
    }

    /// Notes which unit has sent the whole frame that is being skipped.
    fn note_frame(&mut self) {
        if self.run_length > self.end {
            return;
        }
        let front = self.end - self.run_length;
        let unit = self.storage.byte(front);
        if self.run_kind == Finding::MALFORMED {
            // It is neither the echo of the request nor the beginning of its reply, in which
            // the CRC is right by chance.
            let count = self.storage.byte(front + 2u8.into());
            let counted = S::Count::of(usize::from(count) + rtu::OVERHEAD + 2);
            let is_reply = self.run_length == self.length || self.run_length == counted;
            if !is_reply || self.run_length == self.sent {
                return;
            }
        }
        self.note_reply_of(unit);
    }

    /// Forgets the exception or fault in `seen`, because it lies within another frame, and
    /// waits for the reply again.
    pub(super) fn forget(&mut self) {
        self.see_nothing();
        if self.phase == Phase::Reply {
            self.since = self.begun;
            self.wait_for_reply();
        }
    }

    /// Sets the finding of a request for which no bytes arrive.
    pub(crate) fn see_nothing(&mut self) {
        self.is_early = false;
        self.exception = 0;
        self.seen = if Q::IS_OF_MASTER && self.length > self.storage.capacity() {
            Finding::TOO_LONG
        } else {
            Finding::NOTHING
        };
    }

    /// Notes a frame with a right CRC that does not answer the request.
    pub(crate) fn note_foreign_frame(&mut self) {
        self.foreign_frames = self.foreign_frames.wrapping_add(1);
    }

    /// Notes a fault if it is more severe than the noted one. A response stays.
    #[cfg_attr(all(target_os = "none", not(target_arch = "avr")), inline(never))]
    pub(crate) fn note(&mut self, fault: Finding) {
        if !self.seen.is_response() && self.seen < fault {
            self.seen = fault;
        }
    }

    /// How many bytes of the frame buffer the search uses.
    pub(crate) fn space(&self) -> S::Count {
        self.storage.capacity() - self.kept
    }

    /// Makes space in a full frame buffer. A held reply is dropped, because too many bytes
    /// follow it. The last bytes stay, because the reply may begin with them.
    #[cfg_attr(target_arch = "avr", inline(never))]
    pub(super) fn make_space(&mut self) {
        let mut keep = self.end - self.content;
        if self.content > S::Count::ZERO {
            self.note_foreign_frame();
            self.seen = Finding::NOTHING;
        } else {
            keep -= 1u8.into();
        }
        if Q::IS_OF_MASTER {
            // An exception is shorter than any reply.
            keep = keep.min(self.length.max(self.outgoing) - 1u8.into());
        }
        while keep > S::Count::ZERO && self.storage.byte(self.end - keep) != self.unit {
            keep -= 1u8.into();
        }
        self.drop_to(self.end - keep);
    }
}
