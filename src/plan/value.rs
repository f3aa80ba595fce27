//! Values out of the words of a read. The words of registers have the machine's byte order;
//! bits are bytes as on the wire, the lowest bit first.

use super::field::{Field, BIT, DOUBLE, FLOAT, TEXT};
use crate::data::order::Order;
use crate::data::value::{ShortDouble, Value as _};
use crate::error::Status;

/// The words of a field: the words of its read, and where it begins in them.
#[derive(Clone, Copy)]
pub struct Words<'a> {
    /// The words of the read.
    pub words: &'a [u16],
    /// Bits or registers before the field.
    pub before: usize,
    /// The field.
    pub field: &'a Field,
}

/// A byte of words that hold bytes as they travel.
fn byte(words: &[u16], index: usize) -> Option<u8> {
    words
        .get(index / 2)
        .and_then(|word| word.to_ne_bytes().get(index % 2).copied())
}

impl Words<'_> {
    /// No words, of no field.
    pub const NONE: Words<'static> = Words {
        words: &[],
        before: 0,
        field: &Field::NONE,
    };

    /// The bits of a value of the field; a negative integer has its sign in all 64.
    ///
    /// # Errors
    /// [`Status::INVALID_ARGUMENT`] for a text, and if the field has no such value.
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn raw(&self, index: u16) -> Result<i64, Status> {
        let field = self.field;
        if index >= field.values() || field.value_type == TEXT {
            return Err(Status::INVALID_ARGUMENT);
        }
        let index = usize::from(index);
        if field.value_type == BIT {
            let bit = self.before + index;
            let byte = byte(self.words, bit / 8).ok_or(Status::INVALID_ARGUMENT)?;
            return Ok(i64::from(byte >> (bit % 8) & 1));
        }
        let size = usize::from(field.value_registers());
        let order = field.byte_order().unwrap_or(Order::Abcd);
        let first = self.before + index * size;
        let words = self.words.get(first..).and_then(|words| words.get(..size));
        let words = words.ok_or(Status::INVALID_ARGUMENT)?;
        let mut raw = 0;
        for place in 0..size {
            let source = if order.low_word_first() {
                size - 1 - place
            } else {
                place
            };
            let mut word = words.get(source).copied().unwrap_or(0);
            if order.swaps_bytes() {
                word = word.swap_bytes();
            }
            if place == 0 && field.is_signed() && word >> 15 != 0 {
                raw = -1;
            }
            raw = raw << 16 | i64::from(word);
        }
        Ok(raw)
    }

    /// A value as an integer: multiplied and divided as the field says, rounded to the
    /// nearest, halves away from 0.
    ///
    /// # Errors
    /// As [`Words::raw`]; [`Status::INVALID_ARGUMENT`] for floats;
    /// [`Status::BUFFER_TOO_SMALL`] if the result is not in the range of an `i64`, its least
    /// number left out.
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn integer(&self, index: u16) -> Result<i64, Status> {
        let field = self.field;
        if matches!(field.value_type, FLOAT | DOUBLE) {
            return Err(Status::INVALID_ARGUMENT);
        }
        let raw = self.raw(index)?;
        let is_below = field.is_signed() && raw < 0;
        let magnitude = if is_below { raw.wrapping_neg() } else { raw };
        match scale(magnitude.cast_unsigned(), field).map(u64::cast_signed) {
            Some(scaled) if scaled >= 0 => Ok(if is_below != (field.multiplier < 0) {
                -scaled
            } else {
                scaled
            }),
            _ => Err(Status::BUFFER_TOO_SMALL),
        }
    }

    /// The bits of a float of 32 bits; of 64 bits, those of the nearest of 32.
    ///
    /// # Errors
    /// As [`Words::raw`]; [`Status::INVALID_ARGUMENT`] for integers.
    pub fn float(&self, index: u16) -> Result<u32, Status> {
        let raw = self.raw(index)?;
        match self.field.value_type {
            FLOAT => Ok(raw as u32),
            DOUBLE => Ok(ShortDouble::from_bytes(raw.to_be_bytes()).0.to_bits()),
            _ => Err(Status::INVALID_ARGUMENT),
        }
    }

    /// The bits of a float of 64 bits; of 32 bits, those of the same number in 64.
    ///
    /// # Errors
    /// As [`Words::float`].
    pub fn double(&self, index: u16) -> Result<u64, Status> {
        let raw = self.raw(index)?;
        match self.field.value_type {
            FLOAT => {
                let number = ShortDouble(f32::from_bits(raw as u32));
                Ok(u64::from_be_bytes(number.to_bytes()))
            }
            DOUBLE => Ok(raw.cast_unsigned()),
            _ => Err(Status::INVALID_ARGUMENT),
        }
    }

    /// Copies a text, up to its first NUL and without it; returns how many characters.
    ///
    /// # Errors
    /// [`Status::INVALID_ARGUMENT`] for a field of another type; [`Status::BUFFER_TOO_SMALL`]
    /// if `text` cannot hold it. Nothing is copied then.
    pub fn text(&self, text: &mut [u8]) -> Result<usize, Status> {
        let field = self.field;
        if field.value_type != TEXT {
            return Err(Status::INVALID_ARGUMENT);
        }
        let swapped = field.byte_order().is_some_and(Order::swaps_bytes);
        let character = |index: usize| {
            let word = self
                .words
                .get(self.before + index / 2)
                .copied()
                .unwrap_or(0);
            let [high, low] = word.to_be_bytes();
            if index.is_multiple_of(2) != swapped {
                high
            } else {
                low
            }
        };
        let length = usize::from(field.values());
        let count = (0..length)
            .position(|index| character(index) == 0)
            .unwrap_or(length);
        let text = text.get_mut(..count).ok_or(Status::BUFFER_TOO_SMALL)?;
        for (index, place) in text.iter_mut().enumerate() {
            *place = character(index);
        }
        Ok(count)
    }
}

/// Multiplies and divides, rounded to the nearest, halves up; nothing beyond 64 bits. (Loops do
/// it: firmware needs no arithmetic of 64 bits otherwise.)
fn scale(magnitude: u64, field: &Field) -> Option<u64> {
    let divisor = field.divisor.unsigned_abs();
    let mut product = magnitude;
    if field.multiplier != 0 {
        product = 0;
        // The bits of the multiplier, the most significant first.
        for shift in (0..u32::BITS).rev() {
            product = product.checked_add(product)?;
            if field.multiplier.unsigned_abs() >> shift & 1 != 0 {
                product = product.checked_add(magnitude)?;
            }
        }
    }
    if divisor <= 1 {
        return Some(product);
    }
    product = product.checked_add(u64::from(divisor / 2))?;
    let (mut quotient, mut rest) = (0, 0u64);
    for _ in 0..u64::BITS {
        rest = rest << 1 | product >> 63;
        product <<= 1;
        quotient <<= 1;
        if rest >= u64::from(divisor) {
            rest -= u64::from(divisor);
            quotient |= 1;
        }
    }
    Some(quotient)
}
