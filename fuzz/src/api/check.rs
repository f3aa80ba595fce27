//! Checks that hold for every call with any arguments.

use super::world::World;
use mbm_c::MBM_MALFORMED_VALUE;
use mbm_c::{In, Out};

pub const OK: u8 = 0;
pub const PENDING: u8 = 235;
/// The greatest status.
const LAST: u8 = MBM_MALFORMED_VALUE;

/// Calls a function of the C API. Its first argument, or `$object`, is marked as in use during the
/// call.
macro_rules! call {
    ($w:expr, $name:ident($first:expr $(, $more:expr)* $(,)?)) => {{
        let first = $first;
        call!($w, first, $name(first $(, $more)*))
    }};
    ($w:expr, $object:expr, $name:ident($($argument:expr),* $(,)?)) => {{
        let w: &$crate::api::world::World = $w;
        let object = $object;
        call!(@with w, object, $name, [], $($argument,)*)
    }};
    // Each argument is evaluated once, so a run that is traced is the same as one that is not.
    (@with $w:ident, $object:ident, $name:ident, [$($ready:ident)*], $next:expr, $($more:expr,)*) => {
        match $next {
            argument => call!(@with $w, $object, $name, [$($ready)* argument], $($more,)*),
        }
    };
    (@with $w:ident, $object:ident, $name:ident, [$($ready:ident)*],) => {{
        $w.note(|| {
            let arguments: Vec<String> = vec![$(format!("{:?}", $ready)),*];
            format!("{}({})", stringify!($name), arguments.join(", "))
        });
        $w.before($object);
        // SAFETY: every pointer is NULL or valid as the header requires.
        #[allow(unused_unsafe)]
        let returned = unsafe { mbm_c::$name($($crate::api::check::Pass::pass($ready)),*) };
        $w.after();
        $w.note(|| format!("-> {returned:?}"));
        returned
    }};
}

/// A call by `checked_call`.
macro_rules! checked {
    ($w:expr, $name:ident($first:expr $(, $more:expr)* $(,)?)) => {
        $crate::api::check::checked_call(
            $w,
            $crate::api::check::span($first),
            stringify!($name),
            || call!($w, $name($first $(, $more)*)),
        )
    };
}

/// A call by `refused_changes_nothing`, with the memory ranges `$spans` or the first argument.
macro_rules! refused {
    ($w:expr, $name:ident($first:expr $(, $more:expr)* $(,)?)) => {
        refused!(
            $w,
            &[$crate::api::check::span($first)],
            $name($first $(, $more)*)
        )
    };
    ($w:expr, $spans:expr, $name:ident($($argument:expr),* $(,)?)) => {
        $crate::api::check::refused_changes_nothing($w, $spans, stringify!($name), || {
            call!($w, $name($($argument),*))
        })
    };
}

/// An argument that a C function takes as a `T`: a pointer as the type of its parameter.
pub trait Pass<T> {
    /// The argument.
    ///
    /// # Safety
    /// A pointer is NULL or valid as the header requires.
    unsafe fn pass(self) -> T;
}

/// Passes arguments of one type as another.
macro_rules! passes {
    ($($given:ty => $taken:ty: $argument:ident => $passed:expr;)*) => {
        $(impl<T> Pass<$taken> for $given {
            unsafe fn pass(self) -> $taken {
                let $argument = self;
                $passed
            }
        })*
    };
}

passes! {
    T => T: value => value;
    *mut T => *const T: pointer => pointer;
    &mut T => *mut T: value => value;
    &T => *const T: value => value;
    *const T => In<T>: pointer => In::new(pointer);
    *mut T => In<T>: pointer => In::new(pointer);
    &T => In<T>: value => In::from(value);
    &mut T => In<T>: value => In::from(&*value);
    *mut T => Out<T>: pointer => Out::new(pointer);
    &mut T => Out<T>: value => Out::from(value);
}

/// A memory range: its start and its length in bytes.
pub type Span = (*const u8, usize);

/// The memory of the object that a pointer points to.
pub fn span<T>(thing: *const T) -> Span {
    (thing.cast(), size_of::<T>())
}

/// Makes a call that returns a status. Checks that it is refused if a hook of the object is
/// running.
pub fn checked_call(w: &World, (object, _): Span, name: &str, call: impl FnOnce() -> u8) -> u8 {
    let locked = w.is_locked(object);
    let status = is_status(name, call());
    assert!(
        !locked || (status != OK && status != PENDING),
        "{name} returned {status} from within a hook"
    );
    status
}

/// Makes a call like `checked_call`. If the call is refused, the memory ranges must be
/// unchanged, unless a hook has called the API during the call. The first range is the object.
pub fn refused_changes_nothing(
    w: &World,
    spans: &[Span],
    name: &str,
    call: impl FnOnce() -> u8,
) -> u8 {
    unchanged_if_refused(w, spans, name, || checked_call(w, spans[0], name, call))
}

/// As `refused_changes_nothing`, for a call that a hook of the object may make.
pub fn unchanged_if_refused(
    w: &World,
    spans: &[Span],
    name: &str,
    call: impl FnOnce() -> u8,
) -> u8 {
    let before: Vec<Vec<u8>> = spans.iter().map(|span| bytes(*span)).collect();
    let inner = w.inner_calls.get();
    let status = is_status(name, call());
    // `inner_calls` counts this call too if a hook makes it.
    let others = w.inner_calls.get() - inner - u32::from(w.is_inside());
    if status != OK && status != PENDING && others == 0 {
        for (span, before) in spans.iter().zip(&before) {
            assert!(
                bytes(*span) == *before,
                "{name} returned {status}, and changed what it was given"
            );
        }
    }
    status
}

/// The bytes of a memory range; empty for NULL.
pub fn bytes((start, length): Span) -> Vec<u8> {
    if start.is_null() || length == 0 {
        return Vec::new();
    }
    // SAFETY: the range is a block of the heap, and all of it is initialised.
    unsafe { std::slice::from_raw_parts(start, length) }.to_vec()
}

/// Checks that `status` is a status or an exception code of a device, and returns it.
pub fn is_status(name: &str, status: u8) -> u8 {
    assert!(
        status < 0x80 || (224..=LAST).contains(&status),
        "{name} returned {status}, which is not a status"
    );
    status
}

/// Checks that a length returned by a call is at most `most`, and returns it.
pub fn is_length(name: &str, length: *const u16, most: usize) -> usize {
    // SAFETY: the call has succeeded, so the pointer is not NULL.
    let length = usize::from(unsafe { length.read() });
    assert!(length <= most, "{name} gave the length {length} of {most}");
    length
}
