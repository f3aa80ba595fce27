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

use super::{Count, Engine, Request, Seen, Storage, Verdict};
use crate::frame::checksum::{crc16, Crc16};
use crate::frame::rtu::{self, MIN_FRAME};
use crate::pdu::EXCEPTION;

/// Bytes of an exception's frame: unit, function, code, CRC.
pub(super) const EXCEPTION_FRAME: u8 = rtu::OVERHEAD as u8 + 2;

/// Bytes of the frame of a response to a read around its data: unit, function, byte count,
/// CRC.
const READ_OVERHEAD: u8 = rtu::OVERHEAD as u8 + 2;

impl<P, S: Storage, Q: Request<P, S>> Engine<P, S, Q> {
    /// As [`Request::wanted`], of any bytes.
    #[cfg_attr(target_os = "none", inline(never))]
    fn wanted(&mut self, front: S::Count, have: S::Count) -> S::Count {
        if have == S::Count::ZERO {
            return 1u8.into();
        }
        if self.storage.byte(front) != self.unit {
            return S::Count::ZERO;
        }
        if have == 1u8.into() {
            return 2u8.into();
        }
        Q::wanted(self, front, have)
    }

    /// As [`Engine::search_rtu`], of what is there most often: the whole and right reply
    /// to a read of so many bytes of data, and nothing else.
    #[inline(always)]
    pub(crate) fn has_read(&mut self, data: u8) -> bool {
        let length = S::Count::from(data) + READ_OVERHEAD.into();
        if self.end != length || self.done > S::Count::ZERO || self.passed > 0 || self.echo {
            return false;
        }
        let frame = self.storage.slice(S::Count::ZERO, length);
        let start = [self.unit, self.request.function(), data];
        if !frame.starts_with(&start) || !crc16(frame).is_residue() {
            return false;
        }
        self.exception = 0;
        self.least = length;
        true
    }

    /// Looks for the reply among what has arrived, in RTU frames, and moves it to the
    /// front; false if it is not there yet. Stops at a candidate that is not complete.
    /// If `LENIENT`, a deviating reply is kept meanwhile (see `lenient`).
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn search_rtu<const LENIENT: bool>(&mut self) -> bool {
        if self.least > self.end {
            self.take_in(self.end);
            return false;
        }
        let mut front = S::Count::ZERO;
        let found = loop {
            let have = self.end - front;
            let length = self.wanted(front, have);
            if length > have {
                self.least = length;
                self.take_in(self.end);
                break false;
            }
            if length > S::Count::ZERO {
                if self.is_right(front, length) {
                    match Q::judge(self, front, length - rtu::CRC.into()) {
                        Verdict::Right => {
                            self.least = length;
                            break true;
                        }
                        Verdict::Echo => {}
                        Verdict::Wrong => {
                            if LENIENT {
                                Q::note_deviating(self, front);
                            }
                            self.see_foreign(Seen::MALFORMED);
                        }
                    }
                    front += length;
                    self.begin_frame(front);
                    continue;
                }
                self.see(Seen::BAD_CRC);
            }
            if LENIENT {
                front = Q::pass_and_keep(self, front);
            } else {
                self.pass(front);
                front += 1u8.into();
            }
        };
        if front > S::Count::ZERO {
            self.drop_front(front);
        }
        found
    }

    /// Looks for the reply from `front` on, behind a candidate that is not complete, which
    /// may be noise; moves it to the front. If there is none, all is left as it was, for
    /// the rest of the candidate may still come.
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn skim(&mut self, mut front: S::Count) -> bool {
        while front + EXCEPTION_FRAME.into() <= self.end {
            let have = if Q::IS_PLAIN {
                // Only an exception is shorter than a candidate that is not complete.
                EXCEPTION_FRAME.into()
            } else {
                self.end - front
            };
            let length = self.wanted(front, have);
            let is_whole = if Q::IS_PLAIN {
                length == have
            } else {
                length > S::Count::ZERO && length <= have
            };
            if is_whole
                && self.is_right(front, length)
                && Q::judge(self, front, length - rtu::CRC.into()) == Verdict::Right
            {
                self.least = length;
                self.drop_front(front);
                self.passed = 1;
                return true;
            }
            front += 1u8.into();
        }
        false
    }

    /// Takes the bytes up to `end` into the CRC, as they arrive, so that little is left
    /// to do for the last one.
    #[cfg_attr(target_os = "none", inline(never))]
    fn take_in(&mut self, end: S::Count) {
        let news = self.storage.bytes(self.done, end - self.done);
        self.crc = self.crc.with(news);
        self.done = end;
    }

    /// A frame begins at `front`, or whatever comes next.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn begin_frame(&mut self, front: S::Count) {
        self.done = front;
        self.least = 1u8.into();
        self.passed = 0;
        self.crc_passed = Crc16::START;
        self.crc = Crc16::START;
    }

    /// True if the CRC of the frame at `front` is right.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(crate) fn is_right(&mut self, front: S::Count, length: S::Count) -> bool {
        let end = front + length;
        let is_first = self.crc_passed == Crc16::START;
        let is_known = if Q::IS_PLAIN {
            length == self.length
        } else {
            is_first && !self.skimmed
        };
        if is_known && self.done <= end {
            self.take_in(end);
            if is_first || !Q::IS_PLAIN {
                return self.crc.is_residue();
            }
            if self.weight.is_residue() {
                self.weight = Crc16::weight(length.into());
            }
            return self.crc == self.crc_passed.since_start(self.weight);
        }
        crc16(self.storage.bytes(front, length)).is_residue()
    }

    /// Passes over the byte at `front`. Where such bytes make up a frame, a damaged
    /// reply seen in it was none.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn pass(&mut self, front: S::Count) {
        if cfg!(feature = "diagnosis") && self.passed == 0 {
            self.passed_as = if self.storage.byte(front) != self.unit {
                Seen::OTHER_UNIT
            } else if self.storage.byte(front + 1u8.into()) & !EXCEPTION != self.request.function()
            {
                Seen::OTHER_FUNCTION
            } else {
                Seen::MALFORMED
            };
        }
        self.crc_passed = self.crc_passed.with(self.storage.bytes(front, 1u8.into()));
        if self.done == front {
            self.done = front + 1u8.into();
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
            self.begin_frame(front + 1u8.into());
        }
    }

    /// Notes a frame with a right CRC that is not the reply.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn see_foreign(&mut self, what: Seen) {
        if cfg!(feature = "counters") {
            self.foreign = self.foreign.saturating_add(1);
        }
        self.see(what);
    }

    #[cfg_attr(target_os = "none", inline(never))]
    pub(crate) fn see(&mut self, what: Seen) {
        if self.seen < what {
            self.seen = what;
        }
    }

    /// Drops what stands before `front`.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn drop_front(&mut self, front: S::Count) {
        self.end -= front;
        self.done = self.done.saturating_sub(front);
        self.storage.move_down(front, self.end);
    }
}
