//! The CRC-16 of an RTU frame and the LRC of an ASCII frame (serial line guide
//! V1.02, 6.2.2 and 6.2.1).

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
/// use mbm::frame::checksum::{crc16, Crc16};
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
/// let crc = mbm::frame::checksum::crc16(&[17, 6, 0x00, 0x6D, 0x03, 0x78]);
/// assert_eq!(crc.to_bytes(), [0x1A, 0x55]);
/// ```
pub fn crc16(bytes: &[u8]) -> Crc16 {
    Crc16::START.with(bytes)
}

/// The LRC of `bytes`: the sum of `bytes` and the LRC is 0 modulo 256.
///
/// ```
/// assert_eq!(mbm::frame::checksum::lrc(&[17, 6, 0x00, 0x6D, 0x03, 0x78]), 0x01);
/// ```
pub fn lrc(bytes: &[u8]) -> u8 {
    let sum = bytes.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
    sum.wrapping_neg()
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
