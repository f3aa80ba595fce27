//! Texts in other forms than two characters a register and a NUL.

use super::order::Order;
use super::view::{RegisterBytes, RegisterBytesMut, Registers};
use crate::error::Error;

/// Which bytes of a register hold characters.
///
/// ```
/// use mbm::data::text::{Characters, TextForm};
///
/// let form = TextForm { characters: Characters::Low, has_spaces: false };
/// assert_eq!(form.registers(8), 8);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Characters {
    /// Two a register, the first as the order says.
    #[default]
    Both,
    /// One, in the low byte; the high byte does not count, and is written as 0.
    Low,
    /// One, in the high byte; the low byte does not count, and is written as 0.
    High,
}

/// A form of text.
///
/// ```
/// use mbm::data::text::TextForm;
///
/// // Two characters a register.
/// assert_eq!(TextForm::default().registers(7), 4);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct TextForm {
    /// Which bytes hold characters.
    pub characters: Characters,
    /// The rest of the field is filled with spaces, and not with NULs.
    pub has_spaces: bool,
}

impl TextForm {
    /// The number of registers of `length` characters.
    pub const fn registers(self, length: usize) -> usize {
        match self.characters {
            Characters::Both => length.div_ceil(2),
            _ => length,
        }
    }

    /// The index of the byte of the character at `place`.
    const fn byte(self, order: Order, place: usize) -> usize {
        match self.characters {
            Characters::Both => place ^ order.swaps_bytes() as usize,
            Characters::Low => 2 * place + 1,
            Characters::High => 2 * place,
        }
    }
}

impl<C: RegisterBytes> Registers<C> {
    /// Copies a text of `length` characters at most. It ends at its first NUL; if the form has
    /// spaces, those at its end are left out.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]; [`Error::BufferTooSmall`] if `buffer` cannot hold the
    /// text. Nothing is copied then.
    ///
    /// ```
    /// use mbm::data::text::{Characters, TextForm};
    /// use mbm::data::{Order, Registers};
    ///
    /// // A character in the low byte of each register, and spaces at the end.
    /// let form = TextForm { characters: Characters::Low, has_spaces: true };
    /// let response = Registers::new(&[0x004F_u16, 0x004B, 0x0020][..], 107, Order::Abcd)?;
    /// assert_eq!(response.text_of(form, Order::Abcd, 107, 3, &mut [0; 3])?, b"OK");
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn text_of<'b>(
        &self,
        form: TextForm,
        order: Order,
        address: u16,
        length: usize,
        buffer: &'b mut [u8],
    ) -> Result<&'b mut [u8], Error> {
        let start = self.byte_index(address, 2 * form.registers(length))?;
        let character = |place| self.cell(start + form.byte(order, place));
        let mut count = 0;
        while count < length && character(count) != 0 {
            count += 1;
        }
        while form.has_spaces && count > 0 && character(count - 1) == b' ' {
            count -= 1;
        }
        let text = buffer.get_mut(..count).ok_or(Error::BufferTooSmall)?;
        for (place, byte) in text.iter_mut().enumerate() {
            *byte = character(place);
        }
        Ok(text)
    }
}

impl<C: RegisterBytesMut> Registers<C> {
    /// Fills a field of `length` characters with a text, and what is left with NULs or spaces, as
    /// [`Registers::text_of`] reads it. Every byte of its registers is set.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]; [`Error::BufferTooSmall`] if the text is longer than
    /// the field; [`Error::InvalidArgument`] if the form has spaces and the text ends with one,
    /// which would be lost. Nothing is set then.
    ///
    /// ```
    /// use mbm::data::text::{Characters, TextForm};
    /// use mbm::data::{Order, Registers};
    ///
    /// let form = TextForm { characters: Characters::Low, has_spaces: true };
    /// let mut words = [0_u16; 3];
    /// let mut registers = Registers::new(&mut words[..], 107, Order::Abcd)?;
    /// registers.set_text_of(form, Order::Abcd, 107, 3, b"OK")?;
    /// assert_eq!(words, [0x004F, 0x004B, 0x0020]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn set_text_of(
        &mut self,
        form: TextForm,
        order: Order,
        address: u16,
        length: usize,
        text: &[u8],
    ) -> Result<(), Error> {
        let registers = form.registers(length);
        let start = self.byte_index(address, 2 * registers)?;
        if text.len() > length {
            return Err(Error::BufferTooSmall);
        }
        if form.has_spaces && text.last() == Some(&b' ') {
            return Err(Error::InvalidArgument);
        }
        let rest = if form.has_spaces { b' ' } else { 0 };
        for byte in 0..2 * registers {
            self.set_cell(start + byte, 0);
        }
        for place in 0..length {
            let character = text.get(place).copied().unwrap_or(rest);
            self.set_cell(start + form.byte(order, place), character);
        }
        Ok(())
    }
}
