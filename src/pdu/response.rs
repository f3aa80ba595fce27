//! Response PDUs, as the sender of the request judges them: the length rule
//! that finds one, and whether its content answers the request.

use super::request::Request;
use super::EXCEPTION;
use crate::error::Status;

/// An exception response is a function code and an exception code.
const EXCEPTION_LENGTH: usize = 2;

/// The length of the response to `request` that begins with the bytes of
/// `pdu`, or the least length while they do not tell; `None` if no response to
/// it begins so.
pub fn expected(request: &Request, pdu: &[u8]) -> Option<usize> {
    let length = request.response_length();
    match pdu {
        [] => return Some(EXCEPTION_LENGTH),
        [function, ..] if *function == request.function() | EXCEPTION => {
            return Some(EXCEPTION_LENGTH);
        }
        [function, ..] if *function != request.function() => return None,
        [_] if request.is_read() => return Some(EXCEPTION_LENGTH),
        [_, count, ..] if request.is_read() && *count != length - 2 => return None,
        _ => {}
    }
    Some(usize::from(length))
}

/// What a complete `pdu` that is [`expected`] says to `request`: success, an
/// exception of the remote device, or [`Status::MALFORMED_REPLY`].
pub fn judge(request: &Request, pdu: &[u8]) -> Status {
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

/// The data bytes of a response that [`judge`] found to be a success, and
/// that starts `pdu`.
pub fn data<'a>(request: &Request, pdu: &'a [u8]) -> &'a [u8] {
    if request.is_read() {
        let length = usize::from(request.response_length());
        pdu.get(2..length).unwrap_or_default()
    } else {
        &[]
    }
}
