//! The bits of one to four registers as a number, in any order: what the types of [`super::types`]
//! are made of.

use super::arithmetic::{shifted_left, shifted_right};
use super::order::Order;
use super::view::{RegisterBytes, RegisterBytesMut, Registers};
use crate::error::Error;

impl<C: RegisterBytes> Registers<C> {
    /// The bits of `count` registers, 1 to 4.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]; [`Error::InvalidArgument`] for another count, or for an
    /// order by halves of three registers.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let response = Registers::new(&[0x0102_u16, 0x0304][..], 107, Order::Abcd)?;
    /// assert_eq!(response.raw(Order::Cdab, 107, 2)?, 0x0304_0102);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn raw(&self, order: Order, address: u16, count: u16) -> Result<u64, Error> {
        check_count(count, 4)?;
        let _ = self.byte_index(address, 2 * usize::from(count))?;
        let mut raw = 0;
        for nth in 0..count {
            let place = order.place(nth, count).ok_or(Error::InvalidArgument)?;
            let word: u16 = self.get_in(order, address.wrapping_add(place))?;
            raw = raw << 16 | u64::from(word);
        }
        Ok(raw)
    }

    /// `bits` of the bits of `count` registers, from bit `first` on, as one number; bit 0 is the
    /// least significant.
    ///
    /// # Errors
    /// As [`Registers::raw`]; [`Error::InvalidArgument`] also for no bits, or for bits beyond
    /// those of the registers.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let response = Registers::new(&[0b0000_0110_1000_0000_u16][..], 107, Order::Abcd)?;
    /// assert_eq!(response.bits(Order::Abcd, 107, 1, 7, 4)?, 0b1101);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn bits(
        &self,
        order: Order,
        address: u16,
        count: u16,
        first: u8,
        bits: u8,
    ) -> Result<u64, Error> {
        let mask = mask_of(count, first, bits)?;
        Ok(shifted_right(
            self.raw(order, address, count)? & mask,
            first,
        ))
    }
}

impl<C: RegisterBytesMut> Registers<C> {
    /// Sets the bits of `count` registers, 1 to 4.
    ///
    /// # Errors
    /// As [`Registers::raw`]; [`Error::OutOfRange`] for a number with more bits. Nothing is set
    /// then.
    pub(crate) fn set_raw(
        &mut self,
        order: Order,
        address: u16,
        count: u16,
        raw: u64,
    ) -> Result<(), Error> {
        // Finds every reason to refuse it.
        let _ = self.raw(order, address, count)?;
        let mut left = raw;
        for _ in 0..count {
            left >>= 16;
        }
        if left != 0 {
            return Err(Error::OutOfRange);
        }
        left = raw;
        for nth in (0..count).rev() {
            let place = order.place(nth, count).ok_or(Error::InvalidArgument)?;
            self.set_in(order, address.wrapping_add(place), left as u16)?;
            left >>= 16;
        }
        Ok(())
    }

    /// Sets `bits` of the bits of `count` registers, from bit `first` on; the others do not change.
    ///
    /// # Errors
    /// As [`Registers::bits`]; [`Error::OutOfRange`] for a number with more bits. Nothing is set
    /// then.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let mut words = [0_u16; 1];
    /// Registers::new(&mut words[..], 107, Order::Abcd)?.set_bits(Order::Abcd, 107, 1, 7, 4, 0b1101)?;
    /// assert_eq!(words, [0b0000_0110_1000_0000]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn set_bits(
        &mut self,
        order: Order,
        address: u16,
        count: u16,
        first: u8,
        bits: u8,
        number: u64,
    ) -> Result<(), Error> {
        let mask = mask_of(count, first, bits)?;
        if number > shifted_right(mask, first) {
            return Err(Error::OutOfRange);
        }
        let others = self.raw(order, address, count)? & !mask;
        let raw = others | shifted_left(number, first);
        self.set_raw(order, address, count, raw)
    }
}

/// Refuses a count of registers that is not 1 to `most`.
pub(super) fn check_count(count: u16, most: u16) -> Result<(), Error> {
    if count.wrapping_sub(1) >= most {
        return Err(Error::InvalidArgument);
    }
    Ok(())
}

/// The mask of `bits` bits from bit `first` on, of `count` registers.
fn mask_of(count: u16, first: u8, bits: u8) -> Result<u64, Error> {
    let end = u16::from(first) + u16::from(bits);
    if bits == 0 || end > 64 || end > count.saturating_mul(16) {
        return Err(Error::InvalidArgument);
    }
    Ok(shifted_left(shifted_right(u64::MAX, 64 - bits), first))
}
