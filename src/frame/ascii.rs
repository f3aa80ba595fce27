//! ASCII frames: a colon, two hexadecimal characters for each byte of unit, PDU and LRC, a
//! carriage return, and an end character (serial line guide V1.02, 2.5.2).

use super::rtu::Adu;
use crate::error::Error;

/// The colon at the start of a frame.
pub const START: u8 = b':';
/// The carriage return before the end character.
pub const CARRIAGE_RETURN: u8 = b'\r';
/// The default end character, a line feed. Sub-function 03 of function 08 can change it.
pub const END: u8 = b'\n';

/// Characters of the longest frame: the colon, two for each byte of unit, PDU (253 bytes) and
/// LRC, and two at the end.
pub const MAX_FRAME: usize = 1 + 2 * (1 + 253 + 1) + 2;

/// Characters of a frame that are not digits: colon, carriage return and end character.
const DELIMITERS: usize = 3;

/// Digits of the shortest frame: two each for unit, function code and LRC.
const MIN_DIGITS: usize = 2 * 3;

/// Digits of the longest frame.
const MAX_DIGITS: usize = MAX_FRAME - DELIMITERS;

/// The value of a hexadecimal digit in upper or lower case; `None` for other characters.
// For the C API; it may change in any version.
#[doc(hidden)]
pub const fn digit(character: u8) -> Option<u8> {
    match character {
        b'0'..=b'9' => Some(character - b'0'),
        b'A'..=b'F' => Some(character - b'A' + 10),
        b'a'..=b'f' => Some(character - b'a' + 10),
        _ => None,
    }
}

/// The hexadecimal digit, in upper case, for a value of 0 to 15.
// For the C API; it may change in any version.
#[doc(hidden)]
pub const fn character(digit: u8) -> u8 {
    if digit < 10 {
        b'0' + digit
    } else {
        b'A' - 10 + digit
    }
}

/// The byte that two hexadecimal digits encode; `None` if `pair` is not two digits.
// For the C API; it may change in any version.
#[doc(hidden)]
pub const fn byte(pair: &[u8]) -> Option<u8> {
    match pair {
        [high, low] => match (digit(*high), digit(*low)) {
            (Some(high), Some(low)) => Some(high << 4 | low),
            _ => None,
        },
        _ => None,
    }
}

/// The meaning of a character in a frame.
// For the C API; it may change in any version.
#[doc(hidden)]
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum CharacterKind {
    /// A colon. It always begins a frame: an unfinished frame before it was cut off.
    Start,
    /// The end character after a carriage return. It ends a frame.
    End,
    /// Any other character: a digit, or noise.
    Inside,
}

/// The meaning of `character`, which follows the character `before`. `end` is the end
/// character of frames.
// For the C API; it may change in any version.
#[doc(hidden)]
pub const fn kind_of(before: u8, character: u8, end: u8) -> CharacterKind {
    if character == end && before == CARRIAGE_RETURN {
        CharacterKind::End
    } else if character == START {
        CharacterKind::Start
    } else {
        CharacterKind::Inside
    }
}

/// Finds the first frame in `characters`. Returns the index of its colon, and the index after
/// its end character `end` if that has arrived. If there are several colons before the end
/// character, the last one begins the frame: the frames before it were cut off.
// For the C API; it may change in any version.
#[doc(hidden)]
pub fn find(characters: &[u8], end: u8) -> (usize, Option<usize>) {
    let mut begin = None;
    let mut before = 0;
    for (index, character) in characters.iter().enumerate() {
        match kind_of(before, *character, end) {
            CharacterKind::Start => begin = Some(index),
            CharacterKind::End => return (begin.unwrap_or(index + 1), Some(index + 1)),
            CharacterKind::Inside => {}
        }
        before = *character;
    }
    (begin.unwrap_or(characters.len()), None)
}

/// The result of decoding a frame.
// For the C API; it may change in any version.
#[doc(hidden)]
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Decoded {
    /// The frame is valid. The number is the length of unit and PDU, in bytes.
    Valid(u8),
    /// The LRC is wrong. The number is the length of unit and PDU, in bytes.
    WrongLrc(u8),
    /// The characters are not a frame.
    Malformed,
}

/// Decodes the frame that fills `bytes`. Digits may be in upper or lower case. If `in_place` is
/// true, unit, PDU and LRC are written to the front of `bytes`; a malformed frame may then be
/// partly overwritten. If it is false, `bytes` does not change.
// For the C API; it may change in any version.
#[doc(hidden)]
pub fn decode(bytes: &mut [u8], end: u8, in_place: bool) -> Decoded {
    let length = match bytes {
        [START, characters @ .., CARRIAGE_RETURN, last] if *last == end => characters.len(),
        _ => return Decoded::Malformed,
    };
    if length % 2 != 0 || length.wrapping_sub(MIN_DIGITS) > MAX_DIGITS - MIN_DIGITS {
        return Decoded::Malformed;
    }
    let mut sum = 0u8;
    for index in 0..length / 2 {
        let at = 1 + 2 * index;
        let Some(decoded) = bytes.get(at..at + 2).and_then(byte) else {
            return Decoded::Malformed;
        };
        sum = sum.wrapping_add(decoded);
        if let Some(place) = bytes.get_mut(index).filter(|_| in_place) {
            *place = decoded;
        }
    }
    let content = (length / 2 - 1) as u8;
    if sum == 0 {
        Decoded::Valid(content)
    } else {
        Decoded::WrongLrc(content)
    }
}

/// Decodes the frame that fills `bytes`, in place. Digits may be in upper or lower case.
///
/// # Errors
/// [`Error::IncompleteFrame`] if the end is missing; [`Error::MalformedFrame`] if the colon
/// is missing, or if the characters are not pairs of digits; [`Error::InvalidCrc`] if the LRC
/// is wrong. After an error, `bytes` may be overwritten.
///
/// ```
/// use mbm::frame::ascii;
///
/// let mut frame = *b":114107A7\r\n";
/// let adu = ascii::parse(&mut frame, ascii::END)?;
/// assert_eq!((adu.unit, adu.pdu), (17, &[0x41, 7][..]));
/// # Ok::<(), mbm::Error>(())
/// ```
pub fn parse(bytes: &mut [u8], end: u8) -> Result<Adu<'_>, Error> {
    if bytes.first().is_none_or(|first| *first == START)
        && bytes.len() <= MAX_FRAME
        && (bytes.len() < DELIMITERS || !bytes.ends_with(&[CARRIAGE_RETURN, end]))
    {
        return Err(Error::IncompleteFrame);
    }
    let length = match decode(bytes, end, true) {
        Decoded::Valid(length) => length,
        Decoded::WrongLrc(_) => return Err(Error::InvalidCrc),
        Decoded::Malformed => return Err(Error::MalformedFrame),
    };
    match bytes.get(..length.into()) {
        Some([unit, pdu @ ..]) => Ok(Adu {
            transaction: 0,
            unit: *unit,
            pdu,
        }),
        _ => Err(Error::MalformedFrame),
    }
}

/// Writes a frame to `buffer` and returns its length. The callback `pdu` writes the PDU to the
/// front of the slice that it gets, and returns the length of the PDU.
///
/// # Errors
/// The error of `pdu`; [`Error::BufferTooSmall`].
///
/// ```
/// use mbm::frame::ascii;
///
/// let mut buffer = [0; 11];
/// let emitted = ascii::emit(&mut buffer, 17, ascii::END, |pdu| {
///     pdu[..2].copy_from_slice(&[0x41, 7]);
///     Ok(2)
/// });
/// assert_eq!(emitted, Ok(11));
/// assert_eq!(buffer, *b":114107A7\r\n");
/// ```
pub fn emit(
    buffer: &mut [u8],
    unit: u8,
    end: u8,
    pdu: impl FnOnce(&mut [u8]) -> Result<usize, Error>,
) -> Result<usize, Error> {
    let Some((first, place)) = buffer.split_first_mut() else {
        return Err(Error::BufferTooSmall);
    };
    *first = unit;
    let content = 1 + pdu(place)?;
    encode(buffer, content, end)
}

/// Turns unit and PDU, the first `content` bytes of `buffer`, into a frame in place. Returns the
/// length of the frame.
///
/// # Errors
/// [`Error::BufferTooSmall`]; `buffer` is then unchanged.
// For the C API; it may change in any version.
#[doc(hidden)]
pub fn encode(buffer: &mut [u8], content: usize, end: u8) -> Result<usize, Error> {
    let total = 2 * (content + 1) + DELIMITERS;
    let Some(frame) = buffer.get_mut(..total) else {
        return Err(Error::BufferTooSmall);
    };
    let check = lrc(frame.get(..content).unwrap_or_default());
    // From the last byte to the first, so that no byte is overwritten before it is encoded.
    for index in (0..=content).rev() {
        let byte = match frame.get(index) {
            Some(byte) if index < content => *byte,
            _ => check,
        };
        let at = 1 + 2 * index;
        if let Some([high, low]) = frame.get_mut(at..at + 2) {
            *high = character(byte >> 4);
            *low = character(byte & 0x0F);
        }
    }
    if let [first, .., carriage_return, last] = frame {
        *first = START;
        *carriage_return = CARRIAGE_RETURN;
        *last = end;
    }
    Ok(total)
}

/// The LRC of `bytes`: the sum of `bytes` and the LRC is 0 modulo 256.
///
/// ```
/// assert_eq!(mbm::frame::ascii::lrc(&[17, 6, 0x00, 0x6D, 0x03, 0x78]), 0x01);
/// ```
pub fn lrc(bytes: &[u8]) -> u8 {
    let sum = bytes.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
    sum.wrapping_neg()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Read Exception Status of unit 2, with its LRC.
    const FRAME: &[u8] = b":0207F7\r\n";

    #[test]
    fn a_frame_is_parsed_and_emitted() {
        let mut bytes = FRAME.to_vec();
        let adu = parse(&mut bytes, END).unwrap();
        assert_eq!((adu.unit, adu.pdu), (2, &[7][..]));
        let mut buffer = [0; 9];
        let length = emit(&mut buffer, 2, END, |pdu| {
            pdu[0] = 7;
            Ok(1)
        });
        assert_eq!((length, &buffer[..]), (Ok(9), FRAME));
        assert_eq!(
            emit(&mut buffer[..8], 2, END, |_| Ok(1)),
            Err(Error::BufferTooSmall)
        );
    }

    #[test]
    fn lower_case_digits_are_accepted() {
        assert!(parse(&mut b":0207f7\r\n".to_vec(), END).is_ok());
    }

    #[test]
    fn a_frame_without_its_end_is_incomplete() {
        for end in 0..FRAME.len() {
            let mut bytes = FRAME[..end].to_vec();
            assert_eq!(parse(&mut bytes, END), Err(Error::IncompleteFrame));
        }
        assert_eq!(
            parse(&mut FRAME.to_vec(), b'!'),
            Err(Error::IncompleteFrame)
        );
    }

    #[test]
    fn characters_that_are_not_pairs_of_digits_are_malformed() {
        for frame in [
            &b":0207F\r\n"[..],
            b":0207FG\r\n",
            b"0207F7\r\n",
            b":07\r\n",
        ] {
            let mut bytes = frame.to_vec();
            assert_eq!(parse(&mut bytes, END), Err(Error::MalformedFrame));
        }
    }

    #[test]
    fn a_wrong_lrc_is_detected() {
        let mut bytes = b":0207F6\r\n".to_vec();
        assert_eq!(parse(&mut bytes, END), Err(Error::InvalidCrc));
    }

    #[test]
    fn decode_without_in_place_does_not_change_the_frame() {
        for (frame, content) in [
            (FRAME, Decoded::Valid(2)),
            (b":0207F6\r\n", Decoded::WrongLrc(2)),
            (b":0207FG\r\n", Decoded::Malformed),
        ] {
            let mut bytes = frame.to_vec();
            assert_eq!(decode(&mut bytes, END, false), content);
            assert_eq!(bytes, frame);
            assert_eq!(decode(&mut bytes, END, true), content);
        }
    }

    #[test]
    fn the_end_character_can_be_changed() {
        assert!(parse(&mut b":0207F7\r!".to_vec(), b'!').is_ok());
    }
}
