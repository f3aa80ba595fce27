//! The only place where a pointer to an object becomes a reference.

use super::master::{mbm_master, Object};
use crate::error::Status;

/// The master behind a pointer from C.
///
/// # Errors
/// [`Status::INVALID_ARGUMENT`] for NULL, [`Status::NOT_INITIALISED`] for an
/// object that was never begun.
///
/// # Safety
/// `master` is NULL or points to an `mbm_master`, zeroed or begun, that
/// nothing else uses while the reference lives.
pub(super) unsafe fn master<'a>(master: *mut mbm_master) -> Result<&'a mut Object, Status> {
    if master.is_null() {
        return Err(Status::INVALID_ARGUMENT);
    }
    let object = master.cast::<Object>();
    // SAFETY: not NULL, so storage of an object, which has room for it.
    if !unsafe { Object::is_begun(object) } {
        return Err(Status::NOT_INITIALISED);
    }
    // SAFETY: begun, so every field is valid; exclusive as the caller promises.
    Ok(unsafe { &mut *object })
}

/// Runs `action` on a master, or returns the status that says why not.
///
/// # Safety
/// As for [`master`].
pub(super) unsafe fn with(
    pointer: *mut mbm_master,
    action: impl FnOnce(&mut Object) -> Status,
) -> u8 {
    // SAFETY: as the caller promises.
    match unsafe { master(pointer) } {
        Ok(master) => action(master).code(),
        Err(status) => status.code(),
    }
}

/// Asks a master something; `otherwise` where there is none.
///
/// # Safety
/// As for [`master`].
pub(super) unsafe fn ask<T>(
    pointer: *const mbm_master,
    otherwise: T,
    question: impl FnOnce(&mut Object) -> T,
) -> T {
    // SAFETY: as the caller promises; every object is writable storage.
    match unsafe { master(pointer.cast_mut()) } {
        Ok(master) => question(master),
        Err(_) => otherwise,
    }
}
