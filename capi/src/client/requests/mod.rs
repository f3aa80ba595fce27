//! One function for each kind of request.

mod data;
mod device;

pub use data::*;
pub use device::*;

use super::object::{mbm_client, queue};
use super::request::{mbm_clientRequest, RequestFields, RequestPtr};
use crate::pointers;
use mbm::client::ClientRequest as _;
use mbm::error::Status;
use mbm::pdu::functions::FunctionSpec;
#[cfg(doc)]
use mbm::pdu::header::RequestHeader;

/// The arguments of a C function that makes a request: its function code, and the arguments
/// after `client` and `request`, which are the words at the start of the PDU.
#[derive(Clone, Copy)]
struct Arguments {
    function: FunctionSpec,
    words: [usize; 4],
}

impl Arguments {
    fn two_words(function: FunctionSpec, first: u16, second: u16) -> Arguments {
        let words = [first.into(), second.into(), 0, 0];
        Arguments { function, words }
    }
}

/// The further steps of a function after [`RequestHeader::set_all`]. It receives the status
/// of that function, and returns the status of the request.
type More = unsafe fn(&mut RequestFields, &[usize; 4], Status) -> Status;

/// Checks whether the request may be queued.
///
/// # Safety
/// As the header demands.
unsafe fn prepare(client: *const mbm_client, request: *mut mbm_clientRequest) -> Status {
    match pointers::check(client) {
        Status::OK if request.is_null() => Status::INVALID_ARGUMENT,
        Status::OK if (*request).status == Status::PENDING.code() => Status::BUSY,
        Status::OK => {
            // The C program may have zeroed a pending request, so search the queue.
            let object = pointers::object(client);
            match RequestPtr::new(request) {
                Some(request) if queue(object).holds(|queued| *queued == request) => Status::BUSY,
                _ => Status::OK,
            }
        }
        other => other,
    }
}

/// Builds a request and queues it; or returns the status that says why it is refused.
///
/// # Safety
/// As the header demands; [`prepare`] returned [`Status::OK`] for the request, or
/// [`is_free`] returned true.
unsafe fn submit(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    arguments: &Arguments,
    more: Option<More>,
) -> Status {
    // Nothing else uses the request.
    let fields = &mut *request.cast::<RequestFields>();
    let header = &mut fields.state.header;
    let mut status = header.set_all(arguments.function, &arguments.words);
    if let Some(more) = more {
        status = more(fields, &arguments.words, status);
    }
    let header = &fields.state.header;
    if status != Status::OK {
    } else if header.data_length() > 0 && fields.data.is_null() {
        status = Status::INVALID_ARGUMENT;
    } else if !fields.reply.is_null() && u16::from(header.known_data()) > fields.state.capacity {
        status = Status::BUFFER_TOO_SMALL;
    } else if let Some(request) = RequestPtr::new(request) {
        return match queue(pointers::object(client)).enqueue(request) {
            Ok(()) => Status::PENDING,
            Err(refused) => refused.state().status,
        };
    }
    fields.state.status = status;
    fields.state.exception = 0;
    status
}

/// Queues a request. (The calling convention of C extends the status to a word, as the calling
/// function must return it: that saves 40 bytes on a Cortex-M0+.)
///
/// # Safety
/// As the header demands.
#[allow(improper_ctypes_definitions)] // C does not call it.
unsafe extern "C" fn queue_request(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    arguments: &Arguments,
    more: Option<More>,
) -> u8 {
    // `prepare` returned OK before `submit`.
    let status = match prepare(client, request) {
        Status::OK => submit(client, request, arguments, more),
        refused => refused,
    };
    status.code()
}

/// Queues a request that has at most two words.
///
/// # Safety
/// As the header demands.
unsafe extern "C" fn two_words(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    first: u16,
    second: u16,
    function: FunctionSpec,
) -> u8 {
    let arguments = Arguments::two_words(function, first, second);
    queue_request(client, request, &arguments, None)
}

/// Queues a read of a table of the data model, by the number of its function, 01 to 04.
///
/// # Safety
/// As the header demands of mbm_client_readCoils.
pub(crate) unsafe fn read_table(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    function: u8,
    address: u16,
    quantity: u16,
) -> u8 {
    let function = FunctionSpec::reads_table(function);
    two_words(client, request, address, quantity, function)
}

/// Queues a request that consists of its function code only.
///
/// # Safety
/// As the header demands.
unsafe extern "C" fn code_only(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    function: FunctionSpec,
) -> u8 {
    two_words(client, request, 0, 0, function)
}

/// Queues a request that needs up to four words, or further steps.
///
/// # Safety
/// As the header demands.
#[inline(always)]
unsafe fn with_more(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    function: FunctionSpec,
    words: [usize; 4],
    more: Option<More>,
) -> u8 {
    queue_request(client, request, &Arguments { function, words }, more)
}
