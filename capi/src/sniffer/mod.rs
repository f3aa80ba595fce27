//! `mbm_sniffer_*`: reads the frames on a bus that others use.

mod event;

pub use event::*;

use crate::framing::is_delimiter;
use crate::functions::{declared, mbm_function};
use crate::pointers::{self, c_object, read, In, Out, BEGUN};
use core::ffi::c_void;
use mbm::error::{Error, Status};
use mbm::frame::Framing;
use mbm::pdu::custom::{Function, Rule};
use mbm::sniffer::{BusDirection, Sniffer, MIN_BUFFER};
use mbm::time::millis;

/// The bytes come from a line that carries both directions.
pub const MBM_DIRECTION_BOTH: u8 = 0;
/// The bytes come from a line or stream on which only the client sends.
pub const MBM_DIRECTION_CLIENT: u8 = 1;
/// The bytes come from a line or stream on which only servers send.
pub const MBM_DIRECTION_SERVER: u8 = 2;

/// The smallest buffer of a sniffer, in bytes.
pub const MBM_MIN_SNIFFER_BUFFER: u16 = 32;
/// The most functions of your declaration that a sniffer accepts.
pub const MBM_MAX_SNIFFER_FUNCTIONS: u8 = 19;

const FUNCTIONS: usize = MBM_MAX_SNIFFER_FUNCTIONS as usize;

const _: () = {
    assert!(MBM_MIN_SNIFFER_BUFFER as usize == MIN_BUFFER);
};

/// A sniffer: finds the frames on a bus that others use, and pairs requests with replies.
/// It never sends and has no port: you pass it the bytes that you receive.
///
/// You provide the storage. Initialise it with MBM_INIT. Call mbm_sniffer_begin first. Not
/// re-entrant: use one object from one thread, and never from an interrupt; pass bytes from an
/// interrupt through an mbm_ring.
#[repr(C)]
pub struct mbm_sniffer {
    /// Private.
    pointers: [*mut c_void; 1],
    /// Private.
    words: [u32; 171],
}

/// The real content of an `mbm_sniffer`.
#[repr(C)]
pub(super) struct Object {
    buffer: *mut u8,
    size: u16,
    mark: u8,
    count: u8,
    functions: [Function; FUNCTIONS],
    core: Sniffer,
}

impl Object {
    /// The buffer of received bytes.
    fn buffer<'a>(&self) -> Result<&'a mut [u8], Error> {
        // SAFETY: begin demands that it is valid, and only the sniffer uses it.
        unsafe { Out::new(self.buffer) }.buffer(self.size)
    }
}

c_object! { mbm_sniffer, &mut Object }

/// Changes the settings of a sniffer, or returns the status that says why not.
unsafe fn with(sniffer: *mut mbm_sniffer, change: impl FnOnce(&mut Sniffer)) -> u8 {
    pointers::change(sniffer, |object| change(&mut object.core))
}

const NO_FUNCTION: Function = Function {
    code: 0,
    request: Rule::Silence,
    response: Rule::Silence,
};

/// Converts the declarations of C to those of the core.
fn convert(functions: &[mbm_function]) -> Result<[Function; FUNCTIONS], Error> {
    let mut converted = [NO_FUNCTION; FUNCTIONS];
    if functions.len() > FUNCTIONS {
        return Err(Error::InvalidArgument);
    }
    for (place, function) in converted.iter_mut().zip(functions) {
        let declaration = declared(core::slice::from_ref(function), Some(function.code))?;
        *place = declaration.ok_or(Error::InvalidArgument)?;
    }
    Ok(converted)
}

/// Begins a sniffer for the frames on a serial line, or in a TCP stream.
///
/// You may call it again at any time. The sniffer then discards received bytes and
/// unanswered requests without an event, and its settings return to their defaults.
///
/// @param framing  MBM_FRAMING_RTU or MBM_FRAMING_ASCII for a serial line, MBM_FRAMING_TCP or
///                 MBM_FRAMING_RTU_OVER_TCP for a stream
/// @param buffer   holds received bytes until the sniffer has reported them; must stay valid for as
///                 long as the sniffer is used
/// @param size     size of `buffer` in bytes, at least MBM_MIN_SNIFFER_BUFFER. MBM_MAX_FRAME,
///                 MBM_MAX_ASCII_FRAME or MBM_MAX_TCP_FRAME holds every frame; with separate
///                 directions use twice as much. A longer frame becomes an event of kind
///                 MBM_EVENT_NOISE
/// @return a status; MBM_BUFFER_TOO_SMALL for a size that is too small; MBM_INVALID_ARGUMENT for
///         another framing
#[no_mangle]
pub unsafe extern "C" fn mbm_sniffer_begin(
    sniffer: *mut mbm_sniffer,
    framing: u8,
    buffer: *mut u8,
    size: u16,
) -> u8 {
    let Some(framing) = Framing::from_code(framing) else {
        return Status::INVALID_ARGUMENT.code();
    };
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
        functions: [NO_FUNCTION; FUNCTIONS],
        core: Sniffer::new(framing),
    };
    Out::new(sniffer).cast().put(object)
}

/// Declares functions that the standard does not define, in place of those declared
/// before. The sniffer does not know the length of an undeclared function: silence then
/// ends an RTU frame.
///
/// @param functions  an array that is copied; may be NULL if `count` is 0
/// @param count      how many functions, at most MBM_MAX_SNIFFER_FUNCTIONS
#[no_mangle]
pub unsafe extern "C" fn mbm_sniffer_setFunctions(
    sniffer: *mut mbm_sniffer,
    functions: In<mbm_function>,
    count: u8,
) -> u8 {
    pointers::with(sniffer, |object| {
        match functions.slice(count.into()).and_then(convert) {
            Ok(functions) => {
                object.functions = functions;
                object.count = count;
                Status::OK
            }
            Err(_) => Status::INVALID_ARGUMENT,
        }
    })
}

/// Sets the character that ends an ASCII frame after CR, LF at first; as
/// mbm_client_setDelimiter. It has no effect in other framings.
///
/// @param character  1 to 127, except CR, the colon and hexadecimal digits
#[no_mangle]
pub unsafe extern "C" fn mbm_sniffer_setDelimiter(sniffer: *mut mbm_sniffer, character: u8) -> u8 {
    if !is_delimiter(character) {
        return Status::INVALID_ARGUMENT.code();
    }
    with(sniffer, |core| core.set_end(character))
}

/// Sets the baud rate of a serial line. From it the sniffer computes the silence between
/// RTU frames, and the arrival time of each byte if you feed several at once. Without it
/// the silence is 4 ms, and all bytes of one feed count as received at the same time.
///
/// @param baud  bits per second; 0, the default, if the rate is unknown
#[no_mangle]
pub unsafe extern "C" fn mbm_sniffer_setBaudRate(sniffer: *mut mbm_sniffer, baud: u32) -> u8 {
    with(sniffer, |core| core.set_baud_rate(baud))
}

/// Sets how long the sniffer waits for the reply to a request before it reports
/// MBM_EVENT_TIMEOUT; 1000 ms at first. On a serial line the next request ends the wait
/// too. A timeout longer than the one of the client also pairs late replies with their
/// requests. For ten times the timeout, a reply to a request that has timed out is
/// reported as MBM_EVENT_UNPAIRED with the start of that request (requestHead).
///
/// @param timeoutMs  1 to 65535 ms
#[no_mangle]
pub unsafe extern "C" fn mbm_sniffer_setResponseTimeout(
    sniffer: *mut mbm_sniffer,
    timeoutMs: u32,
) -> u8 {
    let timeout = match u16::try_from(timeoutMs) {
        Ok(timeout) if timeout > 0 => millis(timeout),
        _ => return Status::INVALID_ARGUMENT.code(),
    };
    with(sniffer, |core| core.set_timeout(timeout))
}

/// Sets how long the sniffer waits for the rest of an incomplete frame. Choose it longer
/// than the error of your time stamps. At first it is 1000 ms in ASCII and TCP. In RTU and
/// RTU over TCP it is 50 ms, which suits a USB adapter, and the time of 130 characters, which
/// suits a UART that hands over 120 at a time: 199 ms at 9600 baud and while the rate is
/// unknown.
///
/// @param timeoutMs  1 to 65535 ms
#[no_mangle]
pub unsafe extern "C" fn mbm_sniffer_setFrameTimeout(
    sniffer: *mut mbm_sniffer,
    timeoutMs: u32,
) -> u8 {
    let timeout = match u16::try_from(timeoutMs) {
        Ok(timeout) if timeout > 0 => millis(timeout),
        _ => return Status::INVALID_ARGUMENT.code(),
    };
    with(sniffer, |core| core.set_frame_timeout(timeout))
}

/// Passes received bytes to the sniffer. Then call mbm_sniffer_next until it returns 0.
/// If the sniffer did not accept all bytes, feed the rest now with the same time; no byte
/// is lost.
///
/// @param direction  MBM_DIRECTION_BOTH; MBM_DIRECTION_CLIENT or MBM_DIRECTION_SERVER if you
///                   receive the directions separately. Do not mix MBM_DIRECTION_BOTH with the
///                   other two: on a change the sniffer discards the bytes that it has not reported
///                   yet
/// @param bytes      the received bytes; NULL only if `length` is 0
/// @param length     how many bytes
/// @param nowUs      arrival time of the last of the bytes, in microseconds; may wrap
/// @return how many bytes the sniffer accepted; 0 also for a sniffer that was never begun, or for
///         an invalid argument
#[no_mangle]
pub unsafe extern "C" fn mbm_sniffer_feed(
    sniffer: *mut mbm_sniffer,
    direction: u8,
    bytes: In<u8>,
    length: u16,
    nowUs: u32,
) -> u16 {
    let direction = match direction {
        MBM_DIRECTION_BOTH => BusDirection::Both,
        MBM_DIRECTION_CLIENT => BusDirection::Client,
        MBM_DIRECTION_SERVER => BusDirection::Server,
        _ => return 0,
    };
    let Ok(bytes) = bytes.slice(length.into()) else {
        return 0;
    };
    read(sniffer, 0, |object| match object.buffer() {
        Ok(buffer) => object.core.feed(buffer, direction, bytes, nowUs) as u16,
        Err(_) => 0,
    })
}

/// Returns the next event on the bus, in order of time. Call it after each feed until it
/// returns 0. Call it also while no bytes arrive, at least every half hour: silence ends
/// frames, and requests time out.
///
/// On a Cortex-M it takes 750 bytes of stack.
///
/// @param nowUs  the time now, in microseconds; may wrap
/// @param event  receives the event; the data that it points to are valid until the next call with
///               this sniffer
/// @return 1 if there is an event. 0, with `event` unchanged, if there is none yet, for NULL, and
///         for a sniffer that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_sniffer_next(
    sniffer: *mut mbm_sniffer,
    nowUs: u32,
    event: Out<mbm_event>,
) -> u8 {
    if event.is_null() {
        return 0;
    }
    read(sniffer, 0, |object| {
        if object.core.is_idle(nowUs) {
            return 0;
        }
        next(object, nowUs, event)
    })
}

/// [`mbm_sniffer_next`] for the case that the sniffer has to examine data. A function of
/// its own, so that a call without an event does not save the registers that this one
/// needs. (In line, the frame of mbm_sniffer_next is too large for LLVM on an ESP32.)
#[inline(never)]
fn next(object: &mut Object, now: u32, event: Out<mbm_event>) -> u8 {
    let Ok(buffer) = object.buffer() else {
        return 0;
    };
    let functions = object.functions.get(..object.count.into());
    let functions = functions.unwrap_or_default();
    match object.core.next(buffer, functions, now) {
        Some(found) => {
            event.put(mbm_event::from_event(&found, functions));
            1
        }
        None => 0,
    }
}
