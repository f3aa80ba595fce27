//! The CRC-16 of an RTU frame and the LRC of an ASCII frame (serial line guide
//! V1.02, 6.2.2 and 6.2.1).

use crate::FIRMWARE;

/// For each byte value, what it has done to the CRC once so many bytes have
/// followed.
type Table = [u16; 256];

/// The tables for 0 to 15 bytes that follow, in fours: 8 KB, which a host has
/// room for.
static TABLES: [[Table; 4]; 4] = tables();

/// Made by the compiler, so no index is wrong at run time.
#[allow(clippy::indexing_slicing)]
const fn tables() -> [[Table; 4]; 4] {
    let mut tables = [[[0; 256]; 4]; 4];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = byte as u16;
        let mut following = 0;
        while following < 16 {
            let mut bit = 0;
            while bit < 8 {
                crc = (crc >> 1) ^ ((crc & 1) * 0xA001);
                bit += 1;
            }
            tables[following / 4][following % 4][byte] = crc;
            following += 1;
        }
        byte += 1;
    }
    tables
}

/// Takes `bytes` in by table: sixteen at once as long as there are so many, for
/// none of them waits for another, then four, then one. CONTRIBUTING.md says why this
/// is not the crate's table.
fn by_table(crc: u16, bytes: &[u8]) -> u16 {
    let [last, third, second, first] = &TABLES;
    let [single, ..] = last;
    let (sixteens, rest) = bytes.as_chunks::<16>();
    let crc = sixteens.iter().fold(crc, |crc, bytes| {
        let (fours, _) = bytes.as_chunks::<4>();
        let [a, b, c, d] = fours else { return crc };
        of_four(first, with(crc, a)) ^ of_four(second, *b) ^ of_four(third, *c) ^ of_four(last, *d)
    });
    let (fours, rest) = rest.as_chunks::<4>();
    let crc = fours
        .iter()
        .fold(crc, |crc, bytes| of_four(last, with(crc, bytes)));
    rest.iter()
        .fold(crc, |crc, byte| crc >> 8 ^ of(single, crc as u8 ^ byte))
}

/// Four bytes with the CRC of what was before them.
fn with(crc: u16, bytes: &[u8; 4]) -> [u8; 4] {
    (u32::from_le_bytes(*bytes) ^ u32::from(crc)).to_le_bytes()
}

/// What four bytes do to the CRC.
fn of_four(tables: &[Table; 4], bytes: [u8; 4]) -> u16 {
    let [last, third, second, first] = tables;
    let [a, b, c, d] = bytes;
    of(first, a) ^ of(second, b) ^ of(third, c) ^ of(last, d)
}

fn of(table: &Table, byte: u8) -> u16 {
    match table.get(usize::from(byte)) {
        Some(crc) => *crc,
        None => 0,
    }
}

/// Takes `bytes` in without a table, which would cost RAM on an AVR and half a
/// kilobyte of flash elsewhere, and without the crate's loop over bits, which
/// took a third of the time between a reply and the next request on an AVR:
/// eight steps at once, which come down to the parity of the byte and two shifts.
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

/// What [`Crc16::before`] gives, bit by bit.
#[inline(always)]
fn back_by_bits(mut crc: u16, byte: u8) -> u16 {
    for _ in 0..8 {
        let odd = crc & 0x8000 != 0;
        crc <<= 1;
        if odd {
            crc ^= 0x4003;
        }
    }
    crc ^ u16::from(byte)
}

/// What [`Crc16::before`] gives: [`by_parity`] the other way round, eight steps at once.
#[inline(always)]
fn back_by_parity(crc: u16, byte: u8) -> u16 {
    let [low, high] = crc.to_le_bytes();
    // The upper half is the Gray code of the byte that was shifted out, of its parity and
    // its upper seven bits. Its last bit is the parity of what that decodes to.
    let out = high ^ high >> 1;
    let out = out ^ out >> 2;
    let out = out ^ out >> 4;
    let pairs = high ^ high.rotate_left(4);
    let pairs = pairs ^ pairs >> 2;
    let out = out << 1 | (pairs & 1);
    let twice = out ^ out << 1;
    let low = low ^ high >> 7 ^ twice << 6;
    u16::from_le_bytes([out ^ byte, low])
}

/// The CRC with `bytes` taken in.
#[inline(always)]
fn update(crc: u16, bytes: &[u8]) -> u16 {
    if FIRMWARE {
        by_parity(crc, bytes)
    } else {
        by_table(crc, bytes)
    }
}

/// A CRC-16 that grows as bytes arrive.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Crc16(u16);

impl Crc16 {
    /// The CRC of no bytes.
    pub const START: Crc16 = Crc16(0xFFFF);

    /// What the bytes of a frame including its CRC leave, if that is right.
    pub const RESIDUE: Crc16 = Crc16(0);

    /// The CRC with `bytes` taken in as well.
    #[cfg_attr(target_os = "none", inline(never))]
    #[must_use]
    pub fn with(self, bytes: &[u8]) -> Crc16 {
        Crc16(update(self.0, bytes))
    }

    /// The CRC before `byte` was taken in, from the CRC with it. (What is fast is 40
    /// bytes more, and an AVR alone is too slow without.)
    #[inline(always)]
    #[must_use]
    pub fn before(self, byte: u8) -> Crc16 {
        if FIRMWARE && !cfg!(target_arch = "avr") {
            Crc16(back_by_bits(self.0, byte))
        } else {
            Crc16(back_by_parity(self.0, byte))
        }
    }

    /// How a CRC weighs behind so many bytes: see [`Crc16::since_start`].
    #[cfg_attr(target_os = "none", inline(never))]
    #[must_use]
    pub fn weight(bytes: u16) -> Crc16 {
        let first = Crc16(0x8000);
        (0..bytes * 8).fold(first, |weight, _| weight.shifted())
    }

    /// What a run of bytes that began with this CRC ends with, if the last of them
    /// are a frame with a right CRC; `weight` is that of the frame's length. (The CRC
    /// is linear: what came before is a difference, multiplied by the weight.)
    #[cfg_attr(target_os = "none", inline(never))]
    #[must_use]
    pub fn since_start(self, mut weight: Crc16) -> Crc16 {
        let mut difference = self.0 ^ Crc16::START.0;
        let mut product = 0;
        while difference != 0 {
            if difference & 0x8000 != 0 {
                product ^= weight.0;
            }
            difference <<= 1;
            weight = weight.shifted();
        }
        Crc16(product)
    }

    /// The CRC one bit later, the bit being 0.
    const fn shifted(self) -> Crc16 {
        Crc16(if self.0 & 1 != 0 {
            self.0 >> 1 ^ 0xA001
        } else {
            self.0 >> 1
        })
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

/// The CRC-16 of a function code and two words behind a unit, at little cost. Firmware,
/// where a table is too dear, has [`crc16`] alone.
#[inline]
pub fn crc16_of_six(bytes: [u8; 6]) -> Crc16 {
    let [last, [next, first, ..], ..] = &TABLES;
    let [a, b, rest @ ..] = bytes;
    let [low, high] = Crc16::START.to_bytes();
    Crc16(of(first, a ^ low) ^ of(next, b ^ high) ^ of_four(last, rest))
}

/// The LRC of `bytes`: what makes their sum zero.
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

    /// As the catalogue's polynomial has it. The crate reflects the initial
    /// value; reflecting it here as well cancels out.
    fn by_crate(crc: u16, bytes: &[u8]) -> u16 {
        const CRC: crc::Crc<u16> = crc::Crc::<u16>::new(&crc::CRC_16_MODBUS);
        let mut digest = CRC.digest_with_initial(crc.reverse_bits());
        digest.update(bytes);
        digest.finalize()
    }

    #[test]
    fn all_ways_agree_on_every_byte_and_running_value() {
        for crc in 0..=u16::MAX {
            let byte = [(crc >> 8) as u8 ^ 0x5A];
            assert_eq!(by_parity(crc, &byte), by_table(crc, &byte));
            assert_eq!(by_crate(crc, &byte), by_table(crc, &byte));
        }
        for byte in 0..=u8::MAX {
            assert_eq!(by_parity(0x1234, &[byte]), by_table(0x1234, &[byte]));
        }
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
        fn six_bytes_may_be_taken_in_at_once(bytes: [u8; 6]) {
            prop_assert_eq!(crc16_of_six(bytes), crc16(&bytes));
        }

        #[test]
        fn a_byte_can_be_taken_back(crc: u16, byte: u8) {
            let after = Crc16(crc).with(&[byte]);
            prop_assert_eq!(after.before(byte), Crc16(crc));
            prop_assert_eq!(back_by_bits(after.0, byte), crc);
            prop_assert_eq!(back_by_parity(after.0, byte), crc);
        }

        #[test]
        fn a_frame_is_known_by_the_crc_of_what_came_before(noise: std::vec::Vec<u8>, frame: std::vec::Vec<u8>) {
            let frame = frame.get(..250).unwrap_or(&frame);
            let before = crc16(&noise);
            let right = before.with(frame).with(&crc16(frame).to_bytes());
            let weight = Crc16::weight(frame.len() as u16 + 2);
            prop_assert_eq!(right, before.since_start(weight));
        }

        #[test]
        fn bytes_may_arrive_in_any_pieces(bytes: std::vec::Vec<u8>, cut: usize) {
            let (front, back) = bytes.split_at(cut % (bytes.len() + 1));
            let crc = Crc16::START.with(front).with(back);
            prop_assert_eq!(crc, crc16(&bytes));
            prop_assert_eq!(crc.0, by_parity(0xFFFF, &bytes));
            prop_assert_eq!(crc.0, by_crate(0xFFFF, &bytes));
        }
    }
}
