//! Half floats, IEEE 754 binary16. They are converted as bits, without arithmetic on floats.

use crate::error::Error;

/// Difference of the exponents of binary32 and binary16.
const BIAS: u32 = 127 - 15;
/// The exponent of infinity and of a NaN in binary16, and in binary32.
const HALF_MAX: u32 = 0x1F;
const FLOAT_MAX: u32 = 0xFF;

/// The binary32 that equals a binary16, as bits. A NaN stays one.
pub fn to_float(half: u16) -> u32 {
    let half = u32::from(half);
    let sign = (half & 0x8000) << 16;
    let mut fraction = half & 0x3FF;
    let exponent = match half >> 10 & HALF_MAX {
        HALF_MAX => FLOAT_MAX,
        0 if fraction == 0 => 0,
        0 => {
            let mut exponent = BIAS + 1;
            while fraction & 0x400 == 0 {
                fraction <<= 1;
                exponent -= 1;
            }
            fraction &= 0x3FF;
            exponent
        }
        exponent => exponent + BIAS,
    };
    sign | exponent << 23 | fraction << 13
}

/// The binary16 nearest to a binary32, both as bits; of two that are equally near the even one.
///
/// # Errors
/// [`Error::OutOfRange`] for a number of 65520 or more, which would become infinite, and for
/// one that is not 0 but would become 0.
pub fn from_float(bits: u32) -> Result<u16, Error> {
    let sign = (bits >> 16 & 0x8000) as u16;
    let exponent = bits >> 23 & FLOAT_MAX;
    let fraction = bits & 0x007F_FFFF;
    if exponent == FLOAT_MAX {
        let quiet = if fraction == 0 { 0 } else { 0x200 };
        return Ok(sign | (HALF_MAX << 10) as u16 | (fraction >> 13) as u16 | quiet);
    }
    if exponent >= BIAS + HALF_MAX {
        return Err(Error::OutOfRange);
    }
    let (whole, lost) = if exponent > BIAS {
        ((exponent - BIAS) << 23 | fraction, 13)
    } else {
        // The result is subnormal: the hidden bit moves into the fraction.
        let hidden = if exponent == 0 { 0 } else { 0x0080_0000 };
        (fraction | hidden, (BIAS + 14 - exponent).min(31))
    };
    let (mut kept, rest) = (whole >> lost, whole & ((1 << lost) - 1));
    let half = 1 << (lost - 1);
    if rest > half || rest == half && kept & 1 == 1 {
        // A carry out of the fraction increases the exponent.
        kept += 1;
    }
    if kept >= HALF_MAX << 10 || kept == 0 && (exponent | fraction) != 0 {
        return Err(Error::OutOfRange);
    }
    Ok(sign | kept as u16)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The value of the bits of a half, by the formula of IEEE 754.
    fn value(half: u16) -> f64 {
        let sign = if half & 0x8000 == 0 { 1.0 } else { -1.0 };
        let (exponent, fraction) = (i32::from(half >> 10 & 31), f64::from(half & 0x3FF));
        sign * if exponent == 0 {
            fraction * 2f64.powi(-24)
        } else {
            (1024.0 + fraction) * 2f64.powi(exponent - 25)
        }
    }

    #[test]
    fn every_half_is_a_float_and_back() {
        for half in 0..=u16::MAX {
            let float = f32::from_bits(to_float(half));
            if half & 0x7C00 == 0x7C00 {
                assert_eq!(float.is_nan(), half & 0x3FF != 0);
                let back = from_float(to_float(half));
                // A NaN becomes a quiet one.
                let quiet = if float.is_nan() { 0x200 } else { 0 };
                assert_eq!(back, Ok(half | quiet));
                continue;
            }
            assert_eq!(f64::from(float), value(half));
            assert_eq!(from_float(float.to_bits()), Ok(half));
        }
    }

    #[test]
    fn the_numbers_of_ieee_754_are_as_published() {
        for (half, float) in [
            (0x3C00, 1.0),
            (0xC000, -2.0),
            (0x7BFF, 65504.0),
            (0x0400, 6.103_515_6e-5),
            (0x0001, 5.960_464_5e-8),
            (0x3555, 0.333_251_95),
            (0x4248, 3.140_625),
        ] {
            assert_eq!(f32::from_bits(to_float(half)), float);
            assert_eq!(from_float(float.to_bits()), Ok(half));
        }
    }

    #[test]
    fn a_float_becomes_the_nearest_half() {
        // Of each two neighbours: what is nearer, and in the middle the even one.
        for half in 0..0x7BFF_u16 {
            let (low, high) = (value(half), value(half + 1));
            let middle = ((low + high) / 2.0) as f32;
            let even = if half.is_multiple_of(2) {
                half
            } else {
                half + 1
            };
            let below = f32::from_bits(middle.to_bits() - 1);
            let above = f32::from_bits(middle.to_bits() + 1);
            assert_eq!(from_float(above.to_bits()), Ok(half + 1));
            if half == 0 {
                assert_eq!(from_float(middle.to_bits()), Err(Error::OutOfRange));
                continue;
            }
            assert_eq!(from_float(middle.to_bits()), Ok(even));
            assert_eq!(from_float(below.to_bits()), Ok(half));
            assert_eq!(from_float((-below).to_bits()), Ok(half | 0x8000));
        }
    }

    #[test]
    fn a_float_that_no_half_is_near_is_refused() {
        for float in [
            65520.0_f32,
            -65520.0,
            1e30,
            f32::MAX,
            1e-8,
            -1e-8,
            f32::from_bits(1),
        ] {
            assert_eq!(from_float(float.to_bits()), Err(Error::OutOfRange));
        }
        assert_eq!(from_float(65519.0_f32.to_bits()), Ok(0x7BFF));
        assert_eq!(from_float((-0.0_f32).to_bits()), Ok(0x8000));
    }
}
