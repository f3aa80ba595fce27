//! Finds the reply among the received characters of an ASCII line. Every frame begins with a
//! colon; characters before a colon are noise.

use super::{Count, Engine, Request, Seen, Storage, Verdict};
use crate::frame::ascii::{self, find, Content};
use crate::frame::rtu;
use crate::pdu::EXCEPTION;

/// Characters around unit and PDU: colon, two of the LRC, CR and the delimiter.
const AROUND: u8 = 5;

/// How many characters the frame of a PDU of `length` bytes has.
pub fn frame_length(length: u8) -> u16 {
    2 * (u16::from(length) + 1) + u16::from(AROUND)
}

/// How many bytes of unit and PDU a frame of so many characters carries.
pub fn content(characters: u16) -> u16 {
    (characters - u16::from(AROUND)) / 2
}

impl<P, S: Storage, Q: Request<P, S>> Engine<P, S, Q> {
    /// Searches the received characters for the reply in an ASCII frame that ends with
    /// `delimiter`. Leaves the reply decoded at the front of the buffer: unit and PDU, followed
    /// by the remaining characters of its frame.
    pub fn search_ascii(&mut self, delimiter: u8) -> bool {
        let mut front = S::Count::ZERO;
        let found = loop {
            let rest = self.storage.slice(front, self.end - front);
            let (begin, end) = find(rest, delimiter);
            let Some(end) = end else {
                self.pass_characters(begin);
                front += S::Count::of(begin);
                break false;
            };
            self.pass_characters(begin);
            let begins = front + S::Count::of(begin);
            front += S::Count::of(end);
            if begins < front && self.is_reply(begins, front - begins, delimiter) {
                self.least = front - begins;
                front = begins;
                break true;
            }
        };
        self.drop_front(front);
        if !found && self.end == self.storage.room() && self.held == S::Count::ZERO {
            // The frame is too long for the buffer.
            self.see(Seen::TOO_LONG);
            self.end = S::Count::ZERO;
        }
        found
    }

    /// Notes that characters outside of a frame were skipped.
    fn pass_characters(&mut self, count: usize) {
        if count > 0 {
            self.passed = 1;
        }
    }

    /// Decodes the frame of `length` characters at `front`; true if it is the reply.
    fn is_reply(&mut self, front: S::Count, length: S::Count, delimiter: u8) -> bool {
        let frame = self.storage.bytes(front, length);
        let content = match ascii::decode(frame, delimiter, true) {
            Content::Right(length) => S::Count::from(length),
            Content::Damaged(_) => {
                // The unit has been decoded to the front of the frame.
                if self.storage.byte(front) == self.unit {
                    self.see(Seen::BAD_CRC);
                }
                return false;
            }
            Content::Malformed => {
                self.passed = 1;
                return false;
            }
        };
        let function = self.storage.byte(front + 1u8.into()) & !EXCEPTION;
        // The length of an RTU frame of this content: the LRC and one character stand for
        // the CRC.
        let whole = content + rtu::CRC.into();
        let what = if self.storage.byte(front) != self.unit {
            Seen::OTHER_UNIT
        } else if function != self.request.function() {
            Seen::OTHER_FUNCTION
        } else if Q::wanted(self, front, whole) != whole {
            Seen::MALFORMED
        } else {
            match Q::judge(self, front, content) {
                Verdict::Right => return true,
                Verdict::Echo => return false,
                Verdict::Wrong => Seen::MALFORMED,
            }
        };
        self.see_foreign(what);
        false
    }
}
