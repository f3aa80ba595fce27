//! The only place where a pointer to an object becomes a reference.

use super::master::{mbm_master, Object};
use crate::error::Status;

/// Whether there is a master behind a pointer from C: [`Status::OK`],
/// [`Status::INVALID_ARGUMENT`] for NULL, [`Status::NOT_INITIALISED`] for an
/// object that was never begun.
///
/// # Safety
/// `master` is NULL or points to an `mbm_master`, zeroed or begun.
pub(super) unsafe fn check(master: *const mbm_master) -> Status {
    if master.is_null() {
        return Status::INVALID_ARGUMENT;
    }
    // SAFETY: not NULL, so storage of an object, which has room for it.
    if unsafe { Object::is_begun(master.cast()) } {
        Status::OK
    } else {
        Status::NOT_INITIALISED
    }
}

/// Runs `action` on a master, or returns the status that says why not.
///
/// # Safety
/// As for [`check`]; nothing else uses the object meanwhile.
pub(super) unsafe fn with(
    master: *mut mbm_master,
    action: impl FnOnce(&mut Object) -> Status,
) -> u8 {
    // SAFETY: begun, so every field is valid; exclusive as the caller promises.
    let status = unsafe {
        match check(master) {
            Status::OK => action(&mut *master.cast()),
            refused => refused,
        }
    };
    status.code()
}

/// Asks a master something; `otherwise` where there is none.
///
/// # Safety
/// As for [`with`].
pub(super) unsafe fn ask<T>(
    master: *const mbm_master,
    otherwise: T,
    question: impl FnOnce(&mut Object) -> T,
) -> T {
    // SAFETY: as above; every object is writable storage.
    unsafe {
        match check(master) {
            Status::OK => question(&mut *master.cast_mut().cast()),
            _ => otherwise,
        }
    }
}
