//! Where a pointer to a client becomes one to its object; see [`super::pointers`].
//!
//! No reference to a whole object is made: hooks run while the client in it is in
//! use, and may hand C's pointer to the functions of this library, which then look
//! at the mark.

use super::client::{mbm_client, Object};
use mbm::error::Status;

/// Whether there is a client behind a pointer from C: [`Status::OK`],
/// [`Status::INVALID_ARGUMENT`] for NULL, [`Status::NOT_INITIALISED`] for an
/// object that was never begun, [`Status::BUSY`] from within a hook that may not
/// use the client.
///
/// # Safety
/// `client` is NULL or points to an `mbm_client`, zeroed or begun.
#[cfg_attr(target_os = "none", inline(never))]
pub(super) unsafe fn check(client: *const mbm_client) -> Status {
    if client.is_null() {
        return Status::INVALID_ARGUMENT;
    }
    // SAFETY: not NULL, so storage of an object, zeroed or written.
    match unsafe { Object::mark(client).read() } {
        Object::BEGUN => Status::OK,
        Object::CALLING => Status::BUSY,
        _ => Status::NOT_INITIALISED,
    }
}

/// The object behind a pointer.
pub(super) fn object(client: *const mbm_client) -> *mut Object {
    client.cast::<Object>().cast_mut()
}

/// Runs `action`, which may call hooks of a client's port, its number generator
/// included. A call on the same client from within them is refused by [`check`].
///
/// # Safety
/// `client` points to storage of an object, and no reference into it lives.
#[inline(always)]
pub(super) unsafe fn calling<T>(client: *const mbm_client, action: impl FnOnce() -> T) -> T {
    // SAFETY: as the caller promises; every object is writable storage.
    unsafe {
        let mark = Object::mark(client);
        mark.write(Object::CALLING);
        let result = action();
        mark.write(Object::BEGUN);
        result
    }
}

/// Runs `action` on a client, or returns the status that says why not. It calls no
/// hook but within [`calling`].
///
/// # Safety
/// As for [`check`]; nothing else uses the object meanwhile.
pub(super) unsafe fn with(
    client: *mut mbm_client,
    action: impl FnOnce(*mut Object) -> Status,
) -> u8 {
    // SAFETY: checked; exclusive as the caller promises.
    let status = unsafe {
        match check(client) {
            Status::OK => action(object(client)),
            refused => refused,
        }
    };
    status.code()
}

/// Asks a client something; `otherwise` where there is none, and from within a hook
/// that may not use it.
///
/// # Safety
/// As for [`with`].
pub(super) unsafe fn ask<T>(
    client: *const mbm_client,
    otherwise: T,
    question: impl FnOnce(*mut Object) -> T,
) -> T {
    // SAFETY: checked; exclusive as the caller promises, and every object is
    // writable storage.
    unsafe {
        match check(client) {
            Status::OK => question(object(client)),
            _ => otherwise,
        }
    }
}
