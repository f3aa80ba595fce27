//! `mbm_bits_*`: coils and discrete inputs, packed in bytes as on the wire, or in words as
//! in the master's word buffers.

use super::pointers::{In, Out};
use mbm::data::bits::{self, Packed};
use mbm::error::{Error, Status};

fn code(result: Result<(), Error>) -> u8 {
    Status::from(result).code()
}

/// The number of bytes or words that hold `quantity` bits.
fn units<T: Packed>(quantity: u16) -> usize {
    usize::from(quantity).div_ceil(T::BITS)
}

fn read_bit<T: Packed>(units: In<T>, first: u16, quantity: u16, address: u16, on: Out<u8>) -> u8 {
    code(units.slice(self::units::<T>(quantity)).and_then(|units| {
        on.put_result(|| bits::is_set(units, first, quantity, address).map(u8::from))
    }))
}

fn set<T: Packed>(units: Out<T>, first: u16, quantity: u16, address: u16, on: u8) -> u8 {
    code(
        units
            .slice(self::units::<T>(quantity))
            .and_then(|units| bits::set(units, first, quantity, address, on != 0)),
    )
}

/// Packs coils into bytes for a write. The first coil goes into the lowest bit of the
/// first byte (V1.1b3, 6.11). Unused bits of the last byte become 0; the bytes after it do
/// not change.
///
/// @param coils     one byte for each coil: 0 is off, any other value is on
/// @param quantity  the number of coils, 0 to 65535
/// @param bytes     receives the bits, 8 in each byte
/// @param length    the number of bytes that `bytes` can hold
/// @return a status; MBM_BUFFER_TOO_SMALL, with nothing packed
#[no_mangle]
pub extern "C" fn mbm_bits_pack(coils: In<u8>, quantity: u16, bytes: Out<u8>, length: u16) -> u8 {
    code(coils.slice(quantity.into()).and_then(|coils| {
        let on = coils.iter().map(|coil| *coil != 0);
        bits::pack(bytes.slice(length.into())?, on)
    }))
}

/// Unpacks the coils or discrete inputs that a read returned in bytes (V1.1b3, 6.1).
///
/// @param bytes     the bits, 8 in each byte; the first coil is the lowest bit
/// @param length    the number of bytes
/// @param coils     receives one byte for each coil, 0 or 1
/// @param quantity  the number of coils, 0 to 65535
/// @return a status; MBM_ILLEGAL_DATA_ADDRESS if `bytes` has fewer bits than `quantity`
#[no_mangle]
pub extern "C" fn mbm_bits_unpack(bytes: In<u8>, length: u16, coils: Out<u8>, quantity: u16) -> u8 {
    code(bytes.slice(length.into()).and_then(|bytes| {
        let coils = coils.slice(quantity.into())?;
        for (coil, on) in coils.iter_mut().zip(bits::unpack(bytes, quantity.into())?) {
            *coil = on.into();
        }
        Ok(())
    }))
}

functions! {
    safe ()

    /// Gets the state of one coil or discrete input of a read, by its address in the device.
    ///
    /// @param bytes     the bits of the read, 8 in each byte; the first coil is the lowest bit
    /// @param first     the address of the first coil of the read
    /// @param quantity  the number of coils that were read; `bytes` holds that many bits
    /// @param address   the address of the coil
    /// @param on        receives 0 or 1
    /// @return a status; MBM_ILLEGAL_DATA_ADDRESS if the coil is outside of the read or the read
    ///         passes address 65535
    fn mbm_bits_isSet(bytes: In<u8>, first: u16, quantity: u16, address: u16, on: Out<u8>)
        = read_bit(bytes, first, quantity, address, on);

    /// Sets one coil of a write, by its address in the device. The other coils do not change.
    ///
    /// @param bytes     the bits of the write, 8 in each byte; the first coil is the lowest bit
    /// @param first     the address of the first coil of the write
    /// @param quantity  the number of coils of the write; `bytes` holds that many bits
    /// @param address   the address of the coil
    /// @param on        0 is off, any other value is on
    /// @return a status; MBM_ILLEGAL_DATA_ADDRESS if the coil is outside of the write or the write
    ///         passes address 65535
    fn mbm_bits_set(bytes: Out<u8>, first: u16, quantity: u16, address: u16, on: u8)
        = set(bytes, first, quantity, address, on);

    /// As mbm_bits_isSet, but in words, for example the response words of a node.
    ///
    /// @param words     the bits of the read, 16 in each word; the first coil is the lowest bit
    /// @return a status; MBM_ILLEGAL_DATA_ADDRESS if the coil is outside of the read or the read
    ///         passes address 65535
    fn mbm_bits_isSetInWords(words: In<u16>, first: u16, quantity: u16, address: u16, on: Out<u8>)
        = read_bit(words, first, quantity, address, on);

    /// As mbm_bits_set, but in words, for example the transmit words of a node.
    ///
    /// @param words     the bits of the write, 16 in each word; the first coil is the lowest bit
    /// @return a status; MBM_ILLEGAL_DATA_ADDRESS if the coil is outside of the write or the write
    ///         passes address 65535
    fn mbm_bits_setInWords(words: Out<u16>, first: u16, quantity: u16, address: u16, on: u8)
        = set(words, first, quantity, address, on);
}
