//! RTU: unit, PDU, CRC-16, and silence around them (serial line guide 2.5.1).

use super::checksum::{crc16, crc16_of_six, Crc16};
use super::Adu;
use crate::error::Status;

/// The longest frame: unit, PDU of 253 bytes, CRC.
pub const MAX_FRAME: usize = 256;

/// The least bytes of a frame: unit, function, CRC.
pub const MIN_FRAME: u8 = 4;

/// Bytes of a frame around its PDU: the unit before, the CRC behind.
pub const OVERHEAD: usize = 3;

/// Bytes of the CRC.
pub const CRC: u8 = 2;

/// Where the PDU of a frame starts.
pub const PDU: usize = 1;

/// Writes the frame of the PDU that `pdu` writes, `length` bytes long. Returns
/// false, with nothing written, if `buffer` cannot hold it.
pub fn write(buffer: &mut [u8], unit: u8, length: usize, pdu: impl FnOnce(&mut [u8])) -> bool {
    let Some(frame) = buffer.get_mut(..length + OVERHEAD) else {
        return false;
    };
    let Some((content, crc)) = frame.split_at_mut_checked(length + PDU) else {
        return false;
    };
    if let Some((first, rest)) = content.split_first_mut() {
        *first = unit;
        pdu(rest);
    }
    if let [low, high] = crc {
        [*low, *high] = crc16(content).to_bytes();
    }
    true
}

/// The frame of a function code and two words, at little cost: for hosts.
#[inline]
pub fn short(unit: u8, function: u8, [a, b, c, d]: [u8; 4]) -> [u8; 8] {
    let [low, high] = crc16_of_six([unit, function, a, b, c, d]).to_bytes();
    [unit, function, a, b, c, d, low, high]
}

/// The frame that is the whole of `bytes`.
///
/// # Errors
/// [`Status::INCOMPLETE_FRAME`] for less than any frame has,
/// [`Status::MALFORMED_FRAME`] for more, [`Status::INVALID_CRC`].
pub fn parse(bytes: &[u8]) -> Result<Adu<'_>, Status> {
    if bytes.len() < usize::from(MIN_FRAME) {
        return Err(Status::INCOMPLETE_FRAME);
    }
    if bytes.len() > MAX_FRAME {
        return Err(Status::MALFORMED_FRAME);
    }
    match bytes {
        [unit, pdu @ .., _, _] if is_frame(bytes) => Ok(Adu {
            transaction: 0,
            unit: *unit,
            pdu,
        }),
        _ => Err(Status::INVALID_CRC),
    }
}

/// True if the bytes are a frame, as their CRC says. Two or three bytes may be one here, one
/// without a PDU.
#[inline(always)]
pub fn is_frame(bytes: &[u8]) -> bool {
    crc16(bytes).is_residue()
}

/// The length of the shortest frame that begins where `bytes` begin, among those of `least`
/// bytes and each time `step` bytes more; `None` if there is none.
pub fn first(bytes: &[u8], least: usize, step: usize) -> Option<usize> {
    let mut total = least;
    let mut crc = Crc16::START.with(bytes.get(..total)?);
    while !crc.is_residue() {
        crc = crc.with(bytes.get(total..total + step)?);
        total += step;
        if total > MAX_FRAME {
            return None;
        }
    }
    Some(total)
}

/// Where the last frame of `bytes` begins, which ends where they end; their
/// length if there is none. What stands before it does not matter: the CRC is
/// taken back byte by byte until it is that of no bytes; see [`is_frame`].
#[cfg_attr(target_os = "none", inline(never))]
pub fn last(bytes: &[u8]) -> usize {
    let mut crc = Crc16::RESIDUE;
    let mut start = bytes.len();
    let mut rest = bytes;
    while let [before @ .., byte] = rest {
        crc = crc.before(*byte);
        rest = before;
        if crc == Crc16::START {
            start = rest.len();
        }
    }
    start
}

/// Writes the frame of the PDU that `pdu` writes; returns its length.
///
/// # Errors
/// As `pdu` says; [`Status::BUFFER_TOO_SMALL`].
pub fn emit(
    buffer: &mut [u8],
    unit: u8,
    pdu: impl FnOnce(&mut [u8]) -> Result<usize, Status>,
) -> Result<usize, Status> {
    let space = buffer.len().saturating_sub(OVERHEAD);
    let place = buffer.get_mut(PDU..PDU + space);
    let length = pdu(place.ok_or(Status::BUFFER_TOO_SMALL)?)?;
    // Also tells the compiler that the length of the frame cannot overflow.
    if length > space {
        return Err(Status::BUFFER_TOO_SMALL);
    }
    write(buffer, unit, length, |_| ());
    Ok(length + OVERHEAD)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_of_two_words_may_be_written_at_once() {
        let mut frame = [0; 8];
        assert!(write(&mut frame, 0x11, 5, |pdu| pdu
            .copy_from_slice(&[3, 0, 0x6B, 0, 3])));
        assert_eq!(short(0x11, 3, [0, 0x6B, 0, 3]), frame);
        assert_eq!(frame, [0x11, 3, 0, 0x6B, 0, 3, 0x76, 0x87]);
    }
}
