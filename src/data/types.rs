//! Numbers in other forms than two's complement and IEEE 754 of 32 and 64 bits. What the
//! registers hold is exactly such a number, or refused; a call that is refused sets nothing.

use super::digits;
use super::half;
use super::order::Order;
use super::raw::check_count;
use super::view::{RegisterBytes, RegisterBytesMut, Registers};
use crate::error::Error;

impl<C: RegisterBytes> Registers<C> {
    /// A number in BCD: four digits in one register, eight in two.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]; [`Error::InvalidArgument`] for another count;
    /// [`Error::MalformedValue`] for a digit above 9.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let response = Registers::new(&[0x1234_u16, 0x5678][..], 107, Order::Abcd)?;
    /// assert_eq!(response.bcd(Order::Abcd, 107, 2)?, 12_345_678);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn bcd(&self, order: Order, address: u16, count: u16) -> Result<u32, Error> {
        check_count(count, 2)?;
        digits::from_bcd(self.raw(order, address, count)? as u32)
    }

    /// A number of which each of 1 to 4 registers holds four decimal digits, 0 to 9999: what
    /// Schneider calls M10K or Mod10.
    ///
    /// # Errors
    /// As [`Registers::raw`]; [`Error::MalformedValue`] for a register above 9999.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let response = Registers::new(&[12_u16, 3456][..], 107, Order::Abcd)?;
    /// assert_eq!(response.m10k(Order::Abcd, 107, 2)?, 123_456);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn m10k(&self, order: Order, address: u16, count: u16) -> Result<u64, Error> {
        digits::from_m10k(self.raw(order, address, count)?, count)
    }

    /// As [`Registers::m10k`], with a sign in each register: -9999 to 9999.
    ///
    /// # Errors
    /// As [`Registers::m10k`].
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let response = Registers::new(&[0xFFF4_u16, 0xF280][..], 107, Order::Abcd)?;
    /// assert_eq!(response.signed_m10k(Order::Abcd, 107, 2)?, -123_456);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn signed_m10k(&self, order: Order, address: u16, count: u16) -> Result<i64, Error> {
        digits::from_signed_m10k(self.raw(order, address, count)?, count)
    }

    /// An integer of 24 bits, in the low bits of two registers. The eight bits above it do not
    /// count.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let response = Registers::new(&[0x0012_u16, 0x3456][..], 107, Order::Abcd)?;
    /// assert_eq!(response.u24(Order::Abcd, 107)?, 0x12_3456);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn u24(&self, order: Order, address: u16) -> Result<u32, Error> {
        Ok(self.get_in::<u32>(order, address)? & 0x00FF_FFFF)
    }

    /// As [`Registers::u24`], in two's complement.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let response = Registers::new(&[0x00FF_u16, 0xFFFE][..], 107, Order::Abcd)?;
    /// assert_eq!(response.i24(Order::Abcd, 107)?, -2);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn i24(&self, order: Order, address: u16) -> Result<i32, Error> {
        Ok((self.get_in::<u32>(order, address)? << 8).cast_signed() >> 8)
    }

    /// An integer of 48 bits in three registers.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]; [`Error::InvalidArgument`] for an order by halves.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let response = Registers::new(&[0x0001_u16, 0x0002, 0x0003][..], 107, Order::Abcd)?;
    /// assert_eq!(response.u48(Order::Abcd, 107)?, 0x1_0002_0003);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn u48(&self, order: Order, address: u16) -> Result<u64, Error> {
        self.raw(order, address, 3)
    }

    /// As [`Registers::u48`], in two's complement.
    ///
    /// # Errors
    /// As [`Registers::u48`].
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let response = Registers::new(&[0xFFFF_u16, 0xFFFF, 0xFFFE][..], 107, Order::Abcd)?;
    /// assert_eq!(response.i48(Order::Abcd, 107)?, -2);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn i48(&self, order: Order, address: u16) -> Result<i64, Error> {
        Ok((self.raw(order, address, 3)? << 16).cast_signed() >> 16)
    }

    /// An integer of one or two registers whose highest bit is the sign, and whose other bits are
    /// the magnitude. Both zeros are 0.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]; [`Error::InvalidArgument`] for another count.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let response = Registers::new(&[0x8005_u16][..], 107, Order::Abcd)?;
    /// assert_eq!(response.sign_magnitude(Order::Abcd, 107, 1)?, -5);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn sign_magnitude(&self, order: Order, address: u16, count: u16) -> Result<i32, Error> {
        check_count(count, 2)?;
        let raw = self.raw(order, address, count)? as u32;
        let sign = sign_of(count);
        let magnitude = (raw & (sign - 1)).cast_signed();
        Ok(if raw & sign == 0 {
            magnitude
        } else {
            -magnitude
        })
    }

    /// A half float, an IEEE 754 binary16, in one register.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let response = Registers::new(&[0x3E00_u16][..], 107, Order::Abcd)?;
    /// assert_eq!(response.half(Order::Abcd, 107)?, 1.5);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn half(&self, order: Order, address: u16) -> Result<f32, Error> {
        let half: u16 = self.get_in(order, address)?;
        Ok(f32::from_bits(half::to_float(half)))
    }
}

impl<C: RegisterBytesMut> Registers<C> {
    /// Sets what [`Registers::bcd`] reads.
    ///
    /// # Errors
    /// As [`Registers::bcd`]; [`Error::OutOfRange`] for a number with more digits.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let mut words = [0_u16; 2];
    /// Registers::new(&mut words[..], 107, Order::Abcd)?.set_bcd(Order::Abcd, 107, 2, 12_345_678)?;
    /// assert_eq!(words, [0x1234, 0x5678]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn set_bcd(
        &mut self,
        order: Order,
        address: u16,
        count: u16,
        number: u32,
    ) -> Result<(), Error> {
        check_count(count, 2)?;
        let raw = digits::to_bcd(number, 4 * u32::from(count))?;
        self.set_raw(order, address, count, raw.into())
    }

    /// Sets what [`Registers::m10k`] reads.
    ///
    /// # Errors
    /// As [`Registers::raw`]; [`Error::OutOfRange`] for a number with more digits.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let mut words = [0_u16; 2];
    /// Registers::new(&mut words[..], 107, Order::Abcd)?.set_m10k(Order::Abcd, 107, 2, 123_456)?;
    /// assert_eq!(words, [12, 3456]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn set_m10k(
        &mut self,
        order: Order,
        address: u16,
        count: u16,
        number: u64,
    ) -> Result<(), Error> {
        check_count(count, 4)?;
        self.set_raw(order, address, count, digits::to_m10k(number, count)?)
    }

    /// Sets what [`Registers::signed_m10k`] reads: each register that is not 0 gets the sign.
    ///
    /// # Errors
    /// As [`Registers::set_m10k`].
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let mut words = [0_u16; 2];
    /// Registers::new(&mut words[..], 107, Order::Abcd)?.set_signed_m10k(Order::Abcd, 107, 2, -123_456)?;
    /// assert_eq!(words, [0xFFF4, 0xF280]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn set_signed_m10k(
        &mut self,
        order: Order,
        address: u16,
        count: u16,
        number: i64,
    ) -> Result<(), Error> {
        check_count(count, 4)?;
        let raw = digits::to_signed_m10k(number, count)?;
        self.set_raw(order, address, count, raw)
    }

    /// Sets what [`Registers::u24`] reads; the eight bits above it become 0.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]; [`Error::OutOfRange`] for a number with more bits.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let mut words = [0_u16; 2];
    /// Registers::new(&mut words[..], 107, Order::Abcd)?.set_u24(Order::Abcd, 107, 0x12_3456)?;
    /// assert_eq!(words, [0x0012, 0x3456]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn set_u24(&mut self, order: Order, address: u16, number: u32) -> Result<(), Error> {
        if number >> 24 != 0 {
            return Err(Error::OutOfRange);
        }
        self.set_in(order, address, number)
    }

    /// Sets what [`Registers::i24`] reads; the eight bits above it become copies of the sign.
    ///
    /// # Errors
    /// As [`Registers::set_u24`].
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let mut words = [0_u16; 2];
    /// Registers::new(&mut words[..], 107, Order::Abcd)?.set_i24(Order::Abcd, 107, -2)?;
    /// assert_eq!(words, [0xFFFF, 0xFFFE]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn set_i24(&mut self, order: Order, address: u16, number: i32) -> Result<(), Error> {
        if number << 8 >> 8 != number {
            return Err(Error::OutOfRange);
        }
        self.set_in(order, address, number)
    }

    /// Sets what [`Registers::u48`] reads.
    ///
    /// # Errors
    /// As [`Registers::u48`]; [`Error::OutOfRange`] for a number with more bits.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let mut words = [0_u16; 3];
    /// Registers::new(&mut words[..], 107, Order::Abcd)?.set_u48(Order::Abcd, 107, 0x1_0002_0003)?;
    /// assert_eq!(words, [1, 2, 3]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn set_u48(&mut self, order: Order, address: u16, number: u64) -> Result<(), Error> {
        self.set_raw(order, address, 3, number)
    }

    /// Sets what [`Registers::i48`] reads.
    ///
    /// # Errors
    /// As [`Registers::set_u48`].
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let mut words = [0_u16; 3];
    /// Registers::new(&mut words[..], 107, Order::Abcd)?.set_i48(Order::Abcd, 107, -2)?;
    /// assert_eq!(words, [0xFFFF, 0xFFFF, 0xFFFE]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn set_i48(&mut self, order: Order, address: u16, number: i64) -> Result<(), Error> {
        if number << 16 >> 16 != number {
            return Err(Error::OutOfRange);
        }
        self.set_raw(order, address, 3, number.cast_unsigned() << 16 >> 16)
    }

    /// Sets what [`Registers::sign_magnitude`] reads.
    ///
    /// # Errors
    /// As [`Registers::sign_magnitude`]; [`Error::OutOfRange`] for a number with more bits.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let mut words = [0_u16; 1];
    /// Registers::new(&mut words[..], 107, Order::Abcd)?.set_sign_magnitude(Order::Abcd, 107, 1, -5)?;
    /// assert_eq!(words, [0x8005]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn set_sign_magnitude(
        &mut self,
        order: Order,
        address: u16,
        count: u16,
        number: i32,
    ) -> Result<(), Error> {
        check_count(count, 2)?;
        let sign = sign_of(count);
        let magnitude = number.unsigned_abs();
        if magnitude >= sign {
            return Err(Error::OutOfRange);
        }
        let raw = if number < 0 {
            magnitude | sign
        } else {
            magnitude
        };
        self.set_raw(order, address, count, raw.into())
    }

    /// Sets what [`Registers::half`] reads, rounded to the nearest half.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]; [`Error::OutOfRange`] for a number that would become
    /// infinite, or 0 without being 0.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let mut words = [0_u16; 1];
    /// Registers::new(&mut words[..], 107, Order::Abcd)?.set_half(Order::Abcd, 107, 1.5)?;
    /// assert_eq!(words, [0x3E00]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn set_half(&mut self, order: Order, address: u16, number: f32) -> Result<(), Error> {
        self.set_in(order, address, half::from_float(number.to_bits())?)
    }
}

/// The bit of the sign in one or two registers.
fn sign_of(count: u16) -> u32 {
    if count == 1 {
        0x8000
    } else {
        0x8000_0000
    }
}
