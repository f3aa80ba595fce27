//! The only place where a pointer from C becomes a reference.

use super::master::{mbm_master, Core, Object};
use core::slice::{from_raw_parts, from_raw_parts_mut};
use mbm::error::Status;

/// The `count` things from a pointer on; none for NULL, or for more than any
/// memory has.
///
/// # Safety
/// `first` is NULL or points to so many, which nothing changes meanwhile.
pub(super) unsafe fn lent<'a, T>(first: *const T, count: usize) -> Option<&'a [T]> {
    if first.is_null() || count > isize::MAX as usize / size_of::<T>() {
        return None;
    }
    // SAFETY: not NULL and not too long; the rest as the caller promises.
    Some(unsafe { from_raw_parts(first, count) })
}

/// As [`lent`], where no pointer is needed to nothing.
///
/// # Safety
/// As for [`lent`].
pub(super) unsafe fn lent_or_none<'a, T>(first: *const T, count: usize) -> Option<&'a [T]> {
    if count == 0 {
        return Some(&[]);
    }
    // SAFETY: as the caller promises.
    unsafe { lent(first, count) }
}

/// The buffer of so many bytes that starts at a pointer; none for NULL.
///
/// # Safety
/// `first` is NULL or points to so many bytes, which nothing else uses
/// meanwhile: see [`overlap`].
pub(super) unsafe fn buffer<'a>(first: *mut u8, capacity: u16) -> Option<&'a mut [u8]> {
    let capacity = usize::from(capacity);
    if first.is_null() || capacity > isize::MAX as usize {
        return None;
    }
    // SAFETY: not NULL and not too long; the rest as the caller promises.
    Some(unsafe { from_raw_parts_mut(first, capacity) })
}

/// True if two stretches of bytes have one in common.
pub(super) fn overlap(one: *const u8, bytes: u16, other: *const u8, more: u16) -> bool {
    let (one, other) = (one as usize, other as usize);
    one < other.saturating_add(usize::from(more)) && other < one.saturating_add(usize::from(bytes))
}

/// What a pointer points to; none for NULL.
///
/// # Safety
/// `place` is NULL or points to a value.
pub(super) unsafe fn get<T: Copy>(place: *const T) -> Option<T> {
    // SAFETY: as the caller promises.
    (!place.is_null()).then(|| unsafe { place.read() })
}

/// Leaves a value where a pointer points to, and [`Status::OK`] for C;
/// [`Status::INVALID_ARGUMENT`] for NULL.
///
/// # Safety
/// `place` is NULL or points to room for a value.
pub(super) unsafe fn put<T>(place: *mut T, value: T) -> u8 {
    if place.is_null() {
        return Status::INVALID_ARGUMENT.code();
    }
    // SAFETY: not NULL; the rest as the caller promises.
    unsafe { place.write(value) }
    Status::OK.code()
}

/// As [`put`], of a length, or of 0 and the status that says why there is none.
///
/// # Safety
/// As for [`put`].
pub(super) unsafe fn put_length(place: *mut u16, length: Result<usize, Status>) -> u8 {
    match length {
        // SAFETY: as the caller promises.
        Ok(length) => unsafe { put(place, length as u16) },
        Err(refused) => {
            // SAFETY: as the caller promises.
            unsafe { put(place, 0) };
            refused.code()
        }
    }
}

/// Whether there is a master behind a pointer from C: [`Status::OK`],
/// [`Status::INVALID_ARGUMENT`] for NULL, [`Status::NOT_INITIALISED`] for an
/// object that was never begun, [`Status::BUSY`] from within a hook of its port.
///
/// # Safety
/// `master` is NULL or points to an `mbm_master`, zeroed or begun.
#[cfg_attr(target_os = "none", inline(never))]
pub(super) unsafe fn check(master: *const mbm_master) -> Status {
    if master.is_null() {
        return Status::INVALID_ARGUMENT;
    }
    // SAFETY: not NULL, so storage of an object, which has room for it.
    match unsafe { Object::mark(master).read() } {
        Object::BEGUN => Status::OK,
        Object::CALLING => Status::BUSY,
        _ => Status::NOT_INITIALISED,
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

/// Runs `action` on the core of a master, which may call hooks of its port. A call
/// on the same object from within them is refused by [`check`], which looks at the
/// mark alone; the reference to the core does not cover that.
///
/// # Safety
/// [`check`] found a master, and no reference to it lives.
#[inline(always)]
pub(super) unsafe fn calling<T>(master: *mut mbm_master, action: impl FnOnce(&mut Core) -> T) -> T {
    // SAFETY: begun, so every field is valid; exclusive, for no other function
    // makes a reference while the mark says so.
    unsafe {
        let mark = Object::mark(master);
        mark.write(Object::CALLING);
        let result = action(&mut *Object::core_of(master));
        mark.write(Object::BEGUN);
        result
    }
}

/// Runs `action` on a master, or returns the status that says why not. It calls no
/// hook: for that there is [`calling`].
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

/// Asks a master something; `otherwise` where there is none, and from within a hook
/// of its port.
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

/// Puts what `find` gives where C wants it, and nothing if it gives a status.
///
/// # Safety
/// `place` is NULL or points to a `T`.
pub(super) unsafe fn put_found<T>(
    place: *mut T,
    find: impl FnOnce() -> Result<T, Status>,
) -> Result<(), Status> {
    if place.is_null() {
        return Err(Status::INVALID_ARGUMENT);
    }
    let found = find()?;
    // SAFETY: not NULL, so room for it.
    unsafe { place.write(found) };
    Ok(())
}

/// An array of C; NULL is one of no items alone.
///
/// # Safety
/// `items` is NULL or points to `count` items that nobody writes meanwhile.
pub(super) unsafe fn slice<'a, T>(items: *const T, count: usize) -> Result<&'a [T], Status> {
    match (items.is_null(), count) {
        (_, 0) => Ok(&[]),
        (true, _) => Err(Status::INVALID_ARGUMENT),
        // SAFETY: not NULL, so an array.
        (false, _) => Ok(unsafe { from_raw_parts(items, count) }),
    }
}

/// As [`slice`], to write.
///
/// # Safety
/// As for [`slice`], and nobody else reads them meanwhile.
pub(super) unsafe fn slice_mut<'a, T>(items: *mut T, count: usize) -> Result<&'a mut [T], Status> {
    match (items.is_null(), count) {
        (_, 0) => Ok(&mut []),
        (true, _) => Err(Status::INVALID_ARGUMENT),
        // SAFETY: not NULL, so an array.
        (false, _) => Ok(unsafe { from_raw_parts_mut(items, count) }),
    }
}

/// The characters of a C string, without its NUL.
///
/// Looks at no more than `most` and one: of a longer string it gives so many.
///
/// # Safety
/// `text` is NULL or points to characters that a NUL ends.
pub(super) unsafe fn text<'a>(text: *const u8, most: usize) -> Result<&'a [u8], Status> {
    if text.is_null() {
        return Err(Status::INVALID_ARGUMENT);
    }
    let mut count = 0;
    // SAFETY: nothing behind the NUL is looked at.
    unsafe {
        while count <= most && *text.add(count) != 0 {
            count += 1;
        }
        slice(text, count)
    }
}
