//! Holding and input registers: functions 03, 04, 06, 10, 16 and 17.

use super::request::{check_range, counted, in_range, word, Received, Request};
use crate::bytes::Reader;
use crate::data::registers;
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

const fn byte_count(quantity: u16) -> u8 {
    (quantity << 1) as u8
}

/// Builds 03: [`Status::OK`], [`Status::ILLEGAL_DATA_VALUE`] unless `quantity`
/// is 1 to 125, or [`Status::ILLEGAL_DATA_ADDRESS`] if the range passes 65535.
pub fn read_holding(request: &mut Request, address: u16, quantity: u16) -> Status {
    read(request, READ_HOLDING_REGISTERS, address, quantity)
}

/// Builds 04, as [`read_holding`].
pub fn read_input(request: &mut Request, address: u16, quantity: u16) -> Status {
    read(request, READ_INPUT_REGISTERS, address, quantity)
}

fn read(request: &mut Request, function: u8, address: u16, quantity: u16) -> Status {
    let status = request.set_range(function, address, quantity, MAX_READ);
    request.response_length = byte_count(quantity).wrapping_add(2);
    request.take = Some(registers::take);
    status
}

/// Builds 06.
pub fn write_single(request: &mut Request, address: u16, value: u16) -> Status {
    request.set(WRITE_SINGLE_REGISTER, address, value);
    Status::OK
}

/// Builds 10; the values are the sender's words. [`Status::OK`],
/// [`Status::ILLEGAL_DATA_VALUE`] unless `quantity` is 1 to 123, or
/// [`Status::ILLEGAL_DATA_ADDRESS`] if the range passes 65535.
pub fn write_multiple(request: &mut Request, address: u16, quantity: u16) -> Status {
    let status = request.set_range(WRITE_MULTIPLE_REGISTERS, address, quantity, MAX_WRITE);
    request.append(byte_count(quantity), registers::send);
    status
}

/// Builds 16: the register becomes `(register & and) | (or & !and)`.
pub fn mask_write(request: &mut Request, address: u16, and_mask: u16, or_mask: u16) -> Status {
    request.set(MASK_WRITE_REGISTER, address, and_mask);
    [request.head[5], request.head[6]] = or_mask.to_be_bytes();
    request.head_length = 7;
    request.length = 7;
    request.response_length = 7;
    Status::OK
}

/// Builds 17; the values to write are the sender's words. [`Status::OK`],
/// [`Status::ILLEGAL_DATA_VALUE`] unless 1 to 125 registers are read and 1 to
/// 121 written, or [`Status::ILLEGAL_DATA_ADDRESS`] if a range passes 65535.
pub fn read_write(
    request: &mut Request,
    read_address: u16,
    read_quantity: u16,
    write_address: u16,
    write_quantity: u16,
) -> Status {
    let readable = read(
        request,
        READ_WRITE_MULTIPLE_REGISTERS,
        read_address,
        read_quantity,
    );
    [request.head[5], request.head[6]] = write_address.to_be_bytes();
    [request.head[7], request.head[8]] = write_quantity.to_be_bytes();
    request.head_length = 9;
    request.append(byte_count(write_quantity), registers::send);
    match check_range(write_address, write_quantity, MAX_READ_WRITE) {
        Status::OK => readable,
        refused => refused,
    }
}

pub(super) fn parse_read<'a>(function: u8, reader: &mut Reader) -> Result<Received<'a>, Status> {
    let (address, quantity) = (word(reader)?, word(reader)?);
    in_range(address, quantity, MAX_READ)?;
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
    in_range(address, quantity, MAX_WRITE)?;
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
    in_range(read_address, read_quantity, MAX_READ)?;
    in_range(write_address, write_quantity, MAX_READ_WRITE)?;
    let data = counted(reader, 2 * write_quantity)?;
    Ok(Received::ReadWriteMultipleRegisters {
        read_address,
        read_quantity,
        write_address,
        write_quantity,
        data,
    })
}
