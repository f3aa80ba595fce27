//! TCP: the MBAP header and a PDU (messaging on TCP/IP guide V1.0b, 3.1.3).

use super::Adu;
use crate::error::Status;
use core::cmp::Ordering;

/// Bytes of a frame before its PDU: transaction, protocol, length, unit.
pub const PDU: usize = 7;

/// The longest frame.
pub const MAX_FRAME: usize = PDU + 253;

/// Bytes of the header that the length does not count: all but the unit.
pub const HEADER: usize = 6;

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
    let (total, rest) = match bytes {
        [_, _, 0, 0, high, low, rest @ ..] => {
            let total = HEADER + usize::from(u16::from_be_bytes([*high, *low]));
            if !(PDU + 1..=MAX_FRAME).contains(&total) {
                return Err(Status::MALFORMED_FRAME);
            }
            (total, rest)
        }
        [_, _, 0, 0, ..] | [] | [_] | [_, _] | [_, _, _] => return Err(Status::INCOMPLETE_FRAME),
        _ => return Err(Status::MALFORMED_FRAME),
    };
    match (bytes.first_chunk(), rest) {
        (Some(transaction), [unit, ..]) => Ok(Header {
            transaction: u16::from_be_bytes(*transaction),
            total,
            unit: *unit,
        }),
        _ => Err(Status::INCOMPLETE_FRAME),
    }
}

/// The frame that is the whole of `bytes`.
///
/// # Errors
/// As [`header`]; [`Status::MALFORMED_FRAME`] also for bytes behind the frame.
pub fn parse(bytes: &[u8]) -> Result<Adu<'_>, Status> {
    let header = header(bytes)?;
    match (bytes.len().cmp(&header.total), bytes.get(PDU..)) {
        (Ordering::Equal, Some(pdu)) => Ok(Adu {
            transaction: header.transaction,
            unit: header.unit,
            pdu,
        }),
        (Ordering::Greater, _) => Err(Status::MALFORMED_FRAME),
        _ => Err(Status::INCOMPLETE_FRAME),
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
    let [c, d] = (length as u16 + 1).to_be_bytes();
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
