//! Numbers of one, two or four registers. Floats are copied as bits, without arithmetic.

use super::order::{byte_of, set_byte_of, Order};
use crate::error::Error;

/// A number of one, two or four registers.
///
/// ```
/// use mbm::data::value::Value;
/// use mbm::data::{Order, Registers};
///
/// /// A temperature, of which a device sends tenths of a degree.
/// #[derive(Clone, Copy, PartialEq, Debug)]
/// struct Tenths(i16);
///
/// impl Value for Tenths {
///     type Bytes = [u8; 2];
///
///     fn from_bytes(bytes: [u8; 2]) -> Self {
///         Tenths(i16::from_be_bytes(bytes))
///     }
///
///     fn to_bytes(self) -> [u8; 2] {
///         self.0.to_be_bytes()
///     }
/// }
///
/// let response = Registers::new(&[215_u16][..], 107, Order::Abcd)?;
/// assert_eq!(response.get(107), Ok(Tenths(215)));
/// # Ok::<(), mbm::Error>(())
/// ```
pub trait Value: Copy {
    /// An array of its bytes, the most significant first.
    type Bytes: Copy + Default + AsRef<[u8]> + AsMut<[u8]>;

    /// The number that has these bytes.
    fn from_bytes(bytes: Self::Bytes) -> Self;

    /// The bytes of this number.
    fn to_bytes(self) -> Self::Bytes;

    /// The number in the first of `words`, as a device with that order sends it.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`] if there are too few words.
    ///
    /// ```
    /// use mbm::data::{Order, Value};
    ///
    /// let words = [0x8000, 0x4366];
    /// assert_eq!(f32::from_words(&words, Order::Cdab)?, 230.5);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    fn from_words(words: &[u16], order: Order) -> Result<Self, Error> {
        let mut bytes = Self::Bytes::default();
        let mask = order.mask(bytes.as_ref().len());
        for (place, byte) in bytes.as_mut().iter_mut().enumerate() {
            *byte = byte_of(words, place ^ mask).ok_or(Error::IllegalDataAddress)?;
        }
        Ok(Self::from_bytes(bytes))
    }

    /// Writes this number into the first of `words`, as [`Value::from_words`] reads it.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`] if there are too few words; nothing is written then.
    ///
    /// ```
    /// use mbm::data::{Order, Value};
    ///
    /// let mut words = [0; 2];
    /// 230.5_f32.to_words(&mut words, Order::Cdab)?;
    /// assert_eq!(words, [0x8000, 0x4366]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    fn to_words(self, words: &mut [u16], order: Order) -> Result<(), Error> {
        let bytes = self.to_bytes();
        let bytes = bytes.as_ref();
        if words.len() < bytes.len().div_ceil(2) {
            return Err(Error::IllegalDataAddress);
        }
        let mask = order.mask(bytes.len());
        for (place, byte) in bytes.iter().enumerate() {
            set_byte_of(words, place ^ mask, *byte);
        }
        Ok(())
    }
}

macro_rules! values {
    ($($number:ident)*) => {
        $(impl Value for $number {
            type Bytes = [u8; size_of::<$number>()];

            fn from_bytes(bytes: Self::Bytes) -> Self {
                $number::from_be_bytes(bytes)
            }

            fn to_bytes(self) -> Self::Bytes {
                self.to_be_bytes()
            }
        })*
    };
}

values!(u16 i16 u32 i32 u64 i64 f32 f64);

/// An IEEE 754 binary64 in four registers, which the machine holds as a binary32. On an
/// AVR, `double` in C is such a number.
///
/// ```
/// use mbm::data::value::ShortDouble;
/// use mbm::data::{Order, Registers};
///
/// let response = Registers::new(&[0x3FF8_u16, 0, 0, 0][..], 107, Order::Abcd)?;
/// assert_eq!(response.get::<ShortDouble>(107)?.0, 1.5);
/// # Ok::<(), mbm::Error>(())
/// ```
#[repr(transparent)]
#[derive(Clone, Copy, Debug)]
pub struct ShortDouble(pub f32);

impl Value for ShortDouble {
    type Bytes = [u8; 8];

    fn from_bytes(bytes: [u8; 8]) -> Self {
        let [a, b, c, d, e, f, g, h] = bytes;
        let high = u32::from_be_bytes([a, b, c, d]);
        let low = u32::from_be_bytes([e, f, g, h]);
        ShortDouble(f32::from_bits(narrow(high, low)))
    }

    fn to_bytes(self) -> [u8; 8] {
        let (high, low) = widen(self.0.to_bits());
        let ([a, b, c, d], [e, f, g, h]) = (high.to_be_bytes(), low.to_be_bytes());
        [a, b, c, d, e, f, g, h]
    }
}

/// Difference of the exponents of binary64 and binary32.
const BIAS: u32 = 1023 - 127;
/// The exponent of infinity and NaN in binary64, and in binary32.
const WIDE_MAX: u32 = 0x7FF;
const SHORT_MAX: u32 = 0xFF;
/// The highest bit of a binary32's significand. It is not stored.
const HIDDEN: u32 = 1 << 23;

/// Rounds a binary64 to the nearest binary32, ties to even. Both are given as bits.
fn narrow(high: u32, low: u32) -> u32 {
    let sign = high & 0x8000_0000;
    let exponent = high >> 20 & WIDE_MAX;
    // 23 bits of the fraction, and the 29 below them.
    let fraction = (high & 0x000F_FFFF) << 3 | low >> 29;
    let below = low << 3;
    if exponent == WIDE_MAX {
        let is_number = fraction == 0 && below == 0;
        let quiet = if is_number { 0 } else { HIDDEN >> 1 };
        return sign | SHORT_MAX << 23 | fraction | quiet;
    }
    let mut kept = fraction;
    let mut lost = below;
    if exponent > BIAS {
        if exponent >= BIAS + SHORT_MAX {
            return sign | SHORT_MAX << 23;
        }
        kept |= (exponent - BIAS) << 23;
    } else {
        // The result is subnormal: the hidden bit moves into the fraction.
        kept |= HIDDEN;
        let mut more = BIAS + 1 - exponent;
        if more > 25 {
            return sign;
        }
        while more > 0 {
            // The lowest bit of `lost` stays set once any bit below it was set.
            lost = (kept & 1) << 31 | lost >> 1 | u32::from(lost & 1 != 0);
            kept >>= 1;
            more -= 1;
        }
    }
    let half = 0x8000_0000;
    let up = lost > half || lost == half && kept & 1 == 1;
    // A carry out of the fraction increases the exponent, up to infinity.
    sign | (kept + u32::from(up))
}

/// The binary64 that equals a binary32, as bits in two words, the high word first.
fn widen(bits: u32) -> (u32, u32) {
    let sign = bits & 0x8000_0000;
    let mut fraction = bits & (HIDDEN - 1);
    let exponent = match bits >> 23 & SHORT_MAX {
        SHORT_MAX => WIDE_MAX,
        0 if fraction == 0 => 0,
        0 => {
            let mut exponent = BIAS + 1;
            while fraction & HIDDEN == 0 {
                fraction <<= 1;
                exponent -= 1;
            }
            fraction &= HIDDEN - 1;
            exponent
        }
        exponent => exponent + BIAS,
    };
    (sign | exponent << 20 | fraction >> 3, fraction << 29)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn narrowed(value: f64) -> u32 {
        ShortDouble::from_bytes(value.to_be_bytes()).0.to_bits()
    }

    #[test]
    fn a_double_becomes_the_nearest_float() {
        let next = |bits: u64| f64::from_bits(bits);
        for value in [
            0.0,
            -0.0,
            1.0,
            230.1,
            -1e-3,
            f64::from(f32::MAX),
            3.402_823_567e38,
            f64::MAX,
            f64::MIN_POSITIVE,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::from(f32::MIN_POSITIVE),
            // The smallest binary32, half of it, a little more than half, three halves, a
            // quarter.
            next(0x36A0_0000_0000_0000),
            next(0x3690_0000_0000_0000),
            next(0x3690_0000_0000_0001),
            next(0x36A8_0000_0000_0000),
            next(0x3680_0000_0000_0000),
            // A tie that rounds down, one that rounds up, and a fraction with all bits set.
            next(0x3FF0_0000_1000_0000),
            next(0x3FF0_0000_3000_0000),
            next(0x3FFF_FFFF_FFFF_FFFF),
            next(0x380F_FFFF_FFFF_FFFF),
            next(0x47EF_FFFF_F000_0000),
        ] {
            assert_eq!(narrowed(value), (value as f32).to_bits(), "{value:e}");
        }
    }

    #[test]
    fn a_double_that_is_nan_becomes_a_float_that_is_nan() {
        for bits in [0x7FF0_0000_0000_0001, 0x7FF8_0000_0000_0000, u64::MAX] {
            assert!(f32::from_bits(narrowed(f64::from_bits(bits))).is_nan());
        }
    }

    #[test]
    fn a_float_becomes_the_double_that_it_equals() {
        let smallest = f32::from_bits(1);
        for value in [
            0.0,
            -0.0,
            1.0,
            -230.1,
            f32::MAX,
            f32::MIN_POSITIVE,
            smallest,
            f32::INFINITY,
        ] {
            let wide = f64::from_be_bytes(ShortDouble(value).to_bytes());
            assert_eq!(wide.to_bits(), f64::from(value).to_bits());
        }
        assert!(f64::from_be_bytes(ShortDouble(f32::NAN).to_bytes()).is_nan());
    }
}
