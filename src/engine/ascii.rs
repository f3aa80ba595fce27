//! Finds the reply among the received characters of an ASCII line. Every frame begins with a
//! colon; characters before a colon are noise.

use super::{Count, Engine, Match, RequestSpec, RxFault, Storage};
use crate::frame::ascii::{self, find, Decoded};
use crate::frame::rtu;
use crate::pdu::EXCEPTION;

/// Characters around unit and PDU: colon, two of the LRC, CR and the delimiter.
const OVERHEAD: u8 = 5;

/// Length in characters of the frame for a PDU of `length` bytes.
pub fn frame_length(length: u8) -> u16 {
    2 * (u16::from(length) + 1) + u16::from(OVERHEAD)
}

/// Length of unit and PDU in a frame of `characters` characters.
pub fn content(characters: u16) -> u16 {
    (characters - u16::from(OVERHEAD)) / 2
}

impl<P, S: Storage, Q: RequestSpec<P, S>> Engine<P, S, Q> {
    /// Searches the received characters for the reply in an ASCII frame that ends with
    /// `delimiter`. Leaves the reply decoded at the front of the buffer: unit and PDU, followed
    /// by the remaining characters of its frame.
    pub fn find_ascii_reply(&mut self, delimiter: u8) -> bool {
        let mut front = S::Count::ZERO;
        let found = loop {
            let rest = self.storage.slice(front, self.end - front);
            let (begin, end) = find(rest, delimiter);
            let Some(end) = end else {
                self.note_skipped(begin);
                front += S::Count::of(begin);
                break false;
            };
            self.note_skipped(begin);
            let begins = front + S::Count::of(begin);
            front += S::Count::of(end);
            if begins < front && self.is_reply(begins, front - begins, delimiter) {
                self.needed = front - begins;
                front = begins;
                break true;
            }
        };
        self.drop_front(front);
        if !found && self.end == self.storage.capacity() && self.held == S::Count::ZERO {
            // The frame is too long for the buffer.
            self.note_fault(RxFault::TOO_LONG);
            self.end = S::Count::ZERO;
        }
        found
    }

    /// Notes that characters outside of a frame were skipped.
    fn note_skipped(&mut self, count: usize) {
        if count > 0 {
            self.skipped = 1;
        }
    }

    /// Decodes the frame of `length` characters at `front`; true if it is the reply.
    fn is_reply(&mut self, front: S::Count, length: S::Count, delimiter: u8) -> bool {
        let frame = self.storage.bytes(front, length);
        let content = match ascii::decode(frame, delimiter, true) {
            Decoded::Valid(length) => S::Count::from(length),
            Decoded::WrongLrc(_) => {
                // The unit has been decoded to the front of the frame.
                if self.storage.byte(front) == self.unit {
                    self.note_fault(RxFault::BAD_CRC);
                }
                return false;
            }
            Decoded::Malformed => {
                self.skipped = 1;
                return false;
            }
        };
        let function = self.storage.byte(front + 1u8.into()) & !EXCEPTION;
        // The length of an RTU frame of this content: the LRC and one character stand for
        // the CRC.
        let whole = content + rtu::CRC.into();
        let fault = if self.storage.byte(front) != self.unit {
            RxFault::OTHER_UNIT
        } else if function != self.request.function() {
            RxFault::OTHER_FUNCTION
        } else if Q::expected_length(self, front, whole) != whole {
            RxFault::MALFORMED
        } else {
            match Q::validate(self, front, content) {
                Match::Reply => return true,
                Match::Echo => return false,
                Match::Unrelated => RxFault::MALFORMED,
            }
        };
        self.note_foreign_frame(fault);
        false
    }
}
