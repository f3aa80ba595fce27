//! Finds the reply among the bytes that arrive.
//!
//! At the front of the frame buffer stands a candidate: bytes that begin as the
//! reply does, as an exception to the request, or as the request itself where an
//! echo is expected. What turns out to be no frame is passed over byte by byte, up
//! to the next candidate.
//!
//! Two CRCs are kept: of the bytes passed over, and of these and what is looked at
//! since. Where the first one ends with the residue, what was passed over was a
//! frame of somebody else. The two together tell whether the CRC of a reply is
//! right, however many candidates were taken for it before: its bytes are taken in
//! twice at most.

use super::{Engine, Storage, AROUND_PDU};
use crate::error::Status;
use crate::frame::checksum::{crc16, Crc16};
use crate::frame::rtu::MIN_FRAME;
use crate::frame::Seen;
use crate::pdu::EXCEPTION;

/// Bytes of an exception's frame: unit, function, code, CRC.
const EXCEPTION_FRAME: u8 = 5;

/// What a frame is that begins as the reply does.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Verdict {
    /// The reply.
    Right,
    /// The request itself.
    Echo,
    /// Neither.
    Wrong,
}

impl<P, S: Storage> Engine<P, S> {
    /// Bytes of the frame of the reply that was found.
    pub(super) fn found_length(&self) -> u8 {
        if self.exception == 0 {
            self.length
        } else {
            EXCEPTION_FRAME
        }
    }

    /// True if the `count` bytes behind the unit at `front` are the request's.
    #[cfg_attr(target_os = "none", inline(never))]
    fn agrees(&self, front: u8, count: u8) -> bool {
        let bytes = self.storage.slice(front + 1, count);
        self.query
            .head()
            .iter()
            .zip(bytes)
            .all(|(ours, theirs)| ours == theirs)
    }

    /// The length of the frame that begins with the `have` bytes at `front`, or the
    /// least length while they do not tell; 0 if no frame that is waited for begins so.
    #[cfg_attr(target_os = "none", inline(never))]
    fn wanted(&mut self, front: u8, have: u8) -> u8 {
        if have == 0 {
            return 1;
        }
        if self.storage.byte(front) != self.unit {
            return 0;
        }
        if have == 1 {
            return 2;
        }
        let function = self.storage.byte(front + 1) ^ self.query.function();
        if function == EXCEPTION {
            return EXCEPTION_FRAME;
        }
        if function != 0 {
            return 0;
        }
        if cfg!(feature = "echo") && self.echo {
            let known = (have - 1).min(self.query.head_length());
            if self.agrees(front, known) {
                // It may yet turn out to be the reply.
                return (self.query.length() + AROUND_PDU).min(have + 1);
            }
        }
        if self.query.is_read() {
            if have == 2 {
                return 3;
            }
            if self.storage.byte(front + 2) != self.query.reads() {
                return 0;
            }
        }
        if self.length == 0 {
            self.see(Seen::TOO_LONG);
        }
        self.length
    }

    /// Looks for the reply among what has arrived, and moves it to the front; false
    /// if it is not there yet. Stops at a candidate that is not complete.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn search(&mut self) -> bool {
        if self.least > self.end {
            self.take_in(self.end);
            return false;
        }
        let mut front = 0;
        let found = loop {
            let have = self.end - front;
            let length = self.wanted(front, have);
            if length > have {
                self.least = length;
                self.take_in(self.end);
                break false;
            }
            if length > 0 {
                if self.is_right(front, length) {
                    match self.judge(front) {
                        Verdict::Right => break true,
                        Verdict::Echo => {}
                        Verdict::Wrong => self.see_foreign(Seen::MALFORMED),
                    }
                    front += length;
                    self.begin_frame(front);
                    continue;
                }
                self.see(Seen::BAD_CRC);
            }
            self.pass(front);
            front += 1;
        };
        if front > 0 {
            self.drop_front(front);
        }
        found
    }

    /// Looks for an exception behind a candidate that is not complete, which may be
    /// noise; moves it to the front. If there is none, all is left as it was, for
    /// the rest of the candidate may still come.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn skim(&mut self) -> bool {
        let mut front = 1;
        while front + EXCEPTION_FRAME <= self.end {
            if self.wanted(front, EXCEPTION_FRAME) == EXCEPTION_FRAME
                && self.is_right(front, EXCEPTION_FRAME)
                && self.judge(front) == Verdict::Right
            {
                self.passed = 1;
                self.drop_front(front);
                return true;
            }
            front += 1;
        }
        false
    }

    /// Takes the bytes up to `end` into the CRC, as they arrive, so that little is left
    /// to do for the last one.
    #[cfg_attr(target_os = "none", inline(never))]
    fn take_in(&mut self, end: u8) {
        let news = self.storage.bytes(self.done, end - self.done);
        self.crc = self.crc.with(news);
        self.done = end;
    }

    /// A frame begins at `front`, or whatever comes next.
    pub(super) fn begin_frame(&mut self, front: u8) {
        self.done = front;
        self.least = 1;
        self.passed = 0;
        self.crc_passed = Crc16::START;
        self.crc = Crc16::START;
    }

    /// True if the CRC of the frame at `front` is right.
    #[cfg_attr(target_os = "none", inline(never))]
    fn is_right(&mut self, front: u8, length: u8) -> bool {
        let end = front + length;
        if length == self.length && self.done <= end {
            self.take_in(end);
            if self.crc_passed == Crc16::START {
                return self.crc.is_residue();
            }
            if self.weight.is_residue() {
                self.weight = Crc16::weight(length);
            }
            return self.crc == self.crc_passed.since_start(self.weight);
        }
        crc16(self.storage.bytes(front, length)).is_residue()
    }

    /// Says what the frame at `front` is, whose CRC is right.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn judge(&mut self, front: u8) -> Verdict {
        self.exception = 0;
        if self.storage.byte(front + 1) & EXCEPTION != 0 {
            self.exception = self.storage.byte(front + 2);
            return match Status::exception(self.exception) {
                Status::MALFORMED_REPLY => Verdict::Wrong,
                _ => Verdict::Right,
            };
        }
        // A reply may be shorter than the head, and stand at the end of the buffer.
        let head = self.query.head_length();
        let agrees = self.end - front > head && self.agrees(front, head);
        if cfg!(feature = "echo") && self.echo && agrees {
            self.echo = false;
            return Verdict::Echo;
        }
        if agrees || self.query.is_read() {
            Verdict::Right
        } else {
            Verdict::Wrong
        }
    }

    /// Passes over the byte at `front`. Where such bytes make up a frame, a damaged
    /// reply seen in it was none.
    #[cfg_attr(target_os = "none", inline(never))]
    fn pass(&mut self, front: u8) {
        if cfg!(feature = "diagnosis") && self.passed == 0 {
            self.passed_as = if self.storage.byte(front) != self.unit {
                Seen::OTHER_UNIT
            } else if self.storage.byte(front + 1) & !EXCEPTION != self.query.function() {
                Seen::OTHER_FUNCTION
            } else {
                Seen::MALFORMED
            };
        }
        self.crc_passed = self.crc_passed.with(self.storage.bytes(front, 1));
        if self.done == front {
            self.done = front + 1;
            self.crc = self.crc_passed;
        }
        if self.passed < MIN_FRAME {
            self.passed += 1;
        }
        if cfg!(feature = "diagnosis") && self.passed == MIN_FRAME && self.crc_passed.is_residue() {
            if self.seen == Seen::BAD_CRC {
                self.seen = Seen::NOTHING;
            }
            self.see_foreign(self.passed_as);
            self.begin_frame(front + 1);
        }
    }

    /// Notes a frame with a right CRC that is not the reply.
    #[cfg_attr(target_os = "none", inline(never))]
    fn see_foreign(&mut self, what: Seen) {
        if cfg!(feature = "counters") {
            self.foreign = self.foreign.saturating_add(1);
        }
        self.see(what);
    }

    #[cfg_attr(target_os = "none", inline(never))]
    fn see(&mut self, what: Seen) {
        if self.seen < what {
            self.seen = what;
        }
    }

    /// Drops what stands before `front`.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn drop_front(&mut self, front: u8) {
        self.end -= front;
        self.done = self.done.saturating_sub(front);
        self.storage.move_down(front, self.end);
    }
}
