//! `mbm_sniffer_*`: listening on a bus that others use.

use super::frame::mbm_framing;
use super::functions::{declared, mbm_function};
use super::packet::{mbm_packet, MBM_PACKET_REQUEST, MBM_PACKET_RESPONSE};
use super::pointers::{self, ask, buffer, get, lent_or_none, put, CObject, BEGUN};
use core::ffi::c_void;
use mbm::error::Status;
use mbm::explain::HEAD;
use mbm::frame::Framing;
use mbm::packet::Side;
use mbm::pdu::custom::{Function, Rule};
use mbm::sniffer::{Asked, Event, Kind, Sniffer, Tap, MIN_BUFFER};
use mbm::time::millis;

/// A request.
pub const MBM_EVENT_REQUEST: u8 = 0;
/// The reply to a request.
pub const MBM_EVENT_REPLY: u8 = 1;
/// The exception that answers a request.
pub const MBM_EVENT_EXCEPTION: u8 = 2;
/// A reply or exception to no request that waits for one: a late one, one whose
/// request was not seen, or one that does not answer what was asked.
pub const MBM_EVENT_UNPAIRED: u8 = 3;
/// A request that nobody answered within the timeout, or before the next request.
pub const MBM_EVENT_TIMEOUT: u8 = 4;
/// What looks like a frame, but has a wrong CRC or LRC, or too few bytes.
pub const MBM_EVENT_BAD_CRC: u8 = 5;
/// Bytes that are no frame.
pub const MBM_EVENT_NOISE: u8 = 6;

/// Heard on a line that carries both directions.
pub const MBM_TAP_BOTH: u8 = 0;
/// Heard where only the client sends.
pub const MBM_TAP_CLIENT: u8 = 1;
/// Heard where only servers send.
pub const MBM_TAP_SERVER: u8 = 2;

/// Least bytes of a sniffer's buffer.
pub const MBM_MIN_SNIFFER_BUFFER: u16 = 32;
/// Most functions of your own that a sniffer takes.
pub const MBM_MAX_SNIFFER_FUNCTIONS: u8 = 19;

const FUNCTIONS: usize = MBM_MAX_SNIFFER_FUNCTIONS as usize;

const _: () = {
    assert!(MBM_EVENT_REQUEST == Kind::Request as u8);
    assert!(MBM_EVENT_REPLY == Kind::Reply as u8);
    assert!(MBM_EVENT_EXCEPTION == Kind::Exception as u8);
    assert!(MBM_EVENT_UNPAIRED == Kind::Unpaired as u8);
    assert!(MBM_EVENT_TIMEOUT == Kind::Timeout as u8);
    assert!(MBM_EVENT_BAD_CRC == Kind::BadCrc as u8);
    assert!(MBM_EVENT_NOISE == Kind::Noise as u8);
    assert!(MBM_MIN_SNIFFER_BUFFER as usize == MIN_BUFFER);
};

/// A sniffer: finds the frames on a bus that others use, and pairs requests with
/// replies. It only listens, and has no port: you feed it what you hear.
///
/// Storage is yours and must be zero before first use, which a static object is.
/// Everything but mbm_sniffer_begin wants that before. Not re-entrant: use one
/// object from one thread and never from an interrupt; put an mbm_ring between.
#[repr(C)]
pub struct mbm_sniffer {
    /// Not for you.
    pointers: [*mut c_void; 1],
    /// Not for you.
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
    let room = size_of::<mbm_sniffer>();
    let used = size_of::<Object>();
    assert!(align_of::<mbm_sniffer>() >= align_of::<Object>());
    assert!(used <= room);
    // Hiding the fields may waste 5 % where RAM is scarce.
    assert!(size_of::<usize>() > 4 || (room - used) * 20 <= room);
};

/// Something that happened on the bus.
///
/// What it points to lies in the sniffer's buffer, and is valid until the next
/// call with that sniffer.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_event {
    /// The frame; of noise the bytes. An ASCII frame is decoded: unit, PDU, LRC.
    pub frame: *const u8,
    /// The PDU in the frame; NULL if there is none.
    pub pdu: *const u8,
    /// What the PDU says, as mbm_packet_parse tells it. If it cannot be read, of a
    /// timeout and of what is no frame: kind, unit, transaction and function alone.
    pub packet: mbm_packet,
    /// When its last byte arrived, in microseconds; of a timeout when the request
    /// was given up.
    pub time: u32,
    /// From the last byte of the request to the last byte of its reply, or until it
    /// was given up, in microseconds; else 0.
    pub responseTime: u32,
    /// Bytes of `frame`.
    pub frameLength: u16,
    /// Bytes of `pdu`.
    pub pduLength: u16,
    /// How many bytes on the line this was.
    pub length: u16,
    /// What this is about, also of a reply that does not say so itself: the first
    /// coil, input or register of the request; 17: that is read.
    pub address: u16,
    /// How many; 17: that are read.
    pub quantity: u16,
    /// One of MBM_EVENT_.
    pub kind: u8,
    /// MBM_OK; of a request the exception that a server answers to it; the code of
    /// an exception; MBM_MALFORMED_REPLY if a reply does not answer what was asked;
    /// MBM_RESPONSE_TIMED_OUT; MBM_INVALID_CRC; MBM_BUFFER_TOO_SMALL of noise that
    /// may have been a frame longer than the buffer.
    pub status: u8,
    /// The unit that is asked, or answers; of a bad CRC the byte in its place.
    pub unit: u8,
    /// The function code, of an exception that of the request; of a bad CRC the
    /// byte in its place.
    pub function: u8,
    /// The first bytes of the request's PDU, of replies and timeouts.
    pub asked: [u8; 9],
    /// How many those are; 0 if the request is not known.
    pub askedLength: u8,
}

const _: () = assert!(HEAD == 9);

impl mbm_event {
    /// What C sees of an event.
    fn of(event: &Event, functions: &[Function]) -> mbm_event {
        let side = match event.kind {
            Kind::Request | Kind::Timeout | Kind::BadCrc | Kind::Noise => Side::Request,
            _ => Side::Response,
        };
        let kind = match side {
            Side::Request => MBM_PACKET_REQUEST,
            Side::Response => MBM_PACKET_RESPONSE,
        };
        let mut packet = mbm_packet::of(kind, &[event.function]);
        if !matches!(event.kind, Kind::BadCrc | Kind::Noise) {
            // What cannot be read leaves the packet as it is.
            let _ = packet.take(side, event.pdu, functions);
        }
        packet.unit = event.unit;
        packet.transaction = event.transaction;
        let subject = event.subject();
        let mut asked = [0; HEAD];
        let head = event.asked.as_ref().map_or(&[][..], Asked::head);
        for (place, byte) in asked.iter_mut().zip(head) {
            *place = *byte;
        }
        mbm_event {
            frame: event.frame.as_ptr(),
            pdu: if event.pdu.is_empty() {
                core::ptr::null()
            } else {
                event.pdu.as_ptr()
            },
            packet,
            time: event.time,
            responseTime: event.response_time,
            frameLength: event.frame.len() as u16,
            pduLength: event.pdu.len() as u16,
            length: event.length.min(u16::MAX.into()) as u16,
            address: subject.map_or(0, |asked| asked.address()),
            quantity: subject.map_or(0, |asked| asked.quantity()),
            kind: event.kind as u8,
            status: event.status.code(),
            unit: event.unit,
            function: event.function,
            asked,
            askedLength: head.len() as u8,
        }
    }

    /// The event that C hands back.
    ///
    /// # Safety
    /// `frame` and `pdu` are NULL or point to their lengths' bytes.
    pub(super) unsafe fn told<'a>(&self) -> Result<Event<'a>, Status> {
        // SAFETY: as the caller promises.
        let (frame, pdu) = unsafe {
            (
                lent_or_none(self.frame, self.frameLength.into()),
                lent_or_none(self.pdu, self.pduLength.into()),
            )
        };
        let head = self.asked.get(..self.askedLength.into());
        let asked = head.map(Asked::new).filter(|_| self.askedLength > 0);
        Ok(Event {
            kind: Kind::from_code(self.kind).ok_or(Status::INVALID_ARGUMENT)?,
            status: Status::from_code(self.status),
            time: self.time,
            response_time: self.responseTime,
            transaction: self.packet.transaction,
            unit: self.unit,
            function: self.function,
            frame: frame.ok_or(Status::INVALID_ARGUMENT)?,
            pdu: pdu.ok_or(Status::INVALID_ARGUMENT)?,
            length: self.length.into(),
            asked,
        })
    }
}

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

/// Begins to listen. May be called again: what was heard is forgotten, and the
/// settings are as at first.
///
/// @param sniffer  the object
/// @param framing  how frames look; copied
/// @param buffer   where bytes are kept until they are understood; yours, valid
///                 for as long as the sniffer is used
/// @param size     its bytes, MBM_MIN_SNIFFER_BUFFER or more. MBM_MAX_FRAME hold
///                 any RTU frame, MBM_MAX_TCP_FRAME any of TCP,
///                 MBM_MAX_ASCII_FRAME any of ASCII; twice as many where the
///                 directions are heard apart. A longer frame is told of as noise
/// @return MBM_OK; MBM_BUFFER_TOO_SMALL; MBM_INVALID_ARGUMENT, also for more than
///         MBM_MAX_SNIFFER_FUNCTIONS functions
#[no_mangle]
pub unsafe extern "C" fn mbm_sniffer_begin(
    sniffer: *mut mbm_sniffer,
    framing: *const mbm_framing,
    buffer: *mut u8,
    size: u16,
) -> u8 {
    // SAFETY: as the header demands; storage of a sniffer has room for an object.
    unsafe {
        let make = || {
            let told = get(framing).ok_or(Status::INVALID_ARGUMENT)?;
            let framing = Framing::from_code(told.kind).ok_or(Status::INVALID_ARGUMENT)?;
            let functions = lent_or_none(told.functions, told.functionCount.into());
            let functions = all(functions.ok_or(Status::INVALID_ARGUMENT)?)?;
            if sniffer.is_null() || buffer.is_null() {
                return Err(Status::INVALID_ARGUMENT);
            }
            if usize::from(size) < MIN_BUFFER {
                return Err(Status::BUFFER_TOO_SMALL);
            }
            let mut core = Sniffer::new(framing);
            if told.end != 0 {
                core.set_end(told.end);
            }
            Ok(Object {
                buffer,
                size,
                mark: BEGUN,
                count: told.functionCount,
                functions,
                core,
            })
        };
        match make() {
            Ok(object) => put(sniffer.cast(), object),
            Err(refused) => refused.code(),
        }
    }
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
/// @param milliseconds  1 to 65535
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_sniffer_setTimeout(
    sniffer: *mut mbm_sniffer,
    milliseconds: u16,
) -> u8 {
    if milliseconds == 0 {
        return Status::INVALID_ARGUMENT.code();
    }
    // SAFETY: as the header demands.
    unsafe { with(sniffer, |core| core.set_timeout(millis(milliseconds))) }
}

/// Sets how long the rest of a frame that has begun is waited for: how coarse
/// your time stamps are. At first 50 ms in RTU, which a USB adapter needs, and
/// 1000 ms in ASCII and TCP.
///
/// @param sniffer       the object
/// @param milliseconds  1 to 65535
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_sniffer_setPatience(
    sniffer: *mut mbm_sniffer,
    milliseconds: u16,
) -> u8 {
    if milliseconds == 0 {
        return Status::INVALID_ARGUMENT.code();
    }
    // SAFETY: as the header demands.
    unsafe { with(sniffer, |core| core.set_patience(millis(milliseconds))) }
}

/// Takes bytes that were heard. Call mbm_sniffer_next until there is nothing
/// more, then feed the rest, if not all were taken, with the same time: nothing
/// is lost.
///
/// @param sniffer  the object
/// @param tap      MBM_TAP_BOTH, or where the directions are heard apart
///                 MBM_TAP_CLIENT or MBM_TAP_SERVER. Do not mix them: at a change
///                 what is not told of is forgotten
/// @param bytes    what was heard; NULL only with length 0
/// @param length   how many
/// @param now      when the last of them arrived, in microseconds; may wrap
/// @return how many were taken; 0 also if the sniffer was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_sniffer_feed(
    sniffer: *mut mbm_sniffer,
    tap: u8,
    bytes: *const u8,
    length: u16,
    now: u32,
) -> u16 {
    let tap = match tap {
        MBM_TAP_BOTH => Tap::Both,
        MBM_TAP_CLIENT => Tap::Client,
        MBM_TAP_SERVER => Tap::Server,
        _ => return 0,
    };
    // SAFETY: as the header demands; begin demands that the buffer is valid.
    unsafe {
        let bytes = lent_or_none(bytes, length.into());
        let Some(bytes) = bytes else { return 0 };
        ask(sniffer, 0, |object| {
            match buffer(object.buffer, object.size) {
                Some(buffer) => object.core.feed(buffer, tap, bytes, now) as u16,
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
/// @param now      the time, in microseconds
/// @param event    receives what happened; valid until the next call with this
///                 sniffer
/// @return 1 if there is an event; 0, with `event` unchanged, if nothing more is known
///         yet, or the sniffer was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_sniffer_next(
    sniffer: *mut mbm_sniffer,
    now: u32,
    event: *mut mbm_event,
) -> u8 {
    if event.is_null() {
        return 0;
    }
    // SAFETY: as the header demands; begin demands that the buffer is valid.
    unsafe {
        ask(sniffer, 0, |object| {
            if object.core.is_calm(now) || only_waits(object, now) {
                return 0;
            }
            next(object, now, event)
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
