//! What holds of every call, whatever its arguments.

use super::world::World;

pub const OK: u8 = 0;
pub const PENDING: u8 = 235;
/// The greatest status there is.
const LAST: u8 = 242;

/// Calls a function of the C API with an object that is in use meanwhile.
macro_rules! call {
    ($w:expr, $object:expr, $name:ident($($argument:expr),* $(,)?)) => {{
        let w: &$crate::api::world::World = $w;
        w.note(|| {
            let arguments: Vec<String> = vec![$(format!("{:?}", $argument)),*];
            format!("{}({})", stringify!($name), arguments.join(", "))
        });
        w.before($object);
        // SAFETY: every pointer is NULL or valid for what the header says.
        #[allow(unused_unsafe)]
        let returned = unsafe { mbm_c::$name($($argument),*) };
        w.after();
        w.note(|| format!("-> {returned:?}"));
        returned
    }};
}
pub(super) use call;

/// A stretch of memory: where it begins, and its bytes.
pub type Span = (*const u8, usize);

/// The thing that a pointer points to.
pub fn span<T>(thing: *const T) -> Span {
    (thing.cast(), size_of::<T>())
}

/// Makes a call that returns a status. From within a hook of the object, it is
/// refused.
pub fn ends(w: &World, (object, _): Span, name: &str, call: impl FnOnce() -> u8) -> u8 {
    let locked = w.is_locked(object);
    let status = is_status(name, call());
    assert!(
        !locked || (status != OK && status != PENDING),
        "{name} returned {status} from within a hook"
    );
    status
}

/// As `ends`. If the call is refused, the spans are as before, unless a hook called
/// the API meanwhile. The first is the object.
pub fn refused_changes_nothing(
    w: &World,
    spans: &[Span],
    name: &str,
    call: impl FnOnce() -> u8,
) -> u8 {
    let before: Vec<Vec<u8>> = spans.iter().map(|span| bytes(*span)).collect();
    let inner = w.inner_calls.get();
    let status = ends(w, spans[0], name, call);
    // A call from within a hook is itself one of those.
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

/// What stands there; nothing behind NULL.
pub fn bytes((start, length): Span) -> Vec<u8> {
    if start.is_null() || length == 0 {
        return Vec::new();
    }
    // SAFETY: the caller's block, all of which is initialised.
    unsafe { std::slice::from_raw_parts(start, length) }.to_vec()
}

/// A status, or an exception code of a device.
pub fn is_status(name: &str, status: u8) -> u8 {
    assert!(
        status < 0x80 || (224..=LAST).contains(&status),
        "{name} returned {status}, which is no status"
    );
    status
}

/// A length that a call gave is one that fits.
pub fn is_length(name: &str, length: *const u16, most: usize) -> usize {
    // SAFETY: not NULL where the call succeeded.
    let length = usize::from(unsafe { length.read() });
    assert!(length <= most, "{name} gave the length {length} of {most}");
    length
}
