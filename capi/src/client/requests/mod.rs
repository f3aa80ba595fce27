//! One function for each request.

mod data;
mod device;

pub use data::*;
pub use device::*;

use super::object::{mbm_client, queue};
use super::request::{mbm_clientRequest, RequestFields, RequestPtr};
use crate::pointers;
use mbm::client::ClientRequest as _;
use mbm::error::Status;
use mbm::pdu::function_spec::FunctionSpec;
#[cfg(doc)]
use mbm::pdu::header::RequestHeader;
use mbm::FIRMWARE;

/// What a function of C is called with: the form of its request, and its arguments
/// behind client and request, which are the words in the head of its PDU.
#[derive(Clone, Copy)]
struct Arguments {
    form: FunctionSpec,
    words: [usize; 4],
}

/// What a function does besides [`RequestHeader::set_all`], whose status it is given.
type More = unsafe fn(&mut RequestFields, &[usize; 4], Status) -> Status;

/// Whether the request behind a pointer may be queued.
///
/// # Safety
/// As the header demands.
#[inline(always)]
unsafe fn prepare(client: *const mbm_client, request: *mut mbm_clientRequest) -> Status {
    // SAFETY: as the caller promises.
    unsafe {
        match pointers::check(client) {
            Status::OK if request.is_null() => Status::INVALID_ARGUMENT,
            Status::OK if (*request).status == Status::PENDING.code() => Status::BUSY,
            Status::OK => {
                // One that is pending may have been zeroed.
                let object = pointers::object(client);
                match RequestPtr::new(request) {
                    Some(request) if queue(object).holds(|held| *held == request) => Status::BUSY,
                    _ => Status::OK,
                }
            }
            other => other,
        }
    }
}

/// Builds a request and queues it, unless it is refused.
///
/// # Safety
/// As the header demands; the request is [`prepare`]d, or no client has it.
#[inline(always)]
unsafe fn submit(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    arguments: &Arguments,
    more: Option<More>,
) -> Status {
    // SAFETY: as the caller promises, so nobody else uses the request.
    unsafe {
        let inside = &mut *request.cast::<RequestFields>();
        let header = &mut inside.state.header;
        let mut status = header.set_all(arguments.form, &arguments.words);
        if let Some(more) = more {
            status = more(inside, &arguments.words, status);
        }
        let header = &inside.state.header;
        if status != Status::OK {
        } else if header.data_length() > 0 && inside.data.is_null() {
            status = Status::INVALID_ARGUMENT;
        } else if !inside.reply.is_null() && u16::from(header.known_data()) > inside.state.capacity
        {
            status = Status::BUFFER_TOO_SMALL;
        } else if let Some(request) = RequestPtr::new(request) {
            return match queue(pointers::object(client)).enqueue(request) {
                Ok(()) => Status::PENDING,
                Err(refused) => refused.state().status,
            };
        }
        inside.state.status = status;
        status
    }
}

/// True if a client gave the request back, and nothing happened to it since: so no
/// client has it.
///
/// # Safety
/// As the header demands.
#[inline(always)]
unsafe fn is_free(client: *const mbm_client, request: *const mbm_clientRequest) -> bool {
    // SAFETY: as the caller promises.
    unsafe {
        pointers::check(client) == Status::OK
            && !request.is_null()
            && (*request).status != Status::PENDING.code()
            && (*request.cast::<RequestFields>()).state.has_ended()
    }
}

/// Queues a request. (A host looks first whether it is one that was used before, as
/// most are. By C's convention the status comes extended to a word, as the function of
/// C that calls this has to return it: 40 bytes less on a Cortex-M0+.)
///
/// # Safety
/// As the header demands.
#[cfg_attr(target_os = "none", inline(never))]
#[cfg_attr(not(target_os = "none"), inline(always))]
#[allow(improper_ctypes_definitions)] // C does not call it.
unsafe extern "C" fn queue_request(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    arguments: &Arguments,
    more: Option<More>,
) -> u8 {
    // SAFETY: as the caller promises; no client has it, or it is prepared.
    unsafe {
        if FIRMWARE {
            return queue_unknown(client, request, arguments, more);
        }
        if is_free(client, request) {
            return submit(client, request, arguments, more).code();
        }
        // A copy, which only this way has in memory.
        queue_unknown(client, request, &{ *arguments }, more)
    }
}

/// As [`queue_request`], of a request that may be pending.
///
/// # Safety
/// As the header demands.
#[cfg_attr(target_os = "none", inline(always))]
#[cfg_attr(not(target_os = "none"), cold, inline(never))]
#[allow(improper_ctypes_definitions)] // C does not call it.
unsafe extern "C" fn queue_unknown(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    arguments: &Arguments,
    more: Option<More>,
) -> u8 {
    // SAFETY: as the caller promises; built once it is prepared.
    unsafe {
        let status = match prepare(client, request) {
            Status::OK => submit(client, request, arguments, more),
            refused => refused,
        };
        status.code()
    }
}

/// Queues a request of two words at most.
///
/// # Safety
/// As the header demands.
#[cfg_attr(target_os = "none", inline(never))]
#[cfg_attr(not(target_os = "none"), inline(always))]
unsafe extern "C" fn plain(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    first: u16,
    second: u16,
    form: FunctionSpec,
) -> u8 {
    let words = [first.into(), second.into(), 0, 0];
    // SAFETY: as the caller promises.
    unsafe { queue_request(client, request, &Arguments { form, words }, None) }
}

/// Queues a request that is no more than a function code.
///
/// # Safety
/// As the header demands.
#[cfg_attr(target_os = "none", inline(never))]
unsafe extern "C" fn bare(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    form: FunctionSpec,
) -> u8 {
    // SAFETY: as the caller promises.
    unsafe { plain(client, request, 0, 0, form) }
}

/// Queues a request that more is to be done for.
///
/// # Safety
/// As the header demands.
#[inline(always)]
unsafe fn special(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    form: FunctionSpec,
    words: [usize; 4],
    more: Option<More>,
) -> u8 {
    // SAFETY: as the caller promises.
    unsafe { queue_request(client, request, &Arguments { form, words }, more) }
}
