//! Holding and input registers: functions 03, 04, 06, 10, 16 and 17.

use super::fields::{check_end_and_range, check_within, counted, word};
use super::functions;
use super::limits::{MAX_READ_REGISTERS, MAX_READ_WRITE_REGISTERS, MAX_WRITE_REGISTERS};
use super::message::{Request, Response};
use crate::bytes::{Reader, Writer};
use crate::error::Status;

pub(super) fn parse_read<'a>(function: u8, reader: &mut Reader) -> Result<Request<'a>, Status> {
    let (address, quantity) = (word(reader)?, word(reader)?);
    check_end_and_range(reader, address, quantity, MAX_READ_REGISTERS)?;
    Ok(Request::ReadRegisters {
        function,
        address,
        quantity,
    })
}

pub(super) fn parse_write_single<'a>(reader: &mut Reader) -> Result<Request<'a>, Status> {
    Ok(Request::WriteSingleRegister {
        address: word(reader)?,
        value: word(reader)?,
    })
}

pub(super) fn parse_write_multiple<'a>(reader: &mut Reader<'a>) -> Result<Request<'a>, Status> {
    let (address, quantity) = (word(reader)?, word(reader)?);
    let data = values(reader, quantity)?;
    check_end_and_range(reader, address, quantity, MAX_WRITE_REGISTERS)?;
    Ok(Request::WriteMultipleRegisters {
        address,
        quantity,
        data,
    })
}

pub(super) fn parse_mask_write<'a>(reader: &mut Reader) -> Result<Request<'a>, Status> {
    Ok(Request::MaskWriteRegister {
        address: word(reader)?,
        and_mask: word(reader)?,
        or_mask: word(reader)?,
    })
}

pub(super) fn parse_read_write<'a>(reader: &mut Reader<'a>) -> Result<Request<'a>, Status> {
    let (read_address, read_quantity) = (word(reader)?, word(reader)?);
    let (write_address, write_quantity) = (word(reader)?, word(reader)?);
    let data = values(reader, write_quantity)?;
    // Both quantities are checked before both ranges of addresses.
    let most = usize::from(MAX_READ_WRITE_REGISTERS);
    check_within(usize::from(write_quantity), (1, most))?;
    check_end_and_range(reader, read_address, read_quantity, MAX_READ_REGISTERS)?;
    check_end_and_range(
        reader,
        write_address,
        write_quantity,
        MAX_READ_WRITE_REGISTERS,
    )?;
    Ok(Request::ReadWriteMultipleRegisters {
        read_address,
        read_quantity,
        write_address,
        write_quantity,
        data,
    })
}

/// Reads a byte count and the data of `quantity` registers.
fn values<'a>(reader: &mut Reader<'a>, quantity: u16) -> Result<&'a [u8], Status> {
    let data = counted(reader)?;
    if data.len().is_multiple_of(2) && data.len() / 2 == usize::from(quantity) {
        Ok(data)
    } else {
        Err(Status::ILLEGAL_DATA_VALUE)
    }
}

pub(super) fn emit_mask_write(writer: &mut Writer, address: u16, and_mask: u16, or_mask: u16) {
    writer.u8(functions::MASK_WRITE_REGISTER);
    writer.u16(address);
    writer.u16(and_mask);
    writer.u16(or_mask);
}

pub(super) fn parse_read_response<'a>(
    function: u8,
    reader: &mut Reader<'a>,
) -> Result<Response<'a>, Status> {
    let data = counted(reader)?;
    if !is_response_data(data) {
        return Err(Status::MALFORMED_REPLY);
    }
    Ok(Response::ReadRegisters { function, data })
}

/// True if the response to a read can have this number of data bytes.
pub(super) fn is_response_data(data: &[u8]) -> bool {
    let most = 2 * usize::from(MAX_READ_REGISTERS);
    !data.is_empty() && data.len() <= most && data.len().is_multiple_of(2)
}

pub(super) fn parse_write_single_response<'a>(reader: &mut Reader) -> Result<Response<'a>, Status> {
    Ok(Response::WriteSingleRegister {
        address: word(reader)?,
        value: word(reader)?,
    })
}

/// Parses a response of 0F or 10, which writes at most `most` coils or registers.
pub(super) fn parse_write_multiple_response<'a>(
    function: u8,
    most: u16,
    reader: &mut Reader,
) -> Result<Response<'a>, Status> {
    let (address, quantity) = (word(reader)?, word(reader)?);
    check_end_and_range(reader, address, quantity, most)?;
    Ok(Response::WriteMultiple {
        function,
        address,
        quantity,
    })
}

pub(super) fn parse_mask_write_response<'a>(reader: &mut Reader) -> Result<Response<'a>, Status> {
    Ok(Response::MaskWriteRegister {
        address: word(reader)?,
        and_mask: word(reader)?,
        or_mask: word(reader)?,
    })
}
