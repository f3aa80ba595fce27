//! Values out of the words of a read. The words of registers have the machine's byte order;
//! bits are bytes as on the wire, the lowest bit first.

use super::divide::divide;
use super::field::{Field, BIT, DOUBLE, FLOAT, INT16, INT32, INT64, TEXT};
use crate::data::value::{ShortDouble, Value as _};
use crate::error::Error;

/// A value: its words, and its field.
///
/// ```
/// use mbm::plan::field::{HOLDING_REGISTERS, INT16, TEXT};
/// use mbm::plan::{value::Words, Conversion, Field};
///
/// // Tenths of a volt.
/// let volts = Field { table: HOLDING_REGISTERS, value_type: INT16, divisor: 10, ..Field::NONE };
/// let words = Words { words: &[2305], before: 0, field: &volts };
/// assert_eq!((words.integer(), words.int32()), (Ok(231), Ok(231)));
/// assert_eq!(words.number().map(f64::from_bits), Ok(230.5));
/// assert_eq!(words.decimal(&Conversion::default(), 0, 1), Ok(2305));
/// assert_eq!(words.converted(&Conversion::default(), 3).map(f64::from_bits), Ok(230_500.0));
/// assert_eq!(words.available(&Conversion::default()), Ok(()));
///
/// let name = Field { table: HOLDING_REGISTERS, value_type: TEXT, count: 4, ..Field::NONE };
/// let mut text = [0; 4];
/// let words = Words { words: &[0x6D62, 0x6D00], before: 0, field: &name };
/// assert_eq!(words.text(&mut text), Ok(3));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Words<'a> {
    /// The words of its read from the first one that has a part of the value.
    pub words: &'a [u16],
    /// Bits before it in the first word.
    pub before: u8,
    /// The field.
    pub field: &'a Field,
}

/// Where a value is in the words of its read: the first word, and bits before it in that word.
/// `address` is the first address of the read.
///
/// # Errors
/// [`Error::InvalidArgument`] if the field has no such value. A text is one value, and so are
/// bits of a register. (Out of line, a plan takes 56 bytes more on a Cortex-M0+.)
///
/// ```
/// use mbm::plan::field::{HOLDING_REGISTERS, UINT32};
/// use mbm::plan::{value::place, Field};
///
/// let energies = Field { table: HOLDING_REGISTERS, value_type: UINT32, address: 107, count: 2, ..Field::NONE };
/// // The read begins at register 100, so the second energy begins at its tenth word.
/// assert_eq!(place(&energies, 100, 1), Ok((9, 0)));
/// ```
#[inline(always)]
pub fn place(field: &Field, address: u16, index: u16) -> Result<(u16, u8), Error> {
    if index >= field.values() {
        return Err(Error::InvalidArgument);
    }
    let place = field
        .address
        .wrapping_sub(address)
        .wrapping_add(index << field.value_shift());
    Ok(if field.is_in_bits() {
        (place / 16, (place % 16) as u8)
    } else {
        (place, 0)
    })
}

impl Words<'_> {
    /// A word, 0 past the end.
    fn word(&self, index: usize) -> u16 {
        self.words.get(index).copied().unwrap_or(0)
    }

    /// True if the orders has the low byte first.
    const fn swaps_bytes(&self) -> bool {
        self.field.order >= 3
    }

    /// True if the order has the low word first.
    const fn low_word_first(&self) -> bool {
        matches!(self.field.order, 2 | 4)
    }

    /// The bits of a value of at most 32 bits.
    fn raw_32(&self) -> u32 {
        let field = self.field;
        if field.is_in_bits() {
            return (u16::from_le(self.word(0)) >> self.before & 1).into();
        }
        let mut raw = u32::from(self.word(0)) << 16 | u32::from(self.word(1));
        if self.swaps_bytes() {
            raw = raw.swap_bytes().rotate_left(16);
        }
        if field.value_type == BIT {
            raw >> (16 + field.bit) & ((1 << field.count()) - 1)
        } else if field.value_shift() == 0 {
            raw >> 16
        } else if self.low_word_first() {
            raw.rotate_left(16)
        } else {
            raw
        }
    }

    /// The bits of a value.
    pub(super) fn raw(&self) -> u64 {
        if self.field.value_shift() < 2 {
            return self.raw_32().into();
        }
        let mut raw = 0;
        for nth in 0..4 {
            let word = self.word(if self.low_word_first() { 3 - nth } else { nth });
            raw = raw << 16
                | u64::from(if self.swaps_bytes() {
                    word.swap_bytes()
                } else {
                    word
                });
        }
        raw
    }

    /// The bits of a float of 32 bits. For a float of 64 bits they are those of the nearest one
    /// of 32.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for other types.
    ///
    /// ```
    /// use mbm::plan::field::{FLOAT, HOLDING_REGISTERS};
    /// use mbm::plan::{value::Words, Field};
    ///
    /// let volts = Field { table: HOLDING_REGISTERS, value_type: FLOAT, ..Field::NONE };
    /// let words = Words { words: &[0x4366, 0x8000], before: 0, field: &volts };
    /// assert_eq!(words.float().map(f32::from_bits), Ok(230.5));
    /// ```
    pub fn float(&self) -> Result<u32, Error> {
        let raw = self.raw();
        match self.field.value_type {
            FLOAT => Ok(raw as u32),
            DOUBLE => Ok(ShortDouble::from_bytes(raw.to_be_bytes()).0.to_bits()),
            _ => Err(Error::InvalidArgument),
        }
    }

    /// The bits of a float of 64 bits. For a float of 32 bits they are those of the same number
    /// in 64.
    ///
    /// # Errors
    /// As [`Words::float`].
    ///
    /// ```
    /// use mbm::plan::field::{FLOAT, HOLDING_REGISTERS};
    /// use mbm::plan::{value::Words, Field};
    ///
    /// let volts = Field { table: HOLDING_REGISTERS, value_type: FLOAT, ..Field::NONE };
    /// let words = Words { words: &[0x4366, 0x8000], before: 0, field: &volts };
    /// assert_eq!(words.double().map(f64::from_bits), Ok(230.5));
    /// ```
    pub fn double(&self) -> Result<u64, Error> {
        let raw = self.raw();
        match self.field.value_type {
            FLOAT => {
                let number = ShortDouble(f32::from_bits(raw as u32));
                Ok(u64::from_be_bytes(number.to_bytes()))
            }
            DOUBLE => Ok(raw),
            _ => Err(Error::InvalidArgument),
        }
    }

    /// Copies a text, up to its first NUL and without it; returns how many characters.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for a field of another type; [`Error::BufferTooSmall`]
    /// if `text` cannot hold it. Nothing is copied then.
    pub fn text(&self, text: &mut [u8]) -> Result<usize, Error> {
        let field = self.field;
        if field.value_type != TEXT {
            return Err(Error::InvalidArgument);
        }
        let character = |index: usize| {
            let [high, low] = self.word(index / 2).to_be_bytes();
            if index.is_multiple_of(2) != self.swaps_bytes() {
                high
            } else {
                low
            }
        };
        let length = usize::from(field.count());
        let count = (0..length)
            .position(|index| character(index) == 0)
            .unwrap_or(length);
        let text = text.get_mut(..count).ok_or(Error::BufferTooSmall)?;
        for (index, place) in text.iter_mut().enumerate() {
            *place = character(index);
        }
        Ok(count)
    }
}

/// The multiplier and the divisor of a field, without signs.
pub(super) fn scale(field: &Field) -> (u32, u32) {
    let or_1 = |number: i32| {
        if number == 0 {
            1
        } else {
            number.unsigned_abs()
        }
    };
    (or_1(field.multiplier), or_1(field.divisor))
}

impl Words<'_> {
    /// The magnitude of a bit or an integer, and whether it is below 0.
    pub(super) fn magnitude(&self) -> (u64, bool) {
        let raw = self.raw();
        let number = match self.field.value_type {
            INT16 => i64::from(raw as i16),
            INT32 => i64::from(raw as i32),
            INT64 => raw.cast_signed(),
            _ => return (raw, false),
        };
        (number.unsigned_abs(), number < 0)
    }

    /// A value as an integer: multiplied and divided as the field says, rounded to the
    /// nearest, halves away from 0.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for a float, a text or registers as they are;
    /// [`Error::OutOfRange`] if the result is out of range.
    pub fn integer(&self) -> Result<i64, Error> {
        let field = self.field;
        if field.value_type > INT64 {
            return Err(Error::InvalidArgument);
        }
        let (raw, is_below) = self.magnitude();
        let (multiplier, divisor) = scale(field);
        let (whole, part) = divide(multiplier, divisor);
        let scaled = times(raw, whole, part, divisor).ok_or(Error::OutOfRange)?;
        let is_below = is_below != (field.multiplier < 0);
        if scaled > i64::MAX as u64 + u64::from(is_below) {
            return Err(Error::OutOfRange);
        }
        Ok(if is_below {
            scaled.wrapping_neg()
        } else {
            scaled
        }
        .cast_signed())
    }

    /// As [`Words::integer`], with 32 bits throughout.
    ///
    /// # Errors
    /// As [`Words::integer`]; [`Error::InvalidArgument`] also for an integer of 64 bits, and
    /// [`Error::OutOfRange`] also if the product before the division does not fit into 32 bits.
    pub fn int32(&self) -> Result<i32, Error> {
        let field = self.field;
        if field.value_type > INT32 {
            return Err(Error::InvalidArgument);
        }
        let mut raw = self.raw_32();
        let mut is_below = field.multiplier < 0;
        if field.is_signed() {
            let mut number = raw.cast_signed();
            if field.value_type == INT16 {
                number = raw as i16 as i32;
            }
            is_below ^= number < 0;
            raw = number.unsigned_abs();
        }
        let (multiplier, divisor) = scale(field);
        let half = divisor / 2;
        if raw > divide(u32::MAX - half, multiplier).0 {
            return Err(Error::OutOfRange);
        }
        let (scaled, _) = divide(raw * multiplier + half, divisor);
        signed(scaled, is_below)
    }
}

/// The integer with this magnitude.
///
/// # Errors
/// [`Error::OutOfRange`]
#[inline(always)]
pub(super) fn signed(magnitude: u32, is_below: bool) -> Result<i32, Error> {
    if magnitude > i32::MAX as u32 + u32::from(is_below) {
        return Err(Error::OutOfRange);
    }
    Ok(if is_below {
        magnitude.wrapping_neg()
    } else {
        magnitude
    }
    .cast_signed())
}

/// `magnitude` times the sum of `whole` and `part / divisor`, rounded to the nearest, halves
/// up. `part` is less than `divisor`, and that less than 2^31. `None` only if it exceeds 2^63.
/// (Bit by bit: firmware has no other use for a multiplication and a division of this width.)
fn times(mut magnitude: u64, whole: u32, part: u32, divisor: u32) -> Option<u64> {
    let (mut product, mut rest) = (0u64, 0);
    for _ in 0..u64::BITS {
        if product > 1 << 62 {
            return None;
        }
        product <<= 1;
        rest <<= 1;
        // Twice, because `rest` and `part` together may be three times `divisor`.
        for _ in 0..2 {
            if rest >= divisor {
                rest -= divisor;
                product += 1;
            }
            if magnitude >> 63 != 0 {
                product += u64::from(whole);
                rest += part;
            }
            magnitude &= u64::MAX >> 1;
        }
        magnitude <<= 1;
    }
    if rest >= divisor - rest {
        product += 1;
    }
    Some(product)
}
