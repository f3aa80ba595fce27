//! The functions that make references of the pointers that C programs pass: to arrays,
//! to values, and to the objects that C programs begin.

use core::slice::{from_raw_parts, from_raw_parts_mut};
use mbm::error::{Error, Status};

/// A pointer of C to values that this library reads: NULL, or to as many as the comment of the C
/// function says, which nothing writes while that function reads them.
#[repr(transparent)]
pub struct In<T>(*const T);

impl<T> Clone for In<T> {
    fn clone(&self) -> In<T> {
        *self
    }
}

impl<T> Copy for In<T> {}

impl<T> From<&T> for In<T> {
    fn from(value: &T) -> In<T> {
        In(value)
    }
}

impl<T> In<T> {
    /// The pointer, as C passes it.
    ///
    /// # Safety
    /// It is as [`In`] says.
    pub const unsafe fn new(pointer: *const T) -> In<T> {
        In(pointer)
    }

    /// The same values, as a type that has their bytes.
    pub(crate) fn cast<U>(self) -> In<U> {
        In(self.0.cast())
    }

    /// The pointer as C passed it.
    pub(crate) fn pointer(self) -> *const T {
        self.0
    }

    /// The value; `None` if the pointer is NULL.
    pub(crate) fn value<'a>(self) -> Option<&'a T> {
        // SAFETY: NULL or a value, as `In` says.
        unsafe { self.0.as_ref() }
    }

    /// Refuses NULL.
    pub(crate) fn required(self) -> Result<(), Error> {
        required(self.0)
    }

    /// The array of `count` values. The pointer may be NULL only if `count` is 0. Refused if the
    /// array would be longer than any memory.
    pub(crate) fn slice<'a>(self, count: usize) -> Result<&'a [T], Error> {
        match count {
            0 => Ok(&[]),
            // SAFETY: an array of C, as `In` says.
            _ if is_array(self.0, count) => Ok(unsafe { from_raw_parts(self.0, count) }),
            _ => Err(Error::InvalidArgument),
        }
    }

    /// The array of `count` values; an empty one if the pointer is NULL.
    pub(crate) fn slice_or_empty<'a>(self, count: usize) -> &'a [T] {
        match self.0.is_null() {
            true => &[],
            // SAFETY: an array of C, as `In` says.
            false => unsafe { from_raw_parts(self.0, count) },
        }
    }
}

impl<T: Copy> In<T> {
    /// A copy of the value. Refused if the pointer is NULL.
    pub(crate) fn get(self) -> Result<T, Error> {
        required(self.0)?;
        // SAFETY: not NULL, so a value.
        Ok(unsafe { self.0.read() })
    }
}

impl In<u8> {
    /// The characters of a C string, without the NUL that ends it: at most `most + 1`, and it
    /// reads no more.
    pub(crate) fn text<'a>(self, most: usize) -> Result<&'a [u8], Error> {
        required(self.0)?;
        let mut count = 0;
        // SAFETY: no byte after the NUL is read.
        while count <= most && unsafe { *self.0.add(count) } != 0 {
            count += 1;
        }
        self.slice(count)
    }
}

/// A pointer of C to values that this library writes: NULL, or to storage for as many as the
/// comment of the C function says, which nothing else uses meanwhile.
#[repr(transparent)]
pub struct Out<T>(*mut T);

impl<T> From<&mut T> for Out<T> {
    fn from(value: &mut T) -> Out<T> {
        Out(value)
    }
}

impl<T> Out<T> {
    /// The pointer, as C passes it.
    ///
    /// # Safety
    /// It is as [`Out`] says.
    pub const unsafe fn new(pointer: *mut T) -> Out<T> {
        Out(pointer)
    }

    /// As [`In::cast`].
    pub(crate) fn cast<U>(self) -> Out<U> {
        Out(self.0.cast())
    }

    /// The pointer as C passed it.
    pub(crate) fn pointer(&self) -> *mut T {
        self.0
    }

    /// True if it is NULL.
    pub(crate) fn is_null(&self) -> bool {
        self.0.is_null()
    }

    /// Refuses NULL.
    pub(crate) fn required(&self) -> Result<(), Error> {
        required(self.0)
    }

    /// As [`In::value`], writable.
    pub(crate) fn value<'a>(self) -> Option<&'a mut T> {
        // SAFETY: NULL or a value, as `Out` says.
        unsafe { self.0.as_mut() }
    }

    /// As [`In::slice`], writable.
    pub(crate) fn slice<'a>(self, count: usize) -> Result<&'a mut [T], Error> {
        match count {
            0 => Ok(&mut []),
            // SAFETY: an array of C, as `Out` says.
            _ if is_array(self.0, count) => Ok(unsafe { from_raw_parts_mut(self.0, count) }),
            _ => Err(Error::InvalidArgument),
        }
    }

    /// As [`Out::slice`], but never NULL.
    pub(crate) fn buffer<'a>(self, capacity: u16) -> Result<&'a mut [T], Error> {
        match is_array(self.0, capacity.into()) {
            // SAFETY: an array of C, as `Out` says.
            true => Ok(unsafe { from_raw_parts_mut(self.0, capacity.into()) }),
            false => Err(Error::InvalidArgument),
        }
    }

    /// Writes a value. Returns the code of [`Status::OK`], or of [`Status::INVALID_ARGUMENT`] if
    /// the pointer is NULL.
    pub(crate) fn put(&self, value: T) -> u8 {
        if self.0.is_null() {
            return Status::INVALID_ARGUMENT.code();
        }
        // SAFETY: not NULL, so storage of a value.
        unsafe { self.0.write(value) }
        Status::OK.code()
    }

    /// Writes the result of `find`; nothing if `find` returns an error.
    pub(crate) fn put_result(&self, find: impl FnOnce() -> Result<T, Error>) -> Result<(), Error> {
        required(self.0)?;
        // SAFETY: not NULL, so storage of a value.
        unsafe { self.0.write(find()?) }
        Ok(())
    }
}

impl<T: Copy> Out<T> {
    /// As [`In::get`], of a value that is then written.
    pub(crate) fn get(&self) -> Result<T, Error> {
        In(self.0.cast_const()).get()
    }
}

impl Out<u16> {
    /// As [`Out::put`], for a length. For an error it writes the length 0 and returns the code of
    /// the error.
    pub(crate) fn put_length(&self, length: Result<usize, Error>) -> u8 {
        match length {
            Ok(length) => self.put(length as u16),
            Err(refused) => {
                self.put(0);
                refused.code()
            }
        }
    }
}

/// Refuses a pointer that is NULL.
fn required<T>(pointer: *const T) -> Result<(), Error> {
    match pointer.is_null() {
        true => Err(Error::InvalidArgument),
        false => Ok(()),
    }
}

/// True if `count` items may lie at `items`. (A count of C has 16 bits.)
fn is_array<T>(items: *const T, count: usize) -> bool {
    let is_short = size_of::<usize>() > 2 || count <= isize::MAX as usize / size_of::<T>();
    is_short && !items.is_null()
}

/// True if the `bytes` bytes at `one` and the `more` bytes at `other` have a byte in common.
pub(crate) fn overlap(one: *const u8, bytes: u16, other: *const u8, more: u16) -> bool {
    let (one, other) = (one as usize, other as usize);
    one < other.saturating_add(usize::from(more)) && other < one.saturating_add(usize::from(bytes))
}

/// A type of object that C programs use. The C program owns the storage and zeroes it before
/// first use; a begin function makes an object of it.
///
/// # Safety
/// `mark` returns a byte of the storage. That byte is zero in zeroed storage, and only the
/// begin functions and [`with_hooks`] write it.
pub(crate) unsafe trait CObject: Sized {
    /// How the functions of this library reach the fields of the object: by a reference; or
    /// by a pointer, if hooks that run meanwhile may pass the object to this library.
    type Access<'a>;

    /// The byte that says whether the storage is an object. [`check`] reads it before
    /// any reference to the object is made.
    ///
    /// # Safety
    /// `object` points to storage of an object, zeroed or begun.
    unsafe fn mark(object: *const Self) -> *mut u8;

    /// The fields of an object.
    ///
    /// # Safety
    /// [`check`] returned [`Status::OK`] for the object. Nothing else uses it while a
    /// reference lives.
    unsafe fn access<'a>(object: *mut Self) -> Self::Access<'a>;
}

/// Makes `$storage` the storage of an `Object`, with a field `mark`: C programs see only its size.
/// `$access` is what functions of this library get: a reference to the object or to one of its
/// fields; or a pointer, if hooks that run meanwhile may pass the object to this library. Those
/// functions read the mark, so no reference includes it.
macro_rules! c_object {
    ($storage:ident, $($access:tt)*) => {
        const _: () = {
            let (space, used) = (size_of::<$storage>(), size_of::<Object>());
            assert!(align_of::<$storage>() >= align_of::<Object>());
            assert!(used <= space);
            // Hiding the fields may waste 5 % where RAM is scarce.
            assert!(size_of::<usize>() > 4 || (space - used) * 20 <= space);
        };

        // SAFETY: the mark is a field of its own.
        unsafe impl $crate::pointers::CObject for $storage {
            unsafe fn mark(object: *const $storage) -> *mut u8 {
                &raw mut (*object.cast::<Object>().cast_mut()).mark
            }

            $crate::pointers::c_object! { @ $storage $($access)* }
        }
    };
    (@ $storage:ident &mut $type:ty $(, $field:ident)?) => {
        type Access<'a> = &'a mut $type;

        unsafe fn access<'a>(object: *mut $storage) -> Self::Access<'a> {
            &mut (*object.cast::<Object>())$(.$field)?
        }
    };
    (@ $storage:ident *mut $type:ty $(, $field:ident)?) => {
        type Access<'a> = *mut $type;

        unsafe fn access<'a>(object: *mut $storage) -> Self::Access<'a> {
            &raw mut (*object.cast::<Object>())$(.$field)?
        }
    };
}
pub(crate) use c_object;

/// The mark of an object that was begun. Zeroed storage does not have it.
pub(crate) const BEGUN: u8 = IN_HOOK & !1;

/// The mark of an object while it may call hooks that must not use it.
pub(crate) const IN_HOOK: u8 = Status::BUSY.code();
const _: () = assert!(IN_HOOK & 1 != 0);

/// Whether the functions of this library may use the object at a pointer from C:
/// [`Status::OK`]; [`Status::INVALID_ARGUMENT`] if the pointer is NULL;
/// [`Status::NOT_INITIALISED`] if the object was never begun; [`Status::BUSY`] if a hook
/// that may not use the object makes the call.
///
/// # Safety
/// `object` is NULL or points to storage of an object, zeroed or begun.
#[cfg_attr(all(target_os = "none", not(target_arch = "avr")), inline(never))]
pub(crate) unsafe fn check<O: CObject>(object: *const O) -> Status {
    check_once(object)
}

/// As [`check`], inlined: for a function that is, in most images, the only one of its
/// object's type that checks. With `check` for all, a server takes 12 bytes more on a Cortex-M0+,
/// and a master 16.
pub(crate) unsafe fn check_once<O: CObject>(object: *const O) -> Status {
    if object.is_null() {
        return Status::INVALID_ARGUMENT;
    }
    // SAFETY: not NULL, so storage of an object.
    unsafe { check_mark(object) }
}

/// As [`check`], for storage of an object.
///
/// # Safety
/// `object` points to storage of an object, zeroed or begun.
pub(crate) unsafe fn check_mark<O: CObject>(object: *const O) -> Status {
    match O::mark(object).read() {
        BEGUN => Status::OK,
        IN_HOOK => Status::BUSY,
        _ => Status::NOT_INITIALISED,
    }
}

/// The fields of the object at a pointer.
///
/// # Safety
/// As for [`CObject::access`]; every object is writable storage.
pub(crate) unsafe fn object<'a, O: CObject>(object: *const O) -> O::Access<'a> {
    O::access(object.cast_mut())
}

/// Runs `action`, which may call hooks of an object. If a hook calls this library on the
/// same object, [`check`] refuses that call. It reads the mark only, which no reference
/// that `action` makes includes.
///
/// # Safety
/// [`check`] returned [`Status::OK`] for the object, or the object is being begun. No
/// reference to it lives.
pub(crate) unsafe fn with_hooks<O: CObject, T>(object: *const O, action: impl FnOnce() -> T) -> T {
    let mark = O::mark(object);
    mark.write(IN_HOOK);
    let result = action();
    mark.write(BEGUN);
    result
}

/// Zeroes the storage of an object. (A loop instead of memset: libc's memset is larger, and
/// most images do not need it otherwise.)
///
/// # Safety
/// `object` points to storage of an object, which nothing else uses.
pub(crate) unsafe fn zero<O: CObject>(object: *mut O) {
    const { assert!(size_of::<O>().is_multiple_of(size_of::<usize>())) }
    // The storage is a number of words.
    let mut word = object.cast::<usize>();
    let end = object.add(1).cast::<usize>();
    loop {
        word.write_volatile(0);
        word = word.add(1);
        if word == end {
            return;
        }
    }
}

/// As [`zero`] on a host, where a begin function tolerates storage that was not zeroed. It does
/// nothing in firmware, where a line would take 20 bytes of flash more, and a node and a server
/// as much.
#[inline(always)]
pub(crate) unsafe fn zero_on_host<O: CObject>(object: *mut O) {
    if !cfg!(target_os = "none") {
        zero(object)
    }
}

/// Checks the object and runs `action` on it. Returns the code of the status of the check,
/// or of `action`. `action` calls hooks only inside [`with_hooks`].
///
/// # Safety
/// Nothing else uses the object meanwhile.
pub(crate) unsafe fn with<'a, O: CObject>(
    object: *mut O,
    action: impl FnOnce(O::Access<'a>) -> Status,
) -> u8 {
    let status = match check(object) {
        Status::OK => action(O::access(object)),
        refused => refused,
    };
    status.code()
}

/// As [`with`], for an action that nothing refuses.
pub(crate) unsafe fn change<'a, O: CObject>(
    object: *mut O,
    action: impl FnOnce(O::Access<'a>),
) -> u8 {
    with(object, |fields| {
        action(fields);
        Status::OK
    })
}

/// Checks the object and returns what `getter` reads of it. Returns `otherwise` if the
/// check refuses.
pub(crate) unsafe fn read<'a, O: CObject, T>(
    object: *const O,
    otherwise: T,
    getter: impl FnOnce(O::Access<'a>) -> T,
) -> T {
    match check(object) {
        Status::OK => getter(O::access(object.cast_mut())),
        _ => otherwise,
    }
}
