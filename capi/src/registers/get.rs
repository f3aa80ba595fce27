//! Reads values from registers. A call that fails leaves the caller's value unchanged.

use super::{code, machine_order_mask, mbm_registers, view, BorrowedRegisters, MBM_ORDER_DEFAULT};
use crate::pointers::{In, Out};
use core::ffi::c_char;
#[cfg(target_arch = "avr")]
use mbm::data::value::{ShortDouble, Value};
use mbm::data::view::Registers;
use mbm::error::{Error, Status};

/// Writes the value that `find` returns to `value`.
pub(super) fn get_value<T>(
    registers: In<mbm_registers>,
    order: u8,
    value: Out<T>,
    find: impl FnOnce(&Registers<BorrowedRegisters>) -> Result<T, Error>,
) -> u8 {
    code(view(registers, order, false).and_then(|registers| value.put_result(|| find(&registers))))
}

/// Writes the bytes of a number to `number`, in the byte order of this machine. One
/// function for all numbers of a size keeps the code small.
fn get(registers: In<mbm_registers>, address: u16, order: u8, number: Out<u8>, size: usize) -> u8 {
    if number.is_null() {
        return Status::INVALID_ARGUMENT.code();
    }
    code(view(registers, order, false).and_then(|registers| {
        let mask = registers.order.mask(size) ^ machine_order_mask(size);
        registers.load(address, mask, number.slice(size)?)
    }))
}

functions! {
    safe (registers: In<mbm_registers>)

    /// Reads one bit of a register.
    ///
    /// @param address  the device's address of the register
    /// @param bit      0, the least significant, to 15
    /// @param on       receives 0 or 1
    /// @return a status; see mbm_registers
    fn mbm_registers_getBit(address: u16, bit: u8, on: Out<u8>)
        = get_value(MBM_ORDER_DEFAULT, on, |registers| registers.bit(address, bit).map(u8::from));

    /// Reads one byte of a register, 0 to 255.
    ///
    /// @param address  the device's address of the register
    /// @param high     0 for the low byte, anything else for the high byte, which is transmitted
    ///                 first. No order of `registers` exchanges them
    /// @param value    receives the byte
    /// @return a status; see mbm_registers
    fn mbm_registers_getUint8(address: u16, high: u8, value: Out<u8>)
        = get_value(MBM_ORDER_DEFAULT, value, |registers| registers.u8(address, high != 0));

    /// As mbm_registers_getUint8, for a signed byte in two's complement, -128 to 127.
    fn mbm_registers_getInt8(address: u16, high: u8, value: Out<i8>)
        = get_value(MBM_ORDER_DEFAULT, value, |registers| registers.i8(address, high != 0));

    /// Compares registers with bytes, in the order of the wire: the high byte of each register
    /// first, whatever the order of `registers`.
    ///
    /// @param address  the device's address of the register whose high byte is compared with the
    ///                 first byte
    /// @param bytes    the bytes
    /// @param length   how many bytes, two for each register; may be odd
    /// @param equal    receives 1 if all bytes are equal, otherwise 0. It is 1 for no bytes
    /// @return a status; see mbm_registers
    fn mbm_registers_isEqualBytes(address: u16, bytes: In<u8>, length: u16, equal: Out<u8>)
        = get_value(MBM_ORDER_DEFAULT, equal, |registers| {
            let is_equal = registers.is_equal(address, bytes.slice(length.into())?)?;
            Ok(is_equal.into())
        });

    /// Reads a number of one register, 0 to 65535. For a signed number, pass a pointer to an
    /// int16_t, cast to uint16_t *. The order of words has no effect; the order of bytes has.
    ///
    /// @param address  the device's address of its first register
    /// @param order    one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
    /// @param value    receives the number
    /// @return a status; see mbm_registers
    fn mbm_registers_getUint16(address: u16, order: u8, value: Out<u16>)
        = get(address, order, value.cast(), 2);

    /// Reads a number of two registers, 0 to 4294967295. For a signed number (two's
    /// complement), pass a pointer to an int32_t, cast to uint32_t *.
    ///
    /// @return as mbm_registers_getUint16
    fn mbm_registers_getUint32(address: u16, order: u8, value: Out<u32>)
        = get(address, order, value.cast(), 4);

    /// Reads a number of four registers. For a signed number, pass a pointer to an int64_t,
    /// cast to uint64_t *.
    ///
    /// @return as mbm_registers_getUint16
    fn mbm_registers_getUint64(address: u16, order: u8, value: Out<u64>)
        = get(address, order, value.cast(), 8);

    /// Reads a float of two registers, an IEEE 754 binary32. Its bits are copied, also those
    /// of a NaN.
    ///
    /// @return as mbm_registers_getUint16
    fn mbm_registers_getFloat(address: u16, order: u8, value: Out<f32>)
        = get(address, order, value.cast(), 4);
}

/// Reads a double of four registers, an IEEE 754 binary64. Its bits are copied. On AVR,
/// where a double of C has 32 bits (-mdouble=32), the number is rounded to the nearest.
///
/// @return as mbm_registers_getUint16
#[no_mangle]
pub extern "C" fn mbm_registers_getDouble(
    registers: In<mbm_registers>,
    address: u16,
    order: u8,
    value: Out<f64>,
) -> u8 {
    #[cfg(not(target_arch = "avr"))]
    {
        get(registers, address, order, value.cast(), 8)
    }
    // C's double is a float here.
    #[cfg(target_arch = "avr")]
    {
        let mut bytes = [0; 8];
        let status = get(registers, address, order, Out::from(&mut bytes).cast(), 8);
        if status != Status::OK.code() {
            return status;
        }
        bytes.reverse();
        let double = ShortDouble::from_bytes(bytes);
        code(value.cast().put_result(|| Ok(double)))
    }
}

/// Reads a text. It ends at its first NUL or at the end of its field.
///
/// The registers of a text follow each other in every order. In an order with the low
/// byte first, the first of two characters is the low byte of a register. Characters are
/// copied without a check, also if they are not ASCII.
///
/// @param address   the device's address of the first register of the field
/// @param length    length of the field in bytes, two for each register; an odd length ends with
///                  the first character of a register
/// @param order     one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
/// @param text      receives the text and a NUL
/// @param capacity  size of `text` in bytes; `length + 1` are always enough
/// @return a status; see mbm_registers. MBM_BUFFER_TOO_SMALL if `text` is
#[no_mangle]
pub extern "C" fn mbm_registers_getString(
    registers: In<mbm_registers>,
    address: u16,
    length: u16,
    order: u8,
    text: Out<c_char>,
    capacity: u16,
) -> u8 {
    if text.is_null() {
        return Status::INVALID_ARGUMENT.code();
    }
    code(view(registers, order, false).and_then(|registers| {
        let text = text.cast::<u8>().slice(capacity.into())?;
        let (end, place) = text.split_last_mut().ok_or(Error::BufferTooSmall)?;
        let count = registers.text(address, length.into(), place)?.len();
        *place.get_mut(count).unwrap_or(end) = 0;
        Ok(())
    }))
}

/// Reads raw bytes. With MBM_ORDER_ABCD and MBM_ORDER_CDAB the high byte of each register
/// is first, as on the wire; with MBM_ORDER_BADC and MBM_ORDER_DCBA the low byte, for a
/// device that swaps the bytes of its registers.
///
/// @param address  the device's address of the first register
/// @param order    one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
/// @param bytes    receives the bytes; must not overlap the registers
/// @param length   how many bytes, two for each register; may be odd
/// @return a status; see mbm_registers
#[no_mangle]
pub extern "C" fn mbm_registers_getBytes(
    registers: In<mbm_registers>,
    address: u16,
    order: u8,
    bytes: Out<u8>,
    length: u16,
) -> u8 {
    code(view(registers, order, false).and_then(|registers| {
        let bytes = bytes.slice(length.into())?;
        registers.bytes_in(registers.order, address, bytes)
    }))
}
