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

/// The master behind a pointer.
///
/// # Safety
/// [`check`] found one, and nothing else uses it while the reference lives.
pub(super) unsafe fn object<'a>(master: *mut mbm_master) -> &'a mut Object {
    // SAFETY: begun, so every field is valid; exclusive as the caller promises.
    unsafe { &mut *master.cast() }
}

/// As [`check`], but what nobody has touched yet becomes a master, with
/// defaults and without port and buffers.
///
/// # Safety
/// As for [`with`].
#[cfg_attr(target_os = "none", inline(never))]
pub(super) unsafe fn prepare(master: *mut mbm_master) -> Status {
    // SAFETY: as the caller promises; what is not begun is zeroed, and zero is
    // a value of every field.
    unsafe {
        match check(master) {
            Status::NOT_INITIALISED => {
                object(master).preset();
                Status::OK
            }
            other => other,
        }
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
    // SAFETY: checked; exclusive as the caller promises.
    let status = unsafe {
        match check(master) {
            Status::OK => action(object(master)),
            refused => refused,
        }
    };
    status.code()
}

/// As [`with`], for what [`prepare`] makes a master of.
///
/// # Safety
/// As for [`with`].
pub(super) unsafe fn with_new(
    master: *mut mbm_master,
    action: impl FnOnce(&mut Object) -> Status,
) -> u8 {
    // SAFETY: prepared; exclusive as the caller promises.
    let status = unsafe {
        match prepare(master) {
            Status::OK => action(object(master)),
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
    // SAFETY: checked; exclusive as the caller promises, and every object is
    // writable storage.
    unsafe {
        match check(master) {
            Status::OK => question(object(master.cast_mut())),
            _ => otherwise,
        }
    }
}
