//! User-defined functions.

use super::{Reply, Service};
use crate::bytes::move_items;
use crate::pdu::MAX_PDU;
use core::cell::Cell;

/// Serves a request of a user-defined function. The request PDU is the first `length` bytes of
/// `pdu`. `handler` gets the data after the function code, and the free bytes after the
/// request, into which it writes the data of the response.
///
/// ```
/// use mbm::server::custom::{serve, HandlerResult};
/// use mbm::server::Reply;
///
/// let mut pdu = [65, 1, 2, 0, 0, 0];
/// let reply = serve(&mut pdu, 3, |data, space| {
///     space[0] = data[0] + data[1];
///     HandlerResult::Data(1)
/// });
/// assert_eq!((reply, &pdu[..2]), (Reply::length(2), &[65, 3][..]));
/// ```
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
///
/// ```
/// use mbm::server::custom::HandlerResult;
/// use mbm::Exception;
///
/// fn check(data: &[u8]) -> HandlerResult {
///     match data {
///         [0..=100] => HandlerResult::Data(0),
///         _ => HandlerResult::Exception(Exception::IllegalDataValue.code()),
///     }
/// }
/// assert_eq!(check(&[200]), HandlerResult::Exception(3));
/// ```
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
///
/// ```
/// use mbm::server::custom::{Custom, HandlerResult};
/// use mbm::server::ServiceUnit;
///
/// // Function 65 sends back what it gets.
/// let mut echo = Custom {
///     function: 65,
///     handler: |_: u8, data: &[u8], space: &mut [u8]| {
///         space[..data.len()].copy_from_slice(data);
///         HandlerResult::Data(data.len())
///     },
/// };
/// let mut units = [ServiceUnit { id: 17, services: &mut [&mut echo], diagnostics: None }];
/// # let mut frame = [17, 65, 7, 0, 0, 0, 0, 0];
/// # let length = mbm::frame::rtu::emit(&mut frame, 17, |pdu| { pdu[..2].copy_from_slice(&[65, 7]); Ok(2) })?;
/// # let framing = mbm::frame::Framing::Rtu;
/// # assert_eq!(mbm::server::respond(framing, b'\n', &mut frame, length, &mut units[..]), Ok(5));
/// # Ok::<(), mbm::Error>(())
/// ```
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
///
/// ```
/// use mbm::server::custom::DisabledFunctions;
///
/// // Function 6 is not served.
/// let mut disabled = DisabledFunctions([0; 16]);
/// disabled.0[0] |= 1 << 6;
/// assert!(disabled.is_disabled(6) && !disabled.is_disabled(3));
/// ```
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
