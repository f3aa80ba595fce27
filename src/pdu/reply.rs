//! Response PDUs, as the sender of the request judges them: the length rule
//! that finds one, and whether its content answers the request.

use super::query::Query;
use super::EXCEPTION;
use crate::error::Status;
use core::num::NonZeroU8;

/// Where the data of a read's response start, behind function and byte count.
pub const DATA: usize = 2;

/// An exception response is a function code and an exception code.
const EXCEPTION_LENGTH: u8 = 2;

/// The length of the response to `request` that begins with the bytes of
/// `pdu`, or the least length while they do not tell; `None` if no response to
/// it begins so.
pub fn expected(request: &Query, pdu: &[u8]) -> Option<NonZeroU8> {
    let length = request.response_length();
    NonZeroU8::new(match pdu {
        [] => EXCEPTION_LENGTH,
        [function, rest @ ..] if *function == request.function() => match rest {
            [] if request.is_read() => EXCEPTION_LENGTH,
            [count, ..] if request.is_read() && *count != length - 2 => return None,
            _ => length,
        },
        [function, ..] if *function == request.function() | EXCEPTION => EXCEPTION_LENGTH,
        _ => return None,
    })
}

/// What a complete `pdu` that is [`expected`] says to `request`: success, an
/// exception of the remote device, or [`Status::MALFORMED_REPLY`].
pub fn judge(request: &Query, pdu: &[u8]) -> Status {
    match exception_code(pdu) {
        Some(code) => Status::exception(code),
        None if request.is_read() || request.agrees(pdu) => Status::OK,
        None => Status::MALFORMED_REPLY,
    }
}

/// The raw exception code of a response, if that is an exception.
pub fn exception_code(pdu: &[u8]) -> Option<u8> {
    match pdu {
        [function, code, ..] if *function & EXCEPTION != 0 => Some(*code),
        _ => None,
    }
}
