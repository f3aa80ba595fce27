//! Status and diagnostics of a device on a serial line: functions 07, 08, 0B, 0C and 11.

use super::fields::{byte, counted, word};
use super::functions;
use super::limits::MAX_EVENTS;
use super::message::{Request, Response};
use crate::bytes::{Reader, Writer};
use crate::error::Status;

/// The sub-functions of 08 (clause 6.8.1).
pub mod sub_function {
    /// Return Query Data: the response repeats the data, any number of words.
    pub const RETURN_QUERY_DATA: u16 = 0x00;
    /// Restart Communications Option; data FF00 also clears the event log.
    pub const RESTART_COMMUNICATIONS: u16 = 0x01;
    /// Return Diagnostic Register.
    pub const RETURN_DIAGNOSTIC_REGISTER: u16 = 0x02;
    /// Change ASCII Input Delimiter; the character is the high byte.
    pub const CHANGE_ASCII_INPUT_DELIMITER: u16 = 0x03;
    /// Force Listen Only Mode; there is no response.
    pub const FORCE_LISTEN_ONLY: u16 = 0x04;
    /// Clear Counters and Diagnostic Register.
    pub const CLEAR_COUNTERS: u16 = 0x0A;
    /// Return Bus Message Count.
    pub const BUS_MESSAGE_COUNT: u16 = 0x0B;
    /// Return Bus Communication Error Count.
    pub const BUS_COMMUNICATION_ERROR_COUNT: u16 = 0x0C;
    /// Return Bus Exception Error Count.
    pub const BUS_EXCEPTION_ERROR_COUNT: u16 = 0x0D;
    /// Return Server Message Count.
    pub const SERVER_MESSAGE_COUNT: u16 = 0x0E;
    /// Return Server No Response Count.
    pub const SERVER_NO_RESPONSE_COUNT: u16 = 0x0F;
    /// Return Server NAK Count.
    pub const SERVER_NAK_COUNT: u16 = 0x10;
    /// Return Server Busy Count.
    pub const SERVER_BUSY_COUNT: u16 = 0x11;
    /// Return Bus Character Overrun Count.
    pub const BUS_CHARACTER_OVERRUN_COUNT: u16 = 0x12;
    /// Clear Overrun Counter and Flag.
    pub const CLEAR_OVERRUN_COUNTER: u16 = 0x14;
}

/// The data of Restart Communications Option that also clear the event log.
pub const CLEAR_LOG: u16 = 0xFF00;

/// True for a sub-function of the standard.
const fn is_known(sub_function: u16) -> bool {
    matches!(sub_function, 0x00..=0x04 | 0x0A..=0x12 | 0x14)
}

pub(super) fn parse_diagnostics<'a>(reader: &mut Reader<'a>) -> Result<Request<'a>, Status> {
    let (sub_function, data) = sub_function_and_data(reader)?;
    let allowed = match (sub_function, data) {
        (sub_function::RETURN_QUERY_DATA, _) => true,
        (sub_function::RESTART_COMMUNICATIONS, [0x00 | 0xFF, 0]) => true,
        (sub_function::CHANGE_ASCII_INPUT_DELIMITER, [_, 0]) => true,
        (_, data) => matches!(data, [0, 0]),
    };
    if allowed {
        Ok(Request::Diagnostics { sub_function, data })
    } else {
        Err(Status::ILLEGAL_DATA_VALUE)
    }
}

/// Reads a sub-function and its data: one word, or any number of words for Return Query Data.
fn sub_function_and_data<'a>(reader: &mut Reader<'a>) -> Result<(u16, &'a [u8]), Status> {
    let sub_function = word(reader)?;
    if !is_known(sub_function) {
        return Err(Status::ILLEGAL_FUNCTION);
    }
    let data = reader.rest();
    let one = sub_function != sub_function::RETURN_QUERY_DATA;
    if data.is_empty() || !data.len().is_multiple_of(2) || (one && data.len() != 2) {
        return Err(Status::ILLEGAL_DATA_VALUE);
    }
    Ok((sub_function, data))
}

pub(super) fn emit_diagnostics(writer: &mut Writer, sub_function: u16, data: &[u8]) {
    writer.u8(functions::DIAGNOSTICS);
    writer.u16(sub_function);
    writer.put(data);
}

pub(super) fn parse_exception_status<'a>(reader: &mut Reader) -> Result<Response<'a>, Status> {
    let outputs = byte(reader)?;
    Ok(Response::ExceptionStatus { outputs })
}

pub(super) fn parse_diagnostics_response<'a>(
    reader: &mut Reader<'a>,
) -> Result<Response<'a>, Status> {
    let (sub_function, data) = sub_function_and_data(reader)?;
    if sub_function == sub_function::FORCE_LISTEN_ONLY {
        return Err(Status::MALFORMED_REPLY);
    }
    Ok(Response::Diagnostics { sub_function, data })
}

pub(super) fn parse_event_counter<'a>(reader: &mut Reader) -> Result<Response<'a>, Status> {
    Ok(Response::CommEventCounter {
        status: word(reader)?,
        events: word(reader)?,
    })
}

pub(super) fn parse_event_log<'a>(reader: &mut Reader<'a>) -> Result<Response<'a>, Status> {
    let mut reader = Reader::new(counted(reader)?);
    let (status, events) = (word(&mut reader)?, word(&mut reader)?);
    let messages = word(&mut reader)?;
    let log = reader.rest();
    if log.len() > MAX_EVENTS {
        return Err(Status::ILLEGAL_DATA_VALUE);
    }
    Ok(Response::CommEventLog {
        status,
        events,
        messages,
        log,
    })
}

pub(super) fn emit_event_log(writer: &mut Writer, words: [u16; 3], log: &[u8]) {
    writer.u8(functions::GET_COMM_EVENT_LOG);
    writer.u8((log.len() as u8).wrapping_add(6));
    for word in words {
        writer.u16(word);
    }
    writer.put(log);
}

/// In some devices the byte count covers only the id, and more bytes follow. So the result
/// contains the count and all bytes after it.
pub(super) fn parse_server_id<'a>(reader: &mut Reader<'a>) -> Result<Response<'a>, Status> {
    let count = byte(reader)?;
    let data = reader.rest();
    if usize::from(count) > data.len() {
        return Err(Status::ILLEGAL_DATA_VALUE);
    }
    Ok(Response::ServerId { count, data })
}
