//! RTU: unit, PDU, CRC-16, and silence around them (serial line guide 2.5.1).
//!
//! A reply carries no length, and a bad wire puts anything in front of it. So
//! a reply is searched for: a candidate frame starts at each offset of what
//! has arrived, and what turns out not to be the frame costs one byte.

use super::checksum::{crc16, Crc16};
use crate::bytes::Writer;

/// The longest frame: unit, PDU of 253 bytes, CRC.
pub const MAX_FRAME: usize = 256;

const CRC: usize = 2;

/// Bytes of a frame around its PDU: the unit before, the CRC behind.
pub const OVERHEAD: usize = 1 + CRC;

/// Closes the frame that `writer` holds with its CRC.
pub fn seal(writer: &mut Writer) {
    let crc = crc16(writer.written());
    writer.bytes(&crc.to_bytes());
}

/// What the first bytes of a PDU say of it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Fit {
    /// This is not the PDU that is waited for.
    No,
    /// Too few bytes to tell.
    More,
    /// It may be; the whole PDU has this many bytes.
    Length(usize),
}

/// What [`Window::next`] came upon.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Event {
    /// Nothing more in what has arrived.
    More,
    /// A frame of the unit with a right CRC: its PDU starts at `at`.
    Frame {
        /// Offset of the PDU in the buffer.
        at: usize,
        /// Length of the PDU.
        length: usize,
    },
    /// A complete frame of the unit whose CRC is wrong.
    BadCrc {
        /// Offset of the PDU in the buffer.
        at: usize,
    },
    /// The frame of the unit has begun, but the buffer cannot hold it.
    TooLong,
    /// A frame with a right CRC that was not waited for.
    Foreign {
        /// Its unit.
        unit: u8,
        /// Its function code.
        function: u8,
    },
}

/// A window that slides over received bytes. The buffer is the caller's and
/// is passed to each call.
#[derive(Clone, Copy, Debug)]
pub struct Window {
    /// Bytes that have arrived in the buffer.
    len: u16,
    /// Where the candidate starts.
    start: u16,
    /// Bytes of the candidate that `crc` covers.
    checked: u16,
    crc: Crc16,
    /// The bytes passed over since a frame boundary, for they may turn out to
    /// be somebody else's frame: their CRC, count, unit and function code.
    passed_crc: Crc16,
    passed: u8,
    passed_unit: u8,
    passed_function: u8,
}

impl Window {
    /// A window over nothing.
    pub const EMPTY: Window = Window {
        len: 0,
        start: 0,
        checked: 0,
        crc: Crc16::START,
        passed_crc: Crc16::START,
        passed: 0,
        passed_unit: 0,
        passed_function: 0,
    };

    /// Makes room in `buffer` and returns the part to receive into.
    pub fn room<'a>(&mut self, buffer: &'a mut [u8]) -> &'a mut [u8] {
        if self.start > 0 {
            let used = usize::from(self.start)..usize::from(self.len);
            if used.start <= used.end && used.end <= buffer.len() {
                buffer.copy_within(used, 0);
            }
            self.len -= self.start;
            self.start = 0;
        }
        buffer.get_mut(usize::from(self.len)..).unwrap_or_default()
    }

    /// Says that `count` bytes were received into [`Window::room`].
    pub fn arrived(&mut self, count: usize) {
        self.len += count as u16;
    }

    /// The PDU of the frame that was found last, which had `length` bytes.
    pub fn last_frame<'a>(&self, buffer: &'a [u8], length: u8) -> &'a [u8] {
        let end = usize::from(self.start).saturating_sub(CRC);
        let start = end.saturating_sub(usize::from(length));
        buffer.get(start..end).unwrap_or_default()
    }

    /// True if bytes were passed over that were no frame.
    pub fn has_passed_noise(&self) -> bool {
        self.passed > 0
    }

    /// Says that what is passed over next starts at the boundary of a frame.
    pub fn at_boundary(&mut self) {
        self.passed = 0;
    }

    /// True if a candidate has begun and is not complete.
    pub fn has_begun(&self) -> bool {
        self.start < self.len
    }

    /// The next frame of `unit` whose PDU `fits`, or what else is found on the
    /// way to it. With `skim` an incomplete candidate is passed over too, and
    /// what is passed over is not looked at as foreign.
    pub fn next(
        &mut self,
        buffer: &[u8],
        unit: u8,
        skim: bool,
        fits: impl Fn(&[u8]) -> Fit,
    ) -> Event {
        loop {
            let candidate = buffer
                .get(usize::from(self.start)..usize::from(self.len))
                .unwrap_or_default();
            let Some((first, rest)) = candidate.split_first() else {
                return Event::More;
            };
            let fit = if *first == unit { fits(rest) } else { Fit::No };
            let mut event = Event::More;
            match fit {
                Fit::No => {}
                Fit::Length(length) if length + OVERHEAD > buffer.len() => event = Event::TooLong,
                Fit::Length(length) => {
                    let total = length + OVERHEAD;
                    let known = candidate.get(..total).unwrap_or(candidate);
                    self.crc
                        .update(known.get(usize::from(self.checked)..).unwrap_or_default());
                    self.checked = known.len() as u16;
                    if candidate.len() >= total {
                        if self.crc.is_residue() {
                            let at = usize::from(self.start) + 1;
                            self.start += total as u16;
                            self.restart();
                            return Event::Frame { at, length };
                        }
                        event = Event::BadCrc {
                            at: usize::from(self.start) + 1,
                        };
                    } else if !skim {
                        return Event::More;
                    }
                }
                Fit::More if !skim => return Event::More,
                Fit::More => {}
            }
            let foreign = self.pass(*first, skim);
            if event == Event::More {
                event = foreign;
            }
            if event != Event::More {
                return event;
            }
        }
    }

    fn restart(&mut self) {
        self.checked = 0;
        self.crc = Crc16::START;
    }

    /// Slides over the candidate's first byte.
    fn pass(&mut self, first: u8, skim: bool) -> Event {
        self.start += 1;
        self.restart();
        if skim {
            return Event::More;
        }
        match self.passed {
            0 => {
                self.passed_crc = Crc16::START;
                self.passed_unit = first;
            }
            1 => self.passed_function = first,
            _ => {}
        }
        self.passed = self.passed.saturating_add(1);
        self.passed_crc.update(&[first]);
        if self.passed >= 4 && self.passed_crc.is_residue() {
            self.passed = 0;
            return Event::Foreign {
                unit: self.passed_unit,
                function: self.passed_function,
            };
        }
        Event::More
    }
}
