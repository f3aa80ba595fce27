//! File records and FIFO queues: functions 14, 15 and 18.

use super::fields::{counted, expect_end, word};
use super::functions;
use super::limits::MAX_FIFO;
use super::message::{Request, Response};
pub use super::records::{Reads, Record, Records, Writes, REFERENCE_TYPE};
use crate::bytes::{Reader, Writer};
use crate::error::Status;

pub(super) fn parse_read<'a>(reader: &mut Reader<'a>) -> Result<Request<'a>, Status> {
    let bytes = counted(reader)?;
    expect_end(reader)?;
    Ok(Request::ReadFileRecord(Reads::new(bytes)?))
}

pub(super) fn parse_write<'a>(reader: &mut Reader<'a>) -> Result<Request<'a>, Status> {
    let bytes = counted(reader)?;
    expect_end(reader)?;
    Ok(Request::WriteFileRecord(Writes::new(bytes)?))
}

pub(super) fn parse_fifo<'a>(reader: &mut Reader) -> Result<Request<'a>, Status> {
    let address = word(reader)?;
    Ok(Request::ReadFifoQueue { address })
}

pub(super) fn parse_read_response<'a>(reader: &mut Reader<'a>) -> Result<Response<'a>, Status> {
    Ok(Response::ReadFileRecord(Records::new(counted(reader)?)?))
}

pub(super) fn parse_write_response<'a>(reader: &mut Reader<'a>) -> Result<Response<'a>, Status> {
    Ok(Response::WriteFileRecord(Writes::new(counted(reader)?)?))
}

pub(super) fn parse_fifo_response<'a>(reader: &mut Reader<'a>) -> Result<Response<'a>, Status> {
    let (bytes, count) = (word(reader)?, word(reader)?);
    let data = reader.rest();
    let agree = count <= MAX_FIFO && bytes == 2 + 2 * count && data.len() == 2 * usize::from(count);
    if !agree {
        return Err(Status::ILLEGAL_DATA_VALUE);
    }
    Ok(Response::FifoQueue { data })
}

pub(super) fn emit_fifo_response(writer: &mut Writer, data: &[u8]) {
    writer.u8(functions::READ_FIFO_QUEUE);
    writer.u16((data.len() as u16).wrapping_add(2));
    writer.u16(data.len() as u16 / 2);
    writer.put(data);
}
