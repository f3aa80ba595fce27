//! Typed values in registers, accessed by register address. The registers are data bytes
//! in the order of the wire, or words as the master stores them.
//!
//! An access beyond the registers returns [`Error::IllegalDataAddress`]; nothing panics.

use super::order::{byte_of, set_byte_of, Order};
use super::value::Value;
use crate::error::Error;

/// Consecutive registers, accessed as bytes in the order of the wire.
///
/// ```
/// use mbm::data::view::RegisterBytes;
/// use mbm::data::{Order, Registers};
///
/// /// Registers that a display driver keeps, low byte first.
/// struct Display([u8; 4]);
///
/// impl RegisterBytes for Display {
///     fn length(&self) -> usize {
///         self.0.len()
///     }
///
///     fn byte(&self, place: usize) -> Option<u8> {
///         self.0.get(place ^ 1).copied()
///     }
/// }
///
/// let display = Registers::new(Display([0x2B, 0x02, 0, 0]), 107, Order::Abcd)?;
/// assert_eq!(display.get(107), Ok(555_u16));
/// # Ok::<(), mbm::Error>(())
/// ```
pub trait RegisterBytes {
    /// Number of bytes, two for each register.
    fn length(&self) -> usize;

    /// The byte at the index `place`; `None` past the end.
    fn byte(&self, place: usize) -> Option<u8>;
}

/// Registers that can also be written.
///
/// ```
/// use mbm::data::view::{RegisterBytes, RegisterBytesMut};
///
/// /// Sets every byte to 0.
/// fn clear(mut registers: impl RegisterBytesMut) {
///     for place in 0..registers.length() {
///         registers.set_byte(place, 0);
///     }
/// }
///
/// let mut words = [555_u16, 100];
/// clear(&mut words[..]);
/// assert_eq!(words, [0, 0]);
/// ```
pub trait RegisterBytesMut: RegisterBytes {
    /// Sets the byte at the index `place`; does nothing past the end.
    fn set_byte(&mut self, place: usize, value: u8);
}

impl RegisterBytes for &[u8] {
    fn length(&self) -> usize {
        self.len()
    }

    fn byte(&self, place: usize) -> Option<u8> {
        self.get(place).copied()
    }
}

impl RegisterBytes for &[u16] {
    fn length(&self) -> usize {
        self.len().saturating_mul(2)
    }

    fn byte(&self, place: usize) -> Option<u8> {
        byte_of(self, place)
    }
}

impl RegisterBytes for &mut [u8] {
    fn length(&self) -> usize {
        self.len()
    }

    fn byte(&self, place: usize) -> Option<u8> {
        self.get(place).copied()
    }
}

impl RegisterBytesMut for &mut [u8] {
    fn set_byte(&mut self, place: usize, value: u8) {
        if let Some(byte) = self.get_mut(place) {
            *byte = value;
        }
    }
}

impl RegisterBytes for &mut [u16] {
    fn length(&self) -> usize {
        self.len().saturating_mul(2)
    }

    fn byte(&self, place: usize) -> Option<u8> {
        byte_of(self, place)
    }
}

impl RegisterBytesMut for &mut [u16] {
    fn set_byte(&mut self, place: usize, value: u8) {
        set_byte_of(self, place, value);
    }
}

/// Typed access to registers: for reading if `C` is [`RegisterBytes`], also for writing if it is
/// [`RegisterBytesMut`].
///
/// ```
/// use mbm::data::{Order, Registers};
///
/// // What a device answered that was read from register 107 on.
/// let mut words = [0x4366_u16, 0x8000, 0x00FF];
/// let mut meter = Registers::new(&mut words[..], 107, Order::Abcd)?;
/// assert_eq!(meter.get(107), Ok(230.5_f32));
/// assert_eq!(meter.get(109), Ok(255_u16));
/// meter.set(109, -1_i16)?;
/// assert_eq!(words[2], 0xFFFF);
/// # Ok::<(), mbm::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Registers<C> {
    cells: C,
    first: u16,
    /// The order of values for the calls that have no argument for it.
    pub order: Order,
}

impl<C: RegisterBytes> Registers<C> {
    /// Registers in `cells`; the first has the address `first`.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`] if they go beyond address 65535;
    /// [`Error::InvalidArgument`] if the number of bytes is odd.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// // Bytes in the order of the wire, or words.
    /// let bytes = Registers::new(&[0x02_u8, 0x2B][..], 107, Order::Abcd)?;
    /// let words = Registers::new(&[555_u16][..], 107, Order::Abcd)?;
    /// assert_eq!(bytes.get::<u16>(107), words.get(107));
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn new(cells: C, first: u16, order: Order) -> Result<Self, Error> {
        let length = cells.length();
        if !length.is_multiple_of(2) {
            return Err(Error::InvalidArgument);
        }
        if length / 2 > usize::from(u16::MAX - first).saturating_add(1) {
            return Err(Error::IllegalDataAddress);
        }
        Ok(Registers {
            cells,
            first,
            order,
        })
    }

    /// These registers, with another order for the calls that have no argument for it.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let response = Registers::new(&[0x8000_u16, 0x4366][..], 107, Order::Abcd)?;
    /// assert_eq!(response.with_byte_order(Order::Cdab).get(107), Ok(230.5_f32));
    /// # Ok::<(), mbm::Error>(())
    /// ```
    #[must_use]
    pub fn with_byte_order(self, order: Order) -> Self {
        Registers { order, ..self }
    }

    /// The index of the high byte of the register `address`, if `length` bytes from there
    /// exist.
    pub(super) fn byte_index(&self, address: u16, length: usize) -> Result<usize, Error> {
        let Some(before) = address.checked_sub(self.first) else {
            return Err(Error::IllegalDataAddress);
        };
        // Counted in registers, so that a `usize` of 16 bits does not overflow.
        let whole = self.cells.length() / 2;
        let wanted = length.div_ceil(2);
        match whole.checked_sub(before.into()) {
            Some(left) if wanted <= left => Ok(2 * usize::from(before)),
            _ => Err(Error::IllegalDataAddress),
        }
    }

    /// The byte at the index `place`, 0 past the end.
    pub(super) fn cell(&self, place: usize) -> u8 {
        self.cells.byte(place).unwrap_or(0)
    }

    /// Fills `bytes` from the registers that begin at `address`. Byte `n` of the registers
    /// becomes `bytes[n ^ mask]`, see [`Order::mask`].
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]; nothing is copied then.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub fn load(&self, address: u16, mask: usize, bytes: &mut [u8]) -> Result<(), Error> {
        let start = self.byte_index(address, bytes.len())?;
        for (place, byte) in bytes.iter_mut().enumerate() {
            *byte = self.cells.byte(start + (place ^ mask)).unwrap_or(0);
        }
        Ok(())
    }

    /// The number that begins at the register `address`, in the order [`Registers::order`].
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let response = Registers::new(&[0x4366_u16, 0x8000][..], 107, Order::Abcd)?;
    /// assert_eq!(response.get::<f32>(107)?, 230.5);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn get<T: Value>(&self, address: u16) -> Result<T, Error> {
        self.get_in(self.order, address)
    }

    /// As [`Registers::get`], in another order.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let response = Registers::new(&[0x8000_u16, 0x4366][..], 107, Order::Abcd)?;
    /// assert_eq!(response.get_in::<f32>(Order::Cdab, 107)?, 230.5);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn get_in<T: Value>(&self, order: Order, address: u16) -> Result<T, Error> {
        let mut bytes = T::Bytes::default();
        let mask = order.mask(bytes.as_ref().len());
        self.load(address, mask, bytes.as_mut())?;
        Ok(T::from_bytes(bytes))
    }

    /// Copies raw bytes in the order of the wire, from the high byte of `address` on.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]; nothing is copied then.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let response = Registers::new(&[0x0102_u16, 0x0304][..], 107, Order::Abcd)?;
    /// let mut bytes = [0; 3];
    /// response.bytes(107, &mut bytes)?;
    /// assert_eq!(bytes, [1, 2, 3]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn bytes(&self, address: u16, bytes: &mut [u8]) -> Result<(), Error> {
        self.load(address, 0, bytes)
    }

    /// As [`Registers::bytes`], but with the low byte of each register first if `order`
    /// swaps bytes. The registers themselves are copied in ascending order of address in
    /// every `order`.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]; nothing is copied then.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let response = Registers::new(&[0x0102_u16, 0x0304][..], 107, Order::Abcd)?;
    /// let mut bytes = [0; 4];
    /// response.bytes_in(Order::Badc, 107, &mut bytes)?;
    /// assert_eq!(bytes, [2, 1, 4, 3]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn bytes_in(&self, order: Order, address: u16, bytes: &mut [u8]) -> Result<(), Error> {
        self.load(address, order.swaps_bytes().into(), bytes)
    }

    /// The high or the low byte of a register.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let response = Registers::new(&[0x12FE_u16][..], 107, Order::Abcd)?;
    /// assert_eq!(response.u8(107, true)?, 0x12);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn u8(&self, address: u16, high: bool) -> Result<u8, Error> {
        let place = self.byte_index(address, 2)? + usize::from(!high);
        Ok(self.cells.byte(place).unwrap_or(0))
    }

    /// As [`Registers::u8`], signed.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let response = Registers::new(&[0x12FE_u16][..], 107, Order::Abcd)?;
    /// assert_eq!(response.i8(107, false)?, -2);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn i8(&self, address: u16, high: bool) -> Result<i8, Error> {
        self.u8(address, high).map(u8::cast_signed)
    }

    /// Bit `bit` of a register; bit 0 is the least significant.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]; [`Error::InvalidArgument`] if `bit` is greater
    /// than 15.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let response = Registers::new(&[0b0100_u16][..], 107, Order::Abcd)?;
    /// assert_eq!(response.bit(107, 2)?, true);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn bit(&self, address: u16, bit: u8) -> Result<bool, Error> {
        let (high, mask) = byte_of_bit(bit)?;
        Ok(self.u8(address, high)? & mask != 0)
    }

    /// Copies a text from a field of `length` bytes, up to its first NUL and without it.
    /// The registers are read in ascending order of address. In an order that swaps bytes,
    /// the first of the two characters of a register is its low byte.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]; [`Error::BufferTooSmall`] if `buffer` cannot
    /// hold the text. Nothing is copied then.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let response = Registers::new(&[0x6D62_u16, 0x6D00][..], 107, Order::Abcd)?;
    /// assert_eq!(response.text(107, 4, &mut [0; 4])?, b"mbm");
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn text<'b>(
        &self,
        address: u16,
        length: usize,
        buffer: &'b mut [u8],
    ) -> Result<&'b mut [u8], Error> {
        self.text_in(self.order, address, length, buffer)
    }

    /// As [`Registers::text`], in another order.
    ///
    /// # Errors
    /// As [`Registers::text`].
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let response = Registers::new(&[0x626D_u16, 0x006D][..], 107, Order::Abcd)?;
    /// assert_eq!(response.text_in(Order::Badc, 107, 4, &mut [0; 4])?, b"mbm");
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn text_in<'b>(
        &self,
        order: Order,
        address: u16,
        length: usize,
        buffer: &'b mut [u8],
    ) -> Result<&'b mut [u8], Error> {
        let start = self.byte_index(address, length)?;
        let mask = usize::from(order.swaps_bytes());
        let character = |place| self.cells.byte(start + (place ^ mask)).unwrap_or(0);
        let mut count = 0;
        while count < length && character(count) != 0 {
            count += 1;
        }
        let text = buffer.get_mut(..count).ok_or(Error::BufferTooSmall)?;
        for (place, byte) in text.iter_mut().enumerate() {
            *byte = character(place);
        }
        Ok(text)
    }

    /// True if `bytes` equals the raw bytes from the high byte of `address` on.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let response = Registers::new(&[0x6D62_u16, 0x6D00][..], 107, Order::Abcd)?;
    /// assert_eq!(response.is_equal(107, b"mbm")?, true);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn is_equal(&self, address: u16, bytes: &[u8]) -> Result<bool, Error> {
        let start = self.byte_index(address, bytes.len())?;
        let mut held = bytes.iter().enumerate();
        Ok(held.all(|(place, byte)| self.cells.byte(start + place) == Some(*byte)))
    }
}

impl<C: RegisterBytesMut> Registers<C> {
    /// Sets the byte at the index `place`; does nothing past the end.
    pub(super) fn set_cell(&mut self, place: usize, value: u8) {
        self.cells.set_byte(place, value);
    }

    /// Sets the registers that begin at `address` from `bytes`, in the order in which
    /// [`Registers::load`] reads them.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]; nothing is set then.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub fn store(&mut self, address: u16, mask: usize, bytes: &[u8]) -> Result<(), Error> {
        let start = self.byte_index(address, bytes.len())?;
        for (place, byte) in bytes.iter().enumerate() {
            self.cells.set_byte(start + (place ^ mask), *byte);
        }
        Ok(())
    }

    /// Sets the number that begins at the register `address`, in the order
    /// [`Registers::order`].
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]; nothing is set then.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let mut words = [0_u16; 2];
    /// Registers::new(&mut words[..], 107, Order::Abcd)?.set(107, 230.5_f32)?;
    /// assert_eq!(words, [0x4366, 0x8000]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn set<T: Value>(&mut self, address: u16, value: T) -> Result<(), Error> {
        self.set_in(self.order, address, value)
    }

    /// As [`Registers::set`], in another order.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]; nothing is set then.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let mut words = [0_u16; 2];
    /// Registers::new(&mut words[..], 107, Order::Abcd)?.set_in(Order::Cdab, 107, 230.5_f32)?;
    /// assert_eq!(words, [0x8000, 0x4366]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn set_in<T: Value>(&mut self, order: Order, address: u16, value: T) -> Result<(), Error> {
        let bytes = value.to_bytes();
        let mask = order.mask(bytes.as_ref().len());
        self.store(address, mask, bytes.as_ref())
    }

    /// Sets raw bytes in the order of the wire, from the high byte of `address` on. If the
    /// number of bytes is odd, the low byte of the last register does not change.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]; nothing is set then.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let mut words = [0_u16; 2];
    /// Registers::new(&mut words[..], 107, Order::Abcd)?.set_bytes(107, b"mbm")?;
    /// assert_eq!(words, [0x6D62, 0x6D00]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn set_bytes(&mut self, address: u16, bytes: &[u8]) -> Result<(), Error> {
        self.store(address, 0, bytes)
    }

    /// As [`Registers::set_bytes`], in the order in which [`Registers::bytes_in`] reads them.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]; nothing is set then.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let mut words = [0_u16; 2];
    /// Registers::new(&mut words[..], 107, Order::Abcd)?.set_bytes_in(Order::Badc, 107, b"mbm")?;
    /// assert_eq!(words, [0x626D, 0x006D]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn set_bytes_in(&mut self, order: Order, address: u16, bytes: &[u8]) -> Result<(), Error> {
        self.store(address, order.swaps_bytes().into(), bytes)
    }

    /// Sets the high or the low byte of a register; the other byte does not change.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let mut words = [0_u16; 1];
    /// Registers::new(&mut words[..], 107, Order::Abcd)?.set_u8(107, true, 0x12)?;
    /// assert_eq!(words, [0x1200]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn set_u8(&mut self, address: u16, high: bool, value: u8) -> Result<(), Error> {
        let place = self.byte_index(address, 2)? + usize::from(!high);
        self.cells.set_byte(place, value);
        Ok(())
    }

    /// As [`Registers::set_u8`], signed.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let mut words = [0_u16; 1];
    /// Registers::new(&mut words[..], 107, Order::Abcd)?.set_i8(107, false, -2)?;
    /// assert_eq!(words, [0x00FE]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn set_i8(&mut self, address: u16, high: bool, value: i8) -> Result<(), Error> {
        self.set_u8(address, high, value.cast_unsigned())
    }

    /// Sets or clears bit `bit` of a register; bit 0 is the least significant. The other
    /// bits do not change.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]; [`Error::InvalidArgument`] if `bit` is greater
    /// than 15.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let mut words = [0_u16; 1];
    /// Registers::new(&mut words[..], 107, Order::Abcd)?.set_bit(107, 2, true)?;
    /// assert_eq!(words, [0b0100]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn set_bit(&mut self, address: u16, bit: u8, on: bool) -> Result<(), Error> {
        let (high, mask) = byte_of_bit(bit)?;
        let others = self.u8(address, high)? & !mask;
        self.set_u8(address, high, if on { others | mask } else { others })
    }

    /// Fills a field of `length` bytes with a text, followed by NULs, in the order in which
    /// [`Registers::text`] reads it. If `length` is odd, the byte after the field becomes 0
    /// too.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]; [`Error::BufferTooSmall`] if the text is longer
    /// than the field. Nothing is set then.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let mut words = [0_u16; 2];
    /// Registers::new(&mut words[..], 107, Order::Abcd)?.set_text(107, 4, b"mbm")?;
    /// assert_eq!(words, [0x6D62, 0x6D00]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn set_text(&mut self, address: u16, length: usize, text: &[u8]) -> Result<(), Error> {
        self.set_text_in(self.order, address, length, text)
    }

    /// As [`Registers::set_text`], in another order.
    ///
    /// # Errors
    /// As [`Registers::set_text`].
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let mut words = [0_u16; 2];
    /// Registers::new(&mut words[..], 107, Order::Abcd)?.set_text_in(Order::Badc, 107, 4, b"mbm")?;
    /// assert_eq!(words, [0x626D, 0x006D]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn set_text_in(
        &mut self,
        order: Order,
        address: u16,
        length: usize,
        text: &[u8],
    ) -> Result<(), Error> {
        let start = self.byte_index(address, length)?;
        if text.len() > length {
            return Err(Error::BufferTooSmall);
        }
        let mask = usize::from(order.swaps_bytes());
        for place in 0..length + length % 2 {
            let character = text.get(place).copied().unwrap_or(0);
            self.cells.set_byte(start + (place ^ mask), character);
        }
        Ok(())
    }
}

/// The byte of a register that contains bit `bit`, true for the high byte, and the mask of
/// the bit in that byte.
fn byte_of_bit(bit: u8) -> Result<(bool, u8), Error> {
    if bit < 16 {
        Ok((bit >= 8, 1 << (bit % 8)))
    } else {
        Err(Error::InvalidArgument)
    }
}

/// Writes `words` as data bytes. Bytes beyond the last word do not change.
// For the C API; it may change in any version.
#[doc(hidden)]
pub fn send_words(bytes: &mut [u8], words: &[u16]) {
    for (pair, word) in bytes.as_chunks_mut().0.iter_mut().zip(words) {
        *pair = word.to_be_bytes();
    }
}

/// Fills `words` from data bytes.
// For the C API; it may change in any version.
#[doc(hidden)]
pub fn take_words(words: &mut [u16], bytes: &[u8]) {
    for (word, pair) in words.iter_mut().zip(bytes.as_chunks().0) {
        *word = u16::from_be_bytes(*pair);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_are_sent_high_byte_first() {
        let words = [0x0102, 0x0304];
        let mut sent = [0; 4];
        send_words(&mut sent, &words);
        assert_eq!(sent, [1, 2, 3, 4]);
        let mut back = [0; 2];
        take_words(&mut back, &sent);
        assert_eq!(back, words);
    }
}
