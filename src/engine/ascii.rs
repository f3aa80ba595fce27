//! Finds the reply among the received characters of an ASCII line. Every frame begins with a
//! colon; characters before a colon are noise.

use super::{Count, Engine, Finding, Phase, Storage, Transaction};
use crate::bytes::move_to_front;
use crate::error::Status;
use crate::frame::ascii::{self, find, Decoded};
use crate::frame::rtu;
use crate::pdu::EXCEPTION;
use crate::port::Port;

/// Characters around unit and PDU: colon, two of the LRC, CR and the delimiter.
const OVERHEAD: u8 = 5;

/// Bytes of an exception: unit, function code, exception code.
const EXCEPTION_CONTENT: u8 = 3;

/// Length in characters of the frame for a PDU of `length` bytes.
pub fn frame_length(length: u8) -> u16 {
    2 * (u16::from(length) + 1) + u16::from(OVERHEAD)
}

impl<P: Port, S: Storage, Q: Transaction<P, S>> Engine<P, S, Q> {
    /// Searches the frame buffer, to which the port has appended `received` characters, for the
    /// reply in a frame that ends with `delimiter`. Leaves unit and PDU of the reply at the front
    /// of the buffer. True if the request ends.
    pub fn search_ascii(&mut self, received: S::Count, delimiter: u8) -> bool {
        self.end += received;
        loop {
            let rest = self.storage.slice(self.content, self.end - self.content);
            let (begin, after) = find(rest, delimiter);
            if begin > 0 {
                self.note_skipped();
            }
            let front = self.content + S::Count::of(begin);
            let Some(after) = after else {
                self.drop_until(front);
                break;
            };
            let after = self.content + S::Count::of(after);
            if front < after && self.take_ascii_frame(front, after - front, delimiter) {
                self.is_early = self.run_length > S::Count::ZERO;
                let end = self.end;
                if self.take_response() {
                    return true;
                }
                self.end = end;
            }
            self.drop_until(after);
        }
        if self.is_held {
            self.run_length = self.end - self.content;
        }
        if self.end == self.space() {
            self.drop_too_long();
        }
        false
    }

    /// Makes space in a full buffer: drops a held reply, or a frame that is too long for it.
    fn drop_too_long(&mut self) {
        let held = self.content;
        self.content = S::Count::ZERO;
        if held > S::Count::ZERO {
            self.note_foreign_frame();
            self.seen = Finding::NOTHING;
            self.drop_until(held);
        } else {
            self.note(Finding::TOO_LONG);
            self.is_early = true;
            self.end = S::Count::ZERO;
        }
    }

    /// Drops the received characters before `index`.
    fn drop_until(&mut self, index: S::Count) {
        let from = index - self.content;
        let rest = self.storage.bytes(self.content, self.end - self.content);
        move_to_front(rest, from.into());
        self.end -= from;
    }

    /// Notes that characters outside of a frame were skipped.
    fn note_skipped(&mut self) {
        self.run_length = 1u8.into();
    }

    /// Decodes the frame of `length` characters at `front`. If it is the reply, moves it to the
    /// front of the buffer and returns true. While no request is pending, only notes which unit has
    /// sent it.
    fn take_ascii_frame(&mut self, front: S::Count, length: S::Count, delimiter: u8) -> bool {
        let frame = self.storage.bytes(front, length);
        let content = match ascii::decode(frame, delimiter, true) {
            Decoded::Valid(length) => S::Count::from(length),
            Decoded::WrongLrc(_) => {
                // The unit has been decoded to the front of the frame.
                if self.storage.byte(front) == self.unit {
                    self.note_damaged();
                    self.is_early = true;
                }
                return false;
            }
            Decoded::Malformed => {
                self.note_skipped();
                return false;
            }
        };
        if self.phase == Phase::Idle {
            self.note_reply_of(self.storage.byte(front));
            return false;
        }
        let function = self.storage.byte(front + 1u8.into());
        // The length of an RTU frame of this content: the LRC and one character stand for
        // the CRC.
        let whole = content + rtu::CRC.into();
        let kind = if self.storage.byte(front) != self.unit {
            Finding::OTHER_UNIT
        } else if function & !EXCEPTION != self.function {
            Finding::OTHER_FUNCTION
        } else if function & EXCEPTION != 0 {
            let code = self.storage.byte(front + 2u8.into());
            let is_valid = Status::exception(code) != Status::MALFORMED_REPLY;
            if is_valid && content == EXCEPTION_CONTENT.into() {
                self.exception = code;
                self.seen = Finding(code);
                self.content = S::Count::ZERO;
                return true;
            }
            Finding::MALFORMED
        } else if length == self.outgoing && Q::is_echo(self, front) {
            self.outgoing = S::Count::ZERO;
            return false;
        } else if Q::is_reply(self, front, whole) {
            self.exception = 0;
            self.seen = Finding::OK;
            self.storage.move_down(front, content);
            self.content = content;
            return true;
        } else {
            Finding::MALFORMED
        };
        self.note_foreign_frame();
        // A frame as long as the request may be its echo.
        if length != self.sent {
            self.note_reply_of(self.storage.byte(front));
        }
        self.note(kind);
        false
    }
}
