//! Coils and discrete inputs. They are packed with the least significant bit first, so 16
//! of them fill a word with its low byte first.

use crate::error::Error;

/// Writes the bits of `words` as data bytes, and sets the unused bits of the last byte to
/// zero. Bytes beyond the last word do not change.
// For the C API; it may change in any version.
#[doc(hidden)]
pub fn send(bytes: &mut [u8], words: &[u16], quantity: u8) {
    for (pair, word) in bytes.chunks_mut(2).zip(words) {
        for (byte, half) in pair.iter_mut().zip(word.to_le_bytes()) {
            *byte = half;
        }
    }
    if let Some(last) = bytes.last_mut() {
        *last &= mask(quantity & 7) as u8;
    }
}

/// Fills `words` from data bytes, and sets the unused bits of the last word to zero.
// For the C API; it may change in any version.
#[doc(hidden)]
pub fn take(words: &mut [u16], bytes: &[u8], quantity: u8) {
    for (word, pair) in words.iter_mut().zip(bytes.chunks(2)) {
        *word = pair
            .iter()
            .rfold(0, |high, byte| high << 8 | u16::from(*byte));
    }
    if let Some(last) = words.last_mut() {
        *last &= mask(quantity & 15);
    }
}

/// The data byte of up to eight coils.
pub(crate) fn byte_of(coils: &[bool]) -> u8 {
    let coils = coils.iter().rev();
    coils.fold(0, |byte, on| byte << 1 | u8::from(*on))
}

/// Fills `coils` from data bytes. Coils beyond the last byte do not change.
pub(crate) fn take_coils(coils: &mut [bool], bytes: &[u8]) {
    for (coils, byte) in coils.chunks_mut(8).zip(bytes) {
        for (bit, coil) in coils.iter_mut().enumerate() {
            *coil = byte.bit(bit);
        }
    }
}

/// A mask of the `used` lowest bits, for the last byte or word; all bits if `used` is 0.
const fn mask(used: u8) -> u16 {
    match used {
        0 => 0xFFFF,
        used => (1 << used) - 1,
    }
}

/// A unit that holds packed bits: a data byte, or a word as the master stores them.
///
/// ```
/// use mbm::data::bits::Packed;
///
/// assert!(0b100_u8.bit(2));
/// assert_eq!(0b100_u16.with_bit(0, true), 0b101);
/// ```
pub trait Packed: Copy {
    /// Number of bits in it.
    const BITS: usize;
    /// All bits clear.
    const ZERO: Self;

    /// True if bit `bit` is set; bit 0 is the least significant.
    fn bit(self, bit: usize) -> bool;

    /// A copy with bit `bit` set or cleared.
    fn with_bit(self, bit: usize, on: bool) -> Self;
}

macro_rules! packed {
    ($($unit:ident)*) => {
        $(impl Packed for $unit {
            const BITS: usize = $unit::BITS as usize;
            const ZERO: Self = 0;

            fn bit(self, bit: usize) -> bool {
                self >> (bit % <Self as Packed>::BITS) & 1 != 0
            }

            fn with_bit(self, bit: usize, on: bool) -> Self {
                let mask = 1 << (bit % <Self as Packed>::BITS);
                if on {
                    self | mask
                } else {
                    self & !mask
                }
            }
        })*
    };
}

packed!(u8 u16);

/// Packs `bits` into `units` from the first on, and sets the unused bits of the last
/// unit to zero. Units after it do not change.
///
/// # Errors
/// [`Error::BufferTooSmall`] if `units` cannot hold all bits; nothing is packed then.
///
/// ```
/// let mut bytes = [0xFF_u8; 2];
/// mbm::data::bits::pack(&mut bytes, [true, false, true].into_iter())?;
/// // The unused bits of the last byte are off, and the byte after it does not change.
/// assert_eq!(bytes, [0b101, 0xFF]);
/// # Ok::<(), mbm::Error>(())
/// ```
pub fn pack<T: Packed>(
    units: &mut [T],
    bits: impl ExactSizeIterator<Item = bool>,
) -> Result<(), Error> {
    let used = units
        .get_mut(..bits.len().div_ceil(T::BITS))
        .ok_or(Error::BufferTooSmall)?;
    let mut bits = bits.fuse();
    for unit in used {
        *unit = T::ZERO;
        for (place, on) in (0..T::BITS).zip(&mut bits) {
            *unit = unit.with_bit(place, on);
        }
    }
    Ok(())
}

/// The first `quantity` bits of `units`.
///
/// # Errors
/// [`Error::IllegalDataAddress`] if `units` holds fewer bits.
///
/// ```
/// let coils: Vec<bool> = mbm::data::bits::unpack(&[0b101_u8], 3)?.collect();
/// assert_eq!(coils, [true, false, true]);
/// # Ok::<(), mbm::Error>(())
/// ```
pub fn unpack<T: Packed>(
    units: &[T],
    quantity: usize,
) -> Result<impl Iterator<Item = bool> + '_, Error> {
    let used = units
        .get(..quantity.div_ceil(T::BITS))
        .ok_or(Error::IllegalDataAddress)?;
    Ok(used
        .iter()
        .flat_map(|unit| (0..T::BITS).map(|place| unit.bit(place)))
        .take(quantity))
}

/// The index of the coil `address` among `quantity` coils that begin at `first`.
fn place(first: u16, quantity: u16, address: u16) -> Result<usize, Error> {
    match address.checked_sub(first) {
        // The last address is 65535; the coils must not go beyond it.
        Some(place) if place < quantity && quantity - 1 <= u16::MAX - first => Ok(place.into()),
        _ => Err(Error::IllegalDataAddress),
    }
}

/// True if the coil `address` is set. `units` holds `quantity` coils that begin at `first`.
///
/// # Errors
/// [`Error::IllegalDataAddress`] if the coil is not one of these.
///
/// ```
/// // Ten coils from address 20 on, in the words of a master.
/// let words = [0b10_0000_0001_u16];
/// assert!(mbm::data::bits::is_set(&words, 20, 10, 29)?);
/// assert!(mbm::data::bits::is_set(&words, 20, 10, 30).is_err());
/// # Ok::<(), mbm::Error>(())
/// ```
pub fn is_set<T: Packed>(
    units: &[T],
    first: u16,
    quantity: u16,
    address: u16,
) -> Result<bool, Error> {
    let place = place(first, quantity, address)?;
    let unit = units.get(place / T::BITS);
    Ok(unit.ok_or(Error::IllegalDataAddress)?.bit(place))
}

/// Switches the coil `address` on or off. `units` holds `quantity` coils that begin at
/// `first`.
///
/// # Errors
/// [`Error::IllegalDataAddress`] if the coil is not one of these; nothing is changed
/// then.
///
/// ```
/// let mut words = [0_u16];
/// mbm::data::bits::set(&mut words, 20, 10, 29, true)?;
/// assert_eq!(words, [0b10_0000_0000]);
/// # Ok::<(), mbm::Error>(())
/// ```
pub fn set<T: Packed>(
    units: &mut [T],
    first: u16,
    quantity: u16,
    address: u16,
    on: bool,
) -> Result<(), Error> {
    let place = place(first, quantity, address)?;
    let unit = units
        .get_mut(place / T::BITS)
        .ok_or(Error::IllegalDataAddress)?;
    *unit = unit.with_bit(place, on);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_fill_a_word_low_byte_first() {
        let words = [0x0201, 0x0003];
        let mut sent = [0; 3];
        send(&mut sent, &words, 24);
        assert_eq!(sent, [1, 2, 3]);
        let mut back = [0xFFFF; 2];
        take(&mut back, &sent, 24);
        assert_eq!(back, words);
    }

    #[test]
    fn the_mask_keeps_the_used_bits() {
        assert_eq!(mask(1), 0x01);
        assert_eq!(mask(7), 0x7F);
        assert_eq!(mask(0) as u8, 0xFF);
        assert_eq!(mask(17 & 15), 0x01);
    }

    // The example of V1.1b3, 6.1: coils 20 to 38, which have the addresses 19 to 37.
    const COILS: [u8; 3] = [0xCD, 0x6B, 0x05];

    #[test]
    fn a_coil_is_found_by_its_address() {
        for (address, on) in [
            (19, true),
            (20, false),
            (22, true),
            (26, true),
            (27, true),
            (29, false),
            (30, true),
            (35, true),
            (36, false),
            (37, true),
        ] {
            assert_eq!(is_set(&COILS, 19, 19, address), Ok(on), "{address}");
            let words = [0x6BCD_u16, 0x0005];
            assert_eq!(is_set(&words, 19, 19, address), Ok(on), "{address}");
        }
    }

    #[test]
    fn a_coil_outside_the_range_is_an_illegal_data_address() {
        let none = Err(Error::IllegalDataAddress);
        for address in [0, 18, 38, 39, 65535] {
            assert_eq!(is_set(&COILS, 19, 19, address), none);
            assert_eq!(
                set(&mut COILS.clone(), 19, 19, address, true),
                none.map(|_| ())
            );
        }
        // A quantity beyond the bytes, a quantity beyond address 65535, a quantity of 0.
        assert_eq!(is_set(&COILS, 0, 25, 24), none);
        assert_eq!(is_set(&COILS, 65535, 2, 65535), none);
        assert_eq!(is_set(&COILS, 65535, 1, 65535), Ok(true));
        assert_eq!(is_set(&COILS, 0, 0, 0), none);
    }

    #[test]
    fn setting_a_coil_does_not_change_the_others() {
        let mut coils = COILS;
        assert_eq!(set(&mut coils, 19, 19, 20, true), Ok(()));
        assert_eq!(set(&mut coils, 19, 19, 37, false), Ok(()));
        assert_eq!(coils, [0xCF, 0x6B, 0x01]);
    }

    #[test]
    fn bits_are_packed_lowest_first_and_unused_bits_are_zero() {
        let coils = [1, 0, 1, 1, 0, 0, 1, 1, 1, 0].map(|coil| coil == 1);
        let mut bytes = [0xFF_u8; 3];
        assert_eq!(pack(&mut bytes, coils.into_iter()), Ok(()));
        assert_eq!(bytes, [0xCD, 0x01, 0xFF]);
        let mut words = [0xFFFF_u16; 2];
        assert_eq!(pack(&mut words, coils.into_iter()), Ok(()));
        assert_eq!(words, [0x01CD, 0xFFFF]);
        assert!(unpack(&bytes, 10).unwrap().eq(coils));
        assert!(unpack(&words, 10).unwrap().eq(coils));
    }

    #[test]
    fn bits_that_do_not_fit_are_not_packed() {
        let mut bytes = [0xFF_u8];
        let status = pack(&mut bytes, [false; 9].into_iter());
        assert_eq!((status, bytes), (Err(Error::BufferTooSmall), [0xFF]));
        assert_eq!(unpack(&bytes, 9).err(), Some(Error::IllegalDataAddress));
    }
}
