//! Holding and input registers: functions 03, 04, 06, 10, 16 and 17.

use super::request::{check_range, counted, word, Kind, Received, Request};
use crate::bytes::Reader;
use crate::error::Status;

/// Read Holding Registers (clause 6.3).
pub const READ_HOLDING_REGISTERS: u8 = 0x03;
/// Read Input Registers (clause 6.4).
pub const READ_INPUT_REGISTERS: u8 = 0x04;
/// Write Single Register (clause 6.6).
pub const WRITE_SINGLE_REGISTER: u8 = 0x06;
/// Write Multiple Registers (clause 6.12).
pub const WRITE_MULTIPLE_REGISTERS: u8 = 0x10;
/// Mask Write Register (clause 6.16).
pub const MASK_WRITE_REGISTER: u8 = 0x16;
/// Read/Write Multiple Registers (clause 6.17).
pub const READ_WRITE_MULTIPLE_REGISTERS: u8 = 0x17;

/// Most registers that one request reads.
pub const MAX_READ: u16 = 125;
/// Most registers that one request writes.
pub const MAX_WRITE: u16 = 123;
/// Most registers that function 17 writes.
pub const MAX_READ_WRITE: u16 = 121;

/// Builds 03 or 04.
///
/// # Errors
/// [`Status::ILLEGAL_DATA_VALUE`] unless `quantity` is 1 to 125,
/// [`Status::ILLEGAL_DATA_ADDRESS`] if the range passes 65535.
pub fn read(function: u8, address: u16, quantity: u16) -> Result<Request, Status> {
    check_range(address, quantity, MAX_READ)?;
    Ok(Request {
        response_length: 2 + 2 * quantity as u8,
        ..Request::new(Kind::ReadRegisters, function, address, quantity)
    })
}

/// Builds 06.
pub fn write_single(address: u16, value: u16) -> Request {
    Request::new(Kind::Write, WRITE_SINGLE_REGISTER, address, value)
}

/// Builds 10; the values are the sender's words.
///
/// # Errors
/// [`Status::ILLEGAL_DATA_VALUE`] unless `quantity` is 1 to 123,
/// [`Status::ILLEGAL_DATA_ADDRESS`] if the range passes 65535.
pub fn write_multiple(address: u16, quantity: u16) -> Result<Request, Status> {
    check_range(address, quantity, MAX_WRITE)?;
    Ok(Request {
        data_length: 2 * quantity as u8,
        ..Request::new(Kind::Write, WRITE_MULTIPLE_REGISTERS, address, quantity)
    })
}

/// Builds 16: the register becomes `(register & and) | (or & !and)`.
pub fn mask_write(address: u16, and_mask: u16, or_mask: u16) -> Request {
    let mut request = Request::new(Kind::Write, MASK_WRITE_REGISTER, address, and_mask);
    [request.head[5], request.head[6]] = or_mask.to_be_bytes();
    request.head_length = 7;
    request.response_length = 7;
    request
}

/// Builds 17; the values to write are the sender's words.
///
/// # Errors
/// [`Status::ILLEGAL_DATA_VALUE`] unless 1 to 125 registers are read and 1 to
/// 121 written, [`Status::ILLEGAL_DATA_ADDRESS`] if a range passes 65535.
pub fn read_write(
    read_address: u16,
    read_quantity: u16,
    write_address: u16,
    write_quantity: u16,
) -> Result<Request, Status> {
    check_range(write_address, write_quantity, MAX_READ_WRITE)?;
    let mut request = read(READ_WRITE_MULTIPLE_REGISTERS, read_address, read_quantity)?;
    [request.head[5], request.head[6]] = write_address.to_be_bytes();
    [request.head[7], request.head[8]] = write_quantity.to_be_bytes();
    request.head_length = 9;
    request.data_length = 2 * write_quantity as u8;
    Ok(request)
}

pub(super) fn parse_read<'a>(function: u8, reader: &mut Reader) -> Result<Received<'a>, Status> {
    let (address, quantity) = (word(reader)?, word(reader)?);
    check_range(address, quantity, MAX_READ)?;
    Ok(Received::ReadRegisters {
        function,
        address,
        quantity,
    })
}

pub(super) fn parse_write_single<'a>(reader: &mut Reader) -> Result<Received<'a>, Status> {
    Ok(Received::WriteSingleRegister {
        address: word(reader)?,
        value: word(reader)?,
    })
}

pub(super) fn parse_write_multiple<'a>(reader: &mut Reader<'a>) -> Result<Received<'a>, Status> {
    let (address, quantity) = (word(reader)?, word(reader)?);
    check_range(address, quantity, MAX_WRITE)?;
    let data = counted(reader, 2 * quantity)?;
    Ok(Received::WriteMultipleRegisters {
        address,
        quantity,
        data,
    })
}

pub(super) fn parse_mask_write<'a>(reader: &mut Reader) -> Result<Received<'a>, Status> {
    Ok(Received::MaskWriteRegister {
        address: word(reader)?,
        and_mask: word(reader)?,
        or_mask: word(reader)?,
    })
}

pub(super) fn parse_read_write<'a>(reader: &mut Reader<'a>) -> Result<Received<'a>, Status> {
    let (read_address, read_quantity) = (word(reader)?, word(reader)?);
    let (write_address, write_quantity) = (word(reader)?, word(reader)?);
    check_range(read_address, read_quantity, MAX_READ)?;
    check_range(write_address, write_quantity, MAX_READ_WRITE)?;
    let data = counted(reader, 2 * write_quantity)?;
    Ok(Received::ReadWriteMultipleRegisters {
        read_address,
        read_quantity,
        write_address,
        write_quantity,
        data,
    })
}
