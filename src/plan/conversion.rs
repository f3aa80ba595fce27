//! Values that are more than the number in the registers and a fraction: with an offset, with a
//! power of ten that the device has in another field, and not there at all.
//!
//! value = number * multiplier / divisor * 10^power + offset

use super::field::{Field, DOUBLE, FLOAT, INT32, TEXT};
use super::number::{parts, ONE};
use super::value::{scale, signed, Words};
use super::wide::Wide;
use crate::data::arithmetic::times_small;
use crate::error::Error;

/// The greatest power of ten, and the least without its sign: those of SunSpec.
pub const GREATEST_POWER: u8 = 10;
/// The most decimals of an offset.
pub const MOST_DECIMALS: u8 = 9;

/// What the numbers of a field mean, beyond its multiplier and divisor.
///
/// ```
/// use mbm::plan::field::{HOLDING_REGISTERS, UINT16};
/// use mbm::plan::{value::Words, Conversion, Field};
///
/// // A temperature in tenths of a degree, above -40 degrees; FFFF (hex) if the sensor is broken.
/// let field = Field {
///     unit: 17, table: HOLDING_REGISTERS, value_type: UINT16, divisor: 10, interval_ms: 1000, ..Field::NONE
/// };
/// let conversion = Conversion { not_available: &[0xFFFF], offset: -40, ..Conversion::default() };
/// let value = |word: &[u16]| Words { words: word, before: 0, field: &field }.decimal(&conversion, 0, 1);
/// assert_eq!(value(&[615]), Ok(215));
/// assert_eq!(value(&[0xFFFF]), Err(mbm::Error::NotAvailable));
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Conversion<'a> {
    /// The numbers that mean "not available", as bits: each has as many words as a value has
    /// registers, the most significant first.
    pub not_available: &'a [u16],
    /// True if the number that SunSpec reserves in the type means "not available".
    pub is_standard: bool,
    /// Is added, times 10^-`offset_decimals`.
    pub offset: i32,
    /// At most [`MOST_DECIMALS`].
    pub offset_decimals: u8,
}

/// The power of ten that a field holds.
///
/// # Errors
/// [`Error::NotAvailable`] if the number is not -10 to 10, as the one with which a device says
/// that it has none; [`Error::InvalidArgument`] if the field has no integer.
///
/// ```
/// use mbm::plan::field::{HOLDING_REGISTERS, INT16};
/// use mbm::plan::{conversion::power, value::Words, Field};
///
/// let scale = Field { table: HOLDING_REGISTERS, value_type: INT16, ..Field::NONE };
/// let words = Words { words: &[0xFFFE], before: 0, field: &scale };
/// assert_eq!(power(&words), Ok(-2));
/// ```
pub fn power(words: &Words) -> Result<i8, Error> {
    if !words.field.is_integer() {
        return Err(Error::InvalidArgument);
    }
    let (magnitude, is_below) = words.magnitude();
    if magnitude > GREATEST_POWER.into() {
        return Err(Error::NotAvailable);
    }
    let power = magnitude as i8;
    Ok(if is_below { -power } else { power })
}

/// The bits that SunSpec reserves in a type of integers for "not available": in two's complement
/// the least number, else the greatest.
fn reserved(field: &Field) -> u64 {
    let (mut highest, mut greatest) = (1 << 15, 0xFFFF);
    for _ in 1..1 << field.value_shift() {
        highest <<= 16;
        greatest = greatest << 16 | 0xFFFF;
    }
    if field.is_signed() {
        highest
    } else {
        greatest
    }
}

impl Words<'_> {
    /// Whether the value is available: [`Ok`], or [`Error::NotAvailable`]. A float that is not a
    /// number never is. Of a text, and of registers as they are, only `is_standard` counts: it
    /// is not available if all its registers are 0.
    ///
    /// # Errors
    /// [`Error::NotAvailable`]
    pub fn available(&self, conversion: &Conversion) -> Result<(), Error> {
        let field = self.field;
        let is_lacking = if field.value_type >= TEXT {
            let words = self.words.get(..field.length() as usize);
            conversion.is_standard && words.is_some_and(|words| words.iter().all(|word| *word == 0))
        } else {
            let raw = self.raw();
            match field.value_type {
                FLOAT if raw & 0x7FFF_FFFF > 0xFF << 23 => true,
                DOUBLE if raw & 0x7FFF_FFFF_FFFF_FFFF > 0x7FF << 52 => true,
                _ => {
                    conversion.is_standard && field.is_integer() && raw == reserved(field)
                        || is_listed(conversion.not_available, raw, 1 << field.value_shift())
                }
            }
        };
        if is_lacking {
            Err(Error::NotAvailable)
        } else {
            Ok(())
        }
    }

    /// The bits of a value as a float of 64 bits: the one nearest to the exact value, as
    /// [`Words::number`].
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for a text or for registers as they are, and for an offset
    /// with too many decimals; [`Error::NotAvailable`].
    pub fn converted(&self, conversion: &Conversion, power: i8) -> Result<u64, Error> {
        let field = self.field;
        if field.value_type >= TEXT || conversion.offset_decimals > MOST_DECIMALS {
            return Err(Error::InvalidArgument);
        }
        self.available(conversion)?;
        let ((significand, is_below), exponent) = if field.value_type >= FLOAT {
            let bits = self.double()?;
            let Some((significand, exponent)) = parts(bits) else {
                return Ok(bits ^ u64::from(field.multiplier < 0) << 63);
            };
            ((significand, bits >> 63 != 0), exponent - ONE)
        } else {
            (self.magnitude(), 0)
        };
        let (multiplier, divisor) = scale(field);
        let mut value = Wide::new(significand, multiplier, divisor, power);
        value.exponent += exponent;
        value.is_below = is_below != (field.multiplier < 0);
        let decimals = -(conversion.offset_decimals as i8);
        let mut offset = Wide::new(conversion.offset.unsigned_abs().into(), 1, 1, decimals);
        offset.is_below = conversion.offset < 0;
        Ok(value.plus(offset).to_bits())
    }

    /// A value times 10^`decimals`, rounded to the nearest, halves away from 0.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for a type that is not a bit or an integer of 16 or 32 bits,
    /// and for too many decimals; [`Error::NotAvailable`]; [`Error::OutOfRange`] if the result
    /// is out of range, or if a number on the way to it has more than 64 bits.
    pub fn decimal(&self, conversion: &Conversion, power: i8, decimals: u8) -> Result<i32, Error> {
        let field = self.field;
        if field.value_type > INT32
            || conversion.offset_decimals > MOST_DECIMALS
            || decimals > MOST_DECIMALS
        {
            return Err(Error::InvalidArgument);
        }
        self.available(conversion)?;
        // Both terms, as integers, have the denominator divisor * 10^less.
        let of_number = power + decimals as i8;
        let of_offset = (decimals as i8) - (conversion.offset_decimals as i8);
        let mut less = 0.max(-of_number);
        if conversion.offset != 0 {
            less = less.max(-of_offset);
        }
        let (magnitude, is_below) = self.magnitude();
        let (multiplier, divisor) = scale(field);
        let number = times(magnitude as u32, multiplier);
        let number = times_power(number, of_number + less)?;
        let mut offset = 0;
        if conversion.offset != 0 {
            let whole = times(conversion.offset.unsigned_abs(), divisor);
            offset = times_power(whole, of_offset + less)?;
        }
        let denominator = times_power(divisor.into(), less)?;
        let is_below = is_below != (field.multiplier < 0);
        let (sum, is_below) = if is_below == (conversion.offset < 0) {
            let sum = number.checked_add(offset).ok_or(Error::OutOfRange)?;
            (sum, is_below)
        } else if number >= offset {
            (number - offset, is_below)
        } else {
            (offset - number, !is_below)
        };
        let rounded = u32::try_from(quotient(sum, denominator));
        signed(rounded.map_err(|_| Error::OutOfRange)?, is_below)
    }
}

/// True if a list has a number of `words` words.
fn is_listed(list: &[u16], raw: u64, words: usize) -> bool {
    list.chunks(words).any(|number| {
        let mut listed = 0;
        for word in number {
            listed = listed << 16 | u64::from(*word);
        }
        listed == raw
    })
}

/// (Bit by bit, here and below: firmware has no other use for arithmetic of this width.)
fn times(one: u32, mut other: u32) -> u64 {
    let mut product = 0u64;
    for _ in 0..u32::BITS {
        product <<= 1;
        if other >> 31 != 0 {
            product += u64::from(one);
        }
        other <<= 1;
    }
    product
}

/// A number times 10^`power`.
fn times_power(mut number: u64, power: i8) -> Result<u64, Error> {
    for _ in 0..power {
        let carry;
        (number, carry) = times_small(number, 10);
        if carry != 0 {
            return Err(Error::OutOfRange);
        }
    }
    Ok(number)
}

/// Divides and rounds to the nearest, halves up.
fn quotient(mut dividend: u64, divisor: u64) -> u64 {
    let mut rest = 0u64;
    for _ in 0..u64::BITS {
        let is_wide = rest >> 63 != 0;
        rest = rest << 1 | dividend >> 63;
        dividend <<= 1;
        if is_wide || rest >= divisor {
            rest = rest.wrapping_sub(divisor);
            dividend |= 1;
        }
    }
    // The rest is less than the divisor.
    dividend + u64::from(rest >= divisor - rest)
}
