//! Finds the reply among the received bytes of an RTU line.
//!
//! The front of the frame buffer holds a candidate: bytes that begin like the reply, like an
//! exception to the request, or, if an echo is expected, like the request itself. If the
//! candidate turns out to be no frame, the engine skips it byte by byte up to the next
//! candidate.
//!
//! The engine keeps two CRCs: one of the skipped bytes, and one that continues it over the
//! candidate. If the first becomes the residue, the skipped bytes were a frame of another
//! unit. Both together give the CRC of the candidate, so each byte is processed at most
//! twice, however many candidates there were.

use super::{Count, Engine, Request, Seen, Storage, Verdict};
use crate::frame::checksum::Crc16;
use crate::frame::rtu::{self, MIN_FRAME};
use crate::pdu::EXCEPTION;

/// Length of the frame of an exception: unit, function, code, CRC.
pub(super) const EXCEPTION_FRAME: u8 = rtu::OVERHEAD as u8 + 2;

/// Bytes around the data of a read's response frame: unit, function, byte count, CRC.
const READ_OVERHEAD: u8 = rtu::OVERHEAD as u8 + 2;

impl<P, S: Storage, Q: Request<P, S>> Engine<P, S, Q> {
    /// As [`Request::wanted`], for any number of bytes.
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

    /// True if the received bytes are exactly the right reply to a read of `data` bytes. This
    /// is the most frequent case of [`Engine::search_rtu`].
    #[inline(always)]
    pub(crate) fn has_read(&mut self, data: u8) -> bool {
        let length = S::Count::from(data) + READ_OVERHEAD.into();
        if self.end != length || self.done > S::Count::ZERO || self.passed > 0 || self.echo {
            return false;
        }
        let frame = self.storage.slice(S::Count::ZERO, length);
        let start = [self.unit, self.request.function(), data];
        if !frame.starts_with(&start) || !rtu::is_frame(frame) {
            return false;
        }
        self.exception = 0;
        self.least = length;
        true
    }

    /// Searches the received bytes for the reply in an RTU frame, and moves it to the front of
    /// the buffer. False if it has not arrived yet. The search stops at an incomplete
    /// candidate.
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

    /// Searches for the reply from `front` on, after an incomplete candidate that may be noise,
    /// and moves it to the front of the buffer. If no reply is found, nothing changes, because
    /// the rest of the candidate may still arrive.
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn skim(&mut self, mut front: S::Count) -> bool {
        while front + EXCEPTION_FRAME.into() <= self.end {
            let have = if Q::IS_PLAIN {
                // Only an exception is shorter than an incomplete candidate.
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

    /// Updates the CRC with the bytes up to `end`. Done as bytes arrive, so that little work
    /// is left when the last byte arrives.
    #[cfg_attr(target_os = "none", inline(never))]
    fn take_in(&mut self, end: S::Count) {
        let news = self.storage.bytes(self.done, end - self.done);
        self.crc = self.crc.with(news);
        self.done = end;
    }

    /// Starts a new candidate at `front`.
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
        rtu::is_frame(self.storage.bytes(front, length))
    }

    /// Skips the byte at `front`. If the skipped bytes turn out to be a frame, a bad CRC noted
    /// within them is withdrawn.
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

    /// Notes a fault, and counts a frame with a right CRC that is not the reply.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn see_foreign(&mut self, what: Seen) {
        if cfg!(feature = "counters") {
            self.foreign = self.foreign.saturating_add(1);
        }
        self.see(what);
    }

    /// Notes a fault if it is more severe than the noted one.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(crate) fn see(&mut self, what: Seen) {
        if self.seen < what {
            self.seen = what;
        }
    }

    /// Drops the bytes before `front`.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn drop_front(&mut self, front: S::Count) {
        self.end -= front;
        self.done = self.done.saturating_sub(front);
        self.storage.move_down(front, self.end);
    }
}
