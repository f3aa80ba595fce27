//! RTU: unit, PDU, CRC-16, and silence around them (serial line guide 2.5.1).
//!
//! A reply carries no length, and a bad wire puts anything in front of it. So
//! a reply is searched for: a candidate frame starts at each offset of what
//! has arrived, and what turns out not to be the frame costs one byte.

use super::checksum::{crc16, Crc16};
pub use super::search::{Found, Seen, Verdict, Wanted};
use super::{Adu, Search};
use crate::error::Status;
use core::cell::Cell;

/// The longest frame: unit, PDU of 253 bytes, CRC.
pub const MAX_FRAME: usize = 256;

/// Bytes of a frame around its PDU: the unit before, the CRC behind.
pub const OVERHEAD: usize = 3;

/// Where the PDU of a frame starts.
pub const PDU: usize = 1;

/// Writes the frame of the PDU that `pdu` writes, `length` bytes long. Returns
/// false, with nothing written, if `buffer` cannot hold it.
pub fn write(buffer: &mut [u8], unit: u8, length: usize, pdu: impl FnOnce(&mut [u8])) -> bool {
    let Some(frame) = buffer.get_mut(..length + OVERHEAD) else {
        return false;
    };
    let Some((content, crc)) = frame.split_at_mut_checked(length + PDU) else {
        return false;
    };
    if let Some((first, rest)) = content.split_first_mut() {
        *first = unit;
        pdu(rest);
    }
    if let [low, high] = crc {
        [*low, *high] = crc16(content).to_bytes();
    }
    true
}

/// The frame that is the whole of `bytes`.
///
/// # Errors
/// [`Status::INCOMPLETE_FRAME`] for less than any frame has,
/// [`Status::MALFORMED_FRAME`] for more, [`Status::INVALID_CRC`].
pub fn parse(bytes: &[u8]) -> Result<Adu<'_>, Status> {
    if bytes.len() < usize::from(MIN_FRAME) {
        return Err(Status::INCOMPLETE_FRAME);
    }
    if bytes.len() > MAX_FRAME {
        return Err(Status::MALFORMED_FRAME);
    }
    match bytes {
        [unit, pdu @ .., _, _] if crc16(bytes).is_residue() => Ok(Adu {
            transaction: 0,
            unit: *unit,
            pdu,
        }),
        _ => Err(Status::INVALID_CRC),
    }
}

/// Where the last frame of `bytes` begins, which ends where they end; their
/// length if there is none. What stands before it does not matter: the CRC is
/// taken back byte by byte until it is that of no bytes. Two or three bytes may be a frame
/// here, one without a PDU.
#[cfg_attr(target_os = "none", inline(never))]
pub fn last(bytes: &[u8]) -> usize {
    let mut crc = Crc16::RESIDUE;
    let mut start = bytes.len();
    let mut rest = bytes;
    while let [before @ .., byte] = rest {
        crc = crc.before(*byte);
        rest = before;
        if crc == Crc16::START {
            start = rest.len();
        }
    }
    start
}

/// Writes the frame of the PDU that `pdu` writes; returns its length.
///
/// # Errors
/// As `pdu` says; [`Status::BUFFER_TOO_SMALL`].
pub fn emit(
    buffer: &mut [u8],
    unit: u8,
    pdu: impl FnOnce(&mut [u8]) -> Result<usize, Status>,
) -> Result<usize, Status> {
    let room = buffer.len().saturating_sub(OVERHEAD);
    let place = buffer.get_mut(PDU..PDU + room);
    let length = pdu(place.ok_or(Status::BUFFER_TOO_SMALL)?)?;
    // Also tells the compiler that the length of the frame cannot overflow.
    if length > room {
        return Err(Status::BUFFER_TOO_SMALL);
    }
    write(buffer, unit, length, |_| ());
    Ok(length + OVERHEAD)
}

/// The least bytes of a frame: unit, function, CRC.
pub const MIN_FRAME: u8 = 4;

/// A window that slides over received bytes. The buffer is the caller's and
/// is passed to each call.
#[derive(Clone, Copy, Hash, Debug)]
pub struct Window {
    /// Where in the buffer what arrived ends; the candidate stands at its front.
    end: u16,
    /// The CRC of the candidate's first bytes, and how many those are; of what is
    /// to be sent, how many bytes were.
    crc: Crc16,
    checked: u16,
    /// The bytes passed over since a frame boundary, for they may turn out to
    /// be somebody else's frame: their CRC, count, and what such a frame is.
    passed_crc: Crc16,
    passed: u8,
    passed_as: Seen,
    seen: Seen,
    foreign: u8,
    /// Also what stands behind a candidate that is not complete is searched.
    skim: bool,
}

impl Window {
    /// A window over nothing.
    pub const EMPTY: Window = Window {
        end: 0,
        crc: Crc16::START,
        checked: 0,
        passed_crc: Crc16::START,
        passed: 0,
        passed_as: Seen::NOTHING,
        seen: Seen::NOTHING,
        foreign: 0,
        skim: false,
    };

    /// The part of `buffer` to receive into.
    pub fn room<'a>(&self, buffer: &'a mut [u8]) -> Option<&'a mut [u8]> {
        buffer.get_mut(usize::from(self.end)..)
    }

    /// Becomes a window over nothing, of which nothing is left to be skimmed.
    pub fn clear(&mut self) {
        self.skim = true;
        self.end = 0;
        self.begin();
        self.passed = 0;
        self.seen = Seen::NOTHING;
        self.foreign = 0;
    }

    /// Says that `count` bytes more are in the buffer, as in [`Window::room`].
    pub fn arrived(&mut self, count: u16) {
        self.end += count;
        self.skim = false;
    }

    /// Says that the buffer holds `count` bytes to be sent.
    pub fn hold(&mut self, count: u16) {
        self.end = count;
        self.checked = 0;
    }

    /// Says that `count` bytes more were sent.
    pub fn sent(&mut self, count: u16) {
        self.checked += count;
    }

    /// The bytes that are yet to be sent.
    pub fn unsent<'a>(&self, buffer: &'a [u8]) -> Option<&'a [u8]> {
        // One after the other: both at once are more code on an AVR.
        buffer
            .get(..usize::from(self.end))?
            .get(usize::from(self.checked)..)
    }

    /// Has the next search look behind a candidate that is not complete, which
    /// may be noise; the rest of it may still come.
    pub fn skim(&mut self) {
        self.skim = true;
    }

    /// True if nothing arrived since [`Window::skim`].
    pub const fn is_skimmed(&self) -> bool {
        self.skim
    }

    /// Nothing is known of the candidate.
    fn begin(&mut self) {
        self.crc = Crc16::START;
        self.checked = 0;
    }

    /// Passes over `count` bytes: what stands behind them moves to the front.
    #[cfg_attr(target_os = "none", inline(never))]
    fn advance(&mut self, buffer: &mut [u8], count: u16) {
        let cells = Cell::from_mut(buffer).as_slice_of_cells();
        let Some(kept) = cells.get(usize::from(count)..usize::from(self.end)) else {
            return;
        };
        for (to, from) in cells.iter().zip(kept) {
            to.set(from.get());
        }
        self.end = kept.len() as u16;
    }

    /// The CRC of the candidate up to the end of `known`, which grows as bytes
    /// arrive, so that little is left to do when the last one does.
    fn checked(&mut self, known: &[u8]) -> Crc16 {
        let news = known.get(usize::from(self.checked)..).unwrap_or_default();
        self.crc = self.crc.with(news);
        self.checked = known.len() as u16;
        self.crc
    }

    /// The bytes of the window.
    pub fn bytes<'a>(&self, buffer: &'a [u8]) -> Option<&'a [u8]> {
        buffer.get(..usize::from(self.end))
    }

    /// The bytes from `offset` into the candidate on.
    pub fn behind<'a>(&self, buffer: &'a [u8], offset: usize) -> Option<&'a [u8]> {
        buffer.get(offset..)
    }

    /// The most telling thing seen so far.
    pub const fn seen(&self) -> Seen {
        self.seen
    }

    /// Frames with a right CRC that were passed over.
    pub const fn foreign_frames(&self) -> u8 {
        self.foreign
    }

    /// True if bytes were passed over that were no frame.
    pub const fn has_passed_noise(&self) -> bool {
        self.passed > 0
    }

    /// Looks for a frame with a right CRC that is what is `wanted`, and starts
    /// there; false if there is none.
    ///
    /// Stops at a candidate that is not complete yet, unless [`Window::skim`]
    /// was called; then, if there is nothing, all is left as it was.
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn search(&mut self, buffer: &mut [u8], wanted: &mut impl Wanted) -> bool {
        let mut found = false;
        let Some(mut rest) = self.bytes(buffer) else {
            return false;
        };
        // What stays in the buffer.
        let mut kept = rest.len();
        while let [_, behind @ ..] = rest {
            if let Some(length) = wanted.length(rest) {
                let total = usize::from(length.get()) + OVERHEAD;
                if let Some((frame, next)) = rest.split_at_checked(total) {
                    let crc = if self.skim {
                        crc16(frame)
                    } else {
                        self.checked(frame)
                    };
                    if crc.is_residue() {
                        self.checked = total as u16;
                        kept = rest.len();
                        match wanted.judge(frame) {
                            Verdict::Right => {
                                found = true;
                                break;
                            }
                            Verdict::Own => {}
                            Verdict::Wrong => self.see_foreign(Seen::MALFORMED),
                        }
                        self.passed = 0;
                        self.begin();
                        rest = next;
                        kept = rest.len();
                        continue;
                    }
                    if !self.skim {
                        self.see(Seen::BAD_CRC);
                    }
                } else if total > buffer.len() + wanted.reserve() {
                    self.see(Seen::TOO_LONG);
                } else if !self.skim {
                    self.checked(rest);
                    break;
                }
            }
            if !self.skim {
                self.pass(rest, wanted);
                kept = behind.len();
            }
            rest = behind;
        }
        let passed = self.end - kept as u16;
        if passed > 0 {
            self.advance(buffer, passed);
        }
        found
    }

    /// Notes a frame with a right CRC that is not the one.
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

    /// Takes in the first byte of `rest`, which is passed over. Where such bytes
    /// make up a frame, a damaged reply seen in it was none.
    #[cfg_attr(target_os = "none", inline(never))]
    fn pass(&mut self, rest: &[u8], wanted: &impl Wanted) {
        self.begin();
        if !cfg!(feature = "diagnosis") {
            return;
        }
        if self.passed == 0 {
            self.passed_crc = Crc16::START;
            self.passed_as = match rest {
                [unit, ..] if *unit != wanted.unit() => Seen::OTHER_UNIT,
                [_, function, ..] if function & 0x7F != wanted.function() => Seen::OTHER_FUNCTION,
                _ => Seen::MALFORMED,
            };
        }
        // A slice of what is there: a byte of its own would be put on the stack.
        let first = rest.get(..1).unwrap_or_default();
        self.passed_crc = self.passed_crc.with(first);
        if self.passed < MIN_FRAME {
            self.passed += 1;
        }
        if self.passed < MIN_FRAME || !self.passed_crc.is_residue() {
            return;
        }
        self.passed = 0;
        if self.seen == Seen::BAD_CRC {
            self.seen = Seen::NOTHING;
        }
        self.see_foreign(self.passed_as);
    }
}

impl Search for Window {
    const EMPTY: Window = Window::EMPTY;

    fn frame_length(length: u8) -> u16 {
        u16::from(length) + OVERHEAD as u16
    }

    fn hold(&mut self, count: u16) {
        self.hold(count);
    }

    fn write(
        &self,
        buffer: &mut [u8],
        unit: u8,
        length: usize,
        pdu: impl FnOnce(&mut [u8]),
    ) -> bool {
        write(buffer, unit, length, pdu)
    }

    fn room<'a>(&mut self, buffer: &'a mut [u8]) -> Option<&'a mut [u8]> {
        Window::room(self, buffer)
    }

    fn clear(&mut self) {
        self.clear();
    }

    fn arrived(&mut self, count: u16) {
        self.arrived(count);
    }

    fn sent(&mut self, count: u16) {
        self.sent(count);
    }

    fn skim(&mut self) {
        self.skim();
    }

    fn is_skimmed(&self) -> bool {
        self.is_skimmed()
    }

    fn unsent<'a>(&self, buffer: &'a [u8]) -> Option<&'a [u8]> {
        Window::unsent(self, buffer)
    }

    fn behind<'a>(&self, buffer: &'a [u8], offset: usize) -> Option<&'a [u8]> {
        self.behind(buffer, offset)
    }

    fn seen(&self) -> Seen {
        self.seen()
    }

    fn foreign_frames(&self) -> u8 {
        self.foreign_frames()
    }

    fn has_passed_noise(&self) -> bool {
        self.has_passed_noise()
    }

    fn fills(&self, length: usize) -> bool {
        usize::from(self.end) >= length
    }

    fn has_begun(&self) -> bool {
        // One byte may be anything.
        self.end > 1
    }

    fn keep(&mut self) -> Found {
        let length = self.checked;
        self.end -= length;
        self.begin();
        self.passed = 0;
        self.seen = Seen::NOTHING;
        Found {
            start: 0,
            content: length,
            length,
        }
    }

    fn search(&mut self, buffer: &mut [u8], wanted: &mut impl Wanted) -> bool {
        self.search(buffer, wanted)
    }
}
