//! User-defined functions.

use super::{Reply, Service};
use crate::bytes::move_items;
use crate::pdu::MAX_PDU;
use core::cell::Cell;

/// Serves a request of a user-defined function. The request PDU is the first `length` bytes of
/// `pdu`. `handler` gets the data after the function code, and the free bytes after the
/// request, into which it writes the data of the response.
pub fn serve(
    pdu: &mut [u8],
    length: usize,
    handler: impl FnOnce(&[u8], &mut [u8]) -> HandlerResult,
) -> Reply {
    let Some((request, space)) = pdu.split_at_mut_checked(length) else {
        return Reply::SERVER_DEVICE_FAILURE;
    };
    let data = request.get(1..).unwrap_or_default();
    let bytes = match handler(data, space) {
        HandlerResult::Data(bytes) if bytes <= space.len() && bytes < MAX_PDU => bytes,
        HandlerResult::Data(_) => return Reply::SERVER_DEVICE_FAILURE,
        HandlerResult::Exception(code) => return Reply::exception(code),
        HandlerResult::NoResponse => return Reply::NO_RESPONSE,
        HandlerResult::Pending => return Reply::PENDING,
        HandlerResult::Declined => return Reply::NOT_HANDLED,
    };
    // Move the response's data to directly after the function code.
    let cells = Cell::from_mut(pdu).as_slice_of_cells();
    let following = cells.get(length..length + bytes).unwrap_or_default();
    move_items(cells.get(1..).unwrap_or_default(), following);
    Reply::length(1 + bytes)
}

/// The result of the handler of a user-defined function.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum HandlerResult {
    /// A response with this number of data bytes.
    Data(usize),
    /// An exception with this code.
    Exception(u8),
    /// No response.
    NoResponse,
    /// Not finished: the server calls the handler again.
    Pending,
    /// The handler leaves the request to the next service that serves its function.
    Declined,
}

/// Serves one function code with a closure: see [`serve`].
#[derive(Debug)]
pub struct Custom<F> {
    /// The function code; 0 stands for every code that no earlier service serves.
    pub function: u8,
    /// Gets the request's data and writes the response's data.
    pub handler: F,
}

impl<F: FnMut(u8, &[u8], &mut [u8]) -> HandlerResult> Service for Custom<F> {
    fn serve(&mut self, pdu: &mut [u8], length: usize) -> Reply {
        match pdu.first() {
            Some(&function) if self.function == 0 || self.function == function => {
                serve(pdu, length, |data, space| {
                    (self.handler)(function, data, space)
                })
            }
            _ => Reply::NOT_HANDLED,
        }
    }

    fn is_custom(&self) -> bool {
        true
    }
}

/// Responds with exception 01 to disabled functions. It comes before the services that would
/// serve them. One bit for each function code; 1 disables the function.
#[derive(Debug)]
pub struct DisabledFunctions(pub [u8; 16]);

impl DisabledFunctions {
    /// True if the function is disabled.
    pub fn is_disabled(&self, function: u8) -> bool {
        let byte = self.0.get(usize::from(function / 8));
        byte.is_some_and(|byte| byte >> (function % 8) & 1 != 0)
    }
}

impl Service for DisabledFunctions {
    fn serve(&mut self, pdu: &mut [u8], _length: usize) -> Reply {
        match pdu.first() {
            Some(function) if self.is_disabled(*function) => Reply::ILLEGAL_FUNCTION,
            _ => Reply::NOT_HANDLED,
        }
    }
}
