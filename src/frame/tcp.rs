//! TCP frames: an MBAP header and a PDU (messaging on TCP/IP guide V1.0b, 3.1.3).

use super::rtu::Adu;
use crate::error::Error;
use core::ops::RangeInclusive;

/// Index of the PDU in a frame, after transaction, protocol, length and unit.
pub const PDU: usize = 7;

/// Bytes of the longest frame.
pub const MAX_FRAME: usize = PDU + 253;

/// Bytes of the header that its length field does not count: all but the unit.
pub const HEADER: usize = 6;

/// Valid values of the length field. It counts unit and PDU.
const VALID_LENGTHS: RangeInclusive<u16> = 2..=(MAX_FRAME - HEADER) as u16;

/// The MBAP header.
///
/// ```
/// use mbm::frame::tcp::{header, Header};
///
/// let first = [0, 5, 0, 0, 0, 6, 17, 6];
/// assert_eq!(header(&first)?, Header { transaction: 5, total: 12, unit: 17 });
/// # Ok::<(), mbm::Error>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Header {
    /// The transaction identifier. A response repeats that of its request.
    pub transaction: u16,
    /// Length of the whole frame, in bytes.
    pub total: usize,
    /// The unit id.
    pub unit: u8,
}

/// Parses the header at the start of `bytes`. The protocol identifier and the length field are
/// checked as soon as they are complete, even if the rest of the header is still missing.
///
/// # Errors
/// [`Error::IncompleteFrame`] if bytes of the header are missing;
/// [`Error::MalformedFrame`] if the bytes cannot begin a Modbus TCP frame.
///
/// ```
/// use mbm::frame::tcp;
/// use mbm::Error;
///
/// // How many bytes to read until the frame is whole.
/// assert_eq!(tcp::header(&[0, 5, 0, 0, 0, 6, 17])?.total, 12);
/// assert_eq!(tcp::header(&[0, 5, 0]), Err(Error::IncompleteFrame));
/// assert_eq!(tcp::header(&[0, 5, 0, 1]), Err(Error::MalformedFrame));
/// # Ok::<(), mbm::Error>(())
/// ```
pub fn header(bytes: &[u8]) -> Result<Header, Error> {
    let Some([a, b, c, d, e, f, unit]) = bytes.first_chunk() else {
        return Err(partial_header_error(bytes));
    };
    let length = u16::from_be_bytes([*e, *f]);
    if u16::from_ne_bytes([*c, *d]) != 0 || !VALID_LENGTHS.contains(&length) {
        return Err(Error::MalformedFrame);
    }
    Ok(Header {
        transaction: u16::from_be_bytes([*a, *b]),
        total: HEADER + usize::from(length),
        unit: *unit,
    })
}

/// The length field for a PDU of `pdu` bytes.
// For the C API; it may change in any version.
#[doc(hidden)]
pub const fn length(pdu: usize) -> [u8; 2] {
    (pdu as u16 + 1).to_be_bytes()
}

/// How many bytes of a header are needed to check its next field, if `have` bytes are there.
pub(crate) const fn next_part(have: usize) -> usize {
    match have {
        0..4 => 4,
        4..HEADER => HEADER,
        _ => PDU,
    }
}

/// The error for an incomplete header.
#[cold]
fn partial_header_error(bytes: &[u8]) -> Error {
    let is_valid_so_far = match *bytes {
        [_, _, c, d, e, f, ..] => c | d == 0 && VALID_LENGTHS.contains(&u16::from_be_bytes([e, f])),
        [_, _, c, d, ..] => c | d == 0,
        _ => true,
    };
    if is_valid_so_far {
        Error::IncompleteFrame
    } else {
        Error::MalformedFrame
    }
}

/// Parses the frame that fills `bytes`.
///
/// # Errors
/// As [`header`]; [`Error::IncompleteFrame`] also if bytes of the PDU are missing;
/// [`Error::MalformedFrame`] also if bytes follow the frame.
///
/// ```
/// use mbm::frame::tcp;
///
/// let adu = tcp::parse(&[0, 5, 0, 0, 0, 6, 17, 6, 0x00, 0x6D, 0x03, 0x78])?;
/// assert_eq!((adu.transaction, adu.unit, adu.pdu[0]), (5, 17, 6));
/// # Ok::<(), mbm::Error>(())
/// ```
pub fn parse(bytes: &[u8]) -> Result<Adu<'_>, Error> {
    let Some(([a, b, protocol_and_length @ .., unit], pdu)) = bytes.split_first_chunk::<PDU>()
    else {
        return Err(parse_error(bytes));
    };
    // The protocol identifier is 0, so its two bytes and the length field make one number.
    let length = u32::from_be_bytes(*protocol_and_length);
    if pdu.is_empty() || pdu.len() > MAX_FRAME - PDU || length != pdu.len() as u32 + 1 {
        return Err(parse_error(bytes));
    }
    Ok(Adu {
        transaction: u16::from_be_bytes([*a, *b]),
        unit: *unit,
        pdu,
    })
}

/// The error for bytes that are not one whole frame.
#[cold]
fn parse_error(bytes: &[u8]) -> Error {
    match header(bytes) {
        Ok(header) if bytes.len() > header.total => Error::MalformedFrame,
        Ok(_) => Error::IncompleteFrame,
        Err(error) => error,
    }
}

/// Writes a frame to `buffer` and returns its length. The callback `pdu` writes the PDU to the
/// front of the slice that it gets, and returns the length of the PDU.
///
/// # Errors
/// The error of `pdu`; [`Error::BufferTooSmall`].
///
/// ```
/// use mbm::frame::tcp;
///
/// let mut buffer = [0; tcp::MAX_FRAME];
/// let length = tcp::emit(&mut buffer, 5, 17, |pdu| {
///     pdu[..2].copy_from_slice(&[0x41, 7]);
///     Ok(2)
/// })?;
/// assert_eq!(buffer[..length], [0, 5, 0, 0, 0, 3, 17, 0x41, 7]);
/// # Ok::<(), mbm::Error>(())
/// ```
pub fn emit(
    buffer: &mut [u8],
    transaction: u16,
    unit: u8,
    pdu: impl FnOnce(&mut [u8]) -> Result<usize, Error>,
) -> Result<usize, Error> {
    let Some((header, place)) = buffer.split_first_chunk_mut::<PDU>() else {
        return Err(Error::BufferTooSmall);
    };
    let length = pdu(place)?;
    *header = emit_header(transaction, length, unit);
    Ok(PDU + length)
}

/// The header before a PDU of `pdu` bytes.
pub(crate) const fn emit_header(transaction: u16, pdu: usize, unit: u8) -> [u8; PDU] {
    let [a, b] = transaction.to_be_bytes();
    let [c, d] = length(pdu);
    [a, b, 0, 0, c, d, unit]
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: [u8; 12] = [0x81, 0x80, 0, 0, 0, 6, 0x10, 1, 0, 0x6B, 0, 3];

    #[test]
    fn a_frame_is_parsed_and_emitted() {
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
    fn a_part_of_a_frame_is_incomplete() {
        for end in 0..FRAME.len() {
            assert_eq!(parse(&FRAME[..end]), Err(Error::IncompleteFrame));
        }
    }

    #[test]
    fn an_impossible_length_is_malformed() {
        for length in [0u16, 1, 255, 256, 65535] {
            let [high, low] = length.to_be_bytes();
            let bytes = [0, 1, 0, 0, high, low, 1, 3, 0, 0, 0, 1];
            assert_eq!(header(&bytes), Err(Error::MalformedFrame), "{length}");
        }
        assert_eq!(header(&[0, 1, 0, 0, 0, 254, 1]).unwrap().total, MAX_FRAME);
    }

    #[test]
    fn another_protocol_is_malformed() {
        assert_eq!(header(&[0, 1, 0, 1]), Err(Error::MalformedFrame));
    }
}
