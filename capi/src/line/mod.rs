//! `mbm_line_*`: a serial line, which any number of nodes use.

pub(crate) mod object;
mod settings;

pub use object::*;
pub use settings::*;

use crate::pointers::{self, c_object, CObject};
use crate::port::{mbm_port, PortRef};
use crate::storage::LineStorage;
use core::ptr::null_mut;
use mbm::error::Status;
use mbm::master::request::Line;

/// The fields in the storage of an `mbm_line`.
#[repr(C)]
struct Object {
    mark: u8,
    core: Core,
}

pub(crate) type Core = Line<PortRef, LineStorage>;

c_object! { mbm_line, &mut Core, core }

/// Whether the port and the buffers of the line may be changed: [`Status::OK`];
/// [`Status::BUSY`] while a request is pending; [`Status::INVALID_ARGUMENT`] for NULL. Makes
/// zeroed storage a line with default settings, without port and frame buffer.
pub(crate) unsafe fn prepare(line: *mut mbm_line) -> Status {
    // Storage that was not begun is zeroed, and zero is a valid value of every field.
    match pointers::check_once(line) {
        Status::NOT_INITIALISED => {
            pointers::zero_on_host(line);
            mbm_line::mark(line).write(pointers::BEGUN);
            Status::OK
        }
        Status::OK if pointers::object(line).is_pending() => Status::BUSY,
        other => other,
    }
}

/// Runs `action`, which may call hooks, on the core of a line.
pub(crate) unsafe fn with_hooks<T>(line: *mut mbm_line, action: impl FnOnce(&mut Core) -> T) -> T {
    // SAFETY: begun, so every field is valid; exclusive, because the mark keeps every other
    // function from making a reference.
    unsafe { pointers::with_hooks(line, || action(mbm_line::access(line))) }
}

/// The core of a line. It does not include the mark, which is read while the core is in use.
///
/// # Safety
/// `line` points to storage of a line, zeroed or begun.
pub(crate) unsafe fn core_of(line: *mut mbm_line) -> *mut Core {
    &raw mut (*line.cast::<Object>()).core
}

/// Begins a line with RTU frames on a port.
///
/// It may be called again, for another port or frame buffer, whenever no request is pending;
/// this is cheap. Settings stay. It does not open the port: that must be open already. The first
/// request waits for no gap, unless bytes arrive or mbm_line_used was called.
///
/// @param port        the port. It is not copied: it must stay valid and unchanged for as long as
///                    the object is used. read, write and micros must not be NULL
/// @param frame       as for mbm_line_setFrame; also NULL, if you call that function later
/// @param frameBytes  as for mbm_line_setFrame; 0 if `frame` is NULL
/// @return a status; MBM_BUSY while a request is pending
#[no_mangle]
pub unsafe extern "C" fn mbm_line_beginRtu(
    line: *mut mbm_line,
    port: *const mbm_port,
    frame: *mut u8,
    frameBytes: u16,
) -> u8 {
    let is_refused = port.is_null()
        || !(*port).is_complete()
        || frameBytes > 0 && is_frame_refused(frame, frameBytes);
    if is_refused {
        return Status::INVALID_ARGUMENT.code();
    }
    let status = prepare(line);
    if status == Status::OK {
        let core = pointers::object(line);
        core.port.set(port);
        core.storage.set_frame(frame, frameBytes);
    }
    status.code()
}

/// True for a frame buffer that cannot hold an exception or a request of two words.
fn is_frame_refused(frame: *const u8, bytes: u16) -> bool {
    frame.is_null() || bytes < 8
}

/// Sets the buffer of one frame. The line uses it only while a request is pending. So in
/// blocking mode it may lie on the stack of a function that sets it and makes the request.
///
/// A frame buffer of MBM_FRAME_BYTES(words) bytes suffices for every request and reply with
/// that number of words. MBM_FRAME_BYTES(2 * words) bytes also hold a late reply beside the
/// right one. If a request or a reply does not fit, the function that makes the request returns
/// a status. Data are never cut off.
///
/// @param frame       the buffer. Its content is not used between requests
/// @param frameBytes  bytes of `frame`, at least 8; 256 hold any frame
/// @return a status; MBM_BUSY while a request is pending
#[no_mangle]
pub unsafe extern "C" fn mbm_line_setFrame(
    line: *mut mbm_line,
    frame: *mut u8,
    frameBytes: u16,
) -> u8 {
    if is_frame_refused(frame, frameBytes) {
        return Status::INVALID_ARGUMENT.code();
    }
    let status = prepare(line);
    if status == Status::OK {
        pointers::object(line).storage.set_frame(frame, frameBytes);
    }
    status.code()
}

/// Gives up the pending request, whichever node has made it, and switches the driver off. The
/// status of that node becomes MBM_CANCELLED when you poll it. Call it if the node is lost.
/// If no request is pending, it does nothing.
#[no_mangle]
pub unsafe extern "C" fn mbm_line_cancel(line: *mut mbm_line) -> u8 {
    let status = pointers::check(line);
    if status == Status::OK && pointers::object(line).is_pending() {
        with_hooks(line, |core| {
            core.cancel();
            core.storage.words = null_mut();
        });
    }
    status.code()
}
