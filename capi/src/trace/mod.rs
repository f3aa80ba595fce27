//! `mbm_trace_*`: a port that passes everything on, and hands out each frame.

mod record;

pub use record::{mbm_traceRecord, mbm_trace_ofEvent, MBM_TRACE_RECEIVED, MBM_TRACE_SENT};

use crate::framing::{is_delimiter, mbm_framing};
use crate::functions::declared;
use crate::node::mbm_node;
use crate::packet::side;
use crate::pointers::{c_object, change, check, object, with_hooks, CObject, In, BEGUN, IN_HOOK};
use crate::port::{countable, mbm_port, passing_hooks, PortRef};
use core::ffi::c_void;
use core::ptr::null;
use core::slice::{from_raw_parts, from_raw_parts_mut};
use mbm::error::{Error, Status};
use mbm::frame::Framing;
use mbm::port::Port;
use mbm::time::millis;
use mbm::trace::{Trace, MIN_BUFFER};
use record::{CObserver, TraceHook};

/// The smallest buffer of a trace, in bytes.
pub const MBM_MIN_TRACE_BUFFER: u16 = 32;

const _: () = assert!(MBM_MIN_TRACE_BUFFER as usize == MIN_BUFFER);

/// A trace: stands between a port and the line, client or server that uses it, passes
/// everything on, and calls your hook for each frame that is sent or received.
///
/// You provide the storage. Initialise it with MBM_INIT. Call mbm_trace_begin, then begin the
/// line, client or server with mbm_trace_port instead of your port. The object must not move
/// while its port is in use. A program that begins no trace contains no part of it. Not
/// re-entrant: use it from the thread of the object that uses its port.
#[repr(C)]
pub struct mbm_trace {
    /// Private.
    pointers: [*mut c_void; 26],
    /// Private.
    words: [u32; 9],
}

/// The real content of an `mbm_trace`.
#[repr(C)]
struct Object {
    mark: u8,
    /// The port that the traced object uses.
    outer: mbm_port,
    /// The port under the trace. It is not in the core, because the hooks that only pass a call
    /// on read it also while a reference to the core lives.
    inner: mbm_port,
    core: Core,
}

type Core = Trace<PortRef, CBuffer, CObserver>;

/// The caller's buffer.
pub struct CBuffer {
    bytes: *mut u8,
    size: u16,
}

impl AsMut<[u8]> for CBuffer {
    fn as_mut(&mut self) -> &mut [u8] {
        // SAFETY: the begin functions demand that the buffer is valid and used by nothing else.
        unsafe { from_raw_parts_mut(self.bytes, self.size.into()) }
    }
}

c_object! { mbm_trace, *mut Core, core }

/// Runs `action` on the core of a trace, or returns the status that says why not. `action` may
/// call hooks.
unsafe fn with_core<T>(
    trace: *mut mbm_trace,
    action: impl FnOnce(&mut Core) -> T,
) -> Result<T, Error> {
    // Nothing else makes a reference to the core of a marked object.
    match check(trace).result() {
        Ok(()) => {
            let core = object(trace);
            Ok(with_hooks(trace, || action(&mut *core)))
        }
        Err(refused) => Err(refused),
    }
}

/// The port under a trace.
///
/// # Safety
/// `context` points to a trace that was begun.
unsafe fn inner(context: *mut c_void) -> *const mbm_port {
    &raw const (*context.cast::<Object>()).inner
}

// SAFETY, here and below: only a port of a trace has these hooks, and their context is the
// trace. A trace that is not begun, because it was zeroed, has lost its link. The port of a
// trace whose own hook runs has no bytes and accepts none.

unsafe extern "C" fn read(context: *mut c_void, bytes: *mut u8, capacity: u16) -> i16 {
    // SAFETY: see above; the arguments are those of a port.
    let result = unsafe {
        with_core(context.cast(), |core| {
            core.read_count(from_raw_parts_mut(bytes, countable(capacity).into()))
        })
    };
    result.unwrap_or_else(unusable)
}

unsafe extern "C" fn write(context: *mut c_void, bytes: *const u8, length: u16) -> i16 {
    // SAFETY: see above; the arguments are those of a port.
    let result = unsafe {
        with_core(context.cast(), |core| {
            core.write_count(from_raw_parts(bytes, countable(length).into()))
        })
    };
    result.unwrap_or_else(unusable)
}

/// The return value of a trace's port while the port must not be used.
fn unusable(error: Error) -> i16 {
    if error == Error::Busy {
        0
    } else {
        -1
    }
}

passing_hooks!(inner);

unsafe extern "C" fn post_transmission(context: *mut c_void) {
    // SAFETY: see above.
    let _ = unsafe { with_core(context.cast(), Core::post_transmission) };
}

/// Begins a trace; see [`mbm_trace_begin`].
#[allow(clippy::too_many_arguments)]
unsafe fn begin(
    trace: *mut mbm_trace,
    sends: u8,
    port: In<mbm_port>,
    framing: In<mbm_framing>,
    buffer: *mut u8,
    size: u16,
    hook: TraceHook,
    context: *mut c_void,
) -> Result<(), Error> {
    let (described, kind) = described(framing)?;
    let sends = side(sends)?;
    let port = port.get()?;
    // A trace that passes its own bytes on to itself would never end.
    let is_own = port.context == trace.cast();
    if !port.is_complete() || trace.is_null() || buffer.is_null() || hook.is_none() || is_own {
        return Err(Error::InvalidArgument);
    }
    if size < MBM_MIN_TRACE_BUFFER {
        return Err(Error::BufferTooSmall);
    }
    if mbm_trace::mark(trace).read() == IN_HOOK {
        return Err(Error::Busy);
    }
    let observer = CObserver {
        hook,
        context,
        functions: described.functions,
        function_count: described.functionCount,
    };
    let buffer = CBuffer {
        bytes: buffer,
        size,
    };
    let object = trace.cast::<Object>();
    let passed_on = PortRef::new(&raw const (*object).inner);
    object.write(Object {
        mark: BEGUN,
        outer: mbm_port {
            context: trace.cast(),
            read: Some(read),
            write: Some(write),
            micros: Some(micros),
            flush: port.flush.map(|_| flush as _),
            preTransmission: port.preTransmission.map(|_| pre_transmission as _),
            // It ends a sent frame.
            postTransmission: Some(post_transmission),
            idle: port.idle.map(|_| idle as _),
        },
        inner: port,
        core: Trace::new(passed_on, kind, sends, described.end(), buffer, observer),
    });
    Ok(())
}

/// The description of frames, if it is valid.
unsafe fn described<'a>(framing: In<mbm_framing>) -> Result<(&'a mbm_framing, Framing), Error> {
    let described = framing.value().ok_or(Error::InvalidArgument)?;
    declared(described.functions()?, None)?;
    if !is_delimiter(described.end()) {
        return Err(Error::InvalidArgument);
    }
    Ok((described, described.of_frames()?))
}

/// The code of a result.
fn code(result: Result<(), Error>) -> u8 {
    Status::from(result).code()
}

/// Begins the trace of a line, client or server. Then begin that line, client or server with
/// mbm_trace_port.
///
/// The hook is called from within the functions of the node, client or server, when the last
/// byte of a frame was sent or read. Bytes of an incomplete frame are handed out at the first
/// read after the frame timeout (see mbm_trace_setFrameTimeout), on a serial line when the next
/// frame is sent, when the link is lost, or by mbm_trace_flush. `record` and its bytes are
/// valid until the hook returns. The hook must not use this trace or the object that uses its
/// port: such a call returns MBM_BUSY and changes nothing. On a serial line it should not take
/// longer than a character.
///
/// You may call this function again at any time, but not from within the hook. The trace then
/// drops the bytes that it has not handed out, and its frame timeout is the default.
///
/// @param sends    the frames that the object on the port sends: MBM_PACKET_REQUEST for a line or
///                 client, MBM_PACKET_RESPONSE for a server
/// @param port     is copied; its hooks read, write and micros are required. Its optional hooks
///                 are passed on. It must not be the port of this trace or of a trace that
///                 passes everything on to this one
/// @param framing  the framing of the object that will use the port, and the declarations of your
///                 own functions, which must stay valid and unchanged. Without a declaration, the
///                 end of a received RTU frame is not known from its bytes
/// @param buffer   holds incomplete frames: one half of it those that are sent, the other those
///                 that are received. It must stay valid for as long as the trace is used
/// @param size     size of `buffer` in bytes, at least MBM_MIN_TRACE_BUFFER. Two times
///                 MBM_MAX_FRAME, MBM_MAX_ASCII_FRAME or MBM_MAX_TCP_FRAME holds every frame; a
///                 longer one is handed out in pieces
/// @param hook     is called for each frame
/// @param context  your pointer, passed to `hook`: for example the link or its name
/// @return a status; MBM_BUFFER_TOO_SMALL for a size that is too small; MBM_INVALID_ARGUMENT for a
///         framing or `sends` that is not valid
#[no_mangle]
pub unsafe extern "C" fn mbm_trace_begin(
    trace: *mut mbm_trace,
    sends: u8,
    port: In<mbm_port>,
    framing: In<mbm_framing>,
    buffer: *mut u8,
    size: u16,
    hook: Option<unsafe extern "C" fn(context: *mut c_void, record: *const mbm_traceRecord)>,
    context: *mut c_void,
) -> u8 {
    code(begin(
        trace, sends, port, framing, buffer, size, hook, context,
    ))
}

/// Returns the port that passes everything on to the port of the trace. Pass it to the begin
/// function of a node, client or server.
///
/// @return the port, which is valid for as long as the trace is used. NULL for a trace that was
///         never begun, and from within its hook: the begin functions refuse it
#[no_mangle]
pub unsafe extern "C" fn mbm_trace_port(trace: *mut mbm_trace) -> *const mbm_port {
    match check(trace) {
        Status::OK => &raw const (*trace.cast::<Object>()).outer,
        _ => null(),
    }
}

/// Sets how long the trace waits for the rest of an incomplete frame. At first it is 200 ms in
/// RTU, which suits a USB adapter and a UART with a FIFO, and 1000 ms in the other framings.
///
/// @param timeoutMs  1 to 65535 ms
#[no_mangle]
pub unsafe extern "C" fn mbm_trace_setFrameTimeout(trace: *mut mbm_trace, timeoutMs: u32) -> u8 {
    let timeout = match u16::try_from(timeoutMs) {
        Ok(timeout) if timeout > 0 => millis(timeout),
        _ => return Status::INVALID_ARGUMENT.code(),
    };
    change(trace, |core| (*core).set_frame_timeout(timeout))
}

/// Calls the hook for the bytes that wait for the rest of their frame: before the program
/// ends, or before a link is closed.
///
/// On a Cortex-M it takes 850 bytes of stack, as every traced frame does.
#[no_mangle]
pub unsafe extern "C" fn mbm_trace_flush(trace: *mut mbm_trace) -> u8 {
    code(with_core(trace, Core::hand_out_rest))
}
