//! RTU: unit, PDU, CRC-16, and silence around them (serial line guide 2.5.1).
//!
//! A reply carries no length, and a bad wire puts anything in front of it. So
//! a reply is searched for: a candidate frame starts at each offset of what
//! has arrived, and what turns out not to be the frame costs one byte.

use super::checksum::{crc16, Crc16};
use core::cell::Cell;
use core::ops::Range;

/// The longest frame: unit, PDU of 253 bytes, CRC.
pub const MAX_FRAME: usize = 256;

/// Bytes of a frame around its PDU: the unit before, the CRC behind.
pub const OVERHEAD: usize = 3;

/// Writes the frame of the PDU that `pdu` writes, `length` bytes long. Returns
/// false, with nothing written, if `buffer` cannot hold it.
pub fn write(buffer: &mut [u8], unit: u8, length: usize, pdu: impl FnOnce(&mut [u8])) -> bool {
    let Some(frame) = buffer.get_mut(..length + OVERHEAD) else {
        return false;
    };
    let Some((content, crc)) = frame.split_last_chunk_mut() else {
        return false;
    };
    if let Some((first, rest)) = content.split_first_mut() {
        *first = unit;
        pdu(rest);
    }
    *crc = crc16(content).to_bytes();
    true
}

/// What was seen on the way to a reply, the more telling the greater.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Seen {
    /// No frame.
    Nothing,
    /// A frame of another unit.
    OtherUnit,
    /// A frame of our unit with another function.
    OtherFunction,
    /// A frame of our unit and function that is not the reply.
    Malformed,
    /// A complete frame of our unit and function with a wrong CRC.
    BadCrc,
    /// The reply has begun, but the buffer cannot hold it.
    TooLong,
}

/// A window that slides over received bytes. The buffer is the caller's and
/// is passed to each call.
#[derive(Clone, Copy, Debug)]
pub struct Window {
    /// Bytes in the buffer; a candidate starts with the first.
    len: u16,
    /// Bytes of the candidate that `crc` covers.
    checked: u16,
    crc: Crc16,
    /// The bytes passed over since a frame boundary, for they may turn out to
    /// be somebody else's frame: their CRC, count, unit and function code.
    passed_crc: Crc16,
    passed: u8,
    passed_unit: u8,
    passed_function: u8,
    seen: Seen,
    foreign: u8,
}

impl Window {
    /// A window over nothing.
    pub const EMPTY: Window = Window {
        len: 0,
        checked: 0,
        crc: Crc16::START,
        passed_crc: Crc16::START,
        passed: 0,
        passed_unit: 0,
        passed_function: 0,
        seen: Seen::Nothing,
        foreign: 0,
    };

    /// The part of `buffer` to receive into.
    pub fn room<'a>(&self, buffer: &'a mut [u8]) -> &'a mut [u8] {
        buffer.get_mut(usize::from(self.len)..).unwrap_or_default()
    }

    /// Says that `count` bytes were received into [`Window::room`].
    pub fn arrived(&mut self, count: usize) {
        self.len += count as u16;
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

    /// Looks for a frame of `unit` with a right CRC whose PDU is `expected`:
    /// the length of a PDU that begins with the bytes given, `None` for a PDU
    /// that is not waited for. Returns where in `buffer` the PDU is.
    ///
    /// Stops at a candidate that is not complete yet. With `skim` it looks
    /// behind that as well, and if there is nothing leaves all as it was.
    pub fn search(
        &mut self,
        buffer: &mut [u8],
        unit: u8,
        skim: bool,
        expected: impl Fn(&[u8]) -> Option<usize>,
    ) -> Option<Range<usize>> {
        let kept = *self;
        let len = usize::from(self.len);
        let mut start = 0;
        while let Some((first, pdu)) = buffer.get(start..len).and_then(<[u8]>::split_first) {
            let length = if *first == unit { expected(pdu) } else { None };
            if let Some(length) = length {
                let total = length + OVERHEAD;
                let complete = pdu.len() + 1 >= total;
                if total > buffer.len() {
                    self.see(Seen::TooLong);
                } else if complete || !skim {
                    let end = len.min(start + total);
                    let news = buffer.get(start + usize::from(self.checked)..end);
                    self.crc.update(news.unwrap_or_default());
                    self.checked = (end - start) as u16;
                    if !complete {
                        break;
                    }
                    if self.crc.is_residue() {
                        self.restart();
                        return Some(start + 1..start + 1 + length);
                    }
                    if !skim {
                        self.see(Seen::BadCrc);
                    }
                }
            }
            self.restart();
            start += 1;
            if !skim {
                let first = *first;
                self.pass(first, unit, &expected);
            }
        }
        if skim {
            *self = kept;
        } else if start > 0 {
            self.drop_front(buffer, start);
        }
        None
    }

    /// Refuses the frame that [`Window::search`] found and drops it.
    pub fn refuse(&mut self, buffer: &mut [u8], pdu: Range<usize>) {
        self.see(Seen::Malformed);
        self.foreign = self.foreign.saturating_add(1);
        self.drop_echo(buffer, pdu);
    }

    /// Drops the frame that [`Window::search`] found: it is our own.
    pub fn drop_echo(&mut self, buffer: &mut [u8], pdu: Range<usize>) {
        self.passed = 0;
        self.drop_front(buffer, pdu.end + OVERHEAD - 1);
    }

    fn drop_front(&mut self, buffer: &mut [u8], count: usize) {
        let cells = Cell::from_mut(buffer).as_slice_of_cells();
        let kept = cells.get(count..usize::from(self.len)).unwrap_or_default();
        for (to, from) in cells.iter().zip(kept) {
            to.set(from.get());
        }
        self.len = kept.len() as u16;
    }

    fn restart(&mut self) {
        self.checked = 0;
        self.crc = Crc16::START;
    }

    fn see(&mut self, what: Seen) {
        self.seen = self.seen.max(what);
    }

    /// Takes in a byte that is passed over. Where such bytes make up a frame,
    /// a damaged reply seen in it was none.
    fn pass(&mut self, byte: u8, unit: u8, expected: &impl Fn(&[u8]) -> Option<usize>) {
        match self.passed {
            0 => {
                self.passed_crc = Crc16::START;
                self.passed_unit = byte;
            }
            1 => self.passed_function = byte,
            _ => {}
        }
        self.passed = self.passed.saturating_add(1);
        self.passed_crc.update(&[byte]);
        if self.passed < 4 || !self.passed_crc.is_residue() {
            return;
        }
        self.passed = 0;
        self.foreign = self.foreign.saturating_add(1);
        if self.seen == Seen::BadCrc {
            self.seen = Seen::Nothing;
        }
        self.see(if self.passed_unit != unit {
            Seen::OtherUnit
        } else if expected(&[self.passed_function]).is_none() {
            Seen::OtherFunction
        } else {
            Seen::Malformed
        });
    }
}
