//! Functions that read and write parts of requests and responses. An error is the exception that a
//! server answers to such a request; [`super::response`] converts it to the error of a response.

use super::functions::{self, coil_value, COIL_ON};
use crate::bytes::{Reader, Writer};
use crate::error::{Error, Status};

/// Reads a byte; an error if the PDU has ended.
pub(super) fn byte(reader: &mut Reader) -> Result<u8, Error> {
    reader.u8().ok_or(Error::ILLEGAL_DATA_VALUE)
}

/// Reads a word; an error if the PDU has ended.
pub(super) fn word(reader: &mut Reader) -> Result<u16, Error> {
    reader.u16().ok_or(Error::ILLEGAL_DATA_VALUE)
}

/// Reads a byte count and as many bytes of data.
pub(super) fn counted<'a>(reader: &mut Reader<'a>) -> Result<&'a [u8], Error> {
    let count = usize::from(byte(reader)?);
    reader.take(count).ok_or(Error::ILLEGAL_DATA_VALUE)
}

/// Checks a range of addresses as every device would (application protocol,
/// figures 11 and following: quantity first, then addresses).
pub(super) fn check_range(address: u16, quantity: u16, most: u16) -> Status {
    if quantity == 0 || quantity > most {
        Status::ILLEGAL_DATA_VALUE
    } else if address.checked_add(quantity - 1).is_none() {
        Status::ILLEGAL_DATA_ADDRESS
    } else {
        Status::OK
    }
}

/// As [`check_range`], after checking that the PDU ends here. A server checks lengths and
/// quantities before addresses (figures 11 and following).
pub(super) fn check_end_and_range(
    reader: &Reader,
    address: u16,
    quantity: u16,
    most: u16,
) -> Result<(), Error> {
    expect_end(reader)?;
    check_range(address, quantity, most).result()
}

/// Reads the address and the quantity of a range, with which the PDU ends.
pub(super) fn last_range(reader: &mut Reader, most: u16) -> Result<(u16, u16), Error> {
    let (address, quantity) = (word(reader)?, word(reader)?);
    check_end_and_range(reader, address, quantity, most)?;
    Ok((address, quantity))
}

/// Checks that the PDU ends here.
pub(super) fn expect_end(reader: &Reader) -> Result<(), Error> {
    if reader.is_empty() {
        Ok(())
    } else {
        Err(Error::ILLEGAL_DATA_VALUE)
    }
}

/// Checks that `count` is within `limits`, the least and the greatest value.
pub(super) fn check_within(count: usize, limits: (usize, usize)) -> Result<(), Error> {
    if (limits.0..=limits.1).contains(&count) {
        Ok(())
    } else {
        Err(Error::ILLEGAL_DATA_VALUE)
    }
}

/// True if the value of a single coil is on, false if it is off.
pub(super) fn is_on(value: u16) -> Result<bool, Error> {
    match value {
        COIL_ON => Ok(true),
        0 => Ok(false),
        _ => Err(Error::ILLEGAL_DATA_VALUE),
    }
}

/// The number of data bytes that `quantity` bits take.
pub(super) const fn byte_count(quantity: u16) -> u8 {
    quantity.div_ceil(8) as u8
}

/// Writes a request or response of 05.
pub(super) fn emit_write_single_coil(writer: &mut Writer, address: u16, on: bool) {
    writer.u8(functions::WRITE_SINGLE_COIL);
    writer.u16(address);
    writer.u16(coil_value(on));
}

/// Writes a request or response of 16 (hex).
pub(super) fn emit_mask_write_register(
    writer: &mut Writer,
    address: u16,
    and_mask: u16,
    or_mask: u16,
) {
    writer.u8(functions::MASK_WRITE_REGISTER);
    writer.u16(address);
    writer.u16(and_mask);
    writer.u16(or_mask);
}

/// Writes a request or response of 08.
pub(super) fn emit_diagnostics(writer: &mut Writer, sub_function: u16, data: &[u8]) {
    writer.u8(functions::DIAGNOSTICS);
    writer.u16(sub_function);
    writer.put(data);
}

/// Writes a request or response of any MEI type.
pub(super) fn emit_encapsulated(writer: &mut Writer, mei_type: u8, data: &[u8]) {
    writer.u8(functions::ENCAPSULATED_INTERFACE_TRANSPORT);
    writer.u8(mei_type);
    writer.put(data);
}
