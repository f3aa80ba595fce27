//! Coils and discrete inputs: functions 01, 02, 05 and 0F.

use super::fields::{counted, in_range, word};
use super::limits::{MAX_READ_BITS, MAX_WRITE_BITS};
use super::query::Query;
use super::request::Request;
use super::response::Response;
use crate::bytes::{Reader, Writer};
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

/// The value of a single coil that is on; off is 0.
const ON: u16 = 0xFF00;

const fn byte_count(quantity: u16) -> u8 {
    quantity.div_ceil(8) as u8
}

/// Builds 01: [`Status::OK`], [`Status::ILLEGAL_DATA_VALUE`] unless `quantity`
/// is 1 to 2000, or [`Status::ILLEGAL_DATA_ADDRESS`] if the range passes 65535.
pub fn read_coils(request: &mut Query, address: u16, quantity: u16) -> Status {
    read(request, READ_COILS, address, quantity)
}

/// Builds 02, as [`read_coils`].
pub fn read_discrete_inputs(request: &mut Query, address: u16, quantity: u16) -> Status {
    read(request, READ_DISCRETE_INPUTS, address, quantity)
}

fn read(request: &mut Query, function: u8, address: u16, quantity: u16) -> Status {
    let status = request.set_range(function, address, quantity, MAX_READ_BITS);
    request.response_length = byte_count(quantity).wrapping_add(2);
    request.take = Some(bits::take);
    status
}

/// Builds 05; a `value` of 0 is off, any other is on.
pub fn write_single(request: &mut Query, address: u16, value: u16) -> Status {
    let value = if value == 0 { 0 } else { ON };
    request.set(WRITE_SINGLE_COIL, address, value);
    Status::OK
}

/// Builds 0F; the coils are the sender's words, least significant bit first.
/// [`Status::OK`], [`Status::ILLEGAL_DATA_VALUE`] unless `quantity` is 1 to 1968,
/// or [`Status::ILLEGAL_DATA_ADDRESS`] if the range passes 65535.
pub fn write_multiple(request: &mut Query, address: u16, quantity: u16) -> Status {
    let status = request.set_range(WRITE_MULTIPLE_COILS, address, quantity, MAX_WRITE_BITS);
    request.append(byte_count(quantity), bits::send);
    status
}

pub(super) fn parse_read<'a>(function: u8, reader: &mut Reader) -> Result<Request<'a>, Status> {
    let (address, quantity) = (word(reader)?, word(reader)?);
    in_range(reader, address, quantity, MAX_READ_BITS)?;
    Ok(Request::ReadBits {
        function,
        address,
        quantity,
    })
}

pub(super) fn parse_write_single<'a>(reader: &mut Reader) -> Result<Request<'a>, Status> {
    let (address, value) = (word(reader)?, word(reader)?);
    let on = is_on(value)?;
    Ok(Request::WriteSingleCoil { address, on })
}

pub(super) fn parse_write_multiple<'a>(reader: &mut Reader<'a>) -> Result<Request<'a>, Status> {
    let (address, quantity) = (word(reader)?, word(reader)?);
    let data = counted(reader)?;
    if data.len() != usize::from(byte_count(quantity)) {
        return Err(Status::ILLEGAL_DATA_VALUE);
    }
    in_range(reader, address, quantity, MAX_WRITE_BITS)?;
    Ok(Request::WriteMultipleCoils {
        address,
        quantity,
        data,
    })
}

pub(super) fn emit_write_single(writer: &mut Writer, address: u16, on: bool) {
    writer.u8(WRITE_SINGLE_COIL);
    writer.u16(address);
    writer.u16(if on { ON } else { 0 });
}

pub(super) fn parse_read_response<'a>(
    function: u8,
    reader: &mut Reader<'a>,
) -> Result<Response<'a>, Status> {
    let data = counted(reader)?;
    if !is_response_data(data) {
        return Err(Status::MALFORMED_REPLY);
    }
    Ok(Response::ReadBits { function, data })
}

/// True for as many bytes as a read can bring.
pub(super) fn is_response_data(data: &[u8]) -> bool {
    !data.is_empty() && data.len() <= usize::from(byte_count(MAX_READ_BITS))
}

pub(super) fn parse_write_single_response<'a>(reader: &mut Reader) -> Result<Response<'a>, Status> {
    let (address, value) = (word(reader)?, word(reader)?);
    let on = is_on(value)?;
    Ok(Response::WriteSingleCoil { address, on })
}

fn is_on(value: u16) -> Result<bool, Status> {
    match value {
        ON => Ok(true),
        0 => Ok(false),
        _ => Err(Status::ILLEGAL_DATA_VALUE),
    }
}
