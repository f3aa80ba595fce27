//! Values out of registers. What fails leaves the caller's value as it was.

use super::{code, lent, mbm_registers, native, BorrowedRegisters, MBM_ORDER_DEFAULT};
use crate::pointers::{self, slice, slice_mut};
use core::ffi::c_char;
#[cfg(target_arch = "avr")]
use mbm::data::value::{ShortDouble, Value};
use mbm::data::view::Registers;
use mbm::error::Status;

/// Puts what `question` finds where C wants it.
///
/// # Safety
/// As for [`lent`]; `answer` is NULL or points to a `T`.
unsafe fn ask<T>(
    registers: *const mbm_registers,
    answer: *mut T,
    question: impl FnOnce(&Registers<BorrowedRegisters>) -> Result<T, Status>,
) -> u8 {
    // SAFETY: as the caller promises.
    code(unsafe {
        lent(registers, MBM_ORDER_DEFAULT, false)
            .and_then(|registers| pointers::put_result(answer, || question(&registers)))
    })
}

/// Puts the bytes of a number where C wants them, as this machine has them:
/// all numbers of a size in one function, for flash.
///
/// # Safety
/// As for [`lent`]; `number` is NULL or points to one of `size` bytes.
#[cfg_attr(target_os = "none", inline(never))]
unsafe fn get(
    registers: *const mbm_registers,
    address: u16,
    order: u8,
    number: *mut u8,
    size: usize,
) -> u8 {
    if number.is_null() {
        return Status::INVALID_ARGUMENT.code();
    }
    // SAFETY: as the caller promises.
    code(unsafe {
        lent(registers, order, false).and_then(|registers| {
            let mask = registers.order.mask(size) ^ native(size);
            registers.load(address, mask, slice_mut(number, size)?)
        })
    })
}

/// One bit of a register.
///
/// @param registers  the registers
/// @param address    the register, by the device's address
/// @param bit        0, the least significant, to 15
/// @param on         gets 0 or 1
/// @return MBM_OK, MBM_ILLEGAL_DATA_ADDRESS for a register that is not there,
///         MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED, with `on` unchanged
#[no_mangle]
pub unsafe extern "C" fn mbm_registers_getBit(
    registers: *const mbm_registers,
    address: u16,
    bit: u8,
    on: *mut u8,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        ask(registers, on, |registers| {
            registers.bit(address, bit).map(u8::from)
        })
    }
}

/// One byte of a register, 0 to 255; for a signed one, cast the pointer to an int8_t.
///
/// @param registers  the registers
/// @param address    the register, by the device's address
/// @param high       0 for the low byte, anything else for the high byte, which
///                   travels first
/// @param value      gets the byte
/// @return MBM_OK, MBM_ILLEGAL_DATA_ADDRESS for a register that is not there,
///         MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED, with `value` unchanged
#[no_mangle]
pub unsafe extern "C" fn mbm_registers_getUint8(
    registers: *const mbm_registers,
    address: u16,
    high: u8,
    value: *mut u8,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        ask(registers, value, |registers| {
            registers.u8(address, high != 0)
        })
    }
}

/// A number of one register, 0 to 65535; for a signed number, cast the pointer to an
/// int16_t. Of the order only the bytes matter.
///
/// @param registers  the registers
/// @param address    the register, by the device's address
/// @param order      one of MBM_ORDER_..., MBM_ORDER_DEFAULT for that of `registers`
/// @param value      gets the number
/// @return MBM_OK, MBM_ILLEGAL_DATA_ADDRESS for a register that is not there,
///         MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED, with `value` unchanged
#[no_mangle]
pub unsafe extern "C" fn mbm_registers_getUint16(
    registers: *const mbm_registers,
    address: u16,
    order: u8,
    value: *mut u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { get(registers, address, order, value.cast(), 2) }
}

/// A number of two registers, 0 to 4294967295; for a signed number (two's complement),
/// cast the pointer to an int32_t.
///
/// @param registers  the registers
/// @param address    the first of its registers, by the device's address
/// @param order      one of MBM_ORDER_..., MBM_ORDER_DEFAULT for that of `registers`
/// @param value      gets the number
/// @return MBM_OK, MBM_ILLEGAL_DATA_ADDRESS for two registers that are not both there,
///         MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED, with `value` unchanged
#[no_mangle]
pub unsafe extern "C" fn mbm_registers_getUint32(
    registers: *const mbm_registers,
    address: u16,
    order: u8,
    value: *mut u32,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { get(registers, address, order, value.cast(), 4) }
}

/// A number of four registers; for a signed number, cast the pointer to an int64_t.
///
/// @param registers  the registers
/// @param address    the first of its registers, by the device's address
/// @param order      one of MBM_ORDER_..., MBM_ORDER_DEFAULT for that of `registers`
/// @param value      gets the number
/// @return MBM_OK, MBM_ILLEGAL_DATA_ADDRESS for four registers that are not all there,
///         MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED, with `value` unchanged
#[no_mangle]
pub unsafe extern "C" fn mbm_registers_getUint64(
    registers: *const mbm_registers,
    address: u16,
    order: u8,
    value: *mut u64,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { get(registers, address, order, value.cast(), 8) }
}

/// A float of two registers, an IEEE 754 binary32. Its bits are copied, those
/// of what is not a number too.
///
/// @param registers  the registers
/// @param address    the first of its registers, by the device's address
/// @param order      one of MBM_ORDER_..., MBM_ORDER_DEFAULT for that of `registers`
/// @param value      gets the number
/// @return MBM_OK, MBM_ILLEGAL_DATA_ADDRESS for two registers that are not both there,
///         MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED, with `value` unchanged
#[no_mangle]
pub unsafe extern "C" fn mbm_registers_getFloat(
    registers: *const mbm_registers,
    address: u16,
    order: u8,
    value: *mut f32,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { get(registers, address, order, value.cast(), 4) }
}

/// A double of four registers, an IEEE 754 binary64. Its bits are copied; on AVR,
/// where C's double has 32 bits (-mdouble=32), it is rounded to the nearest.
///
/// @param registers  the registers
/// @param address    the first of its registers, by the device's address
/// @param order      one of MBM_ORDER_..., MBM_ORDER_DEFAULT for that of `registers`
/// @param value      gets the number
/// @return MBM_OK, MBM_ILLEGAL_DATA_ADDRESS for four registers that are not all there,
///         MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED, with `value` unchanged
#[no_mangle]
pub unsafe extern "C" fn mbm_registers_getDouble(
    registers: *const mbm_registers,
    address: u16,
    order: u8,
    value: *mut f64,
) -> u8 {
    // SAFETY: as the header demands.
    #[cfg(not(target_arch = "avr"))]
    unsafe {
        get(registers, address, order, value.cast(), 8)
    }
    // SAFETY: as the header demands; C's double is a float here.
    #[cfg(target_arch = "avr")]
    unsafe {
        let mut bytes = [0; 8];
        let status = get(registers, address, order, bytes.as_mut_ptr(), 8);
        if status != Status::OK.code() {
            return status;
        }
        bytes.reverse();
        let double = ShortDouble::from_bytes(bytes);
        code(pointers::put_result(value.cast(), || Ok(double)))
    }
}

/// A text, which ends at its first NUL or with its field.
///
/// Its registers follow each other in every order. In one with the low byte
/// first, the first of two characters is a register's low byte. Characters are
/// copied as they are, ASCII or not.
///
/// @param registers  the registers
/// @param address    the first of its registers, by the device's address
/// @param length     bytes of its field, two a register; an odd one ends with a
///                   register's first character
/// @param order      one of MBM_ORDER_..., MBM_ORDER_DEFAULT for that of `registers`
/// @param text       gets the text and a NUL
/// @param capacity   bytes of `text`; `length + 1` are always enough
/// @return MBM_OK, MBM_ILLEGAL_DATA_ADDRESS if the field is not all there,
///         MBM_BUFFER_TOO_SMALL, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED,
///         with `text` unchanged
#[no_mangle]
pub unsafe extern "C" fn mbm_registers_getString(
    registers: *const mbm_registers,
    address: u16,
    length: u16,
    order: u8,
    text: *mut c_char,
    capacity: u16,
) -> u8 {
    if text.is_null() {
        return Status::INVALID_ARGUMENT.code();
    }
    // SAFETY: as the header demands.
    code(unsafe {
        lent(registers, order, false).and_then(|registers| {
            let text = slice_mut::<u8>(text.cast(), capacity.into())?;
            let (end, place) = text.split_last_mut().ok_or(Status::BUFFER_TOO_SMALL)?;
            let count = registers.text(address, length.into(), place)?.len();
            *place.get_mut(count).unwrap_or(end) = 0;
            Ok(())
        })
    })
}

/// Raw bytes. With MBM_ORDER_ABCD and MBM_ORDER_CDAB the high byte of each register comes
/// first, as on the wire; with MBM_ORDER_BADC and MBM_ORDER_DCBA the low byte, for a device
/// that swaps the bytes of its registers.
///
/// @param registers  the registers
/// @param address    the first register, by the device's address
/// @param order      one of MBM_ORDER_..., MBM_ORDER_DEFAULT for that of `registers`
/// @param bytes      gets the bytes; must not overlap the registers
/// @param length     how many bytes, two a register; may be odd
/// @return MBM_OK, MBM_ILLEGAL_DATA_ADDRESS if there are not so many,
///         MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED, with `bytes` unchanged
#[no_mangle]
pub unsafe extern "C" fn mbm_registers_getBytes(
    registers: *const mbm_registers,
    address: u16,
    order: u8,
    bytes: *mut u8,
    length: u16,
) -> u8 {
    // SAFETY: as the header demands.
    code(unsafe {
        lent(registers, order, false).and_then(|registers| {
            let bytes = slice_mut(bytes, length.into())?;
            registers.bytes_in(registers.order, address, bytes)
        })
    })
}

/// Whether registers hold these raw bytes, high byte first in every order.
///
/// @param registers  the registers
/// @param address    the register whose high byte is the first, by the device's
///                   address
/// @param bytes      the bytes to compare with
/// @param length     how many bytes, two a register; may be odd
/// @param equal      gets 0 or 1
/// @return MBM_OK, MBM_ILLEGAL_DATA_ADDRESS if there are not so many,
///         MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED, with `equal` unchanged
#[no_mangle]
pub unsafe extern "C" fn mbm_registers_isEqual(
    registers: *const mbm_registers,
    address: u16,
    bytes: *const u8,
    length: u16,
    equal: *mut u8,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        ask(registers, equal, |registers| {
            let bytes = slice(bytes, length.into())?;
            registers.is_equal(address, bytes).map(u8::from)
        })
    }
}
