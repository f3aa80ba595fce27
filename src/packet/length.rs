//! How long a frame is, as its first bytes tell, and how long a reply will be,
//! as its request tells.

use super::Side;
use crate::error::Status;
use crate::frame::{ascii, rtu, tcp, Framing};
use crate::pdu::custom::{is_user_defined, Function};
use crate::pdu::diagnostics::REPORT_SERVER_ID;
use crate::pdu::length::{response as response_length, Length};
use crate::pdu::limits::MAX_PDU;
use crate::pdu::request::Request;
use crate::pdu::EXCEPTION;

/// Bytes of a frame around a PDU of so many bytes, and the PDU.
const fn around(framing: Framing, pdu: usize) -> usize {
    match framing {
        Framing::Rtu | Framing::RtuOverTcp => pdu + rtu::OVERHEAD,
        Framing::Tcp => pdu + tcp::PDU,
        // Colon, unit, PDU and LRC in two characters each, two that end it.
        Framing::Ascii => 1 + 2 * (1 + pdu + 1) + 2,
    }
}

/// The length of the frame around a PDU of this length.
fn of_frame(framing: Framing, pdu: Length) -> Length {
    match pdu {
        Length::Exactly(length) => Length::Exactly(around(framing, length)),
        Length::AtLeast(length) => Length::AtLeast(around(framing, length)),
        // In a stream silence tells nothing; an ASCII frame has an end.
        Length::Silence if framing == Framing::RtuOverTcp => Length::Unknown,
        Length::Unknown if framing == Framing::Ascii => Length::Silence,
        other => other,
    }
}

/// True of a response to Report Server ID: some devices count the id alone and send
/// more after it.
fn may_be_longer(side: Side, pdu: &[u8]) -> bool {
    side == Side::Response && pdu.first() == Some(&REPORT_SERVER_ID)
}

/// The length of the whole frame that begins with these bytes. What silence
/// tells in RTU, in ASCII the end character tells.
///
/// # Errors
/// [`Status::MALFORMED_FRAME`] if no frame of this framing begins like that,
/// or none is so long.
pub fn expected(
    framing: Framing,
    side: Side,
    bytes: &[u8],
    end: u8,
    functions: &[Function],
) -> Result<Length, Status> {
    let length = match framing {
        Framing::Tcp => match tcp::header(bytes) {
            Ok(header) => Length::Exactly(header.total),
            Err(Status::INCOMPLETE_FRAME) => Length::AtLeast(around(framing, 1)),
            Err(refused) => return Err(refused),
        },
        Framing::Ascii => of_characters(side, bytes, end, functions)?,
        Framing::Rtu | Framing::RtuOverTcp => {
            let pdu = bytes.get(rtu::PDU..).unwrap_or_default();
            match of_frame(framing, side.length(pdu, functions)) {
                Length::Exactly(length) if may_be_longer(side, pdu) => match bytes.get(..length) {
                    None => Length::AtLeast(length),
                    Some(frame) if rtu::is_frame(frame) => Length::Exactly(length),
                    Some(_) => of_frame(framing, Length::Silence),
                },
                length => length,
            }
        }
    };
    match length {
        Length::Exactly(length) | Length::AtLeast(length) if length > framing.max_frame() => {
            Err(Status::MALFORMED_FRAME)
        }
        length => Ok(length),
    }
}

/// The function code of the frame that begins with these bytes, as soon as it
/// is there.
pub fn function(framing: Framing, bytes: &[u8]) -> Option<u8> {
    match framing {
        Framing::Rtu | Framing::RtuOverTcp => bytes.get(rtu::PDU).copied(),
        Framing::Tcp => bytes.get(tcp::PDU).copied(),
        // Behind the colon and the two digits of the unit.
        Framing::Ascii => bytes.get(3..5).and_then(ascii::byte),
    }
}

/// As [`expected`], of an ASCII frame.
#[inline(never)]
fn of_characters(
    side: Side,
    bytes: &[u8],
    end: u8,
    functions: &[Function],
) -> Result<Length, Status> {
    let framing = Framing::Ascii;
    let Some((first, characters)) = bytes.split_first() else {
        return Ok(Length::AtLeast(around(framing, 1)));
    };
    if *first != ascii::START {
        return Err(Status::MALFORMED_FRAME);
    }
    let is_end = |pair: &[u8]| match pair {
        [before, last] => ascii::mark(*before, *last, end) == ascii::Mark::End,
        _ => false,
    };
    if let Some(at) = characters.windows(2).position(is_end) {
        return Ok(Length::Exactly(1 + at + 2));
    }
    // The end may have begun.
    let digits = characters.strip_suffix(&[ascii::RETURN]);
    let digits = digits.unwrap_or(characters);
    let mut content = [0; 1 + MAX_PDU + 1];
    let mut pairs = digits.chunks_exact(2);
    let mut count = 0;
    for (place, pair) in content.iter_mut().zip(pairs.by_ref()) {
        *place = ascii::byte(pair).ok_or(Status::MALFORMED_FRAME)?;
        count += 1;
    }
    let rest_is_digits = pairs
        .remainder()
        .iter()
        .all(|last| ascii::digit(*last).is_some());
    if !rest_is_digits || pairs.next().is_some() {
        return Err(Status::MALFORMED_FRAME);
    }
    let pdu = content.get(1..count).unwrap_or_default();
    match of_frame(framing, side.length(pdu, functions)) {
        Length::Exactly(length) => match (bytes.len() < length, may_be_longer(side, pdu)) {
            (true, false) => Ok(Length::Exactly(length)),
            (true, true) => Ok(Length::AtLeast(length)),
            // So long already, and no end is there.
            (false, false) => Err(Status::MALFORMED_FRAME),
            (false, true) => Ok(Length::Silence),
        },
        length => Ok(length),
    }
}

/// The length of the frame that answers a request, if it succeeds; an exception
/// may answer it instead, in a PDU of two bytes. `Exactly(0)` if nothing ever
/// answers it: a broadcast, or Force Listen Only Mode.
pub fn of_reply(framing: Framing, unit: u8, request: &Request, functions: &[Function]) -> Length {
    if framing.is_serial() && unit == 0 {
        return Length::Exactly(0);
    }
    match request.response_length(functions) {
        Length::Exactly(0) => Length::Exactly(0),
        length => of_frame(framing, length),
    }
}

/// The length of the Modbus TCP frame that begins with these bytes, request or
/// response, if that is what they look like: a request or a response of this function
/// may be as long as the header says. Without `allow_unknown` only with a function of
/// the standard, one that the standard leaves to users, or one that is declared; 0 is
/// a function of nobody.
///
/// # Errors
/// [`Status::INCOMPLETE_FRAME`] for less than header and function code,
/// [`Status::MALFORMED_FRAME`] if this is something else.
pub fn looks_like_tcp(
    bytes: &[u8],
    allow_unknown: bool,
    functions: &[Function],
) -> Result<usize, Status> {
    let header = tcp::header(bytes)?;
    let code = *bytes.get(tcp::PDU).ok_or(Status::INCOMPLETE_FRAME)?;
    let function = code & !EXCEPTION;
    let known =
        is_user_defined(function) || response_length(&[function], functions) != Length::Unknown;
    let end = header.total.min(bytes.len());
    let pdu = bytes.get(tcp::PDU..end).unwrap_or_default();
    let whole = header.total - tcp::PDU;
    let fits = |side: Side| match side.length(pdu, functions) {
        Length::Exactly(length) if may_be_longer(side, pdu) => length <= whole,
        Length::Exactly(length) => length == whole,
        Length::AtLeast(length) => length <= whole,
        Length::Silence | Length::Unknown => true,
    };
    let right = fits(Side::Response) || (code == function && fits(Side::Request));
    if function != 0 && (known || allow_unknown) && right {
        Ok(header.total)
    } else {
        Err(Status::MALFORMED_FRAME)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is expected of a frame of which nothing is declared.
    fn of(framing: Framing, side: Side, bytes: &[u8]) -> Result<Length, Status> {
        expected(framing, side, bytes, ascii::END, &[])
    }

    #[test]
    fn each_first_byte_of_an_rtu_reply_tells_as_much_as_it_can() {
        let bytes = [0x11, 3, 4, 0, 1, 0, 2, 0xAA, 0xBB];
        for (have, wanted) in [(0, 4), (1, 4), (2, 5)] {
            let length = of(Framing::Rtu, Side::Response, &bytes[..have]);
            assert_eq!(length, Ok(Length::AtLeast(wanted)), "{have}");
        }
        for have in 3..=bytes.len() {
            let length = of(Framing::Rtu, Side::Response, &bytes[..have]);
            assert_eq!(length, Ok(Length::Exactly(9)), "{have}");
        }
    }

    #[test]
    fn an_ascii_frame_is_predicted_and_its_end_decides() {
        let frame = b":110306AE415652434049\r\n";
        for have in 0..frame.len() {
            let length = of(Framing::Ascii, Side::Response, &frame[..have]);
            let wanted = match have {
                0..=2 => Length::AtLeast(9),
                3..=4 => Length::AtLeast(9),
                5..=6 => Length::AtLeast(11),
                _ => Length::Exactly(23),
            };
            assert_eq!(length, Ok(wanted), "{have}");
        }
        let length = of(Framing::Ascii, Side::Response, frame);
        assert_eq!(length, Ok(Length::Exactly(23)));
        let early = of(Framing::Ascii, Side::Response, b":1103\r\n06AE");
        assert_eq!(early, Ok(Length::Exactly(7)));
        let unknown = of(Framing::Ascii, Side::Request, b":1155");
        assert_eq!(unknown, Ok(Length::Silence));
        for bad in [&b"x"[..], b":1G", b":\r1", b":0207F777", b":0207F7\rX"] {
            let length = of(Framing::Ascii, Side::Request, bad);
            assert_eq!(length, Err(Status::MALFORMED_FRAME));
        }
    }

    #[test]
    fn the_end_decides_where_a_device_sends_more_than_it_counts() {
        // It counts its id alone: two bytes of five.
        let frame = b":10110201020001023F\r\n";
        for have in 0..=frame.len() {
            let length = of(Framing::Ascii, Side::Response, &frame[..have]);
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
        let length = of(Framing::Rtu, Side::Response, &[1, 3, 252]);
        assert_eq!(length, Err(Status::MALFORMED_FRAME));
        let length = of(Framing::Tcp, Side::Request, &[0, 1, 0, 0, 255, 255]);
        assert_eq!(length, Err(Status::MALFORMED_FRAME));
        let length = of(Framing::Ascii, Side::Response, b":0103FF");
        assert_eq!(length, Err(Status::MALFORMED_FRAME));
    }

    #[test]
    fn silence_tells_on_a_line_only() {
        let bytes = [1, 8, 0, 0];
        let on_a_line = of(Framing::Rtu, Side::Request, &bytes);
        assert_eq!(on_a_line, Ok(Length::Silence));
        let in_a_stream = of(Framing::RtuOverTcp, Side::Request, &bytes);
        assert_eq!(in_a_stream, Ok(Length::Unknown));
    }

    #[test]
    fn the_reply_to_a_request_is_as_long_as_its_framing_makes_it() {
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
    fn nothing_answers_a_broadcast_or_a_device_told_to_listen_only() {
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
            assert_eq!(length, Err(Status::INCOMPLETE_FRAME));
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
            assert_eq!(length, Err(Status::MALFORMED_FRAME));
        }
    }
}
