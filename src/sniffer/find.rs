//! Where a frame is, in each framing, without knowing who sends it.

use super::pairing::Requests;
use super::stream::{RxStream, Timing};
use crate::error::Status;
use crate::frame::ascii::{CharacterKind, Decoded};
use crate::frame::{ascii, rtu, tcp, Framing};
use crate::packet::PduKind;
use crate::pdu::custom::Function;
use crate::pdu::diagnostics::{DIAGNOSTICS, REPORT_SERVER_ID};
use crate::pdu::length::Length;
use crate::pdu::EXCEPTION;

/// What stands where a frame is looked for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Candidate {
    /// A frame of so many bytes, which may be a request, a response or both.
    Frame(usize, bool, bool),
    /// A whole frame of so many bytes, damaged.
    Damaged(usize),
    /// A frame of so many bytes, which the buffer cannot hold.
    TooLong(usize),
    /// What may become a frame, of which nothing more is known before so many bytes
    /// are there or the line is silent.
    Wait(usize),
    /// No frame.
    NoFrame,
}

/// The least bytes of an RTU frame.
pub(super) const MIN_RTU: usize = rtu::MIN_FRAME as usize;

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
        let of = |side: PduKind| match side.length(pdu, self.functions) {
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
        let request = (self.request && !is_exception).then(|| of(PduKind::Request));
        let response = || match (
            of(PduKind::Response),
            self.requests.reply_length(*unit, pdu),
        ) {
            (_, Some(length)) => Length::Exactly(length + rtu::OVERHEAD),
            // Some devices count the id alone and send more behind it.
            (Length::Exactly(total), _)
                if code == Some(REPORT_SERVER_ID)
                    && self.requests.is_waiting(*unit, pdu)
                    && frame.get(..total).is_some_and(|all| !rtu::is_frame(all)) =>
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

    /// An RTU frame of one of these lengths.
    fn by_length(lengths: [Option<Length>; 2], bytes: &[u8]) -> [Option<usize>; 2] {
        lengths.map(|length| match length {
            Some(Length::Exactly(total)) => {
                let frame = bytes.get(..total)?;
                rtu::is_frame(frame).then_some(total)
            }
            _ => None,
        })
    }

    /// How many bytes must be there before more is known of an RTU frame of these
    /// lengths; none if nothing is waited for.
    fn need(lengths: [Option<Length>; 2], have: usize, capacity: usize) -> Option<usize> {
        let of = |length: Option<Length>| match length {
            Some(Length::Exactly(total)) if total > have && total <= capacity => total,
            // The CRC tells nothing about the length.
            Some(Length::AtLeast(total)) => (total - 2).max(have + 1),
            Some(Length::Silence | Length::Unknown) if have < rtu::MAX_FRAME => rtu::MAX_FRAME,
            _ => usize::MAX,
        };
        let [request, response] = lengths;
        let need = of(request).min(of(response));
        (need < usize::MAX).then_some(need)
    }

    /// An RTU frame that silence ends.
    fn by_silence(&self, stream: &RxStream, bytes: &[u8]) -> Option<usize> {
        let quiet = stream.quiet(self.now) >= self.timing.silence;
        let mut ends = stream
            .silences(stream.at)
            .chain(quiet.then_some(stream.end));
        ends.find_map(|end| {
            let total = usize::from(end - stream.at);
            let is_frame =
                (MIN_RTU..=rtu::MAX_FRAME).contains(&total) && rtu::is_frame(bytes.get(..total)?);
            is_frame.then_some(total)
        })
    }

    /// The shortest RTU frame whose CRC is right, where several came as one piece
    /// and their lengths do not tell them apart.
    fn by_crc(&self, stream: &RxStream, bytes: &[u8]) -> Option<usize> {
        let is_ended = bytes.len() >= rtu::MAX_FRAME
            || stream.quiet(self.now) >= self.timing.silence
            || stream.silences(stream.at).next().is_some();
        if !is_ended {
            return None;
        }
        let is_words = bytes.get(1) == Some(&DIAGNOSTICS);
        let step = if is_words { 2 } else { 1 };
        rtu::find_first(bytes, MIN_RTU * step, step)
    }

    /// What stands in RTU bytes.
    pub fn rtu(&self, stream: &RxStream, bytes: &[u8], capacity: usize) -> Candidate {
        let lengths = self.lengths(bytes);
        let [request, response] = Self::by_length(lengths, bytes);
        match (request, response) {
            (Some(total), other) if other.is_none_or(|other| other == total) => {
                return Candidate::Frame(total, true, other.is_some());
            }
            // Two lengths are right: what is asked for decides.
            (Some(_), Some(total)) if self.is_asked(bytes) => {
                return Candidate::Frame(total, false, true);
            }
            (Some(total), _) => return Candidate::Frame(total, true, false),
            (None, Some(total)) => return Candidate::Frame(total, false, true),
            (None, None) => (),
        }
        let open =
            |length: &Option<Length>| matches!(length, Some(Length::Silence | Length::Unknown));
        let [as_request, as_response] = lengths.map(|length| open(&length));
        let is_open = as_request || as_response;
        let is_aligned = stream.at == stream.start;
        let has_silence = stream.has_silence(self.now, &self.timing);
        if has_silence && (is_open || is_aligned) {
            // Between two silences the CRC alone decides: some devices miscount.
            if let Some(total) = self.by_silence(stream, bytes) {
                let [as_request, as_response] = lengths.map(|length| length.is_some());
                return Candidate::Frame(total, as_request, as_response);
            }
        }
        if is_open && is_aligned && (has_silence || bytes.len() >= rtu::MAX_FRAME) {
            if let Some(total) = self.by_crc(stream, bytes) {
                return Candidate::Frame(total, as_request, as_response);
            }
        }
        let need = Self::need(lengths, bytes.len(), capacity);
        if let Some(need) = need.filter(|_| !self.is_over(stream)) {
            // Each byte more may make a CRC right; see by_crc.
            let is_by_crc = is_open && is_aligned && stream.silences(stream.at).next().is_some();
            let need = if is_by_crc { bytes.len() + 1 } else { need };
            if let Some(other) = self.overtaken(stream, bytes, capacity) {
                return Candidate::Wait(need.min(other));
            }
        }
        let too_long = |length: &Length| match length {
            Length::Exactly(total) if *total > capacity => Some(*total),
            _ => None,
        };
        match lengths.iter().flatten().filter_map(too_long).next_back() {
            Some(total) => Candidate::TooLong(total),
            None => Candidate::NoFrame,
        }
    }

    /// How many bytes it takes to find anything in an empty lane.
    pub fn least(&self, framing: Framing) -> usize {
        match framing {
            // A unit that nobody answers for is enough to see that there is no reply.
            Framing::Rtu | Framing::RtuOverTcp => 1 + usize::from(self.request),
            Framing::Tcp => tcp::next_part(0),
            Framing::Ascii => 1,
        }
    }

    /// How many bytes it takes to look again, if what a lane holds is the beginning of
    /// an RTU frame and the line was not silent since: what [`Context::rtu`] finds
    /// then, at less cost.
    pub fn begun(&self, framing: Framing, stream: &RxStream, part: &[u8]) -> Option<usize> {
        let capacity = part.len();
        let is_rtu = matches!(framing, Framing::Rtu | Framing::RtuOverTcp);
        let is_quiet = stream.has_silence(self.now, &self.timing) || self.is_over(stream);
        if !is_rtu || stream.at != stream.start || is_quiet || stream.is_full(capacity) {
            return None;
        }
        let bytes = part.get(stream.at.into()..stream.end.into())?;
        let [unit, code, ..] = *bytes else {
            return None;
        };
        // Of these two the length depends on what was asked.
        if matches!(code, 0 | EXCEPTION | DIAGNOSTICS | REPORT_SERVER_ID)
            || bytes.len() >= rtu::MAX_FRAME
        {
            return None;
        }
        let pdu = bytes.get(rtu::PDU..)?;
        let mut need = usize::MAX;
        if self.request && code & EXCEPTION == 0 {
            need = Self::rest(
                PduKind::Request.length(pdu, self.functions),
                bytes,
                capacity,
            )?;
        }
        if self.response && unit != 0 {
            let length = PduKind::Response.length(pdu, self.functions);
            need = need.min(Self::rest(length, bytes, capacity)?);
        }
        (need < usize::MAX).then_some(need)
    }

    /// As [`Context::need`], of a PDU of this length; none of a frame that is whole or
    /// too long.
    fn rest(length: Length, bytes: &[u8], capacity: usize) -> Option<usize> {
        match length {
            Length::Exactly(length) => match length + rtu::OVERHEAD {
                total if total > capacity.min(rtu::MAX_FRAME) || total < MIN_RTU => None,
                total if total > bytes.len() => Some(total),
                total if rtu::is_frame(bytes.get(..total)?) => None,
                _ => Some(usize::MAX),
            },
            Length::AtLeast(length) if length + rtu::OVERHEAD > rtu::MAX_FRAME => None,
            Length::AtLeast(length) => Some((length + rtu::PDU).max(bytes.len() + 1)),
            Length::Silence | Length::Unknown => Some(rtu::MAX_FRAME),
        }
    }

    fn is_asked(&self, frame: &[u8]) -> bool {
        match frame {
            [unit, pdu @ ..] => self.requests.is_waiting(*unit, pdu),
            [] => false,
        }
    }

    /// True if what is not complete by now never will be.
    fn is_over(&self, stream: &RxStream) -> bool {
        stream.quiet(self.now) >= self.timing.frame_timeout
    }

    /// None if a whole frame stands after the next silence: what was not complete
    /// before it never will be. Else how many bytes it takes to see one.
    fn overtaken(&self, stream: &RxStream, bytes: &[u8], capacity: usize) -> Option<usize> {
        let Some(end) = stream.silences(stream.at).next() else {
            return Some(usize::MAX);
        };
        let before = usize::from(end - stream.at);
        let next = bytes.get(before..).unwrap_or_default();
        let lengths = self.lengths(next);
        let is_whole = Self::by_length(lengths, next).iter().any(Option::is_some);
        let need = Self::need(lengths, next.len(), capacity).unwrap_or(usize::MAX);
        (!is_whole).then_some(before.saturating_add(need))
    }

    /// What stands in TCP bytes.
    pub fn tcp(&self, stream: &RxStream, bytes: &[u8], capacity: usize) -> Candidate {
        let header = match tcp::header(bytes) {
            Err(Status::INCOMPLETE_FRAME) if !self.is_over(stream) => {
                return Candidate::Wait(tcp::next_part(bytes.len()));
            }
            Err(_) => return Candidate::NoFrame,
            Ok(header) => header,
        };
        if header.total > capacity {
            return Candidate::TooLong(header.total);
        }
        match bytes.get(tcp::PDU..header.total) {
            Some([code, ..]) if code & !EXCEPTION == 0 => Candidate::NoFrame,
            Some(pdu) => {
                let fits = |side: PduKind| match side.length(pdu, self.functions) {
                    Length::Exactly(length) => length == pdu.len(),
                    Length::AtLeast(_) => false,
                    Length::Silence | Length::Unknown => true,
                };
                let is_exception = pdu.first().is_some_and(|code| code & EXCEPTION != 0);
                let request = self.request && !is_exception && fits(PduKind::Request);
                let response = self.response && fits(PduKind::Response);
                // The header says that it is a frame, whatever it carries.
                let neither = !request && !response;
                Candidate::Frame(
                    header.total,
                    request || (neither && self.request && !is_exception),
                    response || (neither && self.response),
                )
            }
            None if self.is_over(stream) => Candidate::NoFrame,
            None => Candidate::Wait(header.total),
        }
    }

    /// What stands in ASCII characters.
    pub fn ascii(&self, stream: &RxStream, bytes: &mut [u8], capacity: usize) -> Candidate {
        let [ascii::START, ..] = bytes else {
            return Candidate::NoFrame;
        };
        // What was searched before has no end in it.
        let known = usize::from(stream.searched).max(1);
        let mut before = bytes.get(known - 1).copied().unwrap_or_default();
        for (index, character) in bytes.iter().enumerate().skip(known) {
            let total = index + 1;
            match ascii::kind_of(before, *character, self.end) {
                CharacterKind::End => {
                    let frame = bytes.get_mut(..total).unwrap_or_default();
                    return match ascii::decode(frame, self.end, false) {
                        Decoded::Valid(_) => Candidate::Frame(total, true, true),
                        Decoded::WrongLrc(_) => Candidate::Damaged(total),
                        Decoded::Malformed => Candidate::NoFrame,
                    };
                }
                CharacterKind::Inside if total <= ascii::MAX_FRAME => {}
                _ => return Candidate::NoFrame,
            }
            before = *character;
        }
        if bytes.len() >= capacity && capacity < ascii::MAX_FRAME {
            Candidate::TooLong(bytes.len())
        } else if self.is_over(stream) {
            Candidate::NoFrame
        } else {
            // Or another colon or end character: [`super::Sniffer::feed`] sees those.
            Candidate::Wait(ascii::MAX_FRAME + 1)
        }
    }
}
