//! A value as a float of 64 bits, scaled and rounded once. Its bits are computed with integers,
//! for not every processor has arithmetic on floats.

use super::field::{DOUBLE, FLOAT, REGISTERS, TEXT};
use super::value::{scale, Words};
use crate::error::Error;

const SIGN: u64 = 1 << 63;
/// The exponent of infinity and of a NaN.
const MAX_EXPONENT: i32 = 0x7FF;
/// Added to the exponent of a float.
const BIAS: i32 = 1023;
/// The bits of a float's fraction.
const FRACTION: u32 = 52;
/// The exponent with which a significand of 1 is 1.
pub(super) const ONE: i32 = BIAS + FRACTION as i32;

/// The significand of a float and its exponent, without the sign; `None` for infinity and a NaN.
#[inline(always)]
pub(super) fn parts(bits: u64) -> Option<(u64, i32)> {
    let fraction = bits & ((1 << FRACTION) - 1);
    match (bits >> FRACTION) as i32 & MAX_EXPONENT {
        MAX_EXPONENT => None,
        0 => Some((fraction, 1)),
        exponent => Some((fraction | 1 << FRACTION, exponent)),
    }
}

impl Words<'_> {
    /// The bits of a value as a float of 64 bits: a bit, an integer or a float, multiplied and
    /// divided as the field says. The result is the float nearest to the exact value, and if
    /// two are equally near, the even one. For infinities and NaN only the sign of the scale
    /// counts.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for a text or for registers as they are.
    pub fn number(&self) -> Result<u64, Error> {
        let field = self.field;
        let (multiplier, divisor) = scale(field);
        let mut sign = if field.multiplier < 0 { SIGN } else { 0 };
        let (significand, exponent) = match field.value_type {
            TEXT | REGISTERS => return Err(Error::InvalidArgument),
            FLOAT | DOUBLE => {
                let bits = self.double()?;
                sign ^= bits & SIGN;
                match parts(bits) {
                    Some(parts) => parts,
                    None => return Ok(bits & !SIGN | sign),
                }
            }
            _ => {
                let (magnitude, is_below) = self.magnitude();
                if is_below {
                    sign ^= SIGN;
                }
                (magnitude, ONE)
            }
        };
        Ok(sign | quotient(significand, exponent, multiplier, divisor))
    }
}

/// The bits of the float nearest to a significand, multiplied and divided.
fn quotient(significand: u64, mut exponent: i32, multiplier: u32, divisor: u32) -> u64 {
    // 96 bits at most.
    let mut product = 0u128;
    for shift in (0..u32::BITS).rev() {
        product <<= 1;
        if multiplier >> shift & 1 != 0 {
            product += u128::from(significand);
        }
    }
    if product == 0 {
        return 0;
    }
    // Long division, until the quotient has two bits more than a significand.
    let (mut quotient, mut rest) = (0u64, 0u32);
    exponent += 96;
    while quotient >> (FRACTION + 2) == 0 {
        rest = rest << 1 | (product >> 95) as u32 & 1;
        product <<= 1;
        quotient <<= 1;
        if rest >= divisor {
            rest -= divisor;
            quotient |= 1;
        }
        exponent -= 1;
    }
    let mut is_more = rest != 0 || product << 32 != 0;
    // Two bits too many, and more of a number that is too small for its exponent.
    exponent += 2;
    let mut superfluous = 2;
    if exponent < 1 {
        superfluous = (3 - exponent).min(FRACTION as i32 + 5);
        exponent = 1;
    }
    for _ in 1..superfluous {
        is_more |= quotient & 1 != 0;
        quotient >>= 1;
    }
    let is_half = quotient & 1 != 0;
    quotient >>= 1;
    if is_half && (is_more || quotient & 1 != 0) {
        quotient += 1;
    }
    if exponent >= MAX_EXPONENT {
        return (MAX_EXPONENT as u64) << FRACTION;
    }
    // The highest bit of the significand adds 1 to the exponent.
    quotient + (((exponent - 1) as u64) << FRACTION)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::Field;
    use proptest::prelude::*;

    fn of_float(number: f64, multiplier: i32, divisor: i32) -> f64 {
        let bytes = number.to_be_bytes();
        let words: [u16; 4] =
            core::array::from_fn(|at| u16::from_be_bytes([bytes[2 * at], bytes[2 * at + 1]]));
        let field = Field {
            value_type: DOUBLE,
            multiplier,
            divisor,
            ..Field::NONE
        };
        let words = Words {
            words: &words,
            before: 0,
            field: &field,
        };
        f64::from_bits(words.number().expect("a number"))
    }

    #[test]
    fn a_scaled_float_is_that_of_the_processor() {
        let numbers = [
            0.0,
            1.0,
            0.1,
            1e300,
            f64::MAX,
            f64::MIN_POSITIVE,
            5e-324,
            1e-310,
            f64::INFINITY,
        ];
        for number in numbers.into_iter().flat_map(|number| [number, -number]) {
            for power in [1, 2, 1 << 20, 1 << 30] {
                let wide = f64::from(power);
                assert_eq!(
                    of_float(number, power, 0).to_bits(),
                    (number * wide).to_bits()
                );
                assert_eq!(
                    of_float(number, -power, 1).to_bits(),
                    (number * -wide).to_bits()
                );
                assert_eq!(
                    of_float(number, 1, power).to_bits(),
                    (number / wide).to_bits()
                );
            }
            for divisor in [3, 10, 1000, i32::MAX] {
                let wide = number / f64::from(divisor);
                assert_eq!(of_float(number, 0, divisor).to_bits(), wide.to_bits());
            }
            for multiplier in [3, 10, -1000, i32::MAX, i32::MIN] {
                let wide = number * f64::from(multiplier);
                assert_eq!(of_float(number, multiplier, 0).to_bits(), wide.to_bits());
            }
        }
        assert!(of_float(f64::NAN, 3, 7).is_nan());
    }

    proptest! {
        #[test]
        fn a_quotient_is_the_nearest_float(
            significand in any::<u64>(),
            less in 0u32..64,
            multiplier in 1u32..=1 << 31,
            divisor in 1u32..=i32::MAX as u32,
        ) {
            let significand = significand >> less;
            let bits = quotient(significand, ONE, multiplier, divisor);
            let product = u128::from(significand) * u128::from(multiplier);
            prop_assert_eq!(bits == 0, product == 0);
            if product > 0 {
                let fraction = bits & ((1 << FRACTION) - 1) | 1 << FRACTION;
                let exponent = (bits >> FRACTION) as i32 - ONE;
                let whole = u128::from(fraction) * u128::from(divisor);
                // The distance of the float and half of that to the next, both times divisor.
                let (distance, half) = if exponent < 0 {
                    ((product << -exponent).abs_diff(whole), u128::from(divisor))
                } else {
                    (product.abs_diff(whole << exponent), u128::from(divisor) << exponent)
                };
                prop_assert!(2 * distance <= half);
                prop_assert!(2 * distance < half || fraction.is_multiple_of(2));
            }
        }
    }
}
