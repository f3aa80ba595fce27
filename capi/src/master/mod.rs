//! `mbm_master_*`: the master for C.

mod getters;
pub(crate) mod object;
mod requests;
mod settings;
mod turn;
mod values;
mod words;

pub use getters::*;
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
use mbm::FIRMWARE;

/// The fields in the storage of an `mbm_master`.
#[repr(C)]
pub(super) struct Object {
    mark: u8,
    non_blocking: bool,
    core: Core,
    /// The order of words in values: one of `MBM_ORDER_...`. It is the last field because few
    /// programs use it.
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
    /// The core of an object. It does not include the mark, which is read while the core is
    /// in use.
    ///
    /// # Safety
    /// `master` points to storage of an object, zeroed or begun.
    pub(super) unsafe fn core_of(master: *mut mbm_master) -> *mut Core {
        // SAFETY: as the caller promises.
        unsafe { &raw mut (*master.cast::<Object>()).core }
    }

    /// The core of the master.
    pub(super) fn core(&mut self) -> &mut Core {
        &mut self.core
    }
}

/// As [`pointers::check`], but makes zeroed storage a master with default settings, without
/// port and buffers.
///
/// # Safety
/// As for [`pointers::with`].
#[cfg_attr(target_os = "none", inline(never))]
pub(super) unsafe fn prepare(master: *mut mbm_master) -> Status {
    // SAFETY: as the caller promises; storage that was not begun is zeroed, and zero is a
    // valid value of every field.
    unsafe {
        match pointers::check(master) {
            Status::NOT_INITIALISED => {
                // Hosts tolerate storage that was not zeroed.
                if !FIRMWARE {
                    pointers::zero(master);
                }
                let object = mbm_master::access(master);
                object.core.set_slave(1);
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
pub(super) unsafe fn with_hooks<T>(
    master: *mut mbm_master,
    action: impl FnOnce(&mut Core) -> T,
) -> T {
    // SAFETY: begun, so every field is valid; exclusive, because the mark keeps every other
    // function from making a reference.
    unsafe { pointers::with_hooks(master, || action(&mut *Object::core_of(master))) }
}

/// Begins a master of RTU frames that sends its requests to a unit over a port.
///
/// It may be called again at any time, to use another unit or another port; this is cheap.
/// Settings, buffers and the words in them stay. The master discards what mbm_master_send
/// queued, and gives up a request under way with the status MBM_CANCELLED. It does not open
/// the port: that must be open already. The first request waits for no gap, unless bytes
/// arrive or mbm_master_lineUsed was called.
///
/// @param master  the object; initialised with MBM_INIT before the first call
/// @param slave   the unit identifier, 1 to 247; 0 is broadcast (serial line guide V1.02,
///                2.2). The master also sends to 248 to 255, which the standard reserves
/// @param port    the port. It is not copied: it must stay valid and unchanged for as long as
///                the object is used. read, write and micros must not be NULL
/// @return MBM_OK; MBM_INVALID_ARGUMENT for a NULL pointer or a missing hook; MBM_BUSY
///         from within a hook of this object's port except `idle`
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

/// As mbm_master_beginRtu, but with a separate context. Several objects can then share one
/// port, which may be a constant, and each object has its own context.
///
/// @param master   the object; initialised with MBM_INIT before the first call
/// @param slave    as for mbm_master_beginRtu
/// @param port     as for mbm_master_beginRtu; its `context` is not used
/// @param context  your pointer, passed to every hook; may be NULL
/// @return as for mbm_master_beginRtu
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
            with_hooks(master, |core| {
                core.begin(slave, |port_ref| port_ref.set(port, context));
            });
        }
        status.code()
    }
}

/// Sets the buffers for requests and replies, before or after mbm_master_beginRtu.
///
/// The buffers must not overlap, and must stay valid for as long as the object is used. A
/// frame buffer of MBM_FRAME_BYTES(words) bytes suffices for every request and reply with
/// that number of words. If a request or a reply does not fit into a smaller buffer, the
/// function that makes the request returns a status. Data are never cut off.
///
/// @param master         the object; initialised with MBM_INIT before the first call
/// @param response       the words that reads fill; NULL only if `responseWords` is 0
/// @param responseWords  0 to 255; 125 hold any reply
/// @param transmit       the words that writes send; NULL only if `transmitWords` is 0
/// @param transmitWords  0 to 255; 123 hold any request
/// @param frame          the buffer of one frame. Its content is not used between requests
/// @param frameBytes     bytes of `frame`, at least 8; 256 hold any frame
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
    let words = Given {
        response,
        response_words: responseWords,
        transmit,
        transmit_words: transmitWords,
    };
    if words.are_refused() || is_frame_refused(frame, frameBytes) {
        return Status::INVALID_ARGUMENT.code();
    }
    // SAFETY: as the header demands.
    unsafe {
        set_words(master, words, |storage| {
            storage.set_frame(frame, frameBytes)
        })
    }
}

/// Sets the words for requests and replies, as mbm_master_setBuffers does. The frame buffer stays
/// as it is.
///
/// @param master         the object; initialised with MBM_INIT before the first call
/// @param response       the words that reads fill; NULL only if `responseWords` is 0
/// @param responseWords  0 to 255; 125 hold any reply
/// @param transmit       the words that writes send; NULL only if `transmitWords` is 0
/// @param transmitWords  0 to 255; 123 hold any request
/// @return MBM_OK, MBM_INVALID_ARGUMENT, or MBM_BUSY while a request is under way
#[no_mangle]
pub unsafe extern "C" fn mbm_master_setWords(
    master: *mut mbm_master,
    response: *mut u16,
    responseWords: u16,
    transmit: *mut u16,
    transmitWords: u16,
) -> u8 {
    let words = Given {
        response,
        response_words: responseWords,
        transmit,
        transmit_words: transmitWords,
    };
    if words.are_refused() {
        return Status::INVALID_ARGUMENT.code();
    }
    // SAFETY: as the header demands.
    unsafe { set_words(master, words, |_| ()) }
}

/// The words that a caller gives.
struct Given {
    response: *mut u16,
    response_words: u16,
    transmit: *mut u16,
    transmit_words: u16,
}

impl Given {
    #[inline(always)]
    fn are_refused(&self) -> bool {
        (self.response.is_null() && self.response_words > 0)
            || (self.transmit.is_null() && self.transmit_words > 0)
            || (self.response_words | self.transmit_words) > 255
    }
}

/// True for a frame buffer that cannot hold an exception or a request of two words.
#[inline(always)]
fn is_frame_refused(frame: *mut u8, bytes: u16) -> bool {
    frame.is_null() || bytes < 8
}

/// Makes `words` those of a master, and changes its other buffers too.
///
/// # Safety
/// As for [`prepare`].
#[inline(always)]
unsafe fn set_words(
    master: *mut mbm_master,
    words: Given,
    others: impl FnOnce(&mut MasterBuffers),
) -> u8 {
    // SAFETY: as the caller promises.
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
        // An empty buffer keeps the earlier pointer, so that no pointer becomes NULL.
        if !words.response.is_null() {
            storage.response = words.response;
        }
        if !words.transmit.is_null() {
            storage.transmit = words.transmit;
        }
        storage.response_words = words.response_words as u8;
        storage.transmit_words = words.transmit_words as u8;
        others(storage);
        Status::OK.code()
    }
}

/// Sets the frame buffer, as mbm_master_setBuffers does. The master uses it only while a request
/// is under way. So in blocking mode it may lie on the stack of a function that sets it and makes
/// the request. Several masters may use one buffer in turn.
///
/// For a request of `n` words, MBM_FRAME_BYTES(2 * n) bytes are enough to hold a late reply beside
/// the right one.
///
/// @param master      the object, with words or begun
/// @param frame       the buffer of one frame
/// @param frameBytes  bytes of `frame`, at least 8; 256 hold any frame
/// @return MBM_OK, MBM_INVALID_ARGUMENT, MBM_NOT_INITIALISED, or MBM_BUSY while a request is under
///         way
#[no_mangle]
pub unsafe extern "C" fn mbm_master_setFrame(
    master: *mut mbm_master,
    frame: *mut u8,
    frameBytes: u16,
) -> u8 {
    if is_frame_refused(frame, frameBytes) {
        return Status::INVALID_ARGUMENT.code();
    }
    // SAFETY: as the header demands.
    unsafe {
        let status = pointers::check_once(master);
        if status != Status::OK {
            return status.code();
        }
        let core = pointers::object(master).core();
        if core.is_pending() {
            return Status::BUSY.code();
        }
        core.storage().set_frame(frame, frameBytes);
        Status::OK.code()
    }
}

/// Sends and receives for a non-blocking request, without waiting.
///
/// Call it as often as you like. If your port does not buffer received bytes, call it at
/// least once in the time of a character.
///
/// @param master  the object
/// @return MBM_PENDING until the request has ended. Then, at every call, the status of the
///         request. MBM_OK if there was no request yet; MBM_BUSY from within a hook of the
///         port except `idle`; MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
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
            Status::OK => with_hooks(master, Core::poll),
            refused => refused,
        }
        .code()
    }
}

/// Returns how long mbm_master_poll will have nothing to do unless a byte arrives. A program
/// or the hook `idle` may sleep for that time. A waiting time that has just started counts
/// from this call, so sleeping makes no timeout longer.
///
/// @param master  the object
/// @return microseconds; 0 means poll now, also from within a hook of the port except `idle`;
///         0xFFFFFFFF means that no request is under way
#[no_mangle]
pub unsafe extern "C" fn mbm_master_pollDelay(master: *mut mbm_master) -> u32 {
    // SAFETY: as the header demands.
    unsafe {
        match pointers::check(master) {
            Status::OK => with_hooks(master, Core::poll_delay),
            Status::BUSY => 0,
            _ => u32::MAX,
        }
    }
}

/// Gives up the request under way and switches the driver off. The status of the request
/// becomes MBM_CANCELLED. If no request is under way, it does nothing.
///
/// @param master  the object
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_cancel(master: *mut mbm_master) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        let status = pointers::check(master);
        if status == Status::OK {
            with_hooks(master, Core::cancel);
        }
        status.code()
    }
}

/// Returns the status of the last request.
///
/// @param master  the object
/// @return the status: MBM_PENDING while the request is under way, MBM_OK if there was no
///         request; MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_status(master: *const mbm_master) -> u8 {
    // SAFETY: as the header demands.
    unsafe { pointers::with(master.cast_mut(), |master| master.core.status()) }
}

/// Returns the exception code of the last reply as received, also a code that the standard
/// does not allow (V1.1b3, 7).
///
/// @param master  the object
/// @return the code; 0 if the last request ended without an exception
#[no_mangle]
pub unsafe extern "C" fn mbm_master_getExceptionCode(master: *const mbm_master) -> u8 {
    // SAFETY: as the header demands.
    unsafe { pointers::read(master, 0, |master| master.core.exception_code()) }
}

/// Starts a request that has an address and a word and, in blocking mode, polls until it has
/// ended.
///
/// # Safety
/// As for [`pointers::with`].
unsafe fn call(pointer: *mut mbm_master, address: u16, word: u16, spec: MasterSpec) -> u8 {
    // SAFETY: as the caller promises.
    unsafe { request(pointer, |master| master.request(address, word, spec)) }
}

/// Starts a request and, in blocking mode, polls until it has ended.
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

/// In blocking mode, polls until the request has ended, and calls the hook `idle` whenever
/// there is nothing to do.
///
/// # Safety
/// As for [`pointers::with`]; `status` is the one that the last call on that master returned.
#[inline(never)]
unsafe fn finish(pointer: *mut mbm_master, mut status: u8) -> u8 {
    if status != Status::PENDING.code() {
        return status;
    }
    // SAFETY: pending, so begun. No reference lives while the hook is called, because the
    // hook may use the object. `poll` checks the object again.
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
