//! `mbm_bits_*`: coils and discrete inputs, packed in bytes as they travel or in
//! words as the master keeps them.

use super::pointers::{put_result, slice, slice_mut};
use mbm::data::bits::{self, Packed};
use mbm::error::Status;

fn code(result: Result<(), Status>) -> u8 {
    result.err().unwrap_or(Status::OK).code()
}

/// How many units hold so many bits.
fn units<T: Packed>(quantity: u16) -> usize {
    usize::from(quantity).div_ceil(T::BITS)
}

/// # Safety
/// As [`slice`] demands of both.
unsafe fn pack<T: Packed>(coils: *const u8, quantity: u16, units: *mut T, length: u16) -> u8 {
    // SAFETY: as the caller promises.
    code(unsafe {
        slice(coils, quantity.into()).and_then(|coils| {
            let on = coils.iter().map(|coil| *coil != 0);
            bits::pack(slice_mut(units, length.into())?, on)
        })
    })
}

/// # Safety
/// As [`slice`] demands of both.
unsafe fn unpack<T: Packed>(units: *const T, length: u16, coils: *mut u8, quantity: u16) -> u8 {
    // SAFETY: as the caller promises.
    code(unsafe {
        slice(units, length.into()).and_then(|units| {
            let coils = slice_mut(coils, quantity.into())?;
            for (coil, on) in coils.iter_mut().zip(bits::unpack(units, quantity.into())?) {
                *coil = on.into();
            }
            Ok(())
        })
    })
}

/// # Safety
/// As [`slice`] demands of `units`, which hold `quantity` bits; `on` is NULL or
/// points to a byte.
unsafe fn is_set<T: Packed>(
    units: *const T,
    first: u16,
    quantity: u16,
    address: u16,
    on: *mut u8,
) -> u8 {
    // SAFETY: as the caller promises.
    code(unsafe {
        slice(units, self::units::<T>(quantity)).and_then(|units| {
            put_result(on, || {
                bits::is_set(units, first, quantity, address).map(u8::from)
            })
        })
    })
}

/// # Safety
/// As [`slice_mut`] demands of `units`, which hold `quantity` bits.
unsafe fn set<T: Packed>(units: *mut T, first: u16, quantity: u16, address: u16, on: u8) -> u8 {
    // SAFETY: as the caller promises.
    code(unsafe {
        slice_mut(units, self::units::<T>(quantity))
            .and_then(|units| bits::set(units, first, quantity, address, on != 0))
    })
}

/// Packs coils for a write, the first into the lowest bit of the first byte (V1.1b3,
/// 6.11); unused bits of the last byte become 0, bytes behind it stay.
///
/// @param coils     a byte a coil: 0 is off, anything else is on
/// @param quantity  how many coils, 0 to 65535
/// @param bytes     gets the bits, 8 a byte
/// @param length    how many bytes there are
/// @return MBM_OK, or with nothing packed MBM_BUFFER_TOO_SMALL or
///         MBM_INVALID_ARGUMENT for a NULL pointer
#[no_mangle]
pub unsafe extern "C" fn mbm_bits_pack(
    coils: *const u8,
    quantity: u16,
    bytes: *mut u8,
    length: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { pack(coils, quantity, bytes, length) }
}

/// Unpacks the coils or discrete inputs of a read (V1.1b3, 6.1).
///
/// @param bytes     the bits, 8 a byte, the first coil the lowest
/// @param length    how many bytes there are
/// @param coils     gets 0 or 1 a coil
/// @param quantity  how many coils, 0 to 65535
/// @return MBM_OK, or with nothing unpacked MBM_ILLEGAL_DATA_ADDRESS if there are
///         not so many bits, MBM_INVALID_ARGUMENT for a NULL pointer
#[no_mangle]
pub unsafe extern "C" fn mbm_bits_unpack(
    bytes: *const u8,
    length: u16,
    coils: *mut u8,
    quantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { unpack(bytes, length, coils, quantity) }
}

/// Whether a coil or discrete input is set, by the device's address.
///
/// @param bytes     the bits of a read, 8 a byte, the first coil the lowest
/// @param first     the address of the first coil
/// @param quantity  how many coils were read; `bytes` has room for so many
/// @param address   the coil
/// @param on        gets 0 or 1
/// @return MBM_OK, or with `on` unchanged MBM_ILLEGAL_DATA_ADDRESS for a coil that
///         is not among them or a range that passes 65535, MBM_INVALID_ARGUMENT
///         for a NULL pointer
#[no_mangle]
pub unsafe extern "C" fn mbm_bits_isSet(
    bytes: *const u8,
    first: u16,
    quantity: u16,
    address: u16,
    on: *mut u8,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { is_set(bytes, first, quantity, address, on) }
}

/// Sets a coil for a write, by the device's address; the others stay.
///
/// @param bytes     the bits of a write, 8 a byte, the first coil the lowest
/// @param first     the address of the first coil
/// @param quantity  how many coils are written; `bytes` has room for so many
/// @param address   the coil
/// @param on        0 is off, anything else is on
/// @return MBM_OK, or with nothing set MBM_ILLEGAL_DATA_ADDRESS for a coil that is
///         not among them or a range that passes 65535, MBM_INVALID_ARGUMENT for
///         a NULL pointer
#[no_mangle]
pub unsafe extern "C" fn mbm_bits_set(
    bytes: *mut u8,
    first: u16,
    quantity: u16,
    address: u16,
    on: u8,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { set(bytes, first, quantity, address, on) }
}

/// As mbm_bits_pack, into words such as mbm_master's transmit words, 16 to a word.
///
/// @param coils     a byte a coil: 0 is off, anything else is on
/// @param quantity  how many coils, 0 to 65535
/// @param words     gets the bits, 16 a word
/// @param length    how many words there are
/// @return MBM_OK, or with nothing packed MBM_BUFFER_TOO_SMALL or
///         MBM_INVALID_ARGUMENT for a NULL pointer
#[no_mangle]
pub unsafe extern "C" fn mbm_bits_packWords(
    coils: *const u8,
    quantity: u16,
    words: *mut u16,
    length: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { pack(coils, quantity, words, length) }
}

/// As mbm_bits_unpack, of words such as mbm_master's response words.
///
/// @param words     the bits, 16 a word, the first coil the lowest
/// @param length    how many words there are
/// @param coils     gets 0 or 1 a coil
/// @param quantity  how many coils, 0 to 65535
/// @return MBM_OK, or with nothing unpacked MBM_ILLEGAL_DATA_ADDRESS if there are
///         not so many bits, MBM_INVALID_ARGUMENT for a NULL pointer
#[no_mangle]
pub unsafe extern "C" fn mbm_bits_unpackWords(
    words: *const u16,
    length: u16,
    coils: *mut u8,
    quantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { unpack(words, length, coils, quantity) }
}

/// As mbm_bits_isSet, in words such as mbm_master's response words.
///
/// @param words     the bits of a read, 16 a word, the first coil the lowest
/// @param first     the address of the first coil
/// @param quantity  how many coils were read; `words` has room for so many
/// @param address   the coil
/// @param on        gets 0 or 1
/// @return MBM_OK, or with `on` unchanged MBM_ILLEGAL_DATA_ADDRESS for a coil that
///         is not among them or a range that passes 65535, MBM_INVALID_ARGUMENT
///         for a NULL pointer
#[no_mangle]
pub unsafe extern "C" fn mbm_bits_isSetInWords(
    words: *const u16,
    first: u16,
    quantity: u16,
    address: u16,
    on: *mut u8,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { is_set(words, first, quantity, address, on) }
}

/// As mbm_bits_set, in words such as mbm_master's transmit words.
///
/// @param words     the bits of a write, 16 a word, the first coil the lowest
/// @param first     the address of the first coil
/// @param quantity  how many coils are written; `words` has room for so many
/// @param address   the coil
/// @param on        0 is off, anything else is on
/// @return MBM_OK, or with nothing set MBM_ILLEGAL_DATA_ADDRESS for a coil that is
///         not among them or a range that passes 65535, MBM_INVALID_ARGUMENT for
///         a NULL pointer
#[no_mangle]
pub unsafe extern "C" fn mbm_bits_setInWords(
    words: *mut u16,
    first: u16,
    quantity: u16,
    address: u16,
    on: u8,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { set(words, first, quantity, address, on) }
}
