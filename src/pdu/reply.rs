//! Response PDUs, as the sender of the request judges them.

use super::EXCEPTION;

/// The raw exception code of a response, if that is an exception.
pub fn exception_code(pdu: &[u8]) -> Option<u8> {
    match pdu {
        [function, code, ..] if *function & EXCEPTION != 0 => Some(*code),
        _ => None,
    }
}
