//! Coils and discrete inputs: functions 01, 02, 05 and 0F.

use super::request::{counted, in_range, word, Received, Request};
use crate::bytes::Reader;
use crate::data::bits;
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

/// Builds 01: [`Status::OK`], [`Status::ILLEGAL_DATA_VALUE`] unless `quantity`
/// is 1 to 2000, or [`Status::ILLEGAL_DATA_ADDRESS`] if the range passes 65535.
pub fn read_coils(request: &mut Request, address: u16, quantity: u16) -> Status {
    read(request, READ_COILS, address, quantity)
}

/// Builds 02, as [`read_coils`].
pub fn read_discrete_inputs(request: &mut Request, address: u16, quantity: u16) -> Status {
    read(request, READ_DISCRETE_INPUTS, address, quantity)
}

fn read(request: &mut Request, function: u8, address: u16, quantity: u16) -> Status {
    let status = request.set_range(function, address, quantity, MAX_READ);
    request.response_length = byte_count(quantity).wrapping_add(2);
    request.take = Some(bits::take);
    status
}

/// Builds 05; a `value` of 0 is off, any other is on.
pub fn write_single(request: &mut Request, address: u16, value: u16) -> Status {
    let value = if value == 0 { 0 } else { ON };
    request.set(WRITE_SINGLE_COIL, address, value);
    Status::OK
}

/// Builds 0F; the coils are the sender's words, least significant bit first.
/// [`Status::OK`], [`Status::ILLEGAL_DATA_VALUE`] unless `quantity` is 1 to 1968,
/// or [`Status::ILLEGAL_DATA_ADDRESS`] if the range passes 65535.
pub fn write_multiple(request: &mut Request, address: u16, quantity: u16) -> Status {
    let status = request.set_range(WRITE_MULTIPLE_COILS, address, quantity, MAX_WRITE);
    request.append(byte_count(quantity), bits::send);
    status
}

pub(super) fn parse_read<'a>(function: u8, reader: &mut Reader) -> Result<Received<'a>, Status> {
    let (address, quantity) = (word(reader)?, word(reader)?);
    in_range(address, quantity, MAX_READ)?;
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
    in_range(address, quantity, MAX_WRITE)?;
    let data = counted(reader, u16::from(byte_count(quantity)))?;
    Ok(Received::WriteMultipleCoils {
        address,
        quantity,
        data,
    })
}
