//! ModbusMaster's callbacks `idle`, `preTransmission` and `postTransmission`: a port before a port,
//! because a line keeps no more than a pointer to a constant port.

use super::{check_line, mbm_node, Object as NodeObject};
use crate::line;
use crate::pointers::{self, c_object, check, CObject};
use crate::port::{mbm_port, passing_hooks};
use core::ffi::c_void;
use core::ptr::{fn_addr_eq, null};
use mbm::error::Status;

/// A callback without an argument, as those of ModbusMaster.
type Callback = Option<unsafe extern "C" fn()>;

/// The callbacks of a line, for mbm_node_idle, mbm_node_preTransmission and
/// mbm_node_postTransmission. A program that sets the members of its mbm_port needs no such object.
///
/// You provide the storage. Initialise it with MBM_INIT. Call mbm_nodeCallbacks_begin, then begin
/// the line with mbm_nodeCallbacks_port instead of your port. The object must not move while its
/// port is in use.
#[repr(C)]
pub struct mbm_nodeCallbacks {
    /// Private.
    pointers: [*mut c_void; 13],
}

/// The fields in the storage of an `mbm_nodeCallbacks`.
#[repr(C)]
pub(crate) struct Object {
    mark: u8,
    /// The port that is called.
    inner: *const mbm_port,
    idle: Callback,
    before: Callback,
    after: Callback,
    /// The port that the line uses.
    outer: mbm_port,
}

c_object! { mbm_nodeCallbacks, *mut Object }

/// The port behind the callbacks.
///
/// # Safety
/// `context` points to callbacks that were begun.
unsafe fn inner(context: *mut c_void) -> *const mbm_port {
    (*context.cast::<Object>()).inner
}

passing_hooks!(inner);

// SAFETY, here and below: only the port of callbacks that were begun has these hooks, and their
// context is the callbacks. The port behind them is complete. No reference lives while a hook runs.

unsafe extern "C" fn read(context: *mut c_void, bytes: *mut u8, capacity: u16) -> i16 {
    let port = inner(context);
    (*port)
        .read
        .map_or(-1, |read| read((*port).context, bytes, capacity))
}

unsafe extern "C" fn write(context: *mut c_void, bytes: *const u8, length: u16) -> i16 {
    let port = inner(context);
    (*port)
        .write
        .map_or(-1, |write| write((*port).context, bytes, length))
}

unsafe extern "C" fn before(context: *mut c_void) {
    pre_transmission(context);
    if let Some(callback) = (*context.cast::<Object>()).before {
        callback();
    }
}

unsafe extern "C" fn after(context: *mut c_void) {
    if let Some(callback) = (*context.cast::<Object>()).after {
        callback();
    }
    let port = inner(context);
    if let Some(hook) = (*port).postTransmission {
        hook((*port).context);
    }
}

/// Calls the callback while a reply is awaited, as ModbusMaster does; otherwise the port's own hook.
unsafe extern "C" fn waiting(context: *mut c_void, node: *mut mbm_node) {
    // The line calls it without a reference to itself or to its node.
    let line = (*node.cast::<NodeObject>()).line;
    match (*context.cast::<Object>()).idle {
        Some(callback) if (*line::core_of(line)).is_sent() => callback(),
        _ => idle(context, node),
    }
}

/// Puts callbacks before a port. At first there are none.
///
/// It may be called again, for another port, whenever no request is pending. The callbacks stay.
///
/// @param port  the port. It is not copied: it must stay valid and unchanged for as long as the
///              object is used. It must not be the port of these callbacks. Its hooks read, write
///              and micros are required
#[no_mangle]
pub unsafe extern "C" fn mbm_nodeCallbacks_begin(
    callbacks: *mut mbm_nodeCallbacks,
    port: *const mbm_port,
) -> u8 {
    let is_refused = callbacks.is_null()
        || port.is_null()
        || !(*port).is_complete()
        || (*port).context == callbacks.cast();
    if is_refused {
        return Status::INVALID_ARGUMENT.code();
    }
    if check(callbacks) != Status::OK {
        pointers::zero_on_host(callbacks);
        mbm_nodeCallbacks::mark(callbacks).write(pointers::BEGUN);
    }
    let object = pointers::object(callbacks);
    (*object).inner = port;
    (*object).outer.copy(&mbm_port {
        context: callbacks.cast(),
        read: Some(read),
        write: Some(write),
        micros: Some(micros),
        flush: (*port).flush.map(|_| flush as _),
        preTransmission: Some(before),
        postTransmission: Some(after),
        idle: Some(waiting),
    });
    Status::OK.code()
}

/// Returns the port that calls the callbacks and passes everything on to the port behind them. Pass
/// it to mbm_line_beginRtu.
///
/// @return the port, which is valid for as long as the object is used; NULL if it was never begun:
///         mbm_line_beginRtu refuses that
#[no_mangle]
pub unsafe extern "C" fn mbm_nodeCallbacks_port(
    callbacks: *const mbm_nodeCallbacks,
) -> *const mbm_port {
    match check(callbacks) {
        Status::OK => &raw const (*pointers::object(callbacks)).outer,
        _ => null(),
    }
}

/// Runs `set` on the callbacks of a node's line.
///
/// # Safety
/// As for [`pointers::with`].
unsafe fn set(node: *mut mbm_node, set: impl FnOnce(*mut Object)) -> u8 {
    let mut status = check(node);
    let object = node.cast::<NodeObject>();
    if status == Status::OK {
        status = check_line(object);
    }
    if status == Status::OK {
        // No hook runs, so the line has no reference.
        let port = (*line::core_of((*object).line)).port.get();
        status = match find(port) {
            Some(callbacks) => {
                set(callbacks);
                Status::OK
            }
            None => Status::NOT_INITIALISED,
        };
    }
    status.code()
}

/// The callbacks whose port this is.
///
/// # Safety
/// `port` is NULL or points to a port.
unsafe fn find(port: *const mbm_port) -> Option<*mut Object> {
    let port = port.as_ref()?;
    let object = port.context.cast::<Object>();
    // Only the port of callbacks has this hook, unless the linker merged it with an equal one.
    let hook = port.idle?;
    let expected: unsafe extern "C" fn(*mut c_void, *mut mbm_node) = waiting;
    let is_found = fn_addr_eq(hook, expected) && core::ptr::eq(port, &raw const (*object).outer);
    is_found.then_some(object)
}

/// Sets the callback that a blocking function calls again and again while it waits for a reply, or
/// for the turnaround delay of a broadcast. It takes the place of the port's hook `idle`
/// meanwhile. It may call every function, but one that starts a request returns MBM_BUSY.
///
/// The callbacks are those of the line: all its nodes share them. To get an argument in a callback,
/// set the members of your mbm_port instead.
///
/// @param callback  the callback; NULL for none
/// @return a status; MBM_NOT_INITIALISED also if the line was not begun with
///         mbm_nodeCallbacks_port
#[no_mangle]
pub unsafe extern "C" fn mbm_node_idle(
    node: *mut mbm_node,
    callback: Option<unsafe extern "C" fn()>,
) -> u8 {
    set(node, |callbacks| (*callbacks).idle = callback)
}

/// Sets the callback that is called before the first byte of a frame is sent, for example to switch
/// an RS-485 driver on. It is called after the port's own hook. See mbm_node_idle.
///
/// @param callback  the callback, which obeys the rules of mbm_port; NULL for none
/// @return a status; see mbm_node_idle
#[no_mangle]
pub unsafe extern "C" fn mbm_node_preTransmission(
    node: *mut mbm_node,
    callback: Option<unsafe extern "C" fn()>,
) -> u8 {
    set(node, |callbacks| (*callbacks).before = callback)
}

/// Sets the callback that is called after the last bit of a frame was sent, for example to switch
/// an RS-485 driver off. It is called before the port's own hook. See mbm_node_idle.
///
/// @param callback  the callback, which obeys the rules of mbm_port; NULL for none
/// @return a status; see mbm_node_idle
#[no_mangle]
pub unsafe extern "C" fn mbm_node_postTransmission(
    node: *mut mbm_node,
    callback: Option<unsafe extern "C" fn()>,
) -> u8 {
    set(node, |callbacks| (*callbacks).after = callback)
}
