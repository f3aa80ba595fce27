//! Where a pointer to a client becomes a reference; see [`super::pointers`].

use super::client::{mbm_client, Object};
use crate::error::Status;

/// Whether there is a client behind a pointer from C: [`Status::OK`],
/// [`Status::INVALID_ARGUMENT`] for NULL, [`Status::NOT_INITIALISED`] for an
/// object that was never begun.
///
/// # Safety
/// `client` is NULL or points to an `mbm_client`, zeroed or begun.
#[cfg_attr(target_os = "none", inline(never))]
pub(super) unsafe fn check(client: *const mbm_client) -> Status {
    if client.is_null() {
        return Status::INVALID_ARGUMENT;
    }
    // SAFETY: not NULL, so storage of an object, which has room for it.
    if unsafe { Object::is_begun(client.cast()) } {
        Status::OK
    } else {
        Status::NOT_INITIALISED
    }
}

/// The client behind a pointer.
///
/// # Safety
/// [`check`] found one, and nothing else uses it while the reference lives.
pub(super) unsafe fn object<'a>(client: *mut mbm_client) -> &'a mut Object {
    // SAFETY: begun, so every field is valid; exclusive as the caller promises.
    unsafe { &mut *client.cast() }
}

/// Runs `action` on a client, or returns the status that says why not.
///
/// # Safety
/// As for [`check`]; nothing else uses the object meanwhile.
pub(super) unsafe fn with(
    client: *mut mbm_client,
    action: impl FnOnce(&mut Object) -> Status,
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

/// Asks a client something; `otherwise` where there is none.
///
/// # Safety
/// As for [`with`].
pub(super) unsafe fn ask<T>(
    client: *const mbm_client,
    otherwise: T,
    question: impl FnOnce(&mut Object) -> T,
) -> T {
    // SAFETY: checked; exclusive as the caller promises, and every object is
    // writable storage.
    unsafe {
        match check(client) {
            Status::OK => question(object(client.cast_mut())),
            _ => otherwise,
        }
    }
}
