//! The CRC-16 of an RTU frame (serial line guide V1.02, 6.2.2).

use crc::{Crc, CRC_16_MODBUS};

/// A table would cost RAM on an AVR and half a kilobyte of flash elsewhere. The
/// larger tables of the crate come with code that can panic.
#[cfg(target_os = "none")]
type Implementation = crc::NoTable;
#[cfg(not(target_os = "none"))]
type Implementation = crc::Table<1>;

const CRC: Crc<u16, Implementation> = Crc::<u16, Implementation>::new(&CRC_16_MODBUS);

/// A CRC-16 that grows as bytes arrive.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Crc16(u16);

impl Crc16 {
    /// The CRC of no bytes.
    pub const START: Crc16 = Crc16(0xFFFF);

    /// The CRC with `bytes` taken in as well.
    #[cfg_attr(target_os = "none", inline(never))]
    #[must_use]
    pub fn with(self, bytes: &[u8]) -> Crc16 {
        // The crate reflects the initial value; reflecting it here as well
        // cancels out, so a running value can be carried on.
        let mut digest = CRC.digest_with_initial(self.0.reverse_bits());
        digest.update(bytes);
        Crc16(digest.finalize())
    }

    /// The two bytes as sent, low byte first.
    pub const fn to_bytes(self) -> [u8; 2] {
        self.0.to_le_bytes()
    }

    /// True after the bytes of a frame including its CRC, if that is right.
    pub const fn is_residue(self) -> bool {
        self.0 == 0
    }
}

/// The CRC-16 of `bytes`.
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
    fn frame_of_the_serial_line_guide() {
        // Exception status request to unit 2 (6.2.2).
        assert_eq!(crc16(&[0x02, 0x07]).to_bytes(), [0x41, 0x12]);
    }

    #[test]
    fn a_right_frame_leaves_no_residue() {
        assert!(crc16(&[0x01, 0x04, 0x02, 0xFF, 0xFF, 0xB8, 0x80]).is_residue());
    }

    proptest! {
        #[test]
        fn bytes_may_arrive_in_any_pieces(bytes: std::vec::Vec<u8>, cut: usize) {
            let (front, back) = bytes.split_at(cut % (bytes.len() + 1));
            let crc = Crc16::START.with(front).with(back);
            prop_assert_eq!(crc, crc16(&bytes));
        }
    }
}
