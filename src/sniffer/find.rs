//! Finds frames of each framing without knowing whether a client or a server sent them.

use super::pairing::Requests;
use super::stream::{RxStream, Timing};
use crate::error::Error;
use crate::frame::ascii::{CharacterKind, Decoded};
use crate::frame::{ascii, rtu, tcp, Framing};
use crate::packet::PduKind;
use crate::pdu::custom::Function;
use crate::pdu::functions::{DIAGNOSTICS, REPORT_SERVER_ID};
use crate::pdu::length::Length;
use crate::pdu::EXCEPTION;
use crate::time::Micros;

/// The kind of the bytes at the place of the search.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Candidate {
    /// A frame: its length in bytes, whether it may be a request, and whether it may be a
    /// response.
    Frame(usize, bool, bool),
    /// A complete but damaged frame of this length.
    Damaged(usize),
    /// A frame of this length, which the buffer cannot hold.
    TooLong(usize),
    /// Possibly the beginning of a frame. The search has to wait until this many bytes have
    /// arrived or the line is silent.
    Wait(usize),
    /// Not a frame.
    NoFrame,
}

/// Bytes of the shortest RTU frame.
pub(super) const MIN_RTU: usize = rtu::MIN_FRAME as usize;

/// The inputs of the search, apart from the bytes of the stream.
#[derive(Clone, Copy)]
pub(super) struct Context<'a> {
    pub requests: &'a Requests,
    pub functions: &'a [Function],
    pub timing: Timing,
    /// The stream may carry requests, and responses.
    pub request: bool,
    pub response: bool,
    /// The end character of ASCII frames.
    pub end: u8,
    pub now: Micros,
}

impl Context<'_> {
    /// The lengths of an RTU frame as a request and as a response, as far as its first bytes
    /// show them. `None` if it cannot be one.
    fn lengths(&self, frame: &[u8]) -> [Option<Length>; 2] {
        let Some((unit, pdu)) = frame.split_first() else {
            return [Some(Length::AtLeast(MIN_RTU)); 2];
        };
        let code = pdu.first().copied();
        if code.is_some_and(|code| code & !EXCEPTION == 0) {
            return [None; 2];
        }
        let frame_length = |kind: PduKind| match kind.length(pdu, self.functions) {
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
        let request = (self.request && !is_exception).then(|| frame_length(PduKind::Request));
        let response = || match (
            frame_length(PduKind::Response),
            self.requests.reply_length(*unit, pdu),
        ) {
            (_, Some(length)) => Length::Exactly(length + rtu::OVERHEAD),
            // The byte count of some devices covers the server id only, though more bytes follow.
            (Length::Exactly(total), _)
                if code == Some(REPORT_SERVER_ID)
                    && self.requests.is_waiting(*unit, pdu)
                    && frame.get(..total).is_some_and(|all| !rtu::is_frame(all)) =>
            {
                Length::Silence
            }
            (length, _) => length,
        };
        // No unit responds to a broadcast.
        let response = (self.response && *unit != 0).then(response);
        [request.filter(fits), response.filter(fits)]
    }

    /// True if the function code of this RTU frame is known.
    pub fn is_known(&self, frame: &[u8]) -> bool {
        let lengths = self.lengths(frame);
        lengths
            .iter()
            .flatten()
            .any(|length| *length != Length::Unknown)
    }

    /// True if `total` is the length of an RTU frame that begins with `frame`.
    pub fn has_length(&self, frame: &[u8], total: usize) -> bool {
        self.lengths(frame).contains(&Some(Length::Exactly(total)))
    }

    /// The length of the frame, as a request and as a response, if it is complete and its CRC is
    /// right.
    fn by_length(lengths: [Option<Length>; 2], bytes: &[u8]) -> [Option<usize>; 2] {
        lengths.map(|length| match length {
            Some(Length::Exactly(total)) => {
                let frame = bytes.get(..total)?;
                rtu::is_frame(frame).then_some(total)
            }
            _ => None,
        })
    }

    /// How many bytes of an RTU frame of these lengths the search needs before it can decide
    /// more; `None` if more bytes change nothing.
    fn need(lengths: [Option<Length>; 2], have: usize, capacity: usize) -> Option<usize> {
        let bytes = |length: Option<Length>| match length {
            Some(Length::Exactly(total)) if total > have && total <= capacity => total,
            // The length can be decided without the two bytes of the CRC.
            Some(Length::AtLeast(total)) => (total - 2).max(have + 1),
            Some(Length::Silence | Length::Unknown) if have < rtu::MAX_FRAME => rtu::MAX_FRAME,
            _ => usize::MAX,
        };
        let [request, response] = lengths;
        let need = bytes(request).min(bytes(response));
        (need < usize::MAX).then_some(need)
    }

    /// The length of an RTU frame that silence ends and whose CRC is right.
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

    /// The length of the shortest RTU frame whose CRC is right. It is used where several frames
    /// arrived without silence between them, and the function does not define their lengths.
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

    /// Examines the RTU bytes at the place of the search.
    pub fn rtu(&self, stream: &RxStream, bytes: &[u8], capacity: usize) -> Candidate {
        let lengths = self.lengths(bytes);
        let [request, response] = Self::by_length(lengths, bytes);
        match (request, response) {
            (Some(total), other) if other.is_none_or(|other| other == total) => {
                return Candidate::Frame(total, true, other.is_some());
            }
            // The CRC is right for two lengths: an open request decides.
            (Some(_), Some(total)) if self.is_reply_expected(bytes) => {
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
            // Between two silences only the CRC decides: some devices send a wrong byte count.
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
        if let Some(need) = need.filter(|_| !self.has_timed_out(stream)) {
            // Each further byte may complete a frame; see `by_crc`.
            let is_by_crc = is_open && is_aligned && stream.silences(stream.at).next().is_some();
            let need = if is_by_crc { bytes.len() + 1 } else { need };
            if let Some(other) = self.bytes_for_next_piece(stream, bytes, capacity) {
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

    /// How many bytes the search needs in an empty stream.
    pub fn min_bytes(&self, framing: Framing) -> usize {
        match framing {
            // The unit alone shows that a frame to unit 0 cannot be a response.
            Framing::Rtu | Framing::RtuOverTcp => 1 + usize::from(self.request),
            Framing::Tcp => tcp::next_part(0),
            Framing::Ascii => 1,
        }
    }

    /// True if a request with the unit and function of this frame is open.
    fn is_reply_expected(&self, frame: &[u8]) -> bool {
        match frame {
            [unit, pdu @ ..] => self.requests.is_waiting(*unit, pdu),
            [] => false,
        }
    }

    /// True if the time for the rest of an incomplete frame is over.
    fn has_timed_out(&self, stream: &RxStream) -> bool {
        stream.quiet(self.now) >= self.timing.frame_timeout
    }

    /// `None` if a complete frame follows the next silence: the frame before that silence will
    /// not be completed any more. Otherwise how many bytes the search needs to see such a frame.
    fn bytes_for_next_piece(
        &self,
        stream: &RxStream,
        bytes: &[u8],
        capacity: usize,
    ) -> Option<usize> {
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

    /// Examines the TCP bytes at the place of the search.
    pub fn tcp(&self, stream: &RxStream, bytes: &[u8], capacity: usize) -> Candidate {
        let header = match tcp::header(bytes) {
            Err(Error::IncompleteFrame) if !self.has_timed_out(stream) => {
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
                let fits = |kind: PduKind| match kind.length(pdu, self.functions) {
                    Length::Exactly(length) => length == pdu.len(),
                    Length::AtLeast(_) => false,
                    Length::Silence | Length::Unknown => true,
                };
                let is_exception = pdu.first().is_some_and(|code| code & EXCEPTION != 0);
                let request = self.request && !is_exception && fits(PduKind::Request);
                let response = self.response && fits(PduKind::Response);
                // The header is valid, so this is a frame, even if its PDU is not valid.
                let neither = !request && !response;
                Candidate::Frame(
                    header.total,
                    request || (neither && self.request && !is_exception),
                    response || (neither && self.response),
                )
            }
            None if self.has_timed_out(stream) => Candidate::NoFrame,
            None => Candidate::Wait(header.total),
        }
    }

    /// Examines the ASCII characters at the place of the search.
    pub fn ascii(&self, stream: &RxStream, bytes: &mut [u8], capacity: usize) -> Candidate {
        let [ascii::START, ..] = bytes else {
            return Candidate::NoFrame;
        };
        // The characters that were searched before do not contain the end.
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
        } else if self.has_timed_out(stream) {
            Candidate::NoFrame
        } else {
            // A colon or an end character may end the wait: [`super::Sniffer::feed`] sees those.
            Candidate::Wait(ascii::MAX_FRAME + 1)
        }
    }
}
