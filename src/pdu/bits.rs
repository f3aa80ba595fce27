//! Coils and discrete inputs: functions 01, 02, 05 and 0F.

use super::fields::{check_end_and_range, counted, word};
use super::functions;
use super::limits::{MAX_READ_BITS, MAX_WRITE_BITS};
use super::message::{Request, Response};
use crate::bytes::{Reader, Writer};
use crate::error::Status;

/// The value that switches a single coil on in a write; 0 switches it off.
pub const ON: u16 = 0xFF00;

const fn byte_count(quantity: u16) -> u8 {
    quantity.div_ceil(8) as u8
}

pub(super) fn parse_read<'a>(function: u8, reader: &mut Reader) -> Result<Request<'a>, Status> {
    let (address, quantity) = (word(reader)?, word(reader)?);
    check_end_and_range(reader, address, quantity, MAX_READ_BITS)?;
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
    check_end_and_range(reader, address, quantity, MAX_WRITE_BITS)?;
    Ok(Request::WriteMultipleCoils {
        address,
        quantity,
        data,
    })
}

pub(super) fn emit_write_single(writer: &mut Writer, address: u16, on: bool) {
    writer.u8(functions::WRITE_SINGLE_COIL);
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

/// True if the response to a read can have this number of data bytes.
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
