//! Coils and discrete inputs: functions 01, 02, 05 and 0F.

use super::request::{check_range, counted, word, Kind, Received, Request};
use crate::bytes::Reader;
use crate::data::words::last_byte_mask;
use crate::error::Status;

/// Read Coils (clause 6.1).
pub const READ_COILS: u8 = 0x01;
/// Read Discrete Inputs (clause 6.2).
pub const READ_DISCRETE_INPUTS: u8 = 0x02;
/// Write Single Coil (clause 6.5).
pub const WRITE_SINGLE_COIL: u8 = 0x05;
/// Write Multiple Coils (clause 6.11).
pub const WRITE_MULTIPLE_COILS: u8 = 0x0F;

/// Most bits that one request reads.
pub const MAX_READ: u16 = 2000;
/// Most coils that one request writes.
pub const MAX_WRITE: u16 = 1968;

/// The value of a single coil that is on; off is 0.
const ON: u16 = 0xFF00;

const fn byte_count(quantity: u16) -> u8 {
    quantity.div_ceil(8) as u8
}

/// Builds 01 or 02.
///
/// # Errors
/// [`Status::ILLEGAL_DATA_VALUE`] unless `quantity` is 1 to 2000,
/// [`Status::ILLEGAL_DATA_ADDRESS`] if the range passes 65535.
pub fn read(function: u8, address: u16, quantity: u16) -> Result<Request, Status> {
    check_range(address, quantity, MAX_READ)?;
    Ok(Request {
        response_length: 2 + byte_count(quantity),
        ..Request::new(Kind::ReadBits, function, address, quantity)
    })
}

/// Builds 05.
pub fn write_single(address: u16, on: bool) -> Request {
    Request::new(
        Kind::Write,
        WRITE_SINGLE_COIL,
        address,
        if on { ON } else { 0 },
    )
}

/// Builds 0F; the coils are the sender's words, least significant bit first.
///
/// # Errors
/// [`Status::ILLEGAL_DATA_VALUE`] unless `quantity` is 1 to 1968,
/// [`Status::ILLEGAL_DATA_ADDRESS`] if the range passes 65535.
pub fn write_multiple(address: u16, quantity: u16) -> Result<Request, Status> {
    check_range(address, quantity, MAX_WRITE)?;
    Ok(Request {
        data_length: byte_count(quantity),
        last_mask: last_byte_mask(quantity),
        ..Request::new(Kind::WriteBits, WRITE_MULTIPLE_COILS, address, quantity)
    })
}

pub(super) fn parse_read<'a>(function: u8, reader: &mut Reader) -> Result<Received<'a>, Status> {
    let (address, quantity) = (word(reader)?, word(reader)?);
    check_range(address, quantity, MAX_READ)?;
    Ok(Received::ReadBits {
        function,
        address,
        quantity,
    })
}

pub(super) fn parse_write_single<'a>(reader: &mut Reader) -> Result<Received<'a>, Status> {
    let address = word(reader)?;
    let on = match word(reader)? {
        ON => true,
        0 => false,
        _ => return Err(Status::ILLEGAL_DATA_VALUE),
    };
    Ok(Received::WriteSingleCoil { address, on })
}

pub(super) fn parse_write_multiple<'a>(reader: &mut Reader<'a>) -> Result<Received<'a>, Status> {
    let (address, quantity) = (word(reader)?, word(reader)?);
    check_range(address, quantity, MAX_WRITE)?;
    let data = counted(reader, u16::from(byte_count(quantity)))?;
    Ok(Received::WriteMultipleCoils {
        address,
        quantity,
        data,
    })
}
