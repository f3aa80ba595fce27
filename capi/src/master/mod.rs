//! `mbm_master_*`: the facade for C.

pub(crate) mod object;
mod requests;
mod settings;
mod turn;
mod values;
mod words;

pub use object::*;
pub use requests::*;
pub use settings::*;
pub use turn::*;
pub use values::*;
pub use words::*;

use super::pointers::{self, CObject};
use super::port::{mbm_port, PortRef};
use super::storage::MasterBuffers;
use core::ffi::c_void;
use mbm::error::Status;
use mbm::master::Master;
use mbm::pdu::master_request::MasterSpec;

/// What lies behind an `mbm_master`.
#[repr(C)]
pub(super) struct Object {
    mark: u8,
    non_blocking: bool,
    core: Core,
    /// Of values in the words, as C counts it; last, as it is seldom wanted.
    order: u8,
}

pub(super) type Core = Master<PortRef, MasterBuffers>;

const _: () = {
    let space = size_of::<mbm_master>();
    let used = size_of::<Object>();
    assert!(align_of::<mbm_master>() >= align_of::<Object>());
    assert!(used <= space);
    // Hiding the fields may waste 5 % where RAM is scarce.
    assert!(size_of::<usize>() > 4 || (space - used) * 20 <= space);
};

// SAFETY: the mark is a field of its own.
unsafe impl CObject for mbm_master {
    type Access<'a> = &'a mut Object;

    unsafe fn mark(master: *const mbm_master) -> *mut u8 {
        // SAFETY: as the caller promises; every object is writable storage.
        unsafe { &raw mut (*master.cast::<Object>().cast_mut()).mark }
    }

    unsafe fn access<'a>(master: *mut mbm_master) -> &'a mut Object {
        // SAFETY: begun, so every field is valid; exclusive as the caller promises.
        unsafe { &mut *master.cast() }
    }
}

impl Object {
    /// The core in storage of an object, which leaves the mark out: that is read while
    /// the core is in use.
    ///
    /// # Safety
    /// `master` points to storage of an object, zeroed or begun.
    pub(super) unsafe fn core_of(master: *mut mbm_master) -> *mut Core {
        // SAFETY: as the caller promises.
        unsafe { &raw mut (*master.cast::<Object>()).core }
    }

    /// The facade itself.
    pub(super) fn core(&mut self) -> &mut Core {
        &mut self.core
    }
}

/// As [`pointers::check`], but zeroed storage becomes a master, with
/// defaults and without port and buffers.
///
/// # Safety
/// As for [`pointers::with`].
#[cfg_attr(target_os = "none", inline(never))]
pub(super) unsafe fn prepare(master: *mut mbm_master) -> Status {
    // SAFETY: as the caller promises; what is not begun is zeroed, and zero is
    // a value of every field.
    unsafe {
        match pointers::check(master) {
            Status::NOT_INITIALISED => {
                let object = mbm_master::access(master);
                object.core.set_default_if_zero();
                object.mark = pointers::BEGUN;
                Status::OK
            }
            other => other,
        }
    }
}

/// Runs `action`, which may call hooks, on the core of a master.
///
/// # Safety
/// As for [`pointers::calling`].
#[inline(always)]
pub(super) unsafe fn calling<T>(master: *mut mbm_master, action: impl FnOnce(&mut Core) -> T) -> T {
    // SAFETY: begun, so every field is valid; exclusive, for no other function
    // makes a reference while the mark says so.
    unsafe { pointers::calling(master, || action(&mut *Object::core_of(master))) }
}

/// Begins to talk to a slave over a port.
///
/// May be called again at any time, which is cheap: to talk to another slave,
/// or over another port. Settings, buffers and the words in them stay; what
/// was queued by send is dropped, and a request under way is given up. Opens
/// nothing: the port is open already. The first request waits for no gap, unless
/// bytes arrive or mbm_master_lineUsed was called.
///
/// @param master  the object; zeroed before the first call
/// @param slave   unit id, 1 to 247; 248 to 255 are sent as they are, 0 is
///                broadcast (serial line guide V1.02, 2.2)
/// @param port    not copied: it must stay valid and unchanged for as long as the
///                object is used; read, write and micros must be there
/// @return MBM_OK; MBM_INVALID_ARGUMENT for a NULL pointer or a missing hook; MBM_BUSY
///         from within a hook of this object's port but `idle`
#[no_mangle]
pub unsafe extern "C" fn mbm_master_beginRtu(
    master: *mut mbm_master,
    slave: u8,
    port: *const mbm_port,
) -> u8 {
    if port.is_null() {
        return Status::INVALID_ARGUMENT.code();
    }
    // SAFETY: not NULL, so a port; the rest as the header demands.
    unsafe { mbm_master_beginRtuWith(master, slave, port, (*port).context) }
}

/// As mbm_master_beginRtu, for several objects that share one port, which may be a
/// constant: each object has a context of its own.
///
/// @param master   the object; zeroed before the first call
/// @param slave    as for mbm_master_beginRtu
/// @param port     as for mbm_master_beginRtu; its `context` is not used
/// @param context  handed to every hook. Yours, may be NULL
/// @return as mbm_master_beginRtu
#[no_mangle]
pub unsafe extern "C" fn mbm_master_beginRtuWith(
    master: *mut mbm_master,
    slave: u8,
    port: *const mbm_port,
    context: *mut c_void,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        if port.is_null() || !(*port).is_complete() {
            return Status::INVALID_ARGUMENT.code();
        }
        let status = prepare(master);
        if status == Status::OK {
            calling(master, |core| {
                core.begin(slave, |place| place.set(port, context));
            });
        }
        status.code()
    }
}

/// Lends the buffers that requests and replies need, before or after begin.
///
/// They must not overlap, and stay valid for as long as the object is used.
/// MBM_FRAME_BYTES(words) bytes of frame serve any request and reply of so
/// many words. What does not fit into a smaller buffer is answered with a
/// status, never cut short.
///
/// @param master         the object; zeroed before the first call
/// @param response       words that reads fill; NULL only with 0 words
/// @param responseWords  0 to 255; 125 hold any reply
/// @param transmit       words that writes send; NULL only with 0 words
/// @param transmitWords  0 to 255; 123 hold any request
/// @param frame          bytes of one frame; keeps nothing between requests
/// @param frameBytes     at least 8; 256 hold any frame
/// @return MBM_OK, MBM_INVALID_ARGUMENT, or MBM_BUSY while a request is under way
#[no_mangle]
pub unsafe extern "C" fn mbm_master_setBuffers(
    master: *mut mbm_master,
    response: *mut u16,
    responseWords: u16,
    transmit: *mut u16,
    transmitWords: u16,
    frame: *mut u8,
    frameBytes: u16,
) -> u8 {
    let useless = (response.is_null() && responseWords > 0)
        || (transmit.is_null() && transmitWords > 0)
        || (responseWords | transmitWords) > 255
        || frame.is_null()
        || frameBytes < 8;
    if useless {
        return Status::INVALID_ARGUMENT.code();
    }
    // SAFETY: as the header demands.
    unsafe {
        let status = prepare(master);
        if status != Status::OK {
            return status.code();
        }
        let master = pointers::object(master);
        if master.core.is_pending() {
            return Status::BUSY.code();
        }
        let storage = master.core.storage();
        // No words start where words were before, but not at NULL.
        if !response.is_null() {
            storage.response = response;
        }
        if !transmit.is_null() {
            storage.transmit = transmit;
        }
        storage.frame = frame;
        storage.response_words = responseWords as u8;
        storage.transmit_words = transmitWords as u8;
        // No frame of a master is longer.
        storage.frame_bytes = frameBytes.min(u8::MAX.into()) as u8;
        Status::OK.code()
    }
}

/// Moves a non-blocking request on, without waiting.
///
/// Call it as often as you like, at least once per character time of the line
/// if nothing else buffers its bytes.
///
/// @param master  the object
/// @return MBM_PENDING until the request has ended, then its status, again at
///         every call; MBM_OK if there was no request yet
#[no_mangle]
pub unsafe extern "C" fn mbm_master_poll(master: *mut mbm_master) -> u8 {
    // SAFETY: as the header demands.
    unsafe { poll(master) }
}

/// As [`mbm_master_poll`].
///
/// # Safety
/// As for [`pointers::with`].
#[cfg_attr(not(target_os = "none"), inline(always))]
unsafe extern "C" fn poll(master: *mut mbm_master) -> u8 {
    // SAFETY: as the caller promises.
    unsafe {
        match pointers::check(master) {
            Status::OK => calling(master, Core::poll),
            refused => refused,
        }
        .code()
    }
}

/// How long mbm_master_poll will find nothing to do unless a byte arrives, so
/// that a program or an idle hook may sleep until then. A wait that has just begun
/// counts from this call, so sleeping lengthens no timeout.
///
/// @param master  the object
/// @return microseconds; 0 means poll now, and is returned within a hook of the port
///         but `idle`; 0xFFFFFFFF that there is no request
#[no_mangle]
pub unsafe extern "C" fn mbm_master_pollDelay(master: *mut mbm_master) -> u32 {
    // SAFETY: as the header demands.
    unsafe {
        match pointers::check(master) {
            Status::OK => calling(master, Core::poll_delay),
            Status::BUSY => 0,
            _ => u32::MAX,
        }
    }
}

/// Gives up the request under way, with the driver switched off; its status
/// becomes MBM_CANCELLED. Without a request it does nothing.
///
/// @param master  the object
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_cancel(master: *mut mbm_master) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        let status = pointers::check(master);
        if status == Status::OK {
            calling(master, Core::cancel);
        }
        status.code()
    }
}

/// The status of the last request.
///
/// @param master  the object
/// @return MBM_PENDING while it is under way, MBM_OK if there was none;
///         MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_status(master: *const mbm_master) -> u8 {
    // SAFETY: as the header demands.
    unsafe { pointers::with(master.cast_mut(), |master| master.core.status()) }
}

/// The raw exception code of the last reply, also where it is none that the
/// standard allows (V1.1b3, 7).
///
/// @param master  the object
/// @return the code; 0 if the last request ended without an exception frame
#[no_mangle]
pub unsafe extern "C" fn mbm_master_getExceptionCode(master: *const mbm_master) -> u8 {
    // SAFETY: as the header demands.
    unsafe { pointers::ask(master, 0, |master| master.core.exception_code()) }
}

/// Requests the function `spec` with an address and a word and, in blocking mode, sees it through.
///
/// # Safety
/// As for [`pointers::with`].
unsafe fn call(pointer: *mut mbm_master, address: u16, word: u16, spec: MasterSpec) -> u8 {
    // SAFETY: as the caller promises.
    unsafe { request(pointer, |master| master.request(address, word, spec)) }
}

/// Starts a request and, in blocking mode, sees it through.
///
/// # Safety
/// As for [`pointers::with`].
unsafe fn request(pointer: *mut mbm_master, start: impl FnOnce(&mut Core) -> Status) -> u8 {
    // SAFETY: as the caller promises.
    unsafe {
        let status = pointers::with(pointer, |master| start(&mut master.core));
        finish(pointer, status)
    }
}

/// In blocking mode, polls a request until it has ended; calls the idle hook
/// where there is nothing to do.
///
/// # Safety
/// As for [`pointers::with`]; the status is what that master said last.
#[inline(never)]
unsafe fn finish(pointer: *mut mbm_master, mut status: u8) -> u8 {
    if status != Status::PENDING.code() {
        return status;
    }
    // SAFETY: pending, so begun. No reference lives while the hook is called,
    // for the hook may use the object, which `poll` looks at anew.
    unsafe {
        let blocking = !(*pointer.cast::<Object>()).non_blocking;
        while blocking && status == Status::PENDING.code() {
            status = poll(pointer);
            let core = Object::core_of(pointer);
            if (*core).is_waiting() {
                PortRef::idle((*core).port(), pointer);
            }
        }
    }
    status
}
