//! Exceptions in response PDUs.

use super::EXCEPTION;

/// The exception code of a response as received; `None` if the response is no exception.
pub fn exception_code(pdu: &[u8]) -> Option<u8> {
    match pdu {
        [function, code, ..] if *function & EXCEPTION != 0 => Some(*code),
        _ => None,
    }
}
