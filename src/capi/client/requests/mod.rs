//! One function for each request.

mod data;
mod device;

pub use data::*;
pub use device::*;

use super::request::Inside;
use super::{calls, mbm_client, mbm_clientRequest, pointers, Lent};
use crate::error::Status;
use crate::pdu::outline::{Form, Outline};

/// Whether the request behind a pointer may be queued.
///
/// # Safety
/// As the header demands.
#[cfg_attr(target_os = "none", inline(never))]
unsafe fn prepare(client: *const mbm_client, request: *mut mbm_clientRequest) -> Status {
    // SAFETY: as the caller promises.
    unsafe {
        match pointers::check(client) {
            Status::OK if request.is_null() => Status::INVALID_ARGUMENT,
            Status::OK if (*request).status == Status::PENDING.code() => Status::BUSY,
            Status::OK => {
                // One that is pending may have been zeroed.
                let object = pointers::object(client);
                match Lent::new(request) {
                    Some(held) if (calls(object).holds)(object, held) => Status::BUSY,
                    _ => Status::OK,
                }
            }
            other => other,
        }
    }
}

/// Queues a request that was built, unless that was refused.
///
/// # Safety
/// As the header demands; the request is [`prepare`]d.
#[cfg_attr(target_os = "none", inline(never))]
unsafe fn submit(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    built: Status,
) -> Status {
    // SAFETY: prepared, so a request that nobody uses.
    let inside = unsafe { &mut *request.cast::<Inside>() };
    let ticket = &mut inside.ticket;
    let outline = &ticket.outline;
    let status = if built != Status::OK {
        built
    } else if outline.data_length() > 0 && inside.data.is_null() {
        Status::INVALID_ARGUMENT
    } else if !inside.reply.is_null() && u16::from(outline.known_data()) > ticket.capacity {
        Status::BUFFER_TOO_SMALL
    } else {
        // SAFETY: as the caller promises.
        return unsafe {
            match Lent::new(request) {
                Some(request) => {
                    let object = pointers::object(client);
                    (calls(object).queue)(object, request)
                }
                None => Status::INVALID_ARGUMENT,
            }
        };
    };
    ticket.status = status;
    status
}

/// Queues the request that `build` outlines.
///
/// # Safety
/// As the header demands.
#[inline(always)]
unsafe fn queue(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    build: impl FnOnce(&mut Outline) -> Status,
) -> u8 {
    // SAFETY: as the caller promises.
    unsafe {
        let mut status = prepare(client, request);
        if status == Status::OK {
            let inside = &mut *request.cast::<Inside>();
            let built = build(&mut inside.ticket.outline);
            status = submit(client, request, built);
        }
        status.code()
    }
}

/// Queues a request of two words at most.
///
/// # Safety
/// As the header demands.
#[cfg_attr(target_os = "none", inline(never))]
unsafe fn plain(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    first: u16,
    second: u16,
    form: Form,
) -> u8 {
    // SAFETY: as the caller promises.
    unsafe { queue(client, request, |outline| outline.set(form, first, second)) }
}

/// Queues a request that is no more than a function code.
///
/// # Safety
/// As the header demands.
#[cfg_attr(target_os = "none", inline(never))]
unsafe fn bare(client: *mut mbm_client, request: *mut mbm_clientRequest, form: Form) -> u8 {
    // SAFETY: as the caller promises.
    unsafe { plain(client, request, 0, 0, form) }
}
