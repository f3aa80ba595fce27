//! Cuts the bytes of one direction into frames.

use crate::bytes::move_items;
use crate::error::{Error, Status};
use crate::frame::ascii::Decoded;
use crate::frame::{ascii, rtu, Framing};
use crate::packet::{length, PduKind};
use crate::pdu::custom::Function;
use crate::pdu::length::Length;
use crate::time::{elapsed, Micros};
use core::cell::Cell;

/// The form of the frames of one direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rules {
    pub framing: Framing,
    /// The end character of ASCII frames.
    pub end: u8,
    pub direction: Direction,
    /// The kind of PDU that this side sends.
    pub kind: PduKind,
    /// Frames of the other kind may come too: the echo of a request, or frames of others on the
    /// same line.
    pub both: bool,
}

/// The kind of the bytes at one place.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Candidate {
    /// A frame of this length, whose check is right or wrong.
    Frame(usize, PduKind, Status),
    /// The beginning of a frame of this length; 0 if the length is unknown.
    Beginning(usize),
    /// No frame.
    NoFrame,
}

impl Rules {
    fn kinds(&self) -> impl Iterator<Item = PduKind> {
        let other = match self.kind {
            PduKind::Request => PduKind::Response,
            PduKind::Response => PduKind::Request,
        };
        [Some(self.kind), self.both.then_some(other)]
            .into_iter()
            .flatten()
    }

    fn length(
        &self,
        kind: PduKind,
        bytes: &[u8],
        observer: &impl Observer,
    ) -> Result<Length, Error> {
        let code = length::function(self.framing, bytes);
        let declaration = code.and_then(|code| observer.declaration(code));
        length::expected(self.framing, kind, bytes, self.end, declaration.as_slice())
    }

    /// [`Status::OK`] if the bytes are a frame; [`Status::INVALID_CRC`] if they are a damaged one;
    /// otherwise [`Status::MALFORMED_FRAME`].
    fn check(&self, bytes: &mut [u8]) -> Status {
        match self.framing {
            Framing::Tcp => Status::OK,
            Framing::Rtu | Framing::RtuOverTcp => match rtu::parse(bytes) {
                Ok(_) => Status::OK,
                // A wrong length is more likely than a wrong CRC.
                Err(_) => Status::MALFORMED_FRAME,
            },
            Framing::Ascii => match ascii::decode(bytes, self.end, false) {
                Decoded::Valid(_) => Status::OK,
                Decoded::WrongLrc(_) => Status::INVALID_CRC,
                Decoded::Malformed => Status::MALFORMED_FRAME,
            },
        }
    }

    /// True if the PDU of a complete frame has the length that its function has in this kind of
    /// PDU. The end character of ASCII frames ends frames of any length.
    fn fits(&self, kind: PduKind, frame: &[u8], observer: &impl Observer) -> bool {
        let digits = frame
            .split_last_chunk::<2>()
            .map_or(frame, |(digits, _)| digits);
        self.framing != Framing::Ascii
            || self.length(kind, digits, observer) == Ok(Length::Exactly(frame.len()))
    }

    /// Examines the bytes at one place. If `ended` is true, no more bytes will follow them.
    fn candidate(&self, bytes: &mut [u8], ended: bool, observer: &impl Observer) -> Candidate {
        let mut found = Candidate::NoFrame;
        for kind in self.kinds() {
            let length = match self.length(kind, bytes, observer) {
                Ok(Length::Exactly(length)) => length,
                Ok(_) => 0,
                Err(_) => continue,
            };
            match bytes.get_mut(..length) {
                Some(frame) if length > 0 => {
                    let status = self.check(frame);
                    if status == Status::MALFORMED_FRAME {
                        continue;
                    }
                    let this = Candidate::Frame(length, kind, status);
                    if self.fits(kind, frame, observer) {
                        return this;
                    }
                    if !matches!(found, Candidate::Frame(..)) {
                        found = this;
                    }
                }
                _ if found == Candidate::NoFrame => found = Candidate::Beginning(length),
                _ => {}
            }
        }
        // Between two silences only the CRC decides: some devices send a wrong byte count.
        let by_end = ended && !matches!(self.framing, Framing::Tcp | Framing::Ascii);
        if by_end && !matches!(found, Candidate::Frame(..)) && self.check(bytes) == Status::OK {
            return Candidate::Frame(bytes.len(), self.kind, Status::OK);
        }
        found
    }

    /// The fault of bytes that are not a valid frame.
    fn fault(&self, bytes: &[u8], observer: &impl Observer) -> Status {
        let least = usize::from(rtu::MIN_FRAME);
        match self.length(self.kind, bytes, observer) {
            Ok(Length::Exactly(length)) if length < bytes.len() => Status::MALFORMED_FRAME,
            Ok(Length::Exactly(length)) if length == bytes.len() => Status::INVALID_CRC,
            Ok(Length::Silence) if self.framing != Framing::Ascii && bytes.len() >= least => {
                Status::INVALID_CRC
            }
            Ok(Length::Unknown) | Err(_) => Status::MALFORMED_FRAME,
            Ok(_) => Status::INCOMPLETE_FRAME,
        }
    }
}

/// The bytes of one direction that were not handed out yet. The caller passes the buffer to each
/// call.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cutter {
    /// How many bytes the buffer holds.
    length: u16,
    /// Index of the byte at which a frame is looked for. No frame begins before it.
    at: u16,
    /// How many of the next bytes belong to a frame that is longer than the buffer.
    rest: u16,
    /// Index of the first byte that arrived last.
    last_at: u16,
    /// Time of the first byte.
    first: Micros,
    /// Time of the bytes that arrived last.
    last: Micros,
}

impl Cutter {
    pub const EMPTY: Cutter = Cutter {
        length: 0,
        at: 0,
        rest: 0,
        last_at: 0,
        first: 0,
        last: 0,
    };

    pub const fn is_empty(&self) -> bool {
        self.length == 0
    }

    /// True if the last byte came at least `time` microseconds ago.
    pub fn is_silent(&self, now: u32, time: u32) -> bool {
        !self.is_empty() && elapsed(now, self.last) >= time
    }

    /// Takes bytes, and hands out the frames that they complete.
    pub fn push(
        &mut self,
        buffer: &mut [u8],
        rules: &Rules,
        bytes: &[u8],
        now: u32,
        observer: &mut impl Observer,
    ) {
        let mut bytes = bytes;
        while !bytes.is_empty() {
            let space = buffer.get_mut(self.length.into()..).unwrap_or_default();
            let mut count = 0;
            for (place, byte) in space.iter_mut().zip(bytes) {
                *place = *byte;
                count += 1;
            }
            if self.length == 0 {
                self.first = now;
            }
            self.last = now;
            self.last_at = self.length;
            self.length += count as u16;
            bytes = bytes.get(count..).unwrap_or_default();
            self.search(buffer, rules, false, observer);
            if usize::from(self.length) >= buffer.len() {
                self.make_space(buffer, rules, observer);
            }
        }
    }

    /// Hands out all bytes, because none will follow them.
    pub fn end(&mut self, buffer: &mut [u8], rules: &Rules, observer: &mut impl Observer) {
        self.search(buffer, rules, true, observer);
        self.hand_out_fault(buffer, rules, self.length.into(), observer);
        self.rest = 0;
    }

    /// Hands out the frames that the buffer holds.
    fn search(
        &mut self,
        buffer: &mut [u8],
        rules: &Rules,
        ended: bool,
        observer: &mut impl Observer,
    ) {
        while self.at < self.length {
            if self.rest > 0 {
                let piece = usize::from(self.rest.min(self.length));
                if piece < usize::from(self.rest).min(buffer.len()) && !ended {
                    return;
                }
                self.rest -= piece as u16;
                self.hand_out(
                    buffer,
                    rules,
                    piece,
                    (rules.kind, Status::BUFFER_TOO_SMALL),
                    observer,
                );
                continue;
            }
            let bytes = buffer
                .get_mut(self.at.into()..self.length.into())
                .unwrap_or_default();
            match rules.candidate(bytes, ended, observer) {
                Candidate::Frame(length, kind, status) => {
                    self.hand_out_fault(buffer, rules, self.at.into(), observer);
                    self.hand_out(buffer, rules, length, (kind, status), observer);
                }
                Candidate::Beginning(_) if !ended => return,
                _ => self.at += 1,
            }
        }
    }

    /// Hands out what fills the buffer and is not a frame.
    fn make_space(&mut self, buffer: &mut [u8], rules: &Rules, observer: &mut impl Observer) {
        if self.at > 0 {
            self.hand_out_fault(buffer, rules, self.at.into(), observer);
            return;
        }
        if let Candidate::Beginning(total) = rules.candidate(buffer, false, observer) {
            self.rest = total.saturating_sub(buffer.len()) as u16;
        }
        let too_long = (rules.kind, Status::BUFFER_TOO_SMALL);
        self.hand_out(buffer, rules, buffer.len(), too_long, observer);
    }

    /// Hands out the first bytes, which are no valid frame.
    fn hand_out_fault(
        &mut self,
        buffer: &mut [u8],
        rules: &Rules,
        count: usize,
        observer: &mut impl Observer,
    ) {
        if count > 0 {
            let bytes = buffer.get(..count).unwrap_or_default();
            let fault = rules.fault(bytes, observer);
            self.hand_out(buffer, rules, count, (rules.kind, fault), observer);
        }
    }

    /// Hands out the first bytes, and drops them.
    fn hand_out(
        &mut self,
        buffer: &mut [u8],
        rules: &Rules,
        count: usize,
        (kind, status): (PduKind, Status),
        observer: &mut impl Observer,
    ) {
        let bytes = buffer.get(..count).unwrap_or_default();
        observer.frame(&Record {
            direction: rules.direction,
            kind,
            status,
            time: self.first,
            bytes,
        });
        let count = count as u16;
        self.first = self.time(count);
        let cells = Cell::from_mut(buffer).as_slice_of_cells();
        let kept = cells.get(count.into()..self.length.into());
        move_items(cells, kept.unwrap_or_default());
        self.length = self.length.saturating_sub(count);
        self.last_at = self.last_at.saturating_sub(count);
        self.at = 0;
    }

    /// The time of the byte at an index. Bytes before the last ones are taken to have arrived at
    /// the same distance from each other.
    fn time(&self, index: u16) -> u32 {
        let step = elapsed(self.last, self.first) / u32::from(self.last_at).max(1);
        if index >= self.last_at {
            self.last
        } else {
            self.first.wrapping_add(step * u32::from(index))
        }
    }
}

/// Whether the object that uses the port received a frame or sent it.
///
/// ```
/// use mbm::trace::{Direction, Record};
///
/// fn arrow(record: &Record) -> &'static str {
///     match record.direction {
///         Direction::Received => "<-",
///         Direction::Sent => "->",
///     }
/// }
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Direction {
    /// The port has read the bytes.
    Received,
    /// The port has accepted the bytes.
    Sent,
}

/// A frame on the line, or bytes that are no frame.
///
/// ```
/// use mbm::trace::Record;
/// use mbm::Status;
///
/// /// One line of a log.
/// fn line(record: &Record) -> String {
///     match record.status {
///         Status::OK => format!("{:02X?}", record.bytes),
///         status => format!("{}: {:02X?}", status.text(), record.bytes),
///     }
/// }
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Record<'a> {
    /// Received or sent.
    pub direction: Direction,
    /// The kind of the PDU. If a received frame can be both, it is the kind that the other side
    /// of this link sends.
    pub kind: PduKind,
    /// [`Status::OK`] for a frame; [`Status::INVALID_CRC`] for a frame whose CRC or LRC is
    /// wrong; [`Status::INCOMPLETE_FRAME`] for the beginning of a frame;
    /// [`Status::MALFORMED_FRAME`] for bytes that begin no frame; [`Status::BUFFER_TOO_SMALL`]
    /// for a piece of a frame that is longer than the buffer.
    pub status: Status,
    /// Time of the first byte, in microseconds, by the clock of the port. The time of a frame that
    /// followed other bytes without a pause is estimated.
    pub time: Micros,
    /// The bytes, as they are on the line.
    pub bytes: &'a [u8],
}

/// Takes the records of a trace. A closure `FnMut(&Record)` is one.
///
/// ```
/// use mbm::pdu::custom::{Function, Rule};
/// use mbm::trace::{Observer, Record};
///
/// /// Counts the frames of a line on which a device has the function 65.
/// struct Count(u32);
///
/// impl Observer for Count {
///     fn frame(&mut self, record: &Record) {
///         self.0 += 1;
///     }
///
///     fn declaration(&self, code: u8) -> Option<Function> {
///         let function = Function { code: 65, request: Rule::Fixed(2), response: Rule::Fixed(4) };
///         (code == function.code).then_some(function)
///     }
/// }
/// ```
pub trait Observer {
    /// Takes a frame. It is called from within the functions of the port.
    fn frame(&mut self, record: &Record<'_>);

    /// The declaration of a user-defined function. Without it, silence or the next frame in the
    /// other direction ends a received RTU frame of that function.
    fn declaration(&self, code: u8) -> Option<Function> {
        let _ = code;
        None
    }
}

impl<F: FnMut(&Record<'_>)> Observer for F {
    fn frame(&mut self, record: &Record<'_>) {
        self(record);
    }
}
