//! `mbm_sniffer_*`: listening on a bus that others use.

mod event;

pub use event::*;

use crate::framing::is_delimiter;
use crate::functions::{declared, mbm_function};
use crate::pointers::{self, array_or_empty, buffer, put, read, CObject, BEGUN};
use core::ffi::c_void;
use mbm::error::Status;
use mbm::frame::Framing;
use mbm::pdu::custom::{Function, Rule};
use mbm::sniffer::{BusDirection, Sniffer, MIN_BUFFER};
use mbm::time::millis;

/// Heard on a line that carries both directions.
pub const MBM_DIRECTION_BOTH: u8 = 0;
/// Heard where only the client sends.
pub const MBM_DIRECTION_CLIENT: u8 = 1;
/// Heard where only servers send.
pub const MBM_DIRECTION_SERVER: u8 = 2;

/// Least bytes of a sniffer's buffer.
pub const MBM_MIN_SNIFFER_BUFFER: u16 = 32;
/// Most functions of your own that a sniffer takes.
pub const MBM_MAX_SNIFFER_FUNCTIONS: u8 = 19;

const FUNCTIONS: usize = MBM_MAX_SNIFFER_FUNCTIONS as usize;

const _: () = {
    assert!(MBM_MIN_SNIFFER_BUFFER as usize == MIN_BUFFER);
};

/// A sniffer: finds the frames on a bus that others use, and pairs requests with
/// replies. It only listens, and has no port: you feed it what you hear.
///
/// Storage is yours and must be zero before first use, which a static object is.
/// One of the mbm_sniffer_begin functions comes first. Not re-entrant: use one
/// object from one thread and never from an interrupt; put an mbm_ring between.
#[repr(C)]
pub struct mbm_sniffer {
    /// Private.
    pointers: [*mut c_void; 1],
    /// Private.
    words: [u32; 171],
}

/// What lies behind an `mbm_sniffer`.
#[repr(C)]
pub(super) struct Object {
    buffer: *mut u8,
    size: u16,
    mark: u8,
    count: u8,
    functions: [Function; FUNCTIONS],
    core: Sniffer,
}

const _: () = {
    let space = size_of::<mbm_sniffer>();
    let used = size_of::<Object>();
    assert!(align_of::<mbm_sniffer>() >= align_of::<Object>());
    assert!(used <= space);
    // Hiding the fields may waste 5 % where RAM is scarce.
    assert!(size_of::<usize>() > 4 || (space - used) * 20 <= space);
};

// SAFETY: the mark is a field of its own.
unsafe impl CObject for mbm_sniffer {
    type Access<'a> = &'a mut Object;

    unsafe fn mark(sniffer: *const mbm_sniffer) -> *mut u8 {
        // SAFETY: as the caller promises; every object is writable storage.
        unsafe { &raw mut (*sniffer.cast::<Object>().cast_mut()).mark }
    }

    unsafe fn access<'a>(sniffer: *mut mbm_sniffer) -> &'a mut Object {
        // SAFETY: begun, so every field is valid; exclusive as the caller promises.
        unsafe { &mut *sniffer.cast() }
    }
}

/// Changes a sniffer, or says why not.
///
/// # Safety
/// As for [`pointers::with`].
unsafe fn with(sniffer: *mut mbm_sniffer, change: impl FnOnce(&mut Sniffer)) -> u8 {
    // SAFETY: as the caller promises.
    unsafe {
        pointers::with(sniffer, |object| {
            change(&mut object.core);
            Status::OK
        })
    }
}

const NOTHING: Function = Function {
    code: 0,
    request: Rule::Silence,
    response: Rule::Silence,
};

/// What C declares, as the core keeps it.
fn all(functions: &[mbm_function]) -> Result<[Function; FUNCTIONS], Status> {
    let mut kept = [NOTHING; FUNCTIONS];
    if functions.len() > FUNCTIONS {
        return Err(Status::INVALID_ARGUMENT);
    }
    for (place, function) in kept.iter_mut().zip(functions) {
        let own = declared(core::slice::from_ref(function), Some(function.code))?;
        *place = own.ok_or(Status::INVALID_ARGUMENT)?;
    }
    Ok(kept)
}

/// Makes a sniffer out of storage.
///
/// # Safety
/// As the header demands of the begin functions.
unsafe fn begin(sniffer: *mut mbm_sniffer, buffer: *mut u8, size: u16, framing: Framing) -> u8 {
    if sniffer.is_null() || buffer.is_null() {
        return Status::INVALID_ARGUMENT.code();
    }
    if usize::from(size) < MIN_BUFFER {
        return Status::BUFFER_TOO_SMALL.code();
    }
    let object = Object {
        buffer,
        size,
        mark: BEGUN,
        count: 0,
        functions: [NOTHING; FUNCTIONS],
        core: Sniffer::new(framing),
    };
    // SAFETY: storage of a sniffer has room for an object.
    unsafe { put(sniffer.cast(), object) }
}

/// Begins to listen to RTU frames on a serial line.
///
/// May be called again at any time: received bytes, and a request that still waits for its
/// reply, are forgotten without an event, and the settings are as at first.
///
/// @param sniffer  the object; zeroed before the first call
/// @param buffer   where bytes are kept until they are understood; yours, valid
///                 for as long as the sniffer is used
/// @param size     its bytes, MBM_MIN_SNIFFER_BUFFER or more. MBM_MAX_FRAME hold any
///                 frame, twice as many where the directions are fed apart. A longer
///                 frame becomes an event of kind MBM_EVENT_NOISE
/// @return MBM_OK; MBM_BUFFER_TOO_SMALL or MBM_INVALID_ARGUMENT, with nothing changed
#[no_mangle]
pub unsafe extern "C" fn mbm_sniffer_beginRtu(
    sniffer: *mut mbm_sniffer,
    buffer: *mut u8,
    size: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { begin(sniffer, buffer, size, Framing::Rtu) }
}

/// Begins to listen to ASCII frames on a serial line.
///
/// @param sniffer  see mbm_sniffer_beginRtu
/// @param buffer   see mbm_sniffer_beginRtu
/// @param size     see mbm_sniffer_beginRtu; MBM_MAX_ASCII_FRAME hold any frame
/// @return a status; see mbm_sniffer_beginRtu
#[no_mangle]
pub unsafe extern "C" fn mbm_sniffer_beginAscii(
    sniffer: *mut mbm_sniffer,
    buffer: *mut u8,
    size: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { begin(sniffer, buffer, size, Framing::Ascii) }
}

/// Begins to listen to a TCP stream, in frames with the MBAP header.
///
/// @param sniffer  see mbm_sniffer_beginRtu
/// @param buffer   see mbm_sniffer_beginRtu
/// @param size     see mbm_sniffer_beginRtu; MBM_MAX_TCP_FRAME hold any frame
/// @return a status; see mbm_sniffer_beginRtu
#[no_mangle]
pub unsafe extern "C" fn mbm_sniffer_beginTcp(
    sniffer: *mut mbm_sniffer,
    buffer: *mut u8,
    size: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { begin(sniffer, buffer, size, Framing::Tcp) }
}

/// Begins to listen to a TCP stream of RTU frames.
///
/// @param sniffer  see mbm_sniffer_beginRtu
/// @param buffer   see mbm_sniffer_beginRtu
/// @param size     see mbm_sniffer_beginRtu; MBM_MAX_FRAME hold any frame
/// @return a status; see mbm_sniffer_beginRtu
#[no_mangle]
pub unsafe extern "C" fn mbm_sniffer_beginRtuOverTcp(
    sniffer: *mut mbm_sniffer,
    buffer: *mut u8,
    size: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { begin(sniffer, buffer, size, Framing::RtuOverTcp) }
}

/// Declares functions that the standard does not have. Without that their length is
/// guessed: silence ends an RTU frame.
///
/// @param sniffer    the object
/// @param functions  copied; may be NULL if there are none
/// @param count      how many, at most MBM_MAX_SNIFFER_FUNCTIONS
/// @return MBM_OK, MBM_NOT_INITIALISED, or MBM_INVALID_ARGUMENT with nothing changed
#[no_mangle]
pub unsafe extern "C" fn mbm_sniffer_setFunctions(
    sniffer: *mut mbm_sniffer,
    functions: *const mbm_function,
    count: u8,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        pointers::with(sniffer, |object| {
            match array_or_empty(functions, count.into()).map(all) {
                Some(Ok(functions)) => {
                    object.functions = functions;
                    object.count = count;
                    Status::OK
                }
                _ => Status::INVALID_ARGUMENT,
            }
        })
    }
}

/// Sets the character that ends ASCII frames after CR, in place of LF, as
/// mbm_client_setDelimiter. Without effect in other framings.
///
/// @param sniffer    the object
/// @param character  1 to 127, but CR, the colon and hexadecimal digits
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_sniffer_setDelimiter(sniffer: *mut mbm_sniffer, character: u8) -> u8 {
    if !is_delimiter(character) {
        return Status::INVALID_ARGUMENT.code();
    }
    // SAFETY: as the header demands.
    unsafe { with(sniffer, |core| core.set_end(character)) }
}

/// Tells the rate of a serial line, from which follow the silence between RTU
/// frames, and when each of several bytes that are fed at once arrived. At first
/// it is untold: 4 ms of silence, and what is fed at once arrived at once.
///
/// @param sniffer  the object
/// @param baud     bits per second; 0 is untold
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_sniffer_setBaudRate(sniffer: *mut mbm_sniffer, baud: u32) -> u8 {
    // SAFETY: as the header demands.
    unsafe { with(sniffer, |core| core.set_baud_rate(baud)) }
}

/// Sets how long a request may stay unanswered before that is told; 1000 ms at
/// first. On a serial line the next request ends it too. A longer time than the
/// master's own pairs late replies. For ten times as long, a reply to a request
/// that was given up is still told with what was asked, as MBM_EVENT_UNPAIRED.
///
/// @param sniffer       the object
/// @param timeoutMs     1 to 65535
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_sniffer_setResponseTimeout(
    sniffer: *mut mbm_sniffer,
    timeoutMs: u16,
) -> u8 {
    if timeoutMs == 0 {
        return Status::INVALID_ARGUMENT.code();
    }
    // SAFETY: as the header demands.
    unsafe { with(sniffer, |core| core.set_timeout(millis(timeoutMs))) }
}

/// Sets how long the rest of a frame that has begun is waited for: how coarse
/// your time stamps are. At first 50 ms in RTU, which a USB adapter needs, and
/// 1000 ms in ASCII and TCP.
///
/// @param sniffer       the object
/// @param timeoutMs     1 to 65535
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_sniffer_setFrameTimeout(
    sniffer: *mut mbm_sniffer,
    timeoutMs: u16,
) -> u8 {
    if timeoutMs == 0 {
        return Status::INVALID_ARGUMENT.code();
    }
    // SAFETY: as the header demands.
    unsafe { with(sniffer, |core| core.set_frame_timeout(millis(timeoutMs))) }
}

/// Takes bytes that were heard. Call mbm_sniffer_next until there is nothing
/// more, then feed the rest, if not all were taken, with the same time: nothing
/// is lost.
///
/// @param sniffer  the object
/// @param direction  MBM_DIRECTION_BOTH, or where the directions are heard apart
///                 MBM_DIRECTION_CLIENT or MBM_DIRECTION_SERVER. Do not mix them: at a change
///                 what is not told of is forgotten
/// @param bytes    what was heard; NULL only with length 0
/// @param length   how many
/// @param nowUs    when the last of them arrived, in microseconds; may wrap
/// @return how many were taken; 0 also if the sniffer was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_sniffer_feed(
    sniffer: *mut mbm_sniffer,
    direction: u8,
    bytes: *const u8,
    length: u16,
    nowUs: u32,
) -> u16 {
    let direction = match direction {
        MBM_DIRECTION_BOTH => BusDirection::Both,
        MBM_DIRECTION_CLIENT => BusDirection::Client,
        MBM_DIRECTION_SERVER => BusDirection::Server,
        _ => return 0,
    };
    // SAFETY: as the header demands; begin demands that the buffer is valid.
    unsafe {
        let bytes = array_or_empty(bytes, length.into());
        let Some(bytes) = bytes else { return 0 };
        read(sniffer, 0, |object| {
            match buffer(object.buffer, object.size) {
                Some(buffer) => object.core.feed(buffer, direction, bytes, nowUs) as u16,
                None => 0,
            }
        })
    }
}

/// Tells what happened next on the bus, in the order of time. Call it after each
/// feed until there is nothing more, and now and then while nothing is heard (at
/// least every half hour): silence ends frames, and requests time out.
///
/// @param sniffer  the object
/// @param nowUs    the time, in microseconds
/// @param event    receives what happened; valid until the next call with this
///                 sniffer
/// @return 1 if there is an event; 0, with `event` unchanged, if nothing more is known
///         yet, or the sniffer was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_sniffer_next(
    sniffer: *mut mbm_sniffer,
    nowUs: u32,
    event: *mut mbm_event,
) -> u8 {
    if event.is_null() {
        return 0;
    }
    // SAFETY: as the header demands; begin demands that the buffer is valid.
    unsafe {
        read(sniffer, 0, |object| {
            if object.core.is_idle(nowUs) || only_waits(object, nowUs) {
                return 0;
            }
            next(object, nowUs, event)
        })
    }
}

/// True if there is nothing to tell of, and nothing more to look for: see
/// [`Sniffer::only_waits`].
///
/// # Safety
/// The object was begun with a buffer that is valid.
unsafe fn only_waits(object: &mut Object, now: u32) -> bool {
    // SAFETY: as the caller promises.
    let buffer = unsafe { buffer(object.buffer, object.size) };
    let functions = object.functions.get(..object.count.into());
    let core = &mut object.core;
    buffer.is_none_or(|buffer| core.only_waits(buffer, functions.unwrap_or_default(), now))
}

/// As [`mbm_sniffer_next`], where the sniffer has to look. On its own, for a call
/// that has nothing to tell is not to pay for the registers and the stack of one that
/// has.
///
/// # Safety
/// The object was begun with a buffer that is valid, `event` points to room for one.
#[inline(never)]
unsafe fn next(object: &mut Object, now: u32, event: *mut mbm_event) -> u8 {
    // SAFETY: as the caller promises.
    unsafe {
        let Some(buffer) = buffer(object.buffer, object.size) else {
            return 0;
        };
        let functions = object.functions.get(..object.count.into());
        let functions = functions.unwrap_or_default();
        match object.core.look(buffer, functions, now) {
            Some(told) => {
                put(event, mbm_event::of(&told, functions));
                1
            }
            None => 0,
        }
    }
}
