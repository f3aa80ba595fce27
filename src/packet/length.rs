//! The length of a frame, derived from its first bytes, and the length of a reply, derived
//! from its request.

use super::PduKind;
use crate::error::Error;
use crate::frame::{ascii, rtu, tcp, Framing};
use crate::pdu::custom::{is_user_defined, Function};
use crate::pdu::functions::REPORT_SERVER_ID;
use crate::pdu::length::{response as response_length, Length};
use crate::pdu::request::Request;
use crate::pdu::EXCEPTION;
use crate::pdu::MAX_PDU;

/// The length of a frame whose PDU has `pdu` bytes.
const fn frame_bytes(framing: Framing, pdu: usize) -> usize {
    match framing {
        Framing::Rtu | Framing::RtuOverTcp => pdu + rtu::OVERHEAD,
        Framing::Tcp => pdu + tcp::PDU,
        // A colon; unit, PDU and LRC with two characters for each byte; two characters that
        // end the frame.
        Framing::Ascii => 1 + 2 * (1 + pdu + 1) + 2,
    }
}

/// Converts the length of a PDU to the length of its frame.
fn frame_length(framing: Framing, pdu: Length) -> Length {
    match pdu {
        Length::Exactly(length) => Length::Exactly(frame_bytes(framing, length)),
        Length::AtLeast(length) => Length::AtLeast(frame_bytes(framing, length)),
        // In a stream, silence does not end a frame. An ASCII frame has an end character.
        Length::Silence if framing == Framing::RtuOverTcp => Length::Unknown,
        Length::Unknown if framing == Framing::Ascii => Length::Silence,
        other => other,
    }
}

/// True for a response of Report Server ID. In some devices its byte count covers only the
/// id, and more bytes follow.
fn may_be_longer(side: PduKind, pdu: &[u8]) -> bool {
    side == PduKind::Response && pdu.first() == Some(&REPORT_SERVER_ID)
}

/// The length of the frame that begins with `bytes`. For an ASCII frame, [`Length::Silence`]
/// means that the end character ends it. `end` is the last character of an ASCII frame.
///
/// # Errors
/// [`Error::MalformedFrame`] if no frame of this framing begins with these bytes, or if the
/// frame would be too long for this framing.
///
/// ```
/// use mbm::frame::{ascii::END, Framing};
/// use mbm::packet::{length, PduKind};
/// use mbm::pdu::length::Length;
///
/// let known = |bytes| length::expected(Framing::Rtu, PduKind::Response, bytes, END, &[]);
/// assert_eq!(known(&[17, 3]), Ok(Length::AtLeast(5)));
/// assert_eq!(known(&[17, 3, 4]), Ok(Length::Exactly(9)));
/// ```
pub fn expected(
    framing: Framing,
    side: PduKind,
    bytes: &[u8],
    end: u8,
    functions: &[Function],
) -> Result<Length, Error> {
    let length = match framing {
        Framing::Tcp => match tcp::header(bytes) {
            Ok(header) => Length::Exactly(header.total),
            Err(Error::IncompleteFrame) => Length::AtLeast(frame_bytes(framing, 1)),
            Err(refused) => return Err(refused),
        },
        Framing::Ascii => expected_ascii(side, bytes, end, functions)?,
        Framing::Rtu | Framing::RtuOverTcp => {
            let pdu = bytes.get(rtu::PDU..).unwrap_or_default();
            match frame_length(framing, side.length(pdu, functions)) {
                Length::Exactly(length) if may_be_longer(side, pdu) => match bytes.get(..length) {
                    None => Length::AtLeast(length),
                    Some(frame) if rtu::is_frame(frame) => Length::Exactly(length),
                    Some(_) => frame_length(framing, Length::Silence),
                },
                length => length,
            }
        }
    };
    match length {
        Length::Exactly(length) | Length::AtLeast(length) if length > framing.max_frame() => {
            Err(Error::MalformedFrame)
        }
        length => Ok(length),
    }
}

/// The function code of the frame that begins with these bytes; `None` if they do not contain
/// it yet.
///
/// ```
/// use mbm::frame::Framing;
/// use mbm::packet::length;
///
/// assert_eq!(length::function(Framing::Rtu, &[17, 3]), Some(3));
/// assert_eq!(length::function(Framing::Tcp, &[17, 3]), None);
/// ```
pub fn function(framing: Framing, bytes: &[u8]) -> Option<u8> {
    match framing {
        Framing::Rtu | Framing::RtuOverTcp => bytes.get(rtu::PDU).copied(),
        Framing::Tcp => bytes.get(tcp::PDU).copied(),
        // After the colon and the two digits of the unit.
        Framing::Ascii => bytes.get(3..5).and_then(ascii::byte),
    }
}

/// As [`expected`], for an ASCII frame.
fn expected_ascii(
    side: PduKind,
    bytes: &[u8],
    end: u8,
    functions: &[Function],
) -> Result<Length, Error> {
    let framing = Framing::Ascii;
    let Some((first, characters)) = bytes.split_first() else {
        return Ok(Length::AtLeast(frame_bytes(framing, 1)));
    };
    if *first != ascii::START {
        return Err(Error::MalformedFrame);
    }
    let is_end = |pair: &[u8]| match pair {
        [before, last] => ascii::kind_of(*before, *last, end) == ascii::CharacterKind::End,
        _ => false,
    };
    if let Some(at) = characters.windows(2).position(is_end) {
        return Ok(Length::Exactly(1 + at + 2));
    }
    // The last character may be the carriage return before the end character.
    let digits = characters.strip_suffix(&[ascii::CARRIAGE_RETURN]);
    let digits = digits.unwrap_or(characters);
    let mut content = [0; 1 + MAX_PDU + 1];
    let mut pairs = digits.chunks_exact(2);
    let mut count = 0;
    for (place, pair) in content.iter_mut().zip(pairs.by_ref()) {
        *place = ascii::byte(pair).ok_or(Error::MalformedFrame)?;
        count += 1;
    }
    let rest_is_digits = pairs
        .remainder()
        .iter()
        .all(|last| ascii::digit(*last).is_some());
    if !rest_is_digits || pairs.next().is_some() {
        return Err(Error::MalformedFrame);
    }
    let pdu = content.get(1..count).unwrap_or_default();
    match frame_length(framing, side.length(pdu, functions)) {
        Length::Exactly(length) => match (bytes.len() < length, may_be_longer(side, pdu)) {
            (true, false) => Ok(Length::Exactly(length)),
            (true, true) => Ok(Length::AtLeast(length)),
            // The frame has its full length, but no end characters.
            (false, false) => Err(Error::MalformedFrame),
            (false, true) => Ok(Length::Silence),
        },
        length => Ok(length),
    }
}

/// The length of the frame that answers a request, if the request succeeds. (The answer may
/// be an exception instead, whose PDU has two bytes.) [`Length::Exactly`] of 0 if a request
/// is never answered: a broadcast, or Force Listen Only Mode.
///
/// ```
/// use mbm::frame::Framing;
/// use mbm::packet::length;
/// use mbm::pdu::length::Length;
/// use mbm::pdu::request::Request;
///
/// let request = Request::ReadRegisters { function: 3, address: 107, quantity: 2 };
/// assert_eq!(length::of_reply(Framing::Rtu, 17, &request, &[]), Length::Exactly(9));
/// ```
pub fn of_reply(framing: Framing, unit: u8, request: &Request, functions: &[Function]) -> Length {
    if framing.is_serial() && unit == 0 {
        return Length::Exactly(0);
    }
    match request.response_length(functions) {
        Length::Exactly(0) => Length::Exactly(0),
        length => frame_length(framing, length),
    }
}

/// The length of the Modbus TCP frame, request or response, that seems to begin with these
/// bytes: a request or a response of their function can have the length in the header.
/// Without `allow_unknown`, the function must be one of the standard, one that the standard
/// leaves to users, or one in `functions`. Function 0 is always refused.
///
/// # Errors
/// [`Error::IncompleteFrame`] if header and function code are not complete;
/// [`Error::MalformedFrame`] if no such frame begins with these bytes.
///
/// ```
/// use mbm::packet::length::looks_like_tcp;
///
/// let frame = [0, 5, 0, 0, 0, 6, 17, 3, 0, 107, 0, 2];
/// assert_eq!(looks_like_tcp(&frame, false, &[]), Ok(12));
/// // A request of 03 is not longer.
/// let other = [0, 5, 0, 0, 0, 7, 17, 3, 0, 107, 0, 2, 0];
/// assert_eq!(looks_like_tcp(&other, false, &[]), Err(mbm::Error::MalformedFrame));
/// ```
pub fn looks_like_tcp(
    bytes: &[u8],
    allow_unknown: bool,
    functions: &[Function],
) -> Result<usize, Error> {
    let header = tcp::header(bytes)?;
    let code = *bytes.get(tcp::PDU).ok_or(Error::IncompleteFrame)?;
    let function = code & !EXCEPTION;
    let known =
        is_user_defined(function) || response_length(&[function], functions) != Length::Unknown;
    let end = header.total.min(bytes.len());
    let pdu = bytes.get(tcp::PDU..end).unwrap_or_default();
    let whole = header.total - tcp::PDU;
    let fits = |side: PduKind| match side.length(pdu, functions) {
        Length::Exactly(length) if may_be_longer(side, pdu) => length <= whole,
        Length::Exactly(length) => length == whole,
        Length::AtLeast(length) => length <= whole,
        Length::Silence | Length::Unknown => true,
    };
    let right = fits(PduKind::Response) || (code == function && fits(PduKind::Request));
    if function != 0 && (known || allow_unknown) && right {
        Ok(header.total)
    } else {
        Err(Error::MalformedFrame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// [`expected`] without declared functions.
    fn expected_length(framing: Framing, side: PduKind, bytes: &[u8]) -> Result<Length, Error> {
        expected(framing, side, bytes, ascii::END, &[])
    }

    #[test]
    fn the_first_bytes_of_an_rtu_reply_narrow_its_length() {
        let bytes = [0x11, 3, 4, 0, 1, 0, 2, 0xAA, 0xBB];
        for (have, wanted) in [(0, 4), (1, 4), (2, 5)] {
            let length = expected_length(Framing::Rtu, PduKind::Response, &bytes[..have]);
            assert_eq!(length, Ok(Length::AtLeast(wanted)), "{have}");
        }
        for have in 3..=bytes.len() {
            let length = expected_length(Framing::Rtu, PduKind::Response, &bytes[..have]);
            assert_eq!(length, Ok(Length::Exactly(9)), "{have}");
        }
    }

    #[test]
    fn the_end_of_an_ascii_frame_overrides_its_predicted_length() {
        let frame = b":110306AE415652434049\r\n";
        for have in 0..frame.len() {
            let length = expected_length(Framing::Ascii, PduKind::Response, &frame[..have]);
            let wanted = match have {
                0..=2 => Length::AtLeast(9),
                3..=4 => Length::AtLeast(9),
                5..=6 => Length::AtLeast(11),
                _ => Length::Exactly(23),
            };
            assert_eq!(length, Ok(wanted), "{have}");
        }
        let length = expected_length(Framing::Ascii, PduKind::Response, frame);
        assert_eq!(length, Ok(Length::Exactly(23)));
        let early = expected_length(Framing::Ascii, PduKind::Response, b":1103\r\n06AE");
        assert_eq!(early, Ok(Length::Exactly(7)));
        let unknown = expected_length(Framing::Ascii, PduKind::Request, b":1155");
        assert_eq!(unknown, Ok(Length::Silence));
        for bad in [&b"x"[..], b":1G", b":\r1", b":0207F777", b":0207F7\rX"] {
            let length = expected_length(Framing::Ascii, PduKind::Request, bad);
            assert_eq!(length, Err(Error::MalformedFrame));
        }
    }

    #[test]
    fn the_end_decides_if_a_device_sends_more_than_its_byte_count() {
        // The byte count covers only the id: two bytes of five.
        let frame = b":10110201020001023F\r\n";
        for have in 0..=frame.len() {
            let length = expected_length(Framing::Ascii, PduKind::Response, &frame[..have]);
            let wanted = match have {
                0..=4 => Length::AtLeast(9),
                5..=6 => Length::AtLeast(11),
                7..=14 => Length::AtLeast(15),
                15..=20 => Length::Silence,
                _ => Length::Exactly(21),
            };
            assert_eq!(length, Ok(wanted), "{have}");
        }
    }

    #[test]
    fn lengths_that_no_frame_has_are_malformed() {
        let length = expected_length(Framing::Rtu, PduKind::Response, &[1, 3, 252]);
        assert_eq!(length, Err(Error::MalformedFrame));
        let length = expected_length(Framing::Tcp, PduKind::Request, &[0, 1, 0, 0, 255, 255]);
        assert_eq!(length, Err(Error::MalformedFrame));
        let length = expected_length(Framing::Ascii, PduKind::Response, b":0103FF");
        assert_eq!(length, Err(Error::MalformedFrame));
    }

    #[test]
    fn silence_ends_a_frame_only_on_a_serial_line() {
        let bytes = [1, 8, 0, 0];
        let on_a_line = expected_length(Framing::Rtu, PduKind::Request, &bytes);
        assert_eq!(on_a_line, Ok(Length::Silence));
        let in_a_stream = expected_length(Framing::RtuOverTcp, PduKind::Request, &bytes);
        assert_eq!(in_a_stream, Ok(Length::Unknown));
    }

    #[test]
    fn the_length_of_a_reply_depends_on_the_framing() {
        let request = Request::parse(&[3, 0, 0x6B, 0, 3]).unwrap();
        for (framing, length) in [
            (Framing::Rtu, 11),
            (Framing::RtuOverTcp, 11),
            (Framing::Tcp, 15),
            (Framing::Ascii, 23),
        ] {
            let found = of_reply(framing, 1, &request, &[]);
            assert_eq!(found, Length::Exactly(length));
        }
    }

    #[test]
    fn a_broadcast_and_force_listen_only_have_no_reply() {
        let write = Request::parse(&[6, 0, 1, 0, 3]).unwrap();
        assert_eq!(of_reply(Framing::Rtu, 0, &write, &[]), Length::Exactly(0));
        assert_eq!(of_reply(Framing::Tcp, 0, &write, &[]), Length::Exactly(12));
        let listen = Request::parse(&[8, 0, 4, 0, 0]).unwrap();
        assert_eq!(of_reply(Framing::Tcp, 1, &listen, &[]), Length::Exactly(0));
    }

    #[test]
    fn tcp_is_recognised_with_and_without_unknown_functions() {
        let mut bytes = [0x81, 0x80, 0, 0, 0, 6, 0x10, 1, 0, 0x6B, 0, 3];
        for have in 0..8 {
            let length = looks_like_tcp(&bytes[..have], true, &[]);
            assert_eq!(length, Err(Error::IncompleteFrame));
        }
        assert_eq!(looks_like_tcp(&bytes[..8], false, &[]), Ok(12));
        for (function, length, known) in [
            (0x83, 3, true),
            (65, 6, true),
            (9, 6, false),
            (0xD5, 3, false),
        ] {
            bytes[5] = length;
            bytes[7] = function;
            let found = looks_like_tcp(&bytes, false, &[]);
            assert_eq!(found.is_ok(), known, "{function}");
            let total = tcp::HEADER + usize::from(length);
            assert_eq!(looks_like_tcp(&bytes, true, &[]), Ok(total));
        }
        for function in [0, 0x80] {
            bytes[7] = function;
            let length = looks_like_tcp(&bytes, true, &[]);
            assert_eq!(length, Err(Error::MalformedFrame));
        }
    }
}
