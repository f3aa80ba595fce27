//! Where a frame is, in each framing, without knowing who sends it.

use super::lane::{Lane, Timing};
use super::pairing::Requests;
use crate::error::Status;
use crate::frame::checksum::{crc16, Crc16};
use crate::frame::{ascii, rtu, tcp};
use crate::packet::Side;
use crate::pdu::custom::Function;
use crate::pdu::diagnostics::{DIAGNOSTICS, REPORT_SERVER_ID};
use crate::pdu::length::Length;
use crate::pdu::EXCEPTION;

/// What stands where a frame is looked for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Verdict {
    /// A frame of so many bytes, which may be a request, a response or both.
    Right(usize, bool, bool),
    /// A whole frame of so many bytes, damaged.
    Damaged(usize),
    /// A frame of so many bytes, which the buffer cannot hold.
    TooLong(usize),
    /// What may become a frame.
    Wait,
    /// No frame.
    Wrong,
}

/// The least bytes of an RTU frame: unit, function, CRC.
pub(super) const MIN_RTU: usize = 4;

/// What a finder needs to know.
#[derive(Clone, Copy)]
pub(super) struct Context<'a> {
    pub requests: &'a Requests,
    pub functions: &'a [Function],
    pub timing: Timing,
    /// Who may speak.
    pub request: bool,
    pub response: bool,
    /// The end character of ASCII.
    pub end: u8,
    pub now: u32,
}

impl Context<'_> {
    /// The lengths of an RTU frame as a request and as a response, as far as its
    /// first bytes tell.
    fn lengths(&self, frame: &[u8]) -> [Option<Length>; 2] {
        let Some((unit, pdu)) = frame.split_first() else {
            return [Some(Length::AtLeast(MIN_RTU)); 2];
        };
        let code = pdu.first().copied();
        if code.is_some_and(|code| code & !EXCEPTION == 0) {
            return [None; 2];
        }
        let of = |side: Side| match side.length(pdu, self.functions) {
            Length::Exactly(length) => Length::Exactly(length + rtu::OVERHEAD),
            Length::AtLeast(length) => Length::AtLeast(length + rtu::OVERHEAD),
            other => other,
        };
        let fits = |length: &Length| match length {
            Length::Exactly(total) => (MIN_RTU..=rtu::MAX_FRAME).contains(total),
            Length::AtLeast(total) => *total <= rtu::MAX_FRAME,
            _ => true,
        };
        let is_exception = code.is_some_and(|code| code & EXCEPTION != 0);
        let request = (self.request && !is_exception).then(|| of(Side::Request));
        let response = || match (of(Side::Response), self.requests.reply_length(*unit, pdu)) {
            (_, Some(length)) => Length::Exactly(length + rtu::OVERHEAD),
            // Some devices count the id alone and send more behind it.
            (Length::Exactly(total), _)
                if code == Some(REPORT_SERVER_ID)
                    && self.requests.is_waiting(*unit, pdu)
                    && frame
                        .get(..total)
                        .is_some_and(|all| !crc16(all).is_residue()) =>
            {
                Length::Silence
            }
            (length, _) => length,
        };
        // Nobody answers a broadcast.
        let response = (self.response && *unit != 0).then(response);
        [request.filter(fits), response.filter(fits)]
    }

    /// True if bytes of an RTU frame tell that somebody knows this function.
    pub fn is_known(&self, frame: &[u8]) -> bool {
        let lengths = self.lengths(frame);
        lengths
            .iter()
            .flatten()
            .any(|length| *length != Length::Unknown)
    }

    /// True if an RTU frame that begins like that has so many bytes.
    pub fn has_length(&self, frame: &[u8], total: usize) -> bool {
        self.lengths(frame).contains(&Some(Length::Exactly(total)))
    }

    /// An RTU frame whose length its own bytes tell.
    fn by_length(&self, bytes: &[u8]) -> [Option<usize>; 2] {
        self.lengths(bytes).map(|length| match length {
            Some(Length::Exactly(total)) => {
                let frame = bytes.get(..total)?;
                crc16(frame).is_residue().then_some(total)
            }
            _ => None,
        })
    }

    /// An RTU frame that silence ends.
    fn by_silence(&self, lane: &Lane, bytes: &[u8]) -> Option<usize> {
        let quiet = lane.quiet(self.now) >= self.timing.silence;
        let mut ends = lane.silences(lane.at).chain(quiet.then_some(lane.end));
        ends.find_map(|end| {
            let total = usize::from(end - lane.at);
            let is_frame = (MIN_RTU..=rtu::MAX_FRAME).contains(&total)
                && crc16(bytes.get(..total)?).is_residue();
            is_frame.then_some(total)
        })
    }

    /// The shortest RTU frame whose CRC is right, where several came as one piece
    /// and their lengths do not tell them apart.
    fn by_crc(&self, lane: &Lane, bytes: &[u8]) -> Option<usize> {
        let is_ended = bytes.len() >= rtu::MAX_FRAME
            || lane.quiet(self.now) >= self.timing.silence
            || lane.silences(lane.at).next().is_some();
        if !is_ended {
            return None;
        }
        let is_words = bytes.get(1) == Some(&DIAGNOSTICS);
        let step = if is_words { 2 } else { 1 };
        let mut total = MIN_RTU * step;
        let mut crc = Crc16::START.with(bytes.get(..total)?);
        while !crc.is_residue() {
            crc = crc.with(bytes.get(total..total + step)?);
            total += step;
            if total > rtu::MAX_FRAME {
                return None;
            }
        }
        Some(total)
    }

    /// What stands in RTU bytes.
    pub fn rtu(&self, lane: &Lane, bytes: &[u8], capacity: usize) -> Verdict {
        let [request, response] = self.by_length(bytes);
        match (request, response) {
            (Some(total), other) if other.is_none_or(|other| other == total) => {
                return Verdict::Right(total, true, other.is_some());
            }
            // Two lengths are right: what is asked for decides.
            (Some(_), Some(total)) if self.is_asked(bytes) => {
                return Verdict::Right(total, false, true);
            }
            (Some(total), _) => return Verdict::Right(total, true, false),
            (None, Some(total)) => return Verdict::Right(total, false, true),
            (None, None) => (),
        }
        let lengths = self.lengths(bytes);
        let open =
            |length: &Option<Length>| matches!(length, Some(Length::Silence | Length::Unknown));
        let [as_request, as_response] = lengths.map(|length| open(&length));
        let is_open = as_request || as_response;
        let is_aligned = lane.at == lane.start;
        if is_open || is_aligned {
            // Between two silences the CRC alone decides: some devices miscount.
            if let Some(total) = self.by_silence(lane, bytes) {
                let [as_request, as_response] = lengths.map(|length| length.is_some());
                return Verdict::Right(total, as_request, as_response);
            }
        }
        if is_open && is_aligned {
            if let Some(total) = self.by_crc(lane, bytes) {
                return Verdict::Right(total, as_request, as_response);
            }
        }
        let mut wait = false;
        let mut too_long = 0;
        for length in lengths.into_iter().flatten() {
            match length {
                Length::Exactly(total) if total > capacity => too_long = total,
                Length::Exactly(total) => wait |= total > bytes.len(),
                Length::AtLeast(_) => wait = true,
                Length::Silence | Length::Unknown => wait |= bytes.len() < rtu::MAX_FRAME,
            }
        }
        if wait && !self.is_over(lane) && !self.is_overtaken(lane, bytes) {
            Verdict::Wait
        } else if too_long > 0 {
            Verdict::TooLong(too_long)
        } else {
            Verdict::Wrong
        }
    }

    fn is_asked(&self, frame: &[u8]) -> bool {
        match frame {
            [unit, pdu @ ..] => self.requests.is_waiting(*unit, pdu),
            [] => false,
        }
    }

    /// True if what is not complete by now never will be.
    fn is_over(&self, lane: &Lane) -> bool {
        lane.quiet(self.now) >= self.timing.patience
    }

    /// True if a whole frame stands behind the next silence: what was not
    /// complete before it never will be.
    fn is_overtaken(&self, lane: &Lane, bytes: &[u8]) -> bool {
        let Some(end) = lane.silences(lane.at).next() else {
            return false;
        };
        let next = bytes.get(usize::from(end - lane.at)..).unwrap_or_default();
        self.by_length(next).iter().any(Option::is_some)
    }

    /// What stands in TCP bytes.
    pub fn tcp(&self, lane: &Lane, bytes: &[u8], capacity: usize) -> Verdict {
        let header = match tcp::header(bytes) {
            Err(Status::INCOMPLETE_FRAME) if !self.is_over(lane) => return Verdict::Wait,
            Err(_) => return Verdict::Wrong,
            Ok(header) => header,
        };
        if header.total > capacity {
            return Verdict::TooLong(header.total);
        }
        match bytes.get(tcp::PDU..header.total) {
            Some([code, ..]) if code & !EXCEPTION == 0 => Verdict::Wrong,
            Some(pdu) => {
                let fits = |side: Side| match side.length(pdu, self.functions) {
                    Length::Exactly(length) => length == pdu.len(),
                    Length::AtLeast(_) => false,
                    Length::Silence | Length::Unknown => true,
                };
                let is_exception = pdu.first().is_some_and(|code| code & EXCEPTION != 0);
                let request = self.request && !is_exception && fits(Side::Request);
                let response = self.response && fits(Side::Response);
                // The header says that it is a frame, whatever it carries.
                let neither = !request && !response;
                Verdict::Right(
                    header.total,
                    request || (neither && self.request && !is_exception),
                    response || (neither && self.response),
                )
            }
            None if self.is_over(lane) => Verdict::Wrong,
            None => Verdict::Wait,
        }
    }

    /// What stands in ASCII characters.
    pub fn ascii(&self, lane: &Lane, bytes: &[u8], capacity: usize) -> Verdict {
        let Some((&ascii::START, characters)) = bytes.split_first() else {
            return Verdict::Wrong;
        };
        let mut before = 0;
        for (index, character) in characters.iter().enumerate() {
            if *character == self.end && before == ascii::RETURN {
                let digits = characters.get(..index - 1).unwrap_or_default();
                return Self::ascii_content(digits);
            }
            if *character == ascii::START || index + 2 > ascii::MAX_FRAME {
                return Verdict::Wrong;
            }
            before = *character;
        }
        if bytes.len() >= capacity && capacity < ascii::MAX_FRAME {
            Verdict::TooLong(bytes.len())
        } else if self.is_over(lane) {
            Verdict::Wrong
        } else {
            Verdict::Wait
        }
    }

    fn ascii_content(digits: &[u8]) -> Verdict {
        let mut sum = 0u8;
        let (pairs, rest) = digits.as_chunks::<2>();
        if pairs.len() < 3 || !rest.is_empty() {
            return Verdict::Wrong;
        }
        for pair in pairs {
            match ascii::byte(pair) {
                Some(byte) => sum = sum.wrapping_add(byte),
                None => return Verdict::Wrong,
            }
        }
        let total = digits.len() + 3;
        if sum == 0 {
            Verdict::Right(total, true, true)
        } else {
            Verdict::Damaged(total)
        }
    }
}

/// Turns the ASCII frame in `bytes` into the bytes that it stands for, at its
/// front; how many.
pub(super) fn decode(bytes: &mut [u8]) -> usize {
    let count = bytes.len().saturating_sub(3) / 2;
    for index in 0..count {
        let at = 1 + 2 * index;
        let byte = bytes.get(at..at + 2).and_then(ascii::byte);
        if let (Some(byte), Some(place)) = (byte, bytes.get_mut(index)) {
            *place = byte;
        }
    }
    count
}
