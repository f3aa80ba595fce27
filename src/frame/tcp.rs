//! TCP: the MBAP header and a PDU (messaging on TCP/IP guide V1.0b, 3.1.3).

use super::Adu;
use crate::error::Status;
use core::ops::RangeInclusive;

/// Bytes of a frame before its PDU: transaction, protocol, length, unit.
pub const PDU: usize = 7;

/// The longest frame.
pub const MAX_FRAME: usize = PDU + 253;

/// Bytes of the header that the length does not count: all but the unit.
pub const HEADER: usize = 6;

/// What the length of a header may be: unit and PDU.
const LENGTHS: RangeInclusive<u16> = 2..=(MAX_FRAME - HEADER) as u16;

/// The MBAP header.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Header {
    /// The transaction identifier, which a response repeats.
    pub transaction: u16,
    /// Bytes of the whole frame.
    pub total: usize,
    /// The unit.
    pub unit: u8,
}

/// The header of the frame that begins with `bytes`, as soon as it is there;
/// the protocol identifier and the length are judged as they come in.
///
/// # Errors
/// [`Status::INCOMPLETE_FRAME`] while bytes are missing,
/// [`Status::MALFORMED_FRAME`] if this can be no Modbus TCP frame.
pub fn header(bytes: &[u8]) -> Result<Header, Status> {
    let Some([a, b, c, d, e, f, unit]) = bytes.first_chunk() else {
        return Err(begun(bytes));
    };
    let length = u16::from_be_bytes([*e, *f]);
    if u16::from_ne_bytes([*c, *d]) != 0 || !LENGTHS.contains(&length) {
        return Err(Status::MALFORMED_FRAME);
    }
    Ok(Header {
        transaction: u16::from_be_bytes([*a, *b]),
        total: HEADER + usize::from(length),
        unit: *unit,
    })
}

/// The length in the header of a frame whose PDU has so many bytes.
#[inline(always)]
pub const fn length(pdu: usize) -> [u8; 2] {
    (pdu as u16 + 1).to_be_bytes()
}

/// How many bytes it takes to judge more of a header than its first `have` allow.
pub const fn next_part(have: usize) -> usize {
    match have {
        0..4 => 4,
        4..HEADER => HEADER,
        _ => PDU,
    }
}

/// The first eight bytes of a frame, the header and a function code, as one
/// number; `length` is that of the PDU.
#[inline]
pub fn start(transaction: u16, length: u8, unit: u8, function: u8) -> u64 {
    let first = u32::from(transaction) << 16;
    let second = (u32::from(length) + 1) << 16 | u32::from(unit) << 8 | u32::from(function);
    u64::from(first) << 32 | u64::from(second)
}

/// A frame of its [`start`] and two words, as sent.
#[inline]
pub fn short(start: u64, words: [u8; 4]) -> [u8; 12] {
    let mut frame = [0; 12];
    if let Some(place) = frame.first_chunk_mut() {
        *place = start.to_be_bytes();
    }
    if let Some(place) = frame.last_chunk_mut() {
        *place = words;
    }
    frame
}

/// What there is to say of less than a header.
#[cold]
fn begun(bytes: &[u8]) -> Status {
    let right = match *bytes {
        [_, _, c, d, e, f, ..] => c | d == 0 && LENGTHS.contains(&u16::from_be_bytes([e, f])),
        [_, _, c, d, ..] => c | d == 0,
        _ => true,
    };
    if right {
        Status::INCOMPLETE_FRAME
    } else {
        Status::MALFORMED_FRAME
    }
}

/// The frame that is the whole of `bytes`.
///
/// # Errors
/// As [`header`]; [`Status::MALFORMED_FRAME`] also for bytes behind the frame.
pub fn parse(bytes: &[u8]) -> Result<Adu<'_>, Status> {
    let Some(([a, b, protocol_and_length @ .., unit], pdu)) = bytes.split_first_chunk::<PDU>()
    else {
        return Err(refused(bytes));
    };
    // The protocol identifier is zero: so the four bytes are the length.
    let length = u32::from_be_bytes(*protocol_and_length);
    if pdu.is_empty() || pdu.len() > MAX_FRAME - PDU || length != pdu.len() as u32 + 1 {
        return Err(refused(bytes));
    }
    Ok(Adu {
        transaction: u16::from_be_bytes([*a, *b]),
        unit: *unit,
        pdu,
    })
}

/// Why bytes are no whole frame.
#[cold]
fn refused(bytes: &[u8]) -> Status {
    match header(bytes) {
        Ok(header) if bytes.len() > header.total => Status::MALFORMED_FRAME,
        Ok(_) => Status::INCOMPLETE_FRAME,
        Err(refused) => refused,
    }
}

/// Writes the frame of the PDU that `pdu` writes; returns its length.
///
/// # Errors
/// As `pdu` says; [`Status::BUFFER_TOO_SMALL`].
pub fn emit(
    buffer: &mut [u8],
    transaction: u16,
    unit: u8,
    pdu: impl FnOnce(&mut [u8]) -> Result<usize, Status>,
) -> Result<usize, Status> {
    let Some((header, place)) = buffer.split_first_chunk_mut::<PDU>() else {
        return Err(Status::BUFFER_TOO_SMALL);
    };
    let length = pdu(place)?;
    let [a, b] = transaction.to_be_bytes();
    let [c, d] = self::length(length);
    *header = [a, b, 0, 0, c, d, unit];
    Ok(PDU + length)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: [u8; 12] = [0x81, 0x80, 0, 0, 0, 6, 0x10, 1, 0, 0x6B, 0, 3];

    #[test]
    fn a_frame_is_read_and_written() {
        let adu = parse(&FRAME).unwrap();
        assert_eq!((adu.transaction, adu.unit), (0x8180, 0x10));
        let mut buffer = [0; 12];
        let length = emit(&mut buffer, 0x8180, 0x10, |pdu| {
            pdu.copy_from_slice(adu.pdu);
            Ok(5)
        });
        assert_eq!((length, buffer), (Ok(12), FRAME));
    }

    #[test]
    fn a_frame_of_two_words_may_be_written_at_once() {
        let start = start(0x8180, 5, 0x10, 1);
        assert_eq!(short(start, [0, 0x6B, 0, 3]), FRAME);
    }

    #[test]
    fn a_part_of_a_frame_is_incomplete() {
        for end in 0..FRAME.len() {
            assert_eq!(parse(&FRAME[..end]), Err(Status::INCOMPLETE_FRAME));
        }
    }

    #[test]
    fn lengths_that_no_frame_has_are_malformed() {
        for length in [0u16, 1, 255, 256, 65535] {
            let [high, low] = length.to_be_bytes();
            let bytes = [0, 1, 0, 0, high, low, 1, 3, 0, 0, 0, 1];
            assert_eq!(header(&bytes), Err(Status::MALFORMED_FRAME), "{length}");
        }
        assert_eq!(header(&[0, 1, 0, 0, 0, 254, 1]).unwrap().total, MAX_FRAME);
    }

    #[test]
    fn another_protocol_is_malformed() {
        assert_eq!(header(&[0, 1, 0, 1]), Err(Status::MALFORMED_FRAME));
    }
}
