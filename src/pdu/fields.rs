//! Functions that the parsers of all families share. An error is the exception that a server
//! answers to such a request; [`super::response`] converts it to the error of a response.

use crate::bytes::Reader;
use crate::error::Status;

/// Reads a byte; an error if the PDU has ended.
pub(super) fn byte(reader: &mut Reader) -> Result<u8, Status> {
    reader.u8().ok_or(Status::ILLEGAL_DATA_VALUE)
}

/// Reads a word; an error if the PDU has ended.
pub(super) fn word(reader: &mut Reader) -> Result<u16, Status> {
    reader.u16().ok_or(Status::ILLEGAL_DATA_VALUE)
}

/// Reads a byte count and as many bytes of data.
pub(super) fn counted<'a>(reader: &mut Reader<'a>) -> Result<&'a [u8], Status> {
    let count = usize::from(byte(reader)?);
    reader.take(count).ok_or(Status::ILLEGAL_DATA_VALUE)
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
) -> Result<(), Status> {
    expect_end(reader)?;
    match check_range(address, quantity, most) {
        Status::OK => Ok(()),
        refused => Err(refused),
    }
}

/// Checks that the PDU ends here.
pub(super) fn expect_end(reader: &Reader) -> Result<(), Status> {
    if reader.is_empty() {
        Ok(())
    } else {
        Err(Status::ILLEGAL_DATA_VALUE)
    }
}

/// Checks that `count` is within `limits`, the least and the greatest value.
pub(super) fn check_within(count: usize, limits: (usize, usize)) -> Result<(), Status> {
    if (limits.0..=limits.1).contains(&count) {
        Ok(())
    } else {
        Err(Status::ILLEGAL_DATA_VALUE)
    }
}
