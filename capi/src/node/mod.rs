//! `mbm_node_*`: a device on a line, for C.

mod callbacks;
pub(crate) mod object;
mod requests;
mod settings;
mod words;

pub use callbacks::*;
pub use object::*;
pub use requests::*;
pub use settings::*;
pub use words::*;

use super::line::{self, mbm_line};
use super::pointers::{self, c_object, CObject};
use super::port::PortRef;
use super::storage::{LineStorage, NodeWords};
use mbm::engine::Extension;
use mbm::error::Status;
use mbm::master::node::Node;
use mbm::master::request::MasterRequest;
use mbm::port::Port;

/// The fields in the storage of an `mbm_node`.
#[repr(C)]
pub(super) struct Object {
    mark: u8,
    core: Node,
    line: *mut mbm_line,
    words: NodeWords,
    /// The engine's extension: a function if deviating replies are accepted.
    lenient: Option<Extension<PortRef, LineStorage, MasterRequest>>,
}

// The reference includes the mark, which no function changes while the object is used: the mark
// of the line refuses the calls that a hook must not make.
c_object! { mbm_node, &mut Object }

/// Begins a node: a unit on a line, with your words for its requests and replies.
///
/// It may be called again, for another unit, line or words, whenever the node has no pending
/// request; this is cheap. Settings and the content of the words stay. The node discards what
/// mbm_node_send queued. The line may be begun before or afterwards.
///
/// The words must not overlap, and must stay valid for as long as the object is used. Any number
/// of nodes may share words. Keep a node until its request has ended.
///
/// @param line           the line, which must stay valid for as long as the object is used
/// @param unit           the unit identifier, 1 to 247; 0 is broadcast (serial line guide V1.02,
///                       2.2). Requests to 248 to 255, which the standard reserves, are sent too
/// @param response       the words that reads fill; NULL only if `responseWords` is 0
/// @param responseWords  0 to 255; 125 hold any reply
/// @param transmit       the words that writes send; NULL only if `transmitWords` is 0
/// @param transmitWords  0 to 255; 123 hold any request
/// @return a status; MBM_BUSY while a request of the node is pending
#[no_mangle]
pub unsafe extern "C" fn mbm_node_begin(
    node: *mut mbm_node,
    line: *mut mbm_line,
    unit: u8,
    response: *mut u16,
    responseWords: u16,
    transmit: *mut u16,
    transmitWords: u16,
) -> u8 {
    let is_refused = node.is_null()
        || line.is_null()
        || (response.is_null() && responseWords > 0)
        || (transmit.is_null() && transmitWords > 0)
        || (responseWords | transmitWords) > 255;
    // Not NULL.
    if is_refused {
        return Status::INVALID_ARGUMENT.code();
    }
    if pointers::check_once(node) != Status::OK {
        pointers::zero_on_host(node);
        mbm_node::mark(node).write(pointers::BEGUN);
    }
    if (*node.cast::<Object>()).core.is_pending() {
        return Status::BUSY.code();
    }
    let object = pointers::object(node);
    object.core.begin(unit);
    object.line = line;
    object.words.response_words = responseWords as u8;
    object.words.transmit_words = transmitWords as u8;
    object.words.response = response;
    object.words.transmit = transmit;
    Status::OK.code()
}

/// Whether a hook of the line's port makes the call: [`Status::BUSY`], otherwise [`Status::OK`];
/// [`Status::NOT_INITIALISED`] if the line was zeroed.
unsafe fn check_line(object: *mut Object) -> Status {
    pointers::check_mark((*object).line)
}

/// True if the pending request of the line is that of the node.
///
/// # Safety
/// [`check_line`] returned [`Status::OK`] for the node.
unsafe fn has_line(object: *const Object) -> bool {
    // The line was begun and has no reference.
    pointers::object((*object).line).storage.words.cast_const() == &raw const (*object).words
}

/// Sends and receives for a non-blocking request, without waiting.
///
/// Call it as often as you like. If your port does not buffer received bytes, call it at
/// least once in the time of a character.
///
/// @return MBM_PENDING until the request has ended. Then, at every call, the status of the request.
///         MBM_OK if there was no request yet
#[no_mangle]
pub unsafe extern "C" fn mbm_node_poll(node: *mut mbm_node) -> u8 {
    poll(node)
}

/// As [`mbm_node_poll`].
unsafe extern "C" fn poll(node: *mut mbm_node) -> u8 {
    // No reference to the node lives while hooks run; the line's mark keeps them from the line.
    match pointers::check(node) {
        Status::OK => {}
        refused => return refused.code(),
    }
    let object = node.cast::<Object>();
    let core = &raw mut (*object).core;
    if (*core).is_pending() {
        match check_line(object) {
            Status::OK => {}
            refused => return refused.code(),
        }
        if has_line(object) {
            let line = (*object).line;
            let status = line::with_hooks(line, |line| {
                let now = line.port.micros();
                line.poll(now)
            });
            let _ = (*core).take(status, pointers::object(line));
        } else {
            // The line has given the request up.
            (*core).end(Status::CANCELLED);
        }
    }
    (*core).status().code()
}

/// Returns how long mbm_node_poll will have nothing to do unless a byte arrives. A program
/// or the hook `idle` may sleep for that time. A waiting time that has just started counts
/// from this call, so sleeping makes no timeout longer. Do not sleep longer: while a frame leaves,
/// the driver would go off late.
///
/// @return microseconds; 0 means poll now, also from within a hook of the port except `idle`;
///         0xFFFFFFFF means that the node has no pending request
#[no_mangle]
pub unsafe extern "C" fn mbm_node_pollDelay(node: *mut mbm_node) -> u32 {
    let object = node.cast::<Object>();
    if pointers::check(node) != Status::OK || !(*object).core.is_pending() {
        return u32::MAX;
    }
    match check_line(object) {
        Status::OK if has_line(object) => line::with_hooks((*object).line, |line| {
            let now = line.port.micros();
            line.poll_delay(now)
        }),
        _ => 0,
    }
}

/// Gives up the pending request and switches the driver off. The status of the request
/// becomes MBM_CANCELLED. If the node has no pending request, it does nothing. If the request
/// was sent, its reply may still come, so the next request to that unit is sent later: see
/// mbm_line_setQuietTime.
#[no_mangle]
pub unsafe extern "C" fn mbm_node_cancel(node: *mut mbm_node) -> u8 {
    // No reference to the node lives while hooks run.
    let mut status = pointers::check(node);
    let object = node.cast::<Object>();
    if status == Status::OK && (*object).core.is_pending() {
        status = check_line(object);
        if status == Status::OK {
            if has_line(object) {
                line::with_hooks((*object).line, line::Core::cancel);
            }
            (*object).core.end(Status::CANCELLED);
        }
    }
    status.code()
}

/// Returns the status of the last request.
///
/// @return the status: MBM_PENDING while the request is pending, MBM_OK if there was no request
#[no_mangle]
pub unsafe extern "C" fn mbm_node_status(node: *const mbm_node) -> u8 {
    // Every object is writable storage.
    pointers::with(node.cast_mut(), |node| match check_line(node) {
        Status::BUSY if node.core.is_pending() => Status::BUSY,
        _ => node.core.status(),
    })
}

/// Returns the exception code of the last reply as received, also a code that the standard
/// does not allow (V1.1b3, 7).
///
/// @return the code; 0 if the last request ended without an exception
#[no_mangle]
pub unsafe extern "C" fn mbm_node_getExceptionCode(node: *const mbm_node) -> u8 {
    pointers::read(node, 0, |node| node.core.exception_code())
}

/// Starts a request that has an address and a word and, in blocking mode, polls until it has
/// ended.
unsafe fn call(pointer: *mut mbm_node, address: u16, word: u16, function: u8) -> u8 {
    request(pointer, |node, line| {
        node.request(line, address, word, function)
    })
}

/// Starts a request and, in blocking mode, polls until it has ended.
unsafe fn request(
    pointer: *mut mbm_node,
    start: impl FnOnce(&mut Node, &mut line::Core) -> Status,
) -> u8 {
    // The line reads the node's words, which are not in its core.
    let mut status = take_line(pointer);
    if status == Status::OK {
        let object = pointer.cast::<Object>();
        status = start(&mut (*object).core, pointers::object((*object).line));
    }
    finish(pointer, status.code())
}

/// Gives the line the words and the timeout of the node, if the node may make a request:
/// [`Status::OK`]; otherwise the reason.
unsafe fn take_line(node: *mut mbm_node) -> Status {
    let mut status = pointers::check(node);
    let object = node.cast::<Object>();
    if status == Status::OK {
        status = check_line(object);
    }
    if status == Status::OK {
        let line = pointers::object((*object).line);
        if line.waits_for_unit()
            && !(*object).core.is_pending()
            && (*line.storage.words).is_non_blocking
        {
            // The request of another node gives way. It was not sent.
            line.cancel();
        }
        status = line.ready();
        if status != Status::BUSY {
            (*object).core.end(status);
        }
        if status == Status::OK {
            line.storage.words = &raw mut (*object).words;
            line.set_lenience((*object).lenient);
        }
    }
    status
}

/// In blocking mode, polls until the request has ended, and calls the hook `idle` whenever
/// there is nothing to do.
///
/// # Safety
/// `status` is the one that the last call on that node returned.
unsafe fn finish(pointer: *mut mbm_node, mut status: u8) -> u8 {
    if status != Status::PENDING.code() {
        return status;
    }
    // SAFETY: pending, so begun. No reference lives while the hook is called, because the
    // hook may use the object. `poll` checks the object again.
    unsafe {
        let object = pointer.cast::<Object>();
        loop {
            if (*object).words.is_non_blocking {
                break;
            }
            status = poll(pointer);
            if status != Status::PENDING.code() {
                break;
            }
            let line = line::core_of((*object).line);
            if (*line).is_waiting() {
                PortRef::idle(&raw const (*line).port, pointer);
            }
        }
    }
    status
}
