//! One function for each request.

mod data;
mod device;

pub use data::*;
pub use device::*;

use super::request::Inside;
use super::{mbm_client, mbm_clientRequest, pointers, shared, Lent};
use crate::client::Job as _;
use crate::error::Status;
use crate::pdu::outline::{Form, Outline};
use crate::FIRMWARE;

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
                    Some(request) if shared(object).holds(|held| *held == request) => Status::BUSY,
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
#[cfg_attr(not(target_os = "none"), inline(always))]
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
                Some(request) => match shared(pointers::object(client)).enqueue(request) {
                    Ok(()) => Status::PENDING,
                    Err(refused) => refused.ticket().status,
                },
                None => Status::INVALID_ARGUMENT,
            }
        };
    };
    ticket.status = status;
    status
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
            && (*request.cast::<Inside>()).ticket.has_ended()
    }
}

/// Queues the request that `build` outlines. (A host looks first whether it is one that
/// was used before, as most are.)
///
/// # Safety
/// As the header demands.
#[inline(always)]
unsafe fn queue(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    build: impl FnOnce(&mut Outline) -> Status,
) -> u8 {
    // SAFETY: as the caller promises; no client has it, or it is prepared.
    unsafe {
        if !FIRMWARE && is_free(client, request) {
            build_and_submit(client, request, build).code()
        } else {
            queue_unknown(client, request, build)
        }
    }
}

/// As [`queue`], of a request that may be pending.
///
/// # Safety
/// As the header demands.
#[cfg_attr(target_os = "none", inline(always))]
#[cfg_attr(not(target_os = "none"), cold, inline(never))]
unsafe fn queue_unknown(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    build: impl FnOnce(&mut Outline) -> Status,
) -> u8 {
    // SAFETY: as the caller promises; built once it is prepared.
    unsafe {
        let status = match prepare(client, request) {
            Status::OK => build_and_submit(client, request, build),
            refused => refused,
        };
        status.code()
    }
}

/// Queues the request that `build` outlines.
///
/// # Safety
/// As for [`submit`].
#[inline(always)]
unsafe fn build_and_submit(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    build: impl FnOnce(&mut Outline) -> Status,
) -> Status {
    // SAFETY: as the caller promises.
    unsafe {
        let inside = &mut *request.cast::<Inside>();
        let built = build(&mut inside.ticket.outline);
        submit(client, request, built)
    }
}

/// Queues a request of two words at most.
///
/// # Safety
/// As the header demands.
#[cfg_attr(target_os = "none", inline(never))]
#[cfg_attr(not(target_os = "none"), inline(always))]
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
