//! ASCII: a colon, hexadecimal characters, LRC, carriage return and an end
//! character (serial line guide V1.02, 2.5.2).

use super::checksum::lrc;
use super::Adu;
use crate::error::Status;

/// What a frame begins with.
pub const START: u8 = b':';
/// What stands before the end character.
pub const RETURN: u8 = b'\r';
/// The end character, unless sub-function 03 of 08 changed it.
pub const END: u8 = b'\n';

/// The longest frame: colon, unit, PDU of 253 bytes and LRC in two characters
/// each, and the two that end it.
pub const MAX_FRAME: usize = 1 + 2 * (1 + 253 + 1) + 2;

/// Characters of a frame that are no bytes of content.
const AROUND: usize = 3;

/// The least digits of a frame: two for each of unit, function code and LRC.
const LEAST_DIGITS: usize = 2 * 3;

/// The most digits of a frame.
const MAX_DIGITS: usize = MAX_FRAME - AROUND;

/// The value of a hexadecimal digit; lower case is taken too.
pub const fn digit(character: u8) -> Option<u8> {
    match character {
        b'0'..=b'9' => Some(character - b'0'),
        b'A'..=b'F' => Some(character - b'A' + 10),
        b'a'..=b'f' => Some(character - b'a' + 10),
        _ => None,
    }
}

/// The hexadecimal digit of a value below 16, in upper case.
pub const fn character(digit: u8) -> u8 {
    if digit < 10 {
        b'0' + digit
    } else {
        b'A' - 10 + digit
    }
}

/// The byte that a pair of digits is.
pub const fn byte(pair: &[u8]) -> Option<u8> {
    match pair {
        [high, low] => match (digit(*high), digit(*low)) {
            (Some(high), Some(low)) => Some(high << 4 | low),
            _ => None,
        },
        _ => None,
    }
}

/// What a character is in a frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Mark {
    /// The colon that begins a frame, wherever it stands: a frame before it was cut off.
    Start,
    /// The end character behind a carriage return, which ends a frame.
    End,
    /// Any other: a digit, or noise.
    Inside,
}

/// What `character` is behind the character `before`; `end` is the one that ends frames.
#[inline(always)]
pub const fn mark(before: u8, character: u8, end: u8) -> Mark {
    if character == end && before == RETURN {
        Mark::End
    } else if character == START {
        Mark::Start
    } else {
        Mark::Inside
    }
}

/// Where the first frame that is whole begins among `characters`, and where it ends if
/// its end has arrived; `end` is the character that ends it. The last colon counts, for a
/// frame without an end was cut off. Characters before it are noise.
pub fn find(characters: &[u8], end: u8) -> (usize, Option<usize>) {
    let mut begin = None;
    let mut before = 0;
    for (index, character) in characters.iter().enumerate() {
        match mark(before, *character, end) {
            Mark::Start => begin = Some(index),
            Mark::End => return (begin.unwrap_or(index + 1), Some(index + 1)),
            Mark::Inside => {}
        }
        before = *character;
    }
    (begin.unwrap_or(characters.len()), None)
}

/// What a frame carries.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Content {
    /// So many bytes of unit and PDU; the LRC behind them is right.
    Right(u8),
    /// As many, whose LRC is wrong.
    Damaged(u8),
    /// Nothing: it is no frame.
    Malformed,
}

/// Decodes the frame that is the whole of `bytes`, unit and PDU and LRC: into its front if
/// `in_place`, else it stays as it is. Lower case digits are taken too. Of what is
/// malformed, some may be overwritten.
#[cfg_attr(target_os = "none", inline(never))]
pub fn decode(bytes: &mut [u8], end: u8, in_place: bool) -> Content {
    let length = match bytes {
        [START, characters @ .., RETURN, last] if *last == end => characters.len(),
        _ => return Content::Malformed,
    };
    if length % 2 != 0 || length.wrapping_sub(LEAST_DIGITS) > MAX_DIGITS - LEAST_DIGITS {
        return Content::Malformed;
    }
    let mut sum = 0u8;
    for index in 0..length / 2 {
        let at = 1 + 2 * index;
        let Some(decoded) = bytes.get(at..at + 2).and_then(byte) else {
            return Content::Malformed;
        };
        sum = sum.wrapping_add(decoded);
        if let Some(place) = bytes.get_mut(index).filter(|_| in_place) {
            *place = decoded;
        }
    }
    let content = (length / 2 - 1) as u8;
    if sum == 0 {
        Content::Right(content)
    } else {
        Content::Damaged(content)
    }
}

/// The frame that is the whole of `bytes`, decoded where it stands. Lower case
/// digits are taken too.
///
/// # Errors
/// [`Status::INCOMPLETE_FRAME`] without its end; [`Status::MALFORMED_FRAME`]
/// without a colon, or for characters that are no pairs of digits;
/// [`Status::INVALID_CRC`] for a wrong LRC. The bytes may then be overwritten.
pub fn parse(bytes: &mut [u8], end: u8) -> Result<Adu<'_>, Status> {
    if bytes.first().is_none_or(|first| *first == START)
        && bytes.len() <= MAX_FRAME
        && (bytes.len() < AROUND || !bytes.ends_with(&[RETURN, end]))
    {
        return Err(Status::INCOMPLETE_FRAME);
    }
    let length = match decode(bytes, end, true) {
        Content::Right(length) => length,
        Content::Damaged(_) => return Err(Status::INVALID_CRC),
        Content::Malformed => return Err(Status::MALFORMED_FRAME),
    };
    match bytes.get(..length.into()) {
        Some([unit, pdu @ ..]) => Ok(Adu {
            transaction: 0,
            unit: *unit,
            pdu,
        }),
        _ => Err(Status::MALFORMED_FRAME),
    }
}

/// Writes the frame of the PDU that `pdu` writes; returns its length. The PDU
/// stands in the buffer's front first.
///
/// # Errors
/// As `pdu` says; [`Status::BUFFER_TOO_SMALL`].
pub fn emit(
    buffer: &mut [u8],
    unit: u8,
    end: u8,
    pdu: impl FnOnce(&mut [u8]) -> Result<usize, Status>,
) -> Result<usize, Status> {
    let Some((first, place)) = buffer.split_first_mut() else {
        return Err(Status::BUFFER_TOO_SMALL);
    };
    *first = unit;
    let content = 1 + pdu(place)?;
    encode(buffer, content, end)
}

/// Turns the first `content` bytes of a buffer, unit and PDU, into their frame; returns
/// its length.
///
/// # Errors
/// [`Status::BUFFER_TOO_SMALL`], with nothing changed.
#[cfg_attr(target_os = "none", inline(never))]
pub fn encode(buffer: &mut [u8], content: usize, end: u8) -> Result<usize, Status> {
    let total = 2 * (content + 1) + AROUND;
    let Some(frame) = buffer.get_mut(..total) else {
        return Err(Status::BUFFER_TOO_SMALL);
    };
    let check = lrc(frame.get(..content).unwrap_or_default());
    // From the back, so that nothing is overwritten before it is taken.
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
    if let [first, .., return_, last] = frame {
        *first = START;
        *return_ = RETURN;
        *last = end;
    }
    Ok(total)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Read Exception Status of unit 2, with its LRC.
    const FRAME: &[u8] = b":0207F7\r\n";

    #[test]
    fn a_frame_is_read_and_written() {
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
            Err(Status::BUFFER_TOO_SMALL)
        );
    }

    #[test]
    fn lower_case_digits_are_taken() {
        assert!(parse(&mut b":0207f7\r\n".to_vec(), END).is_ok());
    }

    #[test]
    fn a_frame_without_its_end_is_incomplete() {
        for end in 0..FRAME.len() {
            let mut bytes = FRAME[..end].to_vec();
            assert_eq!(parse(&mut bytes, END), Err(Status::INCOMPLETE_FRAME));
        }
        assert_eq!(
            parse(&mut FRAME.to_vec(), b'!'),
            Err(Status::INCOMPLETE_FRAME)
        );
    }

    #[test]
    fn characters_that_are_no_pairs_of_digits_are_malformed() {
        for frame in [
            &b":0207F\r\n"[..],
            b":0207FG\r\n",
            b"0207F7\r\n",
            b":07\r\n",
        ] {
            let mut bytes = frame.to_vec();
            assert_eq!(parse(&mut bytes, END), Err(Status::MALFORMED_FRAME));
        }
    }

    #[test]
    fn a_wrong_lrc_is_found() {
        let mut bytes = b":0207F6\r\n".to_vec();
        assert_eq!(parse(&mut bytes, END), Err(Status::INVALID_CRC));
    }

    #[test]
    fn a_frame_that_is_not_decoded_in_place_stays_as_it_is() {
        for (frame, content) in [
            (FRAME, Content::Right(2)),
            (b":0207F6\r\n", Content::Damaged(2)),
            (b":0207FG\r\n", Content::Malformed),
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
