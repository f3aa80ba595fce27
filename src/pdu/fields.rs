//! What the parsers of all families share. A fault is the status that a server
//! answers; [`super::response`] says what it means in a response.

use super::query::check_range;
use crate::bytes::Reader;
use crate::error::Status;

/// The next byte of a PDU that must have it.
pub(super) fn byte(reader: &mut Reader) -> Result<u8, Status> {
    reader.u8().ok_or(Status::ILLEGAL_DATA_VALUE)
}

/// The next word of a PDU that must have it.
pub(super) fn word(reader: &mut Reader) -> Result<u16, Status> {
    reader.u16().ok_or(Status::ILLEGAL_DATA_VALUE)
}

/// The byte count and the data that it counts.
pub(super) fn counted<'a>(reader: &mut Reader<'a>) -> Result<&'a [u8], Status> {
    let count = usize::from(byte(reader)?);
    reader.take(count).ok_or(Status::ILLEGAL_DATA_VALUE)
}

/// As [`check_range`], once nothing is left to read: lengths and quantities are
/// judged before addresses (figures 11 and following).
pub(super) fn in_range(
    reader: &Reader,
    address: u16,
    quantity: u16,
    most: u16,
) -> Result<(), Status> {
    end(reader)?;
    match check_range(address, quantity, most) {
        Status::OK => Ok(()),
        refused => Err(refused),
    }
}

/// True for a range that [`check_range`] finds right.
pub(super) fn is_range(address: u16, quantity: u16, most: u16) -> bool {
    check_range(address, quantity, most) == Status::OK
}

/// Says whether a PDU ends where it should.
pub(super) fn end(reader: &Reader) -> Result<(), Status> {
    if reader.is_empty() {
        Ok(())
    } else {
        Err(Status::ILLEGAL_DATA_VALUE)
    }
}

/// Says whether `count` lies within `limits`, least and most.
pub(super) fn within(count: usize, limits: (usize, usize)) -> Result<(), Status> {
    if (limits.0..=limits.1).contains(&count) {
        Ok(())
    } else {
        Err(Status::ILLEGAL_DATA_VALUE)
    }
}
