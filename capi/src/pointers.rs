//! Where pointers from C become references: to arrays and values, and to the objects
//! that C programs begin.

use core::slice::{from_raw_parts, from_raw_parts_mut};
use mbm::error::Status;

/// The `count` things from a pointer on; none for NULL, or for more than any
/// memory has.
///
/// # Safety
/// `first` is NULL or points to so many, which nothing changes meanwhile.
pub(crate) unsafe fn lent<'a, T>(first: *const T, count: usize) -> Option<&'a [T]> {
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
pub(crate) unsafe fn lent_or_none<'a, T>(first: *const T, count: usize) -> Option<&'a [T]> {
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
pub(crate) unsafe fn buffer<'a>(first: *mut u8, capacity: u16) -> Option<&'a mut [u8]> {
    let capacity = usize::from(capacity);
    if first.is_null() || capacity > isize::MAX as usize {
        return None;
    }
    // SAFETY: not NULL and not too long; the rest as the caller promises.
    Some(unsafe { from_raw_parts_mut(first, capacity) })
}

/// True if two stretches of bytes have one in common.
pub(crate) fn overlap(one: *const u8, bytes: u16, other: *const u8, more: u16) -> bool {
    let (one, other) = (one as usize, other as usize);
    one < other.saturating_add(usize::from(more)) && other < one.saturating_add(usize::from(bytes))
}

/// What a pointer points to; none for NULL.
///
/// # Safety
/// `place` is NULL or points to a value.
pub(crate) unsafe fn get<T: Copy>(place: *const T) -> Option<T> {
    // SAFETY: as the caller promises.
    (!place.is_null()).then(|| unsafe { place.read() })
}

/// Leaves a value where a pointer points to, and [`Status::OK`] for C;
/// [`Status::INVALID_ARGUMENT`] for NULL.
///
/// # Safety
/// `place` is NULL or points to room for a value.
pub(crate) unsafe fn put<T>(place: *mut T, value: T) -> u8 {
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
pub(crate) unsafe fn put_length(place: *mut u16, length: Result<usize, Status>) -> u8 {
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

/// An object of C: storage of its caller's, zeroed before first use, which a begin
/// function makes an object of.
///
/// # Safety
/// `mark` gives a byte of the storage that zeroed storage has zero, and to which only
/// what begins an object, and [`calling`], write.
pub(crate) unsafe trait CObject: Sized {
    /// How the functions on it reach what lies behind it: by a reference, or by a
    /// pointer where hooks that run meanwhile may hand the object to this library.
    type Access<'a>;

    /// The mark of an object, which is read before any reference to it is made.
    ///
    /// # Safety
    /// `object` points to storage of one, zeroed or begun.
    unsafe fn mark(object: *const Self) -> *mut u8;

    /// What lies behind an object.
    ///
    /// # Safety
    /// [`check`] found one, and nothing else uses it while a reference lives.
    unsafe fn access<'a>(object: *mut Self) -> Self::Access<'a>;
}

/// Marks an object that was begun; zeroed storage does not carry it.
pub(crate) const BEGUN: u8 = CALLING & !1;

/// Marks an object while hooks may be called that may not use it.
pub(crate) const CALLING: u8 = Status::BUSY.code();
const _: () = assert!(CALLING & 1 != 0);

/// Whether there is an object behind a pointer from C: [`Status::OK`],
/// [`Status::INVALID_ARGUMENT`] for NULL, [`Status::NOT_INITIALISED`] for one that was
/// never begun, [`Status::BUSY`] from within a hook that may not use it.
///
/// # Safety
/// `object` is NULL or points to storage of one, zeroed or begun.
#[cfg_attr(all(target_os = "none", not(target_arch = "avr")), inline(never))]
pub(crate) unsafe fn check<O: CObject>(object: *const O) -> Status {
    // SAFETY: as the caller promises.
    unsafe { check_once(object) }
}

/// [`check`], for a function that most images have no other with of its noun.
///
/// # Safety
/// As for [`check`].
#[inline(always)]
pub(crate) unsafe fn check_once<O: CObject>(object: *const O) -> Status {
    if object.is_null() {
        return Status::INVALID_ARGUMENT;
    }
    // SAFETY: not NULL, so storage of an object.
    match unsafe { O::mark(object).read() } {
        BEGUN => Status::OK,
        CALLING => Status::BUSY,
        _ => Status::NOT_INITIALISED,
    }
}

/// What lies behind a pointer to an object.
///
/// # Safety
/// As for [`CObject::access`]; every object is writable storage.
pub(crate) unsafe fn object<'a, O: CObject>(object: *const O) -> O::Access<'a> {
    // SAFETY: as the caller promises.
    unsafe { O::access(object.cast_mut()) }
}

/// Runs `action`, which may call hooks of an object. A call on the same object from
/// within them is refused by [`check`], which looks at the mark alone: a reference that
/// `action` makes does not cover that.
///
/// # Safety
/// [`check`] found an object, or one is being begun, and no reference to it lives.
#[inline(always)]
pub(crate) unsafe fn calling<O: CObject, T>(object: *const O, action: impl FnOnce() -> T) -> T {
    // SAFETY: as the caller promises; every object is writable storage.
    unsafe {
        let mark = O::mark(object);
        mark.write(CALLING);
        let result = action();
        mark.write(BEGUN);
        result
    }
}

/// Runs `action` on an object, or returns the status that says why not. It calls no
/// hook but within [`calling`].
///
/// # Safety
/// As for [`check`]; nothing else uses the object meanwhile.
pub(crate) unsafe fn with<'a, O: CObject>(
    object: *mut O,
    action: impl FnOnce(O::Access<'a>) -> Status,
) -> u8 {
    // SAFETY: checked; exclusive as the caller promises.
    let status = unsafe {
        match check(object) {
            Status::OK => action(O::access(object)),
            refused => refused,
        }
    };
    status.code()
}

/// Asks an object something; `otherwise` where there is none, and from within a hook
/// that may not use it.
///
/// # Safety
/// As for [`with`].
pub(crate) unsafe fn ask<'a, O: CObject, T>(
    object: *const O,
    otherwise: T,
    question: impl FnOnce(O::Access<'a>) -> T,
) -> T {
    // SAFETY: checked; exclusive as the caller promises, and every object is
    // writable storage.
    unsafe {
        match check(object) {
            Status::OK => question(O::access(object.cast_mut())),
            _ => otherwise,
        }
    }
}

/// Puts what `find` gives where C wants it, and nothing if it gives a status.
///
/// # Safety
/// `place` is NULL or points to a `T`.
pub(crate) unsafe fn put_found<T>(
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
pub(crate) unsafe fn slice<'a, T>(items: *const T, count: usize) -> Result<&'a [T], Status> {
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
pub(crate) unsafe fn slice_mut<'a, T>(items: *mut T, count: usize) -> Result<&'a mut [T], Status> {
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
pub(crate) unsafe fn text<'a>(text: *const u8, most: usize) -> Result<&'a [u8], Status> {
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
