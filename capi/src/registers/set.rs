//! Values into registers. What fails leaves the registers as they were.
//!
//! Numbers of 64 bits and floats come by pointer: what passes through registers
//! of the processor differs between compilers and float units.

use super::{code, lent, mbm_registers, native, BorrowedRegisters, MBM_ORDER_DEFAULT};
use crate::pointers::{self, slice};
use core::ffi::c_char;
#[cfg(target_arch = "avr")]
use mbm::data::value::{ShortDouble, Value};
use mbm::data::view::Registers;
use mbm::error::Status;

/// Runs `action` on registers to write.
///
/// # Safety
/// As for [`lent`].
unsafe fn with(
    registers: *const mbm_registers,
    order: u8,
    action: impl FnOnce(&mut Registers<BorrowedRegisters>) -> Result<(), Status>,
) -> u8 {
    // SAFETY: as the caller promises.
    code(unsafe { lent(registers, order, true) }.and_then(|mut registers| action(&mut registers)))
}

/// Sets a number from its bytes as this machine has them: all numbers of a size
/// in one function, for flash.
///
/// # Safety
/// As for [`lent`]; `number` is NULL or points to one of `size` bytes.
#[cfg_attr(target_os = "none", inline(never))]
unsafe fn set(
    registers: *const mbm_registers,
    address: u16,
    order: u8,
    number: *const u8,
    size: usize,
) -> u8 {
    // SAFETY: as the caller promises.
    unsafe {
        with(registers, order, |registers| {
            let mask = registers.order.mask(size) ^ native(size);
            registers.store(address, mask, slice(number, size)?)
        })
    }
}

/// Sets one bit of a register; the others stay.
///
/// @param registers  the registers, of a kind to write
/// @param address    the register, by the device's address
/// @param bit        0, the least significant, to 15
/// @param on         0 is off, anything else is on
/// @return MBM_OK, or with nothing set MBM_ILLEGAL_DATA_ADDRESS for a register that
///         is not there, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_registers_setBit(
    registers: *const mbm_registers,
    address: u16,
    bit: u8,
    on: u8,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(registers, MBM_ORDER_DEFAULT, |registers| {
            registers.set_bit(address, bit, on != 0)
        })
    }
}

/// Sets one byte of a register; the other stays.
///
/// @param registers  the registers, of a kind to write
/// @param address    the register, by the device's address
/// @param high       0 for the low byte, anything else for the high byte, which
///                   travels first
/// @param value      the byte
/// @return MBM_OK, or with nothing set MBM_ILLEGAL_DATA_ADDRESS for a register that
///         is not there, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_registers_setUint8(
    registers: *const mbm_registers,
    address: u16,
    high: u8,
    value: u8,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(registers, MBM_ORDER_DEFAULT, |registers| {
            registers.set_u8(address, high != 0, value)
        })
    }
}

/// Sets a number of one register. Of the order only the bytes matter.
///
/// @param registers  the registers, of a kind to write
/// @param address    the register, by the device's address
/// @param order      one of MBM_ORDER_..., MBM_ORDER_DEFAULT for that of `registers`
/// @param value      the number
/// @return MBM_OK, or with nothing set MBM_ILLEGAL_DATA_ADDRESS for a register
///         that is not there, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_registers_setUint16(
    registers: *const mbm_registers,
    address: u16,
    order: u8,
    value: u16,
) -> u8 {
    // SAFETY: as the header demands; the number is there.
    unsafe { set(registers, address, order, (&raw const value).cast(), 2) }
}

/// Sets a number of two registers.
///
/// @param registers  the registers, of a kind to write
/// @param address    the first of its registers, by the device's address
/// @param order      one of MBM_ORDER_..., MBM_ORDER_DEFAULT for that of `registers`
/// @param value      the number
/// @return MBM_OK, or with nothing set MBM_ILLEGAL_DATA_ADDRESS for two registers
///         that are not both there, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_registers_setUint32(
    registers: *const mbm_registers,
    address: u16,
    order: u8,
    value: u32,
) -> u8 {
    // SAFETY: as the header demands; the number is there.
    unsafe { set(registers, address, order, (&raw const value).cast(), 4) }
}

/// Sets a number of four registers.
///
/// @param registers  the registers, of a kind to write
/// @param address    the first of its registers, by the device's address
/// @param order      one of MBM_ORDER_..., MBM_ORDER_DEFAULT for that of `registers`
/// @param value      points to the number
/// @return MBM_OK, or with nothing set MBM_ILLEGAL_DATA_ADDRESS for four registers
///         that are not all there, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_registers_setUint64(
    registers: *const mbm_registers,
    address: u16,
    order: u8,
    value: *const u64,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { set(registers, address, order, value.cast(), 8) }
}

/// Sets a float of two registers, an IEEE 754 binary32. Its bits are copied.
///
/// @param registers  the registers, of a kind to write
/// @param address    the first of its registers, by the device's address
/// @param order      one of MBM_ORDER_..., MBM_ORDER_DEFAULT for that of `registers`
/// @param value      points to the number
/// @return MBM_OK, or with nothing set MBM_ILLEGAL_DATA_ADDRESS for two registers
///         that are not both there, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_registers_setFloat(
    registers: *const mbm_registers,
    address: u16,
    order: u8,
    value: *const f32,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { set(registers, address, order, value.cast(), 4) }
}

/// Sets a double of four registers, an IEEE 754 binary64. On AVR, where C's
/// double has 32 bits (-mdouble=32), to the value that it has there.
///
/// @param registers  the registers, of a kind to write
/// @param address    the first of its registers, by the device's address
/// @param order      one of MBM_ORDER_..., MBM_ORDER_DEFAULT for that of `registers`
/// @param value      points to the number
/// @return MBM_OK, or with nothing set MBM_ILLEGAL_DATA_ADDRESS for four registers
///         that are not all there, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_registers_setDouble(
    registers: *const mbm_registers,
    address: u16,
    order: u8,
    value: *const f64,
) -> u8 {
    // SAFETY: as the header demands.
    #[cfg(not(target_arch = "avr"))]
    unsafe {
        set(registers, address, order, value.cast(), 8)
    }
    // SAFETY: as the header demands; C's double is a float here.
    #[cfg(target_arch = "avr")]
    unsafe {
        match pointers::get(value.cast::<ShortDouble>()) {
            Some(double) => {
                let mut bytes = double.to_bytes();
                bytes.reverse();
                set(registers, address, order, bytes.as_ptr(), 8)
            }
            None => Status::INVALID_ARGUMENT.code(),
        }
    }
}

/// Fills a field with a text and NULs behind it, laid out as
/// mbm_registers_getString reads it.
///
/// @param registers  the registers, of a kind to write
/// @param address    the first of its registers, by the device's address
/// @param length     bytes of the field, two a register; if it is odd, the byte
///                   behind the field becomes 0 too
/// @param order      one of MBM_ORDER_..., MBM_ORDER_DEFAULT for that of `registers`
/// @param text       ends with a NUL, which needs no room in the field
/// @return MBM_OK, or with nothing set MBM_ILLEGAL_DATA_ADDRESS if the field is not
///         all there, MBM_BUFFER_TOO_SMALL for a text longer than the field,
///         MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_registers_setString(
    registers: *const mbm_registers,
    address: u16,
    length: u16,
    order: u8,
    text: *const c_char,
) -> u8 {
    let length = usize::from(length);
    // SAFETY: as the header demands.
    unsafe {
        with(registers, order, |registers| {
            registers.set_text(address, length, pointers::text(text.cast(), length)?)
        })
    }
}

/// Sets raw bytes. With MBM_ORDER_ABCD and MBM_ORDER_CDAB the high byte of each register
/// comes first, as on the wire; with MBM_ORDER_BADC and MBM_ORDER_DCBA the low byte, for a
/// device that swaps the bytes of its registers.
///
/// @param registers  the registers, of a kind to write
/// @param address    the first register, by the device's address
/// @param order      one of MBM_ORDER_..., MBM_ORDER_DEFAULT for that of `registers`
/// @param bytes      the bytes; must not overlap the registers
/// @param length     how many bytes, two a register; if odd, the other byte of the
///                   last register stays
/// @return MBM_OK, or with nothing changed MBM_ILLEGAL_DATA_ADDRESS if there are not so
///         many, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_registers_setBytes(
    registers: *const mbm_registers,
    address: u16,
    order: u8,
    bytes: *const u8,
    length: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(registers, order, |registers| {
            registers.set_bytes_in(registers.order, address, slice(bytes, length.into())?)
        })
    }
}
