//! Decimal digits in registers: BCD, with four digits in a register as four bits each, and
//! Schneider's modulo 10000 (M10K, Mod10), with four digits in a register as one number.

use super::arithmetic::{divide_small, times_small};
use crate::error::Error;

/// The number of 8 digits of BCD.
///
/// # Errors
/// [`Error::MalformedValue`] for a digit above 9.
pub fn from_bcd(raw: u32) -> Result<u32, Error> {
    let mut number = 0;
    for nth in (0..8).rev() {
        let digit = raw >> (4 * nth) & 15;
        if digit > 9 {
            return Err(Error::MalformedValue);
        }
        number = number * 10 + digit;
    }
    Ok(number)
}

/// A number as `digits` digits of BCD, at most 8.
///
/// # Errors
/// [`Error::OutOfRange`] for a number with more digits.
pub fn to_bcd(number: u32, digits: u32) -> Result<u32, Error> {
    let (mut left, mut raw) = (number, 0);
    for nth in 0..digits.min(8) {
        raw |= (left % 10) << (4 * nth);
        left /= 10;
    }
    if left > 0 {
        return Err(Error::OutOfRange);
    }
    Ok(raw)
}

/// The most that a register of modulo 10000 holds, and one more.
const M10K: u16 = 10_000;

/// The number of `count` registers of modulo 10000, each 0 to 9999.
///
/// # Errors
/// [`Error::MalformedValue`] for a register above 9999.
pub fn from_m10k(raw: u64, count: u16) -> Result<u64, Error> {
    number_of(raw, count, |part| part < M10K)
}

/// The number of `count` registers of modulo 10000, each -9999 to 9999 in two's complement.
///
/// # Errors
/// [`Error::MalformedValue`] for a register beyond that.
pub fn from_signed_m10k(raw: u64, count: u16) -> Result<i64, Error> {
    let is_right = |part: u16| part.cast_signed().unsigned_abs() < M10K;
    number_of(raw, count, is_right).map(u64::cast_signed)
}

/// The number of `count` registers, in two's complement, if all of them are right.
#[inline(always)]
fn number_of(raw: u64, count: u16, is_right: impl Fn(u16) -> bool) -> Result<u64, Error> {
    let (mut number, mut left) = (0u64, raw);
    for _ in count..4 {
        left <<= 16;
    }
    for _ in 0..count {
        let part = (left >> 48) as u16;
        left <<= 16;
        if !is_right(part) {
            return Err(Error::MalformedValue);
        }
        number = times_small(number, M10K).0;
        number = number.wrapping_add(i64::from(part.cast_signed()).cast_unsigned());
    }
    Ok(number)
}

/// A number in `count` registers of modulo 10000.
///
/// # Errors
/// [`Error::OutOfRange`] for a number with more than four digits for each register.
pub fn to_m10k(number: u64, count: u16) -> Result<u64, Error> {
    let (mut left, mut words) = (number, [0; 4]);
    for word in words.iter_mut().take(count.into()) {
        (left, *word) = divide_small(left, M10K);
    }
    if left > 0 {
        return Err(Error::OutOfRange);
    }
    Ok(joined(words))
}

/// Four registers, the lowest first, as one number.
fn joined(words: [u16; 4]) -> u64 {
    let mut raw = 0;
    for word in words.iter().rev() {
        raw = raw << 16 | u64::from(*word);
    }
    raw
}

/// As [`to_m10k`], for a number with a sign, which each register has that is not 0.
///
/// # Errors
/// As [`to_m10k`].
pub fn to_signed_m10k(number: i64, count: u16) -> Result<u64, Error> {
    let raw = to_m10k(number.unsigned_abs(), count)?;
    if number >= 0 {
        return Ok(raw);
    }
    let (mut left, mut words) = (raw, [0; 4]);
    for word in &mut words {
        *word = (left as u16).wrapping_neg();
        left >>= 16;
    }
    Ok(joined(words))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_register_of_bcd_is_a_number_or_refused() {
        let mut numbers = 0;
        for raw in 0..=0xFFFF {
            let digits = [raw >> 12, raw >> 8 & 15, raw >> 4 & 15, raw & 15];
            if digits.iter().any(|digit| *digit > 9) {
                assert_eq!(from_bcd(raw), Err(Error::MalformedValue));
                continue;
            }
            let number = digits.iter().fold(0, |sum, digit| sum * 10 + digit);
            assert_eq!(from_bcd(raw), Ok(number));
            assert_eq!(to_bcd(number, 4), Ok(raw));
            numbers += 1;
        }
        assert_eq!(numbers, 10_000);
        assert_eq!(to_bcd(10_000, 4), Err(Error::OutOfRange));
    }

    #[test]
    fn eight_digits_of_bcd_are_two_registers() {
        assert_eq!(from_bcd(0x1234_5678), Ok(12_345_678));
        assert_eq!(to_bcd(99_999_999, 8), Ok(0x9999_9999));
        assert_eq!(to_bcd(100_000_000, 8), Err(Error::OutOfRange));
        assert_eq!(from_bcd(0xA000_0000), Err(Error::MalformedValue));
        assert_eq!(from_bcd(0x0000_000F), Err(Error::MalformedValue));
    }

    #[test]
    fn a_register_of_modulo_10000_holds_four_digits() {
        // The energy of a PM710: 0108 18D4 002B 0000, the lowest register first.
        assert_eq!(from_m10k(0x0000_002B_18D4_0108, 4), Ok(4_363_560_264));
        assert_eq!(to_m10k(4_363_560_264, 4), Ok(0x0000_002B_18D4_0108));
        assert_eq!(from_m10k(0x270F_270F, 2), Ok(99_999_999));
        assert_eq!(to_m10k(100_000_000, 2), Err(Error::OutOfRange));
        assert_eq!(from_m10k(0x2710_0000, 2), Err(Error::MalformedValue));
        assert_eq!(from_m10k(0x0000_FFFF, 2), Err(Error::MalformedValue));
        assert_eq!(to_m10k(9_999_999_999_999_999, 4), Ok(0x270F_270F_270F_270F));
    }

    #[test]
    fn each_register_of_modulo_10000_has_the_sign() {
        // -123456789 is -1, -2345, -6789.
        let raw = 0xFFFF_F6D7_E57B;
        assert_eq!(from_signed_m10k(raw, 3), Ok(-123_456_789));
        assert_eq!(to_signed_m10k(-123_456_789, 3), Ok(raw));
        assert_eq!(to_signed_m10k(-10_000, 2), Ok(0xFFFF_0000));
        assert_eq!(from_signed_m10k(0xD8F0_0000, 2), Err(Error::MalformedValue));
        assert_eq!(from_signed_m10k(0x8000, 1), Err(Error::MalformedValue));
        assert_eq!(to_signed_m10k(-100_000_000, 2), Err(Error::OutOfRange));
        assert_eq!(to_signed_m10k(i64::MIN, 4), Err(Error::OutOfRange));
    }
}
