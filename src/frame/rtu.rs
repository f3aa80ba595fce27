//! RTU frames: unit, PDU and CRC-16 (serial line guide V1.02, 6.2.2). Silence separates the frames
//! (2.5.1).

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

/// The CRC after `bytes`, for hosts: two bytes in one step, by the table of the crate `crc` and one
/// made of it.
#[cfg(not(target_os = "none"))]
#[allow(clippy::indexing_slicing)] // A byte is in range, so the compiler leaves the checks out.
fn by_table(crc: u16, bytes: &[u8]) -> u16 {
    const ONE: [u16; 256] = crc::Crc::<u16>::new(&crc::CRC_16_MODBUS).table()[0];
    /// The contribution of the last byte of a step to the CRC, and that of the byte before it.
    static TABLES: [[u16; 256]; 2] = {
        let mut before = ONE;
        let mut index = 0;
        while index < before.len() {
            before[index] = ONE[ONE[index] as usize & 0xFF] ^ ONE[index] >> 8;
            index += 1;
        }
        [ONE, before]
    };
    let [last, before] = &TABLES;
    let (pairs, rest) = bytes.as_chunks();
    let crc = pairs.iter().fold(crc, |crc, pair| {
        let [low, high] = (crc ^ u16::from_le_bytes(*pair)).to_le_bytes();
        before[usize::from(low)] ^ last[usize::from(high)]
    });
    rest.iter().fold(crc, |crc, byte| {
        last[usize::from(crc as u8 ^ byte)] ^ crc >> 8
    })
}

/// The CRC after `bytes`, for firmware: eight bits in one step, which come down to the parity of
/// the byte and two shifts. A table would take RAM on an AVR, and half a kilobyte of flash
/// elsewhere. The loop over bits of the `crc` crate took a third of the time between a reply and
/// the next request on an AVR.
#[cfg(any(test, target_os = "none"))]
fn by_parity(crc: u16, bytes: &[u8]) -> u16 {
    bytes.iter().fold(crc, |crc, byte| {
        let low = crc as u8 ^ byte;
        let folded = low ^ low >> 4;
        let folded = folded ^ folded >> 2;
        let odd = (folded ^ folded >> 1) & 1 != 0;
        let low = u16::from(low);
        let crc = crc >> 8 ^ low << 6 ^ low << 7;
        if odd {
            crc ^ 0xC001
        } else {
            crc
        }
    })
}

/// A CRC-16 that can be updated as bytes arrive.
///
/// ```
/// use mbm::frame::rtu::{crc16, Crc16};
///
/// // Byte by byte, as they arrive.
/// let crc = Crc16::START.with(&[17, 6, 0x00]).with(&[0x6D, 0x03, 0x78]);
/// assert_eq!(crc, crc16(&[17, 6, 0x00, 0x6D, 0x03, 0x78]));
/// assert_eq!(crc.to_bytes(), [0x1A, 0x55]);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Crc16(u16);

impl Crc16 {
    /// The CRC of no bytes.
    pub const START: Crc16 = Crc16(0xFFFF);

    /// The CRC of a whole frame including its CRC, if the frame's CRC is right.
    pub const RESIDUE: Crc16 = Crc16(0);

    /// The CRC after these `bytes` too.
    #[must_use]
    pub fn with(self, bytes: &[u8]) -> Crc16 {
        // A table takes half a kilobyte of flash. On a host it saves 560 of the 1860 instructions
        // of a transaction, and a second one 125 more.
        #[cfg(not(target_os = "none"))]
        return Crc16(by_table(self.0, bytes));
        #[cfg(target_os = "none")]
        Crc16(by_parity(self.0, bytes))
    }

    /// The inverse of [`Crc16::with`]: the CRC before `byte`, from the CRC after `byte`. (A bit that is
    /// shifted counts the steps of this loop: 52 bytes of flash less on an AVR than a number.)
    // For the C API; it may change in any version.
    #[doc(hidden)]
    #[must_use]
    pub fn before(self, byte: u8) -> Crc16 {
        let mut crc = self.0;
        let mut bit = 0x80u8;
        loop {
            let odd = crc & 0x8000 != 0;
            crc <<= 1;
            if odd {
                crc ^= 0x4003;
            }
            bit >>= 1;
            if bit == 0 {
                return Crc16(crc ^ u16::from(byte));
            }
        }
    }

    /// The two bytes of the CRC as they are sent, low byte first.
    pub const fn to_bytes(self) -> [u8; 2] {
        self.0.to_le_bytes()
    }

    /// True for the CRC of a whole frame including its CRC, if the frame's CRC is right.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn is_residue(self) -> bool {
        self.0 == 0
    }
}

/// The CRC-16 of `bytes`.
///
/// ```
/// let crc = mbm::frame::rtu::crc16(&[17, 6, 0x00, 0x6D, 0x03, 0x78]);
/// assert_eq!(crc.to_bytes(), [0x1A, 0x55]);
/// ```
pub fn crc16(bytes: &[u8]) -> Crc16 {
    Crc16::START.with(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn check_value_of_the_catalogue() {
        assert_eq!(crc16(b"123456789").to_bytes(), [0x37, 0x4B]);
    }

    #[test]
    fn all_implementations_agree_for_every_byte_and_every_crc() {
        for crc in 0..=u16::MAX {
            let bytes = [(crc >> 8) as u8 ^ 0x5A, crc as u8 ^ 0xC3];
            assert_eq!(by_parity(crc, &bytes), by_table(crc, &bytes));
            assert_eq!(by_parity(crc, &bytes[..1]), by_table(crc, &bytes[..1]));
        }
        for byte in 0..=u8::MAX {
            for bytes in [&[byte][..], &[byte, 0x5A], &[0x5A, byte]] {
                assert_eq!(by_parity(0x1234, bytes), by_table(0x1234, bytes));
            }
        }
    }

    #[test]
    fn frame_of_the_serial_line_guide() {
        // Exception status request to unit 2 (6.2.2).
        assert_eq!(crc16(&[0x02, 0x07]).to_bytes(), [0x41, 0x12]);
    }

    #[test]
    fn a_valid_frame_leaves_no_residue() {
        assert!(crc16(&[0x01, 0x04, 0x02, 0xFF, 0xFF, 0xB8, 0x80]).is_residue());
    }

    proptest! {
        #[test]
        fn before_undoes_one_byte(crc: u16, byte: u8) {
            let after = Crc16(crc).with(&[byte]);
            prop_assert_eq!(after.before(byte), Crc16(crc));
        }

        #[test]
        fn the_crc_does_not_depend_on_how_the_bytes_are_split(bytes: std::vec::Vec<u8>, cut: usize) {
            let (front, back) = bytes.split_at(cut % (bytes.len() + 1));
            let crc = Crc16::START.with(front).with(back);
            prop_assert_eq!(crc, crc16(&bytes));
            prop_assert_eq!(crc.0, by_parity(0xFFFF, &bytes));
        }
    }
}
