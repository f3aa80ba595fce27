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

use super::{Count, Engine, Match, RequestSpec, RxFault, Storage};
use crate::frame::checksum::Crc16;
use crate::frame::rtu::{self, MIN_FRAME};
use crate::pdu::EXCEPTION;

/// Length of the frame of an exception: unit, function, code, CRC.
pub(super) const EXCEPTION_FRAME: u8 = rtu::OVERHEAD as u8 + 2;

/// Bytes around the data of a read's response frame: unit, function, byte count, CRC.
const READ_OVERHEAD: u8 = rtu::OVERHEAD as u8 + 2;

impl<P, S: Storage, Q: RequestSpec<P, S>> Engine<P, S, Q> {
    /// As [`RequestSpec::expected_length`], for any number of bytes.
    #[cfg_attr(target_os = "none", inline(never))]
    fn expected_length(&mut self, front: S::Count, have: S::Count) -> S::Count {
        if have == S::Count::ZERO {
            return 1u8.into();
        }
        if self.storage.byte(front) != self.unit {
            return S::Count::ZERO;
        }
        if have == 1u8.into() {
            return 2u8.into();
        }
        Q::expected_length(self, front, have)
    }

    /// True if the received bytes are exactly the right reply to a read of `data` bytes. This
    /// is the most frequent case of [`Engine::find_rtu_reply`].
    #[inline(always)]
    pub(crate) fn has_read(&mut self, data: u8) -> bool {
        let length = S::Count::from(data) + READ_OVERHEAD.into();
        if self.end != length || self.processed > S::Count::ZERO || self.skipped > 0 || self.echo {
            return false;
        }
        let frame = self.storage.slice(S::Count::ZERO, length);
        let start = [self.unit, self.request.function(), data];
        if !frame.starts_with(&start) || !rtu::is_frame(frame) {
            return false;
        }
        self.exception = 0;
        self.needed = length;
        true
    }

    /// Searches the received bytes for the reply in an RTU frame, and moves it to the front of
    /// the buffer. False if it has not arrived yet. The search stops at an incomplete
    /// candidate.
    /// If `LENIENT`, a deviating reply is kept meanwhile (see `lenient`).
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn find_rtu_reply<const LENIENT: bool>(&mut self) -> bool {
        if self.needed > self.end {
            self.update_crc(self.end);
            return false;
        }
        let mut front = S::Count::ZERO;
        let found = loop {
            let have = self.end - front;
            let length = self.expected_length(front, have);
            if length > have {
                self.needed = length;
                self.update_crc(self.end);
                break false;
            }
            if length > S::Count::ZERO {
                if self.has_right_crc(front, length) {
                    match Q::validate(self, front, length - rtu::CRC.into()) {
                        Match::Reply => {
                            self.needed = length;
                            break true;
                        }
                        Match::Echo => {}
                        Match::Unrelated => {
                            if LENIENT {
                                Q::note_deviating(self, front);
                            }
                            self.note_foreign_frame(RxFault::MALFORMED);
                        }
                    }
                    front += length;
                    self.begin_frame(front);
                    continue;
                }
                self.note_fault(RxFault::BAD_CRC);
            }
            if LENIENT {
                front = Q::skip_or_keep_byte(self, front);
            } else {
                self.skip_byte(front);
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
    pub fn resync(&mut self, mut front: S::Count) -> bool {
        while front + EXCEPTION_FRAME.into() <= self.end {
            let have = if Q::HAS_FIXED_REPLY {
                // Only an exception is shorter than an incomplete candidate.
                EXCEPTION_FRAME.into()
            } else {
                self.end - front
            };
            let length = self.expected_length(front, have);
            let is_whole = if Q::HAS_FIXED_REPLY {
                length == have
            } else {
                length > S::Count::ZERO && length <= have
            };
            if is_whole
                && self.has_right_crc(front, length)
                && Q::validate(self, front, length - rtu::CRC.into()) == Match::Reply
            {
                self.needed = length;
                self.drop_front(front);
                self.skipped = 1;
                return true;
            }
            front += 1u8.into();
        }
        false
    }

    /// Updates the CRC with the bytes up to `end`. Done as bytes arrive, so that little work
    /// is left when the last byte arrives.
    #[cfg_attr(target_os = "none", inline(never))]
    fn update_crc(&mut self, end: S::Count) {
        let news = self.storage.bytes(self.processed, end - self.processed);
        self.crc = self.crc.with(news);
        self.processed = end;
    }

    /// Starts a new candidate at `front`.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn begin_frame(&mut self, front: S::Count) {
        self.processed = front;
        self.needed = 1u8.into();
        self.skipped = 0;
        self.crc_skipped = Crc16::START;
        self.crc = Crc16::START;
    }

    /// True if the CRC of the frame at `front` is right.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(crate) fn has_right_crc(&mut self, front: S::Count, length: S::Count) -> bool {
        let end = front + length;
        let is_first = self.crc_skipped == Crc16::START;
        let is_known = if Q::HAS_FIXED_REPLY {
            length == self.length
        } else {
            is_first && !self.resynced
        };
        if is_known && self.processed <= end {
            self.update_crc(end);
            if is_first || !Q::HAS_FIXED_REPLY {
                return self.crc.is_residue();
            }
            if self.weight.is_residue() {
                self.weight = Crc16::weight(length.into());
            }
            return self.crc == self.crc_skipped.since_start(self.weight);
        }
        rtu::is_frame(self.storage.bytes(front, length))
    }

    /// Skips the byte at `front`. If the skipped bytes turn out to be a frame, a bad CRC noted
    /// within them is withdrawn.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn skip_byte(&mut self, front: S::Count) {
        if cfg!(feature = "diagnosis") && self.skipped == 0 {
            self.skipped_as = if self.storage.byte(front) != self.unit {
                RxFault::OTHER_UNIT
            } else if self.storage.byte(front + 1u8.into()) & !EXCEPTION != self.request.function()
            {
                RxFault::OTHER_FUNCTION
            } else {
                RxFault::MALFORMED
            };
        }
        self.crc_skipped = self.crc_skipped.with(self.storage.bytes(front, 1u8.into()));
        if self.processed == front {
            self.processed = front + 1u8.into();
            self.crc = self.crc_skipped;
        }
        if self.skipped < MIN_FRAME {
            self.skipped += 1;
        }
        if cfg!(feature = "diagnosis") && self.skipped == MIN_FRAME && self.crc_skipped.is_residue()
        {
            if self.fault == RxFault::BAD_CRC {
                self.fault = RxFault::NOTHING;
            }
            self.note_foreign_frame(self.skipped_as);
            self.begin_frame(front + 1u8.into());
        }
    }

    /// Notes a fault, and counts a frame with a right CRC that is not the reply.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn note_foreign_frame(&mut self, what: RxFault) {
        if cfg!(feature = "counters") {
            self.foreign_frames = self.foreign_frames.saturating_add(1);
        }
        self.note_fault(what);
    }

    /// Notes a fault if it is more severe than the noted one.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(crate) fn note_fault(&mut self, what: RxFault) {
        if self.fault < what {
            self.fault = what;
        }
    }

    /// Drops the bytes before `front`.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn drop_front(&mut self, front: S::Count) {
        self.end -= front;
        self.processed = self.processed.saturating_sub(front);
        self.storage.move_down(front, self.end);
    }
}
