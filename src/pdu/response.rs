//! Response PDUs, as the sender of the request judges them: the length rule
//! that finds one, and whether its content answers the request.

use super::request::Request;
use super::EXCEPTION;
use crate::error::Status;
use crate::frame::rtu::Fit;

/// An exception response is a function code and an exception code.
const EXCEPTION_LENGTH: usize = 2;

/// Whether `pdu`, complete or not, may be the response to `request`, and how
/// long it is then.
pub fn fit(request: &Request, pdu: &[u8]) -> Fit {
    let Some((function, rest)) = pdu.split_first() else {
        return Fit::More;
    };
    if *function == request.function() | EXCEPTION {
        return Fit::Length(EXCEPTION_LENGTH);
    }
    if *function != request.function() {
        return Fit::No;
    }
    let length = request.response_length();
    if request.is_read() {
        match rest.first() {
            None => return Fit::More,
            Some(count) if *count != length - 2 => return Fit::No,
            Some(_) => {}
        }
    }
    Fit::Length(usize::from(length))
}

/// What a complete `pdu` that [`fit`] found says to `request`: success, an
/// exception of the remote device, or [`Status::MALFORMED_REPLY`].
pub fn judge(request: &Request, pdu: &[u8]) -> Status {
    if let Some(code) = exception_code(request, pdu) {
        return Status::exception(code);
    }
    if request.is_read() || pdu == request.head().get(..pdu.len()).unwrap_or_default() {
        Status::OK
    } else {
        Status::MALFORMED_REPLY
    }
}

/// The raw exception code, if `pdu` is an exception response to `request`.
pub fn exception_code(request: &Request, pdu: &[u8]) -> Option<u8> {
    match pdu {
        [function, code] if *function == request.function() | EXCEPTION => Some(*code),
        _ => None,
    }
}

/// The data bytes of a response that [`judge`] found to be a success.
pub fn data<'a>(request: &Request, pdu: &'a [u8]) -> &'a [u8] {
    if request.is_read() {
        pdu.get(2..).unwrap_or_default()
    } else {
        &[]
    }
}
