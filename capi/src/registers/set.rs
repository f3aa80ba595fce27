//! Writes values into registers. A call that fails leaves the registers unchanged.
//!
//! Numbers of 64 bits and floats are passed by pointer, because compilers and float units
//! pass them by value in different ways.

use super::{code, machine_order_mask, mbm_registers, view, BorrowedRegisters, MBM_ORDER_DEFAULT};
use crate::pointers::In;
use core::ffi::c_char;
#[cfg(target_arch = "avr")]
use mbm::data::value::{ShortDouble, Value};
use mbm::data::view::Registers;
use mbm::error::Error;

/// Runs `action` on registers that may be written.
pub(super) fn with(
    registers: In<mbm_registers>,
    order: u8,
    action: impl FnOnce(&mut Registers<BorrowedRegisters>) -> Result<(), Error>,
) -> u8 {
    code(view(registers, order, true).and_then(|mut registers| action(&mut registers)))
}

/// Sets a number from its bytes in the byte order of this machine. One function for all
/// numbers of a size keeps the code small.
fn set(registers: In<mbm_registers>, address: u16, order: u8, number: In<u8>, size: usize) -> u8 {
    with(registers, order, |registers| {
        let mask = registers.order.mask(size) ^ machine_order_mask(size);
        registers.store(address, mask, number.slice(size)?)
    })
}

functions! {
    safe (registers: In<mbm_registers>)

    /// Writes one bit of a register; the other bits do not change.
    ///
    /// @param registers  the registers, of a kind that may be written
    /// @param address    the device's address of the register
    /// @param bit        0, the least significant, to 15
    /// @param on         0 for off, anything else for on
    /// @return a status; see mbm_registers
    fn mbm_registers_setBit(address: u16, bit: u8, on: u8)
        = with(MBM_ORDER_DEFAULT, |registers| registers.set_bit(address, bit, on != 0));

    /// Writes one byte of a register; the other byte does not change.
    ///
    /// @param registers  the registers, of a kind that may be written
    /// @param address    the device's address of the register
    /// @param high       0 for the low byte, anything else for the high byte, which is transmitted
    ///                   first. No order of `registers` exchanges them
    /// @param value      the byte, 0 to 255
    /// @return a status; see mbm_registers
    fn mbm_registers_setUint8(address: u16, high: u8, value: u8)
        = with(MBM_ORDER_DEFAULT, |registers| registers.set_u8(address, high != 0, value));

    /// As mbm_registers_setUint8, for a signed byte in two's complement.
    ///
    /// @param value  the byte, -128 to 127
    fn mbm_registers_setInt8(address: u16, high: u8, value: i8)
        = with(MBM_ORDER_DEFAULT, |registers| registers.set_i8(address, high != 0, value));

    /// Writes a number into one register. The order of words has no effect; the order of
    /// bytes has.
    ///
    /// @param registers  the registers, of a kind that may be written
    /// @param address    the device's address of its first register
    /// @param order      one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
    /// @param value      the number
    /// @return a status; see mbm_registers
    fn mbm_registers_setUint16(address: u16, order: u8, value: u16)
        = set(address, order, In::from(&value).cast(), 2);

    /// Writes a number into two registers.
    ///
    /// @return as mbm_registers_setUint16
    fn mbm_registers_setUint32(address: u16, order: u8, value: u32)
        = set(address, order, In::from(&value).cast(), 4);

    /// Writes a number into four registers.
    ///
    /// @param value  points to the number
    /// @return as mbm_registers_setUint16
    fn mbm_registers_setUint64(address: u16, order: u8, value: In<u64>)
        = set(address, order, value.cast(), 8);

    /// Writes a float into two registers, as an IEEE 754 binary32. Its bits are copied.
    ///
    /// @param value  points to the number
    /// @return as mbm_registers_setUint16
    fn mbm_registers_setFloat(address: u16, order: u8, value: In<f32>)
        = set(address, order, value.cast(), 4);
}

/// Writes a double into four registers, as an IEEE 754 binary64. On AVR, where a double
/// of C has 32 bits (-mdouble=32), it is converted without loss.
///
/// @param value  points to the number
/// @return as mbm_registers_setUint16
#[no_mangle]
pub extern "C" fn mbm_registers_setDouble(
    registers: In<mbm_registers>,
    address: u16,
    order: u8,
    value: In<f64>,
) -> u8 {
    #[cfg(not(target_arch = "avr"))]
    {
        set(registers, address, order, value.cast(), 8)
    }
    // C's double is a float here.
    #[cfg(target_arch = "avr")]
    {
        match value.cast::<ShortDouble>().get() {
            Ok(double) => {
                let mut bytes = double.to_bytes();
                bytes.reverse();
                set(registers, address, order, In::from(&bytes).cast(), 8)
            }
            Err(refused) => refused.code(),
        }
    }
}

/// Writes a text into a field and fills the rest of the field with NULs, in the layout
/// that mbm_registers_getString reads.
///
/// @param registers  the registers, of a kind that may be written
/// @param address    the device's address of the first register of the field
/// @param length     length of the field in bytes, two for each register; if it is odd, the byte
///                   after the field becomes 0 too
/// @param order      one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
/// @param text       the text; ends with a NUL, which need not fit into the field
/// @return a status; see mbm_registers. MBM_BUFFER_TOO_SMALL if the text is longer than the
///         field
#[no_mangle]
pub extern "C" fn mbm_registers_setString(
    registers: In<mbm_registers>,
    address: u16,
    length: u16,
    order: u8,
    text: In<c_char>,
) -> u8 {
    let length = usize::from(length);
    with(registers, order, |registers| {
        registers.set_text(address, length, text.cast().text(length)?)
    })
}

functions! {
    safe (registers: In<mbm_registers>)

    /// Writes raw bytes. With MBM_ORDER_ABCD and MBM_ORDER_CDAB the high byte of each
    /// register is first, as on the wire; with MBM_ORDER_BADC and MBM_ORDER_DCBA the low
    /// byte, for a device that swaps the bytes of its registers.
    ///
    /// @param registers  the registers, of a kind that may be written
    /// @param address    the device's address of the first register
    /// @param order      one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
    /// @param bytes      the bytes; must not overlap the registers
    /// @param length     how many bytes, two for each register; if it is odd, the other byte of the
    ///                   last register does not change
    /// @return a status; see mbm_registers
    fn mbm_registers_setBytes(address: u16, order: u8, bytes: In<u8>, length: u16)
        = with(order, |registers| {
            registers.set_bytes_in(registers.order, address, bytes.slice(length.into())?)
        });
}
