//! Texts for statuses, and a check of texts for frames and events.

use super::check::is_status;
use super::world::World;

/// Checks that a text written by a call has a NUL within its size, or that the call has written
/// nothing.
pub fn check_text(w: &World, name: &str, status: u8, text: *const u8, size: u16) {
    is_status(name, status);
    if text.is_null() || size == 0 {
        return;
    }
    let written = super::check::bytes((text, size.into()));
    let ended = written.contains(&0) || written.iter().all(|byte| *byte == 0xA5);
    assert!(
        ended,
        "{name} returned {status} and left a text without NUL"
    );
    w.note(|| {
        format!(
            "   {}",
            String::from_utf8_lossy(written.split(|b| *b == 0).next().unwrap_or(&[]))
        )
    });
}

/// Reads the text of a status.
pub fn step(w: &World) {
    let status = w.byte();
    let text = call!(w, std::ptr::null::<u8>(), mbm_status_text(status));
    assert!(!text.is_null());
    // SAFETY: a constant string.
    let text = unsafe { std::ffi::CStr::from_ptr(text.cast()) };
    assert!(!text.is_empty() && text.to_bytes().is_ascii());
    let code = w.byte();
    let text = call!(w, std::ptr::null::<u8>(), mbm_status_textOf(status, code));
    assert!(!text.is_null());
    let version = call!(w, std::ptr::null::<u8>(), mbm_version());
    assert!(!version.is_null());
}
