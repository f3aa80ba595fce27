//! RTU frames: unit, PDU and CRC-16. Silence separates the frames (serial line guide V1.02,
//! 2.5.1).

use super::checksum::{crc16, Crc16};
use crate::error::Error;

/// The content of a frame, in every framing: unit and PDU.
///
/// ```
/// use mbm::frame::{tcp, Adu};
///
/// let adu = tcp::parse(&[0, 5, 0, 0, 0, 3, 17, 0x41, 7])?;
/// assert_eq!(adu, Adu { transaction: 5, unit: 17, pdu: &[0x41, 7] });
/// # Ok::<(), mbm::Error>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Adu<'a> {
    /// The transaction identifier of a TCP frame; 0 in other framings.
    pub transaction: u16,
    /// The unit id: of the unit that receives a request, or that sent a response.
    pub unit: u8,
    /// The PDU: function code and data.
    pub pdu: &'a [u8],
}

/// Bytes of the longest frame: unit, PDU of 253 bytes, CRC.
pub const MAX_FRAME: usize = 256;

/// Bytes of the shortest frame: unit, function code, CRC.
pub const MIN_FRAME: u8 = 4;

/// Bytes of a frame that are not its PDU: the unit before it, the CRC after it.
pub const OVERHEAD: usize = 3;

/// Bytes of the CRC.
pub const CRC: u8 = 2;

/// Index of the PDU in a frame.
pub const PDU: usize = 1;

/// Writes a frame to `buffer`. The callback `pdu` writes the PDU of `length` bytes. Returns
/// false, and writes nothing, if the frame does not fit into `buffer`.
// For the C API; it may change in any version.
#[doc(hidden)]
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

/// Parses the frame that fills `bytes`.
///
/// # Errors
/// As [`parse_without_crc`]; [`Error::InvalidCrc`].
///
/// ```
/// use mbm::frame::rtu;
///
/// let adu = rtu::parse(&[17, 6, 0x00, 0x6D, 0x03, 0x78, 0x1A, 0x55])?;
/// assert_eq!((adu.unit, adu.pdu), (17, &[6, 0x00, 0x6D, 0x03, 0x78][..]));
/// # Ok::<(), mbm::Error>(())
/// ```
// With `parse_without_crc` in it, a trace takes 4 bytes more on a Cortex-M0+.
pub fn parse(bytes: &[u8]) -> Result<Adu<'_>, Error> {
    if bytes.len() < usize::from(MIN_FRAME) {
        return Err(Error::IncompleteFrame);
    }
    if bytes.len() > MAX_FRAME {
        return Err(Error::MalformedFrame);
    }
    match bytes {
        [unit, pdu @ .., _, _] if is_frame(bytes) => Ok(Adu {
            transaction: 0,
            unit: *unit,
            pdu,
        }),
        _ => Err(Error::InvalidCrc),
    }
}

/// As [`parse`], whatever the two bytes of the CRC are: for bytes that another layer has checked.
///
/// # Errors
/// [`Error::IncompleteFrame`] for fewer bytes than the shortest frame has,
/// [`Error::MalformedFrame`] for more than the longest has.
///
/// ```
/// use mbm::frame::rtu;
///
/// let adu = rtu::parse_without_crc(&[17, 6, 0x00, 0x6D, 0x03, 0x78, 0, 0])?;
/// assert_eq!(adu.pdu, [6, 0x00, 0x6D, 0x03, 0x78]);
/// # Ok::<(), mbm::Error>(())
/// ```
pub fn parse_without_crc(bytes: &[u8]) -> Result<Adu<'_>, Error> {
    match bytes {
        _ if bytes.len() > MAX_FRAME => Err(Error::MalformedFrame),
        [unit, pdu @ .., _, _] if !pdu.is_empty() => Ok(Adu {
            transaction: 0,
            unit: *unit,
            pdu,
        }),
        _ => Err(Error::IncompleteFrame),
    }
}

/// True if the last two bytes are the CRC of the others. This does not check the length: two or
/// three bytes, a frame without a PDU, may pass.
///
/// ```
/// use mbm::frame::rtu;
///
/// assert!(rtu::is_frame(&[17, 6, 0x00, 0x6D, 0x03, 0x78, 0x1A, 0x55]));
/// assert!(!rtu::is_frame(&[17, 6, 0x00, 0x6D, 0x03, 0x79, 0x1A, 0x55]));
/// ```
#[inline(always)]
pub fn is_frame(bytes: &[u8]) -> bool {
    crc16(bytes).is_residue()
}

/// Length of the shortest frame at the start of `bytes` whose CRC is right. Tries lengths from
/// `least` on in steps of `step`. `None` if there is no such frame.
// For the C API; it may change in any version.
#[doc(hidden)]
pub fn find_first(bytes: &[u8], least: usize, step: usize) -> Option<usize> {
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

/// Index of the longest frame at the end of `bytes` whose CRC is right; that of the last byte if
/// there is none. There is at least one byte. Goes back from the end, and undoes the CRC byte by
/// byte: a frame begins where the CRC has its initial value. As for [`is_frame`], a frame may lack a
/// PDU.
// For the C API; it may change in any version.
#[doc(hidden)]
pub fn find_last(bytes: &[u8]) -> usize {
    // Most often all bytes are one frame. An AVR sees that forwards in a third of the time, for
    // 42 bytes of flash, and a host by its tables.
    if cfg!(any(target_arch = "avr", not(target_os = "none"))) && is_frame(bytes) {
        return 0;
    }
    let mut crc = Crc16::RESIDUE;
    let mut start = bytes.len().wrapping_sub(1);
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

/// Writes a frame to `buffer` and returns its length. The callback `pdu` writes the PDU to the
/// front of the slice that it gets, and returns the length of the PDU.
///
/// # Errors
/// The error of `pdu`; [`Error::BufferTooSmall`].
///
/// ```
/// use mbm::frame::rtu;
///
/// let mut buffer = [0; 8];
/// let emitted = rtu::emit(&mut buffer, 17, |pdu| {
///     pdu[..5].copy_from_slice(&[6, 0x00, 0x6D, 0x03, 0x78]);
///     Ok(5)
/// });
/// assert_eq!(emitted, Ok(8));
/// assert_eq!(buffer, [17, 6, 0x00, 0x6D, 0x03, 0x78, 0x1A, 0x55]);
/// ```
pub fn emit(
    buffer: &mut [u8],
    unit: u8,
    pdu: impl FnOnce(&mut [u8]) -> Result<usize, Error>,
) -> Result<usize, Error> {
    let space = buffer.len().saturating_sub(OVERHEAD);
    let place = buffer.get_mut(PDU..PDU + space);
    let length = pdu(place.ok_or(Error::BufferTooSmall)?)?;
    // This check also lets the compiler prove that the frame's length does not overflow.
    if length > space {
        return Err(Error::BufferTooSmall);
    }
    write(buffer, unit, length, |_| ());
    Ok(length + OVERHEAD)
}
